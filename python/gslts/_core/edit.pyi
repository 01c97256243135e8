"""
Selection and creation of Gaussians of an edited map.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['DepthTolerance', 'VoteRule', 'count_visibility', 'count_votes', 'inherit_attributes', 'nearest_gaussians', 'thin_points']
class VoteRule:
    """
    Maximum distance behind the rendered surface at which a Gaussian belongs to it; immutable.
    
    It is behind_m + behind_share depth; farther behind a Gaussian is hidden.
    
    Args:
        behind_m: Constant part, m.
        behind_share: Share of the rendered depth.
    """
    def __init__(self, *, behind_m: typing.SupportsFloat | typing.SupportsIndex = 0.04, behind_share: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> None:
        ...
    @property
    def behind_m(self) -> float:
        ...
    @property
    def behind_share(self) -> float:
        ...
class DepthTolerance:
    """
    Maximum difference of two depths of one surface; immutable.
    
    It is margin_m + margin_share depth.
    
    Args:
        margin_m: Constant part, m.
        margin_share: Share of the depth.
    """
    def __init__(self, *, margin_m: typing.SupportsFloat | typing.SupportsIndex = 0.03, margin_share: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> None:
        ...
    @property
    def margin_m(self) -> float:
        ...
    @property
    def margin_share(self) -> float:
        ...
def count_visibility(gaussians: gslts._core.map.GaussianViewFloat, cameras: collections.abc.Sequence[gslts._core.map.Camera], observed_depths: collections.abc.Sequence[numpy.ndarray], tolerance: DepthTolerance) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
    """
    Count the views that saw a surface at the centre of each of N Gaussians, or saw through it.
    
    Args:
        gaussians: Of a map.
        cameras: Of the K views.
        observed_depths: K images [H,W] float32, z in the camera frame, m; 0 and NaN: not measured.
        tolerance: When two depths are those of one surface.
    
    Returns:
        on_surface: [N] int32, views that measured a surface at the centre.
        seen_through: [N] int32, views that measured one behind it: it is free space.
    
    Raises:
        ValueError: An image does not fit its camera, or the tolerance is out of range.
    """
def count_votes(gaussians: gslts._core.map.GaussianViewFloat, cameras: collections.abc.Sequence[gslts._core.map.Camera], masks: collections.abc.Sequence[numpy.ndarray], rendered_depths: collections.abc.Sequence[numpy.ndarray] | None, rule: VoteRule) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
    """
    Count the views in whose mask the centre of each of N Gaussians is seen.
    
    Args:
        gaussians: Of a map.
        cameras: Of the K views.
        masks: K masks [H,W] bool, M_comb; True where the image shows what changed.
        rendered_depths: K images [H,W] float32, z of the map's surface in the camera frame, m, 0 where
            there is none: hidden Gaussians get no votes. None: they do, as in GS-LTS.
        rule: When a Gaussian is hidden.
    
    Returns:
        votes: [N] int32, V(g).
        views: [N] int32, views in which the centre is seen.
    
    Raises:
        ValueError: An image does not fit its camera, or the rule is out of range.
    
    Source: GS-LTS, sec. III-D2, eq. 11.
    """
def inherit_attributes(gaussians: gslts._core.map.GaussianViewFloat, points: numpy.ndarray, rows: numpy.ndarray, first_id: typing.SupportsInt | typing.SupportsIndex) -> dict[str, numpy.ndarray]:
    """
    Create Gaussians at points with the attributes of others.
    
    Args:
        gaussians: Of a map.
        points: [P,3] float32, centres relative to the map's origin, m.
        rows: [P] uint32, rows of the Gaussians to inherit from.
        first_id: The ids are first_id, first_id + 1, ...
    
    Returns:
        Arrays of a `GaussianMap` by name.
    
    Raises:
        ValueError: There is no such row.
    
    Source: GS-LTS, sec. III-D2, the pre-editing of an addition, steps iii and iv (eq. 12).
    """
def nearest_gaussians(gaussians: gslts._core.map.GaussianViewFloat, points: numpy.ndarray, k: int) -> tuple[numpy.typing.NDArray[numpy.uint32], numpy.typing.NDArray[numpy.float32]]:
    """
    Find the k Gaussians whose centres are nearest to each of Q points, exactly.
    
    Args:
        gaussians: Of a map, at least one.
        points: [Q,3] float32, relative to the map's origin, m.
        k: At least 1; fewer are found where there are fewer Gaussians.
    
    Returns:
        rows: [Q,k] uint32, the nearest first.
        distances_m: [Q,k] float32.
    
    Raises:
        ValueError: There is no Gaussian, k is below 1, or a number is not finite.
    """
def thin_points(points: numpy.ndarray, spacing_m: numpy.ndarray) -> numpy.typing.NDArray[numpy.uint32]:
    """
    Select points that keep a distance from each other.
    
    Each point, in order, is kept if no point kept before it is nearer than its spacing.
    
    Args:
        points: [P,3] float32, m.
        spacing_m: [P] float32, minimum distance of each point from those kept before it, m.
    
    Returns:
        [M] uint32, rows of the points kept, ascending.
    
    Raises:
        ValueError: A point is not finite, or a spacing is not positive and finite.
    """
