"""The demonstration as a user meets it, and the first image of the README, taken of its map.

GSLTS_IMAGES=docs/images scripts/test long -k demo   makes the image anew, of a whole demonstration.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from command import MAIN
from command import gslts as run
from drawn import assert_drawn
from viewed_room import browser_page

from gslts.viewer.viewer import Viewer

pytestmark = pytest.mark.long

SIZE_PX = {"width": 1280, "height": 800}
MAX_PAGE_BYTES = 15_000_000
"""Maximum size of the page of the day in one file, so that it can be sent by mail."""


def test_demo_and_its_page(tmp_path: Path) -> None:
    images = os.environ.get("GSLTS_IMAGES")
    arguments = ["demo", "--out", "demo", "--view", *([] if images else ["--quick"])]
    done = subprocess.run(
        [sys.executable, "-c", MAIN, *arguments], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"^open http://127.0.0.1:\d+ in a browser", done.stdout, re.MULTILINE)
    assert "gslts view demo/map" in done.stdout.splitlines()[-1]
    folder = tmp_path / "demo" / "map"
    with Viewer(folder, port=0) as viewer, browser_page(viewer.url) as page:
        page.page.set_viewport_size(SIZE_PX)
        page.page.locator(".mantine-Notification-closeButton").first.click()
        page.page.get_by_label("Go to").first.click()
        page.page.get_by_role("option").filter(has_text=re.compile(r"\bmoved from")).first.click()
        page.page.wait_for_timeout(30_000)  # Software GL draws the last of the Gaussians.
        image = Path(images or tmp_path) / "viewer.jpg"
        page.page.screenshot(path=image, quality=85)
        assert page.errors == []
    assert_drawn(image)
    done = run("export", "demo/map", "day.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "day.html").stat().st_size <= MAX_PAGE_BYTES
