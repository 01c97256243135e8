"""Dense features: invariance to light, position, and models from files."""

import numpy as np
import pytest
from change_images import boxes, texture

from gslts.change.features import OrientedGradients, alignment_peak, feature_extractor, similarity

HEIGHT, WIDTH = 90, 120
BORDER_PX = 16
"""Margin larger than the neighbourhoods of the features, px."""


def similarities(first: np.ndarray, other: np.ndarray, halvings: int = 1) -> np.ndarray:
    features = OrientedGradients(halvings)
    return similarity(features(first), features(other), HEIGHT, WIDTH)


halved = pytest.mark.parametrize("halvings", [0, 1])


def test_plain_images_are_similar() -> None:
    dark, bright = (np.full((HEIGHT, WIDTH, 3), value, np.float32) for value in (0.1, 0.9))
    np.testing.assert_allclose(similarities(dark, bright), 1, atol=1e-6)


@halved
def test_features_move_with_the_image(halvings: int) -> None:
    """Shift by 5 and -9 cells."""
    features = OrientedGradients(halvings)
    image = texture(0)
    moved = features(np.roll(image, (5 << halvings, -9 << halvings), axis=(0, 1)))
    expected = np.roll(features(image), (5, -9), axis=(0, 1))
    assert expected.shape == (HEIGHT >> halvings, WIDTH >> halvings, 17)
    border = BORDER_PX >> halvings
    inner = (slice(border + 5, -border - 5), slice(border + 9, -border - 9))
    np.testing.assert_allclose(moved[inner], expected[inner], atol=1e-5)
    assert np.abs(moved - features(image))[inner].max() > 0.01


