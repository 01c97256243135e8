"""Frames of a robot that works: sent by its process, and read by that of the viewer."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gslts.core.camera import Camera, downscale
from gslts.core.frame import RgbdFrame, halve_rgb
from gslts.io.image_files import decode_rgb, encode_jpeg
from gslts.io.images import RgbImage

MAX_WIDTH_PX = 400
"""Width above which images are halved: that of the panel."""
JPEG_QUALITY = 80
"""Of the images; 320 x 240 pixels take about 15 kB."""
PERIOD_S = 0.5
"""Time between two frames that are sent, s."""
MAX_HEADER_BYTES, MAX_JPEG_BYTES = 1 << 16, 1 << 20
"""Maximum sizes of the two parts of a message."""
MAX_LINES, MAX_LINE = 20, 200
"""Maximum number of lines of text, and of characters of a line."""


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """A frame that a robot took just now.

    Attributes:
        rgb: [H,W,3] uint8, sRGB.
        camera: Camera in the world of the map; None while the robot is lost.
        lines: State of the robot and of its map, in words.
    """

    rgb: RgbImage
    camera: Camera | None
    lines: tuple[str, ...]


class LiveFeed:
    """Sends the newest frame of a robot from a thread of its own; the robot never waits for it.

    A context manager. Once nobody reads the stream, it sends nothing more.

    Args:
        stream: Standard input of the viewer, in binary.
    """

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._newest: tuple[RgbdFrame, Callable[[], Sequence[str]]] | None = None
        self._is_due = False
        self._changed, self._closing = threading.Condition(), threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        with self._changed:
            self._changed.notify()
        self._thread.join()
        with suppress(OSError):  # The viewer was closed, and what was written last is lost.
            self._stream.close()

    def show(self, frame: RgbdFrame, describe: Callable[[], Sequence[str]]) -> None:
        """Send a frame soon, unless a newer one comes first.

        Args:
            frame: Its pose is in the world of the map; with a fault, none is sent.
            describe: Returns the state of the robot and of its map in words; called from the
                thread of the feed, for frames that are sent.
        """
        with self._changed:
            self._newest = frame, describe
            self._is_due = True
            self._changed.notify()

    def repeat(self) -> None:
        """Send the newest frame again soon, as the state of the robot has changed."""
        with self._changed:
            self._is_due = self._newest is not None
            self._changed.notify()

    def _work(self) -> None:
        while not self._closing.is_set():
            with self._changed:
                self._changed.wait_for(lambda: self._is_due or self._closing.is_set())
                newest, self._is_due = self._newest, False
            if newest is None:
                return
            try:
                frame, describe = newest
                self._stream.write(_encode(frame, describe()))
                self._stream.flush()
            except (OSError, ValueError):  # The viewer was closed.
                return
            self._closing.wait(PERIOD_S)


def read_live_frames(stream: IO[bytes]) -> Iterator[LiveFrame]:
    """Read the frames that a `LiveFeed` sends, until the stream ends.

    Args:
        stream: In binary.

    Yields:
        The frames.

    Raises:
        ValueError: The stream holds something else.
    """
    while line := stream.readline(MAX_HEADER_BYTES):
        header = _Header.model_validate_json(line)
        rgb = decode_rgb(stream.read(header.jpeg_bytes), (header.height, header.width))
        yield LiveFrame(rgb, header.camera(), header.lines)


class _Header(BaseModel):
    """First part of a message, a line of JSON; the image follows as JPEG."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    fx: Annotated[FiniteFloat, Field(gt=0)]
    fy: Annotated[FiniteFloat, Field(gt=0)]
    cx: FiniteFloat
    cy: FiniteFloat
    width: Annotated[int, Field(ge=1, le=MAX_WIDTH_PX)]
    height: Annotated[int, Field(ge=1, le=2 * MAX_WIDTH_PX)]
    world_from_camera: Annotated[list[FiniteFloat], Field(min_length=16, max_length=16)] | None
    lines: Annotated[tuple[str, ...], Field(max_length=MAX_LINES)]
    jpeg_bytes: Annotated[int, Field(ge=1, le=MAX_JPEG_BYTES)]

    def camera(self) -> Camera | None:
        """Return the camera of the image, if its pose is known."""
        values: dict[str, Any] = self.model_dump(exclude={"lines", "jpeg_bytes"})
        if self.world_from_camera is None:
            return None
        pose = np.array(values.pop("world_from_camera")).reshape(4, 4)
        return Camera(**values, world_from_camera=pose)


def _encode(frame: RgbdFrame, lines: Sequence[str]) -> bytes:
    rgb, camera, is_lost = frame.rgb, frame.camera, frame.fault is not None
    if is_lost:
        lines = [f"no pose: {frame.fault}", *lines]
    while rgb.shape[1] > MAX_WIDTH_PX:
        rgb, camera = halve_rgb(rgb), downscale(camera, 2)
    jpeg = encode_jpeg(rgb, JPEG_QUALITY)
    header = _Header(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
        world_from_camera=None if is_lost else camera.world_from_camera.ravel().tolist(),
        lines=tuple(line[:MAX_LINE] for line in lines[:MAX_LINES]),
        jpeg_bytes=len(jpeg),
    )
    return header.model_dump_json().encode() + b"\n" + jpeg
