"""Poses of the frames of a recording, estimated from its RGB-D images."""
