"""Large maps have bounds, by which rendering skips what is out of view without another image."""

import copy
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import image_bytes, in_clusters, orbit_camera
from store_maps import ROOM, random_map
from written_maps import assert_same

import gslts
from gslts._core.map import CHUNK_SIZE
from gslts.core.gaussian_map import MIN_BOUNDED, GaussianMap
from gslts.rendering.rasterizer import Rasterizer, rows_in_view
from gslts.store.map_store import MapStore


@pytest.fixture(scope="module")
def large() -> GaussianMap:
    """Return clusters of small Gaussians, most of them out of view of a camera."""
    return in_clusters(random_map(MIN_BOUNDED + 1000, features=1))


def without_bounds(gaussian_map: GaussianMap) -> GaussianMap:
    result = gaussian_map.select(np.arange(gaussian_map.size))
    object.__setattr__(result, "bounds", None)
    return result


def test_images_and_gradients_are_the_same(large: GaussianMap) -> None:
    plain = without_bounds(large)
    for seed in range(4):
        camera = orbit_camera(angle_rad=seed)
        assert len(rows_in_view(large, [camera])) < 0.9 * large.size
        results = []
        for gaussian_map in (large, plain):
            rasterizer = Rasterizer()
            images = rasterizer.forward(gaussian_map, camera, gslts.RenderOptions(threads=2))
            gradients = rasterizer.backward(dL_drgb=np.ones_like(images.rgb))
            results.append((image_bytes(images), gradients.rows.tobytes(), gradients.dL_dmeans))
        assert results[0][:2] == results[1][:2]
        assert np.array_equal(results[0][2], results[1][2])


def test_gaussians_out_of_view_contribute_nothing(large: GaussianMap) -> None:
    camera = orbit_camera(angle_rad=2)
    part = large.select(rows_in_view(large, [camera]))
    assert image_bytes(gslts.render(part, camera)) == image_bytes(gslts.render(large, camera))


def test_far_plane_bounds_what_is_seen(large: GaussianMap) -> None:
    camera, options = orbit_camera(angle_rad=2), gslts.RenderOptions(far_m=6)
    near = gslts.render(large, camera, options)
    assert near.depth.max() < 6.5
    assert image_bytes(near) == image_bytes(gslts.render(without_bounds(large), camera, options))
    around = orbit_camera(angle_rad=2, distance_m=60)
    assert len(rows_in_view(large, [around], options)) == 0
    assert len(rows_in_view(large, [around])) > 0


@pytest.mark.parametrize("far_m", [0.01, np.nan, -1.0])
def test_far_plane_must_be_behind_the_near_plane(far_m: float) -> None:
    with pytest.raises(ValueError, match="far_m must be greater than near_m"):
        gslts.render(random_map(3), orbit_camera(), gslts.RenderOptions(far_m=far_m))


def test_rows_in_box_has_all_centres(large: GaussianMap) -> None:
    low, high = np.array([-3.0, -2.0, -5.0]), np.array([4.0, 5.0, 3.0])
    rows = large.rows_in_box(low, high)
    inside = ((large.means >= low) & (large.means <= high)).all(axis=1)
    assert np.isin(np.flatnonzero(inside), rows).all()
    assert len(rows) < large.size
    assert (np.diff(rows) > 0).all()
    small = random_map(10)
    assert small.bounds is None
    assert small.rows_in_box(low, high).tolist() == list(range(10))


def test_other_features_share_the_rest(large: GaussianMap) -> None:
    features = np.ones((large.size, 3), np.float32)
    changed = large.with_features(lambda _: features)
    assert changed.bounds is large.bounds
    assert changed.means is large.means
    assert np.array_equal(changed.features, features)
    with pytest.raises(ValueError, match="features"):
        large.with_features(lambda _: features[1:])
    features[5, 1] = np.nan
    with pytest.raises(ValueError, match="features: must be finite"):
        large.with_features(lambda _: features)


def test_a_copy_has_bounds_of_its_own(large: GaussianMap, tmp_path: Path) -> None:
    MapStore.create(tmp_path, large, ROOM)
    with MapStore(tmp_path) as store:
        read_in_blocks = store.read()
    assert read_in_blocks.chunks is not None
    for gaussian_map in (large, read_in_blocks):
        for copied in (pickle.loads(pickle.dumps(gaussian_map)), copy.deepcopy(gaussian_map)):
            assert copied.chunks is None
            assert_same(copied, large)
            assert not np.shares_memory(copied.means, large.means)
            np.testing.assert_array_equal(copied.bounds.boxes(), large.bounds.boxes())
            with pytest.raises(ValueError, match="read-only"):
                copied.sh[0] = 1


def test_numbers_that_are_not_finite_are_named(large: GaussianMap) -> None:
    sh = large.sh.copy()
    sh[-1, 0, 0] = np.nan
    with pytest.raises(ValueError, match=r"GaussianMap: sh\[66535,0,0\] is nan"):
        replace(large, sh=sh)


def test_maps_of_an_optimizer_have_no_bounds(large: GaussianMap) -> None:
    """Its arrays change with every step."""
    assert gslts.Adam(large).map.bounds is None
    assert large.bounds is not None
    assert len(large.bounds.boxes()) == -(-large.size // CHUNK_SIZE)
