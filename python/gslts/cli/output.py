"""The commands `gslts render` and `gslts export`: what a person gets from a map."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gslts.cli.mapping import Map, Threads

if TYPE_CHECKING:
    from gslts.core.camera import Camera
    from gslts.core.gaussian_map import GaussianMap
    from gslts.io.images import RgbImage

# What a command needs is imported inside it, so that `gslts --help` answers at once.

Pose = Annotated[
    str | None,
    typer.Option(
        help="One view: a .json file with world_from_camera and, if wanted, fx, fy, cx, cy, width "
        "and height; or the name of one of the map's own cameras."
    ),
]

Range = tuple[float, float]

DEFAULT_SIZE, DEFAULT_FOV_DEG = (640, 480), 70.0
COARSE, SAMPLES = 4, 8
"""So many views at a fraction of their size tell the range of depths."""
WORTH_TELLING_M = 1e-3
"""Centres that a format rounds by more are noted."""


def render(
    map_path: Map,
    out: Annotated[Path, typer.Option(help="A new folder for PNGs, or an .mp4 file.")],
    pose: Pose = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(
            help="Many views: a text file with lines of time tx ty tz qx qy qz qw as in TUM RGB-D, "
            "or a .json file like the cameras.json of a map."
        ),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=1, help="Of the way around the map, if no view is given.")
    ] = 150,
    depth: Annotated[bool, typer.Option("--depth", help="Coloured depth as well.")] = False,
    width: Annotated[int | None, typer.Option(min=16, max=8192, help="px")] = None,
    height: Annotated[int | None, typer.Option(min=16, max=8192, help="px")] = None,
    fov_deg: Annotated[
        float | None,
        typer.Option(min=1, max=170, help="Horizontal; with it, other intrinsics are not used."),
    ] = None,
    threads: Threads = 0,
) -> None:
    """Render a map from one view, along a trajectory, or on a way around it.

    Without --pose or --trajectory the way leads smoothly along the map's own cameras. Given any of
    --width, --height and --fov-deg, views have these (640, 480 and 70 where not given) in place of
    their own intrinsics.

    Example: gslts render out/map --out out/around.mp4
    """
    from tqdm import tqdm

    from gslts.store.map_folder import read_map

    if pose is not None and trajectory is not None:
        raise ValueError("--pose and --trajectory exclude each other")
    is_video = out.suffix.lower() == ".mp4"
    depth_out = out.with_name(f"{out.stem}_depth.mp4")
    for path in (out, depth_out) if is_video else ():
        if path.exists():
            raise FileExistsError(f"{path} is there already")
    gaussian_map = read_map(map_path)
    given = None if (width, height, fov_deg) == (None,) * 3 else _lens(width, height, fov_deg)
    cameras = _views(map_path, pose, trajectory, frames, given)
    if is_video and len({(camera.width, camera.height) for camera in cameras}) > 1:
        raise ValueError(f"{out}: a video needs views of one size: give --width and --height")
    range_m = _depth_range(gaussian_map, cameras, threads) if depth else None
    with tqdm(cameras, desc="rendering", unit="view", disable=None) as bar:
        pictures = _pictures(gaussian_map, bar, range_m, threads)
        if is_video:
            size = (cameras[0].width, cameras[0].height)
            _write_videos(pictures, size, out, depth_out if depth else None)
        else:
            _write_pngs(pictures, out)
    scale = f"; depth from {range_m[0]:.2f} m, red, to {range_m[1]:.2f} m, blue" if range_m else ""
    typer.echo(f"wrote {len(cameras)} view(s) to {out}{scale}")


def export(
    map_path: Map,
    out: Annotated[Path, typer.Argument(help="A new file ending in .ply or .splat.")],
) -> None:
    """Write a map as a PLY file of 3DGS, or as a .splat file for viewers on the web.

    Example: gslts export out/map out/map.splat
    """
    from gslts.io.ply import write_ply
    from gslts.io.splat import rounding_m, write_splat
    from gslts.store.map_folder import read_map

    kind = out.suffix.lower()
    if kind not in (".ply", ".splat"):
        raise ValueError(f"{out}: must end in .ply or .splat")
    if out.exists():
        raise FileExistsError(f"{out} is there already")
    gaussian_map = read_map(map_path)
    lost = ""
    out.parent.mkdir(parents=True, exist_ok=True)
    if kind == ".ply":
        write_ply(gaussian_map, out)
    else:
        write_splat(gaussian_map, out)
        if gaussian_map.sh_degree > 0:
            lost = (
                f"; colours are those of SH degree 0, degrees to {gaussian_map.sh_degree} do not "
                "fit into the format"
            )
        if rounding_m(gaussian_map) > WORTH_TELLING_M:
            lost += (
                f"; centres are rounded by up to {1000 * rounding_m(gaussian_map):.3g} mm, as the "
                "format counts from the world's origin"
            )
    typer.echo(f"wrote {out}: {gaussian_map.size} Gaussians, {out.stat().st_size} bytes{lost}")


def find_camera(map_path: Path, pose: str | None) -> Camera:
    """The camera of the option --pose; without it, the first of the map's own.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such camera.
    """
    return _views(map_path, pose, None, 1, None)[0] if pose else next(iter(_own(map_path).values()))


def _views(
    map_path: Path, pose: str | None, trajectory: Path | None, frames: int, given: Camera | None
) -> list[Camera]:
    """The cameras to render from, with the given intrinsics instead of their own."""
    from gslts.core.camera import at_pose
    from gslts.rendering.orbit import orbit
    from gslts.store.camera_files import read_camera, read_camera_path

    if pose is not None and Path(pose).suffix.lower() == ".json":
        cameras = [read_camera(Path(pose), given or _usual_lens(map_path))]
    elif pose is not None:
        own = _own(map_path)
        if pose not in own:
            some = ", ".join(repr(name) for name in list(own)[:3])
            raise ValueError(f"{map_path}: there is no camera {pose!r}; there are {some}, ...")
        cameras = [own[pose]]
    elif trajectory is not None:
        cameras = read_camera_path(trajectory, given or _usual_lens(map_path))
    else:
        cameras = orbit(list(_own(map_path).values()), frames)
    if given is None:
        return cameras
    return [at_pose(given, camera.world_from_camera) for camera in cameras]


def _own(map_path: Path) -> dict[str, Camera]:
    """The cameras of a map folder, at least one."""
    from gslts.store.camera_files import cameras_of_map

    cameras = cameras_of_map(map_path)
    if not cameras:
        raise ValueError(f"{map_path}: it has no cameras of its own, a view must be given")
    return cameras


def _usual_lens(map_path: Path) -> Camera:
    """For poses without intrinsics: those of the map's first camera, if it has cameras."""
    from gslts.store.camera_files import cameras_of_map

    return next(iter(cameras_of_map(map_path).values()), _lens(None, None, None))


