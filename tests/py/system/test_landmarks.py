"""Landmarks: their positions, and their files along the versions of a map."""

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
from landmark_room import folder_with, found, frames
from safetensors.numpy import load, save
from store_maps import ORACLE
from typer.testing import CliRunner

from gslts._core import reloc
from gslts.cli import app
from gslts.core.frame import RgbdFrame
from gslts.io.ply import write_ply
from gslts.localization import landmark_files
from gslts.localization.constants import (
    DESCRIPTOR_RADIUS_PX,
    MAX_FILE_BYTES,
    MAX_GAUSSIAN_DISTANCE_M,
    SAME_LANDMARK_BITS,
    SAME_LANDMARK_M,
)
from gslts.localization.landmark_extraction import extract_landmarks, gray_image
from gslts.localization.landmark_files import (
    FOLDER,
    KEY,
    has_landmarks,
    read_landmarks,
    write_landmarks,
)
from gslts.localization.landmarks import Landmarks, concatenate, limit_size, remove_duplicates
from gslts.store.causes import UpdateCause
from gslts.store.manifest import MANIFEST
from gslts.store.map_folder import open_map, read_map
from gslts.update.integrate import UpdateResult
from gslts.update.publish import publish
from gslts_sim.physics import boxes_in_world

ARRAYS = ("positions", "descriptors", "keyframes", "world_from_keyframe", "gaussians")
SPLIT_PX = change_room.SIZE["width"] // 2


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return folder_with(found(), tmp_path / "map")


def files_of(folder: Path) -> list[Path]:
    return sorted((folder / FOLDER).iterdir())


def assert_same(one: Landmarks | None, other: Landmarks) -> None:
    assert one is not None
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def off_surfaces_m(points: np.ndarray) -> np.ndarray:
    """Return [P] distances to the nearest face of any box of the room, m."""
    off = []
    for thing in change_room.home().objects:
        boxes = boxes_in_world(thing)
        for center, half in zip(boxes.centers, boxes.halves, strict=True):
            beyond = np.abs(points - center) - half
            outside = np.linalg.norm(beyond.clip(0), axis=1)
            off.append(np.abs(outside + np.minimum(beyond.max(axis=1), 0)))
    return np.min(off, axis=0)


def pixels_of(landmarks: Landmarks, frame: RgbdFrame) -> np.ndarray:
    """Return [L,2] pixels of landmarks in an image."""
    camera, pose = frame.camera, frame.camera.world_from_camera
    x, y, z = ((landmarks.positions - pose[:3, 3]) @ pose[:3, :3]).T
    assert (z > 0).all()
    return np.column_stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy])


