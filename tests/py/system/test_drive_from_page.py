"""A robot that is sent to objects from a page of the viewer, in a real browser."""

import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import change_room
import numpy as np
import pytest
from command import gslts as run
from semantic_room import embedded_map
from update_room import LOOP
from viewed_room import Page, browser_page

from gslts.keeper.errand import drive_to
from gslts.keeper.keeper import MapKeeper
from gslts.robots.watched import WatchedRobot
from gslts.semantics.files import write_autoencoder
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import open_map, write_map_folder
from gslts.viewer.beside import PagesBeside, viewer_beside
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint

FAR = Viewpoint(0.75, 0.5, 45.0, 30.0)
BLOCK = (np.array([2.0, 1.5]), np.array([3.2, 2.3]))
"""Corners of the block on the floor, m."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A map with words, whose first camera looks at the block."""
    gaussian_map, found = embedded_map()
    cameras = dict(reversed(change_room.mapped()[1].items()))
    folder = tmp_path / "map"
    write_map_folder(folder, change_room.mapped()[0], {}, cameras)
    cause = SemanticsCause(
        source="oracle",
        dataset="room",
        levels=gaussian_map.feature_dims // found.codec.code_dims,
        code_dims=found.codec.code_dims,
        names=found.names,
        autoencoder=write_autoencoder(found.codec, folder),
    )
    with open_map(folder, writable=True) as store:
        store.commit_features(gaussian_map, cause)
    return folder


class Driven:
    """A simulated robot, the keeper of its map, and a page that looks at them."""

    def __init__(self, page: Page, pages: PagesBeside, keeper: MapKeeper) -> None:
        self.page, self._pages, self._keeper = page, pages, keeper
        self.robot = Controller(change_room.home(), **change_room.SIZE)
        self.robot.go(FAR)
        self._shown = WatchedRobot(self.robot, lambda frame: pages.show(frame, lambda: ["idle"]))
        self._start = {"start": self._shown.observe().camera}
        page.wait_for_text("idle")

    def go_round(self) -> None:
        """Go round one viewpoint, the start, and then where the page says."""
        self._keeper.go_round(self._shown, self._start, between=self._follow_goal)

    def _follow_goal(self) -> None:
        self._pages.follow_goal(
            lambda goal: drive_to(self._keeper, self._shown, goal.words, goal.box).describe()
        )

    def find(self, text: str) -> None:
        """Go to what fits a text."""
        self.page.page.get_by_role("textbox").nth(2).fill(text)
        self.page.page.get_by_role("textbox").nth(2).press("Enter")
        self.page.page.get_by_role("button", name="Go there").last.click()

    def click_on_the_block(self) -> None:
        """Click on the block, and go there."""
        area = self.page.page.locator("canvas").first.bounding_box()
        middle = area["x"] + area["width"] / 2, area["y"] + area["height"] / 2
        self.page.page.mouse.click(*middle)
        self.page.wait_for_text("no change is known of it")
        self.page.page.get_by_role("button", name="Go there").first.click()

    def distance_m(self) -> float:
        """Return the distance of the robot from the block."""
        position = self.robot.pose()[:2, 3]
        return float(np.linalg.norm(position - position.clip(*BLOCK)))


@pytest.fixture
def driven(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> Callable[[bool], AbstractContextManager[Driven]]:
    """Return a function that opens the page of a robot, which may be driven from it or not."""

    @contextmanager
    def open_page(control: bool) -> Iterator[Driven]:
        with viewer_beside(folder, True, control) as pages, MapKeeper(folder, LOOP) as keeper:
            output = ""
            while "\n" not in output:
                output += capfd.readouterr().out
            with browser_page(output.split()[1]) as page:
                page.wait_for_text("semantic features")
                page.page.locator(".mantine-Notification-closeButton").first.click()
                yield Driven(page, pages, keeper)
                assert page.errors == []

    return open_page


def test_a_click_sends_the_robot(driven: Callable[[bool], AbstractContextManager[Driven]]) -> None:
    with driven(True) as it:
        assert it.distance_m() > 1.2
        it.find("box")
        it.page.wait_for_text("path of the robot: ")
        it.page.wait_for_text("box: sent; the robot ends first what it is doing")
        it.find("block")  # A goal that was not begun is forgotten.
        it.page.wait_for_text("block: sent; the robot ends first what it is doing")
        it.go_round()
        it.page.wait_for_text("block: reached, ")
        assert it.distance_m() < 1.0
        it.go_round()  # The goal was reached; there is no other one.
        assert it.distance_m() > 1.2
        it.click_on_the_block()
        it.page.wait_for_text("Block: sent; the robot ends first")
        it.go_round()
        it.page.wait_for_text("Block: reached, ")
        assert it.distance_m() < 1.0


def test_without_control_nothing_drives(
    driven: Callable[[bool], AbstractContextManager[Driven]],
) -> None:
    with driven(False) as it:
        before = it.robot.pose().copy()
        it.find("block")
        it.page.wait_for_text("path from here: ")
        it.go_round()
        np.testing.assert_allclose(it.robot.pose(), before)
        assert it.page.page.get_by_text(re.compile("sent|driving|reached")).count() == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "map", "--robot", "none.json", "--control"), "give --view as well"),
        (("run", "map", "--frames", "none", "--view", "--control"), "a recording cannot be driven"),
        (("demo", "--control"), "give --view as well"),
        (("ros", "--map", "map", "--view", "--control"), "give --active as well"),
    ],
)
def test_robots_that_cannot_be_driven(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
