"""Merging of neighbouring Gaussians."""

import numpy as np
import oracle
import pytest

from gslts.core.camera import Camera, look_at
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.mapping.density import merge as merging
from gslts.mapping.density.control import axes_of
from gslts.mapping.density.merge import merge
from gslts.mapping.seeding.depth_seeds import flat_gaussians
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.rendering.rasterizer import render


def flats(points: np.ndarray, normals: np.ndarray, colors: np.ndarray, **changes) -> GaussianMap:
    spacing_m = np.full(len(points), changes.pop("spacing_m", 0.1))
    return flat_gaussians(points, normals, colors, spacing_m, changes.pop("opacity", 0.5), 0)


def covars(gaussian_map: GaussianMap) -> np.ndarray:
    turns = oracle.rotation_matrices(gaussian_map.quats.astype(np.float64))
    scaled = turns * np.exp(gaussian_map.log_scales.astype(np.float64))[:, None, :]
    return scaled @ scaled.transpose(0, 2, 1)


def opacities(gaussian_map: GaussianMap) -> np.ndarray:
    return 1 / (1 + np.exp(-gaussian_map.logit_opacities.astype(np.float64)))


def random_pair(rng: np.random.Generator) -> GaussianMap:
    """Make faint Gaussians, so that their area fits into one without widening it."""
    return GaussianMap(
        means=rng.normal(0, 0.1, (2, 3)),
        quats=rng.normal(size=(2, 4)),
        log_scales=np.log(rng.uniform(0.02, 0.2, (2, 3))),
        logit_opacities=np.array([-3.0, -2.5]),
        sh=rng.normal(size=(2, 4, 3)),
        features=rng.normal(size=(2, 2)),
        ids=np.array([7, 3], np.uint64),
        origin=np.array([100.0, 0, 0]),
    )


@pytest.mark.parametrize("seed", range(20))
def test_moments_are_those_of_the_mixture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pair, weights = random_pair(rng), rng.uniform(1, 5, 2)
    merged = merge(pair, 1, weights)
    share = weights / weights.sum()
    # Directly: moments about the origin.
    mean = sum(share[k] * pair.means[k] for k in (0, 1))
    squares = sum(
        share[k] * (covars(pair)[k] + np.outer(pair.means[k], pair.means[k])) for k in (0, 1)
    )
    covar = squares - np.outer(mean, mean)
    np.testing.assert_allclose(merged.means[0], mean, atol=1e-12)
    wider = covars(merged)[0] / covar
    assert wider.min() > 1 - 1e-9
    np.testing.assert_allclose(wider, wider[0, 0], rtol=1e-6)
    np.testing.assert_allclose(merged.sh[0], np.tensordot(share, pair.sh, 1), atol=1e-12)
    np.testing.assert_allclose(merged.features[0], share @ pair.features, atol=1e-12)
    assert merged.ids[0] == pair.ids[np.argmax(weights)]
    assert (merged.origin == pair.origin).all()


