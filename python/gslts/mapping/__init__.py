"""Gaussian Mapping Engine: from posed RGB-D frames to a map."""
