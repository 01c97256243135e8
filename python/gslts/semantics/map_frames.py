"""Check that frames are those that a map was made from: the map shows them at its cameras.

Labels of other frames, such as those of a later visit or of another room with frames of the same
names, would be lifted through cameras that did not take them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.datasets import Frame
from gslts.rendering.losses import apply_exposure, fit_exposure
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.store.manifest import read_manifest

MAX_FRAMES = 8
"""Maximum number of frames that are compared, evenly chosen: 10 to 50 ms each."""
MAX_DROP_DB = 5.0
"""Maximum difference between the PSNR that is expected and that of the frames compared, dB. At the
cameras of maps of three real rooms, it is 0 for their frames, 7 to 22 for those of other visits,
and 11 to 27 for those of other rooms; updates and extensions of a map cost less."""
UNRECORDED_GAIN_DB, UNRECORDED_PSNR_DB = 8.0, 25.0
"""Expected PSNR of a frame where the map records none, dB: above that of an image of one colour,
the median is 9 in a simulated room, and 9 to 24 in four real ones; and no more than the second
value, as plain rooms have little more than one colour."""


def frames_of_map(
    map_path: Path,
    gaussian_map: GaussianMap,
    cameras: Mapping[str, Camera],
    frames: Sequence[Frame],
    dataset: Path,
    threads: int = 0,
) -> list[Frame]:
    """Return the frames that a map was made from.

    Their poses may differ, as mapping refines or estimates them, and so may focal lengths.

    Args:
        map_path: Folder of the map.
        gaussian_map: Any version of the map: few changes of objects do not matter.
        cameras: Cameras of the map, by name.
        frames: Frames of the data set.
        dataset: Folder or file of the frames, for messages.
        threads: 0 uses one per hardware thread.

    Returns:
        Those of the names of the cameras.

    Raises:
        OSError: A file cannot be read.
        ValueError: The map was not made from these frames, or a file is damaged.
    """
    hint = "; give the dataset of gslts map"
    used = [frame for frame in frames if frame.name in cameras]
    if not used:
        raise ValueError(f"{map_path} was made from no frame of {dataset}{hint}")
    for frame in used:
        size, own = ((c.width, c.height) for c in (frame.camera, cameras[frame.name]))
        if size != own:
            raise ValueError(
                f"{dataset}: {frame.name} has {size[0]} x {size[1]} px, that of {map_path} "
                f"{own[0]} x {own[1]} px{hint}"
            )
    recorded = _recorded_psnrs_db(map_path)
    known = [frame for frame in used if frame.name in recorded] or used
    count = min(len(known), MAX_FRAMES)
    chosen = [known[k] for k in np.linspace(0, len(known) - 1, count).round().astype(int)]
    psnrs_db = [_psnrs_db(gaussian_map, f, cameras[f.name], recorded, threads) for f in chosen]
    found_db, expected_db = np.median(psnrs_db, axis=0)
    if found_db < expected_db - MAX_DROP_DB:
        raise ValueError(
            f"{dataset}: {map_path} was made from other frames of these names: it shows "
            f"{count} with a median PSNR of {found_db:.1f} dB, expected about {expected_db:.1f}"
            f"{hint}"
        )
    return used


def _recorded_psnrs_db(map_path: Path) -> dict[str, float]:
    """Return the PSNR of training frames by name, as `gslts map` records it; empty if unknown."""
    recorded = read_manifest(map_path).get("training_psnrs_db")
    if not isinstance(recorded, dict):
        return {}
    return {name: psnr for name, psnr in recorded.items() if isinstance(psnr, float)}


def _psnrs_db(
    gaussian_map: GaussianMap,
    frame: Frame,
    camera: Camera,
    recorded: Mapping[str, float],
    threads: int,
) -> tuple[float, float]:
    """Return the PSNR of a frame at half resolution, as it is recorded, and the expected one."""
    halved = replace(frame.read(), camera=camera).halved()
    target = halved.rgb.astype(np.float32) / np.float32(255)

    def psnr_of(rgb: FloatArray) -> float:
        exposure = fit_exposure(rgb, target, mask=halved.mask, threads=threads)
        return psnr_db(apply_exposure(rgb, exposure), target, halved.mask)

    options = RenderOptions(threads=threads)
    rgb = Rasterizer(np.float32).forward(gaussian_map, halved.camera, options).rgb
    plain_db = psnr_of(np.zeros_like(rgb))  # The exposure makes it the mean colour.
    unrecorded_db = min(plain_db + UNRECORDED_GAIN_DB, UNRECORDED_PSNR_DB)
    return psnr_of(rgb), recorded.get(frame.name, unrecorded_db)
