"""Settings of the mapping engine, and folders of maps."""

import json
from pathlib import Path

import numpy as np
import pytest

import gslts
from gslts.mapping.config import PRESETS, MappingConfig
from gslts.store.manifest import read_manifest
from gslts.store.map_folder import read_map, write_map_folder


def test_presets_differ_in_cost() -> None:
    assert PRESETS["fast"].iterations < PRESETS["balanced"].iterations < PRESETS["best"].iterations
    with pytest.raises(ValueError, match="voxel"):
        MappingConfig(voxel_m=0)


def small_map() -> gslts.GaussianMap:
    return gslts.GaussianMap(
        means=np.zeros((2, 3)),
        quats=np.tile([1.0, 0, 0, 0], (2, 1)),
        log_scales=np.zeros((2, 3)),
        logit_opacities=np.zeros(2),
        sh=np.zeros((2, 1, 3)),
        ids=np.array([7, 9], np.uint64),
    ).astype(np.float32)


def test_settings_are_checked() -> None:
    config = PRESETS["fast"].with_settings(["voxel_m=0.5", "fill_holes=false", "iterations=7"])
    assert (config.voxel_m, config.fill_holes, config.iterations) == (0.5, False, 7)
    assert config.seed_contrast == PRESETS["fast"].seed_contrast
    for setting, message in (
        ("voxel_m=-1", "voxel_m=-1: Input should be greater than 0"),
        ("iterations=many", "iterations=many: Input should be a valid integer"),
        ("voxel=1", "voxel=1: expected NAME=VALUE, NAME one of iterations, "),
        ("seed", "seed: expected NAME=VALUE"),
        ("budget_s=nan", "budget_s=nan: Input should be "),
        ("means_rate=inf", "means_rate=inf: Input should be a finite number"),
        ("min_opacity=1", "min_opacity=1: Input should be less than 1"),
    ):
        with pytest.raises(ValueError, match=f"^{message}"):
            config.with_settings([setting])


def test_map_folder_round_trip(tmp_path: Path) -> None:
    camera = gslts.camera_from_fov(8, 6, 1.0, np.eye(4))
    write_map_folder(tmp_path / "map", small_map(), {"dataset": "x"}, {"a": camera})
    gaussian_map, manifest = read_map(tmp_path / "map"), read_manifest(tmp_path / "map")
    np.testing.assert_array_equal(gaussian_map.ids, [7, 9])
    assert manifest["dataset"] == "x"
    cameras = json.loads((tmp_path / "map" / "cameras.json").read_text())
    assert cameras["a"]["world_from_camera"] == np.eye(4).tolist()
    assert [path.name for path in tmp_path.iterdir()] == ["map"]
    with pytest.raises(FileExistsError, match="map exists already"):
        write_map_folder(tmp_path / "map", small_map(), {}, {})


def test_a_failed_write_leaves_no_map(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_map_folder(tmp_path / "map", small_map(), {"bad": object()}, {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("manifest", "message"),
    [
        ("{", r"manifest\.json: Expecting"),
        ("[]", "not the manifest of a map"),
        ("[" * 100_000, r"manifest\.json: maximum recursion depth"),
        ('{"format": "gslts-map", "version": 3}', "version is 3, this gslts reads 2"),
    ],
)
def test_folders_that_are_no_maps_are_rejected(tmp_path: Path, manifest: str, message: str) -> None:
    write_map_folder(tmp_path / "map", small_map(), {}, {})
    (tmp_path / "map" / "manifest.json").write_text(manifest)
    with pytest.raises(ValueError, match=message):
        read_map(tmp_path / "map")
