"""Commands `gslts render` and `gslts export`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.arguments import Map
from gslts.cli.mapping import Threads

if TYPE_CHECKING:
    from gslts.core.camera import Camera
    from gslts.core.gaussian_map import GaussianMap
    from gslts.io.images import RgbImage

# Commands import what they need inside, so that `gslts --help` is fast.

Pose = Annotated[
    str | None,
    typer.Option(
        help="Single view: a .json file with world_from_camera and optional fx, fy, cx, cy, width "
        "and height; or the name of one of the map's cameras."
    ),
]

Range = tuple[float, float]

DEFAULT_SIZE, DEFAULT_FOV_DEG = (640, 480), 70.0
"""Image size, px, and horizontal field of view of views without intrinsics: those of a Kinect."""
COARSE, SAMPLES = 4, 8
"""The colour range of depth comes from this many views, with sides divided by `COARSE`."""


def render(
    map_path: Map,
    out: Annotated[Path, typer.Option(help="A new folder for PNGs, or an .mp4 file.")],
    pose: Pose = None,
    trajectory: Annotated[
        Path | None,
        typer.Option(
            help="Views along a trajectory: a text file with lines of time tx ty tz qx qy qz qw as "
            "in TUM RGB-D, or a .json file like the cameras.json of a map."
        ),
    ] = None,
    frames: Annotated[
        int, typer.Option(min=1, help="Number of views, without --pose or --trajectory.")
    ] = 150,
    depth: Annotated[bool, typer.Option("--depth", help="Also write coloured depth.")] = False,
    width: Annotated[int | None, typer.Option(min=16, max=8192, help="Image width, px.")] = None,
    height: Annotated[int | None, typer.Option(min=16, max=8192, help="Image height, px.")] = None,
    fov_deg: Annotated[
        float | None, typer.Option(min=1, max=170, help="Horizontal field of view, degrees.")
    ] = None,
    threads: Threads = 0,
) -> None:
    """Render a map from one view, along a trajectory, or along the map's own cameras.

    Without --pose or --trajectory the camera moves smoothly along the map's own cameras. Any of
    --width, --height and --fov-deg replaces the intrinsics of all views; the others are then 640,
    480 and 70.

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
    has_lens = (width, height, fov_deg) != (None,) * 3
    lens = _intrinsics(width, height, fov_deg) if has_lens else None
    cameras = _views(map_path, pose, trajectory, frames, lens)
    if is_video and len({(camera.width, camera.height) for camera in cameras}) > 1:
        raise ValueError(f"{out}: a video needs views of one size: give --width and --height")
    range_m = _depth_range(gaussian_map, cameras, threads) if depth else None
    with tqdm(cameras, desc="rendering", unit="view", disable=None) as bar:
        images = _render(gaussian_map, bar, range_m, threads)
        if is_video:
            size = (cameras[0].width, cameras[0].height)
            _write_videos(images, size, out, depth_out if depth else None)
        else:
            _write_pngs(images, out)
    scale = f"; depth from {range_m[0]:.2f} m (red) to {range_m[1]:.2f} m (blue)" if range_m else ""
    typer.echo(f"wrote {len(cameras)} view(s) to {out}{scale}")


def export(
    map_path: Map,
    out: Annotated[
        Path, typer.Argument(help="New file that ends in .ply, .glb, .spz, .splat or .html.")
    ],
    versions: Annotated[
        int, typer.Option(min=1, help="Maximum number of versions on a page, the newest ones.")
    ] = 50,
    spz_version: Annotated[
        int, typer.Option(min=3, max=4, help="Version of a .spz file; older programs read 3.")
    ] = 4,
) -> None:
    """Write a map as a file for other programs, or as a web page.

    A .ply file of 3DGS and a .glb file (glTF, KHR_gaussian_splatting) hold every bit of the map;
    .spz (Niantic) is about a tenth of their size, and .splat is for viewers on the web. A page is
    one file with the map, its versions and what changed, and opens without a network.

    Example: gslts export out/map out/map.glb
    """
    from gslts.io.map_files import WRITTEN_SUFFIXES, losses_of, write_map_file
    from gslts.store.map_folder import read_map

    kind = out.suffix.lower()
    if kind not in (*WRITTEN_SUFFIXES, ".html"):
        raise ValueError(f"{out}: must end in {', '.join(WRITTEN_SUFFIXES)} or .html")
    if out.exists():
        raise FileExistsError(f"{out} is there already")
    if kind == ".html":
        _export_page(map_path, out, versions)
        return
    gaussian_map = read_map(map_path)
    about = _facts(map_path) if kind == ".glb" else None
    out.parent.mkdir(parents=True, exist_ok=True)
    write_map_file(gaussian_map, out, about, spz_version)
    losses = "".join(f"; {loss}" for loss in losses_of(gaussian_map, kind))
    typer.echo(f"wrote {out}: {gaussian_map.size} Gaussians, {out.stat().st_size} bytes{losses}")


def _facts(map_path: Path) -> dict[str, Any]:
    """Return what a file may say of a version; nothing of a map without versions."""
    from gslts.store.describe import version_facts
    from gslts.store.history import open_history
    from gslts.store.manifest import split_version

    folder, number = split_version(map_path)
    if not folder.is_dir():
        return {}
    with open_history(folder) as history:
        return version_facts(history, number)


