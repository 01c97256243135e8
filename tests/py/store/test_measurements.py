"""The files of what recordings tell of the Gaussians of their map."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save
from synthetic_rooms import extension_cause

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.store.manifest import MANIFEST
from gslts.store.map_folder import open_map, write_map_folder
from gslts.store.measurement_files import (
    MEASUREMENT_FILES,
    read_measurement_file,
    read_measurements,
    write_measurements,
)
from gslts.store.measurements import NO_MEASUREMENTS, TYPICAL_ERRORS, Measurements
from gslts.store.recorded_depths import RecordedDepths

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
        path, gaussian(), {}, {}, lambda part: {"measurements": write_measurements(measured, part)}
    )
    return path


def file_of(path: Path) -> Path:
    """Return the only file of measurements of a map."""
    (file,) = (path / "measurements").iterdir()
    return file


def problems_of(path: Path) -> list[str]:
    with open_map(path) as store:
        return MEASUREMENT_FILES.find_problems(store, read_measurement_file)


def extend(path: Path, measured: Measurements) -> None:
    """Commit an extension of a map by a Gaussian."""
    with open_map(path, writable=True) as store:
        store.commit(
            join(store.read(), gaussian(), store.version().next_id), extension_cause(measured, path)
        )


def depths_of(*depths_mm: int) -> RecordedDepths:
    """Return an image of one row."""
    size = {"width": len(depths_mm), "height": 1}
    camera = Camera(fx=9, fy=9, cx=1, cy=0.5, **size, world_from_camera=np.eye(4))
    return RecordedDepths((camera,), np.array(depths_mm, np.uint16))


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
    assert problems_of(path) == []


def test_an_extension_adds_its_own(tmp_path: Path) -> None:
    first = Measurements(np.zeros(1, np.uint64), MEASURED[:1], ERRORS[:1], depths=depths_of(7, 8))
    path = folder_with(first, tmp_path / "map")
    added = replace(measurements(), depths=depths_of(9))
    assert added.of_new(8).ids.tolist() == [8, 2**63]
    extend(path, added)
    both = read_measurements(path)
    assert both.ids.tolist() == [0, *IDS.tolist()]
    np.testing.assert_array_equal(both.errors, np.concatenate([ERRORS[:1], ERRORS]))
    assert both.noise == first.noise
    assert len(both.depths.cameras) == 2
    assert both.depths.depths_mm.tolist() == [7, 8, 9]
    assert read_measurements(Path(f"{path}@1")).ids.tolist() == [0]
    assert problems_of(path) == []
    with open_map(path, writable=True) as store:
        store.restore(1)
    assert read_measurements(path).ids.tolist() == [0]


def test_a_damaged_file_of_an_extension_is_named_with_its_version(tmp_path: Path) -> None:
    path = folder_with(NO_MEASUREMENTS, tmp_path / "map")
    base = file_of(path)
    extend(path, measurements())
    (file,) = {*base.parent.iterdir()} - {base}
    file.write_bytes(b"")
    (problem,) = problems_of(path)
    assert problem.startswith(f"version 2: {file}: it is damaged")
    assert read_measurements(Path(f"{path}@1")).ids.size == 0
    with open_map(path, writable=True) as store:
        store.restore(1)
        assert MEASUREMENT_FILES.remove_unneeded(store) == 0  # Version 2 still names it.


def test_the_file_of_an_older_map_is_found_beside_the_manifest(tmp_path: Path) -> None:
    path = folder_with(measurements(), tmp_path / "map")
    file_of(path).rename(path / "measurements.safetensors")
    assert read_measurements(path).ids.tolist() == IDS.tolist()
    extend(path, replace(measurements(), ids=np.array([1, 2, 3], np.uint64) + IDS[-1]))
    assert len(read_measurements(path).ids) == 6
    with open_map(path, writable=True) as store:
        assert MEASUREMENT_FILES.remove_unneeded(store) == 0


def test_an_imported_map_has_none(tmp_path: Path) -> None:
    write_map_folder(tmp_path / "map", gaussian(), {}, {})
    assert read_measurements(tmp_path / "map").ids.size == 0
    assert read_measurements(tmp_path / "map.ply").ids.size == 0


def test_damage_is_named(tmp_path: Path) -> None:
    path = folder_with(NO_MEASUREMENTS, tmp_path / "map")
    file = file_of(path)
    file.write_bytes(save(SAVED))
    with pytest.raises(ValueError, match=r"\.safetensors: it is damaged"):
        read_measurements(path)
    assert len(problems_of(path)) == 1
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
    old, new = file_of(path), hashlib.sha256(content).hexdigest()
    old.with_stem(new).write_bytes(content)
    manifest = (path / MANIFEST).read_text()
    (path / MANIFEST).write_text(manifest.replace(old.stem, new))
    with pytest.raises(ValueError, match=problem) as raised:
        read_measurements(path)
    assert "\n" not in str(raised.value)
