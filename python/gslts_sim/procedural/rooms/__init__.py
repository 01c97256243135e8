"""Furnishing of a kitchen, a living room and a bedroom."""
