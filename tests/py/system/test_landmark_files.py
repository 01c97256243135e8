"""Files of landmarks along the versions of a map: updates, restored versions and damage."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import change_room
import numpy as np
import pytest
import update_room
from landmark_room import ARRAYS, assert_same, folder_with, found
from safetensors.numpy import load, save
from store_maps import ORACLE
from typer.testing import CliRunner

from gslts.cli import app
from gslts.io.ply import write_ply
from gslts.localization import landmark_files
from gslts.localization.constants import MAX_FILE_BYTES
from gslts.localization.landmark_files import (
    LANDMARK_FILES,
    has_landmarks,
    read_landmarks,
    write_landmarks,
)
from gslts.localization.landmarks import Landmarks
from gslts.store.causes import UpdateCause
from gslts.store.manifest import MANIFEST
from gslts.store.map_folder import open_map, read_map
from gslts.update.integrate import UpdateResult
from gslts.update.publish import publish


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return folder_with(found(), tmp_path / "map")


def files_of(folder: Path) -> list[Path]:
    return sorted((folder / LANDMARK_FILES.kind).iterdir())


def in_box(landmarks: Landmarks, box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return [L] True for landmarks in or near a box."""
    points = landmarks.positions
    return ((points > box[0] - 0.02) & (points < box[1] + 0.02)).all(axis=1)


def test_landmarks_are_read_as_written(folder: Path) -> None:
    assert has_landmarks(folder)
    assert_same(read_landmarks(folder), found())
    assert_same(read_landmarks(Path(f"{folder}@1")), found())
    (path,) = files_of(folder)
    assert path.stem == hashlib.sha256(path.read_bytes()).hexdigest()
    assert set(load(path.read_bytes())) == set(ARRAYS)
    with pytest.raises(ValueError, match="there is no version 2"):
        read_landmarks(Path(f"{folder}@2"))


def test_a_map_without_landmarks_has_none(tmp_path: Path) -> None:
    gaussian_map, _ = change_room.mapped()
    change_room.write_room_map(tmp_path / "map")
    assert not has_landmarks(tmp_path / "map")
    assert read_landmarks(tmp_path / "map") is None
    write_ply(gaussian_map, tmp_path / "map.ply")
    assert read_landmarks(tmp_path / "map.ply") is None
    publish_update(tmp_path / "map", addition())
    assert not (tmp_path / "map" / LANDMARK_FILES.kind).exists()


def test_landmarks_are_removed_and_restored_with_their_gaussians(folder: Path) -> None:
    gaussian_map = read_map(folder)
    low, high = update_room.REMOVED
    gone = ((gaussian_map.means > low - 0.01) & (gaussian_map.means < high + 0.01)).all(axis=1)
    with open_map(folder, writable=True) as store:
        store.commit(gaussian_map.select(~gone), UpdateCause())
        store.commit_features(
            replace(store.read(), features=np.ones((store.version().gaussians, 3), np.float32)),
            ORACLE,
        )
    left = read_landmarks(folder)
    assert left is not None
    lost = np.isin(found().gaussians, gaussian_map.ids[gone])
    assert 20 < lost.sum() < 200
    assert_same(left, found().select(~lost))
    assert in_box(found(), update_room.REMOVED).sum() > 5 * in_box(left, update_room.REMOVED).sum()
    assert_same(read_landmarks(Path(f"{folder}@1")), found())
    with open_map(folder, writable=True) as store:
        store.restore(1)
    assert_same(read_landmarks(folder), found())
    assert_same(read_landmarks(Path(f"{folder}@3")), left)


@cache
def addition() -> UpdateResult:
    home = update_room.changed_home("addition")
    return update_room.run_update(update_room.robot_in(home), "addition")


def publish_update(folder: Path, result: UpdateResult) -> None:
    gaussian_map, cameras = change_room.mapped()
    with open_map(folder, writable=True) as store:
        assert publish(store, gaussian_map, cameras.values(), result, update_room.UPDATE)


