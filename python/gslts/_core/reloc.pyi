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
    How many features of a picture are taken, and how.
    
    Args:
        count: At most so many, spread over the picture.
        scale_step: Between the levels of the pyramid, above 1.
        levels: Of the pyramid, 1 to 16.
        fast_threshold: Least difference of grey of a corner, 1 to 254.
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
    How poses are guessed from features.
    
    Args:
        neighbours: Landmarks that a feature may be, 1 to 16.
        most_bits: Hamming distance of what may be the same corner, 0 to 256.
        ratio: Of the distances to the nearest landmark and to the next one that is elsewhere, for
            matches among all landmarks, above 0 and at most 1.
        elsewhere_m: Landmarks that are nearer to each other are one corner, m.
        keyframes: With the most votes, that are tried one by one.
        inlier_px: Error of the reprojection of an inlier, px.
        inlier_depth: Relative error of its depth, where it is measured.
        least_inliers: Of a pose worth looking at, at least 4.
        iterations: Poses that each RANSAC tries at most.
    """
    def __init__(self, *, neighbours: int = 4, most_bits: int = 64, ratio: typing.SupportsFloat | typing.SupportsIndex = 0.85, elsewhere_m: typing.SupportsFloat | typing.SupportsIndex = 0.1, keyframes: int = 8, inlier_px: typing.SupportsFloat | typing.SupportsIndex = 4.0, inlier_depth: typing.SupportsFloat | typing.SupportsIndex = 0.05, least_inliers: int = 10, iterations: int = 500) -> None:
        ...
    @property
    def elsewhere_m(self) -> float:
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
    def least_inliers(self) -> int:
        ...
    @property
    def most_bits(self) -> int:
        ...
    @property
    def neighbours(self) -> int:
        ...
    @property
    def ratio(self) -> float:
        ...
class LandmarkIndex:
    """
    Finds landmarks by their descriptors.
    
    It keeps a copy of the landmarks; the same ones give the same index.
    
    Args:
        positions: [L,3] float32 from the map's origin, m.
        descriptors: [L,32] uint8, ORB.
        keyframes: [L] int32, row of the keyframe that saw it.
    
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
        The landmarks that are most like each of M features.
        
        Args:
            descriptors: [M,32] uint8 of the features.
            k: How many of each, 1 to 16.
        
        Returns:
            landmarks: [M,k] int32 rows, the most like it first; -1 where fewer were found.
            distances: [M,k] int32, bits that differ; 256 where fewer were found.
        
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
        Corners that it explains.
        """
    @property
    def keyframe(self) -> int:
        """
        Row of the keyframe that it was found with; -1 if with all of them.
        """
    @property
    def world_from_camera(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        [4,4] float64, a copy.
        """
class CloudRule:
    """
    How clouds are brought together.
    
    Args:
        voxel_m: Both clouds are thinned to one point in each, m, 1e-4 to 10.
        most_distant_m: Points that are farther apart are not paired, m, above 0 and up to 100.
        neighbours: Of a point, that tell its plane, at least 4.
        iterations: At most, at least 1.
    """
    def __init__(self, *, voxel_m: typing.SupportsFloat | typing.SupportsIndex = 0.05, most_distant_m: typing.SupportsFloat | typing.SupportsIndex = 0.15, neighbours: int = 12, iterations: int = 20) -> None:
        ...
    @property
    def iterations(self) -> int:
        ...
    @property
    def most_distant_m(self) -> float:
        ...
    @property
    def neighbours(self) -> int:
        ...
    @property
    def voxel_m(self) -> float:
        ...
