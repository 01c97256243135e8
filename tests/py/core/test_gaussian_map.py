import pickle

import numpy as np
import pytest
import scenes
from written_maps import assert_same

import gslts


def test_defaults_of_features_ids_and_origin():
    gaussians = scenes.single_gaussian(np.float32)
    assert gaussians.features.shape == (1, 0)
    assert gaussians.features.dtype == np.float32
    np.testing.assert_array_equal(gaussians.ids, np.array([0], np.uint64))
    np.testing.assert_array_equal(gaussians.origin, np.zeros(3))


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_properties(sh_degree):
    gaussians = scenes.random_map(7, sh_degree=sh_degree, feature_dims=5)
    assert gaussians.size == 7
    assert gaussians.sh_degree == sh_degree
    assert gaussians.feature_dims == 5
    assert gaussians.dtype == np.float64
    assert "size=7" in repr(gaussians)


def test_contiguous_arrays_are_shared_and_others_copied():
    means = np.zeros((1, 3))
    assert np.shares_memory(scenes.single_gaussian(means=means).means, means)
    wide = np.zeros((1, 6))[:, ::2]
    gaussians = scenes.single_gaussian(means=wide)
    assert not np.shares_memory(gaussians.means, wide)
    assert gaussians.means.flags.c_contiguous


def test_arrays_are_read_only_and_the_callers_stay_writeable():
    means = np.zeros((1, 3))
    gaussians = scenes.single_gaussian(means=means)
    with pytest.raises(ValueError, match="read-only"):
        gaussians.means[0, 0] = 1
    means[0, 0] = 1


def test_astype_keeps_ids_and_origin():
    gaussians = scenes.random_map(5, feature_dims=2, origin=(1e6, 0, 0)).select(np.array([4, 2]))
    single = gaussians.astype(np.float32)
    assert single.dtype == np.float32
    assert single.origin.dtype == np.float64
    np.testing.assert_array_equal(single.ids, gaussians.ids)
    np.testing.assert_array_equal(single.origin, gaussians.origin)
    np.testing.assert_array_equal(single.astype(np.float64).sh, gaussians.sh)


@pytest.mark.parametrize(
    "rows", [np.array([3, 0]), np.array([True, False, False, True]), np.array([], np.int64)]
)
def test_select_takes_the_rows_of_every_array(rows):
    gaussians = scenes.random_map(4, sh_degree=1, feature_dims=2, origin=(1, 2, 3))
    chosen = gaussians.select(rows)
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh", "features", "ids"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(gaussians, name)[rows])
    np.testing.assert_array_equal(chosen.origin, gaussians.origin)


def test_select_rejects_what_would_break_the_ids():
    gaussians = scenes.random_map(4)
    with pytest.raises(ValueError, match="ids: 1 occurs"):
        gaussians.select(np.array([1, 2, 1]))
    with pytest.raises(ValueError, match="rows"):
        gaussians.select(np.array([0.0, 1.0]))
    with pytest.raises(IndexError):
        gaussians.select(np.array([4]))


def test_map_survives_pickling():
    gaussians = scenes.random_map(4, feature_dims=2)
    copy = pickle.loads(pickle.dumps(gaussians))
    assert_same(copy, gaussians)
    with pytest.raises(ValueError, match="read-only"):
        copy.means[0, 0] = 1
    camera = scenes.orbit_camera()
    np.testing.assert_array_equal(
        gslts.render(copy, camera).rgb, gslts.render(gaussians, camera).rgb
    )
