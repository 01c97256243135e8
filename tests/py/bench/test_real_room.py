"""Tests of objects found in a map, of changes made in it, and of their score."""

from collections.abc import Sequence

import numpy as np
import pytest

from gslts.change.changes import Change, Kind
from gslts.change.detection import Detection
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import render
from gslts_bench.real.map_changes import SIDES_OF, MapChange, make_changes
from gslts_bench.real.objects import StandingObject, find_objects, free_places
from gslts_bench.real.planes import surface_points
from gslts_bench.real.room_run import RoomRecord, judge
from gslts_bench.real.room_tables import summarize, tabulate

SPACING_M = 0.02
TABLE, BOX = np.array([0.6, 0.5, 0.4]), np.array([1.0, 1.0, 1.0])
"""Grey of the table, and white."""
LOW, HIGH = np.array([-0.06, -0.06, 0.0]), np.array([0.06, 0.06, 0.14])
"""Box that stands on a table at z = 0, m."""


def camera(turn_rad: float) -> Camera:
    """A camera beside the table that looks at the box."""
    eye = np.array([0.9 * np.cos(turn_rad), 0.9 * np.sin(turn_rad), 0.7])
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    return Camera(width=320, height=240, fx=260, fy=260, cx=160, cy=120, world_from_camera=pose)


