"""Accuracy of a map on validation and test frames."""
