"""Refinement: only what is near the change is rendered, and only that moves."""

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
from gslts.update.refine import Refined, Target, _spread, refine, remembered, targets_of
from gslts.update.updater import moving_of
from gslts.update.verify import error_around, split_held_back

ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "features", "ids")
CONFIG = RefineConfig(iterations=60, around_px=15, patience=100)


def edit_of(kind: str) -> Edit:
    found = update_room.collected(kind)
    gaussian_map, _ = change_room.mapped()
    return pre_edit(gaussian_map, found.views, found.regions_of_each, SMALL, threads=1)


def refined(kind: str, config: RefineConfig = CONFIG, threads: int = 1) -> tuple[Edit, Refined]:
    found, edit = update_room.collected(kind), edit_of(kind)
    moving = moving_of(edit, found.regions, config.reach_m)
    targets = targets_of(found.views, found.regions, config)
    return edit, refine(edit.gaussian_map, targets, moving, config, threads=threads)


def error(gaussian_map: GaussianMap, kind: str) -> float:
    found = update_room.collected(kind)
    value = error_around(gaussian_map, found.views, found.regions, threads=1)
    assert value is not None
    return value


@pytest.mark.parametrize("kind", ["addition", "removal", "relocation"])
def test_each_stage_lowers_the_error_around_the_change(kind: str) -> None:
    before, _ = change_room.mapped()
    edit, result = refined(kind)
    errors = [error(one, kind) for one in (before, edit.gaussian_map, result.gaussian_map)]
    assert errors[1] < 0.7 * errors[0]
    assert errors[2] < 0.7 * errors[1]
    assert result.iterations == CONFIG.iterations


def test_the_rest_is_bit_identical() -> None:
    edit, result = refined("removal")
    moving = moving_of(edit, update_room.collected("removal").regions, CONFIG.reach_m)
    assert 0 < moving.sum() < 0.5 * moving.size
    for name in ARRAYS:
        old, new = getattr(edit.gaussian_map, name), getattr(result.gaussian_map, name)
        np.testing.assert_array_equal(new[~moving], old[~moving])
    assert (result.gaussian_map.sh[moving] != edit.gaussian_map.sh[moving]).any()


def test_what_reaches_beyond_the_views_of_a_site_stays() -> None:
    gaussian_map, _ = change_room.mapped()
    region = update_room.collected("removal").regions[0]
    two = gaussian_map.select(np.arange(2))
    scales_m = np.array([[0.02, 0.02, 0.02], [0.02, 0.02, 0.3]], np.float32)
    means = np.repeat(region.high[None] + 0.1, 2, axis=0).astype(np.float32)
    two = replace(two, means=means, log_scales=np.log(scales_m))
    unchanged = np.zeros(2, np.bool_)
    assert moving_of(Edit(two, unchanged, 0), [region], 0.45).tolist() == [True, False]
    assert moving_of(Edit(two, unchanged, 1), [region], 0.45).tolist() == [True, True]
    assert moving_of(Edit(two, unchanged, 0), [region], 0.12).tolist() == [False, False]


def test_it_is_the_same_for_any_number_of_threads() -> None:
    maps = [refined("relocation", threads=threads)[1].gaussian_map for threads in (1, 2)]
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(maps[0], name), getattr(maps[1], name))


def test_plain_fine_tuning_moves_the_whole_map() -> None:
    before, _ = change_room.mapped()
    config = CONFIG.model_copy(update={"scope": "map", "iterations": 20})
    found = update_room.collected("removal")
    targets = targets_of(found.views, found.regions, config)
    assert all(target.mask is None for target in targets)
    everything = np.ones(before.size, np.bool_)
    after = refine(before, targets, everything, config, threads=1).gaussian_map
    assert (after.sh != before.sh).any(axis=(1, 2)).mean() > 0.3


def test_it_ends_when_the_error_falls_no_longer() -> None:
    config = CONFIG.model_copy(update={"iterations": 2000, "patience": 2, "least_gain": 0.05})
    _, result = refined("removal", config)
    assert result.iterations < 500
    assert min(result.losses[-2:]) > 0.9 * min(result.losses[:-2])


