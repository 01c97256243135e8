"""Benchmark of change detection."""
