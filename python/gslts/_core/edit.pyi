"""
Which Gaussians go, and which come.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['DepthRule', 'VoteRule', 'inherited', 'nearest_gaussians', 'sightings_of', 'thinned', 'votes_of']
class VoteRule:
    """
    How far behind the surface that the map shows a Gaussian
    still belongs to it.
    
    Args:
        behind_m: At the camera, m,
        behind_share: and by so much of the depth more.
    """
    def __init__(self, *, behind_m: typing.SupportsFloat | typing.SupportsIndex = 0.04, behind_share: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> None:
        ...
    @property
    def behind_m(self) -> float:
        ...
    @property
    def behind_share(self) -> float:
        ...
class DepthRule:
    """
    Depths that differ by no more are the same.
    
    Args:
        margin_m: At the camera, m,
        margin_share: and by so much of the depth more.
    """
    def __init__(self, *, margin_m: typing.SupportsFloat | typing.SupportsIndex = 0.03, margin_share: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> None:
        ...
    @property
    def margin_m(self) -> float:
        ...
    @property
    def margin_share(self) -> float:
        ...
def inherited(gaussians: gslts._core.map.GaussianViewFloat, points: numpy.ndarray, rows: numpy.ndarray, first_id: typing.SupportsInt | typing.SupportsIndex) -> dict[str, numpy.ndarray]:
    """
    The arrays of new Gaussians at points, with everything else from others.
    
    Args:
        gaussians: Of a map.
        points: [P,3] float32 centres, relative to the map's origin, m.
        rows: [P] uint32, of which each inherits.
        first_id: The ids are first_id, first_id + 1, ...
    
    Raises:
        ValueError: There is no such row.
    
    Source: GS-LTS, sec. III-D, the pre-editing of an addition, step iii.
    """
def nearest_gaussians(gaussians: gslts._core.map.GaussianViewFloat, points: numpy.ndarray, k: int) -> tuple[numpy.typing.NDArray[numpy.uint32], numpy.typing.NDArray[numpy.float32]]:
    """
    The k Gaussians whose centres are nearest to each of Q points, exactly.
    
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
def sightings_of(gaussians: gslts._core.map.GaussianViewFloat, cameras: collections.abc.Sequence[gslts._core.map.Camera], measured: collections.abc.Sequence[numpy.ndarray], rule: DepthRule) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
    """
    Counts the views that saw a surface at the centre of each of N Gaussians, or through it.
    
    Args:
        gaussians: Of a map.
        cameras: Of the views.
        measured: [H,W] float32 of each, depth, z, m; 0 and NaN mean no measurement.
        rule: When two depths are the same.
    
    Returns:
        on: [N] int32, views that measured a surface there.
        through: [N] int32, views that measured one behind it: nothing can be there.
    
    Raises:
        ValueError: An image does not fit its camera, or the rule is out of range.
    """
def thinned(points: numpy.ndarray, spacing_m: numpy.ndarray) -> numpy.typing.NDArray[numpy.uint32]:
    """
    Rows of the points that stay when each, in order, must keep a distance from those before.
    
    Args:
        points: [P,3] float32, m.
        spacing_m: [P] float32 that a point keeps from all that stay before it.
    
    Returns:
        [M] uint32, ascending.
    
    Raises:
        ValueError: A point is not finite, or a spacing is not positive and finite.
    """
def votes_of(gaussians: gslts._core.map.GaussianViewFloat, cameras: collections.abc.Sequence[gslts._core.map.Camera], masks: collections.abc.Sequence[numpy.ndarray], rendered: collections.abc.Sequence[numpy.ndarray] | None, rule: VoteRule) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
    """
    Counts the views in whose mask the centre of each of N Gaussians is seen.
    
    Args:
        gaussians: Of a map.
        cameras: Of the views.
        masks: [H,W] bool of each, True where the image shows what is voted for.
        rendered: [H,W] float32 of each, depth of the map from there, z, m, 0 where nothing is: what is
            hidden then does not vote. None: it votes too, as in the paper.
        rule: When it is hidden.
    
    Returns:
        votes: [N] int32, V(g).
        views: [N] int32, views in which the centre can be seen at all.
    
    Raises:
        ValueError: An image does not fit its camera, or the rule is out of range.
    
    Source: GS-LTS, sec. III-D, eq. of V(g_i).
    """
