"""The page in one file, without a browser: what it holds. What it shows is in test_view.py."""

import gzip
import json
import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from store_maps import BOX, addition, edited, random_map

from gslts.io.splat import GAUSSIAN, splat_rows
from gslts.store.causes import MappingCause, UpdateCause
from gslts.store.map_folder import open_map, write_map_folder
from gslts.viewer.export import export_page

HOSTILE = "</script><script>alert(1)</script>$title"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A map of two versions with names that would be code of the page."""
    first = random_map(500)
    write_map_folder(tmp_path / "map", first, {}, {}, cause=MappingCause(dataset=HOSTILE))
    with open_map(tmp_path / "map", writable=True) as store:
        store.commit(edited(first, 1, store.version().next_id), UpdateCause(), [addition(HOSTILE)])
    return tmp_path / "map"


def parts(page: Path) -> tuple[dict[str, list[dict[str, list[float]]]], np.ndarray]:
    """Return the scene and the Gaussians of a page."""
    text = page.read_text()
    content = {
        name: re.search(f"id={name}>([^<]*)</script>", text)[1] for name in ("scene", "gaussians")
    }
    planes = np.frombuffer(gzip.decompress(b64decode(content["gaussians"])), np.uint8)
    rows = planes.reshape(GAUSSIAN.itemsize, -1).T.tobytes()
    return json.loads(content["scene"]), np.frombuffer(rows, GAUSSIAN)


def by_bytes(splats: np.ndarray) -> np.ndarray:
    """Return Gaussians in the order of their colours and turns, which are not rounded."""
    return splats[np.lexsort(np.hstack([splats["rgba"], splats["quat"]]).T)]


def test_versions_share_their_blocks(folder: Path, tmp_path: Path) -> None:
    assert export_page(folder, tmp_path / "page.html", 9) == 2
    scene, gaussians = parts(tmp_path / "page.html")
    with open_map(folder) as store:
        maps = [store.read(1), store.read(2)]
    for version, expected in zip(scene["versions"], maps, strict=True):
        ranges = [scene["blocks"][block] for block in version["blocks"]]
        rows = np.concatenate(
            [np.arange(a // GAUSSIAN.itemsize, b // GAUSSIAN.itemsize) for a, b in ranges]
        )
        splats, exact = gaussians[rows], splat_rows(replace(expected, origin=np.zeros(3)))
        splats, exact = (by_bytes(rows) for rows in (splats, exact))
        np.testing.assert_allclose(splats["mean"], exact["mean"], rtol=0, atol=0.13e-3)
        np.testing.assert_allclose(splats["scales"], exact["scales"], rtol=0.3e-3)
        for name in ("rgba", "quat"):
            np.testing.assert_array_equal(splats[name], exact[name])
    assert len(gaussians) < sum(gaussian_map.size for gaussian_map in maps)
    lines = np.reshape(scene["versions"][1]["lines"], (12, 2, 3)) + maps[0].origin
    np.testing.assert_allclose(lines.min(axis=(0, 1)), BOX[0], atol=1e-3)
    np.testing.assert_allclose(lines.max(axis=(0, 1)), BOX[1], atol=1e-3)
    assert scene["versions"][0]["lines"] == []


def test_names_are_no_code(folder: Path, tmp_path: Path) -> None:
    export_page(folder, tmp_path / "page.html", 9)
    text = (tmp_path / "page.html").read_text()
    assert "alert(1)" in text
    assert "<script>alert" not in text


def test_versions_that_were_compacted(folder: Path, tmp_path: Path) -> None:
    with open_map(folder, writable=True) as store:
        store.compact(1)
    with pytest.raises(ValueError, match=r"version 1 was compacted .*--versions N"):
        export_page(folder, tmp_path / "page.html", 9)
    assert not (tmp_path / "page.html").exists()
    assert export_page(folder, tmp_path / "page.html", 1) == 1
