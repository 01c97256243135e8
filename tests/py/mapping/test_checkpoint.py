"""Checkpoint files: round trip, and one-line errors of damaged ones."""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from striped_wall import grey_wall, half_striped

import gslts
from gslts.mapping.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from gslts.mapping.config import MappingConfig
from gslts.mapping.lenses import Lenses
from gslts.mapping.optimize import Optimizer, Schedule
from gslts.mapping.report.data import CurvePoint
from gslts.rendering.adam import Adam

FRAMES, TRAINING = 10, 8
Arrays = dict[str, Any]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    random_map = scenes.random_map(5, dtype=np.float32)
    camera = gslts.camera_from_fov(8, 6, 1.0, np.eye(4))
    checkpoint = Checkpoint(
        config=MappingConfig(),
        frames=tuple(f"{k:02}" for k in range(FRAMES)),
        gaussian_map=random_map,
        adam=Adam(random_map).state,
        iteration=3,
        epoch=1,
        random=dict(np.random.default_rng(4).bit_generator.state),
        poses=np.tile(np.eye(4), (TRAINING, 1, 1)),
        exposures=np.ones((TRAINING, 2, 3)),
        exposures_rejected=(2,),
        lenses=Lenses(camera, camera),
        pose_stds=(0.1, 0.2),
        curve=(CurvePoint(1.0, 3, 0, 20.0, None, 5),),
        seeds=5,
        seconds={"reading": 1.5},
    )
    write_checkpoint(tmp_path / "map.npz", checkpoint)
    return tmp_path / "map.npz"


def change(path: Path, **arrays: Any) -> None:
    with np.load(path) as old:
        whole = dict(old)
    np.savez(path, **whole | arrays)


def change_state(path: Path, **values: Any) -> None:
    with np.load(path) as old:
        state = json.loads(old["state"].tobytes())
    change(path, state=as_bytes(json.dumps(state | values)))


def change_header(path: Path, name: str, shape: tuple[int, ...]) -> None:
    """Let the header of an array promise another shape than its bytes have."""
    with zipfile.ZipFile(path) as file:
        contents = {entry: file.read(entry) for entry in file.namelist()}
    header = io.BytesIO()
    lie = {"descr": "<u4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(header, lie)
    contents[f"{name}.npy"] = header.getvalue() + bytes(64)
    with zipfile.ZipFile(path, "w") as file:
        for entry, content in contents.items():
            file.writestr(entry, content)


def as_bytes(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), np.uint8)


def test_a_checkpoint_that_is_kept_does_not_change() -> None:
    """Later steps change the map of the optimizer in place."""
    observation = half_striped()
    schedule = Schedule(10, ((float("inf"), 0),))
    optimizer = Optimizer(grey_wall(), [observation], observation.lenses, MappingConfig(), schedule)
    kept = Checkpoint.of(optimizer, MappingConfig(), ("00",), (), 5, {})
    means, ids = kept.gaussian_map.means.copy(), kept.gaussian_map.ids.copy()
    optimizer.step(observation, 0.0)
    assert (optimizer.adam.map.means != means).any()
    np.testing.assert_array_equal(kept.gaussian_map.means, means)
    np.testing.assert_array_equal(kept.gaussian_map.ids, ids)


def test_round_trip(path: Path) -> None:
    content = path.read_bytes()
    checkpoint = read_checkpoint(path)
    assert checkpoint.seconds == {"reading": 1.5}
    assert len(checkpoint.poses) == TRAINING
    write_checkpoint(path, checkpoint)
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda p: change(p, state=as_bytes("[]")), "state is not a JSON object"),
        (lambda p: change(p, state=as_bytes("[" * 100_000)), "recursion"),
        (lambda p: change(p, state=as_bytes("{")), "Expecting"),
        (lambda p: change(p, state=np.zeros(3)), ""),
        (lambda p: change(p, poses=np.zeros((7, 4, 4))), r"expected float64 \(8, 4, 4\), got"),
        (lambda p: change(p, poses=np.zeros((8, 4))), r"poses: .* got float64 \(8, 4\)"),
        (lambda p: change(p, poses=np.zeros((8, 4, 4), "U1")), r"poses: .* got <U1"),
        (lambda p: change(p, exposures=np.zeros((8, 3, 2))), r"exposures: .* \(8, 2, 3\), got"),
        (lambda p: change(p, means=np.zeros((5, 2), np.float32)), "means"),
        (lambda p: change(p, poses=np.full((8, 4, 4), np.nan)), "poses: expected finite numbers"),
        (lambda p: change(p, sh=np.full((5, 1, 3), np.inf, np.float32)), "sh.* is inf"),
        (lambda p: change(p, first=np.full((5, 14), np.nan, np.float32)), "first: expected finite"),
        (lambda p: change(p, steps=np.full(5, 4, np.uint32)), "steps: .* at most 3, got 4"),
        (lambda p: change(p, steps=np.full(5, 2**32 - 1, np.uint32)), "steps: .* got 4294967295"),
        (lambda p: change_header(p, "steps", (10**12,)), "Unable to allocate"),
        (lambda p: change_state(p, frames=["00"]), "poses: expected"),
        (lambda p: change_state(p, iteration=float("inf")), "infinity"),
        (lambda p: change_state(p, random=[]), "state"),
        (lambda p: change_state(p, seconds=[]), "items"),
        (lambda p: change_state(p, config={"iterations": -1, "voxel": 2}), "2 validation errors"),
        (lambda p: change_state(p, lenses=[[], []]), ""),
        (lambda p: p.write_bytes(p.read_bytes().replace(b"means.npy", b"means.npz")), ""),
    ],
)
def test_damage_is_one_line(path: Path, damage: Callable[[Path], None], reason: str) -> None:
    damage(path)
    wanted = rf"map\.npz: not a checkpoint of a map: .*{reason}"
    with pytest.raises(ValueError, match=wanted) as error:
        read_checkpoint(path)
    assert len(str(error.value).splitlines()) == 1
