"""The command `gslts locate`, and the option --locate of others."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.mapping import Threads
from gslts.cli.tasks import Folder

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from gslts.core.camera import Camera
    from gslts.core.frame import RgbdFrame
    from gslts.datasets import Dataset, Frame
    from gslts.localization.localizer import Localizer
    from gslts.localization.relocalizer import Localization, Relocalizer

    Floats = NDArray[np.float64]

# What a command needs is imported inside it, so that `gslts --help` answers at once.

PICTURES = (".png", ".jpg", ".jpeg")

Locate = Annotated[
    bool,
    typer.Option(
        "--locate",
        help="Poses are those of any odometry, or missing: the map tells where it was.",
    ),
]


def locate(
    map_path: Folder,
    frames: Annotated[
        Path,
        typer.Argument(
            metavar="IMAGE|DATASET",
            help="A PNG or JPEG; or a data set, whose poses do not count.",
        ),
    ],
    depth: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of the image: a 16-bit PNG, mm.")
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Of the image: a .json file with fx, fy, cx, cy, width and height. Default: that "
            "of the map.",
        ),
    ] = None,
    fov_deg: Annotated[
        float | None, typer.Option(min=1, max=170, help="Of the image, horizontal.")
    ] = None,
    track: Annotated[
        bool, typer.Option("--track", help="Look for a frame first where the last one was found.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a frame.")] = False,
    picture: Annotated[
        Path | None,
        typer.Option(help="PNG of the first frame that was found, beside the map from there."),
    ] = None,
    halvings: Annotated[
        int | None,
        typer.Option(min=0, max=3, help="Of the sides of an image; fewer take longer."),
    ] = None,
    threads: Threads = 0,
) -> None:
    """Tell where in a map an image was taken, and how certain that is.

    It is ok, or ambiguous where other places look nearly the same, or lost. How far the places
    found are from the poses of a data set is told as well.

    Example: gslts locate out/map photo.jpg --fov-deg 69 --picture out/photo.png

    Example: gslts locate out/map out/visit --track
    """
    from PIL import Image
    from tqdm import tqdm

    from gslts.datasets import Dataset
    from gslts.localization.localizer import Localizer
    from gslts.localization.relocalizer import Localization
    from gslts.localization.side_by_side import side_by_side

    settings = {"threads": threads} | ({} if halvings is None else {"halvings": halvings})
    relocalizer = _relocalizer(map_path, settings)
    is_image = frames.suffix.lower() in PICTURES and not frames.is_dir()
    if is_image:
        image = _frame_of_image(map_path, frames, depth, camera, fov_deg)
        opened = Dataset(image.name, (image,), unposed=(image,))
    elif (depth, camera, fov_deg) != (None,) * 3:
        raise ValueError(f"{frames}: --depth, --camera and --fov-deg are for a PNG or JPEG only")
    else:
        opened = _opened(frames, posed=False)
    find = Localizer(relocalizer).locate if track else relocalizer.locate
    told: list[_Told] = []
    unposed = {one.name for one in opened.unposed}
    for frame in tqdm(opened.frames, desc="locating", unit="frame", disable=None):
        start_s = time.perf_counter()
        try:
            read = _without_pose(frame.read())
            start_s = time.perf_counter()
            found = find(read)
        except (OSError, ValueError) as error:  # Of a damaged file; the others may be whole.
            if is_image:
                raise
            found = Localization("lost", " ".join(str(error).split()))
        pose = None if frame.name in unposed else frame.camera.world_from_camera
        told.append(_Told(frame.name, found, time.perf_counter() - start_s, pose))
        typer.echo(json.dumps(told[-1].plain()) if as_json else told[-1].line())
        if picture is not None and found.world_from_camera is not None:
            pose = found.world_from_camera
            beside = side_by_side(relocalizer.gaussian_map, read, pose, threads)
            picture.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(beside).save(picture)
            typer.echo(f"see {picture}", err=True)
            picture = None
    if not (is_image or as_json):
        typer.echo(_summary(told))


def localizer_of(map_path: Path, threads: int) -> Localizer:
    """What the option --locate asks for.

    Raises:
        OSError: A file cannot be read.
        ValueError: It is no map, or has no landmarks.
    """
    from gslts.localization.localizer import Localizer

    return Localizer(_relocalizer(map_path, {"threads": threads}))


def read_frames(path: Path, localizer: Localizer | None) -> dict[str, RgbdFrame]:
    """The frames of a data set by name; with a localizer those that it finds, where it finds them.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged, or no frame was found.
    """
    from tqdm import tqdm

    read: dict[str, RgbdFrame] = {}
    opened = _opened(path, posed=localizer is None)
    for one in tqdm(opened.frames, desc="reading", unit="frame", disable=None):
        frame = one.read() if localizer is None else localizer.located(one.read())
        if frame.fault is None:
            read[one.name] = frame
        else:
            typer.echo(f"skipped {one.name}: {frame.fault}", err=True)
    if not read:
        raise ValueError(f"{path}: none of its frames was found in the map")
    return read


def _relocalizer(map_path: Path, settings: dict[str, int]) -> Relocalizer:
    from gslts.localization.config import RelocalizationConfig
    from gslts.localization.landmark_files import require_landmarks
    from gslts.localization.relocalizer import Relocalizer
    from gslts.store.map_folder import read_map

    gaussian_map = read_map(map_path)
    config = RelocalizationConfig.model_validate(settings)
    return Relocalizer(gaussian_map, require_landmarks(map_path, gaussian_map), config)


def _opened(path: Path, *, posed: bool) -> Dataset:
    from gslts.datasets import open_dataset

    opened = open_dataset(path, posed=posed)
    for reason in opened.skipped:
        typer.echo(f"skipped {reason}", err=True)
    return opened


def _frame_of_image(
    map_path: Path, image: Path, depth: Path | None, camera: Path | None, fov_deg: float | None
) -> Frame:
    from math import radians

    from gslts.core.camera import camera_from_fov
    from gslts.datasets.dataset import ImageFrame, image_size
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
    """The first of the map's cameras whose pictures have a size."""
    from gslts.store.camera_files import cameras_of_map

    cameras = cameras_of_map(map_path).values()
    found = next((one for one in cameras if (one.width, one.height) == size), None)
    if found is None:
        raise ValueError(
            f"{image}: no camera of {map_path} has {size[0]} x {size[1]} px: give --camera or "
            "--fov-deg"
        )
    return found


