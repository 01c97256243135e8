"""Benchmark of relocalization."""
