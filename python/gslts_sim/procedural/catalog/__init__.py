"""Builders of objects.

Each builder samples a `Model` in a frame with z up and its front towards -y.
"""
