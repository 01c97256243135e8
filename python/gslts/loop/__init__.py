"""A map that keeps itself up to date: rounds, the watch on them, and what is waiting."""
