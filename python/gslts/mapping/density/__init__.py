"""Number of Gaussians: split, merge, prune."""
