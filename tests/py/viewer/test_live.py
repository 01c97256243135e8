"""Frames of a robot on their way to the viewer."""

import io
import os
import threading
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.viewer.live import MAX_LINES, LiveFeed, LiveFrame, read_live_frames

POSE = look_at(np.array([3.8, 0.3, 2.0]), np.array([2.0, 2.6, 0.4]))


def frame_of(gray: int) -> RgbdFrame:
    """Return a frame of 640 x 480 pixels with one colour."""
    camera = camera_from_fov(640, 480, 1.0, POSE)
    rgb = np.full((480, 640, 3), gray, np.uint8)
    return RgbdFrame(rgb=rgb, depth=np.ones((480, 640), np.float32), camera=camera)


@pytest.fixture
def pipe() -> Iterator[tuple[io.BufferedReader, io.BufferedWriter]]:
    """Both ends of a pipe."""
    reading, writing = os.pipe()
    with os.fdopen(reading, "rb") as source, os.fdopen(writing, "wb") as target:
        yield source, target


def test_frames_arrive(pipe: tuple[io.BufferedReader, io.BufferedWriter]) -> None:
    source, target = pipe
    with LiveFeed(target) as feed:
        feed.show(frame_of(100), lambda: ["round 1", *["deferred"] * 100])
        live = next(read_live_frames(source))
    assert isinstance(live, LiveFrame)
    assert live.rgb.shape == (240, 320, 3)
    assert np.abs(live.rgb.astype(int) - 100).max() <= 2
    np.testing.assert_array_equal(live.camera.world_from_camera, POSE)
    assert live.camera.fx == frame_of(0).camera.fx / 2
    assert live.lines == ("round 1", *["deferred"] * (MAX_LINES - 1))
    assert list(read_live_frames(source)) == []


def test_a_lost_robot(pipe: tuple[io.BufferedReader, io.BufferedWriter]) -> None:
    source, target = pipe
    with LiveFeed(target) as feed:
        feed.repeat()  # There is nothing to be repeated.
        feed.show(replace(frame_of(9), fault="lost: 3 matches"), lambda: ["round 1"])
        frames = read_live_frames(source)
        lost = next(frames)
        feed.show(frame_of(20), lambda: ["round 2"])
        found = next(frames)
        feed.repeat()
        again = next(frames)
    assert (lost.camera, lost.lines) == (None, ("no pose: lost: 3 matches", "round 1"))
    assert lost.rgb.mean() < 12
    assert found.camera is not None
    assert (again.lines, again.rgb.mean()) == (found.lines, found.rgb.mean())


def test_a_robot_waits_for_no_reader(pipe: tuple[io.BufferedReader, io.BufferedWriter]) -> None:
    source, target = pipe
    noise = np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8)
    frame = RgbdFrame(rgb=noise, depth=frame_of(0).depth, camera=frame_of(0).camera)
    shown = threading.Event()

    def drive(feed: LiveFeed) -> None:
        for _ in range(100):  # More than any pipe holds.
            feed.show(frame, list)
        shown.set()

    with LiveFeed(target) as feed:
        threading.Thread(target=drive, args=(feed,), daemon=True).start()
        assert shown.wait(60)
        source.close()  # The viewer is closed; the feed ends without an error.


@pytest.mark.parametrize(
    "content",
    [
        b"{}\n",
        b"nonsense\n",
        b'{"jpeg_bytes": 99999999999}\n',
        b"[" * 100_000,
    ],
)
def test_other_streams(content: bytes) -> None:
    with pytest.raises(ValidationError):
        next(read_live_frames(io.BytesIO(content)))


def test_image_that_is_cut(pipe: tuple[io.BufferedReader, io.BufferedWriter]) -> None:
    source, target = pipe
    with LiveFeed(target) as feed:
        feed.show(frame_of(3), list)
        whole = next(iter(lambda: source.read1(1 << 20), b""))
    with pytest.raises(ValueError, match="the image is damaged"):
        next(read_live_frames(io.BytesIO(whole[:-50])))
