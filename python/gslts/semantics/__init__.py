"""Semantic features of Gaussians and text queries on them (GS-LTS, sec. III-B)."""
