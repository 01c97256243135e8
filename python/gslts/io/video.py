"""MP4 videos of images."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from gslts.io.images import RgbImage

FRAMES_PER_S = 25
"""Frame rate of videos."""


class Video:
    """Writes an MPEG-4 video; the file appears when its `with` block ends without an error.

    Args:
        path: File that ends in .mp4.
        width: px.
        height: px. Odd sides lose their last column or row: the format allows even sides only.

    Raises:
        OSError: The file cannot be written, or, at the end, is not complete.
        ValueError: A side is below 2 px.
    """

    def __init__(self, path: Path, width: int, height: int) -> None:
        import cv2

        if min(width, height) < 2:
            raise ValueError(f"{path}: a video has at least 2 x 2 px, not {width} x {height}")
        self._path = path
        self._size = (width // 2 * 2, height // 2 * 2)
        self._added = 0
        self._temporary = path.with_name(f".{path.stem}.{os.getpid()}.part.mp4")
        self._temporary.touch()  # Raises the reason, which OpenCV does not report.
        code = cv2.VideoWriter.fourcc(*"mp4v")
        self._writer = cv2.VideoWriter(str(self._temporary), code, FRAMES_PER_S, self._size)
        if not self._writer.isOpened():
            self._temporary.unlink(missing_ok=True)  # OpenCV may have removed it.
            raise OSError(f"{path}: the disk is full, or OpenCV cannot write MPEG-4 videos")

    def add(self, image: RgbImage) -> None:
        """Add an image.

        Args:
            image: [H,W,3] uint8, of the size of the video.
        """
        width, height = self._size
        # OpenCV stores blue first.
        self._writer.write(np.ascontiguousarray(image[:height, :width, ::-1]))
        self._added += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._writer.release()
        try:
            if error is None:
                self._require_complete()
                self._temporary.replace(self._path)
        finally:
            self._temporary.unlink(missing_ok=True)

    def _require_complete(self) -> None:
        """Read the file back: OpenCV does not report a full disk."""
        import cv2

        reader = cv2.VideoCapture(str(self._temporary))
        count = 0
        while reader.grab():  # The count in the header also has images that were not written.
            count += 1
        reader.release()
        if count != self._added or count == 0:
            raise OSError(
                f"{self._path}: {count} of {self._added} images were written; is the disk full?"
            )
