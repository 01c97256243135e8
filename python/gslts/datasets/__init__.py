"""Recorded data sets of posed images, in the formats of other projects."""

from gslts.datasets.dataset import Dataset, Frame
from gslts.datasets.registry import FORMATS, open_dataset

__all__ = ["FORMATS", "Dataset", "Frame", "open_dataset"]