def test_only_aligned_images_have_a_peak() -> None:
    """Other light and objects on a third of the image keep it; displacements and mirrors do not."""
    features = OrientedGradients()
    for seed in range(5):
        image = boxes(seed)
        changed = 0.6 * image + 0.2
        changed[:, : WIDTH // 3] = boxes(100 + seed)[:, : WIDTH // 3]
        assert alignment_peak(features(image), features(changed)) > 4
        for other in (np.roll(image, 18, axis=1), image[:, ::-1], boxes(200 + seed)):
            peak = alignment_peak(features(image), features(np.ascontiguousarray(other)))
            assert peak < 4


@pytest.mark.parametrize("shape", [(HEIGHT, WIDTH, 3), (8, 8, 3), (2, 2, 3)])
def test_plain_and_tiny_images_have_no_peak(shape: tuple[int, ...]) -> None:
    plain = OrientedGradients()(np.full(shape, 0.5, np.float32))
    assert alignment_peak(plain, plain) == 0


def test_the_peak_is_that_of_its_definition() -> None:
    """A double-precision sum over pixels and displacements of 9 and 18 of 120 cells."""
    rng = np.random.default_rng(0)
    a, b = (rng.random((HEIGHT, WIDTH, 3)).astype(np.float32) for _ in range(2))
    first, second = (x / np.linalg.norm(x.astype(np.float64), axis=-1)[..., None] for x in (a, b))
    means = {}
    for right in (-18, -9, 0, 9, 18):
        for down in (-18, -9, 0, 9, 18):
            pairs = [
                first[y, x] @ second[y - down, x - right]
                for y in range(max(0, down), min(HEIGHT, HEIGHT + down))
                for x in range(max(0, right), min(WIDTH, WIDTH + right))
            ]
            means[right, down] = np.mean(pairs)
    peak = means.pop((0, 0))
    others = np.array(list(means.values()))
    expected = (peak - others.mean()) / others.std()
    assert alignment_peak(a, b) == pytest.approx(expected, abs=1e-2)


def test_halved_features_are_those_of_the_halved_image() -> None:
    """Each pixel of the halved image is the mean of 2 x 2; odd sides are covered too."""
    rng = np.random.default_rng(0)
    image = rng.random((HEIGHT, WIDTH, 3), np.float32)
    blocks = image.reshape(HEIGHT // 2, 2, WIDTH // 2, 2, 3).mean(axis=(1, 3))
    once = OrientedGradients(1)(image)
    np.testing.assert_allclose(once, OrientedGradients(0)(blocks), atol=1e-5)
    np.testing.assert_array_equal(OrientedGradients()(image), once)
    assert OrientedGradients(1)(image[1:, 1:]).shape == (HEIGHT // 2 - 1, WIDTH // 2 - 1, 17)
    assert OrientedGradients(2)(image[:3, :2]).shape == (1, 1, 17)


@halved
def test_features_change_where_the_image_does(halvings: int) -> None:
    """A square of 8 x 8 px changes features symmetrically around its middle."""
    image = texture(0)
    changed = image.copy()
    changed[40:48, 64:72] = 1
    unlike = 1 - similarities(image, changed, halvings)
    rows, columns = np.nonzero(unlike > 0.02)
    middle = (
        np.average(rows + 0.5, weights=unlike[rows, columns]),
        np.average(columns + 0.5, weights=unlike[rows, columns]),
    )
    assert middle == pytest.approx((44, 68), abs=1)
    assert rows.min() > 40 - BORDER_PX
    assert columns.max() < 72 + BORDER_PX


@halved
def test_light_hardly_changes_features(halvings: int) -> None:
    image = texture(0)
    assert similarities(image, 0.7 * image + np.float32(0.1), halvings).min() > 0.97
    assert similarities(image, image, halvings).min() > 1 - 1e-5


@halved
def test_another_texture_changes_features(halvings: int) -> None:
    """Stripes are two cells wide: narrower ones vanish in the halved image."""
    assert np.median(similarities(texture(0), texture(1), halvings)) < 0.85
    on = np.arange(max(HEIGHT, WIDTH)) % (4 << halvings) < 2 << halvings
    stripes = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    stripes[on[:HEIGHT]] = 0.8
    across = np.zeros_like(stripes)
    across[:, on[:WIDTH]] = 0.8
    # Both lean by 45 degrees to the orientations between theirs: 2 of 4 parts.
    assert np.median(similarities(stripes, across, halvings)) < 0.51
    assert np.median(similarities(stripes, np.full_like(stripes, 0.4), halvings)) < 0.05


@halved
def test_a_step_from_dark_to_bright_differs_from_the_opposite(halvings: int) -> None:
    step = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    step[:, WIDTH // 2 :] = 0.8
    assert similarities(step, step[:, ::-1], halvings)[HEIGHT // 2, WIDTH // 2] < 0.1


def test_coarse_features_are_resized_in_place() -> None:
    """A cell of 3 x 4 differs; the minimum of the large image is at its middle."""
    ones = np.ones((3, 4, 2), np.float32)
    other = ones.copy()
    other[2, 1] = 1, -1
    alike = similarity(ones, other, 30, 40)
    assert alike.shape == (30, 40)
    assert alike.dtype == np.float32
    # The middle of the cell lies between pixels 14 and 15, and the border repeats the last row.
    assert alike[29, 14] == pytest.approx(0.05, abs=1e-6)
    np.testing.assert_allclose(alike[29, 5:25], alike[29, 24:4:-1], atol=1e-6)
    np.testing.assert_array_equal(alike[:15], 1)


def test_zero_features_have_no_similarity() -> None:
    nothing = np.zeros((2, 2, 3), np.float32)
    np.testing.assert_array_equal(similarity(nothing, nothing + 1, 2, 2), 0)


@pytest.mark.parametrize("name", ["edges", "onnx", "onnx:", "transformers:", ""])
def test_unknown_features_are_named(name: str) -> None:
    with pytest.raises(ValueError, match=r"expected gradients, onnx:FILE or transformers:DIR"):
        feature_extractor(name)
    assert isinstance(feature_extractor("gradients"), OrientedGradients)
