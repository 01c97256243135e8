"""Keeps a map up to date: rounds of a robot, watch for changes, updates, history."""
