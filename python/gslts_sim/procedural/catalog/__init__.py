"""Builders of things: each takes a `Kit` and returns a `Model`."""
