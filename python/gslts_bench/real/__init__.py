"""Change detection on recorded visits of real rooms, whose changed objects are marked by boxes."""
