"""Pose graph of keyframes, optimized by Open3D (Choi et al. 2015)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.se3 import pose_distance, product
from gslts.datasets.poses import inverse
from gslts.trajectory.constants import (
    AGREEMENT_M,
    AGREEMENT_RAD,
    LOOP_DISTANCE_M,
    PRUNE_BELOW,
)
from gslts.trajectory.open3d import import_open3d
from gslts.trajectory.registration import Motion
from gslts.types import Floats


@dataclass(frozen=True, eq=False)
class Edge:
    """Measured motion between two nodes of a graph.

    Attributes:
        source: Index of the node whose points are moved.
        target: Index of the other node.
        motion: Between them.
        is_certain: False if the motion may be wrong, as places look alike.
    """

    source: int
    target: int
    motion: Motion
    is_certain: bool = False


def optimize_poses(count: int, edges: Sequence[Edge]) -> dict[int, Floats]:
    """Find the poses that agree best with the measured motions.

    Args:
        count: Number of nodes.
        edges: Motions between them.

    Returns:
        For each node of the largest part that motions connect, without those that contradict the
        others, world_from_camera [4,4], m, by index; the first of them is the world.

    Raises:
        ImportError: Open3D is missing.
    """
    trusted = _by_support(edges)
    poses = _largest_part(range(count), trusted)
    if len(poses) < 3:
        return poses
    used = [edge for edge in trusted if edge.source in poses]
    optimized, kept = _optimize(poses, used)
    connected = _largest_part(poses, [used[k] for k in kept])
    first = min(connected, default=0)
    return {node: product(inverse(optimized[first]), optimized[node]) for node in sorted(connected)}


def _by_support(edges: Sequence[Edge]) -> list[Edge]:
    """Order edges: certain ones, then by the number of nodes over which two others tell the same.

    Others without any are left out: places that look alike are seldom alike from three frames.
    """
    motions: dict[int, dict[int, Floats]] = defaultdict(dict)
    for edge in edges:
        motions[edge.source][edge.target] = edge.motion.target_from_source
        motions[edge.target][edge.source] = inverse(edge.motion.target_from_source)

    def support(edge: Edge) -> int:
        from_source, from_target = motions[edge.source], motions[edge.target]
        agreeing = 0
        for node in from_source.keys() & from_target.keys():
            around = product(inverse(from_target[node]), from_source[node])
            metres, turn_rad = pose_distance(around, edge.motion.target_from_source)
            agreeing += metres < AGREEMENT_M and turn_rad < AGREEMENT_RAD
        return agreeing

    supporters = [support(edge) for edge in edges]
    order = sorted(
        range(len(edges)),
        key=lambda k: (not edges[k].is_certain, -supporters[k], -edges[k].motion.overlap, k),
    )
    return [edges[k] for k in order if edges[k].is_certain or supporters[k] > 0]


def _largest_part(nodes: Iterable[int], edges: Sequence[Edge]) -> dict[int, Floats]:
    """Return poses [4,4] of the largest connected part, along the first edges that connect it."""
    largest: dict[int, Floats] = {}
    left = set(nodes)
    while len(left) > len(largest):
        part = _spread(min(left), edges)
        left -= part.keys()
        largest = max(largest, part, key=len)
    return largest


def _spread(start: int, edges: Sequence[Edge]) -> dict[int, Floats]:
    """Return poses [4,4] of all nodes that edges connect with a first one."""
    poses = {start: np.eye(4)}
    while True:
        edge = next((e for e in edges if (e.source in poses) != (e.target in poses)), None)
        if edge is None:
            return poses
        if edge.target in poses:
            poses[edge.source] = product(poses[edge.target], edge.motion.target_from_source)
        else:
            back = inverse(edge.motion.target_from_source)
            poses[edge.target] = product(poses[edge.source], back)


def _optimize(
    poses: dict[int, Floats], edges: Sequence[Edge]
) -> tuple[dict[int, Floats], list[int]]:
    """Return optimized poses [4,4] by node, and the indices of the edges that agree with them."""
    o3d = import_open3d()
    registration = o3d.pipelines.registration
    nodes = sorted(poses)
    rows = {node: row for row, node in enumerate(nodes)}
    graph = registration.PoseGraph()
    for node in nodes:
        graph.nodes.append(registration.PoseGraphNode(poses[node]))
    for edge in edges:
        graph.edges.append(
            registration.PoseGraphEdge(
                rows[edge.source],
                rows[edge.target],
                edge.motion.target_from_source,
                edge.motion.information,
                not edge.is_certain,
            )
        )
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        registration.global_optimization(
            graph,
            registration.GlobalOptimizationLevenbergMarquardt(),
            registration.GlobalOptimizationConvergenceCriteria(),
            registration.GlobalOptimizationOption(
                max_correspondence_distance=LOOP_DISTANCE_M,
                edge_prune_threshold=PRUNE_BELOW,
                preference_loop_closure=1.0,
                reference_node=0,
            ),
        )
    kept = {(edge.source_node_id, edge.target_node_id) for edge in graph.edges}
    agreeing = [k for k, edge in enumerate(edges) if (rows[edge.source], rows[edge.target]) in kept]
    return {node: np.array(graph.nodes[row].pose) for node, row in rows.items()}, agreeing
