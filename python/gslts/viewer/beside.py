"""The viewer beside a program that works on a map."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from gslts.core.frame import RgbdFrame
from gslts.viewer.live import LiveFeed

ShowFrame = Callable[[RgbdFrame, Callable[[], Sequence[str]]], None]
"""Shows a frame of the robot, its pose that of the map, with lines about the robot's state; see
`LiveFeed.show`."""


@contextmanager
def viewer_beside(map_path: Path, wanted: bool) -> Iterator[ShowFrame]:
    """Serve `gslts view` on a free port, in a process of its own that cannot slow the program.

    Args:
        map_path: Folder of the map.
        wanted: False does nothing.

    Yields:
        Shows a frame of the robot; never waits.
    """
    if not wanted:
        yield lambda *_: None
        return
    command = [sys.executable, "-m", "gslts", "view", str(map_path), "--port", "0", "--live"]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        with LiveFeed(process.stdin) as feed:
            try:
                yield feed.show
            finally:
                process.terminate()
