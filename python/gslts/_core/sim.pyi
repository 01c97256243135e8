"""
Shading of simulated RGB-D frames.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['Shading', 'Surfaces', 'intersect_triangles', 'measure_color', 'measure_depth', 'pixel_rays', 'visible_triangles']
class Surfaces:
    """
    The T triangles of a home and their textures; copies.
    
    Args:
        normals: [T,3] float32, unit vectors, world.
        objects: [T] int32, index of the object that each belongs to.
        emission: [T] float32, radiance of a white texel that glows.
        uvs: [T,3,2] float32, texture coordinates of the corners.
        texels_per_m: [T] float32, on the largest level of the texture.
        first_level: [T] int32, index of that level.
        level_count: [T] int32, number of levels, each half as large.
        level_sizes: [L,2] int32, height and width, px.
        texels: [X] uint32, all levels one after the other, red + 256 green + 65536 blue.
        linear_of_byte: [256] float32, linear light of an sRGB byte.
    
    Raises:
        ValueError: An array does not fit, or a triangle names a level that is not there.
    """
    def __init__(self, *, normals: numpy.ndarray, objects: numpy.ndarray, emission: numpy.ndarray, uvs: numpy.ndarray, texels_per_m: numpy.ndarray, first_level: numpy.ndarray, level_count: numpy.ndarray, level_sizes: numpy.ndarray, texels: numpy.ndarray, linear_of_byte: numpy.ndarray) -> None:
        ...
class Shading:
    """
    An image under area lights, in two steps.
    
    Between them, the caller casts the shadow rays.
    
    Args:
        surfaces: What the rays hit.
        rays: [H,W,6] float32, as from `pixel_rays`.
        depth: [H,W] float32, m along them, infinite where nothing is hit.
        triangles: [H,W] uint32, what is hit.
        weights: [H,W,2] float32, barycentric weights of its second and third corner.
        pixel_rad: Angle of a pixel, 1 / focal length.
        lights: [L,4,3] float64, center, edge_u, edge_v (m) and radiance of each.
        threads: 0 means one per hardware thread; the result does not depend on it.
    
    Raises:
        ValueError: An array does not fit, a hit names a triangle that is not there, or threads is
            negative.
    """
    def __init__(self, surfaces: Surfaces, rays: numpy.ndarray, depth: numpy.ndarray, triangles: numpy.ndarray, weights: numpy.ndarray, *, pixel_rad: typing.SupportsFloat | typing.SupportsIndex, lights: numpy.ndarray, threads: int) -> None:
        ...
    def radiance(self, blocked: numpy.ndarray, ambient: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]) -> numpy.typing.NDArray[numpy.float32]:
        """
        Computes the image.
        
        Args:
            blocked: [R] bool, whether anything is in the way of each shadow ray.
            ambient: (3,) linear RGB of the light that is everywhere.
        
        Returns:
            [H,W,3] float32, linear RGB; 0 where nothing was hit.
        
        Raises:
            ValueError: An array does not fit.
        """
    @property
    def cosines(self) -> numpy.typing.NDArray[numpy.float32]:
        """
        [H,W] float32, between normal and ray; 0 where nothing was hit.
        """
    @property
    def depth(self) -> numpy.typing.NDArray[numpy.float32]:
        """
        [H,W] float32, m; 0 where nothing was hit.
        """
    @property
    def objects(self) -> numpy.typing.NDArray[numpy.int32]:
        """
        [H,W] int32, index; -1 where nothing was hit.
        """
    @property
    def shadow_rays(self) -> numpy.typing.NDArray[numpy.float32]:
        """
        [R,6] float32 origins, m, and ways to the lights; what blocks them is in 0 to 1.
        """
def intersect_triangles(rays: numpy.ndarray, hit: numpy.ndarray, corners: numpy.ndarray, *, threads: int) -> tuple:
    """
    Computes where rays meet triangles that are known to be hit, the same on every processor.
    
    Args:
        rays: [N,6] float32 origins, m, and directions of any length, world.
        hit: [N] uint32 index of the triangle; 0xffffffff where nothing is hit.
        corners: [T,3,3] float32, m, world.
        threads: 0 means one per hardware thread; the result does not depend on it.
    
    Returns:
        Distances [N] float32 in lengths of the direction, infinite for a miss; and barycentric weights
        [N,2] float32 of the second and third corner.
    
    Raises:
        ValueError: An array does not fit, an index is out of range, or threads is negative.
    """
def measure_color(radiance: numpy.ndarray, *, normals: numpy.ndarray | None, gains: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(3)"], vignetting: typing.SupportsFloat | typing.SupportsIndex, noise_std: typing.SupportsFloat | typing.SupportsIndex, threads: int) -> numpy.typing.NDArray[numpy.uint8]:
    """
    Makes an sRGB image (IEC 61966-2-1) of linear light.
    
    Args:
        radiance: [H,W,3] float64, linear RGB.
        normals: [H,W,3] float64, standard normal numbers, the noise; None: there is none.
        gains: Factors of red, green and blue.
        vignetting: Share of the light that is lost in the corners.
        noise_std: Of the noise of each number of the image, 0 to 1.
        threads: 0 means one per hardware thread; the result does not depend on it.
    
    Returns:
        [H,W,3] uint8
    
    Raises:
        ValueError: An array does not fit, or threads is negative.
    """
def measure_depth(depth: numpy.ndarray, cosines: numpy.ndarray, *, normals: numpy.ndarray, uniforms: numpy.ndarray, std_m: typing.SupportsFloat | typing.SupportsIndex, std_per_m: typing.SupportsFloat | typing.SupportsIndex, range_m: typing.Annotated[collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex], "FixedSize(2)"], least_cosine: typing.SupportsFloat | typing.SupportsIndex, edge_dropout: typing.SupportsFloat | typing.SupportsIndex, dropout: typing.SupportsFloat | typing.SupportsIndex, threads: int) -> numpy.typing.NDArray[numpy.float32]:
    """
    Makes a depth image with noise and holes.
    
    Args:
        depth: [H,W] float32, true depth, m; 0 where nothing is.
        cosines: [H,W] float32, between surface normal and ray.
        normals: [H,W] float64, standard normal numbers.
        uniforms: [H,W] float64 in 0 to 1, which decide the dropout.
        std_m: Of the noise at any depth, m.
        std_per_m: Growth of that with the squared depth, m/m^2.
        range_m: Nearest and farthest depth that is measured, m.
        least_cosine: Surfaces at a smaller cosine to the ray give no depth.
        edge_dropout: Probability that a pixel at an edge of the depth gives none.
        dropout: Probability that any other pixel gives none.
        threads: 0 means one per hardware thread; the result does not depend on it.
    
    Returns:
        [H,W] float32, m; 0 where nothing is measured.
    
    Raises:
        ValueError: An array does not fit, or threads is negative.
    """
def pixel_rays(camera: gslts._core.map.Camera, *, threads: int) -> numpy.typing.NDArray[numpy.float32]:
    """
    Makes the rays from the eye of a camera through the centres of its pixels.
    
    Returns:
        [H,W,6] float32: origin, m, and direction in world axes, whose z in the camera frame is 1.
    
    Raises:
        ValueError: threads is negative.
    """
def visible_triangles(camera: gslts._core.map.Camera, corners: numpy.ndarray, *, threads: int) -> numpy.typing.NDArray[numpy.uint32]:
    """
    Finds the nearest triangle in front of a camera at each pixel centre, by rasterization.
    
    Args:
        camera: The camera.
        corners: [T,3,3] float32, m, world. Both sides of a triangle are visible.
        threads: 0 means one per hardware thread; the result does not depend on it.
    
    Returns:
        [H,W] uint32 index, the lower of two at the same distance; 0xffffffff where nothing is hit.
    
    Raises:
        ValueError: An array does not fit, or threads is negative.
    """
