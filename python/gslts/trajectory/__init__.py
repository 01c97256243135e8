"""Poses of the frames of a recording, estimated from its images."""
