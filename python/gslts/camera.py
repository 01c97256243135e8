"""Pinhole cameras and their poses."""

from gslts._core.map import Camera, camera_from_fov, look_at

__all__ = ["Camera", "camera_from_fov", "look_at"]
