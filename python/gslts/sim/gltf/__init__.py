"""Homes in glTF files."""
