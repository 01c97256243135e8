"""Commands of the benchmarks: `gslts bench`, `gslts tradeoff` and `gslts demo`."""
