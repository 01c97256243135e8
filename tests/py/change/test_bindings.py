"""Tests of `gslts._core.detect` on images made by hand: a wall 2 m ahead, and boxes."""

from typing import Any

import numpy as np
import pytest
from change_images import CAMERA, HEIGHT, POSE, WALL_M, WIDTH, blank, put
from hypothesis import given
from hypothesis import strategies as st

from gslts._core import detect as core
from gslts._core.detect import ChangeType, GsLtsRule, MaskRule, ObjectRule, Side
from gslts.change.changes import Change
from gslts.change.rules import relocation_of
from gslts.core.camera import Camera


def classify(
    images: dict[str, np.ndarray], rule: ObjectRule | None = None
) -> tuple[list[Any], np.ndarray]:
    views = core.Views(camera=CAMERA, **images)
    masks = core.compute_masks(views, MaskRule())
    rule = ObjectRule() if rule is None else rule
    surfaces, labels = core.find_changed_surfaces(views, masks, rule)
    return core.classify_changes(surfaces, rule), labels


def at(row: float, column: float, depth_m: float) -> np.ndarray:
    """Return (3,) the point in the world at image coordinates; the first pixel's centre is 0.5."""
    x, y = (column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy
    return POSE[:3, :3] @ (np.array([x, y, 1]) * depth_m) + POSE[:3, 3]


def test_equal_images_have_no_change() -> None:
    changes, labels = classify(blank())
    assert changes == []
    assert labels.shape == (HEIGHT, WIDTH)
    assert labels.dtype == np.int32
    assert not labels.any()


@pytest.mark.parametrize(
    ("side", "kind"), [("after", ChangeType.ADDITION), ("before", ChangeType.REMOVAL)]
)
def test_a_box_is_found_at_its_position(side: str, kind: ChangeType) -> None:
    images = blank()
    put(images, side, (40, 90))
    changes, labels = classify(images)
    assert [change.type for change in changes] == [kind]
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


def test_a_relocated_box_is_one_relocation() -> None:
    images = blank()
    put(images, "before", (40, 20))
    put(images, "after", (50, 100))
    (change,), _ = classify(images)
    assert change.type == ChangeType.RELOCATION
    np.testing.assert_allclose(change.before.point, at(52, 30, 1.6), atol=0.006)
    np.testing.assert_allclose(change.after.point, at(62, 110, 1.6), atol=0.006)


def test_boxes_of_other_colours_are_two_changes() -> None:
    images = blank()
    put(images, "before", (40, 20))
    put(images, "after", (50, 100), color=(0.1, 0.2, 0.9))
    changes, labels = classify(images)
    assert {change.type for change in changes} == {ChangeType.REMOVAL, ChangeType.ADDITION}
    assert sorted(np.unique(labels)) == [0, 1, 2]


def test_unknown_parts_of_the_map_have_no_change() -> None:
    images = blank()
    put(images, "after", (40, 90))
    images["alpha"][30:80, 80:120] = 0.5
    assert classify(images)[0] == []


@pytest.mark.parametrize("missing", [0.0, np.nan])
def test_without_depth_there_is_no_step(missing: float) -> None:
    images = blank()
    put(images, "after", (40, 90))
    images["observed_depth"][30:80, 80:120] = missing
    assert classify(images)[0] == []


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
    for images, position in (
        (here, corner),
        (there, (corner[0] + shift[0], corner[1] + shift[1])),
    ):
        put(images, side, position, depth_m=depth_m)
        put(images, "after", (position[0] + 2, position[1] + 40), (12, 12), 1.8, (0.1, 0.3, 0.9))
    changes, labels = classify(here)
    shifted, shifted_labels = classify(there)
    np.testing.assert_array_equal(np.roll(labels, shift, axis=(0, 1)), shifted_labels)
    assert [change.type for change in changes] == [change.type for change in shifted]
    assert len(changes) == 2
    for change, other in zip(changes, shifted, strict=True):
        assert other.confidence == pytest.approx(change.confidence)
        a, b = (end.after if end.after is not None else end.before for end in (change, other))
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
        "observed_rgb": images["rendered_rgb"],
        "rendered_rgb": images["observed_rgb"],
        "observed_depth": images["rendered_depth"],
        "rendered_depth": images["observed_depth"],
        "alpha": images["alpha"],
        "similarity": images["similarity"],
    }
    additions, removals = classify(images)[0], classify(exchanged)[0]
    assert [change.type for change in additions] == [ChangeType.ADDITION]
    # The slope that is forgiven is that of the map, so that a border may differ by a pixel.
    assert [change.type for change in removals] == [ChangeType.REMOVAL]
    np.testing.assert_allclose(additions[0].after.point, removals[0].before.point, atol=0.02)


