"""Consolidation: refines what updates touched, by views of a robot that has time."""
