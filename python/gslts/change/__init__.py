"""Change detection: objects that differ between a map and the frames of a robot (GS-LTS III-C)."""
