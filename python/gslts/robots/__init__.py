"""Robots behind the protocol of `gslts.core.robot`: recorded, inside a map, localized."""
