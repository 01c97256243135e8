"""Changed surfaces: confidence, match score, and surfaces of another detector."""

from typing import Any

import numpy as np
import pytest
from change_images import blank, classify, put

from gslts._core import detect as core
from gslts._core.detect import ChangeType, ObjectRule, Side
from gslts.change.changes import Change
from gslts.change.rules import relocation_of


def test_confidence_of_a_change_is_that_of_its_surface() -> None:
    images = blank()
    put(images, "after", (40, 30))
    ((change,), _) = classify(images)
    alone = core.confidence(change.after)  # The other end of a relocation may be hidden.
    assert change.confidence == pytest.approx(alone - 0.1 * (2 * alone - 1))
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
        ("area_m2", -1, "area_m2 must be finite and at least 0, got -1"),
        ("depth_m", -1, "depth_m must be finite and at least 0, got -1"),
        ("step_m", np.inf, "step_m must be finite, got inf"),
        ("color_histogram", [0.5, 0.5], "color_histogram must have 0 or 2304 bins, got 2"),
        ("color_histogram", [np.nan] * 2304, "color_histogram must not be negative or NaN"),
        ("color_histogram", [-1.0, 2.0] * 1152, "color_histogram must not be negative or NaN"),
        ("color_histogram", [1.0] * 2304, "color_histogram must sum up to 1, got 2304"),
        ("color_confidence", np.nan, r"color_confidence must be in \[0, 1\], got nan"),
        ("color_confidence", 1.1, r"color_confidence must be in \[0, 1\], got 1.1"),
    ],
)
def test_fields_of_a_surface_out_of_range_are_named(field: str, value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"^Surface: {message}"):
        build_surface(**{field: value})


@pytest.mark.parametrize("confidence", [-0.1, 1.1, np.nan])
def test_a_confidence_of_colours_is_set_to_a_probability(confidence: float) -> None:
    surface = build_surface(color_confidence=0.5)
    with pytest.raises(ValueError, match=r"^Surface: color_confidence must be in \[0, 1\], got"):
        surface.color_confidence = confidence
    assert surface.color_confidence == 0.5
    surface.color_confidence = None
    assert surface.color_confidence is None


@pytest.mark.parametrize("name", [name for name in dir(core.Evidence) if not name.startswith("_")])
def test_evidence_out_of_range_is_named(name: str) -> None:
    """Otherwise its confidence would be NaN, and a change whatever `min_confidence` is."""
    for wrong in (np.nan, np.inf) if name == "correlation" else (np.nan, np.inf, -1):
        with pytest.raises(ValueError, match=f"^Evidence: {name} must be "):
            core.Evidence(**{name: wrong})


@pytest.mark.parametrize(
    "name", [name for name in dir(core.Visibility) if not name.startswith("_")]
)
def test_visibility_out_of_range_is_named(name: str) -> None:
    counts = {"on_surface": 1, "seen_through": 1, "known_share": 1}
    for wrong in (np.nan, np.inf, -1):
        with pytest.raises(ValueError, match=f"^Visibility: {name} must be "):
            core.Visibility(**{**counts, name: wrong})
