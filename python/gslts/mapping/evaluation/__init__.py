"""Accuracy of a map on frames it was not made from."""
