"""Extension of a map by recordings of space that it does not know."""
