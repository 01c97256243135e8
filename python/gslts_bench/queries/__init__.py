"""Benchmark of text queries."""