def test_new_views_are_fitted_as_often_as_they_are_wanted() -> None:
    found, edit = update_room.collected("removal"), edit_of("removal")
    moving = moving_of(edit, found.regions, CONFIG.reach_m)
    once = targets_of(found.views, found.regions, CONFIG.model_copy(update={"new_visits": 1}))
    thrice = targets_of(found.views, found.regions, CONFIG.model_copy(update={"new_visits": 3}))
    repeated = [target for target in once for _ in range(3)]
    given = (edit.gaussian_map, moving, CONFIG)
    maps = [
        refine(given[0], targets, *given[1:], threads=1).gaussian_map
        for targets in (once, thrice, repeated)
    ]
    np.testing.assert_array_equal(maps[1].sh, maps[2].sh)
    assert (maps[0].sh != maps[1].sh).any()


def test_steps_are_watched() -> None:
    found, edit = update_room.collected("removal"), edit_of("removal")
    moving = moving_of(edit, found.regions, CONFIG.reach_m)
    targets = targets_of(found.views, found.regions, CONFIG)
    seen: dict[int, GaussianMap] = {}
    result = refine(
        edit.gaussian_map,
        targets,
        moving,
        CONFIG,
        threads=1,
        watch=lambda step, current: seen.update({step: current()}) if step % 30 == 0 else None,
    )
    assert list(seen) == [30, 60]
    np.testing.assert_array_equal(seen[60].sh, result.gaussian_map.sh)
    assert (seen[30].sh != seen[60].sh).any()


@pytest.mark.parametrize("iterations", [0, 5])
def test_with_nothing_to_do_the_map_is_the_same(iterations: int) -> None:
    before, _ = change_room.mapped()
    config = CONFIG.model_copy(update={"iterations": iterations})
    nothing = np.zeros(before.size, np.bool_)
    found = update_room.collected("removal")
    targets = targets_of(found.views, found.regions, config)
    assert refine(before, targets, nothing, config).gaussian_map is before
    assert refine(before, [], ~nothing, config).gaussian_map is before


def memories(count: int) -> tuple[Edit, list[Target]]:
    before, cameras = change_room.mapped()
    edit = edit_of("removal")
    regions = update_room.collected("removal").regions
    config = CONFIG.model_copy(update={"remembered": count})
    known = list(cameras.values())
    return edit, remembered(before, edit.gaussian_map, known, regions, config, threads=1)


def test_what_the_edit_changed_is_not_remembered() -> None:
    """The old state would come back."""
    edit, targets = memories(6)
    assert 3 <= len(targets) <= 6
    for target in targets:
        assert target.mask is not None
        assert target.mask.any()
        rgb = render(edit.gaussian_map, target.camera).rgb
        assert np.abs(rgb - target.colors)[target.mask].max() < 0.03
    eyes = np.array([target.camera.world_from_camera[:3, 3] for target in targets])
    apart = np.linalg.norm(eyes[:, None] - eyes[None], axis=2) + np.eye(len(eyes))
    assert apart.min() > 0.2


def test_cameras_at_one_place_are_remembered_once_each() -> None:
    _, cameras = change_room.mapped()
    (region,) = update_room.collected("removal").regions
    here, there = [one for one in cameras.values() if region.middle_in(one) is not None][:2]
    known = [here, there, *(at_pose(one, one.world_from_camera) for one in (here, there, here))]
    chosen = _spread(known, [region], 4)
    assert len({id(one) for one in chosen}) == 4


def test_nothing_is_remembered_where_nothing_is_wanted() -> None:
    assert memories(0)[1] == []


def test_views_are_held_back_evenly() -> None:
    views = list(update_room.collected("removal").views)
    used, held_back = split_held_back(views, 4)
    assert [views.index(one) for one in held_back] == [2, 6]
    assert used == [view for k, view in enumerate(views) if k not in (2, 6)]
    for count, expected in ((0, 0), (1, 0), (2, 1), (3, 1)):
        assert len(split_held_back(views[:count], 4)[1]) == expected


def test_no_view_tells_no_error() -> None:
    before, _ = change_room.mapped()
    assert error_around(before, [], update_room.collected("removal").regions) is None
