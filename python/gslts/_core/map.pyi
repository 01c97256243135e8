"""
Cameras, views of Gaussians and their files.
"""
from __future__ import annotations
import numpy
import numpy.typing
import os
import typing
__all__: list[str] = ['Camera', 'GaussianViewDouble', 'GaussianViewFloat', 'SurfaceVoxels', 'camera_from_fov', 'look_at', 'read_ply', 'register_depth', 'scatter_rows_double', 'scatter_rows_float', 'scatter_rows_uint32', 'write_ply']
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
        The same camera with a part of its image: columns [x0, x1) and rows [y0, y1).
        
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
class GaussianViewFloat:
    """
    Read-only view of the arrays of N Gaussians; it copies nothing.
    """
    def __init__(self, *, means: numpy.ndarray, quats: numpy.ndarray, log_scales: numpy.ndarray, logit_opacities: numpy.ndarray, sh: numpy.ndarray, features: numpy.ndarray, origin: numpy.ndarray) -> None:
        ...
    def require_finite(self, function: str) -> None:
        """
        Raises ValueError naming `function`, the first array with a number that is not finite and its index.
        """
class GaussianViewDouble:
    """
    Read-only view of the arrays of N Gaussians; it copies nothing.
    """
    def __init__(self, *, means: numpy.ndarray, quats: numpy.ndarray, log_scales: numpy.ndarray, logit_opacities: numpy.ndarray, sh: numpy.ndarray, features: numpy.ndarray, origin: numpy.ndarray) -> None:
        ...
    def require_finite(self, function: str) -> None:
        """
        Raises ValueError naming `function`, the first array with a number that is not finite and its index.
        """
class SurfaceVoxels:
    """
    Fuses depth images: what they measured of surfaces, in cubes.
    
    Sums are taken in the order of the frames and of their pixels. Not to be used by two threads at once.
    
    Args:
        edge_m: Of the voxels, whose corners are multiples of it.
        pixel_step: Of every so many rows and columns one is looked at.
    
    Raises:
        ValueError: The edge is not positive and finite, or the step is below 1.
    """
    def __init__(self, edge_m: typing.SupportsFloat | typing.SupportsIndex, pixel_step: int) -> None:
        ...
    def add(self, depth: numpy.ndarray, rgb: numpy.ndarray, camera: Camera, mask: numpy.ndarray | None) -> None:
        """
        Adds the points of an image, with normals, colours and details.
        
        A pixel counts if it and its four neighbours, `pixel_step` away, are measured and no step of the
        depth parts them.
        
        Args:
            depth: [H,W] float32, z, m; 0 and NaN mean no measurement.
            rgb: [H,W,3] uint8, sRGB.
            camera: Of both.
            mask: [H,W] bool, False where nothing was seen; None means that all was.
        
        Raises:
            ValueError: An array does not fit, a depth is negative or infinite, the camera is too far from
                the world's origin to tell voxels apart, or a point is about 2^20 voxels from the first
                camera. Nothing has been added then.
        """
    def voxels(self) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int64]]:
        """
        All V voxels so far, by ascending key.
        
        Returns:
            keys: [V] int64, Morton codes. A voxel of twice the edge has the keys of its eight parts, which
                follow each other, shifted right by 3. Keys depend on where the first camera stood.
            sums: [V,11] float64 over the points of each: their number, position in the world (3, m), unit
                normal towards the camera (3), sRGB colour from 0 to 1 (3), and squared change of the
                brightness along the surface (1/m^2).
            hits: [V] int64, frames with points in the voxel.
        """
def camera_from_fov(width: int, height: int, horizontal_fov_rad: typing.SupportsFloat | typing.SupportsIndex, world_from_camera: numpy.ndarray | None = None) -> Camera:
    """
    Camera with square pixels and the principal point at the image centre.
    
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
    Pose of a camera at `eye` that looks at `target`, its image upright with respect to `up`.
    
    Args:
        eye: (3,) camera centre in the world, m.
        target: (3,) point at the image centre, in the world, m.
        up: (3,) direction in the world, of any length.
    
    Returns:
        [4,4] float64 world_from_camera.
    
    Raises:
        ValueError: The target is the eye, or the view direction is along `up`.
    """
def read_ply(path: os.PathLike | str | bytes) -> tuple[dict[str, numpy.ndarray], list[str]]:
    """
    See gslts.ply.read_ply; returns the arrays of the map by name, and the names of the properties that it ignored.
    """
def register_depth(depth: numpy.ndarray, depth_camera: Camera, camera: Camera) -> numpy.typing.NDArray[numpy.float32]:
    """
    A depth image as another camera would have measured it.
    
    Each measured pixel is carried over as the small patch of surface that it and its neighbours show,
    so that surfaces stay closed and planes stay planes; of several at a place the nearest counts.
    
    Args:
        depth: [H,W] float32 of `depth_camera`, z, m; 0 and NaN mean no measurement.
        depth_camera, camera: With poses in one common frame; only their relative pose counts.
    
    Returns:
        [H',W'] float32 of `camera`, z, m; 0 where nothing arrives.
    
    Raises:
        ValueError: The image does not fit its camera.
    """
def scatter_rows_double(rows: numpy.ndarray, values: numpy.ndarray, size: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float64]:
    """
    [size,K] zeros but for `values` [V,K] at `rows` [V] uint32, which ascend.
    """
def scatter_rows_float(rows: numpy.ndarray, values: numpy.ndarray, size: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.float32]:
    """
    [size,K] zeros but for `values` [V,K] at `rows` [V] uint32, which ascend.
    """
def scatter_rows_uint32(rows: numpy.ndarray, values: numpy.ndarray, size: typing.SupportsInt | typing.SupportsIndex) -> numpy.typing.NDArray[numpy.uint32]:
    """
    [size,K] zeros but for `values` [V,K] at `rows` [V] uint32, which ascend.
    """
def write_ply(gaussians: GaussianViewFloat, ids: numpy.ndarray, path: os.PathLike | str | bytes) -> None:
    """
    See gslts.ply.write_ply.
    """
