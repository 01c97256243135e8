"""Localization: the camera pose of an image in a map, with and without a prior."""
