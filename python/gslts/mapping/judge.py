"""Which frames of a data set can judge a map, and what is known about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gslts.camera import Camera
from gslts.camera_files import cameras_of_map
from gslts.datasets import Dataset, Frame
from gslts.map_folder import camera_of, folder_of, read_manifest
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import Observation


@dataclass(frozen=True, eq=False)
class Known:
    """What the folder of a map tells besides the Gaussians; nothing for a plain PLY file.

    Attributes:
        cameras: Of the frames that the map was made from, as corrected, by name.
        lenses: As given and as found, if they are known.
    """

    cameras: Mapping[str, Camera]
    lenses: tuple[Lenses, Lenses] | None = None

    @classmethod
    def of(cls, path: Path) -> Known:
        """Reads it.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged.
        """
        folder, _ = folder_of(path)
        if not folder.is_dir():
            return cls({})
        manifest, cameras = read_manifest(folder), cameras_of_map(path)
        if "lenses" not in manifest:
            return cls(cameras)
        try:
            lenses = tuple(_lenses(manifest["lenses"][kind]) for kind in ("given", "found"))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: lenses of the manifest: {error}") from None
        return cls(cameras, (lenses[0], lenses[1]))

    def observe(self, frame: Frame) -> Observation:
        """Reads a frame; of the sensor that the map was made with, lenses and pose are corrected.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged.
        """
        one = Observation.of(frame.read())
        if self.lenses is not None and one.lenses.alike(self.lenses[0]):
            one.set_lenses(self.lenses[1])
        one.pose = one.given_pose
        if frame.name in self.cameras:
            one.pose = self.cameras[frame.name].world_from_camera
        return one


def held_out_of(
    dataset: Dataset, known: Known, every: int | None
) -> tuple[list[Observation], list[list[Observation]]]:
    """Frames to judge by, and for each its neighbours that the map was made from.

    Args:
        dataset: The one that the map was made from, or another one of the same scene.
        known: Of the map.
        every: Use every so manieth frame; None means those that the map was not made from, or
            every eighth if it knows none of them.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged, or there is no frame.
    """
    frames = dataset.frames
    chosen = judging([frame.name for frame in frames], known, every)
    if not chosen:
        raise ValueError(f"{dataset.name}: the map was made from all of its frames")
    observations = [known.observe(frames[k]) for k in chosen]
    neighbours = [
        [
            known.observe(frames[near])
            for near in (k - 1, k + 1)
            if 0 <= near < len(frames) and frames[near].name in known.cameras
        ]
        for k in chosen
    ]
    return observations, neighbours


def judging(names: Sequence[str], known: Known, every: int | None = None) -> list[int]:
    """Which of these frames judge the map; see `held_out_of`."""
    chosen = [k for k, name in enumerate(names) if name not in known.cameras]
    if every is not None or len(chosen) == len(names):
        chosen = list(range(0, len(names), every or 8))
    return chosen


def _lenses(plain: Mapping[str, Any]) -> Lenses:
    return Lenses(camera_of(plain["color"]), camera_of(plain["depth"]))