def test_masks_are_those_of_gs_lts_with_features_reversed() -> None:
    """The paper prints M_feat = (similarity > tau_feat), which marks what did not change."""
    images = blank()
    images["observed_rgb"][20:40, 20:60] += 0.1  # 0.3 over the channels.
    images["similarity"][30:50, 20:60] = 0.4
    images["alpha"][:, 50:] = 0.6
    views = core.Views(camera=CAMERA, **images)
    rule = MaskRule(tau_gs=0.25, tau_feat=0.5, alpha_min=0.7, clean_px=0)
    arrays = core.mask_arrays(core.compute_masks(views, rule), CAMERA)
    assert set(arrays) == {"known", "pixel", "feature", "combined"}
    pixel = np.abs(images["observed_rgb"] - images["rendered_rgb"]).sum(axis=-1) > 0.25
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
    images["observed_rgb"][50] = images["rendered_rgb"][50]  # A crack of one row,
    images["observed_rgb"][10, 10] = 1  # and a speck of one pixel.
    images["similarity"][10, 10] = 0
    views = core.Views(camera=CAMERA, **images)
    combined = core.mask_arrays(core.compute_masks(views, MaskRule(clean_px=1)), CAMERA)["combined"]
    assert not combined[10, 10]
    assert combined[50, 45:55].all()
    raw = core.mask_arrays(core.compute_masks(views, MaskRule(clean_px=0)), CAMERA)["combined"]
    assert raw[10, 10]
    assert not raw[50].any()


def detect_gs_lts(images: dict[str, np.ndarray], rule: GsLtsRule | None = None) -> Any:
    views = core.Views(camera=CAMERA, **images)
    masks = core.compute_masks(views, MaskRule())
    return core.detect_gs_lts(views, masks, GsLtsRule() if rule is None else rule)


@pytest.mark.parametrize(
    ("side", "kind"), [("after", ChangeType.ADDITION), ("before", ChangeType.REMOVAL)]
)
def test_gs_lts_separates_additions_from_removals(side: str, kind: ChangeType) -> None:
    images = blank()
    put(images, side, (40, 90))
    change, labels = detect_gs_lts(images)
    assert change.type == kind
    assert change.second is None
    assert (change.first.u, change.first.v) == pytest.approx((100, 52), abs=0.1)
    # The key point has the nearer of the two depths.
    np.testing.assert_allclose(change.point_in_world, at(52, 100, 1.6), atol=0.005)
    assert (labels == change.first.label).sum() == change.first.area


def test_relocation_of_gs_lts_lies_between_both_regions() -> None:
    images = blank()
    put(images, "before", (40, 40))
    put(images, "after", (40, 80))
    change, _ = detect_gs_lts(images)
    assert change.type == ChangeType.RELOCATION
    np.testing.assert_allclose(change.point_in_world, at(52, 70, 1.6), atol=0.005)
    far, _ = detect_gs_lts(images, GsLtsRule(tau_d=0.2))
    assert far.type != ChangeType.RELOCATION
    assert detect_gs_lts(images, GsLtsRule(tau_change=0.2))[0] is None


