"""Simulated homes, their sensors, a robot in them, and changes of the scene."""
