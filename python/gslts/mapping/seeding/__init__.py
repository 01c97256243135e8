"""Seeding of Gaussians: from depth, from triangulated points, and in holes of the depth."""
