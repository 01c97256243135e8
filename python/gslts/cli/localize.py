"""The command `gslts localize`, and the option --localize of others."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.arguments import MapFolder
from gslts.cli.mapping import Threads, echo_skipped
from gslts.io.messages import to_line

if TYPE_CHECKING:
    from gslts.core.camera import Camera
    from gslts.core.frame import RgbdFrame
    from gslts.core.gaussian_map import GaussianMap
    from gslts.datasets import Dataset, Frame
    from gslts.localization.localizer import Localizer
    from gslts.localization.relocalizer import Localization, Relocalizer
    from gslts.types import Floats

# What a command needs is imported inside it, so that `gslts --help` answers at once.


Localize = Annotated[
    bool,
    typer.Option(
        "--localize",
        help="Localize the frames in the map first; their poses may drift or be missing.",
    ),
]


def localize(
    map_path: MapFolder,
    frames: Annotated[
        Path,
        typer.Argument(
            metavar="IMAGE|DATASET",
            help="A PNG or JPEG, or a data set, whose poses are not used.",
        ),
    ],
    depth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Depth of the image: a 16-bit PNG, mm.")
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Camera of the image: a .json file with fx, fy, cx, cy, width and height. "
            "Default: that of the map.",
        ),
    ] = None,
    fov_deg: Annotated[
        float | None, typer.Option(min=1, max=170, help="Horizontal field of view of the image.")
    ] = None,
    track: Annotated[
        bool, typer.Option("--track", help="Try the pose of the previous frame first.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object per frame.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="PNG of the first localized frame beside the map from its pose."),
    ] = None,
    halvings: Annotated[
        int | None,
        typer.Option(min=0, max=3, help="Halvings of an image: faster, less accurate."),
    ] = None,
    threads: Threads = 0,
) -> None:
    """Estimate the camera pose of images in a map, without a prior.

    Each is ok, ambiguous if other poses fit nearly as well, or lost. Poses of a data set serve for
    comparison only.

    Example: gslts localize out/map photo.jpg --fov-deg 69 --out out/photo.png

    Example: gslts localize out/map out/visit --track
    """
    from tqdm import tqdm

    from gslts.datasets import Dataset
    from gslts.localization.localizer import Localizer

    settings = {"threads": threads} | ({} if halvings is None else {"halvings": halvings})
    relocalizer = _relocalizer(map_path, settings)
    # Any other path is a data set.
    is_image = frames.suffix.lower() in (".png", ".jpg", ".jpeg") and not frames.is_dir()
    if is_image:
        image = _frame_of_image(map_path, frames, depth, camera, fov_deg)
        opened = Dataset(image.name, (image,), unposed=(image,))
    elif (depth, camera, fov_deg) != (None,) * 3:
        raise ValueError(f"{frames}: --depth, --camera and --fov-deg are for a PNG or JPEG only")
    else:
        opened = _open_frames(frames, posed=False)
    find = Localizer(relocalizer).localize if track else relocalizer.localize
    results: list[_Result] = []
    unposed = {entry.name for entry in opened.unposed}
    for entry in tqdm(opened.frames, desc="localizing", unit="frame", disable=None):
        given = None if entry.name in unposed else entry.camera.world_from_camera
        try:
            frame = _without_pose(entry.read())
            result = _Result.of(entry.name, frame, find, given)
        except (OSError, ValueError) as error:  # A damaged file does not stop the others.
            if is_image:
                raise
            result = _Result.of_error(entry.name, error, given)
        results.append(result)
        typer.echo(json.dumps(result.plain()) if as_json else result.line())
        if out is not None and result.found.world_from_camera is not None:
            pose = result.found.world_from_camera
            _write_side_by_side(out, relocalizer.gaussian_map, frame, pose, threads)
            out = None
    if not (is_image or as_json):
        typer.echo(_summary(results))


def localizer_of(map_path: Path, threads: int) -> Localizer:
    """Return a localizer in a map, for the option --localize.

    Args:
        map_path: Map folder.
        threads: Number of threads; 0 means one per hardware thread.

    Raises:
        OSError: A file cannot be read.
        ValueError: The path is no map, or the map has no landmarks.
    """
    from gslts.localization.localizer import Localizer

    return Localizer(_relocalizer(map_path, {"threads": threads}))


def read_frames(path: Path, localizer: Localizer | None) -> dict[str, RgbdFrame]:
    """Read the frames of a data set, localized if there is a localizer.

    Args:
        path: Data set.
        localizer: Localizer in the map; None keeps the poses of the data set.

    Returns:
        Frames by name, without those that are lost, ambiguous or damaged, which are named.

    Raises:
        OSError: The data set cannot be read.
        ValueError: It is damaged, or no frame is left.
    """
    return read_recording(path, localizer)[0]


def read_recording(
    path: Path, localizer: Localizer | None, *, needs_poses: bool = False
) -> tuple[dict[str, RgbdFrame], dict[str, RgbdFrame]]:
    """Read the frames of a data set as `read_frames` does, and also at its own poses.

    Args:
        path: Data set.
        localizer: Localizer in the map; None keeps the poses of the data set.
        needs_poses: True if its own poses are used; frames without are reported before reading.

    Returns:
        Frames by name in the map, and at the poses of the data set, also those that are lost.

    Raises:
        OSError: The data set cannot be read.
        ValueError: It is damaged, or no frame is left.
    """
    from tqdm import tqdm

    opened = _open_frames(path, posed=localizer is None)
    if localizer is not None and needs_poses:
        _require_poses(path, opened)
    unposed = {entry.name for entry in opened.unposed}
    in_map: dict[str, RgbdFrame] = {}
    given: dict[str, RgbdFrame] = {}
    for entry in tqdm(opened.frames, desc="reading", unit="frame", disable=None):
        try:
            own = entry.read()
            frame = own if localizer is None else localizer.localize_frame(own)
        except (OSError, ValueError) as error:  # A damaged file does not stop the others.
            typer.echo(f"skipped {entry.name}: {to_line(str(error))}", err=True)
            continue
        if entry.name not in unposed:
            given[entry.name] = own
        if frame.fault is None:
            in_map[entry.name] = frame
        else:
            typer.echo(f"skipped {entry.name}: {frame.fault}", err=True)
    if not in_map and localizer is None:
        raise ValueError(f"{path}: none of its frames can be read")
    if not in_map:
        raise ValueError(f"{path}: none of its frames was localized in the map")
    return in_map, given


def _require_poses(path: Path, opened: Dataset) -> None:
    """Report frames of a data set without a pose; if all have none, raise ValueError."""
    hint = f"gslts extend MAP {path} --poses estimate finds poses by the images"
    count = len(opened.unposed)
    if count == len(opened.frames):
        raise ValueError(f"{path}: its frames have no poses, which --extend needs; {hint}")
    if count:
        typer.echo(f"{count} frames have no pose and extend no map; {hint}", err=True)


def _relocalizer(map_path: Path, settings: dict[str, int]) -> Relocalizer:
    from gslts.localization.config import RelocalizationConfig
    from gslts.localization.landmark_files import require_landmarks
    from gslts.localization.relocalizer import Relocalizer
    from gslts.store.map_folder import read_map

    gaussian_map = read_map(map_path)
    config = RelocalizationConfig.model_validate(settings)
    return Relocalizer(gaussian_map, require_landmarks(map_path, gaussian_map), config)


def _open_frames(path: Path, *, posed: bool) -> Dataset:
    from gslts.datasets import open_dataset

    opened = open_dataset(path, posed=posed)
    echo_skipped(opened.left_out)
    return opened


def _frame_of_image(
    map_path: Path, image: Path, depth: Path | None, camera: Path | None, fov_deg: float | None
) -> Frame:
    from math import radians

    from gslts.core.camera import camera_from_fov
    from gslts.datasets.image_frame import ImageFrame
    from gslts.io.image_files import image_size
    from gslts.store.camera_files import read_intrinsics

    if camera is not None and fov_deg is not None:
        raise ValueError("--camera and --fov-deg exclude each other")
    size = image_size(image)
    if camera is not None:
        lens = read_intrinsics(camera)
    elif fov_deg is not None:
        lens = camera_from_fov(*size, radians(fov_deg))
    else:
        lens = _lens_of_map(map_path, image, size)
    return ImageFrame(image, lens, depth)


def _lens_of_map(map_path: Path, image: Path, size: tuple[int, int]) -> Camera:
    """Return the first camera of the map whose images have that size."""
    from gslts.store.camera_files import cameras_of_map

    cameras = cameras_of_map(map_path).values()
    found = next((camera for camera in cameras if (camera.width, camera.height) == size), None)
    if found is None:
        raise ValueError(
            f"{image}: no camera of {map_path} has {size[0]} x {size[1]} px: give --camera or "
            "--fov-deg"
        )
    return found


def _write_side_by_side(
    out: Path, gaussian_map: GaussianMap, frame: RgbdFrame, pose: Floats, threads: int
) -> None:
    from gslts.io.image_files import write_image
    from gslts.localization.side_by_side import side_by_side

    out.parent.mkdir(parents=True, exist_ok=True)
    write_image(out, side_by_side(gaussian_map, frame, pose, threads))
    typer.echo(f"see {out}", err=True)


def _without_pose(frame: RgbdFrame) -> RgbdFrame:
    """Return a frame in the coordinates of its camera, as of a robot without odometry."""
    import numpy as np

    from gslts.localization.localizer import in_world

    camera_from_world = np.asarray(np.linalg.inv(frame.camera.world_from_camera), np.float64)
    return in_world(frame, camera_from_world)


@dataclass(frozen=True, eq=False)
class _Result:
    """Localization of one frame.

    Attributes:
        name: Name of the frame.
        found: Estimated pose.
        seconds: Time of the localization, s.
        given: [4,4] world_from_camera of the data set, m; None if there is none.
    """

    name: str
    found: Localization
    seconds: float
    given: Floats | None

    @classmethod
    def of(
        cls,
        name: str,
        frame: RgbdFrame,
        find: Callable[[RgbdFrame], Localization],
        given: Floats | None,
    ) -> _Result:
        """Localize a frame and measure the time."""
        start_s = time.perf_counter()
        found = find(frame)
        return cls(name, found, time.perf_counter() - start_s, given)

    @classmethod
    def of_error(cls, name: str, error: Exception, given: Floats | None) -> _Result:
        """Return a lost frame that cannot be read."""
        from gslts.localization.relocalizer import Localization

        return cls(name, Localization("lost", to_line(str(error))), 0.0, given)

    @property
    def error(self) -> tuple[float, float] | None:
        """Distance of the pose from that of the data set, m and rad."""
        from gslts.core.se3 import pose_distance

        pose = self.found.world_from_camera
        return None if pose is None or self.given is None else pose_distance(self.given, pose)

    def line(self) -> str:
        """Return the result as a line of text."""
        from gslts.localization.pose_quality import pose_stds

        found = self.found
        if found.status == "lost":
            return f"{self.name}: lost: {found.reason}"
        assert found.world_from_camera is not None
        position = _position(found.world_from_camera)
        if found.status == "ambiguous":
            others = " or ".join(_position(pose) for pose in found.others)
            return f"{self.name}: ambiguous: at {position} or {others}: {found.reason}"
        assert found.covariance is not None
        std_m, std_rad = pose_stds(found.covariance)
        support = f"{found.inliers} keypoints" if found.inliers else "tracked"
        error = "" if self.error is None else f"; {_sizes(*self.error)} from the given pose"
        return (
            f"{self.name}: ok at {position}, +- {_sizes(std_m, std_rad, ', +- ')}, {support}, "
            f"{self.seconds:.2f} s{error}"
        )

    def plain(self) -> dict[str, Any]:
        """Return the result as values of JSON."""
        found, error = self.found, self.error
        pose, covariance = found.world_from_camera, found.covariance
        return {
            "frame": self.name,
            "status": found.status,
            "reason": found.reason,
            "world_from_camera": None if pose is None else pose.tolist(),
            "covariance": None if covariance is None else covariance.tolist(),
            "inliers": found.inliers,
            "residual": None if pose is None else found.residual,
            "others": [other.tolist() for other in found.others],
            "seconds": self.seconds,
            "error_m": None if error is None else error[0],
            "error_rad": None if error is None else error[1],
        }


def _summary(results: Sequence[_Result]) -> str:
    import numpy as np

    statuses = [result.found.status for result in results]
    errors = [result.error for result in results if result.error and result.found.status == "ok"]
    median_error = f", {_sizes(*np.median(errors, axis=0))} from the given poses" if errors else ""
    ok, ambiguous, lost = (statuses.count(status) for status in ("ok", "ambiguous", "lost"))
    return (
        f"{ok} of {len(results)} frames ok, {ambiguous} ambiguous, {lost} lost; medians: "
        f"{np.median([result.seconds for result in results]):.2f} s{median_error}"
    )


def _sizes(metres: float, angle_rad: float, between: str = " and ") -> str:
    import math

    length = f"{1000 * metres:.0f} mm" if metres < 1 else f"{metres:.2f} m"
    return f"{length}{between}{math.degrees(angle_rad):.2f} degrees"


def _position(pose: Floats) -> str:
    x, y, z = pose[:3, 3]
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m"
