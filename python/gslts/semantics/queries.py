"""Text queries: 3D boxes of the objects in a map that match a text (GS-LTS, sec. III-B)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.clusters import CELL_STRIDES, cell_keys, connected_components, dbscan
from gslts.semantics.registry import open_text_semantics
from gslts.semantics.relevance import RelevanceScorer
from gslts.semantics.source import Codec, SemanticSource
from gslts.store.map_folder import read_map
from gslts.types import Floats, Floats32, Indices

MAX_CHARACTERS = 300
"""Maximum length of a query; CLIP reads 77 tokens."""
SAMPLE_SIZE = 20_000
"""Number of Gaussians scored first, evenly sampled as in GS-LTS. All Gaussians near a match are
scored then, so that the number bounds only how small a found object may be."""
NEIGHBOURHOOD_M = 0.25
"""Edge of the cells around matches of the sample in which all Gaussians are scored."""
MIN_OPACITY = 0.3
"""Minimum opacity of scored Gaussians; others are hardly visible."""
LINK_M = 0.07
"""Radius of DBSCAN: distance up to which matching Gaussians belong to one object."""
MIN_NEIGHBOURS, LINK_SPACINGS = 4, 3.0
"""Weight of a core point of DBSCAN; in a coarse map, the radius is a multiple of the median
distance to the third neighbour, given by the second value."""
FLANN_KDTREE_SINGLE = 4
"""FLANN's exact k-d tree; OpenCV has no Python name for it."""
MIN_GAUSSIANS = 12
"""Minimum number of Gaussians of a cluster, and of an object between two pieces."""
MIN_SHARE_OF_PEAK, PEAK = 0.4, 0.95
"""Minimum score of a Gaussian of an object as a share of the object's peak, this quantile of its
scores. Class scores of a detector fall off around an object, where masks of some views reach."""
MIN_SHARE_OF_LARGEST = 0.1
"""Minimum size of an object as a share of the largest one's number of Gaussians; removes fragments
of blurred borders."""
CELL_M = 0.02
"""Gaussians in a cell of this edge are clustered as one weighted point."""
MAX_CELLS = 4_000
"""With more cells, as of walls, their edge becomes half the DBSCAN radius; bounds time."""
MAX_VERTICAL_GAP_M = 0.3
"""Maximum height of an unseen gap between two pieces of one object, such as base and shade of a
lamp."""
MIN_FOOTPRINT_OVERLAP = 0.7
"""Minimum overlap of the footprints of two such pieces, as a share of the smaller one's."""
TRIM_PERCENT = 0.5
"""Percentage of the Gaussians of an object trimmed as outliers at each side of its box."""


@dataclass(frozen=True, eq=False)
class Instance:
    """An object that matches a query.

    Attributes:
        low, high: (3,) corners of the axis-aligned box, world, m.
        corners: [4,2] corners of the smallest upright box, x and y in the world, m; its heights are
            those of `low` and `high`.
        score: Mean relevance of its Gaussians, 0 to 1.
        rows: [K] rows of its Gaussians in the map.
    """

    low: Floats
    high: Floats
    corners: Floats
    score: float
    rows: Indices

    @property
    def center(self) -> Floats:
        """(3,) centre of the axis-aligned box, world, m."""
        center: Floats = (self.low + self.high) / 2
        return center

    def to_json(self) -> dict[str, Any]:
        """Convert to JSON values: boxes in the world, m, score, and number of Gaussians."""
        return {
            "low_m": self.low.tolist(),
            "high_m": self.high.tolist(),
            "corners_m": self.corners.tolist(),
            "score": self.score,
            "gaussians": len(self.rows),
        }


