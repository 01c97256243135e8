"""Pictures as an MP4 video."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from gslts.io.images import Picture

FRAMES_PER_S = 25


class Video:
    """A video in MPEG-4, which is there as a whole once its `with` block ends without an error.

    Args:
        path: Ends in .mp4.
        width: px.
        height: px. Odd sides lose their last column or row: the format has even ones only.

    Raises:
        OSError: The file cannot be written, or, at the end, was not written whole.
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
        self._temporary.touch()  # OpenCV does not say why it cannot write.
        code = cv2.VideoWriter.fourcc(*"mp4v")
        self._writer = cv2.VideoWriter(str(self._temporary), code, FRAMES_PER_S, self._size)
        if not self._writer.isOpened():
            self._temporary.unlink(missing_ok=True)  # OpenCV may have removed it.
            raise OSError(f"{path}: the disk is full, or OpenCV cannot write MPEG-4 videos")

    def add(self, picture: Picture) -> None:
        """Adds a picture of the video's size."""
        width, height = self._size
        # OpenCV wants blue first.
        self._writer.write(np.ascontiguousarray(picture[:height, :width, ::-1]))
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
                self._require_whole()
                self._temporary.replace(self._path)
        finally:
            self._temporary.unlink(missing_ok=True)

    def _require_whole(self) -> None:
        """Reads what was written: OpenCV says nothing of a full disk."""
        import cv2

        written = cv2.VideoCapture(str(self._temporary))
        found = 0
        while written.grab():  # The number in the header would not tell of pictures that are gone.
            found += 1
        written.release()
        if found != self._added or found == 0:
            raise OSError(
                f"{self._path}: it was not written whole, as on a full disk: {found} of "
                f"{self._added} pictures are in it"
            )
