"""Times and bytes of the viewer with a large map, in a headless Chromium; prints a markdown table.

make demo && python benchmarks/viewer_benchmark.py demo/map    # a minute; needs chromium
python benchmarks/viewer_benchmark.py demo/map --minutes 20    # memory, while versions come

The map is repeated until it has 500,000 Gaussians. A GPU is used where Chromium finds one.
"""

from __future__ import annotations

import argparse
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from base64 import b64decode
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from PIL import Image
from playwright.sync_api import sync_playwright

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.store.camera_files import cameras_of_map
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map, write_map_folder
from gslts.viewer.viewer import Viewer

MIN_GAUSSIANS = 500_000
GAP_M = 0.5
"""Gap between two copies of the map, m."""
CHANGED_M = 0.25
"""Radius around a point in which Gaussians are removed, m: a small object."""
SIZE_PX = {"width": 960, "height": 540}
SCENE = np.s_[200:440, 330:560]
"""Part of the page that no panel and no notification covers, px."""
DRAWN_SPREAD = 2.0
"""Standard deviation of the grey values there above which something is drawn: the empty page is
white."""
BLOCKS_BYTES = 4096
"""Size above which a message has Gaussians: those of the panel are smaller."""
FLAGS = ("--ignore-gpu-blocklist", "--enable-unsafe-swiftshader", "--no-sandbox")
GIVE_UP_S = 120.0
PERIOD_S = 4.0
"""Time between two versions while memory is measured, s."""
Row = tuple[str, str]


def large_map(gaussian_map: GaussianMap) -> GaussianMap:
    """Return copies of a map, beside each other."""
    span_m = np.ptp(gaussian_map.means[:, 0]) + np.float32(GAP_M)
    joined, copies = gaussian_map, 1
    while joined.size < MIN_GAUSSIANS:
        means = gaussian_map.means + copies * span_m * np.float32([1, 0, 0])
        joined = join(joined, replace(gaussian_map, means=means), int(joined.ids.max()) + 1)
        copies += 1
    return joined


class Received:
    """Bytes that a page received from the server, and when."""

    def __init__(self, page: Any) -> None:
        self.log: list[tuple[float, int]] = []
        page.on("websocket", lambda socket: socket.on("framereceived", self._add))

    def _add(self, data: bytes) -> None:
        self.log.append((time.perf_counter(), len(data)))

    def since(self, start_s: float) -> tuple[int, float]:
        """Return the bytes with Gaussians since a time, and the seconds until the last of them."""
        own = [entry for entry in self.log if entry[0] > start_s and entry[1] > BLOCKS_BYTES]
        return sum(size for _, size in own), max(
            (at_s for at_s, _ in own), default=start_s
        ) - start_s


def wait_until(page: Any, is_done: Callable[[], bool], start_s: float) -> float:
    """Return the seconds since a time until something is so."""
    while not is_done():
        if time.perf_counter() - start_s > GIVE_UP_S:
            return float("nan")
        page.wait_for_timeout(50)
    return time.perf_counter() - start_s


class Shown:
    """Frames that a page shows: a screenshot would wait for all Gaussians.

    Attributes:
        drawn_at_s: Time of the first frame that shows the map; None before it.
    """

    def __init__(self, page: Any) -> None:
        self.drawn_at_s: float | None = None
        self._session = page.context.new_cdp_session(page)
        self._session.on("Page.screencastFrame", self._look)
        self._session.send("Page.startScreencast", {"format": "png"})

    def stop(self) -> None:
        """Look at no more frames."""
        self._session.detach()

    def _look(self, frame: Any) -> None:
        self._session.send("Page.screencastFrameAck", {"sessionId": frame["sessionId"]})
        image = np.asarray(Image.open(BytesIO(b64decode(frame["data"]))).convert("L"))
        if self.drawn_at_s is None and float(image[SCENE].std()) > DRAWN_SPREAD:
            self.drawn_at_s = time.perf_counter()


