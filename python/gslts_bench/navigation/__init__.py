"""Benchmark of navigation to objects."""
