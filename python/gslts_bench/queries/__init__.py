"""Benchmark of queries: objects are found in semantic maps by their names."""
