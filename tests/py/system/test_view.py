"""The viewer in a real browser, headless and with software GL."""

import base64
import shutil
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import viewed_room
from command import gslts as run
from PIL import Image
from shared import made_once
from viewed_room import BOX, LONG_MS, MOVED, SAME_DB, Page, browser_page

from gslts.io.images import to_rgb8
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import render
from gslts.store.map_folder import read_map
from gslts.viewer.live import LiveFrame
from gslts.viewer.viewer import Viewer

MIDDLE = ((2.4, 1.2, 0.3), (2.4, 1.4, 0.5))
"""Of the room, where no version changed anything."""

READ_IMAGE = """async image => {
  const blob = await (await fetch(image.src)).blob();
  const reader = new FileReader();
  reader.readAsDataURL(blob);
  return new Promise(done => reader.onload = () => done(reader.result));
}"""
"""Returns an image of the page as a data URL."""


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A map of three versions: the second has words, the third a box at another position."""
    made = made_once("viewed_room", viewed_room.make_map)
    return Path(shutil.copytree(made, tmp_path / "room"))


@pytest.fixture
def page(room: Path) -> Iterator[Page]:
    """An open page of the map."""
    with Viewer(room, port=0) as viewer, browser_page(viewer.url) as opened:
        opened.wait_for_text("moved from")
        opened.page.locator(".mantine-Notification-closeButton").first.click()
        yield opened
    assert opened.errors == []


def fill(page: Page, field: int, text: str) -> None:
    """Type into a field of the panel: 0 is the version, 1 the one before, 2 the words."""
    page.page.get_by_role("textbox").nth(field).fill(text)
    page.page.get_by_role("textbox").nth(field).press("Enter")


def test_versions(page: Page, room: Path) -> None:
    fill(page, 1, "3")  # Without the boxes of what changed.
    page.wait_for_image(room, MIDDLE)
    page.wait_for_image(room, MOVED)
    fill(page, 0, "1")
    page.wait_for_text("mapped from room")
    page.wait_for_image(room.with_name("room@1"), BOX)
    assert page.psnr_db(room.with_name("room@3"), BOX) < SAME_DB
    # A version that appears is shown, and only the blocks that differ are sent.
    fill(page, 0, "3")
    page.wait_for_text("Box moved from (1000.30")
    fill(page, 1, "3")
    page.wait_for_image(room, BOX)
    whole = page.received
    viewed_room.move(room, MOVED, BOX)
    page.wait_for_text("Box moved from (1003.00, -1997.40, 3.20) m to (1000.30")
    fill(page, 1, "4")
    page.wait_for_image(room.with_name("room@4"), BOX)
    assert page.psnr_db(room.with_name("room@3"), BOX) < SAME_DB
    assert 0 < page.received - whole < 0.3 * whole


def test_objects_and_words(page: Page, room: Path) -> None:
    page.wait_for_image(room, MIDDLE)
    page.page.mouse.click(*page.pixel((3.0, 2.4, 0.2)))
    page.wait_for_text("Box, 0.40 x 0.40 x 0.40 m, there since version 3")
    page.wait_for_text("3: Box moved from (1000.30, -1997.30, 3.20) m")
    page.page.mouse.click(*page.pixel((2.275, 1.4, 0.825)))
    page.wait_for_text("no change is known of it")
    page.wait_for_text("Mug, 0.1")
    fill(page, 2, "elephant")
    page.page.get_by_role("button", name="Find", exact=True).click()
    page.wait_for_text("elephant: not found")
    fill(page, 2, "mug")
    page.page.get_by_role("button", name="Go there").last.click()
    page.wait_for_text("path from here: ")


def test_before_and_after(page: Page, room: Path) -> None:
    before, after = room.with_name("room@1"), room.with_name("room@3")
    fill(page, 1, "1")
    page.page.get_by_label("Boxes").first.uncheck()
    page.page.get_by_label("Before | after").first.check()
    fill(page, 2, "1")  # The divider stands at the right edge: all is as it was.
    page.wait_for_image(before, BOX)
    assert page.psnr_db(after, BOX) < SAME_DB
    fill(page, 2, "0")
    page.wait_for_image(after, BOX)
    page.page.get_by_label("Before | after").first.uncheck()
    page.wait_for_image(after, MIDDLE)


def robot_image(page: Page, height: int) -> np.ndarray:
    """Return the image of the robot's part of the panel, [H,W,3], once it has that height."""
    for _ in range(LONG_MS // 500):
        address = page.page.locator("img[src^='blob:']").first.evaluate(READ_IMAGE)
        content = base64.b64decode(address.partition(",")[2])
        image = np.array(Image.open(BytesIO(content)).convert("RGB"))
        if len(image) == height:
            return image
        page.page.wait_for_timeout(500)
    raise AssertionError(f"the panel shows an image of {len(image)} pixels, not of {height}")


def test_robot(room: Path) -> None:
    camera = viewed_room.first_view()
    seen = LiveFrame(np.full((64, 64, 3), 90, np.uint8), camera, ("round 7", "deferred: a vase"))
    with Viewer(room, port=0) as viewer, browser_page(viewer.url) as page:
        page.wait_for_text("moved from")
        viewer.show_robot(seen)
        page.wait_for_text("deferred: a vase")
        image = robot_image(page, 128)
        viewer.show_robot(replace(seen, camera=None, lines=("no pose: lost",)))
        page.wait_for_text("no pose: lost")
        assert robot_image(page, 64).shape == (64, 64, 3)  # That of the camera alone.
    rendered = to_rgb8(render(read_map(room), camera).rgb)
    inside = np.s_[8:56, 8:56]  # JPEG mixes colours at edges.
    assert np.abs(image[inside].astype(int) - 90).max() < 10
    assert psnr_db(image[:64, 64:][inside] / 255, rendered[inside] / 255) > SAME_DB


def test_map_that_is_lost(page: Page, room: Path) -> None:
    room.rename(room.with_name("elsewhere"))
    page.wait_for_text("The map cannot be read any more")
    page.wait_for_image(room.with_name("elsewhere"), MIDDLE)
    room.with_name("elsewhere").rename(room)
    page.page.get_by_text("The map cannot be read any more").wait_for(state="detached")


def test_browser_without_webgl(room: Path) -> None:
    with (
        Viewer(room, port=0) as viewer,
        browser_page(viewer.url, viewed_room.WITHOUT_GL) as page,
    ):
        page.wait_for_text("This browser has no WebGL 2")
        page.wait_for_text("Box moved from (1000.30")
        image = page.page.get_by_alt_text("The map from corner")
        content = base64.b64decode(image.get_attribute("src").partition(",")[2])
        shown = np.array(Image.open(BytesIO(content)).convert("RGB"))
        expected = to_rgb8(render(read_map(room), viewed_room.first_view()).rgb)
        assert psnr_db(shown / 255, expected / 255) > SAME_DB


def test_exported_page(room: Path, tmp_path: Path) -> None:
    done = run("export", "room", "out/room.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "3 version(s)" in done.stdout
    with browser_page((tmp_path / "out" / "room.html").as_uri()) as page:
        page.page.wait_for_selector("body[data-shown='2']")
        panel = page.page.locator("#panel summary")
        panel.click()  # It hides what is compared.
        page.wait_for_image(room, MIDDLE)
        panel.click()
        page.page.get_by_role("button", name="Version 1").click()
        page.page.wait_for_selector("body[data-shown='0']")
        panel.click()
        page.wait_for_image(room.with_name("room@1"), BOX)
        assert page.psnr_db(room.with_name("room@3"), BOX) < SAME_DB
        assert page.errors == []
