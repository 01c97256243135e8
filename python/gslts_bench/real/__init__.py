"""Change detection on recorded visits of real rooms, whose changed objects people marked."""
