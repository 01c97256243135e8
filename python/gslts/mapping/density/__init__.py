"""Density control: split, merge and join Gaussians, and weigh them by what images show."""
