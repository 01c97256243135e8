"""A map of a room with colours, words and a moved box, and a browser to look at it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import surfel_room
from PIL import Image

from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.io.images import to_rgb8
from gslts.mapping.density.control import join
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import render
from gslts.semantics.files import write_autoencoder
from gslts.store.causes import Box, SemanticsCause, UpdateCause
from gslts.store.map_folder import open_map, read_map, write_map_folder
from gslts.store.records import ObjectEvent

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
WITHOUT_GL = ("--disable-gpu", "--disable-software-rasterizer", "--disable-3d-apis", "--no-sandbox")
ORIGIN = np.array([1000.0, -2000.0, 3.0])
"""Of the map in the world, m: far enough for mistakes to show."""
WIDTH, HEIGHT = 630, 240
SAME_DB = 25.0
"""Minimum PSNR of two images of one map; of another version it is below."""
LONG_MS = 60_000
"""More than anything here takes: what lasts so long has failed."""
MARGIN_PX = 16
"""Half the side of the part of an image around a box."""
BOX: Box = ((0.1, 2.5, 0.0), (0.5, 2.9, 0.4))
MOVED: Box = ((2.8, 2.4, 0.0), (3.2, 2.8, 0.4))


def in_world(box: Box) -> Box:
    """Return a box of the room in the world."""
    low, high = ((np.array(corner) + ORIGIN).tolist() for corner in box)
    return tuple(low), tuple(high)


def first_view() -> Camera:
    """Return the camera of the map: in a corner, level, with both positions of the box in view."""
    pose = look_at(np.array([3.8, 0.3, 2.0]), np.array([2.0, 2.6, 0.4]))
    pose[:3, 3] += ORIGIN
    return camera_from_fov(64, 64, np.deg2rad(85), pose)


def coloured_map() -> GaussianMap:
    """Return the map of `surfel_room` with stripes, so that any displacement shows."""
    grey = surfel_room.surfel_map()
    waves = np.sin(4 * grey.means + np.float32([0, 2, 4]))
    sh = (0.35 * waves / SH_C0).astype(np.float32)[:, None]
    return replace(grey, sh=sh, origin=ORIGIN)


def make_map(folder: Path) -> None:
    """Write the map: version 2 adds words, version 3 moves the box."""
    first = coloured_map()
    write_map_folder(folder, first, {"dataset": "room"}, {"corner": first_view()})
    digest = write_autoencoder(surfel_room.autoencoder(), folder)
    with open_map(folder, writable=True) as store:
        cause = SemanticsCause(
            source="oracle",
            dataset="room",
            levels=1,
            code_dims=surfel_room.CODE_DIMS,
            names=surfel_room.NAMES,
            autoencoder=digest,
        )
        store.commit_features(first, cause)
    move(folder, BOX, MOVED)


def move(folder: Path, before: Box, after: Box) -> None:
    """Add a version in which the box has moved."""
    with open_map(folder, writable=True) as store:
        old = store.read()
        low, high = np.array(before[0]) - 0.01, np.array(before[1]) + 0.01
        rows = ((old.means >= low) & (old.means <= high)).all(axis=1)
        # The floor and the walls stay: of the box are Gaussians inside of the room.
        rows &= (old.means > 0.01).all(axis=1)
        box = old.select(rows)
        means = (box.means + np.subtract(after[0], before[0])).astype(np.float32)
        new = join(old.select(~rows), replace(box, means=means), store.version().next_id)
        event = ObjectEvent(
            kind="relocation", type="Box", boxes=(in_world(before), in_world(after))
        )
        store.commit(new, UpdateCause(), [event])


@contextmanager
def browser_page(url: str, flags: tuple[str, ...] = FLAGS) -> Iterator["Page"]:
    """Open a page in a headless Chromium with software GL; skip the test where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=flags)
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.set_default_timeout(LONG_MS)
        opened = Page(page)
        page.goto(url)
        yield opened
        browser.close()


class Page:
    """A page, as who looks at it sees it.

    Attributes:
        page: Of Playwright.
        errors: Of its scripts.
        received: Bytes received from the server.
    """

    def __init__(self, page: "object") -> None:
        self.page, self.errors, self.received = page, [], 0
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("websocket", lambda socket: socket.on("framereceived", self._count))

    def _count(self, data: bytes) -> None:
        self.received += len(data)

    def wait_for_text(self, text: str) -> None:
        """Wait until the page shows a text."""
        self.page.get_by_text(text).first.wait_for()

    def image(self) -> np.ndarray:
        """Return what the page shows, [H,W,3]."""
        return np.array(Image.open(BytesIO(self.page.screenshot())).convert("RGB"))

    def camera(self) -> Camera:
        """Return the camera of a page that was not turned."""
        size = self.page.evaluate(
            "() => { const r = document.querySelector('canvas').getBoundingClientRect();"
            " return [r.width, r.height]; }"
        )
        width, height = map(int, size)
        view = first_view()
        focal_px = height / 2 / (view.height / 2 / view.fy)
        return Camera(
            fx=focal_px,
            fy=focal_px,
            cx=width / 2,
            cy=height / 2,
            width=width,
            height=height,
            world_from_camera=view.world_from_camera,
        )

    def psnr_db(self, version: Path, box: Box) -> float:
        """Compare the page around a box with a rendering of a version, such as map@1."""
        camera = self.camera()
        x, y = (round(value) for value in self.pixel(np.mean(box, axis=0)))
        part = np.s_[y - MARGIN_PX : y + MARGIN_PX, x - MARGIN_PX : x + MARGIN_PX]
        expected = to_rgb8(render(read_map(version), camera).rgb)[part]
        return float(psnr_db(self.image()[part] / 255, expected / 255))

    def wait_for_image(self, version: Path, box: Box) -> None:
        """Wait until the page shows a version around a box."""
        for _ in range(LONG_MS // 500):
            value = self.psnr_db(version, box)
            if value >= SAME_DB:
                return
            self.page.wait_for_timeout(500)
        raise AssertionError(f"the page does not show {version.name}: {value:.1f} dB")

    def pixel(self, point: np.ndarray) -> tuple[float, float]:
        """Return where the page shows a point of the room, px."""
        camera = self.camera()
        pose = camera.world_from_camera
        x, y, z = pose[:3, :3].T @ (np.array(point) + ORIGIN - pose[:3, 3])
        return camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
