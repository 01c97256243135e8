"""Benchmark of extensions: a home recorded part by part, against one map of all frames."""
