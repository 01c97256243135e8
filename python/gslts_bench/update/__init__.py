"""Benchmark of map updates."""