def _lens(width: int | None, height: int | None, fov_deg: float | None) -> Camera:
    from math import radians

    from gslts.core.camera import camera_from_fov

    return camera_from_fov(
        width or DEFAULT_SIZE[0], height or DEFAULT_SIZE[1], radians(fov_deg or DEFAULT_FOV_DEG)
    )


def _depth_range(gaussian_map: GaussianMap, cameras: list[Camera], threads: int) -> Range:
    """Of all views, so that the colours of a video keep their meaning; m."""
    import numpy as np

    from gslts.core.camera import downscale
    from gslts.io.images import depth_range
    from gslts.rendering.rasterizer import Rasterizer, RenderOptions

    rasterizer, options = Rasterizer(gaussian_map.dtype), RenderOptions(threads=threads)
    sample = cameras[:: max(1, len(cameras) // SAMPLES)]
    coarse = (downscale(camera, COARSE) for camera in sample)
    depths = [rasterizer.forward(gaussian_map, camera, options).depth for camera in coarse]
    return depth_range(np.concatenate([depth.ravel() for depth in depths]))


def _pictures(
    gaussian_map: GaussianMap, cameras: Iterable[Camera], range_m: Range | None, threads: int
) -> Iterator[tuple[RgbImage, RgbImage | None]]:
    """Colour, and depth if it has a range."""
    from gslts.io.images import depth_image, to_rgb8
    from gslts.rendering.rasterizer import Rasterizer, RenderOptions

    rasterizer, options = Rasterizer(gaussian_map.dtype), RenderOptions(threads=threads)
    for camera in cameras:
        images = rasterizer.forward(gaussian_map, camera, options)
        of_depth = None if range_m is None else depth_image(images.depth, range_m)
        yield to_rgb8(images.rgb), of_depth


def _write_videos(
    pictures: Iterable[tuple[RgbImage, RgbImage | None]],
    size: tuple[int, int],
    out: Path,
    depth_out: Path | None,
) -> None:
    from gslts.io.video import Video

    out.parent.mkdir(parents=True, exist_ok=True)
    with (
        Video(out, *size) as video,
        nullcontext() if depth_out is None else Video(depth_out, *size) as depth_video,
    ):
        for picture, of_depth in pictures:
            video.add(picture)
            if depth_video is not None and of_depth is not None:
                depth_video.add(of_depth)


def _write_pngs(pictures: Iterable[tuple[RgbImage, RgbImage | None]], out: Path) -> None:
    """00000.png, 00000_depth.png, ...: names from files are no names for files."""
    from PIL import Image

    from gslts.io.atomic_files import empty_folder

    empty_folder(out)
    for number, (picture, of_depth) in enumerate(pictures):
        Image.fromarray(picture).save(out / f"{number:05}.png")
        if of_depth is not None:
            Image.fromarray(of_depth).save(out / f"{number:05}_depth.png")
