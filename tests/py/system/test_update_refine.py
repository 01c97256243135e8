"""Refinement: only pixels and Gaussians near the change are rendered and fitted."""

from dataclasses import replace

import change_room
import numpy as np
import pytest
import update_room
from update_room import SMALL

from gslts.core.camera import at_pose
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import render
from gslts.update.config import RefineConfig
from gslts.update.edit import Edit, pre_edit
from gslts.update.evidence import is_visible
from gslts.update.refine import Refinement, refine
from gslts.update.settle import active_gaussians
from gslts.update.targets import Target, replay_targets, spread_cameras, view_targets
from gslts.update.verify import error_in_regions, split_views

ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features", "ids")
CONFIG = RefineConfig(iterations=60, margin_px=15, patience=100)


def edit_of(kind: str) -> Edit:
    found = update_room.collected(kind)
    gaussian_map, _ = change_room.mapped()
    return pre_edit(gaussian_map, found.views, found.regions_by_change, SMALL, threads=1)


def refined(kind: str, config: RefineConfig = CONFIG, threads: int = 1) -> tuple[Edit, Refinement]:
    found, edit = update_room.collected(kind), edit_of(kind)
    active = active_gaussians(edit, found.regions, found.views, config)
    targets = view_targets(found.views, found.regions, config)
    return edit, refine(edit.gaussian_map, targets, active, config, threads=threads)


def error(gaussian_map: GaussianMap, kind: str) -> float:
    found = update_room.collected(kind)
    value = error_in_regions(gaussian_map, found.views, found.regions, threads=1)
    assert value is not None
    return value


@pytest.mark.parametrize("kind", ["addition", "removal", "relocation"])
def test_each_stage_lowers_the_error_around_the_change(kind: str) -> None:
    before, _ = change_room.mapped()
    edit, result = refined(kind)
    maps = (before, edit.gaussian_map, result.gaussian_map)
    errors = [error(gaussian_map, kind) for gaussian_map in maps]
    assert errors[1] < 0.7 * errors[0]
    assert errors[2] < 0.7 * errors[1]
    assert result.iterations == CONFIG.iterations


def test_inactive_gaussians_are_bit_identical() -> None:
    found, (edit, result) = update_room.collected("removal"), refined("removal")
    active = active_gaussians(edit, found.regions, found.views, CONFIG)
    assert 0 < active.sum() < 0.5 * active.size
    for name in ARRAYS:
        old, new = getattr(edit.gaussian_map, name), getattr(result.gaussian_map, name)
        np.testing.assert_array_equal(new[~active], old[~active])
    assert (result.gaussian_map.sh[active] != edit.gaussian_map.sh[active]).any()


def are_active(distance_m: float, added: int, views: int, reach_m: float) -> list[bool]:
    """Return whether a round Gaussian and a long one beside a region are active."""
    gaussian_map, _ = change_room.mapped()
    found = update_room.collected("removal")
    region = found.regions[0]
    scales_m = np.array([[0.02, 0.02, 0.02], [0.02, 0.02, 0.3]], np.float32)
    means = np.repeat(region.high[None] + distance_m, 2, axis=0).astype(np.float32)
    two = gaussian_map.select(np.arange(2))
    edit = Edit(
        replace(two, means=means, log_scales=np.log(scales_m)), np.zeros(2, np.bool_), added
    )
    seeing = [view for view in found.views if is_visible(view.frame, region)]
    config = CONFIG.model_copy(update={"reach_m": reach_m})
    return active_gaussians(edit, [region], seeing[:views], config).tolist()


def test_gaussians_that_reach_beyond_the_region_are_inactive() -> None:
    assert are_active(0.1, added=0, views=4, reach_m=0.45) == [True, False]
    assert are_active(0.1, added=1, views=4, reach_m=0.45) == [True, True]
    assert are_active(0.1, added=0, views=4, reach_m=0.12) == [False, False]


def test_few_views_leave_what_stands_beside_a_change_as_it_is() -> None:
    assert are_active(0.2, added=0, views=4, reach_m=0.45) == [True, False]
    assert are_active(0.2, added=0, views=3, reach_m=0.45) == [False, False]
    assert are_active(0.02, added=0, views=3, reach_m=0.45) == [True, False]
    assert are_active(0.02, added=0, views=3, reach_m=0.05) == [False, False]


def test_refinement_does_not_depend_on_the_number_of_threads() -> None:
    maps = [refined("relocation", threads=threads)[1].gaussian_map for threads in (1, 2)]
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(maps[0], name), getattr(maps[1], name))


def test_scope_map_refines_all_gaussians() -> None:
    before, _ = change_room.mapped()
    config = CONFIG.model_copy(update={"scope": "map", "iterations": 20})
    found = update_room.collected("removal")
    targets = view_targets(found.views, found.regions, config)
    assert all(target.mask is None for target in targets)
    everything = np.ones(before.size, np.bool_)
    after = refine(before, targets, everything, config, threads=1).gaussian_map
    assert (after.sh != before.sh).any(axis=(1, 2)).mean() > 0.3


