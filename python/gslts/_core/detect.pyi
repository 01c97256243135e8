"""
What changed between map and frame.
"""
from __future__ import annotations
import collections.abc
import gslts._core.map
import numpy
import numpy.typing
import typing
__all__: list[str] = ['ChangeType', 'Component', 'Evidence', 'MaskRule', 'MaskSet', 'ObjectChange', 'ObjectRule', 'PaperChange', 'PaperRule', 'Side', 'Sights', 'Surface', 'Views', 'arrays_of', 'certainty', 'changed_surfaces', 'changes_of', 'differences_of', 'features_of', 'likeness', 'masks_of', 'paper_change']
class MaskRule:
    """
    Where a photo and a rendering differ (GS-LTS, sec. III-C).
    
    Args:
        tau_gs: Sum over the channels of absolute differences, 0 to 3.
        tau_feat: Cosine of the features below which they differ.
        alpha_min: Where less of the map is, it was never seen.
        clean_px: Radius by which specks are opened, and cracks closed.
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
class PaperRule:
    """
    Thresholds of GS-LTS, sec. III-C.
    
    Args:
        tau_change: Share of the image that M_comb must exceed.
        tau_a: Area similarity of a relocation's two regions.
        tau_d: Their distance, as a share of the width of the image.
        epsilon: Depth difference of an addition or a removal, m.
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
    How changed objects are told from errors of sensor, pose and map.
    
    Args:
        step_m: A surface counts as nearer by so much, across it,
        step_per_m: by so much more times the square of its depth in m,
        step_px: and by what its depth changes within so many pixels.
        reach_px: By which edges may be misplaced.
        least_area_m2: Smaller surfaces, facing the camera, are no objects.
        least_area_px: Nor are smaller parts of the image.
        flat_area_m2: The same where colours alone differ,
        flat_color: summed over the channels, from all that is around.
        flat_step_m: A mean difference of depths that tells the side.
        least_contrast: Of brightness a pixel, across the outline of a flat object.
        alike: How likely the ends of a relocation must be one object, 0 to 1.
        certain: Less likely changes are not reported.
    """
    def __init__(self, *, step_m: typing.SupportsFloat | typing.SupportsIndex = 0.025, step_per_m: typing.SupportsFloat | typing.SupportsIndex = 0.006, step_px: typing.SupportsFloat | typing.SupportsIndex = 1.0, reach_px: int = 2, least_area_m2: typing.SupportsFloat | typing.SupportsIndex = 0.0006, least_area_px: int = 25, flat_area_m2: typing.SupportsFloat | typing.SupportsIndex = 0.0015, flat_color: typing.SupportsFloat | typing.SupportsIndex = 0.15, flat_step_m: typing.SupportsFloat | typing.SupportsIndex = 0.006, least_contrast: typing.SupportsFloat | typing.SupportsIndex = 0.03, alike: typing.SupportsFloat | typing.SupportsIndex = 0.25, certain: typing.SupportsFloat | typing.SupportsIndex = 0.5) -> None:
        ...
    @property
    def alike(self) -> float:
        ...
    @property
    def certain(self) -> float:
        ...
    @property
    def flat_area_m2(self) -> float:
        ...
    @property
    def flat_color(self) -> float:
        ...
    @property
    def flat_step_m(self) -> float:
        ...
    @property
    def least_area_m2(self) -> float:
        ...
    @property
    def least_area_px(self) -> int:
        ...
    @property
    def least_contrast(self) -> float:
        ...
    @property
    def reach_px(self) -> int:
        ...
    @property
    def step_m(self) -> float:
        ...
    @property
    def step_per_m(self) -> float:
        ...
    @property
    def step_px(self) -> float:
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
class Component:
    """
    Pixels of a mask that touch each other.
    """
    @property
    def area(self) -> int:
        """
        px
        """
    @property
    def label(self) -> int:
        """
        In the image of labels, from 1.
        """
    @property
    def u(self) -> float:
        """
        Centroid, px; the centre of the first pixel is 0.5.
        """
    @property
    def v(self) -> float:
        ...
class PaperChange:
    """
    What the rule of GS-LTS says, and why.
    """
    @property
    def first(self) -> Component:
        """
        R_1
        """
    @property
    def point_in_world(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        p_world, m.
        """
    @property
    def second(self) -> Component | None:
        """
        R_2 of a relocation.
        """
    @property
    def type(self) -> ChangeType:
        ...
class Evidence:
    """
    What tells an object that changed from an error.
    """
    @property
    def around_color(self) -> float:
        """
        The difference in colour around it, as a share of that within.
        """
    @property
    def around_m(self) -> float:
        """
        Median difference of the depths around it.
        """
    @property
    def attached(self) -> float:
        """
        Share of what is beside it whose depth goes on from it.
        """
    @property
    def correlation(self) -> float:
        """
        Of the brightness of both images, on it and beside it.
        """
    @property
    def differing(self) -> float:
        """
        Share of its pixels whose colours are not around in the other image.
        """
    @property
    def steps(self) -> float:
        """
        By which it is nearer, in units of the least that counts; if flat, of colour.
        """
    @property
    def thickness_m(self) -> float:
        """
        Of the largest disc in it.
        """
    @property
    def unexplained(self) -> float:
        """
        Mean difference in colour that more or less light does not explain.
        """