def test_an_update_adds_landmarks_of_new_gaussians(folder: Path) -> None:
    publish_update(folder, addition())
    both = read_landmarks(folder)
    assert both is not None
    assert len(files_of(folder)) == 2
    np.testing.assert_array_equal(both.positions[: found().size], found().positions)
    new = both.select(np.arange(found().size, both.size))
    assert 20 < new.size < 600
    assert (in_box(new, update_room.ADDED)).mean() > 0.9
    fresh = ~np.isin(new.gaussians, change_room.mapped()[0].ids)
    assert fresh.all()
    used = [view.camera.world_from_camera for view in addition().views]
    for pose in new.world_from_keyframe:
        assert any(np.array_equal(pose, known) for known in used)
    assert_same(read_landmarks(Path(f"{folder}@1")), found())
    with open_map(folder, writable=True) as store:
        store.restore(1)
    assert_same(read_landmarks(folder), found())
    with open_map(folder, writable=True) as store:
        store.restore(2)
    assert_same(read_landmarks(folder), both)


def test_an_update_without_keypoints_adds_none(folder: Path) -> None:
    views = [
        replace(view, frame=replace(view.frame, rgb=np.full_like(view.frame.rgb, 90)))
        for view in addition().views
    ]
    publish_update(folder, replace(addition(), views=tuple(views)))
    assert len(files_of(folder)) == 1
    with open_map(folder) as store:
        cause = store.version(2).cause
    assert isinstance(cause, UpdateCause)
    assert cause.landmarks is None
    assert_same(read_landmarks(folder), found())


def test_the_landmarks_of_many_updates_are_limited(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish_update(folder, addition())
    monkeypatch.setattr(landmark_files, "VERSION_BYTES", found().nbytes // 2)
    fewer = read_landmarks(folder)
    assert fewer is not None
    assert 0.9 * found().nbytes // 2 < fewer.nbytes <= found().nbytes // 2


def spoilt(content: bytes, harm: str) -> bytes:
    return {
        "cut": content[:-1],
        "flip": content[:-1] + bytes([content[-1] ^ 1]),
        "empty": b"",
        "grow": bytes(MAX_FILE_BYTES + 1),
    }[harm]


def one_array(dtype: str, shape: str) -> bytes:
    """Return a safetensors file with one empty array."""
    entry = f'{{"dtype":"{dtype}","shape":{shape},"data_offsets":[0,0]}}'
    header = f'{{"gaussians":{entry}}}'.encode()
    return len(header).to_bytes(8, "little") + header


def arrays(**others: np.ndarray) -> bytes:
    """Return a landmark file with other arrays."""
    return save({**{name: getattr(found(), name) for name in ARRAYS}, **others})


WRONG: dict[str, Callable[[], bytes]] = {
    "nothing": lambda: b"",
    "no header": lambda: b"landmarks",
    "huge header": lambda: (1 << 62).to_bytes(8, "little") + b"{}",
    "huge array": lambda: one_array("U64", "[4611686018427387904]"),
    "huge nothing": lambda: one_array("U64", "[18446744073709551615,0]"),
    "unknown dtype": lambda: one_array("F8_E4M3", "[0]"),
    "one array": lambda: one_array("U64", "[0]"),
    "one more": lambda: arrays(more=np.zeros(1)),
    "another shape": lambda: arrays(descriptors=np.zeros((9, 32), np.uint8)),
    "another dtype": lambda: arrays(gaussians=found().gaussians.astype(np.int64)),
    "not finite": lambda: arrays(positions=np.full((found().size, 3), np.inf, np.float32)),
}


def harmed(content: bytes, folder: Path) -> Path:
    """Make the manifest of a map name a file."""
    for path in files_of(folder):
        path.unlink()
    digest = hashlib.sha256(content).hexdigest()
    manifest = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps({**manifest, LANDMARK_FILES.kind: digest}))
    path = folder / LANDMARK_FILES.kind / f"{digest}.safetensors"
    path.write_bytes(content)
    return path


def messages_of(folder: Path) -> str:
    """Return the messages of reading a file and of gslts verify."""
    with pytest.raises((OSError, ValueError)) as error:
        read_landmarks(folder)
    message = str(error.value)
    assert "\n" not in message
    assert len(message) < 500
    done = CliRunner().invoke(app, ["verify", str(folder)])
    assert isinstance(done.exception, RuntimeError)
    assert str(done.exception) == f"{folder}: 1 problem(s), named above"
    assert done.stderr.splitlines()[-1] == f"version 1: {message}"
    return message


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        ("cut", "it is damaged: it has another SHA-256; copy it from a backup, or"),
        ("flip", "it is damaged: it has another SHA-256; copy it from a backup, or"),
        ("empty", "it is damaged: it has another SHA-256; copy it from a backup, or"),
        ("grow", "larger than 16,777,216 bytes"),
    ],
)
def test_a_damaged_file_is_named(folder: Path, harm: str, message: str) -> None:
    (path,) = files_of(folder)
    path.write_bytes(spoilt(path.read_bytes(), harm))
    assert messages_of(folder).startswith(f"{path}: {message}")