class SemanticQueries:
    """Answers text queries on one map.

    Args:
        gaussian_map: With features of L * d numbers.
        codec: Decodes the features.
        source: Encodes the texts.

    Attributes:
        gaussian_map: The map.

    Raises:
        ValueError: The features do not fit the codec, or that does not fit the source.
    """

    def __init__(self, gaussian_map: GaussianMap, codec: Codec, source: SemanticSource) -> None:
        self.gaussian_map, self._source = gaussian_map, source
        self._scorer = RelevanceScorer(gaussian_map, codec, source)
        opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities))
        has_features = gaussian_map.features.any(axis=1)
        self._rows = np.flatnonzero(has_features & (opacities >= MIN_OPACITY))
        # Relative to the origin of the map, to which cells are aligned.
        self._points = gaussian_map.means[self._rows].astype(np.float64)
        keys = cell_keys(self._points, NEIGHBOURHOOD_M)
        # Cell by cell, so that a query reads only the cells around matches.
        self._by_cell = np.argsort(keys, kind="stable")
        self._cells, starts = np.unique(keys[self._by_cell], return_index=True)
        self._cell_ends = np.append(starts, len(keys))

    @classmethod
    def of_map(
        cls, path: Path | str, text_model: Path | None = None, threads: int = 0
    ) -> SemanticQueries:
        """Read a map folder for queries.

        Args:
            path: A map folder with semantic features, or a version of it such as MAP@3.
            text_model: Folder of a text model; see `open_text_source`.
            threads: For CLIP; 0 uses the default of torch.

        Returns:
            The queries.

        Raises:
            ImportError: transformers is missing.
            OSError: A file cannot be read.
            ValueError: The map has no semantic features, or a file is damaged.
        """
        path = Path(path)
        codec, source = open_text_semantics(path, text_model, threads)
        return cls(read_map(path), codec, source)

    def relevance(self, text: str) -> Floats32:
        """Compute the relevance of all Gaussians to a text.

        Args:
            text: Such as "alarm clock".

        Returns:
            [N] float32, 0 to 1; 0 for Gaussians that are not scored.

        Raises:
            ValueError: The text is empty.
        """
        result = np.zeros(self.gaussian_map.size, np.float32)
        result[self._rows] = self._scorer.scores(self._encode(text), self._rows)[0]
        return result

    def explain(self, text: str) -> str:
        """Explain how a text is understood, if not as it is.

        Args:
            text: Such as "mug".

        Returns:
            Such as '"mug": understood as cup (0.83)'; empty if there is nothing to explain.

        Raises:
            ValueError: The text is empty or too long.
        """
        return self._source.explain(checked_text(text))

    def find(self, text: str) -> list[Instance]:
        """Find the objects that match a text.

        Args:
            text: Such as "alarm clock".

        Returns:
            The objects, the best first; empty if no relevance reaches the threshold of the source.

        Raises:
            ValueError: The text is empty.
        """
        query, threshold = self._encode(text), self._source.threshold
        if len(self._rows) == 0:
            return []
        sample = np.arange(0, len(self._rows), max(1, len(self._rows) // SAMPLE_SIZE))
        matches = sample[self._scorer.scores(query, self._rows[sample])[0] >= threshold]
        if len(matches) == 0:
            return []
        near = self._neighbourhood(matches)
        scores = self._scorer.scores(query, self._rows[near])[0]
        is_match = scores >= threshold
        return self._instances(near[is_match], scores[is_match])

    def _encode(self, text: str) -> Floats32:
        return self._source.encode([checked_text(text)])

    def _neighbourhood(self, indices: Indices) -> Indices:
        """Return all scored Gaussians in the cells of some and in the 26 neighbours of these."""
        own = np.unique(cell_keys(self._points[indices], NEIGHBOURHOOD_M))
        neighbours = np.array(list(product((-1, 0, 1), repeat=3))) @ CELL_STRIDES
        near = np.flatnonzero(np.isin(self._cells, own[:, None] + neighbours))
        parts = [self._by_cell[self._cell_ends[k] : self._cell_ends[k + 1]] for k in near]
        return np.sort(np.concatenate(parts))

    def _instances(self, indices: Indices, scores: Floats32) -> list[Instance]:
        """Cluster matching Gaussians into objects; drop noise and small fragments."""
        points = self._points[indices]
        labels = _cluster(points)
        kept = scores >= MIN_SHARE_OF_PEAK * _peaks(scores, labels)
        if not kept.all():
            indices, scores, points = indices[kept], scores[kept], points[kept]
            labels = _cluster(points)
        counts = np.bincount(labels + 1)[1:]  # Without noise, -1.
        large = np.flatnonzero(counts >= MIN_GAUSSIANS)
        pieces = [np.flatnonzero(labels == label) for label in large]
        groups = _join_pieces([points[piece] for piece in pieces], self._others(points, indices))
        members = [np.concatenate([pieces[piece] for piece in group]) for group in groups]
        largest = max(map(len, members), default=0)
        instances = [
            self._instance(points[own], scores[own], self._rows[indices[own]])
            for own in members
            if len(own) >= MIN_SHARE_OF_LARGEST * largest
        ]
        return sorted(instances, key=lambda instance: -instance.score * np.sqrt(len(instance.rows)))

    def _others(self, points: Floats, indices: Indices) -> Floats:
        """Return [P,3] scored Gaussians in the box of some, m, without these."""
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        origin = self.gaussian_map.origin
        rows = self.gaussian_map.rows_in_box(low + origin, high + origin)
        scored = np.searchsorted(self._rows, rows)
        scored = scored[(np.append(self._rows, -1)[scored] == rows)]
        others: Floats = self._points[np.setdiff1d(scored, indices, assume_unique=True)]
        return others

    def _instance(self, points: Floats, scores: Floats32, rows: Indices) -> Instance:
        low, high = np.percentile(points, [TRIM_PERCENT, 100 - TRIM_PERCENT], axis=0)
        corners = cv2.boxPoints(cv2.minAreaRect(points[:, :2].astype(np.float32)))
        origin = self.gaussian_map.origin
        return Instance(
            low + origin, high + origin, corners + origin[:2], float(scores.mean()), rows
        )


def checked_text(text: str) -> str:
    """Check the text of a query.

    Args:
        text: From a user.

    Returns:
        The text.

    Raises:
        ValueError: The text is empty or too long.
    """
    if not text.strip():
        raise ValueError("SemanticQueries: text: expected a name or description, got nothing")
    if len(text) > MAX_CHARACTERS:
        raise ValueError(
            f"SemanticQueries: text: expected up to {MAX_CHARACTERS} characters, got {len(text)}"
        )
    return text


def _peaks(scores: Floats32, labels: Indices) -> Floats32:
    """Return [K] for each point the peak of the scores of its cluster; 0 for noise."""
    peaks = np.zeros_like(scores)
    for label in range(labels.max(initial=-1) + 1):
        own = labels == label
        peaks[own] = np.quantile(scores[own], PEAK)
    return peaks


def _cluster(points: Floats) -> Indices:
    """Return [K] cluster of each point, -1 for noise; points of a cell are clustered as one."""
    centers, cell_of, counts = _downsample(points, CELL_M)
    sample = centers[:: -(-len(centers) // MAX_CELLS)]
    link_m = max(LINK_M, LINK_SPACINGS * _spacing_m(centers, sample))
    if len(centers) > MAX_CELLS:
        centers, cell_of, counts = _downsample(points, link_m / 2)
    return dbscan(centers, link_m, MIN_NEIGHBOURS, counts)[cell_of]


def _spacing_m(points: Floats, sample: Floats) -> float:
    """Return the median distance of a sample to the third neighbour, or to the last there is."""
    tree = cv2.flann.Index(points.astype(np.float32), {"algorithm": FLANN_KDTREE_SINGLE})
    count = min(MIN_NEIGHBOURS, len(points))
    squares = tree.knnSearch(sample.astype(np.float32), count, params={})[1]
    return float(np.median(np.sqrt(squares[:, -1])))


def _downsample(points: Floats, edge_m: float) -> tuple[Floats, Indices, Indices]:
    """Return [C,3] means of the points by cell, [K] cell of each point, [C] counts."""
    _, cell_of, counts = np.unique(
        cell_keys(points, edge_m), return_inverse=True, return_counts=True
    )
    sums = [np.bincount(cell_of, points[:, axis]) for axis in range(3)]
    return np.stack(sums, axis=1) / counts[:, None], cell_of, counts


def _join_pieces(pieces: list[Floats], others: Floats) -> list[list[int]]:
    """Group pieces of one object: one above the other, with nothing between them.

    Args:
        pieces: Points [K,3] of each piece, m.
        others: [P,3] points that do not match the query, m.

    Returns:
        The numbers of the pieces of each object.
    """
    boxes = [np.percentile(points, [TRIM_PERCENT, 100 - TRIM_PERCENT], axis=0) for points in pieces]
    pairs = []
    for a, b in combinations(range(len(pieces)), 2):
        if boxes[a][0, 2] > boxes[b][0, 2]:
            a, b = b, a
        low, high = np.maximum(boxes[a][0], boxes[b][0]), np.minimum(boxes[a][1], boxes[b][1])
        smaller = min(np.prod((box[1] - box[0])[:2]) for box in (boxes[a], boxes[b]))
        # Heights from the top of a to the bottom of b; swapped where they overlap.
        low[2], high[2] = high[2], low[2]
        is_near = high[2] - low[2] < MAX_VERTICAL_GAP_M
        overlap = np.prod(np.maximum(0, (high - low)[:2]))
        if is_near and overlap > MIN_FOOTPRINT_OVERLAP * smaller:
            between = ((others > low) & (others < high)).all(axis=1).sum()
            if between < MIN_GAUSSIANS:
                pairs.append((a, b))
    roots = connected_components(len(pieces), np.array(pairs, np.intp).reshape(-1, 2))
    return [[int(piece) for piece in np.flatnonzero(roots == root)] for root in np.unique(roots)]
