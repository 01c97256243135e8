"""Typed causes: why a version of a map exists, or why an update was rejected.

The index stores a cause as one JSON object. Its `kind` selects the model, and its `schema_version`
the layout. This module does not import NumPy, because `gslts log` reads causes and must start fast.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    JsonValue,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from gslts.io.messages import first_problem

ChangeKind = Literal["addition", "removal", "relocation", "shift"]
Count = Annotated[int, Field(ge=0)]
Number = Annotated[int, Field(ge=1)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Point = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Box = tuple[Point, Point]
"""Lower and upper corner of an axis-aligned box in the world frame, m."""
Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Motion = tuple[Row, Row, Row, Row]
"""[4,4] rigid transform in the world frame, m: x_after = motion @ x_before."""


class Record(BaseModel):
    """Base of all records of a store: immutable, and unknown fields are an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class CameraRecord(Record):
    """A pinhole camera in JSON.

    Attributes:
        fx, fy, cx, cy: Focal lengths and principal point, px.
        width, height: Image size, px.
        world_from_camera: [4,4] rigid transform, m, camera axes of OpenCV.
    """

    fx: FiniteFloat
    fy: FiniteFloat
    cx: FiniteFloat
    cy: FiniteFloat
    width: Number
    height: Number
    world_from_camera: tuple[Row, Row, Row, Row]


class UpdateFrame(CameraRecord):
    """Camera of a frame that an update used.

    Attributes:
        new_viewpoint: True if no earlier frame of the map has a similar pose; only such cameras
            become training cameras of the map.
    """

    new_viewpoint: bool


class Appearance(Record):
    """Colours of a surface, by which the detector recognizes an object.

    Attributes:
        area_m2: Area facing the camera, m^2; in records of earlier versions only.
        colors: Bins of the colour histogram that are not empty, each in five hexadecimal digits:
            three for the number of the bin, two for the square root of its share, 255 for 1.
    """

    area_m2: Annotated[FiniteFloat, Field(ge=0)] | None = None
    colors: Annotated[str, Field(pattern="^([0-9a-f]{5})*$")]


class ChangeRecord(Record):
    """An object change as the detector reported it.

    Attributes:
        kind: Type of the change.
        confidence: Calibrated probability that the change is real, 0 to 1.
        boxes: Box of the object before and after the change; None where there is no object.
        appearances: Appearance of the object before and after the change; None where unknown.
        motion: Motion of a shift; None for other kinds.
    """

    kind: ChangeKind
    confidence: FiniteFloat
    boxes: tuple[Box | None, Box | None]
    appearances: tuple[Appearance | None, Appearance | None] = (None, None)
    motion: Motion | None = None

    @model_validator(mode="after")
    def _motion_fits_kind(self) -> Self:
        require_motion(self.kind, self.motion)
        return self


class UpdateRecord(Record):
    """Record of an update: timings, counts, and the reason if it was rejected.

    Attributes:
        rejected: Reason for leaving the map unchanged; None if the update was accepted.
        kinds: Types of the changes to be made.
        training_views, validation_views: Number of views used for the update, and of views held
            out to accept or reject it.
        skipped: Reasons for skipping other frames.
        removed, added, refined: Number of Gaussians.
        iterations: Refinement steps.
        psnr_before_db, psnr_after_db: PSNR around the change in the validation views, before these
            may train it as well; None without such a view.
        seconds: Run time of each stage, s.
    """

    rejected: str | None = None
    kinds: tuple[ChangeKind, ...] = ()
    training_views: Count = 0
    validation_views: Count = 0
    skipped: tuple[str, ...] = ()
    removed: Count = 0
    added: Count = 0
    refined: Count = 0
    iterations: Count = 0
    psnr_before_db: FiniteFloat | None = None
    psnr_after_db: FiniteFloat | None = None
    seconds: dict[str, FiniteFloat] = {}


class _Cause(Record):
    """Fields of every cause.

    Attributes:
        schema_version: Layout of the cause.
    """

    schema_version: Literal[1] = 1


class MappingCause(_Cause):
    """The first version, made by mapping a recording.

    Attributes:
        dataset: Name of the recording; None if unknown.
    """

    kind: Literal["mapping"] = "mapping"
    dataset: str | None = None


class ImportCause(_Cause):
    """The first version, imported from a file of another program.

    Attributes:
        file: Name of the file.
    """

    kind: Literal["import"] = "import"
    file: str


class UpdateCause(_Cause):
    """A version that shows object changes.

    Attributes:
        round: Round of the robot, counted from 0; None outside of rounds.
        changes: Changes that the new version shows.
        record: Timings and counts.
        config: Settings of the update, `UpdateConfig` in JSON.
        frames: Cameras of the collected frames.
        landmarks: SHA-256 of the file of landmarks that the update added; None if it added none.
    """

    kind: Literal["update"] = "update"
    round: Count | None = None
    changes: tuple[ChangeRecord, ...] = ()
    record: UpdateRecord = UpdateRecord()
    config: dict[str, JsonValue] = {}
    frames: tuple[UpdateFrame, ...] = ()
    landmarks: Sha256 | None = None


