"""The viewer beside a program that works on a map."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from gslts.core.frame import RgbdFrame
from gslts.viewer.goals import Goal, PendingGoal
from gslts.viewer.live import LiveFeed


class PagesBeside:
    """The pages of the viewer, for the program of a robot, which never waits for them.

    Args:
        feed: Shows frames; None if there is no viewer.
    """

    def __init__(self, feed: LiveFeed | None = None) -> None:
        self._feed = feed
        self.pending = PendingGoal(lambda: None if feed is None else feed.repeat())

    def show(self, frame: RgbdFrame, describe: Callable[[], Sequence[str]]) -> None:
        """Show a frame of the robot; see `LiveFeed.show`.

        Args:
            frame: Its pose is that of the map.
            describe: Returns the state of the robot in words.
        """
        if self._feed is not None:
            self._feed.show(frame, lambda: [*self.pending.lines(), *describe()])

    def follow_goal(self, drive: Callable[[Goal], str]) -> None:
        """Drive to what was chosen on a page last, if there is something; see `PendingGoal.follow`.

        Args:
            drive: Moves the robot, and returns how it ended.
        """
        self.pending.follow(drive)


@contextmanager
def viewer_beside(map_path: Path, wanted: bool, control: bool = False) -> Iterator[PagesBeside]:
    """Serve `gslts view` on a free port, in a process of its own that cannot slow the program.

    Args:
        map_path: Folder of the map.
        wanted: False does nothing.
        control: Pages may choose goals of the robot.

    Yields:
        The pages.
    """
    if not wanted:
        yield PagesBeside()
        return
    command = [sys.executable, "-m", "gslts", "view", str(map_path), "--port", "0", "--live"]
    reading, writing = os.pipe()
    given = ((writing,), [f"--goals={writing}"]) if control else ((), [])
    with (
        os.fdopen(reading, "rb") as goals,
        subprocess.Popen(
            [*command, *given[1]], stdin=subprocess.PIPE, pass_fds=given[0]
        ) as process,
    ):
        os.close(writing)
        assert process.stdin is not None
        with LiveFeed(process.stdin) as feed:
            pages = PagesBeside(feed)
            listening = threading.Thread(target=pages.pending.listen, args=(goals,), daemon=True)
            listening.start()
            try:
                yield pages
            finally:
                process.terminate()
        process.wait()  # Nobody else can write to the pipe.
        listening.join()
