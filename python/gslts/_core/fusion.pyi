"""
Fusion and registration of depth images.
"""
from __future__ import annotations
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['SurfaceVoxels', 'register_depth']
class SurfaceVoxels:
    """
    Fuses depth images: sums of the measured surface points in voxels.
    
    Sums are taken in the order of the frames and of their pixels. RuntimeError is raised where another
    thread uses the object.
    
    Args:
        edge_m: Edge of the voxels, whose corners are multiples of it, m.
        pixel_step: Every n-th row and column of an image is used.
    
    Raises:
        ValueError: The edge is not positive and finite, or the step is below 1.
    """
    def __init__(self, edge_m: typing.SupportsFloat | typing.SupportsIndex, pixel_step: int) -> None:
        ...
    def add(self, depth: numpy.ndarray, rgb: numpy.ndarray, camera: gslts._core.map.Camera, mask: numpy.ndarray | None) -> None:
        """
        Add the points of an image, with normals, colours and details.
        
        A pixel counts if it and its four neighbours, `pixel_step` away, are measured and no edge of the
        depth separates them.
        
        Args:
            depth: [H,W] float32, z, m; 0 and NaN mean no measurement.
            rgb: [H,W,3] uint8, sRGB.
            camera: Camera of both images.
            mask: [H,W] bool, False where pixels are invalid; None means that all are valid.
        
        Raises:
            ValueError: An array does not fit, a depth is negative or infinite, the camera is farther from
                the world's origin than 2^40 voxels, or a point is about 2^20 voxels from the first
                camera. Nothing has been added then.
        """
    def voxels(self) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.int64]]:
        """
        Return all V voxels so far, by ascending key.
        
        Returns:
            keys: [V] int64, Morton codes. A voxel of twice the edge has the keys of its eight parts, which
                follow each other, shifted right by 3. Keys depend on where the first camera stood.
            sums: [V,11] float64 over the points of each: their number, position in the world (3, m), unit
                normal towards the camera (3), sRGB colour from 0 to 1 (3), and squared change of the
                brightness along the surface (1/m^2).
            hits: [V] int64, frames with points in the voxel.
        """
def register_depth(depth: numpy.ndarray, depth_camera: gslts._core.map.Camera, camera: gslts._core.map.Camera) -> numpy.typing.NDArray[numpy.float32]:
    """
    Register a depth image to another camera.
    
    Each measured pixel is projected as a small planar patch that it and its neighbours determine, so
    that surfaces stay closed and planes stay planes; where patches overlap, the nearest one counts.
    
    Args:
        depth: [H,W] float32 of `depth_camera`, z, m; 0 and NaN mean no measurement.
        depth_camera, camera: Cameras with poses in one frame; only the relative pose counts.
    
    Returns:
        [H',W'] float32 of `camera`, z, m; 0 where no patch is projected.
    
    Raises:
        ValueError: The image does not fit its camera.
    """
