"""Text queries on synthetic maps with known semantic features."""

import tracemalloc
from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics import queries as queries_module
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.categories import classify_gaussians
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.source import Oracle
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.semantics.vocabulary import NOUNS, UNRELATED

ORIGIN = np.array([10.0, -5.0, 0.5])
NAMES = ("Mug", "Sofa", "Lamp", "Shelf", "Wall")


@cache
def autoencoder() -> Autoencoder:
    return train_autoencoder(Oracle().encode(NAMES), 8, steps=400)


def block(low: tuple[float, ...], high: tuple[float, ...], step_m: float = 0.02) -> np.ndarray:
    """Return points that fill a box."""
    axes = [np.arange(a, b + 1e-9, step_m) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def map_of(*parts: tuple[str | None, np.ndarray]) -> GaussianMap:
    """Return Gaussians at points, with the features of a name, or of none."""
    points = np.concatenate([points for _, points in parts]).astype(np.float32)
    features = [
        np.zeros((len(points), 8), np.float32)
        if name is None
        else np.repeat(autoencoder().encode(Oracle().encode([name])), len(points), axis=0)
        for name, points in parts
    ]
    size = len(points)
    return GaussianMap(
        means=points,
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.full((size, 3), -4, np.float32),
        logit_opacities=np.full(size, 3, np.float32),
        sh=np.zeros((size, 1, 3), np.float32),
        features=np.concatenate(features),
        origin=ORIGIN,
    )


def queries(*parts: tuple[str | None, np.ndarray]) -> SemanticQueries:
    return SemanticQueries(map_of(*parts), autoencoder(), Oracle())


WALL = ("Wall", block((-1, -1, 0), (-0.9, 1, 2), 0.05))
FIRST, SECOND = block((0, 0, 0.5), (0.1, 0.1, 0.6)), block((0.5, 0, 0.5), (0.58, 0.08, 0.6))


def test_each_instance_has_a_box_and_noise_is_dropped() -> None:
    stray = block((0.3, 0.6, 1), (0.32, 0.62, 1.02))
    found = queries(WALL, ("Mug", FIRST), ("Mug", SECOND), ("Mug", stray)).find("mug")
    assert len(found) == 2
    for instance, points in zip(found, (FIRST, SECOND), strict=True):
        np.testing.assert_allclose(instance.low, points.min(axis=0) + ORIGIN, atol=0.003)
        np.testing.assert_allclose(instance.high, points.max(axis=0) + ORIGIN, atol=0.003)
        assert instance.score > Oracle.threshold
        assert len(instance.rows) == len(points)


def test_a_large_map_origin_does_not_change_results() -> None:
    far = np.array([512_345.6, 4_123_456.7, 400.0])  # Such as eastings and northings, m.
    near = map_of(WALL, ("Mug", FIRST), ("Mug", SECOND))
    expected = SemanticQueries(near, autoencoder(), Oracle()).find("mug")
    found = SemanticQueries(replace(near, origin=far), autoencoder(), Oracle()).find("mug")
    assert len(found) == len(expected) == 2
    for instance, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(instance.rows, other.rows)
        np.testing.assert_allclose(instance.low - far, other.low - ORIGIN, atol=1e-6)
        np.testing.assert_allclose(
            instance.corners - far[:2], other.corners - ORIGIN[:2], atol=1e-6
        )


def test_large_objects_are_clustered_in_larger_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [block((y, 0, 0), (y + 0.4, 1, 1)) for y in (0.0, 0.5, 1.2)]
    some = queries(*(("Shelf", points) for points in rows))
    expected = [instance.rows for instance in some.find("shelf")]
    monkeypatch.setattr(queries_module, "MAX_CELLS", 500)
    found = [instance.rows for instance in some.find("shelf")]
    assert len(found) == len(expected) == 3
    for instance, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(instance, other)


def test_copies_of_an_object_are_found_as_a_single_copy_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both halves of the object are linked by its small cells only."""
    halves = block((0, 0, 0), (0.1, 0.1, 0.1)), block((0.165, 0, 0), (0.265, 0.1, 0.1))
    copy = np.concatenate(halves)
    monkeypatch.setattr(queries_module, "MAX_CELLS", 500)
    assert len(queries(("Mug", copy)).find("mug")) == 1
    rows = np.arange(60 * len(copy)).reshape(60, -1)
    offsets = [np.array((0.53 * (number % 10), number // 10, 0)) for number in range(60)]
    copies = [("Mug", copy + offset) for offset in offsets]
    large = block((0, 8, 0), (0.3, 8.2, 0.3))  # Of more cells than 500 by itself.
    found = queries(*copies, ("Mug", large)).find("mug")
    objects = [*rows, rows.size + np.arange(len(large))]
    assert sorted(tuple(instance.rows) for instance in found) == [tuple(own) for own in objects]


def test_a_rotated_object_has_a_rotated_box() -> None:
    turn = np.deg2rad(30)
    sides = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    points = block((0, 0, 0), (0.6, 0.2, 0.3))
    points[:, :2] = points[:, :2] @ sides
    (instance,) = queries(("Sofa", points)).find("sofa")
    edges = np.linalg.norm(np.diff(instance.corners[:3], axis=0), axis=1)
    np.testing.assert_allclose(sorted(edges), (0.2, 0.6), atol=0.01)


@pytest.mark.parametrize(
    ("between", "count"),
    [(None, 1), (("Shelf", block((-0.3, -0.3, 0.2), (0.3, 0.3, 0.22))), 2)],
)
def test_vertical_pieces_are_joined_unless_another_object_is_between(
    between: tuple[str, np.ndarray] | None, count: int
) -> None:
    base = ("Lamp", block((-0.1, -0.1, 0), (0.1, 0.1, 0.1)))
    shade = ("Lamp", block((-0.12, -0.12, 0.3), (0.12, 0.12, 0.5)))
    parts = [base, shade] if between is None else [base, shade, between]
    found = queries(*parts).find("lamp")
    assert len(found) == count
    assert max(instance.high[2] - instance.low[2] for instance in found) == pytest.approx(
        0.5 if count == 1 else 0.2, abs=0.01
    )


def test_pieces_side_by_side_are_not_joined() -> None:
    left = ("Lamp", block((0, 0, 0), (0.1, 0.1, 0.1)))
    right = ("Lamp", block((0.2, 0, 0.15), (0.3, 0.1, 0.25)))
    assert len(queries(left, right).find("lamp")) == 2


def test_pieces_are_joined_as_by_comparing_all_pairs() -> None:
    """Random boxes of some heights, of which some hide each other from above."""
    rng = np.random.default_rng(0)
    lows = rng.uniform((0, 0, 0), (3, 3, 2), (120, 3))
    sizes = rng.uniform(0.1, 0.8, (120, 3)) * (1, 1, 0.2)
    pieces = [rng.uniform(low, low + size, (40, 3)) for low, size in zip(lows, sizes, strict=True)]
    blocked = rng.random((120, 120)) < 0.3

    def count_between(low: np.ndarray, high: np.ndarray) -> int:
        cell = (20 * (low + high)).astype(int) % 120
        return 12 if blocked[cell[0], cell[2]] else 0

    boxes = [np.percentile(piece, queries_module.TRIM, axis=0) for piece in pieces]
    groups = {number: {number} for number in range(120)}
    for a, b in combinations(range(120), 2):
        low, high = (
            choose(boxes[a][k], boxes[b][k]) for k, choose in enumerate((np.maximum, np.minimum))
        )
        areas = [np.prod((box[1] - box[0])[:2]) for box in (boxes[a], boxes[b])]
        overlap = np.prod(np.maximum(0, high - low)[:2])
        bottom, top = (*low[:2], high[2]), (*high[:2], low[2])
        if (
            low[2] - high[2] < queries_module.MAX_VERTICAL_GAP_M
            and overlap > queries_module.MIN_FOOTPRINT_OVERLAP * min(areas)
            and count_between(np.array(bottom), np.array(top)) == 0
        ):
            both = groups[a] | groups[b]
            groups.update(dict.fromkeys(both, both))
    expected = sorted({tuple(sorted(group)) for group in groups.values()})
    assert 40 < len(expected) < 110
    assert [tuple(own) for own in queries_module._join_pieces(pieces, count_between)] == expected


def test_memory_does_not_grow_with_the_square_of_the_number_of_objects() -> None:
    corners = np.stack(np.divmod(np.arange(1500), 40), axis=1) @ ((1, 0, 0), (0, 1, 0))
    mugs = (corners[:, None] + block((0, 0, 0), (0.04, 0.02, 0.02))).reshape(-1, 3)
    some = queries(("Mug", mugs))
    tracemalloc.start()
    try:
        assert len(some.find("mug")) == 1500
        assert tracemalloc.get_traced_memory()[1] < 30e6
    finally:
        tracemalloc.stop()


def test_a_small_object_of_a_large_map_is_found() -> None:
    points = np.random.default_rng(0).uniform((-20, -20, 0), (20, 20, 3), (600_000, 3))
    parts = (("Wall", points[:300_001]), ("Mug", FIRST[:14]), ("Wall", points[300_001:]))
    (instance,) = queries(*parts).find("mug")
    np.testing.assert_array_equal(instance.rows, 300_001 + np.arange(14))


class Unsure(Oracle):
    """Matches whatever fits a text better than the canonical phrases, as CLIP does."""

    threshold = 0.5


class Calibrated(Unsure):
    unrelated = UNRELATED


def test_unrelated_texts_raise_the_threshold_of_a_map() -> None:
    gaussian_map = map_of(WALL, ("Mug", FIRST), ("Sofa", SECOND))
    unsure = SemanticQueries(gaussian_map, autoencoder(), Unsure())
    calibrated = SemanticQueries(gaussian_map, autoencoder(), Calibrated())
    assert unsure.threshold == Unsure.threshold < calibrated.threshold
    absent = sorted(set(NOUNS) - {name.lower() for name in NAMES})
    assert sum(bool(unsure.find(text)) for text in absent) > 0.2 * len(absent)
    assert sum(bool(calibrated.find(text)) for text in absent) < 0.05 * len(absent)
    for text, points in (("mug", FIRST), ("sofa", SECOND)):
        (instance,) = calibrated.find(text)
        np.testing.assert_allclose(instance.low, points.min(axis=0) + ORIGIN, atol=0.003)
    nothing = SemanticQueries(map_of((None, FIRST)), autoencoder(), Calibrated())
    assert nothing.find("mug") == []


def test_categories_have_the_threshold_of_queries() -> None:
    gaussian_map = map_of(WALL, ("Mug", FIRST), ("Sofa", SECOND))
    some = SemanticQueries(gaussian_map, autoencoder(), Calibrated())
    rows = np.arange(gaussian_map.size)
    for text in (*NOUNS[::10], "mug"):
        for source in (Calibrated(), some.source):
            classes = classify_gaussians(gaussian_map, rows, autoencoder(), source, [text])
            np.testing.assert_array_equal(classes == 0, some.relevance(text) >= some.threshold)


def test_absent_objects_are_not_found() -> None:
    some = queries(WALL, ("Mug", FIRST))
    for name in ("Sofa", "Lamp", "piano", "bicycle"):
        assert some.find(name) == []
    assert queries((None, FIRST)).find("mug") == []


def test_relevance_of_gaussians() -> None:
    some = queries(("Mug", FIRST), ("Sofa", SECOND), (None, WALL[1]))
    scores = np.split(some.relevance("mug"), np.cumsum([len(FIRST), len(SECOND)]))
    assert scores[0].min() > Oracle.threshold > scores[1].max() > 0
    assert (scores[2] == 0).all()


@pytest.mark.parametrize("text", ["", "  "])
def test_empty_texts_are_rejected(text: str) -> None:
    with pytest.raises(ValueError, match="SemanticQueries: text: expected a name"):
        queries(("Mug", FIRST)).find(text)


def test_features_of_another_autoencoder_are_rejected() -> None:
    bare = map_of(("Mug", FIRST)).select(np.arange(5))
    wider = train_autoencoder(Oracle().encode(NAMES), 12, steps=1)
    with pytest.raises(
        ValueError, match="the features of the map have 8 dimensions, which is no multiple"
    ):
        SemanticQueries(bare, wider, Oracle())
    other = train_autoencoder(np.eye(16, dtype=np.float32), 8, steps=1)
    with pytest.raises(
        ValueError, match="has semantics of 16-D embeddings, the source gives 512-D"
    ):
        SemanticQueries(bare, other, Oracle())
