"""Rules of `gslts._core.detect` on images made by hand: a wall 2 m ahead, and boxes."""

from typing import Any

import numpy as np
import pytest
from change_images import CAMERA, HEIGHT, POSE, WALL_M, WIDTH, blank, put
from hypothesis import given
from hypothesis import strategies as st

from gslts._core import detect as core
from gslts._core.detect import ChangeType, MaskRule, ObjectRule, PaperRule
from gslts.core.camera import Camera


def found(
    images: dict[str, np.ndarray], rule: ObjectRule | None = None
) -> tuple[list[Any], np.ndarray]:
    views = core.Views(camera=CAMERA, **images)
    masks = core.masks_of(views, MaskRule())
    rule = ObjectRule() if rule is None else rule
    surfaces, labels = core.changed_surfaces(views, masks, rule)
    return core.changes_of(surfaces, rule), labels


def at(row: float, column: float, depth_m: float) -> np.ndarray:
    """Unproject a pixel to (3,) in the world, m; (0.5, 0.5) is the middle of the first pixel."""
    x, y = (column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy
    return POSE[:3, :3] @ (np.array([x, y, 1]) * depth_m) + POSE[:3, 3]


def test_equal_images_have_no_change() -> None:
    changes, labels = found(blank())
    assert changes == []
    assert labels.shape == (HEIGHT, WIDTH)
    assert labels.dtype == np.int32
    assert not labels.any()


@pytest.mark.parametrize(
    ("side", "kind"), [("after", ChangeType.ADDITION), ("before", ChangeType.REMOVAL)]
)
def test_a_box_is_found_where_it_stands(side: str, kind: ChangeType) -> None:
    images = blank()
    put(images, side, (40, 90))
    changes, labels = found(images)
    assert [one.type for one in changes] == [kind]
    surface = changes[0].after if side == "after" else changes[0].before
    assert (changes[0].before is None) == (side == "after")
    assert (changes[0].after is None) == (side == "before")
    np.testing.assert_allclose(surface.point, at(52, 100, 1.6), atol=0.006)
    np.testing.assert_allclose(surface.color, (0.9, 0.2, 0.1), atol=1e-3)
    assert surface.area_m2 == pytest.approx(24 * 20 * 1.6**2 / (150 * 160), rel=0.02)
    assert surface.step_m == pytest.approx(0.4, abs=1e-3)
    assert not surface.flat
    rows, columns = np.nonzero(labels == surface.label)
    assert (rows.min(), rows.max() + 1) == (40, 64)
    assert (columns.min(), columns.max() + 1) == (90, 110)
    assert 0.9 < changes[0].confidence <= 1


def test_a_box_that_moved_is_one_relocation() -> None:
    images = blank()
    put(images, "before", (40, 20))
    put(images, "after", (50, 100))
    (change,), _ = found(images)
    assert change.type == ChangeType.RELOCATION
    np.testing.assert_allclose(change.before.point, at(52, 30, 1.6), atol=0.006)
    np.testing.assert_allclose(change.after.point, at(62, 110, 1.6), atol=0.006)


def test_boxes_of_other_colours_are_two_changes() -> None:
    images = blank()
    put(images, "before", (40, 20))
    put(images, "after", (50, 100), color=(0.1, 0.2, 0.9))
    changes, labels = found(images)
    assert {one.type for one in changes} == {ChangeType.REMOVAL, ChangeType.ADDITION}
    assert sorted(np.unique(labels)) == [0, 1, 2]


def test_unknown_parts_of_the_map_have_not_changed() -> None:
    images = blank()
    put(images, "after", (40, 90))
    images["alpha"][30:80, 80:120] = 0.5
    assert found(images)[0] == []


@pytest.mark.parametrize("missing", [0.0, np.nan])
def test_without_depth_there_is_no_step(missing: float) -> None:
    images = blank()
    put(images, "after", (40, 90))
    images["measured"][30:80, 80:120] = missing
    assert found(images)[0] == []


@given(
    corner=st.tuples(st.integers(20, 60), st.integers(20, 90)),
    shift=st.tuples(st.integers(-12, 12), st.integers(-12, 12)),
    depth_m=st.floats(1.0, 1.7),
    side=st.sampled_from(["before", "after"]),
)
def test_a_shift_of_both_images_shifts_the_changes(
    corner: tuple[int, int], shift: tuple[int, int], depth_m: float, side: str
) -> None:
    here, there = blank(), blank()
    for images, place in (
        (here, corner),
        (there, (corner[0] + shift[0], corner[1] + shift[1])),
    ):
        put(images, side, place, depth_m=depth_m)
        put(images, "after", (place[0] + 2, place[1] + 40), (12, 12), 1.8, (0.1, 0.3, 0.9))
    changes, labels = found(here)
    moved, moved_labels = found(there)
    np.testing.assert_array_equal(np.roll(labels, shift, axis=(0, 1)), moved_labels)
    assert [one.type for one in changes] == [one.type for one in moved]
    assert len(changes) == 2
    for one, other in zip(changes, moved, strict=True):
        assert other.confidence == pytest.approx(one.confidence)
        a, b = (now.after if now.after is not None else now.before for now in (one, other))
        z = WALL_M - a.step_m
        step = np.array([shift[1] / CAMERA.fx * z, shift[0] / CAMERA.fy * z, 0])
        np.testing.assert_allclose(b.point - a.point, POSE[:3, :3] @ step, atol=1e-5)
        np.testing.assert_allclose(b.low - a.low, POSE[:3, :3] @ step, atol=1e-5)


@given(
    rows=st.integers(6, 40),
    columns=st.integers(6, 40),
    depth_m=st.floats(0.8, 1.6),
)
def test_swapped_images_swap_additions_and_removals(
    rows: int, columns: int, depth_m: float
) -> None:
    images = blank()
    put(images, "after", (30, 50), (rows, columns), depth_m)
    exchanged = {
        "photo": images["rgb"],
        "rgb": images["photo"],
        "measured": images["rendered"],
        "rendered": images["measured"],
        "alpha": images["alpha"],
        "similarity": images["similarity"],
    }
    one, other = found(images)[0], found(exchanged)[0]
    assert [change.type for change in one] == [ChangeType.ADDITION] * len(one)
    # The slope that is forgiven is that of the map, so that a border may differ by a pixel.
    assert [change.type for change in other] == [ChangeType.REMOVAL] * len(other)
    assert len(one) == len(other) == 1
    np.testing.assert_allclose(one[0].after.point, other[0].before.point, atol=0.02)


def test_masks_are_those_of_gs_lts_with_the_reversed_feature_test() -> None:
    """The paper prints M_feat = (similarity > tau_feat), which marks what did not change."""
    images = blank()
    images["photo"][20:40, 20:60] += 0.1  # 0.3 over the channels.
    images["similarity"][30:50, 20:60] = 0.4
    images["alpha"][:, 50:] = 0.6
    views = core.Views(camera=CAMERA, **images)
    rule = MaskRule(tau_gs=0.25, tau_feat=0.5, alpha_min=0.7, clean_px=0)
    arrays = core.arrays_of(core.masks_of(views, rule), CAMERA)
    assert set(arrays) == {"known", "pixel", "feature", "combined"}
    pixel = np.abs(images["photo"] - images["rgb"]).sum(axis=-1) > 0.25
    feature = images["similarity"] < 0.5
    known = images["alpha"] >= 0.7
    for name, expected in (
        ("known", known),
        ("pixel", pixel),
        ("feature", feature),
        ("combined", known & pixel & feature),
    ):
        assert arrays[name].dtype == np.bool_
        np.testing.assert_array_equal(arrays[name], expected, err_msg=name)
    assert arrays["combined"].sum() == 10 * 30
    as_printed = images["similarity"] > 0.5
    np.testing.assert_array_equal(arrays["feature"], ~as_printed)


def test_specks_are_cleaned_and_cracks_closed() -> None:
    images = blank()
    put(images, "after", (40, 40))
    images["photo"][50] = images["rgb"][50]  # A crack of one row,
    images["photo"][10, 10] = 1  # and a speck of one pixel.
    images["similarity"][10, 10] = 0
    views = core.Views(camera=CAMERA, **images)
    combined = core.arrays_of(core.masks_of(views, MaskRule(clean_px=1)), CAMERA)["combined"]
    assert not combined[10, 10]
    assert combined[50, 45:55].all()
    raw = core.arrays_of(core.masks_of(views, MaskRule(clean_px=0)), CAMERA)["combined"]
    assert raw[10, 10]
    assert not raw[50].any()


def by_gs_lts(images: dict[str, np.ndarray], rule: PaperRule | None = None) -> Any:
    views = core.Views(camera=CAMERA, **images)
    masks = core.masks_of(views, MaskRule())
    return core.paper_change(views, masks, PaperRule() if rule is None else rule)


@pytest.mark.parametrize(
    ("side", "kind"), [("after", ChangeType.ADDITION), ("before", ChangeType.REMOVAL)]
)
def test_gs_lts_tells_additions_from_removals(side: str, kind: ChangeType) -> None:
    images = blank()
    put(images, side, (40, 90))
    change, labels = by_gs_lts(images)
    assert change.type == kind
    assert change.second is None
    assert (change.first.u, change.first.v) == pytest.approx((100, 52), abs=0.1)
    # The key point has the nearer of the two depths.
    np.testing.assert_allclose(change.point_in_world, at(52, 100, 1.6), atol=0.005)
    assert (labels == change.first.label).sum() == change.first.area


def test_gs_lts_puts_a_relocation_between_both_regions() -> None:
    images = blank()
    put(images, "before", (40, 40))
    put(images, "after", (40, 80))
    change, _ = by_gs_lts(images)
    assert change.type == ChangeType.RELOCATION
    np.testing.assert_allclose(change.point_in_world, at(52, 70, 1.6), atol=0.005)
    far, _ = by_gs_lts(images, PaperRule(tau_d=0.2))
    assert far.type != ChangeType.RELOCATION
    assert by_gs_lts(images, PaperRule(tau_change=0.2))[0] is None


@pytest.mark.parametrize("name", ["photo", "rgb", "measured", "rendered", "alpha", "similarity"])
def test_arrays_that_do_not_fit_are_named(name: str) -> None:
    images = blank()
    for wrong in (
        images[name][:-1],
        images[name].astype(np.float64),
        np.asfortranarray(images[name]),
        images[name][..., None],
    ):
        with pytest.raises(ValueError, match=f"^{name}"):
            core.Views(camera=CAMERA, **{**images, name: wrong})


@pytest.mark.parametrize(
    ("function", "rule"),
    [
        *[
            ("masks_of", MaskRule(**{name: value}))
            for name, value in (("tau_gs", 4), ("tau_feat", -2), ("alpha_min", 1.1))
        ],
        ("masks_of", MaskRule(clean_px=-1)),
        ("masks_of", MaskRule(tau_gs=float("nan"))),
        *[
            ("paper_change", PaperRule(**{name: -0.1}))
            for name in ("tau_change", "tau_a", "tau_d", "epsilon")
        ],
        *[
            ("changed_surfaces", ObjectRule(**{name: -1}))
            for name in (
                "step_m", "step_per_m", "step_px", "reach_px", "least_area_m2", "least_area_px",
                "flat_area_m2", "flat_step_m", "least_contrast", "alike",
            )
        ],
    ],
)  # fmt: skip
def test_settings_out_of_range_are_named(function: str, rule: Any) -> None:
    views = core.Views(camera=CAMERA, **blank())
    arguments = (rule,) if function == "masks_of" else (core.masks_of(views, MaskRule()), rule)
    with pytest.raises(ValueError, match=rf"^{function}: \w+ must be in \["):
        getattr(core, function)(views, *arguments)


def test_views_keep_their_arrays_alive() -> None:
    views = core.Views(camera=CAMERA, **blank())  # Nothing else holds them.
    others = [np.full((HEIGHT, WIDTH, 3), 7, np.float32) for _ in range(20)]
    arrays = core.arrays_of(core.masks_of(views, MaskRule()), CAMERA)
    assert len(others) == 20
    assert arrays["known"].all()
    assert not arrays["pixel"].any()


def test_masks_of_another_size_are_rejected() -> None:
    """The kernel would read beyond their end."""
    views = core.Views(camera=CAMERA, **blank())
    small = Camera(fx=10, fy=10, cx=4, cy=3, width=8, height=6, world_from_camera=np.eye(4))
    few = {name: np.ascontiguousarray(image[:6, :8]) for name, image in blank().items()}
    masks = core.masks_of(core.Views(camera=small, **few), MaskRule())
    with pytest.raises(ValueError, match="masks"):
        core.arrays_of(masks, CAMERA)
    with pytest.raises(ValueError, match="masks"):
        core.changed_surfaces(views, masks, ObjectRule())
    with pytest.raises(ValueError, match="masks"):
        core.paper_change(views, masks, PaperRule())


def test_confidence_of_a_change_is_that_of_its_surface() -> None:
    images = blank()
    put(images, "after", (40, 30))
    ((change,), _) = found(images)
    assert change.confidence == core.certainty(change.after)
    assert len(core.features_of(change.after)) > 10
    assert np.isfinite(core.features_of(change.after)).all()
    assert change.after.evidence.steps > 1
    assert change.after.evidence.differing == 1
    assert change.after.evidence.attached == 0
    assert change.after.sights is None


def test_visibility_changes_the_confidence() -> None:
    """An addition where training cameras saw a surface is rather an error of the map."""
    images = blank()
    put(images, "after", (40, 30))
    ((change,), _) = found(images)
    surface = change.after
    surface.sights = core.Sights(on=0, through=900, seen=1)
    free = core.certainty(surface)
    surface.sights = core.Sights(on=900, through=0, seen=1)
    assert (surface.sights.on, surface.sights.through, surface.sights.seen) == (900, 0, 1)
    assert core.certainty(surface) < free


def test_the_match_score_compares_colours() -> None:
    ends = []
    for side, color in (
        ("before", (0.9, 0.2, 0.1)),
        ("after", (0.9, 0.2, 0.1)),
        ("after", (0, 0, 1)),
    ):
        images = blank()
        put(images, side, (40, 30), color=color)
        ((change,), _) = found(images)
        ends.append(change.before if side == "before" else change.after)
    before, same, other = ends
    assert core.likeness(before, same) > 0.9
    assert core.likeness(before, other) < 0.1
    assert core.differences_of(before, same)[0] < core.differences_of(before, other)[0]