@pytest.mark.parametrize(
    "name",
    ["observed_rgb", "rendered_rgb", "observed_depth", "rendered_depth", "alpha", "similarity"],
)
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
            ("compute_masks", MaskRule(**{name: value}))
            for name, value in (("tau_gs", 4), ("tau_feat", -2), ("alpha_min", 1.1))
        ],
        ("compute_masks", MaskRule(clean_px=-1)),
        ("compute_masks", MaskRule(tau_gs=float("nan"))),
        *[
            ("detect_gs_lts", GsLtsRule(**{name: -0.1}))
            for name in ("tau_change", "tau_a", "tau_d", "epsilon")
        ],
        *[
            ("find_changed_surfaces", ObjectRule(**{name: -1}))
            for name in (
                "step_m", "step_per_m", "step_px", "edge_tolerance_px", "min_area_m2",
                "min_area_px", "min_flat_area_m2", "min_flat_step_m", "min_flat_contrast",
                "min_match_score",
            )
        ],
    ],
)  # fmt: skip
def test_settings_out_of_range_are_named(function: str, rule: Any) -> None:
    views = core.Views(camera=CAMERA, **blank())
    arguments = (
        (rule,) if function == "compute_masks" else (core.compute_masks(views, MaskRule()), rule)
    )
    with pytest.raises(ValueError, match=rf"^{function}: \w+ must be in \["):
        getattr(core, function)(views, *arguments)


def test_views_keep_their_arrays_alive() -> None:
    views = core.Views(camera=CAMERA, **blank())  # Nothing else holds them.
    others = [np.full((HEIGHT, WIDTH, 3), 7, np.float32) for _ in range(20)]
    arrays = core.mask_arrays(core.compute_masks(views, MaskRule()), CAMERA)
    assert len(others) == 20
    assert arrays["known"].all()
    assert not arrays["pixel"].any()


def test_masks_of_another_size_are_rejected() -> None:
    """Smaller masks would be read beyond their end."""
    views = core.Views(camera=CAMERA, **blank())
    small = Camera(fx=10, fy=10, cx=4, cy=3, width=8, height=6, world_from_camera=np.eye(4))
    few = {name: np.ascontiguousarray(image[:6, :8]) for name, image in blank().items()}
    masks = core.compute_masks(core.Views(camera=small, **few), MaskRule())
    with pytest.raises(ValueError, match="masks"):
        core.mask_arrays(masks, CAMERA)
    with pytest.raises(ValueError, match="masks"):
        core.find_changed_surfaces(views, masks, ObjectRule())
    with pytest.raises(ValueError, match="masks"):
        core.detect_gs_lts(views, masks, GsLtsRule())


def test_confidence_of_a_change_is_that_of_its_surface() -> None:
    images = blank()
    put(images, "after", (40, 30))
    ((change,), _) = classify(images)
    assert change.confidence == core.confidence(change.after)
    assert len(core.confidence_features(change.after)) > 10
    assert np.isfinite(core.confidence_features(change.after)).all()
    assert change.after.evidence.step_ratio > 1
    assert change.after.evidence.changed_share == 1
    assert change.after.evidence.attached_share == 0
    assert change.after.visibility is None


def test_visibility_changes_the_confidence() -> None:
    """An addition at a surface that the training cameras saw is less likely."""
    images = blank()
    put(images, "after", (40, 30))
    ((change,), _) = classify(images)
    surface = change.after
    surface.visibility = core.Visibility(on_surface=0, seen_through=900, known_share=1)
    free = core.confidence(surface)
    solid = core.Visibility(on_surface=900, seen_through=0, known_share=1)
    assert (solid.on_surface, solid.seen_through, solid.known_share) == (900, 0, 1)
    surface.visibility = solid
    assert core.confidence(surface) < free


def test_match_score_compares_colours() -> None:
    ends = []
    for side, color in (
        ("before", (0.9, 0.2, 0.1)),
        ("after", (0.9, 0.2, 0.1)),
        ("after", (0, 0, 1)),
    ):
        images = blank()
        put(images, side, (40, 30), color=color)
        ((change,), _) = classify(images)
        ends.append(change.before if side == "before" else change.after)
    before, same, other = ends
    assert core.match_score(before, same) > 0.9
    assert core.match_score(before, other) < 0.1
    assert core.match_features(before, same)[0] < core.match_features(before, other)[0]


