"""Benchmark of scale: what a frame of one room costs in maps of more and more rooms."""
