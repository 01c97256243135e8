"""Masks and key points of GS-LTS on images made by hand, and what `gslts._core.detect` rejects."""

from typing import Any

import numpy as np
import pytest
from change_images import CAMERA, HEIGHT, WIDTH, at, blank, put

from gslts._core import detect as core
from gslts._core.detect import ChangeType, GsLtsRule, MaskRule, ObjectRule
from gslts.core.camera import Camera


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
                "step_sigmas", "step_px", "edge_tolerance_px", "min_area_m2",
                "min_area_px", "min_flat_area_m2", "min_flat_step_m", "min_flat_contrast",
                "min_match_score",
            )
        ],
        ("find_changed_surfaces", ObjectRule(step_sigmas=0)),
        ("find_changed_surfaces", ObjectRule(min_flat_color=0)),
    ],
)  # fmt: skip
def test_settings_out_of_range_are_named(function: str, rule: Any) -> None:
    views = core.Views(camera=CAMERA, **blank())
    arguments = (
        (rule,) if function == "compute_masks" else (core.compute_masks(views, MaskRule()), rule)
    )
    with pytest.raises(ValueError, match=rf"^{function}: \w+ must be in \["):
        getattr(core, function)(views, *arguments)


@pytest.mark.parametrize("noise", [(-0.01, 0.002), (0.008, np.nan), (np.inf, 0), (0, 0)])
def test_noise_out_of_range_is_named(noise: tuple[float, float]) -> None:
    """Depth steps are divided by it."""
    images: dict[str, Any] = {**blank(), "noise": noise}
    views = core.Views(camera=CAMERA, **images)
    masks = core.compute_masks(views, MaskRule())
    with pytest.raises(ValueError, match=r"^find_changed_surfaces: noise.* must be in \["):
        core.find_changed_surfaces(views, masks, ObjectRule())


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