class Sights:
    """
    How the places of a surface look from where a map was made.
    
    Args:
        on: How often a frame saw a surface there,
        through: or looked through to something behind.
        seen: Share of the places of which there is either.
    """
    def __init__(self, *, on: typing.SupportsFloat | typing.SupportsIndex, through: typing.SupportsFloat | typing.SupportsIndex, seen: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...
    @property
    def on(self) -> float:
        ...
    @property
    def seen(self) -> float:
        ...
    @property
    def through(self) -> float:
        ...
class Surface:
    """
    The visible surface of an object, at one of the times.
    """
    @property
    def area_m2(self) -> float:
        """
        Facing the camera.
        """
    @property
    def area_px(self) -> int:
        ...
    @property
    def color(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        (3,) median, sRGB.
        """
    @property
    def depth_m(self) -> float:
        """
        Its median.
        """
    @property
    def evidence(self) -> Evidence:
        ...
    @property
    def flat(self) -> bool:
        """
        Whether colours alone tell of it.
        """
    @property
    def high(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        ...
    @property
    def label(self) -> int:
        """
        In the image of labels.
        """
    @property
    def low(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        (3,) corner of the box around most of it, world, m.
        """
    @property
    def point(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        (3,) its median, in the world, m.
        """
    @property
    def samples(self) -> list[typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]]:
        """
        [N] points (3,) of it, in the world, m.
        """
    @property
    def side(self) -> Side:
        """
        Seen in the map (BEFORE) or in the photo (AFTER).
        """
    @property
    def sights(self) -> Sights | None:
        """
        Of the samples; None if they are not known.
        """
    @sights.setter
    def sights(self, arg0: Sights | None) -> None:
        ...
    @property
    def step_m(self) -> float:
        """
        By which it is nearer than what is seen at the other time.
        """
class ObjectChange:
    """
    An object elsewhere, new or gone.
    """
    @property
    def after(self) -> Surface | None:
        """
        In the photo; None for a removal.
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
    What a camera saw, and what a map shows from there.
    
    Args:
        camera: Of all images.
        photo: [H,W,3] float32 sRGB, 0 to 1, as all others C-contiguous.
        rgb: [H,W,3] rendered, with the exposure of the photo.
        measured: [H,W] depth, z, m; 0 and NaN mean no measurement.
        rendered: [H,W] depth, z, m; 0 where nothing is.
        alpha: [H,W] opacity of the map, 0 to 1.
        similarity: [H,W] cosine of the features of both.
    
    Raises:
        ValueError: An array does not fit.
    """
    def __init__(self, *, camera: gslts._core.map.Camera, photo: numpy.ndarray, rgb: numpy.ndarray, measured: numpy.ndarray, rendered: numpy.ndarray, alpha: numpy.ndarray, similarity: numpy.ndarray) -> None:
        ...
class MaskSet:
    """
    Where both differ; see `masks_of`.
    """
def arrays_of(masks: MaskSet, camera: gslts._core.map.Camera) -> dict[str, numpy.ndarray]:
    """
    [H,W] bool each: known, pixel (M_pixel), feature (M_feat) and combined (M_comb).
    """
def certainty(surface: Surface) -> float:
    """
    0 to 1: how likely a surface is that of an object that changed.
    """
def changed_surfaces(views: Views, masks: MaskSet, rule: ObjectRule) -> tuple[list[Surface], numpy.typing.NDArray[numpy.int32]]:
    """
    What only one of map and photo shows.
    
    Returns:
        The surfaces, and the image [H,W] int32 of their labels; 0 where nothing changed.
    
    Raises:
        ValueError: A setting is out of range.
    """
def changes_of(surfaces: collections.abc.Sequence[Surface], rule: ObjectRule) -> list[ObjectChange]:
    """
    The changes that explain some surfaces, the most certain first.
    
    What vanished and what appeared are one object if they are alike in colours and size.
    
    Raises:
        ValueError: A setting is out of range.
    """
def differences_of(a: Surface, b: Surface) -> typing.Annotated[list[float], "FixedSize(2)"]:
    """
    What `likeness` weighs: how far histograms of colours, and areas, are apart.
    """
def features_of(surface: Surface) -> typing.Annotated[list[float], "FixedSize(15)"]:
    """
    What `certainty` weighs.
    """
def likeness(a: Surface, b: Surface) -> float:
    """
    0 to 1: how likely two surfaces are one object, both answers being as likely beforehand.
    """
def masks_of(views: Views, rule: MaskRule) -> MaskSet:
    """
    The dual branch of GS-LTS, sec. III-C.
    
    The paper prints M_feat = (similarity > tau_feat), which marks what did not change; here features
    differ where their similarity is low.
    
    Raises:
        ValueError: A setting is out of range.
    """
def paper_change(views: Views, masks: MaskSet, rule: PaperRule) -> tuple[PaperChange | None, numpy.typing.NDArray[numpy.int32]]:
    """
    Change type and key point as printed in GS-LTS, sec. III-C.
    
    Returns:
        The change, None if there is none, and the labels [H,W] int32 of the components.
    
    Raises:
        ValueError: A setting is out of range.
    """
