"""Pre-editing: the Gaussians that it removes and adds."""

from dataclasses import replace

import change_room
import numpy as np
import pytest
import update_room
from update_room import ADDED, REMOVED, SMALL

from gslts._core import edit as core
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import render
from gslts.update import selection
from gslts.update.config import GS_LTS, EditConfig
from gslts.update.edit import Edit, pre_edit
from gslts.update.selection import select_removed
from gslts.update.views import View


def edited(kind: str, config: EditConfig = SMALL, **settings: object) -> Edit:
    found = update_room.collected(kind)
    gaussian_map, _ = change_room.mapped()
    return pre_edit(
        gaussian_map,
        found.views,
        found.regions_by_change,
        config.model_copy(update=settings),
        threads=1,
    )


def removed(**settings: object) -> np.ndarray:
    found = update_room.collected("removal")
    gaussian_map, _ = change_room.mapped()
    config = SMALL.model_copy(update=settings)
    return select_removed(gaussian_map, found.views, found.regions, config)


def in_box(gaussian_map: GaussianMap, box: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    low, high = box
    return ((gaussian_map.means > low - 0.05) & (gaussian_map.means < high + 0.05)).all(axis=1)


def new_of(edit: Edit) -> GaussianMap:
    rows = np.arange(edit.gaussian_map.size)
    return edit.gaussian_map.select(rows >= rows.size - edit.added)


def wrong_depth_share(gaussian_map: GaussianMap, views: tuple[View, ...]) -> float:
    """Return the share of changed pixels with an error of depth above 5 cm."""
    shares = []
    for view in views:
        depth = render(gaussian_map, view.camera).depth
        measured = view.changed & (view.depth > 0)
        shares.append((np.abs(depth - view.depth)[measured] > 0.05).mean())
    return float(np.mean(shares))


def test_removal_empties_the_space_of_the_object() -> None:
    before, _ = change_room.mapped()
    assert update_room.opaque_in(before, REMOVED, -0.03) > 20
    after = edited("removal").gaussian_map
    assert update_room.opaque_in(after, REMOVED, 0.03) == 0
    views = update_room.collected("removal").views
    assert wrong_depth_share(before, views) > 0.9
    assert (
        wrong_depth_share(after, views) < 0.35
    )  # Its outline is a pixel or two wide, of a hundred.


def test_unchanged_gaussians_are_bit_identical() -> None:
    before, _ = change_room.mapped()
    edit = edited("removal")
    after = edit.gaussian_map
    kept = after.select(np.arange(after.size) < after.size - edit.added)
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh", "ids"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(before, name)[~edit.removed])
    assert not set(after.ids[after.size - edit.added :].tolist()) & set(before.ids.tolist())
    assert in_box(before, REMOVED)[edit.removed].mean() > 0.95


def test_addition_shows_the_object_in_its_color() -> None:
    edit = edited("addition")
    assert edit.removed.sum() <= 3
    new = new_of(edit)
    assert in_box(new, ADDED).mean() > 0.95
    colors = 0.5 + 0.28209479 * new.sh[:, 0]
    red, green, blue = np.median(colors, axis=0)
    assert min(red, green) > 3 * blue
    assert wrong_depth_share(edit.gaussian_map, update_room.collected("addition").views) < 0.35


def test_new_gaussians_lie_flat_on_the_measured_surface() -> None:
    edit = edited("addition")
    new = new_of(edit)
    assert (new.log_scales[:, 2] < new.log_scales[:, 0]).all()
    low, high = ADDED
    to_sides = np.minimum(np.abs(new.means - low), np.abs(new.means - high)).min(axis=1)
    assert np.median(to_sides) < 0.01


def test_relocation_removes_at_the_source_and_adds_at_the_destination() -> None:
    edit = edited("relocation")
    source = (np.array([2.88, 1.83, 0.75]), np.array([3.12, 2.07, 1.05]))
    assert update_room.opaque_in(edit.gaussian_map, source, 0.03) == 0
    assert update_room.opaque_in(edit.gaussian_map, ADDED, -0.03) > 20


def test_gs_lts_also_votes_for_occluded_gaussians() -> None:
    """In views from one side, these are the Gaussians behind the object."""
    found, (before, _) = update_room.collected("removal"), change_room.mapped()
    visible, gs_lts = (
        select_removed(before, found.views[:4], found.regions, config)
        for config in (SMALL.model_copy(update={"carve": False, "sweep": False}), GS_LTS)
    )
    assert visible.any()
    assert (gs_lts | ~visible).all()  # All that is seen votes either way.
    behind = gs_lts & ~in_box(before, REMOVED)
    assert behind.sum() > 2 * (visible & ~in_box(before, REMOVED)).sum()


def test_carving_removes_gaussians_that_views_see_through() -> None:
    gaussian_map, _ = change_room.mapped()
    found = update_room.collected("removal")
    # Dust in the air where the box was, which no mask shows.
    dust = replace(
        gaussian_map.select(np.arange(3)),
        means=np.array([[2.2, 1.85, 1.0], [2.15, 1.8, 0.95], [2.2, 1.9, 1.02]], np.float32),
        ids=np.arange(3, dtype=np.uint64) + 10_000_000,
    )
    fields = ("means", "quats", "log_scales", "logit_opacities", "sh", "features", "ids")
    dusty = GaussianMap(
        **{
            name: np.concatenate([getattr(gaussian_map, name), getattr(dust, name)])
            for name in fields
        }
    )
    blind = [replace(view, before=np.zeros_like(view.before)) for view in found.views]
    for carve in (True, False):
        config = SMALL.model_copy(update={"carve": carve, "sweep": False})
        gone = select_removed(dusty, blind, found.regions, config)
        assert gone[-3:].all() == carve
        assert gone.any() == carve


def test_sweeping_removes_gaussians_amid_removed_ones() -> None:
    gaussian_map, _ = change_room.mapped()
    found = update_room.collected("removal")
    gone = removed(carve=False, sweep=False)
    # One in the midst of the box, where no view sees it, and one beside it on the block.
    middle = gaussian_map.means[gone].mean(axis=0)
    left, beside = np.flatnonzero(~gone)[:2]
    means = gaussian_map.means.copy()
    means[left], means[beside] = middle, (1.98, middle[1], 0.75)
    spread = replace(gaussian_map, means=means)
    config = SMALL.model_copy(update={"carve": False})
    without = select_removed(
        spread, found.views, found.regions, config.model_copy(update={"sweep": False})
    )
    swept = select_removed(spread, found.views, found.regions, config)
    assert swept[left]
    assert not without[left]
    assert not swept[beside]


def test_gs_lts_new_gaussians_inherit_from_the_nearest() -> None:
    edit = edited("addition", GS_LTS)
    assert edit.added > 5
    kept, _ = change_room.mapped()
    kept = kept.select(~edit.removed)
    new = new_of(edit)
    apart = np.linalg.norm(new.means[:, None] - kept.means[None], axis=2)
    nearest = apart.argmin(axis=1)
    for name in ("quats", "log_scales", "logit_opacities", "sh"):
        np.testing.assert_array_equal(getattr(new, name), getattr(kept, name)[nearest])
    spacing = np.linalg.norm(kept.means[nearest][:, None] - kept.means[None], axis=2)
    spacing = np.sort(spacing, axis=1)[:, 1]
    among = np.linalg.norm(new.means[:, None] - new.means[None], axis=2)
    for k in range(1, new.size):
        assert among[k, :k].min() >= max(0.01, spacing[k]) - 1e-5


def test_gs_lts_relocated_object_keeps_its_colors() -> None:
    edit = edited("relocation", GS_LTS)
    before, _ = change_room.mapped()
    new = new_of(edit)
    there = in_box(new, ADDED)
    assert there.any()
    gone = {
        tuple(harmonics)
        for harmonics in before.sh[edit.removed].reshape(-1, 3 * before.sh.shape[1])
    }
    assert {
        tuple(harmonics) for harmonics in new.sh[there].reshape(-1, 3 * before.sh.shape[1])
    } <= gone


BLUE_BOX = (np.array([2.88, 1.83, 0.75]), np.array([3.12, 2.07, 1.05]))
"""Corners of the box that is moved."""


def known_boxes() -> GaussianMap:
    """Return the map with semantic features of the blue box, and others of all else."""
    gaussian_map, _ = change_room.mapped()
    features = np.zeros((gaussian_map.size, 2), np.float32)
    features[:, 0] = 1
    features[in_box(gaussian_map, BLUE_BOX)] = (0, 5)
    return replace(gaussian_map, features=features)


@pytest.mark.parametrize("kind", ["addition", "relocation", "removal"])
def test_features_are_those_of_the_object(kind: str) -> None:
    found = update_room.collected(kind)
    edit = pre_edit(known_boxes(), found.views, found.regions_by_change, SMALL, threads=1)
    new = new_of(edit)
    there = in_box(new, ADDED)
    expected = {"addition": (0, 0), "relocation": (0, 5), "removal": (1, 0)}[kind]
    chosen = new.features if kind == "removal" else new.features[there]
    np.testing.assert_array_equal(np.median(chosen, axis=0), expected)


def test_added_object_does_not_inherit_features_of_a_removed_one() -> None:
    """A removal and an addition of other boxes are two changes."""
    gone, come = (update_room.collected(kind) for kind in ("removal", "addition"))
    views = (*gone.views, *come.views)
    regions = (*gone.regions_by_change, *come.regions_by_change)
    edit = pre_edit(known_boxes(), views, regions, SMALL, threads=1)
    assert edit.removed.sum() > 20
    there = in_box(new_of(edit), ADDED)
    assert there.sum() > 20
    assert not new_of(edit).features[there].any()


def test_only_missing_surfaces_get_new_gaussians() -> None:
    assert edited("removal").added < edited("removal", only_missing=False).added


def test_nothing_is_added_behind_what_the_map_shows() -> None:
    def under_the_box(edit: Edit) -> int:
        places = new_of(edit).means[:, :2]
        low, high = REMOVED[0][:2] + 0.02, REMOVED[1][:2] - 0.02
        return int(((places > low) & (places < high)).all(axis=1).sum())

    assert under_the_box(edited("removal")) > 5
    gaussian_map, _ = change_room.mapped()
    found = update_room.collected("removal")
    # The box stays in the map, before the table that is measured.
    blind = [replace(view, before=np.zeros_like(view.before)) for view in found.views]
    config = SMALL.model_copy(update={"carve": False, "sweep": False})
    edit = pre_edit(gaussian_map, blind, found.regions_by_change, config, threads=1)
    assert not edit.removed.any()
    assert under_the_box(edit) == 0


@pytest.mark.parametrize("switch", ["visible_votes", "only_missing", "flat", "observed_colors"])
def test_each_setting_changes_the_map(switch: str) -> None:
    before, _ = change_room.mapped()
    differs = False
    for kind in ("removal", "addition"):
        views = update_room.collected(kind).views
        edit, usual = edited(kind, **{switch: False}), edited(kind)
        assert wrong_depth_share(edit.gaussian_map, views) < 0.7 * wrong_depth_share(before, views)
        differs |= edit.removed.sum() != usual.removed.sum() or edit.added != usual.added
        differs |= not np.array_equal(new_of(edit).sh, new_of(usual).sh)
    assert differs


def test_remains_among_removed_gaussians_are_swept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against a search by brute force; with half of the neighbours, as few remains are left."""
    monkeypatch.setattr(selection, "MIN_REMOVED_SHARE", 0.5)
    gaussian_map, _ = change_room.mapped()
    kept, swept = removed(sweep=False), removed(sweep=True)
    regions = update_room.collected("removal").regions
    near = selection.gaussians_in_regions(gaussian_map, regions, SMALL.margin_m)
    expected = np.zeros_like(kept)
    for row in np.flatnonzero(near & ~kept):
        distances = np.linalg.norm(gaussian_map.means - gaussian_map.means[row], axis=1)
        nearest = np.argsort(distances)[1 : 1 + selection.SWEEP_NEIGHBORS]
        expected[row] = kept[nearest].mean() >= 0.5
    assert expected.any()
    np.testing.assert_array_equal(swept, kept | expected)


def test_edits_are_the_same_for_any_number_of_threads() -> None:
    found = update_room.collected("relocation")
    gaussian_map, _ = change_room.mapped()
    single, two = (
        pre_edit(
            gaussian_map, found.views, found.regions_by_change, SMALL, threads=threads
        ).gaussian_map
        for threads in (1, 2)
    )
    for name in ("means", "sh", "log_scales", "ids"):
        np.testing.assert_array_equal(getattr(single, name), getattr(two, name))


def test_a_map_may_have_its_origin_anywhere() -> None:
    gaussian_map, _ = change_room.mapped()
    found = update_room.collected("relocation")
    origin = np.array([100.0, -50.0, 3.0])
    moved = replace(
        gaussian_map, means=(gaussian_map.means - origin).astype(np.float32), origin=origin
    )
    here, there = (
        pre_edit(each, found.views, found.regions_by_change, SMALL, threads=1)
        for each in (gaussian_map, moved)
    )
    assert here.added == pytest.approx(there.added, rel=0.06)
    np.testing.assert_array_equal(there.gaussian_map.origin, origin)
    assert (here.removed != there.removed).mean() < 0.001
    means = new_of(there).means + origin
    low, high = new_of(here).means.min(axis=0), new_of(here).means.max(axis=0)
    assert ((means > low - 0.02) & (means < high + 0.02)).all()
    colors = [new_of(edited).sh[:, 0].mean(axis=0) for edited in (here, there)]
    np.testing.assert_allclose(*colors, atol=0.05)


def test_ids_of_removed_gaussians_are_not_used_again() -> None:
    gaussian_map, _ = change_room.mapped()
    gone = removed()
    order = np.argsort(gone, kind="stable")  # Those that go have the greatest ids.
    last = gaussian_map.select(order)
    last = replace(last, ids=np.arange(last.size, dtype=np.uint64))
    found = update_room.collected("removal")
    config = SMALL.model_copy(update={"only_missing": False})
    edit = pre_edit(last, found.views, found.regions_by_change, config, threads=1)
    assert edit.removed[-1]
    assert edit.added > 0
    assert new_of(edit).ids.min() == last.size


def test_removing_all_gaussians_is_rejected() -> None:
    gaussian_map, _ = change_room.mapped()
    found = update_room.collected("removal")
    only = gaussian_map.select(removed())
    with pytest.raises(ValueError, match="all Gaussians would be removed"):
        pre_edit(only, found.views, found.regions_by_change, SMALL)


def test_editing_without_views_is_rejected() -> None:
    gaussian_map, _ = change_room.mapped()
    with pytest.raises(ValueError, match="pre_edit: views: expected at least one, got none"):
        pre_edit(gaussian_map, [], update_room.collected("removal").regions_by_change, SMALL)


def test_views_without_depth_add_nothing() -> None:
    found = update_room.collected("addition")
    views = [
        replace(view, frame=replace(view.frame, depth=np.zeros_like(view.frame.depth)))
        for view in found.views
    ]
    gaussian_map, _ = change_room.mapped()
    for config in (SMALL, GS_LTS):
        edit = pre_edit(gaussian_map, views, found.regions_by_change, config)
        assert edit.added == 0


def test_a_float64_map_is_rejected() -> None:
    found = update_room.collected("removal")
    gaussian_map, _ = change_room.mapped()
    with pytest.raises(ValueError, match="expected float32, got float64"):
        pre_edit(gaussian_map.astype(np.float64), found.views, found.regions_by_change, GS_LTS)


def test_arrays_of_the_core_are_checked() -> None:
    gaussian_map, _ = change_room.mapped()
    view = gaussian_map.view()
    camera = update_room.collected("removal").views[0].camera
    mask = np.zeros((120, 160), np.bool_)
    with pytest.raises(ValueError, match="masks: expected 1, one per camera, got 2"):
        core.count_votes(view, [camera], [mask, mask], None, core.VoteRule())
    with pytest.raises(ValueError, match=r"masks: expected .* bool .* \(120, 160\), got uint8"):
        core.count_votes(view, [camera], [mask.view(np.uint8)], None, core.VoteRule())
    with pytest.raises(ValueError, match="points: expected"):
        core.nearest_gaussians(view, np.zeros((2, 3)), 1)
    with pytest.raises(ValueError, match="behind_m must be finite and not negative"):
        core.count_votes(view, [camera], [mask], None, core.VoteRule(behind_m=-1))