class Registration:
    """
    A motion that brings one cloud onto another.
    """
    @property
    def converged(self) -> bool:
        """
        Whether it came to rest before the iterations ran out. False also where a thinned cloud has fewer points than `neighbours`: then the guess comes back, with no overlap.
        """
    @property
    def overlap(self) -> float:
        """
        Share of the thinned source points that have a partner, 0 to 1.
        """
    @property
    def rms_m(self) -> float:
        """
        Of their distances from the planes of their partners, m; 0 if there are none.
        """
    @property
    def target_from_source(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        [4,4] float64, a copy: x_in_target = target_from_source @ x_in_source.
        """
class RefineRule:
    """
    How a pose is refined.
    
    Args:
        iterations: At each resolution, at most.
        least_step_m: A step that is shorter, and turns less than so many rad, is the last one; twice as
            much at half the resolution, and so on.
        color_scale: Difference of a channel at which trust begins to end.
        depth_scale: The same of the depth, as a share of it.
        depth_weight: Of the depth, against the colours.
        alpha_min: Where less of the map is, it was never seen.
        threads: 0 means one a hardware thread.
    """
    def __init__(self, *, iterations: typing.SupportsInt | typing.SupportsIndex = 8, least_step_m: typing.SupportsFloat | typing.SupportsIndex = 0.0001, color_scale: typing.SupportsFloat | typing.SupportsIndex = 0.08, depth_scale: typing.SupportsFloat | typing.SupportsIndex = 0.03, depth_weight: typing.SupportsFloat | typing.SupportsIndex = 0.1, alpha_min: typing.SupportsFloat | typing.SupportsIndex = 0.9, threads: typing.SupportsInt | typing.SupportsIndex = 0) -> None:
        ...
class Fit:
    """
    How well a picture fits a map.
    
    Attributes:
        known: Share of the pixels that may count that the map fills.
        alike: Share of that where colours are alike.
        measured: Share of that where depth was measured.
        near: Share of this where it is near that of the map.
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
    A pose where a picture fits a map best.
    
    Attributes:
        world_from_camera: [4,4].
        curvature: [6,6] of the cost there, by a twist (rho, phi) of world_from_camera @ exp(rho, phi):
            m before rad.
        cost: Mean over the pixels that count.
        fit: There, too.
        iterations: Of all resolutions.
        converged: Whether the last resolution ended before its iterations did.
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
    Corners of a picture with descriptors, the strongest of each part of it.
    
    Args:
        grey: [H,W] uint8.
        mask: [H,W] bool, True where features are wanted. None: everywhere.
        rule: How many, and how.
    
    Returns:
        pixels: [M,2] float32, (u, v); pixel centres are at + 0.5.
        descriptors: [M,32] uint8, ORB.
    
    Raises:
        ValueError: An array does not fit, or the rule is out of range.
    
    Source: Rublee et al. 2011, ORB; spread as in Mur-Artal et al. 2015, ORB-SLAM.
    """
def hypotheses_of(camera: gslts._core.map.Camera, pixels: numpy.ndarray, descriptors: numpy.ndarray, depths: numpy.ndarray, index: LandmarkIndex, rule: HypothesisRule) -> list[Hypothesis]:
    """
    Poses that a picture may have been taken from.
    
    Args:
        camera: Its intrinsics; its pose is not used.
        pixels: [M,2] float32 of its features.
        descriptors: [M,32] uint8 of them.
        depths: [M] float32 of them, z, m; 0 and NaN mean no measurement.
        index: The landmarks of the map.
        rule: How they are found.
    
    Returns:
        Those with most inliers first; poses that are nearly the same only once.
    
    Raises:
        ValueError: An array does not fit, a pixel is not finite, or the rule is out of range.
    
    Source: RANSAC with three points (Umeyama 1991) where depth is measured, P3P (Gao et al. 2003)
    elsewhere.
    """
def refine_pose(maps: collections.abc.Sequence[gslts._core.map.GaussianViewFloat], cameras: collections.abc.Sequence[gslts._core.map.Camera], photos: collections.abc.Sequence[numpy.ndarray], *, measured: collections.abc.Sequence[numpy.ndarray] | None = None, masks: collections.abc.Sequence[numpy.ndarray] | None = None, rule: RefineRule) -> RefinedPose:
    """
    Where a picture fits a map best, near a pose.
    
    Args:
        maps: Views of a float32 map: one for all pictures, or one for each.
        cameras: Of one picture in several resolutions, the coarsest first; the pose of the first one is
            where the search starts.
        photos: [H,W,3] float32 sRGB of each, 0 to 1.
        measured: [H,W] float32 depth of each, m, 0 or NaN where there is none; None means without.
        masks: [H,W] bool of each, pixels that may count; None means all.
        rule: Settings.
    
    Source: iComMa, Sun et al. 2023.
    """
def register_clouds(source: numpy.ndarray, target: numpy.ndarray, guess: numpy.ndarray, *, rule: CloudRule) -> Registration:
    """
    Brings the surfaces of one cloud onto those of another: generalised ICP.
    
    Along a single plane or a corridor nothing holds the clouds; there the motion stays near the guess.
    
    Args:
        source: [N,3] float32, m.
        target: [M,3] float32, m; only what is around the source counts.
        guess: [4,4] float64 target_from_source, some `most_distant_m` off at most.
        rule: How it is done.
    
    Raises:
        ValueError: A point is not finite, the guess is not a rigid motion, the rule is out of range, or
            a cloud spans more than 2^31 voxels.
    
    Source: Segal et al., Generalized-ICP, 2009; PCL.
    """