def test_coincident_gaussians_merge_in_few_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their nearest neighbours are any few of them, which must not be the same few for all."""
    rng = np.random.default_rng(0)
    points = np.concatenate([np.zeros((600, 3)), rng.normal(0, 1, (40, 3))])
    crowd = flats(points, np.tile([0, 0, 1.0], (640, 1)), rng.random((640, 3)))
    rounds: list[int] = []
    merge_pairs = merging._merge

    def count(*arguments) -> None:
        rounds.append(1)
        merge_pairs(*arguments)

    monkeypatch.setattr(merging, "_merge", count)
    assert merge(crowd, 320).size == 320
    assert len(rounds) < 60


def test_without_weights_area_is_the_weight_and_is_kept() -> None:
    points = np.array([[0, 0, 0], [0.1, 0, 0.0]])
    small, large = (
        flats(points, np.tile([0, 0, 1.0], (2, 1)), np.full((2, 3), 0.5), opacity=0.3, spacing_m=s)
        for s in (0.1, 0.2)
    )
    arrays = {
        name: np.concatenate([getattr(small, name)[:1], getattr(large, name)[1:]])
        for name in ("means", "quats", "log_scales", "logit_opacities", "sh")
    }
    pair = GaussianMap(**arrays)
    merged = merge(pair, 1)
    assert merged.means[0, 0] == pytest.approx(0.1 * 4 / 5, rel=1e-5)
    assert merged.ids[0] == 1

    def covered(some: GaussianMap) -> float:
        scales_m = np.sort(np.exp(some.log_scales), axis=1)
        return float((opacities(some) * scales_m[:, 1] * scales_m[:, 2]).sum())

    assert covered(merged) == pytest.approx(covered(pair), rel=1e-5)


def test_two_equal_gaussians_merge_to_the_same() -> None:
    twins = flats(np.ones((2, 3)), np.tile([0, 1.0, 1], (2, 1)), np.full((2, 3), 0.3), opacity=0.6)
    merged = merge(twins, 1)
    np.testing.assert_allclose(merged.means[0], twins.means[0], rtol=1e-6)
    np.testing.assert_allclose(covars(merged)[0], covars(twins)[0], atol=1e-9)
    np.testing.assert_allclose(merged.sh[0], twins.sh[0], rtol=1e-6)
    assert opacities(merged)[0] == pytest.approx(1 - 0.4**2), "what shines through both"


def test_unseen_gaussians_leave_no_trace() -> None:
    pair = random_pair(np.random.default_rng(1))
    merged = merge(pair, 1, np.array([0.0, 3.0]))
    np.testing.assert_allclose(merged.means[0], pair.means[1], atol=1e-12)
    np.testing.assert_allclose(covars(merged)[0], covars(pair)[1], rtol=1e-9)
    np.testing.assert_allclose(opacities(merged)[0], opacities(pair)[1], rtol=1e-9)
    assert merged.ids[0] == pair.ids[1]


def test_plain_neighbours_merge_before_colours_and_edges() -> None:
    """Distant pairs: equal, of two colours, around an edge, and stepped."""
    points = np.array([[0, 0, 0], [0.1, 0, 0.0]])
    up = np.tile([0, 0, 1.0], (2, 1))
    gray = np.full((2, 3), 0.5)
    step, turned, other = points.copy(), up.copy(), gray.copy()
    step[1, 2], turned[1], other[1] = 0.1, (1, 0, 0), (0.9, 0.5, 0.2)
    pairs = [(points, up, gray), (points, up, other), (points, turned, gray), (step, up, gray)]
    shifted = [(p + np.array([10.0 * k, 0, 0]), n, c) for k, (p, n, c) in enumerate(pairs)]
    whole = flats(*(np.concatenate(part) for part in zip(*shifted, strict=True)))
    left = merge(whole, 7)
    assert sorted({*range(8)} - {*left.ids.tolist()}) in ([0], [1])
    assert {*left.ids.tolist()} > {2, 3, 4, 5, 6, 7}


def wall(size: int, rng: np.random.Generator) -> GaussianMap:
    """Plain, of size x size Gaussians 5 cm apart, facing -z, turned at random about that."""
    x, y = np.meshgrid(*2 * [0.05 * (np.arange(size) - (size - 1) / 2)])
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(size**2)])
    normals = np.tile([0, 0, -1.0], (size**2, 1)) + rng.normal(0, 0.02, (size**2, 3))
    colors = np.tile([0.7, 0.5, 0.3], (size**2, 1)) + 0.05 * points
    return flats(points, normals, colors, spacing_m=0.05, opacity=0.8)


@pytest.fixture
def plain() -> GaussianMap:
    return wall(30, np.random.default_rng(0))


def test_a_plain_wall_is_rendered_alike_with_half(plain: GaussianMap) -> None:
    pose = look_at((0.3, 0.2, -1.2), (0, 0, 0), (0, -1, 0))
    camera = Camera(fx=150, fy=150, cx=80, cy=60, width=160, height=120, world_from_camera=pose)

    def error_db(half: GaussianMap) -> float:
        squares = (render(half, camera).rgb - render(plain, camera).rgb) ** 2
        return psnr_from_mse_db(float(squares.mean()))

    half = merge(plain, plain.size // 2)
    assert half.size == plain.size // 2
    good_db = error_db(half)
    assert good_db > 28
    narrower = GaussianMap(
        means=half.means,
        quats=half.quats,
        log_scales=half.log_scales - np.float32(0.5 * np.log(2)),
        logit_opacities=half.logit_opacities,
        sh=half.sh,
    )
    turned = GaussianMap(
        means=half.means,
        quats=half.quats * np.array([1, -1, -1, -1], np.float32),
        log_scales=half.log_scales,
        logit_opacities=half.logit_opacities,
        sh=half.sh,
    )
    dropped = plain.select(np.arange(0, plain.size, 2))
    for bad in (narrower, turned, dropped):
        assert error_db(bad) < good_db - 3


@pytest.mark.parametrize("count", [899, 450, 100, 7, 1])
def test_the_count_is_met_and_the_map_is_valid(plain: GaussianMap, count: int) -> None:
    weights = np.random.default_rng(3).uniform(0, 9, plain.size)
    left = merge(plain, count, weights)
    assert left.size == count
    assert left.dtype == plain.dtype
    assert len({*left.ids.tolist()}) == count
    assert {*left.ids.tolist()} <= {*plain.ids.tolist()}
    assert (np.diff(left.ids.astype(np.int64)) > 0).all(), "in the old order"
    np.testing.assert_allclose(np.linalg.norm(left.quats, axis=1), 1, atol=1e-6)
    axes = axes_of(left.quats.astype(np.float64))
    np.testing.assert_allclose(np.linalg.det(axes), 1, atol=1e-6)
    thinnest = axes[np.arange(count), left.log_scales.argmin(axis=1)]
    assert (np.abs(thinnest[:, 2]) > 0.99).all(), "still flat on the wall"
    assert (weights == np.random.default_rng(3).uniform(0, 9, plain.size)).all()
    again = merge(plain, count, weights)
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh", "ids"):
        assert getattr(left, name).tobytes() == getattr(again, name).tobytes()


def test_unmerged_gaussians_keep_every_bit(plain: GaussianMap) -> None:
    left = merge(plain, plain.size - 1)
    same = [
        np.array_equal(left.log_scales[k], plain.log_scales[int(row)])
        for k, row in enumerate(left.ids)
    ]
    assert sum(same) == plain.size - 2


def test_a_map_that_is_small_enough_is_unchanged(plain: GaussianMap) -> None:
    assert merge(plain, plain.size) is plain
    empty = plain.select(np.zeros(0, np.int64))
    assert merge(empty, 0) is empty


def test_gaussians_at_one_position_and_of_no_size() -> None:
    many = flats(np.zeros((50, 3)), np.tile([0, 0, 1.0], (50, 1)), np.full((50, 3), 0.5))
    assert merge(many, 3, np.zeros(50)).size == 3
    tiny = GaussianMap(
        means=many.means,
        quats=many.quats,
        log_scales=np.full((50, 3), -60, np.float32),
        logit_opacities=np.full(50, -80, np.float32),
        sh=many.sh,
    )
    assert merge(tiny, 3).size == 3


def test_bad_arguments(plain: GaussianMap) -> None:
    with pytest.raises(ValueError, match=r"count: expected at least 1, got 0"):
        merge(plain, 0)
    with pytest.raises(ValueError, match=r"weights: expected \[900\], got \(3,\)"):
        merge(plain, 10, np.ones(3))
    for bad in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="weights: expected finite values of at least 0"):
            merge(plain, 10, np.full(900, bad))


def test_colours_are_harmonics_of_0_5_and_more(plain: GaussianMap) -> None:
    merged = merge(plain, 1)
    np.testing.assert_allclose(0.5 + SH_C0 * merged.sh[0, 0], [0.7, 0.5, 0.3], atol=1e-3)