def _export_page(map_path: Path, out: Path, versions: int) -> None:
    from tqdm import tqdm

    from gslts.viewer.export import export_page

    out.parent.mkdir(parents=True, exist_ok=True)
    count = export_page(
        map_path, out, versions, lambda numbers: tqdm(numbers, desc="versions", disable=None)
    )
    typer.echo(f"wrote {out}: {count} version(s), {out.stat().st_size} bytes; open it in a browser")


def find_camera(map_path: Path, pose: str | None) -> Camera:
    """Return the camera of the option --pose; without it, the first camera of the map.

    Args:
        map_path: Folder of the map.
        pose: Value of the option.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such camera.
    """
    if pose:
        return _views(map_path, pose, None, 1, None)[0]
    return next(iter(_map_cameras(map_path).values()))


def _views(
    map_path: Path, pose: str | None, trajectory: Path | None, frames: int, lens: Camera | None
) -> list[Camera]:
    """Return the cameras to render from, with the intrinsics of `lens` if given."""
    from gslts.core.camera import at_pose
    from gslts.rendering.orbit import orbit
    from gslts.store.camera_files import read_camera, read_camera_path

    if pose is not None and Path(pose).suffix.lower() == ".json":
        cameras = [read_camera(Path(pose), lens or _default_lens(map_path))]
    elif pose is not None:
        known = _map_cameras(map_path)
        if pose not in known:
            some = ", ".join(repr(name) for name in list(known)[:3])
            raise ValueError(f"{map_path}: there is no camera {pose!r}; there are {some}, ...")
        cameras = [known[pose]]
    elif trajectory is not None:
        cameras = read_camera_path(trajectory, lens or _default_lens(map_path))
    else:
        cameras = orbit(list(_map_cameras(map_path).values()), frames)
    if lens is None:
        return cameras
    return [at_pose(lens, camera.world_from_camera) for camera in cameras]


def _map_cameras(map_path: Path) -> dict[str, Camera]:
    """Return the cameras of a map folder, at least one."""
    from gslts.store.camera_files import cameras_of_map

    cameras = cameras_of_map(map_path)
    if not cameras:
        raise ValueError(f"{map_path}: the map has no cameras; give --pose FILE or --trajectory")
    return cameras


def _default_lens(map_path: Path) -> Camera:
    """Return intrinsics for poses without their own: those of the map's first camera."""
    from gslts.store.camera_files import cameras_of_map

    return next(iter(cameras_of_map(map_path).values()), _intrinsics(None, None, None))


def _intrinsics(width: int | None, height: int | None, fov_deg: float | None) -> Camera:
    from math import radians

    from gslts.core.camera import camera_from_fov

    return camera_from_fov(
        width or DEFAULT_SIZE[0], height or DEFAULT_SIZE[1], radians(fov_deg or DEFAULT_FOV_DEG)
    )


def _depth_range(gaussian_map: GaussianMap, cameras: list[Camera], threads: int) -> Range:
    """Return one range of depth for all views, m, so that colours mean the same in a video."""
    import numpy as np

    from gslts.core.camera import downscale
    from gslts.io.images import depth_range
    from gslts.rendering.rasterizer import Rasterizer, RenderOptions

    rasterizer, options = Rasterizer(gaussian_map.dtype), RenderOptions(threads=threads)
    sample = cameras[:: max(1, len(cameras) // SAMPLES)]
    coarse = (downscale(camera, COARSE) for camera in sample)
    depths = [rasterizer.forward(gaussian_map, camera, options).depth for camera in coarse]
    return depth_range(np.concatenate([depth.ravel() for depth in depths]))


def _render(
    gaussian_map: GaussianMap, cameras: Iterable[Camera], range_m: Range | None, threads: int
) -> Iterator[tuple[RgbImage, RgbImage | None]]:
    """Yield the colour image of each view, and its coloured depth if `range_m` is given."""
    from gslts.io.images import depth_image, to_rgb8
    from gslts.rendering.rasterizer import Rasterizer, RenderOptions

    rasterizer, options = Rasterizer(gaussian_map.dtype), RenderOptions(threads=threads)
    for camera in cameras:
        images = rasterizer.forward(gaussian_map, camera, options)
        depth = None if range_m is None else depth_image(images.depth, range_m)
        yield to_rgb8(images.rgb), depth


def _write_videos(
    images: Iterable[tuple[RgbImage, RgbImage | None]],
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
        for image, depth in images:
            video.add(image)
            if depth_video is not None and depth is not None:
                depth_video.add(depth)


def _write_pngs(images: Iterable[tuple[RgbImage, RgbImage | None]], out: Path) -> None:
    """Write 00000.png, 00000_depth.png, ...: untrusted camera names never become file names."""
    from gslts.io.atomic_files import empty_folder
    from gslts.io.image_files import write_image

    empty_folder(out)
    for number, (image, depth) in enumerate(images):
        write_image(out / f"{number:05}.png", image)
        if depth is not None:
            write_image(out / f"{number:05}_depth.png", depth)
