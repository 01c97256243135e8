"""Text queries: 3D boxes of the objects in a map that match a text (GS-LTS, sec. III-B)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gslts._core.map import CHUNK_SIZE
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.calibration import MIN_GAUSSIANS, calibrate
from gslts.semantics.clusters import (
    NOISE,
    cell_keys,
    connected_components,
    dbscan,
    linked_groups,
)
from gslts.semantics.prototypes import Prototypes, meaningful_rows
from gslts.semantics.registry import open_text_semantics
from gslts.semantics.relevance import RelevanceScorer
from gslts.semantics.source import Codec, SemanticSource
from gslts.store.map_folder import read_map
from gslts.types import Floats, Floats32, Indices

MAX_CHARACTERS = 300
"""Maximum length of a query; CLIP reads 77 tokens."""
SLACK = 0.05
"""The Gaussians of a chunk are scored if a prototype is at most so far below the threshold: others
may be more relevant than it."""
LINK_M = 0.07
"""Radius of DBSCAN: distance up to which matching Gaussians belong to one object."""
MIN_NEIGHBOURS, LINK_SPACINGS = 4, 3.0
"""Weight of a core point of DBSCAN; in a coarse map, the radius is a multiple of the median
distance to the third neighbour, given by the second value."""
FLANN_KDTREE_SINGLE = 4
"""FLANN's exact k-d tree; OpenCV has no Python name for it."""
MIN_SHARE_OF_PEAK, PEAK = 0.4, 0.95
"""Minimum score of a Gaussian of an object as a share of the object's peak, this quantile of its
scores. Class scores of a detector fall off around an object, where masks of some views reach."""
MIN_SHARE_OF_LARGEST = 0.1
"""Minimum size of an object as a share of the largest one's number of Gaussians; removes fragments
of blurred borders."""
CELL_M = 0.02
"""Gaussians in a cell of this edge are clustered as one weighted point."""
MAX_CELLS = 4_000
"""In a group of points with more cells, as of walls, their edge becomes half the DBSCAN radius;
bounds time."""
MAX_VERTICAL_GAP_M = 0.3
"""Maximum height of an unseen gap between two pieces of one object, such as base and shade of a
lamp."""
MIN_FOOTPRINT_OVERLAP = 0.7
"""Minimum overlap of the footprints of two such pieces, as a share of the smaller one's."""
TRIM = (0.5, 99.5)
"""Percentiles of the Gaussians of an object between which its box is; others are outliers."""


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
        source: The source with the threshold of this map.

    Raises:
        ValueError: The features do not fit the codec, or that does not fit the source.
    """

    def __init__(self, gaussian_map: GaussianMap, codec: Codec, source: SemanticSource) -> None:
        self.gaussian_map = gaussian_map
        self._scorer = RelevanceScorer(gaussian_map, codec, source)
        self._prototypes = Prototypes.of_map(gaussian_map)
        self.source = calibrate(source, gaussian_map, codec, self._prototypes)

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
        codec, source = open_text_semantics(path, text_model, threads, calibrated=False)
        return cls(read_map(path), codec, source)

    @property
    def threshold(self) -> float:
        """Minimum relevance of a match in this map."""
        return self.source.threshold

    def relevance(self, text: str) -> Floats32:
        """Compute the relevance of all Gaussians to a text.

        Args:
            text: Such as "alarm clock".

        Returns:
            [N] float32, 0 to 1; 0 for Gaussians that are not scored.

        Raises:
            ValueError: The text is empty.
        """
        result, query = np.zeros(self.gaussian_map.size, np.float32), self._encode(text)
        for rows, part in self.gaussian_map.parts():
            scored = meaningful_rows(part)
            result[rows.start + scored] = self._scorer.scores(query, part.features[scored])[0]
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
        return self.source.explain(checked_text(text))

    def find(self, text: str) -> list[Instance]:
        """Find the objects that match a text.

        Args:
            text: Such as "alarm clock".

        Returns:
            The objects, the best first; empty if no relevance reaches the threshold.

        Raises:
            ValueError: The text is empty.
        """
        rows, points, scores = self._matches(self._encode(text))
        return self._instances(rows, points, scores) if len(rows) else []

    def _matches(self, query: Floats32) -> tuple[Indices, Floats, Floats32]:
        """Return rows, points [K,3] and scores of the Gaussians that match an embedding [1,D]."""
        threshold, prototypes = self.threshold, self._prototypes
        rows, points = [np.zeros(0, np.intp)], [np.zeros((0, 3))]
        scores = [np.zeros(0, np.float32)]
        close = self._scorer.scores(query, prototypes.features)[0] >= threshold - SLACK
        for chunk in np.unique(prototypes.chunks[close]) * CHUNK_SIZE:
            end = min(chunk + CHUNK_SIZE, self.gaussian_map.size)
            part = self.gaussian_map.part(slice(chunk, end))
            own = meaningful_rows(part)
            found = self._scorer.scores(query, part.features[own])[0]
            own, found = own[found >= threshold], found[found >= threshold]
            rows.append(chunk + own)
            points.append(part.means[own].astype(np.float64))  # Relative to the origin.
            scores.append(found)
        return np.concatenate(rows), np.concatenate(points), np.concatenate(scores)

    def _encode(self, text: str) -> Floats32:
        return self.source.encode([checked_text(text)])

    def _instances(self, rows: Indices, points: Floats, scores: Floats32) -> list[Instance]:
        """Cluster matching Gaussians into objects; drop noise and small fragments."""
        labels = _cluster(points)
        kept = scores >= MIN_SHARE_OF_PEAK * _peaks(scores, labels)
        if not kept.all():
            rows, scores, points = rows[kept], scores[kept], points[kept]
            labels = _cluster(points)
        pieces = [own for own in _members(labels) if len(own) >= MIN_GAUSSIANS]

        def count_between(low: Floats, high: Floats) -> int:
            """Count the scored Gaussians in a box that do not match."""
            origin = self.gaussian_map.origin
            near = self.gaussian_map.rows_in_box(low + origin, high + origin)
            others = self.gaussian_map.select(np.setdiff1d(near, rows, assume_unique=True))
            means = others.means[meaningful_rows(others)].astype(np.float64)
            return int(((means > low) & (means < high)).all(axis=1).sum())

        groups = _join_pieces([points[piece] for piece in pieces], count_between)
        members = [np.concatenate([pieces[piece] for piece in group]) for group in groups]
        largest = max(map(len, members), default=0)
        instances = [
            self._instance(points[own], scores[own], rows[own])
            for own in members
            if len(own) >= MIN_SHARE_OF_LARGEST * largest
        ]
        return sorted(instances, key=lambda instance: -instance.score * np.sqrt(len(instance.rows)))

    def _instance(self, points: Floats, scores: Floats32, rows: Indices) -> Instance:
        low, high = np.percentile(points, TRIM, axis=0)
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
    for own in _members(labels):
        peaks[own] = np.quantile(scores[own], PEAK)
    return peaks


def _members(labels: Indices) -> list[Indices]:
    """Return the rows of each cluster, ascending, in one pass over all; without noise."""
    order = np.argsort(labels, kind="stable")
    starts = np.searchsorted(labels[order], np.arange(labels.max(initial=-1) + 2))
    return [order[start:end] for start, end in pairwise(starts)]


def _cluster(points: Floats) -> Indices:
    """Return [K] cluster of each point, -1 for noise; points of a cell are clustered as one.

    Groups without a link between them are clustered in batches of about `MAX_CELLS` cells, and
    larger ones alone: but for the radius, objects do not depend on matches elsewhere.
    """
    centers, cell_of, _ = _downsample(points, CELL_M)
    sample = centers[:: -(-len(centers) // MAX_CELLS)]
    link_m = max(LINK_M, LINK_SPACINGS * _spacing_m(centers, sample))
    groups = linked_groups(centers, link_m)
    sizes = np.bincount(groups)
    is_large = sizes > MAX_CELLS
    small_until = np.cumsum(np.where(is_large, 0, sizes))
    batches = np.where(is_large, -1 - np.arange(len(sizes)), (small_until - 1) // MAX_CELLS)
    batch_of = batches[groups][cell_of]
    labels = np.full(len(points), NOISE)
    for batch in np.unique(batch_of):
        own = np.flatnonzero(batch_of == batch)
        centers, cell_of, counts = _downsample(points[own], link_m / 2 if batch < 0 else CELL_M)
        found = dbscan(centers, link_m, MIN_NEIGHBOURS, counts)[cell_of]
        labels[own] = np.where(found == NOISE, NOISE, found + labels.max() + 1)
    return labels


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


def _join_pieces(
    pieces: list[Floats], count_between: Callable[[Floats, Floats], int]
) -> list[list[int]]:
    """Group pieces of one object: one above the other, with nothing between them.

    Args:
        pieces: Points [K,3] of each piece, m.
        count_between: Counts points in the box between two corners (3,) that do not match the
            query.

    Returns:
        The numbers of the pieces of each object.
    """
    boxes = np.array([np.percentile(piece, TRIM, axis=0) for piece in pieces]).reshape(-1, 2, 3)
    pairs = []
    for a, b in _stacked_pairs(boxes):
        low, high = np.maximum(boxes[a, 0], boxes[b, 0]), np.minimum(boxes[a, 1], boxes[b, 1])
        # Heights from the top of one to the bottom of the other; swapped where they overlap.
        bottom, top = np.append(low[:2], high[2]), np.append(high[:2], low[2])
        if count_between(bottom, top) < MIN_GAUSSIANS:
            pairs.append((a, b))
    roots = connected_components(len(pieces), np.array(pairs, np.intp).reshape(-1, 2))
    groups = _members(np.unique(roots, return_inverse=True)[1])
    return [[int(piece) for piece in group] for group in groups]


def _stacked_pairs(boxes: Floats) -> list[tuple[int, int]]:
    """Return the pairs of boxes [P,2,3] that are one above the other, in a sweep along x."""
    low, high = boxes[:, 0], boxes[:, 1]
    areas = np.prod((high - low)[:, :2], axis=1)
    order = np.argsort(low[:, 0], kind="stable")
    ends = np.searchsorted(low[order, 0], high[:, 0])  # Boxes from here on begin behind this one.
    pairs = []
    for rank, a in enumerate(order):
        others = order[rank + 1 : ends[a]]
        inner_low, inner_high = np.maximum(low[a], low[others]), np.minimum(high[a], high[others])
        overlaps = np.prod(np.maximum(0, inner_high - inner_low)[:, :2], axis=1)
        is_above = inner_low[:, 2] - inner_high[:, 2] < MAX_VERTICAL_GAP_M
        is_above &= overlaps > MIN_FOOTPRINT_OVERLAP * np.minimum(areas[a], areas[others])
        pairs += [(min(a, b), max(a, b)) for b in others[is_above].tolist()]
    return pairs
