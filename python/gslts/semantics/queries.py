"""Where in a map something is that words tell: GS-LTS, sec. III-B, Querying and Localization."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.clusters import CELL_STRIDES, cells_of, connected_components, dbscan
from gslts.semantics.relevance import RelevanceScorer
from gslts.semantics.source import SemanticSource
from gslts.types import Floats, Floats32

SAMPLE = 20_000
"""Gaussians that are asked first."""
AROUND_M = 0.25
"""All Gaussians so near to one that matches, or a bit farther, are asked as well."""
LEAST_OPACITY = 0.3
LINK_M = 0.07
"""Gaussians that match and are so near to each other are of one instance."""
KDTREE_SINGLE = 4
"""FLANN's exact k-d tree; OpenCV does not name it in Python."""
NEIGHBOURS, LINK_SPACINGS = 4, 3.0
"""In a coarse map, they are linked so many times as far as they are from their third neighbour."""
LEAST_GAUSSIANS = 12
LEAST_SHARE = 0.1
"""Of the Gaussians of the largest instance."""
CELL_M = 0.02
"""Gaussians of one cell are clustered as one."""
MANY_CELLS = 4_000
"""Of what has more, such as walls, cells are half as wide as what they are linked over."""
JOIN_M = 0.3
"""An object's pieces are no farther apart in height where what joins them was not seen."""
JOIN_SHARE = 0.7
"""Of the smaller piece's outline on the floor that the other one's must cover."""
TRIM = 0.5
"""Percent of the Gaussians of an instance that may stick out of its box on each side."""


@dataclass(frozen=True, eq=False)
class Instance:
    """One object that fits a query.

    Attributes:
        low, high: (3,) corners of the box around it, axes of the world, m.
        corners: [4,2] those of the smallest upright box, on the floor, x and y, m; its heights are
            those of `low` and `high`.
        score: Mean relevance of its Gaussians, 0 to 1.
        rows: [K] of its Gaussians in the map.
    """

    low: Floats
    high: Floats
    corners: Floats
    score: float
    rows: NDArray[np.intp]

    @property
    def middle(self) -> Floats:
        """(3,) m."""
        middle: Floats = (self.low + self.high) / 2
        return middle


