"""Recorded data sets of posed images, in the formats of other projects."""

from gslts.datasets.dataset import Dataset, Frame, PointCloud
from gslts.datasets.registry import FORMATS, open_dataset

__all__ = ["FORMATS", "Dataset", "Frame", "PointCloud", "open_dataset"]
