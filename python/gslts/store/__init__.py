"""Versions of a map on the disk, each by what it changed."""