def build_surface(**fields: Any) -> core.Surface:
    """Build a surface as another detector would."""
    needed = {"side": Side.AFTER, "point": (1, 2, 0.5), "low": (0.9, 1.9, 0.4), "high": (1.1, 2, 1)}
    return core.Surface(**{**needed, **fields})


def test_a_surface_is_built_from_its_fields() -> None:
    fields = {
        "label": 3,
        "area_px": 120,
        "area_m2": 0.02,
        "depth_m": 1.5,
        "color": (0.9, 0.2, 0.1),
        "step_m": 0.2,
        "flat": True,
        "samples": [np.array([1.0, 2.0, 0.5]), np.array([1.1, 2.0, 0.6])],
    }
    surface = build_surface(
        **fields,
        evidence=core.Evidence(step_ratio=4, changed_share=0.5),
        visibility=core.Visibility(on_surface=1, seen_through=90, known_share=1),
    )
    assert surface.side == Side.AFTER
    np.testing.assert_array_equal(surface.point, (1, 2, 0.5))
    np.testing.assert_array_equal(surface.low, (0.9, 1.9, 0.4))
    np.testing.assert_array_equal(surface.high, (1.1, 2, 1))
    for name, value in fields.items():
        np.testing.assert_array_equal(getattr(surface, name), value)
    assert (surface.evidence.step_ratio, surface.evidence.changed_share) == (4, 0.5)
    assert surface.visibility is not None
    assert surface.visibility.seen_through == 90


def test_a_found_surface_can_be_built_again() -> None:
    """A surface has no state besides its fields."""
    images = blank()
    put(images, "after", (40, 30))
    ((change,), _) = classify(images)
    names = [name for name in dir(change.after) if not name.startswith("_")]
    again = core.Surface(**{name: getattr(change.after, name) for name in names})
    for name in names:
        if name not in ("evidence", "visibility"):
            np.testing.assert_array_equal(getattr(again, name), getattr(change.after, name))
    assert core.confidence(again) == core.confidence(change.after)
    assert core.match_score(again, change.after) == core.match_score(change.after, change.after)
    (same,) = core.classify_changes([again], ObjectRule())
    assert (same.type, same.confidence) == (ChangeType.ADDITION, change.confidence)


def test_surfaces_of_another_detector_make_a_relocation() -> None:
    """Two changes built without `find_changed_surfaces` are matched as any others."""
    histogram = np.zeros(2304)
    histogram[100] = 1
    fields = {
        "area_px": 300,
        "area_m2": 0.02,
        "depth_m": 1.5,
        "color_histogram": histogram,
        "evidence": core.Evidence(
            step_ratio=9, changed_share=1, thickness_m=0.1, residual_color=0.5, ring_depth_m=0.005
        ),
    }
    before, after = (build_surface(side=side, **fields) for side in (Side.BEFORE, Side.AFTER))
    box = (before.low, before.high)
    removal = Change("removal", 0.8, before.point, (box, None), before=before)
    addition = Change("addition", 0.8, after.point, (None, box), after=after)
    relocation = relocation_of(removal, addition, ObjectRule())
    assert relocation is not None
    assert relocation.kind == "relocation"
    assert relocation_of(removal, addition, ObjectRule(min_match_score=1)) is None


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("point", (np.nan, 0, 0), "point must be finite"),
        ("samples", [(0, 0, np.inf)], "samples must be finite"),
        ("low", (2, 1.9, 0.4), "low must not exceed high"),
        ("area_m2", -1, "area_px and area_m2 must be at least 0"),
        ("depth_m", -1, "depth_m must be finite and at least 0"),
        ("color_histogram", [0.5, 0.5], "color_histogram must have 0 or 2304 bins, got 2"),
    ],
)
def test_fields_of_a_surface_out_of_range_are_named(field: str, value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"^Surface: {message}"):
        build_surface(**{field: value})
