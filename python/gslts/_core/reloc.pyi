"""
Pose of an image in a map, without a prior.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['CloudRule', 'FeatureRule', 'Fit', 'Hypothesis', 'HypothesisRule', 'LandmarkIndex', 'RefineRule', 'RefinedPose', 'Registration', 'features_of', 'hypotheses_of', 'refine_pose', 'register_clouds']
class FeatureRule:
    """
    Settings of feature extraction.
    
    Args:
        count: Maximum number of features, spread over the image.
        scale_step: Ratio of the sizes of neighbouring levels of the pyramid, above 1.
        levels: Number of levels of the pyramid, 1 to 16.
        fast_threshold: Minimum grey difference of a FAST corner, 1 to 254.
    """
    def __init__(self, *, count: int = 1000, scale_step: typing.SupportsFloat | typing.SupportsIndex = 1.2, levels: int = 8, fast_threshold: int = 10) -> None:
        ...
    @property
    def count(self) -> int:
        ...
    @property
    def fast_threshold(self) -> int:
        ...
    @property
    def levels(self) -> int:
        ...
    @property
    def scale_step(self) -> float:
        ...
class HypothesisRule:
    """
    Settings of the search for hypotheses.
    
    Args:
        neighbours: Landmarks that are considered for each feature, 1 to 16.
        max_bits: Maximum Hamming distance of a match, 0 to 256.
        ratio: Maximum ratio of the distances to the nearest landmark and to the next one elsewhere, for
            matches among all landmarks, above 0 and at most 1.
        same_landmark_m: Landmarks that are nearer to each other count as one, m.
        keyframes: Number of keyframes that are tried one by one, by votes.
        inlier_px: Maximum reprojection error of an inlier, px.
        inlier_depth: Maximum relative error of its measured depth.
        min_inliers: Minimum number of inliers of a hypothesis, at least 4.
        iterations: Maximum number of poses that each RANSAC tries.
    """
    def __init__(self, *, neighbours: int = 4, max_bits: int = 64, ratio: typing.SupportsFloat | typing.SupportsIndex = 0.85, same_landmark_m: typing.SupportsFloat | typing.SupportsIndex = 0.1, keyframes: int = 8, inlier_px: typing.SupportsFloat | typing.SupportsIndex = 4.0, inlier_depth: typing.SupportsFloat | typing.SupportsIndex = 0.05, min_inliers: int = 10, iterations: int = 500) -> None:
        ...
    @property
    def inlier_depth(self) -> float:
        ...
    @property
    def inlier_px(self) -> float:
        ...
    @property
    def iterations(self) -> int:
        ...
    @property
    def keyframes(self) -> int:
        ...
    @property
    def max_bits(self) -> int:
        ...
    @property
    def min_inliers(self) -> int:
        ...
    @property
    def neighbours(self) -> int:
        ...
    @property
    def ratio(self) -> float:
        ...
    @property
    def same_landmark_m(self) -> float:
        ...
class LandmarkIndex:
    """
    Approximate nearest-neighbour index of landmarks, by their descriptors.
    
    It keeps a copy of the landmarks; the same landmarks give the same index.
    
    Args:
        positions: [L,3] float32 from the map's origin, m.
        descriptors: [L,32] uint8, ORB.
        keyframes: [L] int32, index of the keyframe that saw each.
    
    Raises:
        ValueError: A position is not finite, a keyframe is negative, or an array does not fit.
    
    Source: FLANN's multi-probe locality-sensitive hashing (Lv et al. 2007).
    """
    def __init__(self, positions: numpy.ndarray, descriptors: numpy.ndarray, keyframes: numpy.ndarray) -> None:
        ...
    def __len__(self) -> int:
        ...
    def match(self, descriptors: numpy.ndarray, k: int) -> tuple[numpy.typing.NDArray[numpy.int32], numpy.typing.NDArray[numpy.int32]]:
        """
        Find the nearest landmarks of each of M features.
        
        Args:
            descriptors: [M,32] uint8 of the features.
            k: Number of landmarks per feature, 1 to 16.
        
        Returns:
            landmarks: [M,k] int32 rows, the nearest first; -1 where fewer were found.
            distances: [M,k] int32, Hamming distance in bits; 256 where fewer were found.
        
        Raises:
            ValueError: k is out of range, or the array does not fit.
        """
class Hypothesis:
    """
    A pose that some features support.
    """
    @property
    def inliers(self) -> int:
        """
        Number of keypoints that it explains.
        """
    @property
    def keyframe(self) -> int:
        """
        Index of the keyframe whose landmarks gave it; -1 for all landmarks.
        """
    @property
    def world_from_camera(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        [4,4] float64, a copy.
        """
