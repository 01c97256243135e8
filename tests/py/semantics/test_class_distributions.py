"""Class distributions: codec, lifting with misses, queries, and names of objects."""

from dataclasses import replace

import numpy as np
import pytest

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.class_codec import ClassCodec
from gslts.semantics.class_names import ClassNames
from gslts.semantics.detector import Detections
from gslts.semantics.detector_source import DetectorSource
from gslts.semantics.lift import PRIOR_VIEWS, FeatureView, lift_codes
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.queries import SemanticQueries

NAMES = ("cup", "sofa")
CODEC = ClassCodec(3)
NOTHING, CUP, BOTH = (1, 0, 0), (0.2, 0.8, 0), (0.1, 0.5, 0.4)


def wall() -> GaussianMap:
    """Return opaque Gaussians on the square of 0.5 m around the origin, x to the right."""
    steps = np.arange(-0.25, 0.26, 0.02)
    points = np.stack(np.meshgrid(steps, [0.0], steps, indexing="ij"), axis=-1).reshape(-1, 3)
    size = len(points)
    return GaussianMap(
        means=points.astype(np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.full((size, 3), np.log(0.01), np.float32),
        logit_opacities=np.full(size, 4, np.float32),
        sh=np.zeros((size, 1, 3), np.float32),
        features=np.zeros((size, 3), np.float32),
    )


def view(left: tuple, right: tuple, distance_m: float = 1.0) -> FeatureView:
    """Return a view of the wall, with a distribution in each half."""
    camera = camera_from_fov(80, 60, 0.9, look_at((0, -distance_m, 0), (0, 0, 0)))
    labels = np.zeros((60, 80), np.int32)
    labels[:, 40:] = 1
    return camera, labels, np.array([left, right], np.float32)


def lifted(*views: FeatureView) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean distributions of the left and of the right third of the wall."""
    gaussian_map = wall()
    features = lift_codes(gaussian_map, views, CODEC, threads=1)
    np.testing.assert_allclose(features.sum(axis=1), 1, atol=1e-5)
    x = gaussian_map.means[:, 0]
    return features[x < -0.1].mean(axis=0), features[x > 0.1].mean(axis=0)


def test_misses_lower_the_score() -> None:
    always, never = lifted(*[view(CUP, NOTHING)] * 10)
    sometimes, _ = lifted(*[view(CUP, NOTHING)] * 5, *[view(NOTHING, NOTHING)] * 5)
    views = 10 * 0.8  # What 10 views count at most, with the weights of this map.
    assert always[1] == pytest.approx(0.8 * views / (views + PRIOR_VIEWS), abs=0.06)
    assert sometimes[1] == pytest.approx(always[1] / 2, abs=0.01)
    np.testing.assert_allclose(never, NOTHING, atol=1e-6)


def test_a_single_false_detection_vanishes() -> None:
    false, _ = lifted(view(CUP, NOTHING), *[view(NOTHING, NOTHING)] * 9)
    alone, _ = lifted(view((0.4, 0.6, 0), NOTHING))
    assert false[1] < DetectorSource.threshold
    assert 0 < alone[1] < 0.13


def test_near_views_do_not_outvote_far_ones() -> None:
    """A view with four times the pixels counts about as much as another one."""
    mixed, _ = lifted(view(CUP, NOTHING, 0.8), view(NOTHING, NOTHING, 1.6))
    other, _ = lifted(view(NOTHING, NOTHING, 0.8), view(CUP, NOTHING, 1.6))
    assert mixed[1] == pytest.approx(other[1], rel=0.5)


def test_unseen_gaussians_have_no_distribution() -> None:
    gaussian_map = wall()
    camera, labels, codes = view(CUP, CUP)
    labels[:, :40] = -1
    features = lift_codes(gaussian_map, [(camera, labels, codes)], CODEC, threads=1)
    assert not features[gaussian_map.means[:, 0] < -0.05].any()


def source() -> DetectorSource:
    return DetectorSource(ClassNames(NAMES))


def two_cups(first: float, second: float, around: float) -> GaussianMap:
    """Return a wall with the scores of two cups of 0.1 m, and of what is around them."""
    gaussian_map = wall()
    x, z = gaussian_map.means[:, 0], gaussian_map.means[:, 2]
    scores = np.full(gaussian_map.size, around, np.float32)
    scores[(np.abs(x + 0.12) < 0.05) & (np.abs(z) < 0.05)] = first
    scores[(np.abs(x - 0.12) < 0.05) & (np.abs(z) < 0.05)] = second
    features = np.stack([1 - scores, scores, np.zeros_like(scores)], axis=1)
    return replace(gaussian_map, features=features.astype(np.float32))


@pytest.mark.parametrize(("first", "second", "around"), [(0.6, 0.5, 0.15), (0.5, 0.12, 0.02)])
def test_objects_end_where_scores_fall_off(first: float, second: float, around: float) -> None:
    """Also of two cups that touch by weak scores, and of one that was often missed."""
    found = SemanticQueries(two_cups(first, second, around), CODEC, source()).find("cups")
    assert len(found) == 2
    for instance, x in zip(found, (-0.12, 0.12), strict=True):
        np.testing.assert_allclose(instance.center, (x, 0, 0), atol=0.02)
        assert max(instance.high - instance.low) < 0.11
    assert [round(instance.score, 2) for instance in found] == [first, second]


def test_what_the_detector_does_not_know_is_not_found() -> None:
    queries = SemanticQueries(two_cups(0.6, 0.5, 0), CODEC, source())
    for text in ("sofa", "unicorn", "object", "🙂"):
        assert queries.find(text) == []
    assert queries.explain("sofas") == ""
    assert queries.explain("unicorn").startswith('"unicorn": none of the 2 classes')


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "got nothing"),
        (" \n", "got nothing"),
        ("cup " * 2500, "up to 300 characters, got 10000"),
    ],
)
def test_queries_without_sense_are_rejected(text: str, message: str) -> None:
    queries = SemanticQueries(two_cups(0.6, 0.5, 0), CODEC, source())
    for ask in (queries.find, queries.explain, queries.relevance):
        with pytest.raises(ValueError, match=message):
            ask(text)


def test_objects_are_named_by_their_mean_distribution() -> None:
    semantics = MapSemantics(source(), CODEC, NAMES)
    gaussian_map = two_cups(0.3, 0.0, 0.0)
    x = gaussian_map.means[:, 0]
    assert semantics.name_of(gaussian_map, np.flatnonzero(x < -0.05)) == "cup"
    assert semantics.name_of(gaussian_map, np.flatnonzero(x > 0.05)) is None
    assert semantics.name_of(gaussian_map, np.zeros(0, np.intp)) is None


def test_what_goes_on_around_an_object_does_not_name_it() -> None:
    """A cup that is detected less often than the sofa behind it."""
    semantics = MapSemantics(source(), CODEC, NAMES)
    gaussian_map = two_cups(0.1, 0.0, 0.0)
    features = gaussian_map.features.copy()
    features[:, 2] = 0.4
    both = replace(gaussian_map, features=features)
    cup = np.flatnonzero(features[:, 1] > 0)
    assert semantics.name_of(both, cup) == "cup"
    features[cup, 2] = 0.6  # The sofa stands out by more.
    assert semantics.name_of(replace(both, features=features), cup) == "sofa"


def test_an_object_is_named_by_detections_of_its_size() -> None:
    """A cup that is detected in one frame, before a sofa that is detected in all."""
    frame = RgbdFrame(
        np.zeros((60, 80, 3), np.uint8),
        np.ones((60, 80), np.float32),
        camera_from_fov(80, 60, 0.9, np.eye(4)),
    )
    sofa = Detections(np.float32([[0, 0, 80, 50]]), np.float32([0.9]), np.array([1]))
    both = Detections(
        np.float32([[0, 0, 80, 50], [30, 20, 50, 40]]), np.float32([0.9, 0.3]), np.array([1, 0])
    )
    seen = iter([sofa, both, sofa, sofa])
    detector = DetectorSource(ClassNames(NAMES), lambda _: next(seen))
    semantics = MapSemantics(detector, CODEC, NAMES)
    assert semantics.name_in_frames([(frame, (32, 21, 51, 41))] * 3) == "cup"
    assert semantics.name_in_frames([(frame, (32, 21, 51, 41))]) is None