def in_box(landmarks: Landmarks, box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return [L] True for landmarks in or near a box."""
    points = landmarks.positions
    return ((points > box[0] - 0.02) & (points < box[1] + 0.02)).all(axis=1)


def test_landmarks_are_on_the_surfaces() -> None:
    assert found().size > 1500
    off_m = off_surfaces_m(found().positions)
    assert np.median(off_m) < 0.012
    assert np.quantile(off_m, 0.95) < 0.03
    assert off_m.max() < 0.1


def test_each_landmark_is_a_keypoint_of_its_keyframe() -> None:
    poses = [one.camera.world_from_camera for one in frames()]
    for row, pose in enumerate(found().world_from_keyframe):
        (number,) = (k for k, one in enumerate(poses) if np.array_equal(one, pose))
        own = found().select(found().keyframes == row)
        rule = reloc.FeatureRule(count=4000)
        pixels, looks = reloc.features_of(gray_image(frames()[number].rgb), None, rule)
        apart_px = np.linalg.norm(pixels_of(own, frames()[number])[:, None] - pixels, axis=2)
        same = (own.descriptors[:, None] == looks).all(axis=2)
        assert ((apart_px < 0.01) & same).any(axis=1).mean() > 0.9


def test_each_landmark_is_near_its_gaussian() -> None:
    gaussian_map, _ = change_room.mapped()
    rows = np.searchsorted(gaussian_map.ids, found().gaussians)
    np.testing.assert_array_equal(gaussian_map.ids[rows], found().gaussians)
    apart_m = np.linalg.norm(gaussian_map.means[rows] - found().positions, axis=1)
    assert apart_m.max() < MAX_GAUSSIAN_DISTANCE_M + 1e-5


def test_landmarks_do_not_depend_on_the_number_of_threads() -> None:
    gaussian_map, _ = change_room.mapped()
    assert_same(extract_landmarks(gaussian_map, frames(), threads=2), found())


def test_frames_from_one_pose_are_one_keyframe() -> None:
    gaussian_map, _ = change_room.mapped()
    one = extract_landmarks(gaussian_map, frames()[:1], threads=1)
    assert_same(extract_landmarks(gaussian_map, frames()[:1] * 3, threads=1), one)
    assert len(one.world_from_keyframe) == 1


def test_depth_need_not_be_measured() -> None:
    blind = [replace(one, depth=np.zeros_like(one.depth)) for one in frames()]
    landmarks = extract_landmarks(change_room.mapped()[0], blind, threads=1)
    assert landmarks.size > 0.5 * found().size
    assert np.quantile(off_surfaces_m(landmarks.positions), 0.95) < 0.03


def test_there_are_none_where_map_and_depth_disagree() -> None:
    frame = frames()[-1]
    depth = frame.depth.copy()
    depth[:, :SPLIT_PX] *= 1.2
    landmarks = extract_landmarks(change_room.mapped()[0], [replace(frame, depth=depth)], threads=1)
    assert landmarks.size > 20
    assert pixels_of(landmarks, frame)[:, 0].min() > SPLIT_PX - 0.01


def test_descriptors_do_not_reach_beyond_the_mask() -> None:
    frame = frames()[-1]
    mask = np.ones(frame.depth.shape, np.bool_)
    mask[:, :SPLIT_PX] = False
    seen = replace(frame, mask=mask)
    landmarks = extract_landmarks(change_room.mapped()[0], [seen], threads=1)
    assert landmarks.size > 20
    assert pixels_of(landmarks, frame)[:, 0].min() > SPLIT_PX + DESCRIPTOR_RADIUS_PX - 1
    wanted = extract_landmarks(change_room.mapped()[0], [frame], [mask], threads=1)
    assert -0.01 < pixels_of(wanted, frame)[:, 0].min() - SPLIT_PX < DESCRIPTOR_RADIUS_PX


def test_no_frames_give_no_landmarks() -> None:
    gaussian_map, _ = change_room.mapped()
    grey = replace(frames()[0], rgb=np.full_like(frames()[0].rgb, 90))
    for none in ([], [grey]):
        landmarks = extract_landmarks(gaussian_map, none, threads=1)
        assert landmarks.size == len(landmarks.world_from_keyframe) == 0
    assert concatenate([]).size == 0


def test_the_size_is_limited_evenly_over_keyframes() -> None:
    gaussian_map, _ = change_room.mapped()
    for most in (found().nbytes // 2, 20_000):
        fewer = extract_landmarks(gaussian_map, frames(), max_bytes=most, threads=1)
        assert 0.8 * most < fewer.nbytes <= most
        share = fewer.size / found().size
        for pose, count in zip(
            found().world_from_keyframe, np.bincount(found().keyframes), strict=True
        ):
            (row,) = np.flatnonzero((fewer.world_from_keyframe == pose).all(axis=(1, 2)))
            assert abs((fewer.keyframes == row).sum() - share * count) < 2
    assert limit_size(found(), found().nbytes) is found()
    assert limit_size(found(), 0).size == 0


def flipped(landmarks: Landmarks, bits: int, shift_m: float) -> Landmarks:
    """Return the same landmarks with a few other bits and positions."""
    one = np.unpackbits(landmarks.descriptors, axis=1)
    one[:, :bits] ^= 1
    positions = landmarks.positions + np.float32([0, 0, shift_m])
    return replace(landmarks, positions=positions, descriptors=np.packbits(one, axis=1))


def test_duplicates_are_removed() -> None:
    assert remove_duplicates(found()).size == found().size
    again = flipped(found(), SAME_LANDMARK_BITS - 1, 0.9 * SAME_LANDMARK_M)
    assert_same(remove_duplicates(concatenate([found(), again])), found())
    for other in (
        flipped(found(), SAME_LANDMARK_BITS, 0.0),
        flipped(found(), 0, 1.1 * SAME_LANDMARK_M),
    ):
        assert remove_duplicates(concatenate([found(), other])).size > 1.8 * found().size


def test_duplicates_are_those_of_all_pairs() -> None:
    rng = np.random.default_rng(0)
    positions = rng.uniform(-0.05, 0.05, (400, 3)).astype(np.float32)
    bits = rng.integers(0, 2, (3, 256))[rng.integers(0, 3, 400)] ^ (rng.random((400, 256)) < 0.055)
    landmarks = Landmarks(
        positions,
        np.packbits(bits.astype(np.uint8), axis=1),
        np.zeros(400, np.int32),
        np.eye(4)[None],
        np.arange(400, dtype=np.uint64),
    )
    kept: list[int] = []
    for k in range(400):
        near = np.linalg.norm(positions[kept] - positions[k], axis=1) < SAME_LANDMARK_M
        if not (near & ((bits[kept] != bits[k]).sum(axis=1) < SAME_LANDMARK_BITS)).any():
            kept.append(k)
    assert 150 < len(kept) < 390
    assert_same(remove_duplicates(landmarks), landmarks.select(np.array(kept)))


def test_selected_landmarks_keep_their_keyframes() -> None:
    rows = np.arange(found().size)[::-7]
    some = found().select(rows)
    both = concatenate([some, found()])
    assert both.size == some.size + found().size
    for landmarks, of in ((some, rows), (both, np.concatenate([rows, np.arange(found().size)]))):
        np.testing.assert_array_equal(
            landmarks.world_from_keyframe[landmarks.keyframes],
            found().world_from_keyframe[found().keyframes[of]],
        )
    ids = found().gaussians[:9]
    living = found().of_gaussians(ids)
    assert set(living.gaussians.tolist()) == set(ids.tolist())
    assert len(living.world_from_keyframe) == len(np.unique(living.keyframes))


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("positions", np.zeros((1, 3))),
        ("positions", np.full((1, 3), np.nan, np.float32)),
        ("descriptors", np.zeros((1, 31), np.uint8)),
        ("descriptors", np.zeros((2, 32), np.uint8)),
        ("keyframes", np.ones(1, np.int32)),
        ("keyframes", np.full(1, -1, np.int32)),
        ("world_from_keyframe", np.zeros((0, 4, 4))),
        ("world_from_keyframe", 2 * np.eye(4)[None]),
        ("world_from_keyframe", np.diag([1.0, 1, -1, 1])[None]),
        ("world_from_keyframe", np.full((1, 4, 4), np.nan)),
        ("world_from_keyframe", np.full((1, 4, 4), 1e200)),
        ("world_from_keyframe", np.zeros(())),
        ("gaussians", np.zeros(1, np.int64)),
        ("gaussians", np.zeros((1, 1), np.uint64)),
        ("gaussians", np.zeros((), np.uint64)),
    ],
)
def test_invalid_arrays_are_rejected(name: str, array: np.ndarray) -> None:
    one = {
        "positions": np.zeros((1, 3), np.float32),
        "descriptors": np.zeros((1, 32), np.uint8),
        "keyframes": np.zeros(1, np.int32),
        "world_from_keyframe": np.eye(4)[None],
        "gaussians": np.zeros(1, np.uint64),
    }
    Landmarks(**one)
    named = "keyframes" if array.shape == (0, 4, 4) else name
    with pytest.raises(ValueError, match=f"Landmarks: {named}: "):
        Landmarks(**{**one, name: array})


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
    assert not (tmp_path / "map" / FOLDER).exists()


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
        assert any(np.array_equal(pose, one) for one in used)
    assert_same(read_landmarks(Path(f"{folder}@1")), found())
    with open_map(folder, writable=True) as store:
        store.restore(1)
    assert_same(read_landmarks(folder), found())
    with open_map(folder, writable=True) as store:
        store.restore(2)
    assert_same(read_landmarks(folder), both)


def test_an_update_without_keypoints_adds_none(folder: Path) -> None:
    views = [
        replace(one, frame=replace(one.frame, rgb=np.full_like(one.frame.rgb, 90)))
        for one in addition().views
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
    (folder / MANIFEST).write_text(json.dumps({**manifest, KEY: digest}))
    path = folder / FOLDER / f"{digest}.safetensors"
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
        ("cut", "it is damaged: its content is not that of its name; copy it from a backup, or"),
        ("flip", "it is damaged: its content is not that of its name; copy it from a backup, or"),
        ("empty", "it is damaged: its content is not that of its name; copy it from a backup, or"),
        ("grow", "larger than 16 MiB"),
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
    (folder / MANIFEST).write_text(json.dumps({**manifest, KEY: name}))
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
    part = folder / FOLDER / ".abc.safetensors.1.part"
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
