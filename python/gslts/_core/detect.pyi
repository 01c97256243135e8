"""
Changes between map and frame.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['ChangeType', 'Component', 'Evidence', 'GsLtsChange', 'GsLtsRule', 'MaskRule', 'Masks', 'ObjectChange', 'ObjectRule', 'Region', 'Shift', 'Side', 'Surface', 'Views', 'Visibility', 'classify_changes', 'compute_masks', 'confidence', 'confidence_features', 'detect_gs_lts', 'find_changed_regions', 'find_changed_surfaces', 'find_regions', 'find_shifts', 'mask_arrays', 'match_features', 'match_score']
class MaskRule:
    """
    Thresholds of the masks of GS-LTS, sec. III-C1; immutable.
    
    Args:
        tau_gs: Sum over the channels of absolute colour differences above which a pixel differs, 0 to 3.
        tau_feat: Cosine of the features below which a pixel differs, -1 to 1.
        alpha_min: Minimum opacity of the map where it is known, 0 to 1.
        clean_px: Radius of the opening and closing of the combined mask, px.
    """
    def __init__(self, *, tau_gs: typing.SupportsFloat | typing.SupportsIndex = 0.15, tau_feat: typing.SupportsFloat | typing.SupportsIndex = 0.95, alpha_min: typing.SupportsFloat | typing.SupportsIndex = 0.7, clean_px: int = 2) -> None:
        ...
    @property
    def alpha_min(self) -> float:
        ...
    @property
    def clean_px(self) -> int:
        ...
    @property
    def tau_feat(self) -> float:
        ...
    @property
    def tau_gs(self) -> float:
        ...
class GsLtsRule:
    """
    Thresholds of the rule of GS-LTS, sec. III-C2; immutable.
    
    Args:
        tau_change: Share of the image that M_comb must exceed, 0 to 1.
        tau_a: Minimum area similarity of a relocation's two regions, 0 to 1.
        tau_d: Maximum distance of a relocation's two regions, as a share of the image's width.
        epsilon: Minimum depth difference of an addition or a removal, m.
    """
    def __init__(self, *, tau_change: typing.SupportsFloat | typing.SupportsIndex = 0.0002, tau_a: typing.SupportsFloat | typing.SupportsIndex = 0.5, tau_d: typing.SupportsFloat | typing.SupportsIndex = 1.0, epsilon: typing.SupportsFloat | typing.SupportsIndex = 0.02) -> None:
        ...
    @property
    def epsilon(self) -> float:
        ...
    @property
    def tau_a(self) -> float:
        ...
    @property
    def tau_change(self) -> float:
        ...
    @property
    def tau_d(self) -> float:
        ...
class ObjectRule:
    """
    Thresholds that separate objects that changed from errors of sensor, pose and map; immutable.
    
    A surface counts as nearer than that of the other image if it is so by `step_sigmas` standard
    deviations of the depth, the constant part measured across the surface, plus the change of its depth
    within `step_px` pixels.
    
    Args:
        step_sigmas: Minimum step, in standard deviations, above 0.
        step_px: Part for the slope of the surface, px.
        edge_tolerance_px: By which edges may be misplaced, px.
        min_area_m2: Minimum area of a surface, facing the camera, m^2.
        min_area_px: Minimum area of a part of a surface, px.
        min_flat_area_m2: Minimum area of a flat change (colours changed, but no single pixel's depth),
            m^2.
        min_flat_color: Minimum colour change of a flat change, summed over the channels, above 0 to 3.
        min_flat_step_m: Minimum median depth difference that tells the side of a flat change, m.
        min_flat_contrast: Minimum difference of the brightness gradient across the outline of a flat
            change, 1/px.
        min_match_score: Minimum `match_score` of the two ends of a relocation, 0 to 1.
        min_confidence: Minimum confidence of a reported change, 0 to 1.
    """
    def __init__(self, *, step_sigmas: typing.SupportsFloat | typing.SupportsIndex = 3.0, step_px: typing.SupportsFloat | typing.SupportsIndex = 1.0, edge_tolerance_px: int = 2, min_area_m2: typing.SupportsFloat | typing.SupportsIndex = 0.0006, min_area_px: int = 25, min_flat_area_m2: typing.SupportsFloat | typing.SupportsIndex = 0.0015, min_flat_color: typing.SupportsFloat | typing.SupportsIndex = 0.15, min_flat_step_m: typing.SupportsFloat | typing.SupportsIndex = 0.006, min_flat_contrast: typing.SupportsFloat | typing.SupportsIndex = 0.03, min_match_score: typing.SupportsFloat | typing.SupportsIndex = 0.3, min_confidence: typing.SupportsFloat | typing.SupportsIndex = 0.5) -> None:
        ...
    @property
    def edge_tolerance_px(self) -> int:
        ...
    @property
    def min_area_m2(self) -> float:
        ...
    @property
    def min_area_px(self) -> int:
        ...
    @property
    def min_confidence(self) -> float:
        ...
    @property
    def min_flat_area_m2(self) -> float:
        ...
    @property
    def min_flat_color(self) -> float:
        ...
    @property
    def min_flat_contrast(self) -> float:
        ...
    @property
    def min_flat_step_m(self) -> float:
        ...
    @property
    def min_match_score(self) -> float:
        ...
    @property
    def step_px(self) -> float:
        ...
    @property
    def step_sigmas(self) -> float:
        ...
class ChangeType:
    """
    Members:
    
      ADDITION
    
      REMOVAL
    
      RELOCATION
    """
    ADDITION: typing.ClassVar[ChangeType]
    RELOCATION: typing.ClassVar[ChangeType]
    REMOVAL: typing.ClassVar[ChangeType]
    __members__: typing.ClassVar[dict[str, ChangeType]]
    @typing.overload
    def __eq__(self, other: ChangeType) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: ChangeType) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class Side:
    """
    Members:
    
      BEFORE
    
      AFTER
    """
    AFTER: typing.ClassVar[Side]
    BEFORE: typing.ClassVar[Side]
    __members__: typing.ClassVar[dict[str, Side]]
    @typing.overload
    def __eq__(self, other: Side) -> bool:
        ...
    @typing.overload
    def __eq__(self, other: typing.Any) -> bool:
        ...
    def __getstate__(self) -> int:
        ...
    def __hash__(self) -> int:
        ...
    def __index__(self) -> int:
        ...
    def __init__(self, value: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __int__(self) -> int:
        ...
    @typing.overload
    def __ne__(self, other: Side) -> bool:
        ...
    @typing.overload
    def __ne__(self, other: typing.Any) -> bool:
        ...
    def __repr__(self) -> str:
        ...
    def __setstate__(self, state: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...
    def __str__(self) -> str:
        ...
    @property
    def name(self) -> str:
        ...
    @property
    def value(self) -> int:
        ...
class Evidence:
    """
    Measurements that tell an object that changed from an error of sensor, pose or map; immutable.
    
    Args:
        step_ratio: Median step by which the surface is nearer than that of the other image, in units of
            the smallest that counts; of a flat surface its mean colour change in such units.
        changed_share: Share of its pixels whose colours are not around in the other image.
        thickness_m: Diameter of the largest disc in it, m.
        attached_share: Share of the pixels beside it in which its depth continues.
        residual_color: Mean colour change, summed over the channels, that more or less light does not
            explain.
        correlation: Of the brightness of both images, on it and beside it, -1 to 1.
        ring_depth_m: Median absolute difference of the depths around it, m.
        ring_color_ratio: Colour change around it, as a share of that on it.
        depth_error_m: Mean expected error of the rendered depth, m.
        color_error: Mean expected error of the rendered colour, summed over the channels.
    
    Raises:
        ValueError: A number is not finite, a share is not in 0 to 1, or another one but the correlation
            is negative.
    """
    def __init__(self, *, step_ratio: typing.SupportsFloat | typing.SupportsIndex = 0.0, changed_share: typing.SupportsFloat | typing.SupportsIndex = 0.0, thickness_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, attached_share: typing.SupportsFloat | typing.SupportsIndex = 0.0, residual_color: typing.SupportsFloat | typing.SupportsIndex = 0.0, correlation: typing.SupportsFloat | typing.SupportsIndex = 0.0, ring_depth_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, ring_color_ratio: typing.SupportsFloat | typing.SupportsIndex = 0.0, depth_error_m: typing.SupportsFloat | typing.SupportsIndex = 0.012, color_error: typing.SupportsFloat | typing.SupportsIndex = 0.05) -> None:
        ...
    @property
    def attached_share(self) -> float:
        ...
    @property
    def changed_share(self) -> float:
        ...
    @property
    def color_error(self) -> float:
        ...
    @property
    def correlation(self) -> float:
        ...
    @property
    def depth_error_m(self) -> float:
        ...
    @property
    def residual_color(self) -> float:
        ...
    @property
    def ring_color_ratio(self) -> float:
        ...
    @property
    def ring_depth_m(self) -> float:
        ...
    @property
    def step_ratio(self) -> float:
        ...
    @property
    def thickness_m(self) -> float:
        ...
class Visibility:
    """
    Visibility counts of a surface's samples; immutable.
    
    In how many training cameras of the map each sample is seen, summed over the samples.
    
    Args:
        on_surface: Counts of cameras that see a surface at the sample.
        seen_through: Counts of cameras that see a surface behind it: the sample was free space.
        known_share: Share of the samples with at least one count, 0 to 1.
        recorded_share: Share of the samples at which the recording of the map measured a surface.
        free_share: Share of the samples that the recording saw through.
        missing_share: Of a surface of the map, share of the samples that the recording saw through
            and never measured.
    
    Raises:
        ValueError: A count is negative or not finite, or a share is not in 0 to 1.
    """
    def __init__(self, *, on_surface: typing.SupportsFloat | typing.SupportsIndex, seen_through: typing.SupportsFloat | typing.SupportsIndex, known_share: typing.SupportsFloat | typing.SupportsIndex, recorded_share: typing.SupportsFloat | typing.SupportsIndex = 0.0, free_share: typing.SupportsFloat | typing.SupportsIndex = 1.0, missing_share: typing.SupportsFloat | typing.SupportsIndex = 0.0) -> None:
        ...
    @property
    def free_share(self) -> float:
        ...
    @property
    def known_share(self) -> float:
        ...
    @property
    def missing_share(self) -> float:
        ...
    @property
    def on_surface(self) -> float:
        ...
    @property
    def recorded_share(self) -> float:
        ...
    @property
    def seen_through(self) -> float:
        ...
class Surface:
    """
    The visible surface of an object, before or after a change.
    
    `find_changed_surfaces` returns surfaces; a detector of your own builds them. `side`, `point`, `low`
    and `high` say what changed and where; the rest serves `confidence` and `match_score`.
    
    Args:
        side: In which image it is seen: in the map (BEFORE) or in the frame (AFTER).
        point: (3,) float64, median of its points, world, m.
        low: (3,) float64, lower corner of the box around most of it, world, m.
        high: (3,) float64, upper corner.
        label: In the image of labels; 0: in none.
        area_px: Pixels.
        area_m2: Area facing the camera, m^2.
        depth_m: Median z in the camera frame, m.
        color: (3,) float64, median, sRGB, 0 to 1.
        step_m: Median step by which it is nearer than in the other image, m.
        flat: It is a flat change: colours changed, but no single pixel's depth.
        samples: [N] points (3,) of it, world, m.
        color_histogram: Shares of colours that sum up to 1; empty: unknown, and it matches nothing.
        evidence: Measurements on and around it; None: those of `Evidence()`.
        visibility: Visibility counts of the samples; None: unknown.
        color_confidence: Confidence of a region of colours, 0 to 1, in place of that from the rest; None:
            not known.
    
    Raises:
        ValueError: A number is not finite, an area or a depth is negative, the box is inverted, the
            histogram has another length or sum, or the confidence is not in 0 to 1.
    """
    def __init__(self, *, side: Side, point: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], low: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], high: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"], label: int = 0, area_px: int = 0, area_m2: typing.SupportsFloat | typing.SupportsIndex = 0.0, depth_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, color: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"] = (0.0, 0.0, 0.0), step_m: typing.SupportsFloat | typing.SupportsIndex = 0.0, flat: bool = False, samples: collections.abc.Sequence[typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]] = (), color_histogram: collections.abc.Sequence[typing.SupportsFloat | typing.SupportsIndex] = (), evidence: Evidence | None = None, visibility: Visibility | None = None, color_confidence: typing.SupportsFloat | typing.SupportsIndex | None = None) -> None:
        ...
    @property
    def area_m2(self) -> float:
        ...
    @property
    def area_px(self) -> int:
        ...
    @property
    def color(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def color_confidence(self) -> float | None:
        """
        May be set: what updates added is not known to the detection.
        """
    @color_confidence.setter
    def color_confidence(self, arg1: typing.SupportsFloat | typing.SupportsIndex | None) -> None:
        ...
    @property
    def color_histogram(self) -> list[float]:
        ...
    @property
    def depth_m(self) -> float:
        ...
    @property
    def evidence(self) -> Evidence:
        ...
    @property
    def flat(self) -> bool:
        ...
    @property
    def high(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def label(self) -> int:
        ...
    @property
    def low(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def point(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def samples(self) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]]:
        ...
    @property
    def side(self) -> Side:
        ...
    @property
    def step_m(self) -> float:
        ...
    @property
    def visibility(self) -> Visibility | None:
        """
        May be set: the map's training cameras are not known to the detection.
        """
    @visibility.setter
    def visibility(self, arg0: Visibility | None) -> None:
        ...
class Shift:
    """
    A small rigid motion over the floor.
    """
    @property
    def after(self) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]]:
        """
        The same after the motion.
        """
    @property
    def before(self) -> tuple[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"], typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]]:
        """
        Lower and upper corner (3,) around the points that were followed, world, m.
        """
    @property
    def motion(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 4]"]:
        """
        [4,4] float64, world, m: x_after = motion @ x_before.
        """
    @property
    def score(self) -> float:
        """
        Mean share of their points that it explains, less those that contradict it.
        """
    @property
    def surfaces(self) -> list[int]:
        """
        Rows of the surfaces that it explains.
        """
class Region:
    """
    A region of similar colours that the other image may not show.
    """
    @property
    def features(self) -> typing.Annotated[list[float], "FixedSize(9)"]:
        """
        Features of the logistic regression of its confidence.
        """
    @property
    def pixels(self) -> list[int]:
        """
        Indices, row by row.
        """
    @property
    def side(self) -> Side:
        ...
class Component:
    """
    Pixels of a mask that touch each other.
    """
    @property
    def area(self) -> int:
        """
        Pixels.
        """
    @property
    def label(self) -> int:
        """
        In the image of labels, from 1.
        """
    @property
    def u(self) -> float:
        """
        Column of the centroid, px; the centre of the first pixel is 0.5.
        """
    @property
    def v(self) -> float:
        """
        Row of the centroid, px.
        """
class GsLtsChange:
    """
    A change as the rule of GS-LTS finds it.
    """
    @property
    def first(self) -> Component:
        """
        R_1.
        """
    @property
    def point_in_world(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        (3,) p_world, m.
        """
    @property
    def second(self) -> Component | None:
        """
        R_2 of a relocation, else None.
        """
    @property
    def type(self) -> ChangeType:
        ...
class ObjectChange:
    """
    An object that was added, removed or relocated.
    """
    @property
    def after(self) -> Surface | None:
        """
        In the frame; None for a removal.
        """
    @property
    def before(self) -> Surface | None:
        """
        In the map; None for an addition.
        """
    @property
    def confidence(self) -> float:
        """
        0 to 1.
        """
    @property
    def type(self) -> ChangeType:
        ...
class Views:
    """
    A frame and a rendering of the map from the same camera.
    
    Args:
        camera: Of all images.
        observed_rgb: [H,W,3] float32, sRGB, 0 to 1; this and all others C-contiguous.
        rendered_rgb: [H,W,3] float32, sRGB, with the exposure of the frame.
        observed_depth: [H,W] float32, z in the camera frame, m; 0 and NaN: not measured.
        rendered_depth: [H,W] float32, z in the camera frame, m; 0 where nothing is.
        alpha: [H,W] float32, opacity of the map, 0 to 1.
        similarity: [H,W] float32, cosine of the features of both images, -1 to 1.
        depth_error: [H,W] float32, expected error of the rendered depth, m; None if it is not known.
        color_error: [H,W] float32, expected error of the rendered colours, summed over the channels.
        noise: (a, b), m and 1/m: the standard deviation of the difference of measured and rendered
            depths z of an unchanged surface is a + b z^2. Neither is negative, and not both are 0.
    
    Raises:
        ValueError: An array has another shape, type or layout.
    """
    def __init__(self, *, camera: gslts._core.map.Camera, observed_rgb: numpy.ndarray, rendered_rgb: numpy.ndarray, observed_depth: numpy.ndarray, rendered_depth: numpy.ndarray, alpha: numpy.ndarray, similarity: numpy.ndarray, depth_error: numpy.ndarray | None = None, color_error: numpy.ndarray | None = None, noise: tuple[typing.SupportsFloat | typing.SupportsIndex, typing.SupportsFloat | typing.SupportsIndex] = (0.0083, 0.002)) -> None:
        ...
class Masks:
    """
    Masks of one pair of images, from `compute_masks`.
    """
def classify_changes(surfaces: collections.abc.Sequence[Surface], rule: ObjectRule) -> list[ObjectChange]:
    """
    Classify surfaces as additions, removals and relocations.
    
    What vanished and what appeared are one object if they match in colours and size.
    
    Args:
        surfaces: Of one pair of images, or of several.
        rule: Thresholds.
    
    Returns:
        Changes with at least `rule.min_confidence`, the highest confidence first.
    
    Raises:
        ValueError: A threshold or a number of a surface is out of range.
    """
def compute_masks(views: Views, rule: MaskRule) -> Masks:
    """
    Compute the two branches of change detection and their product.
    
    The paper prints M_feat = (similarity > tau_feat), which marks what did not change; here features
    differ where their similarity is low.
    
    Args:
        views: Frame and rendering.
        rule: Thresholds.
    
    Returns:
        The masks; `mask_arrays` converts them to numpy.
    
    Raises:
        ValueError: A threshold is out of range.
    
    Source: GS-LTS, sec. III-C1, eq. 4 and 5.
    """
def confidence(surface: Surface) -> float:
    """
    Compute how likely a surface belongs to an object that changed.
    
    Args:
        surface: Of either side.
    
    Returns:
        Calibrated probability, 0 to 1.
    """
def confidence_features(surface: Surface) -> typing.Annotated[list[float], "FixedSize(18)"]:
    """
    Compute the numbers that `confidence` weighs.
    
    Args:
        surface: Of either side.
    
    Returns:
        Features of the logistic regression.
    """
def detect_gs_lts(views: Views, masks: Masks, rule: GsLtsRule) -> tuple[GsLtsChange | None, numpy.typing.NDArray[numpy.int32]]:
    """
    Predict change type and key point as printed in GS-LTS.
    
    Args:
        views: Frame and rendering.
        masks: Of the same views.
        rule: Thresholds.
    
    Returns:
        The change, None if there is none, and [H,W] int32 labels of the components of M_comb.
    
    Raises:
        ValueError: A threshold is out of range, or the masks have another size.
    
    Source: GS-LTS, sec. III-C2, eq. 6 to 10.
    """
def find_changed_regions(views: Views, masks: Masks, rule: ObjectRule) -> tuple[list[Surface], numpy.typing.NDArray[numpy.int32]]:
    """
    Find the objects that only one of map and frame shows, by colours and coarse depth.
    
    For depth that is coarser than the steps that `find_changed_surfaces` looks for, or missing.
    
    Args:
        views: Frame and rendering.
        masks: Of the same views.
        rule: Thresholds.
    
    Returns:
        Surfaces with a `color_confidence`, the highest first, and [H,W] int32 their labels, 0 where
        nothing changed.
    
    Raises:
        ValueError: A threshold is out of range, or the masks have another size.
    """
def find_changed_surfaces(views: Views, masks: Masks, rule: ObjectRule) -> tuple[list[Surface], numpy.typing.NDArray[numpy.int32]]:
    """
    Find the surfaces that only one of map and frame shows.
    
    Args:
        views: Frame and rendering.
        masks: Of the same views.
        rule: Thresholds.
    
    Returns:
        The surfaces, and [H,W] int32 their labels, 0 where nothing changed.
    
    Raises:
        ValueError: A threshold or the noise is out of range, or the masks have another size.
    """
def find_regions(views: Views, masks: Masks, rule: ObjectRule) -> list[Region]:
    """
    List the regions that `find_changed_regions` chooses from; they may overlap.
    
    Args:
        views: Frame and rendering.
        masks: Of the same views.
        rule: Thresholds.
    
    Returns:
        The regions of frame and rendering.
    
    Raises:
        ValueError: A threshold is out of range, or the masks have another size.
    """
def find_shifts(views: Views, masks: Masks, surfaces: collections.abc.Sequence[Surface], labels: numpy.ndarray, rule: ObjectRule) -> list[Shift]:
    """
    Find small rigid motions over the floor that explain changed surfaces.
    
    Args:
        views: Frame and rendering.
        masks: Of the same views.
        surfaces: Surfaces visible in only one of map and frame.
        labels: [H,W] int32, label of the surface at each pixel, 0 for none.
        rule: Thresholds.
    
    Returns:
        The shifts; each surface belongs to one of them at most.
    
    Raises:
        ValueError: A threshold is out of range, or the masks or labels have another size.
    """
def mask_arrays(masks: Masks, camera: gslts._core.map.Camera) -> dict[str, numpy.ndarray]:
    """
    Copy masks to arrays.
    
    Args:
        masks: From `compute_masks`.
        camera: Of the images.
    
    Returns:
        [H,W] bool by name: "known" (the map is known there), "pixel" (M_pixel), "feature" (M_feat) and
        "combined" (M_comb).
    
    Raises:
        ValueError: The masks have another size than the camera.
    """
def match_features(before: Surface, after: Surface) -> typing.Annotated[list[float], "FixedSize(2)"]:
    """
    Compute the numbers that `match_score` weighs.
    
    Args:
        before: A surface of the map.
        after: A surface of the frame.
    
    Returns:
        Hellinger distance of the colour histograms, and the logarithm of the ratio of the heights after
        and before, 0 if it is smaller.
    """
def match_score(before: Surface, after: Surface) -> float:
    """
    Score how likely two surfaces of one frame are one object.
    
    Args:
        before: A surface of the map.
        after: A surface of the frame.
    
    Returns:
        Probability, 0 to 1.
    """
