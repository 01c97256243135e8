"""Patches of a map, and the exposures of a recording."""

from dataclasses import replace

import numpy as np
import store_maps
from change_room import VIEWPOINTS, home, mapped, see

from gslts.extension.exposure import recording_exposure
from gslts.extension.fit import Patch, merge_patch, replay_frames, without_changes
from gslts.extension.new_space import FrameSpace
from gslts.mapping.density.control import join
from gslts.mapping.observation import Observation
from gslts.mapping.seeding.depth_seeds import seed_from_depth
from gslts.rendering.rasterizer import render

NAMES = ("means", "quats", "log_scales", "logit_opacities", "sh")


def test_merged_map_keeps_what_is_outside_and_fixed() -> None:
    before = store_maps.random_map(50)
    first_id = int(before.ids[-1]) + 10
    old = replace(before.select(np.arange(10, 30)), features=np.zeros((20, 0), np.float32))
    fixed = np.arange(20) < 15
    new = replace(
        old.select(np.arange(4)), ids=np.array([first_id + k for k in (0, 1, 5, 9)], np.uint64)
    )
    # The seam is rows 25 to 29: row 27 was pruned, the others moved.
    moved = replace(old, means=old.means + np.where(fixed, 0, 1)[:, None].astype(np.float32))
    fitted = _join(moved.select(np.delete(np.arange(20), 17)), new)
    merged = merge_patch(
        before, Patch(_join(old, new), np.append(fixed, [False] * 4)), fitted, first_id
    )
    assert merged.ids.tolist() == [
        *np.delete(before.ids, 27).tolist(),
        *range(first_id, first_id + 4),
    ]
    rows = np.delete(np.arange(50), [25, 26, 27, 28, 29])
    kept = merged.select(np.isin(merged.ids, before.ids[rows]))
    store_maps.assert_same(kept, before.select(rows))
    for name in NAMES:
        assert np.array_equal(getattr(merged, name)[-4:], getattr(new, name))
    assert not merged.features[-4:].any()
    assert np.array_equal(merged.means[25], before.means[25] + 1)


def _join(first, second):
    parts = {name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in NAMES}
    ids = np.concatenate([first.ids, second.ids])
    features = np.zeros((len(ids), 0), np.float32)
    return replace(first, **parts, ids=ids, features=features)


def _known_space(frame) -> FrameSpace:
    nothing = np.zeros(frame.depth.shape, np.bool_)
    return FrameSpace(nothing, nothing, nothing)


def test_exposure_of_a_darker_recording_is_found() -> None:
    gain, offset = 0.8, 0.05
    frames = []
    for viewpoint in VIEWPOINTS:
        frame = see(home(), viewpoint)
        darker = gain * (frame.rgb / 255.0) + offset
        frames.append(replace(frame, rgb=(255 * darker + 0.5).astype(np.uint8)))
    observations = [Observation.of(frame) for frame in frames]
    exposure = recording_exposure(mapped()[0], observations, [_known_space(f) for f in frames])
    np.testing.assert_allclose(exposure.gain, gain, atol=0.04)
    np.testing.assert_allclose(exposure.offset, offset, atol=0.02)


def test_exposure_does_not_depend_on_what_the_mask_hides() -> None:
    frames = []
    for viewpoint in VIEWPOINTS:
        frame = see(home(), viewpoint)
        mask = np.zeros(frame.depth.shape, np.bool_)
        mask[20:100, 30:130] = True
        frames.append(replace(frame, rgb=frame.rgb * mask[..., None], mask=mask))
    observations = [Observation.of(frame) for frame in frames]
    exposure = recording_exposure(mapped()[0], observations, [_known_space(f) for f in frames])
    np.testing.assert_allclose(exposure.gain, 1, atol=0.06)
    np.testing.assert_allclose(exposure.offset, 0, atol=0.04)


def test_replays_show_what_the_patch_has_alone() -> None:
    gaussian_map, cameras = mapped()
    plain = replace(gaussian_map, features=np.zeros((gaussian_map.size, 0), np.float32))
    own = plain.select(plain.means[:, 0] < 2.5)
    new = seed_from_depth([see(home(), VIEWPOINTS[0])] * 2, 0.1, sh_degree=plain.sh_degree)
    patch = Patch(join(own, new, gaussian_map.next_id), np.zeros(own.size + new.size, np.bool_))
    frames = replay_frames(plain, list(cameras.values())[::8], patch, threads=1)
    shares = []
    for frame in frames:
        images, mask = render(own, frame.camera()), frame.mask()
        assert mask is not None
        shares.append(mask.mean())
        assert (images.alpha[mask] > 0.69).all()
        np.testing.assert_allclose(images.depth[mask], frame.depth()[mask], rtol=0.05, atol=0.1)
    assert max(shares) > 0.9
    assert min(shares) < 0.5


def test_exposure_is_the_identity_where_nothing_agrees() -> None:
    frame = see(home(), VIEWPOINTS[0])
    new = np.ones(frame.depth.shape, np.bool_)
    exposure = recording_exposure(
        mapped()[0], [Observation.of(frame)], [FrameSpace(new, ~new, ~new)]
    )
    assert tuple(exposure.gain) == (1, 1, 1)
    assert tuple(exposure.offset) == (0, 0, 0)


def test_changes_are_masked_out_at_all_resolutions() -> None:
    frame = see(home(), VIEWPOINTS[0])
    changed = np.zeros(frame.depth.shape, np.bool_)
    changed[40:60, 40:60] = True
    nothing = np.zeros_like(changed)
    masked = without_changes(Observation.of(frame), FrameSpace(nothing, nothing, changed))
    assert masked.shows_known
    for level in range(3):
        side = 1 << level
        mask = masked.mask(level)
        assert mask is not None
        assert not mask[40 // side : 60 // side, 40 // side : 60 // side].any()
        assert mask.mean() > 0.9
