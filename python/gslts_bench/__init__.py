"""Benchmarks of the stages of gslts, on simulated homes and recorded rooms."""
