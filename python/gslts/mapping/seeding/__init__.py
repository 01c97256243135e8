"""First Gaussians of a map: from depth, from triangulated points, in holes of the depth."""