def _without_pose(frame: RgbdFrame) -> RgbdFrame:
    """In the world of its camera: as if the robot had never moved."""
    import numpy as np

    from gslts.localization.localizer import in_world

    camera_from_world = np.asarray(np.linalg.inv(frame.camera.world_from_camera), np.float64)
    return in_world(frame, camera_from_world)


@dataclass(frozen=True, eq=False)
class _Told:
    """Of one frame.

    Attributes:
        name: Of the frame.
        found: Where it was taken.
        seconds: That this took.
        given: [4,4] pose of the data set; None if there is none.
    """

    name: str
    found: Localization
    seconds: float
    given: Floats | None

    @property
    def off(self) -> tuple[float, float] | None:
        """By how much the pose of the data set is another one, m and rad."""
        from gslts.core.se3 import pose_distance

        pose = self.found.world_from_camera
        return None if pose is None or self.given is None else pose_distance(self.given, pose)

    def line(self) -> str:
        """In words."""
        from gslts.localization.pose_quality import stds_of

        found = self.found
        if found.status == "lost":
            return f"{self.name}: lost: {found.reason}"
        assert found.world_from_camera is not None
        place = _place(found.world_from_camera)
        if found.status == "ambiguous":
            others = " or ".join(_place(one) for one in found.others)
            return f"{self.name}: ambiguous: at {place} or {others}: {found.reason}"
        assert found.covariance is not None
        std_m, std_rad = stds_of(found.covariance)
        how = f"{found.inliers} corners" if found.inliers else "tracked"
        off = "" if self.off is None else f"; {_sizes(*self.off)} from the pose given"
        return (
            f"{self.name}: ok at {place}, +- {_sizes(std_m, std_rad, ', +- ')}, {how}, "
            f"{self.seconds:.2f} s{off}"
        )

    def plain(self) -> dict[str, Any]:
        """In values of JSON."""
        found, off = self.found, self.off
        pose, covariance = found.world_from_camera, found.covariance
        return {
            "frame": self.name,
            "status": found.status,
            "reason": found.reason,
            "world_from_camera": None if pose is None else pose.tolist(),
            "covariance": None if covariance is None else covariance.tolist(),
            "inliers": found.inliers,
            "residual": None if pose is None else found.residual,
            "others": [one.tolist() for one in found.others],
            "seconds": self.seconds,
            "off_m": None if off is None else off[0],
            "off_rad": None if off is None else off[1],
        }


def _summary(told: Sequence[_Told]) -> str:
    import numpy as np

    statuses = [one.found.status for one in told]
    offs = [one.off for one in told if one.off is not None and one.found.status == "ok"]
    of_data = f", {_sizes(*np.median(offs, axis=0))} from the poses given" if offs else ""
    ok, ambiguous, lost = (statuses.count(one) for one in ("ok", "ambiguous", "lost"))
    return (
        f"{ok} of {len(told)} frames ok, {ambiguous} ambiguous, {lost} lost; medians: "
        f"{np.median([one.seconds for one in told]):.2f} s{of_data}"
    )


def _sizes(metres: float, angle_rad: float, between: str = " and ") -> str:
    import math

    length = f"{1000 * metres:.0f} mm" if metres < 1 else f"{metres:.2f} m"
    return f"{length}{between}{math.degrees(angle_rad):.2f} degrees"


def _place(pose: Floats) -> str:
    x, y, z = pose[:3, 3]
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m"