def test_refinement_ends_when_the_loss_converges() -> None:
    config = CONFIG.model_copy(update={"iterations": 2000, "patience": 2, "min_gain": 0.05})
    _, result = refined("removal", config)
    assert result.iterations < 500
    assert min(result.losses[-2:]) > 0.9 * min(result.losses[:-2])


def test_new_views_get_the_configured_number_of_visits() -> None:
    found, edit = update_room.collected("removal"), edit_of("removal")
    active = active_gaussians(edit, found.regions, found.views, CONFIG)
    once = view_targets(found.views, found.regions, CONFIG.model_copy(update={"new_visits": 1}))
    thrice = view_targets(found.views, found.regions, CONFIG.model_copy(update={"new_visits": 3}))
    repeated = [target for target in once for _ in range(3)]
    given = (edit.gaussian_map, active, CONFIG)
    maps = [
        refine(given[0], targets, *given[1:], threads=1).gaussian_map
        for targets in (once, thrice, repeated)
    ]
    np.testing.assert_array_equal(maps[1].sh, maps[2].sh)
    assert (maps[0].sh != maps[1].sh).any()


def test_on_step_is_called_after_each_step() -> None:
    found, edit = update_room.collected("removal"), edit_of("removal")
    active = active_gaussians(edit, found.regions, found.views, CONFIG)
    targets = view_targets(found.views, found.regions, CONFIG)
    seen: dict[int, GaussianMap] = {}
    result = refine(
        edit.gaussian_map,
        targets,
        active,
        CONFIG,
        threads=1,
        on_step=lambda step, current: seen.update({step: current()}) if step % 30 == 0 else None,
    )
    assert list(seen) == [30, 60]
    np.testing.assert_array_equal(seen[60].sh, result.gaussian_map.sh)
    assert (seen[30].sh != seen[60].sh).any()


@pytest.mark.parametrize("iterations", [0, 5])
def test_without_active_gaussians_or_targets_the_map_is_unchanged(iterations: int) -> None:
    before, _ = change_room.mapped()
    config = CONFIG.model_copy(update={"iterations": iterations})
    nothing = np.zeros(before.size, np.bool_)
    found = update_room.collected("removal")
    targets = view_targets(found.views, found.regions, config)
    assert refine(before, targets, nothing, config).gaussian_map is before
    assert refine(before, [], ~nothing, config).gaussian_map is before


def replayed(count: int) -> tuple[Edit, list[Target]]:
    before, cameras = change_room.mapped()
    edit = edit_of("removal")
    regions = update_room.collected("removal").regions
    config = CONFIG.model_copy(update={"replay_views": count})
    known = list(cameras.values())
    return edit, replay_targets(before, edit.gaussian_map, known, regions, config, threads=1)


def test_edited_pixels_are_not_replayed() -> None:
    """The old state would come back."""
    edit, targets = replayed(6)
    assert 3 <= len(targets) <= 6
    for target in targets:
        assert target.mask is not None
        assert target.mask.any()
        rgb = render(edit.gaussian_map, target.camera).rgb
        assert np.abs(rgb - target.colors)[target.mask].max() < 0.03
    eyes = np.array([target.camera.world_from_camera[:3, 3] for target in targets])
    apart = np.linalg.norm(eyes[:, None] - eyes[None], axis=2) + np.eye(len(eyes))
    assert apart.min() > 0.2


def test_cameras_at_one_position_are_chosen_once_each() -> None:
    _, cameras = change_room.mapped()
    (region,) = update_room.collected("removal").regions
    here, there = [
        camera for camera in cameras.values() if region.project_center(camera) is not None
    ][:2]
    known = [
        here,
        there,
        *(at_pose(camera, camera.world_from_camera) for camera in (here, there, here)),
    ]
    chosen = spread_cameras(known, [region], 4)
    assert len({id(camera) for camera in chosen}) == 4


def test_zero_replay_views_give_no_target() -> None:
    assert replayed(0)[1] == []


def test_validation_views_are_spread_evenly() -> None:
    views = list(update_room.collected("removal").views)
    training, validation = split_views(views, [], 4)
    assert [views.index(view) for view in validation] == [2, 6]
    assert training == [view for k, view in enumerate(views) if k not in (2, 6)]


def test_each_change_has_a_validation_view_if_two_views_show_it() -> None:
    found = update_room.collected("removal")
    for count, expected in ((0, 0), (1, 0), (2, 1), (3, 1)):
        training, validation = split_views(found.views[:count], found.regions_by_change, 4)
        assert len(validation) == expected
        assert len(training) == count - expected


def test_error_without_views_is_none() -> None:
    before, _ = change_room.mapped()
    assert error_in_regions(before, [], update_room.collected("removal").regions) is None