class CloudRule:
    """
    Settings of the registration of two clouds.
    
    Args:
        voxel_m: Edge of the voxels that both are downsampled to, m, 1e-4 to 10.
        max_distance_m: Maximum distance of corresponding points, m, above 0 and up to 100.
        neighbours: Number of points that determine the plane at a point, at least 4.
        iterations: Maximum number, at least 1.
    """
    def __init__(self, *, voxel_m: typing.SupportsFloat | typing.SupportsIndex = 0.05, max_distance_m: typing.SupportsFloat | typing.SupportsIndex = 0.15, neighbours: int = 12, iterations: int = 20) -> None:
        ...
    @property
    def iterations(self) -> int:
        ...
    @property
    def max_distance_m(self) -> float:
        ...
    @property
    def neighbours(self) -> int:
        ...
    @property
    def voxel_m(self) -> float:
        ...
class Registration:
    """
    A rigid motion that registers one cloud with another.
    """
    @property
    def converged(self) -> bool:
        """
        Whether the motion converged within the iterations. False also where a downsampled cloud has fewer points than `neighbours`: then the guess is returned, with no overlap.
        """
    @property
    def overlap(self) -> float:
        """
        Share of the downsampled source points with a correspondence, 0 to 1.
        """
    @property
    def rms_m(self) -> float:
        """
        RMS distance of these from the planes of the target, m; 0 if there are none.
        """
    @property
    def target_from_source(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        [4,4] float64, a copy: x_in_target = target_from_source @ x_in_source.
        """
class RefineRule:
    """
    Settings of the refinement of a pose.
    
    Args:
        iterations: Maximum number at each resolution.
        min_step_m: Length of a step, m and rad, below which it is the last one at full size; twice as
            much at half the size, and so on.
        color_scale: Scale of the robust loss of a colour difference, 0 to 1.
        depth_scale: The same of a relative depth difference.
        depth_weight: Weight of depth against colour.
        alpha_min: Minimum alpha where the map is known.
        far_m: Far plane of the rendering, m.
        threads: 0 means one per hardware thread.
    """
    def __init__(self, *, iterations: typing.SupportsInt | typing.SupportsIndex = 8, min_step_m: typing.SupportsFloat | typing.SupportsIndex = 0.0001, color_scale: typing.SupportsFloat | typing.SupportsIndex = 0.08, depth_scale: typing.SupportsFloat | typing.SupportsIndex = 0.03, depth_weight: typing.SupportsFloat | typing.SupportsIndex = 0.1, alpha_min: typing.SupportsFloat | typing.SupportsIndex = 0.9, far_m: typing.SupportsFloat | typing.SupportsIndex = ..., threads: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
        ...
class Fit:
    """
    How well an image fits a map, in shares of pixels.
    
    Attributes:
        known: Of the pixels that may count: where the map is known.
        alike: Of these: where colours differ by less than `color_scale`.
        measured: Of the known pixels: where depth was measured.
        near: Of these: where depth differs by less than `depth_scale`.
    """
    @property
    def alike(self) -> float:
        ...
    @property
    def known(self) -> float:
        ...
    @property
    def measured(self) -> float:
        ...
    @property
    def near(self) -> float:
        ...
class RefinedPose:
    """
    The pose at which an image fits a map best.
    
    Attributes:
        world_from_camera: [4,4].
        curvature: [6,6] of the cost at the pose, by a twist (rho, phi) of
            world_from_camera @ exp(rho, phi), m before rad.
        cost: Mean over the known pixels.
        fit: How well the image fits there.
        iterations: Sum over all resolutions.
        converged: Whether the last resolution converged within its iterations.
    """
    @property
    def converged(self) -> bool:
        ...
    @property
    def cost(self) -> float:
        ...
    @property
    def curvature(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[6, 6]"]:
        ...
    @property
    def fit(self) -> Fit:
        ...
    @property
    def iterations(self) -> int:
        ...
    @property
    def world_from_camera(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 4]"]:
        ...
def features_of(grey: numpy.ndarray, mask: numpy.ndarray | None, rule: FeatureRule) -> tuple[numpy.typing.NDArray[numpy.float32], numpy.typing.NDArray[numpy.uint8]]:
    """
    Extract keypoints with descriptors, the strongest of each part of an image.
    
    Args:
        grey: [H,W] uint8.
        mask: [H,W] bool, True where features are wanted. None: everywhere.
        rule: Settings.
    
    Returns:
        pixels: [M,2] float32, (u, v); pixel centres are at + 0.5.
        descriptors: [M,32] uint8, ORB.
    
    Raises:
        ValueError: An array does not fit, or the rule is out of range.
    
    Source: Rublee et al. 2011, ORB; spread as in Mur-Artal et al. 2015, ORB-SLAM.
    """
def hypotheses_of(camera: gslts._core.map.Camera, pixels: numpy.ndarray, descriptors: numpy.ndarray, depths: numpy.ndarray, index: LandmarkIndex, rule: HypothesisRule) -> list[Hypothesis]:
    """
    Find poses from which an image may have been taken.
    
    Args:
        camera: Intrinsics of the image; its pose is not used.
        pixels: [M,2] float32, positions of its features, px.
        descriptors: [M,32] uint8 of the features.
        depths: [M] float32, z of the features, m; 0 and NaN mean no measurement.
        index: Landmarks of the map.
        rule: Settings.
    
    Returns:
        Hypotheses by descending number of inliers, without poses within 5 cm and 3 degrees of each
        other.
    
    Raises:
        ValueError: An array does not fit, a pixel is not finite, or the rule is out of range.
    
    Source: RANSAC with three points (Umeyama 1991) where depth is measured, P3P (Gao et al. 2003)
    elsewhere.
    """
def refine_pose(maps: collections.abc.Sequence[gslts._core.map.GaussianViewFloat], cameras: collections.abc.Sequence[gslts._core.map.Camera], photos: collections.abc.Sequence[numpy.ndarray], *, measured: collections.abc.Sequence[numpy.ndarray] | None = None, masks: collections.abc.Sequence[numpy.ndarray] | None = None, rule: RefineRule) -> RefinedPose:
    """
    Refine the pose of an image in a map.
    
    Args:
        maps: Views of a float32 map: one for all images, or one per image.
        cameras: Cameras of one image in several resolutions, the coarsest first; the search starts at
            the pose of the first one.
        photos: [H,W,3] float32 sRGB of each, 0 to 1.
        measured: [H,W] float32 depth of each, m, 0 or NaN where there is none; None means without.
        masks: [H,W] bool of each, pixels that may count; None means all.
        rule: Settings.
    
    Returns:
        The pose; the start, not converged, if the map is not seen from there.
    
    Raises:
        ValueError: An array does not fit its camera, or a camera or a setting is invalid.
    
    Source: iComMa, Sun et al. 2023.
    """
def register_clouds(source: numpy.ndarray, target: numpy.ndarray, guess: numpy.ndarray, *, rule: CloudRule) -> Registration:
    """
    Register two clouds by generalised ICP, plane to plane.
    
    Where the clouds do not constrain the motion, such as along a wall, it stays near the guess.
    
    Args:
        source: [N,3] float32, m.
        target: [M,3] float32, m; only points near the source are used.
        guess: [4,4] float64 target_from_source, up to about `max_distance_m` off.
        rule: Settings.
    
    Raises:
        ValueError: A point is not finite, the guess is not a rigid motion, the rule is out of range, or
            a cloud spans more than 2^31 voxels.
    
    Source: Segal et al., Generalized-ICP, 2009; PCL.
    """
