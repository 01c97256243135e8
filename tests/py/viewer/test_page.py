"""Tasks of a page beside frames of a robot, and versions that are replaced by others."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gslts.viewer import page
from gslts.viewer.page import Page

REST_S = 0.1
"""Time without a move in the tests, s."""
DEADLINE_S = 60.0
"""More than anything here takes."""


class NotedPage(Page):
    """A page without a browser, which notes the versions that it shows.

    Args:
        viewed: Stands for the map.
    """

    def __init__(self, viewed: Any) -> None:
        gui = SimpleNamespace(add_html=lambda content: SimpleNamespace(content=content))
        self.versions: list[int] = []
        self.rested = Event()
        self._divider = SimpleNamespace(update=self.rested.set)
        self._following = SimpleNamespace(value=True)
        self._event = SimpleNamespace(options=())
        self._slider, self._before = (
            SimpleNamespace(value=viewed.newest, max=viewed.newest) for _ in range(2)
        )
        super().__init__(SimpleNamespace(scene=None, gui=gui), viewed)

    def _begin(self) -> None:
        pass

    def _show_version(self) -> None:
        self.versions.append(self._number)

    def _show_blocks(self, _blocks: Any) -> None:
        pass


def make_map(newest: int, replaced: int = 0) -> SimpleNamespace:
    return SimpleNamespace(
        name="map",
        origin=np.zeros(3),
        newest=newest,
        replaced=replaced,
        changes=lambda _before, _after: {},
    )


@contextmanager
def robot_frames(opened: Page) -> Iterator[Event]:
    """Post frames of a robot more often than a camera rests, and set an event by each."""
    stop, shown = Event(), Event()

    def feed() -> None:
        while not stop.wait(REST_S / 3):
            opened.post("robot", shown.set)

    thread = Thread(target=feed)
    thread.start()
    try:
        yield shown
    finally:
        stop.set()
        thread.join()
        opened.close()


def wait_until(is_done: Callable[[], bool]) -> None:
    end_s = time.monotonic() + DEADLINE_S
    while not is_done() and time.monotonic() < end_s:
        time.sleep(REST_S / 10)
    assert is_done()


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "REST_S", REST_S)
    monkeypatch.setattr(page, "PLAY_S", 3 * REST_S)


def test_the_divider_follows_the_camera_beside_frames_of_a_robot() -> None:
    opened = NotedPage(make_map(3))
    with robot_frames(opened) as shown:
        opened.post("camera", opened._on_camera)
        assert opened.rested.wait(DEADLINE_S)
        shown.clear()
        assert shown.wait(DEADLINE_S)


def test_a_camera_is_followed_after_what_interrupts_it() -> None:
    opened, clicked = NotedPage(make_map(3)), Event()
    opened.post("camera", opened._on_camera)
    time.sleep(REST_S / 3)
    opened.post("click", clicked.set)
    assert clicked.wait(DEADLINE_S)
    assert opened.rested.wait(DEADLINE_S)
    opened.close()


def test_play_goes_on_beside_frames_of_a_robot() -> None:
    opened = NotedPage(make_map(4))
    with robot_frames(opened) as shown:
        opened.post("play", opened._play)
        wait_until(lambda: len(opened.versions) >= 2)
        shown.clear()
        assert shown.wait(DEADLINE_S)
        wait_until(lambda: len(opened.versions) == 4)
    assert opened.versions == [1, 2, 3, 4]


def test_play_ends_when_something_else_is_asked_for() -> None:
    opened = NotedPage(make_map(99))
    opened.post("play", opened._play)
    wait_until(lambda: len(opened.versions) >= 2)
    clicked = Event()
    opened.post("click", clicked.set)
    assert clicked.wait(DEADLINE_S)
    shown = list(opened.versions)
    time.sleep(8 * REST_S)
    assert opened.versions == shown
    assert len(shown) < 99
    opened.close()


@pytest.mark.parametrize("newest", [3, 2])
@pytest.mark.parametrize("following", [True, False])
def test_a_version_that_another_replaces_is_drawn_again(newest: int, following: bool) -> None:
    viewed = make_map(3)
    opened = NotedPage(viewed)
    opened._following.value = following
    opened._follow()
    assert opened.versions == []
    viewed.newest, viewed.replaced = newest, 1
    opened._follow()
    opened._follow()
    assert opened.versions == [newest]
    assert (opened._slider.value, opened._slider.max) == (newest, newest)
    opened.close()
