"""Differentiable rendering of Gaussian maps, losses, the optimizer and image metrics."""
