"""
Cameras and views of Gaussians.
"""
from __future__ import annotations
import collections.abc
import numpy
import numpy.typing
import typing
__all__: list[str] = ['CHUNK_SIZE', 'Camera', 'ChunkBounds', 'GaussianViewDouble', 'GaussianViewFloat', 'camera_from_fov', 'look_at', 'scatter_rows_double', 'scatter_rows_float', 'scatter_rows_uint32']
class Camera:
    """
    A pinhole camera at a pose in the world; immutable.
    
    Camera frame: OpenCV axes, x right, y down, z forward, metres. The pixel in column i and row j
    covers [i, i+1) x [j, j+1) of the image plane; its centre is (i + 0.5, j + 0.5). A point (x, y, z)
    in the camera frame is seen at (fx x/z + cx, fy y/z + cy) pixels.
    
    Args:
        fx, fy: Focal lengths, px.
        cx, cy: Principal point, px.
        width, height: Image size, px.
        world_from_camera: [4,4] float64, rigid transform from the camera frame to the world frame:
            x_in_world = world_from_camera @ x_in_camera. Metres, world z up.
    
    Raises:
        ValueError: A focal length that is not positive, a size outside 1..65536, a rotation that is not
            orthonormal to 1e-6, anything not finite, or a pose of another shape or dtype.
    """
    __hash__: typing.ClassVar[None] = None
    def __eq__(self, other: Camera) -> bool:
        ...
    def __getstate__(self) -> tuple[float, float, float, float, int, int, numpy.typing.NDArray[numpy.float64]]:
        ...
    def __init__(self, *, fx: typing.SupportsFloat | typing.SupportsIndex, fy: typing.SupportsFloat | typing.SupportsIndex, cx: typing.SupportsFloat | typing.SupportsIndex, cy: typing.SupportsFloat | typing.SupportsIndex, width: int, height: int, world_from_camera: numpy.ndarray) -> None:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, arg0: tuple) -> None:
        ...
    def cropped(self, x0: int, y0: int, x1: int, y1: int) -> Camera:
        """
        Crop the image of the camera to columns [x0, x1) and rows [y0, y1).
        
        What it renders is that part, but for Gaussians centred far outside it: 3DGS projects those as if
        they were at 1.3 times the edge of the view.
        
        Raises:
            ValueError: The part is empty or not inside the image.
        """
    @property
    def cx(self) -> float:
        """
        Principal point, column, px.
        """
    @property
    def cy(self) -> float:
        """
        Principal point, row, px.
        """
    @property
    def fx(self) -> float:
        """
        Horizontal focal length, px.
        """
    @property
    def fy(self) -> float:
        """
        Vertical focal length, px.
        """
    @property
    def height(self) -> int:
        """
        Image height, px.
        """
    @property
    def width(self) -> int:
        """
        Image width, px.
        """
    @property
    def world_from_camera(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        [4,4] float64, a copy of the pose: x_in_world = world_from_camera @ x_in_camera.
        """
class ChunkBounds:
    """
    Bounds of chunks, runs of CHUNK_SIZE consecutive Gaussians: an index by which renderers skip those out of view.
    """
    def __init__(self, *, size: typing.SupportsInt | typing.SupportsIndex, boxes: numpy.ndarray, max_log_scales: numpy.ndarray, load: collections.abc.Callable) -> None:
        """
        Bounds of a map whose chunks are loaded when they are needed.
        
        Args:
            size: N, Gaussians of the map.
            boxes: [C,2,3] float64, as `boxes` returns them.
            max_log_scales: [C] float64, as `max_log_scales` returns them.
            load: Called with the chunks [K] uint32 that a renderer is about to read. What it raises ends
                the rendering.
        
        Raises:
            ValueError: An array has another shape or dtype.
        """
    def boxes(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Return [C,2,3] lowest and highest centres of each chunk, m, relative to the origin.
        """
    def max_log_scales(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Return [C] log of the largest standard deviation of each chunk in m.
        """
class GaussianViewFloat:
    """
    Read-only view of the arrays of N Gaussians; it copies nothing.
    """
    def __init__(self, *, means: numpy.ndarray, quats: numpy.ndarray, log_scales: numpy.ndarray, logit_opacities: numpy.ndarray, sh: numpy.ndarray, features: numpy.ndarray, origin: numpy.ndarray, bounds: ChunkBounds = None) -> None:
        ...
    def chunk_bounds(self, function: str) -> ChunkBounds:
        """
        Compute the bounds of the chunks of these Gaussians; raises as `require_finite`.
        """
    def require_finite(self, function: str) -> None:
        """
        Raises ValueError naming `function`, the first array with a number that is not finite and its index.
        """
class GaussianViewDouble:
    """
    Read-only view of the arrays of N Gaussians; it copies nothing.
    """
    def __init__(self, *, means: numpy.ndarray, quats: numpy.ndarray, log_scales: numpy.ndarray, logit_opacities: numpy.ndarray, sh: numpy.ndarray, features: numpy.ndarray, origin: numpy.ndarray, bounds: ChunkBounds = None) -> None:
        ...
    def chunk_bounds(self, function: str) -> ChunkBounds:
        """
        Compute the bounds of the chunks of these Gaussians; raises as `require_finite`.
        """
    def require_finite(self, function: str) -> None:
        """
        Raises ValueError naming `function`, the first array with a number that is not finite and its index.
        """
def camera_from_fov(width: int, height: int, horizontal_fov_rad: typing.SupportsFloat | typing.SupportsIndex, world_from_camera: numpy.ndarray | None = None) -> Camera:
    """
    Make a camera with square pixels and the principal point at the image centre.
    
    Args:
        width, height: Image size, px.
        horizontal_fov_rad: Horizontal field of view, rad, inside (0, pi).
        world_from_camera: [4,4] float64, x_in_world = world_from_camera @ x_in_camera; None means
            that the camera frame is the world frame.
    
    Raises:
        ValueError: The field of view, the size or the pose is out of range.
    """
def look_at(eye: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], target: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], up: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] = ...) -> numpy.typing.NDArray[numpy.float64]:
    """
    Compute the pose of a camera that looks at a point, its image upright.
    
    Args:
        eye: (3,) camera centre in the world, m.
        target: (3,) point at the image centre, in the world, m.
        up: (3,) direction in the world, of any length.
    
    Returns:
        [4,4] float64 world_from_camera.
    
    Raises:
        ValueError: The target is the eye, or the view direction is along `up`.
    """
def scatter_rows_double(rows: numpy.ndarray, values: numpy.ndarray, size: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    Scatter `values` [V,K] to `rows` [V] uint32, ascending, of an array of zeros [size,K].
    """
def scatter_rows_float(rows: numpy.ndarray, values: numpy.ndarray, size: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float32]:
    """
    Scatter `values` [V,K] to `rows` [V] uint32, ascending, of an array of zeros [size,K].
    """
def scatter_rows_uint32(rows: numpy.ndarray, values: numpy.ndarray, size: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.uint32]:
    """
    Scatter `values` [V,K] to `rows` [V] uint32, ascending, of an array of zeros [size,K].
    """
CHUNK_SIZE: int = 1024