def test_a_missing_file_is_named(folder: Path) -> None:
    (path,) = files_of(folder)
    path.unlink()
    assert messages_of(folder) == (
        f"{path}: it is missing; copy it from a backup, or make the map again with gslts map"
    )


@pytest.mark.parametrize("what", WRONG)
def test_a_file_of_something_else_is_named(folder: Path, what: str) -> None:
    path = harmed(WRONG[what](), folder)
    assert messages_of(folder).startswith(f"{path}: these are no landmarks: ")


@pytest.mark.parametrize("name", [5, "../../secret", "ab" * 33, "x" * 64, {}])
def test_a_wrong_digest_in_the_manifest_is_named(folder: Path, name: object) -> None:
    manifest = json.loads((folder / MANIFEST).read_text())
    (folder / MANIFEST).write_text(json.dumps({**manifest, LANDMARK_FILES.kind: name}))
    assert messages_of(folder).startswith(
        f"{folder / MANIFEST}: landmarks: expected a SHA-256, got "
    )


def test_damage_of_an_update_leaves_earlier_versions_readable(folder: Path) -> None:
    (base,) = files_of(folder)
    publish_update(folder, addition())
    (path,) = {*files_of(folder)} - {base}
    path.write_bytes(path.read_bytes()[:-1])
    done = CliRunner().invoke(app, ["verify", str(folder)])
    assert done.stderr.splitlines()[-1].startswith(f"version 2: {path}: it is damaged")
    with pytest.raises(ValueError, match="it is damaged"):
        read_landmarks(folder)
    assert_same(read_landmarks(Path(f"{folder}@1")), found())


def test_files_that_no_version_names_are_removed(folder: Path) -> None:
    publish_update(folder, addition())
    named, both = files_of(folder), read_landmarks(folder)
    assert both is not None
    write_landmarks(found().select(np.arange(9)), folder)  # Of a commit that was stopped.
    (unnamed,) = {*files_of(folder)} - {*named}
    part = folder / LANDMARK_FILES.kind / ".abc.safetensors.1.part"
    part.write_bytes(b"half")
    size = unnamed.stat().st_size
    for freed in (size, 0):
        done = CliRunner().invoke(app, ["gc", str(folder)], catch_exceptions=False)
        assert done.stdout == f"{freed} bytes freed\n"
        assert files_of(folder) == named
    assert CliRunner().invoke(app, ["gc", str(folder), "--keep", "1"]).exit_code == 0
    assert_same(read_landmarks(folder), both)
    done = CliRunner().invoke(app, ["verify", str(folder)])
    assert done.stdout == "2 versions are intact\n"
