"""Builders of objects.

Each builder returns a `Model` in a frame with z up and its front towards -y, drawn from a random
stream.

Args of all builders:
    kit: Materials, style and random stream of the home.
"""