class SemanticQueries:
    """Asks one map.

    Args:
        gaussian_map: With features of L * d numbers.
        autoencoder: Of the features.
        source: Of words.

    Raises:
        ValueError: The features are not those of the autoencoder.
    """

    def __init__(
        self, gaussian_map: GaussianMap, autoencoder: Autoencoder, source: SemanticSource
    ) -> None:
        self._map, self._source = gaussian_map, source
        self._scorer = RelevanceScorer(gaussian_map, autoencoder, source)
        opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities))
        known = gaussian_map.features.any(axis=1)
        self._rows = np.flatnonzero(known & (opacities >= LEAST_OPACITY))
        # Relative to the map's origin: cells are counted from there.
        self._points = gaussian_map.means[self._rows].astype(np.float64)
        self._cells, self._cell_of = np.unique(
            cells_of(self._points, AROUND_M), return_inverse=True
        )

    def relevance(self, text: str) -> Floats32:
        """[N] how well each Gaussian fits a text, 0 to 1; 0 for those without a meaning.

        Raises:
            ValueError: The text is empty.
        """
        result = np.zeros(self._map.size, np.float32)
        result[self._rows] = self._scorer.scores(self._embedded(text), self._rows)[0]
        return result

    def find(self, text: str) -> list[Instance]:
        """What fits a text, the best first; nothing if nothing fits as well as the source asks.

        Raises:
            ValueError: The text is empty.
        """
        query, threshold = self._embedded(text), self._source.threshold
        if len(self._rows) == 0:
            return []
        sample = np.arange(0, len(self._rows), max(1, len(self._rows) // SAMPLE))
        hits = sample[self._scorer.scores(query, self._rows[sample])[0] >= threshold]
        if len(hits) == 0:
            return []
        near = self._around(hits)
        scores = self._scorer.scores(query, self._rows[near])[0]
        kept = scores >= threshold
        return self._instances(near[kept], scores[kept])

    def _embedded(self, text: str) -> Floats32:
        if not text.strip():
            raise ValueError("SemanticQueries: text: it is empty")
        return self._source.encode([text])

    def _around(self, places: NDArray[np.intp]) -> NDArray[np.intp]:
        """All Gaussians in the cells of some and in those beside them."""
        own = self._cells[np.unique(self._cell_of[places])]
        beside = np.array(list(product((-1, 0, 1), repeat=3))) @ CELL_STRIDES
        wanted = np.isin(self._cells, own[:, None] + beside)
        return np.flatnonzero(wanted[self._cell_of])

    def _instances(self, places: NDArray[np.intp], scores: Floats32) -> list[Instance]:
        """Clusters of Gaussians that match, but for stray ones."""
        points = self._points[places]
        labels = _clusters(points)
        counts = np.bincount(labels + 1)[1:]  # Stray ones are -1.
        large = np.flatnonzero(counts >= LEAST_GAUSSIANS)
        pieces = [np.flatnonzero(labels == one) for one in large]
        others = np.delete(self._points, places, axis=0)
        groups = _joined([points[own] for own in pieces], others)
        largest = max((sum(len(pieces[one]) for one in group) for group in groups), default=0)
        found = []
        for group in groups:
            own = np.concatenate([pieces[one] for one in group])
            if len(own) < LEAST_SHARE * largest:
                continue
            low, high = np.percentile(points[own], [TRIM, 100 - TRIM], axis=0)
            corners = cv2.boxPoints(cv2.minAreaRect(points[own, :2].astype(np.float32)))
            score = float(scores[own].mean())
            rows, origin = self._rows[places[own]], self._map.origin
            found.append(Instance(low + origin, high + origin, corners + origin[:2], score, rows))
        return sorted(found, key=lambda one: -one.score * np.sqrt(len(one.rows)))


def _clusters(points: Floats) -> NDArray[np.intp]:
    """[K] cluster of each point, -1 for stray ones; dense ones count by their cell."""
    middles, cell_of, counts = _thinned(points, CELL_M)
    some = middles[:: -(-len(middles) // MANY_CELLS)]
    link_m = max(LINK_M, LINK_SPACINGS * _spacing_m(middles, some))
    if len(middles) > MANY_CELLS:
        middles, cell_of, counts = _thinned(points, link_m / 2)
    return dbscan(middles, link_m, NEIGHBOURS, counts)[cell_of]


def _spacing_m(points: Floats, some: Floats) -> float:
    """Median distance of some points from their third neighbour, or from the farthest there is."""
    tree = cv2.flann.Index(points.astype(np.float32), {"algorithm": KDTREE_SINGLE})
    squares = tree.knnSearch(some.astype(np.float32), min(NEIGHBOURS, len(points)), params={})[1]
    return float(np.median(np.sqrt(squares[:, -1])))


def _thinned(points: Floats, edge_m: float) -> tuple[Floats, NDArray[np.intp], NDArray[np.intp]]:
    """[C,3] mean of the points of each cell, [K] cell of each point, [C] how many each has."""
    _, cell_of, counts = np.unique(
        cells_of(points, edge_m), return_inverse=True, return_counts=True
    )
    sums = [np.bincount(cell_of, points[:, axis]) for axis in range(3)]
    return np.stack(sums, axis=1) / counts[:, None], cell_of, counts


def _joined(pieces: list[Floats], others: Floats) -> list[list[int]]:
    """Pieces of one object: one stands above the other, and nothing was seen between them.

    Args:
        pieces: Points of each.
        others: What belongs to no piece.

    Returns:
        The pieces of each object.
    """
    boxes = [np.percentile(own, [TRIM, 100 - TRIM], axis=0) for own in pieces]
    pairs = []
    for a, b in combinations(range(len(pieces)), 2):
        if boxes[a][0, 2] > boxes[b][0, 2]:
            a, b = b, a
        low, high = np.maximum(boxes[a][0], boxes[b][0]), np.minimum(boxes[a][1], boxes[b][1])
        smaller = min(np.prod((box[1] - box[0])[:2]) for box in (boxes[a], boxes[b]))
        # What is above one's top and under the other's bottom: upside down where they overlap.
        low[2], high[2] = high[2], low[2]
        above = high[2] - low[2] < JOIN_M
        if above and np.prod(np.maximum(0, (high - low)[:2])) > JOIN_SHARE * smaller:
            between = ((others > low) & (others < high)).all(axis=1).sum()
            if between < LEAST_GAUSSIANS:
                pairs.append((a, b))
    least = connected_components(len(pieces), np.array(pairs, np.intp).reshape(-1, 2))
    return [[int(one) for one in np.flatnonzero(least == first)] for first in np.unique(least)]