def measure_memory(folder: Path, large: GaussianMap, page: Any, minutes: float) -> list[Row]:
    """Return the memory of server and page after each minute, while new versions come.

    Each version has the Gaussians around another point anew, with other ids.
    """
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    command = [sys.executable, "-m", "gslts", "view", str(folder), "--port", str(port)]
    rng, samples = np.random.default_rng(0), list[tuple[float, int, float, float]]()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            server.stdout.readline()  # It is ready.
            page.goto(f"http://127.0.0.1:{port}")
            session = page.context.new_cdp_session(page)
            start_s, versions = time.monotonic(), 0
            while (passed_s := time.monotonic() - start_s) < 60 * minutes:
                near = np.linalg.norm(large.means - rng.choice(large.means), axis=1) < CHANGED_M
                left, moved = (
                    large.select(np.flatnonzero(~near)),
                    large.select(np.flatnonzero(near)),
                )
                large = join(left, moved, large.next_id)
                with open_map(folder, writable=True) as store:
                    store.commit(large, UpdateCause())
                versions += 1
                page.wait_for_timeout(1000 * PERIOD_S)
                if passed_s >= 60 * len(samples):
                    session.send("HeapProfiler.collectGarbage")
                    heap = session.send("Runtime.getHeapUsage")
                    page_bytes = heap["usedSize"] + heap.get("backingStorageSize", 0)
                    rss = psutil.Process(server.pid).memory_info().rss
                    samples.append((passed_s, versions, rss / 2**20, page_bytes / 2**20))
        finally:
            server.terminate()
    return [
        (f"after {at_s / 60:.0f} min, {count} versions", f"{rss:.0f} MiB server, {heap:.0f} page")
        for at_s, count, rss, heap in samples
    ]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("map", type=Path, help="folder of a map")
    parser.add_argument("--minutes", type=float, help="measure memory for so long instead")
    given = parser.parse_args()
    path = given.map
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with tempfile.TemporaryDirectory() as work, sync_playwright() as playwright:
        folder, large = Path(work) / "map", large_map(read_map(path))
        write_map_folder(folder, large, {}, cameras_of_map(path))
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport=SIZE_PX)
        if given.minutes is not None:
            print_rows(measure_memory(folder, large, page, given.minutes))
            return
        received, shown = Received(page), Shown(page)
        with Viewer(folder, port=0) as viewer:
            start_s = time.perf_counter()
            page.goto(viewer.url)
            wait_until(page, lambda: shown.drawn_at_s is not None, start_s)
            shown.stop()
            expected = 32 * large.size  # Bytes of a Gaussian of viser.
            wait_until(page, lambda: received.since(start_s)[0] >= expected, start_s)
            whole, whole_s = received.since(start_s)
            near = np.linalg.norm(large.means - large.means[large.size // 3], axis=1) < CHANGED_M
            with open_map(folder, writable=True) as store:
                store.commit(large.select(np.flatnonzero(~near)), UpdateCause())
            committed_s = time.perf_counter()
            first_s = wait_until(page, lambda: received.since(committed_s)[0] > 0, committed_s)
            page.wait_for_timeout(3_000)
            changed, _ = received.since(committed_s)
            renderer = page.evaluate(
                "() => { const gl = document.createElement('canvas').getContext('webgl2');"
                " return gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info')"
                ".UNMASKED_RENDERER_WEBGL); }"
            )
        browser.close()
    rows: list[Row] = [
        ("Gaussians", f"{large.size:,}"),
        ("first image after opening the page", f"{(shown.drawn_at_s or np.nan) - start_s:.1f} s"),
        ("all Gaussians received", f"{whole_s:.1f} s, {whole / 1e6:.1f} MB"),
        ("new version after its commit", f"{first_s:.2f} s"),
        ("bytes of the new version", f"{100 * changed / whole:.1f} %"),
        ("drawn by", str(renderer)),
    ]
    print_rows(rows)


def print_rows(rows: list[Row]) -> None:
    """Print a markdown table."""
    print("| what | figure |\n| :-- | --: |")
    for row in rows:
        print(f"| {row[0]} | {row[1]} |")


if __name__ == "__main__":
    main()
