"""The file of what a recording tells of the Gaussians of its map."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save

from gslts.core.gaussian_map import GaussianMap
from gslts.store.manifest import MANIFEST
from gslts.store.map_folder import write_map_folder
from gslts.store.measurements import (
    FILE,
    KEY,
    NO_MEASUREMENTS,
    TYPICAL_ERRORS,
    Measurements,
    measurement_problems,
    read_measurements,
    write_measurements,
)

IDS = np.array([3, 8, 2**63], np.uint64)
MEASURED = np.array([True, False, True])
ERRORS = np.array([[0.01, 0.2], [np.nan, 0.1], [np.nan, np.nan]], np.float32)
SAVED = {"ids": IDS, "is_measured": MEASURED, "errors": ERRORS, "noise": np.array([0.01, 0.002])}


def measurements() -> Measurements:
    return Measurements(IDS, MEASURED, ERRORS, (0.01, 0.002))


def gaussian() -> GaussianMap:
    return GaussianMap(
        means=np.zeros((1, 3), np.float32),
        quats=np.array([[1, 0, 0, 0]], np.float32),
        log_scales=np.full((1, 3), -4, np.float32),
        logit_opacities=np.zeros(1, np.float32),
        sh=np.zeros((1, 1, 3), np.float32),
    )


def folder_with(measured: Measurements, path: Path) -> Path:
    write_map_folder(
        path, gaussian(), {}, {}, lambda part: {KEY: write_measurements(measured, part)}
    )
    return path


def test_gaussians_that_are_not_listed_count_as_measured_with_typical_errors() -> None:
    wanted = np.array([8, 5, 2**63, 2**64 - 1, 3], np.uint64)
    assert measurements().is_measured_of(wanted).tolist() == [False, True, True, True, True]
    depth, color = np.float32(TYPICAL_ERRORS)
    expected = [[depth, 0.1], [depth, color], [depth, color], [depth, color], [0.01, 0.2]]
    np.testing.assert_allclose(measurements().errors_of(wanted), expected)
    assert NO_MEASUREMENTS.is_measured_of(wanted).all()
    assert (NO_MEASUREMENTS.errors_of(wanted) == np.float32(TYPICAL_ERRORS)).all()


def test_measurements_are_read_as_written(tmp_path: Path) -> None:
    path = folder_with(measurements(), tmp_path / "map")
    for version in (path, Path(f"{path}@1")):
        read = read_measurements(version)
        np.testing.assert_array_equal(read.ids, IDS)
        np.testing.assert_array_equal(read.is_measured, MEASURED)
        np.testing.assert_array_equal(read.errors, ERRORS)
        assert read.noise == (0.01, 0.002)
    assert measurement_problems(path) == []


def test_an_imported_map_has_none(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", gaussian(), {}, {})
    assert read_measurements(tmp_path / "map").ids.size == 0
    assert read_measurements(tmp_path / "map.ply").ids.size == 0


def test_damage_is_named(tmp_path: Path) -> None:
    path = folder_with(NO_MEASUREMENTS, tmp_path / "map")
    file = path / FILE
    file.write_bytes(save(SAVED))
    with pytest.raises(ValueError, match=r"measurements\.safetensors: it is damaged"):
        read_measurements(path)
    assert len(measurement_problems(path)) == 1
    file.unlink()
    with pytest.raises(FileNotFoundError, match="it is missing; copy it from a backup"):
        read_measurements(path)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        (None, "these are no measurements"),
        ({"ids": IDS.astype(np.int64)}, r"ids: expected uint64 \(3,\), got int64"),
        ({"ids": IDS[::-1].copy()}, "ids must rise"),
        ({"is_measured": MEASURED[:2]}, r"is_measured: expected bool \(3,\), got bool \(2,\)"),
        ({"errors": ERRORS[:, :1].copy()}, r"errors: expected float32 \(3, 2\)"),
        ({"errors": -ERRORS}, "errors must not be negative"),
        ({"errors": ERRORS + np.float32(np.inf)}, "errors must not be negative or infinite"),
        ({"noise": np.zeros(2)}, "noise must be positive"),
        ({"noise": np.array([np.nan, 1.0])}, "noise must be positive"),
        ({"noise": np.ones(3)}, "these are no measurements"),
    ],
)
def test_files_that_hold_no_measurements_are_rejected(
    tmp_path: Path, changed: dict[str, np.ndarray] | None, problem: str
) -> None:
    path = folder_with(measurements(), tmp_path / "map")
    content = b"no safetensors" if changed is None else save({**SAVED, **changed})
    old = hashlib.sha256((path / FILE).read_bytes()).hexdigest()
    (path / FILE).write_bytes(content)
    manifest = (path / MANIFEST).read_text()
    (path / MANIFEST).write_text(manifest.replace(old, hashlib.sha256(content).hexdigest()))
    with pytest.raises(ValueError, match=problem) as raised:
        read_measurements(path)
    assert "\n" not in str(raised.value)