class ExtensionRecord(Record):
    """Record of an extension.

    Attributes:
        frames: Number of frames of the recording,
        placed: of those whose pose in the map was found,
        new: and of those that show new space.
        added, refined: Number of new Gaussians, and of old ones that were refined with them.
        iterations: Optimization steps.
        test_psnr_db: PSNR of the test frames; None without any.
        seconds: Run time of each stage, s.
    """

    frames: Count
    placed: Count
    new: Count
    added: Count
    refined: Count
    iterations: Count
    test_psnr_db: FiniteFloat | None
    seconds: dict[str, FiniteFloat]


class ExtensionCause(_Cause):
    """A version that shows space which the one before did not know.

    Attributes:
        dataset: Name of the recording.
        record: Counts, times and quality.
        names, frames: Names of the training frames, and their cameras in the map.
        test_frames: Cameras of the test frames in the map, by name.
        landmarks: SHA-256 of the file of landmarks that were added; None if there are none.
        measurements: SHA-256 of the file of its measurements; older versions have none.
    """

    kind: Literal["extension"] = "extension"
    dataset: str
    record: ExtensionRecord
    names: tuple[str, ...]
    frames: tuple[UpdateFrame, ...]
    test_frames: dict[str, CameraRecord]
    landmarks: Sha256 | None
    measurements: Sha256 | None = None


class ConsolidationRecord(Record):
    """Record of a consolidation.

    Attributes:
        views, held_out: Number of training views, and of those held out to judge the result.
        refined, removed: Number of Gaussians.
        iterations: Optimization steps.
        psnr_before_db, psnr_after_db: PSNR around past changes in the test views.
        seconds: Run time of each stage, s.
    """

    views: Count
    held_out: Count
    refined: Count
    removed: Count
    iterations: Count
    psnr_before_db: FiniteFloat | None
    psnr_after_db: FiniteFloat | None
    seconds: dict[str, FiniteFloat]


class ConsolidationCause(_Cause):
    """A version in which Gaussians around past changes were refined by new views.

    Attributes:
        since: Number of the version whose changes are the first ones.
        record: Counts, times and quality.
        frames: Cameras of the views.
    """

    kind: Literal["consolidation"] = "consolidation"
    since: Number
    record: ConsolidationRecord
    frames: tuple[UpdateFrame, ...]


ViewsCause = UpdateCause | ExtensionCause | ConsolidationCause
"""Cause of a version that was made from views of a later time than the first one."""


class RejectedUpdateCause(_Cause):
    """An update that was tried and left the map unchanged.

    Attributes:
        round: Round of the robot, counted from 0; None outside of rounds.
        changes: Changes that the map does not show.
        record: Timings, counts, and the reason.
    """

    kind: Literal["rejected update"] = "rejected update"
    round: Count | None = None
    changes: tuple[ChangeRecord, ...] = ()
    record: UpdateRecord

    @model_validator(mode="after")
    def _has_reason(self) -> Self:
        if self.record.rejected is None:
            raise ValueError("record.rejected: a rejected update needs a reason")
        return self

    @property
    def reason(self) -> str:
        """Reason for leaving the map unchanged."""
        return self.record.rejected or ""


class RestoreCause(_Cause):
    """An old version that became the newest one again.

    Attributes:
        version: Number of the restored version.
    """

    kind: Literal["restore"] = "restore"
    version: Number


class SemanticsCause(_Cause):
    """A version with new semantic features.

    Attributes:
        source: Model that gave the embeddings or classes.
        dataset: Recording that the features were computed from.
        levels, code_dims: Levels of masks, and length of the code of each.
        names: Words that the source knows, the classes of a detector; empty for an open vocabulary.
        models, layout: Folder or file of each model; layout of a detector's outputs, if given.
        autoencoder: SHA-256 of the file of the autoencoder; None for a detector.
    """

    kind: Literal["semantics"] = "semantics"
    source: Literal["oracle", "clip", "detector"]
    dataset: str
    levels: Annotated[int, Field(ge=1, le=3)]
    code_dims: Annotated[int, Field(ge=2, le=129)]
    names: tuple[str, ...]
    models: dict[str, str] = {}
    layout: str | None = None
    autoencoder: Sha256 | None = None


VersionCause = Annotated[
    MappingCause | ImportCause | ViewsCause | RestoreCause | SemanticsCause,
    Field(discriminator="kind"),
]
_VERSION_CAUSE: TypeAdapter[VersionCause] = TypeAdapter(VersionCause)
"""Parser of `VersionCause`."""


def version_cause_from_json(text: str) -> VersionCause:
    """Parse the cause of a version.

    Args:
        text: One JSON object.

    Raises:
        ValueError: The text is no cause that this version of gslts knows; one line says why.
    """
    try:
        return _VERSION_CAUSE.validate_json(text)
    except ValidationError as error:
        raise ValueError(f"cause: {first_problem(error)}") from None


def rejected_cause_from_json(text: str) -> RejectedUpdateCause:
    """Parse the cause of a rejected update.

    Args:
        text: One JSON object.

    Raises:
        ValueError: The text is no such cause; one line says why.
    """
    try:
        return RejectedUpdateCause.model_validate_json(text)
    except ValidationError as error:
        raise ValueError(f"cause: {first_problem(error)}") from None


def require_motion(kind: ChangeKind, motion: Motion | None) -> None:
    """Check that a shift has a motion, and that other changes have none.

    Args:
        kind: Type of the change.
        motion: Its motion, or None.

    Raises:
        ValueError: They do not fit.
    """
    if (motion is not None) != (kind == "shift"):
        raise ValueError(f"motion: a shift needs one, other kinds have none, got {kind}")
