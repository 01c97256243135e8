"""Gaussians that no measured depth confirms."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.store.manifest import MANIFEST
from gslts.store.map_folder import write_map_folder
from gslts.store.unmeasured import (
    FILE,
    KEY,
    NO_IDS,
    read_unmeasured,
    surface_margin_m,
    unmeasured_gaussians,
    unmeasured_problems,
    write_unmeasured,
)

DEPTH_M = 2.0
ORIGIN = np.array([10.0, -5.0, 1.0])


def gaussians(*means: tuple[float, float, float]) -> GaussianMap:
    """Return Gaussians at some centres, relative to the origin of the map."""
    size = len(means)
    return GaussianMap(
        means=np.array(means, np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.full((size, 3), -4, np.float32),
        logit_opacities=np.zeros(size, np.float32),
        sh=np.zeros((size, 1, 3), np.float32),
        ids=np.arange(5, 5 + size, dtype=np.uint64),
        origin=ORIGIN,
    )


def frame(depth_m: float = DEPTH_M) -> RgbdFrame:
    """Return a frame from the origin of the map along x, of a wall at a depth."""
    camera = camera_from_fov(40, 30, 1.0, look_at(ORIGIN, ORIGIN + np.array([1.0, 0.0, 0.0])))
    depth = np.full((30, 40), depth_m, np.float32)
    return RgbdFrame(np.zeros((30, 40, 3), np.uint8), depth, camera)


def test_what_depths_confirm_is_measured() -> None:
    margin_m = surface_margin_m(np.array([DEPTH_M]))[0]
    made = gaussians(
        (DEPTH_M, 0, 0),
        (DEPTH_M + 0.9 * margin_m, 0.1, 0),
        (DEPTH_M - 2 * margin_m, 0, 0.1),  # In front of the wall.
        (DEPTH_M + 2 * margin_m, 0, 0),  # Behind it.
        (-1, 0, 0),  # Behind the camera.
        (DEPTH_M, 5, 0),  # Beside the image.
    )
    assert unmeasured_gaussians(made, [frame()]).tolist() == [7, 8, 9, 10]


def test_most_depths_decide() -> None:
    made = gaussians((DEPTH_M, 0, 0))
    through = frame(2 * DEPTH_M)
    occluded = frame(DEPTH_M / 2)  # Says nothing of what is behind.
    assert unmeasured_gaussians(made, [frame(), through, occluded]).tolist() == []
    assert unmeasured_gaussians(made, [frame(), through, through]).tolist() == [5]


def test_where_no_depth_is_measured_nothing_is_confirmed() -> None:
    made = gaussians((DEPTH_M, 0.5, 0), (DEPTH_M, -0.5, 0))
    half = frame()
    depth = half.depth.copy()
    depth[:, 20:] = np.nan  # The image's right is at -y.
    assert unmeasured_gaussians(made, [replace(half, depth=depth)]).tolist() == [6]
    assert unmeasured_gaussians(made, [frame(0.0)]).tolist() == []  # Photographs tell nothing.


def folder_with(ids: np.ndarray, path: Path) -> Path:
    write_map_folder(
        path, gaussians((1, 0, 0)), {}, {}, lambda part: {KEY: write_unmeasured(ids, part)}
    )
    return path


def test_ids_are_read_as_written(tmp_path: Path) -> None:
    ids = np.array([1, 2, 2**63], np.uint64)
    path = folder_with(ids, tmp_path / "map")
    np.testing.assert_array_equal(read_unmeasured(path), ids)
    np.testing.assert_array_equal(read_unmeasured(Path(f"{path}@1")), ids)
    assert unmeasured_problems(path) == []


def test_an_imported_map_has_none(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", gaussians((1, 0, 0)), {}, {})
    assert read_unmeasured(tmp_path / "map").size == 0
    assert read_unmeasured(tmp_path / "map.ply").size == 0


def test_damage_is_named(tmp_path: Path) -> None:
    path = folder_with(NO_IDS, tmp_path / "map")
    file = path / FILE
    file.write_bytes(save({KEY: np.zeros(3, np.uint64)}))
    with pytest.raises(ValueError, match=r"unmeasured\.safetensors: it is damaged"):
        read_unmeasured(path)
    assert len(unmeasured_problems(path)) == 1
    file.unlink()
    with pytest.raises(FileNotFoundError, match="it is missing; copy it from a backup"):
        read_unmeasured(path)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"no safetensors", "these are no ids"),
        (save({"other": np.zeros(3, np.uint64)}), "these are no ids"),
        (save({KEY: np.zeros(3, np.float32)}), r"expected uint64 \[U\], got float32 \(3,\)"),
    ],
)
def test_files_that_hold_no_ids_are_rejected(tmp_path: Path, content: bytes, problem: str) -> None:
    path = folder_with(NO_IDS, tmp_path / "map")
    (path / FILE).write_bytes(content)
    manifest = (path / MANIFEST).read_text()
    old = hashlib.sha256(save({KEY: NO_IDS})).hexdigest()
    (path / MANIFEST).write_text(manifest.replace(old, hashlib.sha256(content).hexdigest()))
    with pytest.raises(ValueError, match=problem):
        read_unmeasured(path)