def grid(low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """Points of a surface that is flat along one axis."""
    axes = [np.arange(a, b + SPACING_M / 2, SPACING_M) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)


CAMERAS = [camera(turn) for turn in np.linspace(0, 5, 8)]


@pytest.fixture(scope="module")
def table() -> GaussianMap:
    """A box on a table."""
    sides = []
    for axis in range(3):
        for end in (LOW, HIGH):
            low, high = LOW.copy(), HIGH.copy()
            low[axis] = high[axis] = end[axis]
            sides.append(grid(low, high))
    plane, box = grid((-0.6, -0.6, 0), (0.6, 0.6, 0)), np.concatenate(sides[:4] + sides[5:])
    means = np.concatenate([plane, box]).astype(np.float32)
    colors = np.concatenate([np.tile(TABLE, (len(plane), 1)), np.tile(BOX, (len(box), 1))])
    size = len(means)
    return GaussianMap(
        means=means,
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.full((size, 3), np.log(0.012), np.float32),
        logit_opacities=np.full(size, 4, np.float32),
        sh=((colors - 0.5) / 0.28209479).astype(np.float32)[:, None],
    )


@pytest.fixture(scope="module")
def box(table: GaussianMap) -> StandingObject:
    """The box as it is found."""
    (found,) = find_objects(table, surface_points(table, CAMERAS), seed=0)
    return found


def test_the_box_is_the_object(table: GaussianMap, box: StandingObject) -> None:
    own = table.means[box.rows]
    assert (own >= LOW - 1e-3).all()
    assert (own <= HIGH + 1e-3).all()
    above = ((table.means >= LOW - 1e-3) & (table.means <= HIGH + 1e-3)).all(axis=1)
    above &= table.means[:, 2] > 0.015
    assert len(box.rows) == above.sum()
    np.testing.assert_allclose(box.plane.axes[2], [0, 0, 1], atol=0.02)
    assert box.height_m == pytest.approx(0.14, abs=0.01)


def test_places_are_free_and_on_the_table(table: GaussianMap, box: StandingObject) -> None:
    surface = surface_points(table, CAMERAS)
    steps = list(free_places(box, surface.points, np.random.default_rng(0)))
    again = list(free_places(box, surface.points, np.random.default_rng(0)))
    np.testing.assert_array_equal(steps, again)
    shifts = np.array([box.plane.shift(step) for step in steps])
    assert len(shifts) > 100
    assert np.abs(shifts[:, 2]).max() < 0.02
    assert np.abs(shifts[:, :2]).max() < 0.6
    assert np.abs(shifts[:, :2]).max(axis=1).min() >= 0.12, "the box would overlap itself"


def white(gaussian_map: GaussianMap) -> np.ndarray:
    """Columns of the white pixels."""
    rgb = render(gaussian_map, CAMERAS[0]).rgb
    return np.flatnonzero((rgb[..., 2] > 0.7).any(axis=0))


@pytest.mark.parametrize("kind", SIDES_OF)
def test_the_map_is_changed_the_other_way_round(
    table: GaussianMap, box: StandingObject, kind: Kind
) -> None:
    step = np.array([0, 0])
    for step in free_places(box, surface_points(table, CAMERAS).points, np.random.default_rng(1)):
        shift = box.plane.shift(step)
        if abs(shift[1]) > 0.25 and abs(shift[0]) < 0.2:  # Far to one side in the image.
            break
    change = MapChange("00_0", kind, box, step, "frame")
    truth = change.truth(table, CAMERAS[0])
    changed = change.changed_map(table)
    assert [mask is not None for mask in truth.masks] == [
        kind != "addition",
        kind != "removal",
    ]
    columns = white(changed)
    expected = set[int]()
    if kind != "addition":
        assert truth.masks[0] is not None
        expected |= set(np.flatnonzero(truth.masks[0].any(axis=0)).tolist())
    if kind == "removal":  # The map has it twice.
        expected |= set(white(table).tolist())
    assert len(expected ^ set(columns.tolist())) <= 8
    alpha = render(changed, CAMERAS[0]).alpha
    assert alpha[render(table, CAMERAS[0]).alpha > 0.9].min() > 0.5, "the table has no hole"


def test_changes_are_seen_by_their_frames(table: GaussianMap) -> None:
    frames = {str(k): camera for k, camera in enumerate(CAMERAS)}
    made = make_changes(table, CAMERAS, frames, 5, seed=0)
    again = make_changes(table, CAMERAS, frames, 5, seed=0)
    assert [(c.kind, c.name) for c in made] == [(c.kind, c.name) for c in again]
    assert {kind: sum(c.kind == kind for c in made) for kind in SIDES_OF} == dict.fromkeys(
        SIDES_OF, 5
    )
    for change in made:
        truth = change.truth(table, frames[change.frame])
        assert all(mask.sum() >= 100 for mask in truth.masks if mask is not None)


def reported(kind: Kind, before: int | None, after: int | None, confidence: float = 0.9) -> Change:
    """A change with regions of 20 px at some columns."""
    masks = []
    for column in (before, after):
        mask = None if column is None else np.zeros((60, 80), bool)
        if mask is not None:
            mask[20:40, column : column + 20] = True
        masks.append(mask)
    return Change(kind, confidence, np.zeros(3), masks=(masks[0], masks[1]))


def test_kind_and_place_of_the_first_report_count() -> None:
    truth = reported("relocation", 0, 40)

    def answer(*changes: Change, unreliable: str | None = None) -> dict[str, object]:
        detection = Detection(changes, unreliable, CAMERAS[0], np.zeros((60, 80, 3), np.float32))
        return judge(truth, detection, 160)

    assert answer(reported("relocation", 5, 45)) == {
        "unreliable": 0, "right": True, "found": True, "others": (),
    }  # fmt: skip
    assert not answer(reported("relocation", 5, 60))["found"]
    end = answer(reported("addition", None, 40))
    assert (end["found"], end["others"]) == (False, ())
    late = answer(reported("removal", 60, None, 0.95), reported("relocation", 0, 40))
    assert (late["right"], late["found"], late["others"]) == (False, True, (0.95,))
    assert answer(unreliable="blurred")["unreliable"] == 1


def test_tables_count_changes_frames_and_sequences() -> None:
    records = [
        RoomRecord(id="a", part="frame", detector="objects", others=(0.9, 0.8)),
        RoomRecord(id="b", part="frame", detector="objects", unreliable=1),
        RoomRecord(id="c", part="sequence", detector="located", frames=7, others=(0.9,)),
        RoomRecord(id="d", part="addition", detector="objects", object_name="x", right=True),
    ]
    changes, frames, sequences = tabulate(summarize(records))
    assert changes.rows[0] == (
        "addition", "1", "1", "100.0 % (1 of 1)", "0.0 % (0 of 1)", "0.00", "0.0 % (0 of 1)",
    )  # fmt: skip
    assert changes.rows[1][3] == "-"
    assert frames.rows == [("`objects`, given poses", "50.0 % (1 of 2)", "1.00", "50.0 % (1 of 2)")]
    assert sequences.rows == [("`objects`, `--localize`", "1", "7", "1", "0.0 % (0 of 7)")]
