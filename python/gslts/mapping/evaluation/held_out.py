"""Which frames of a data set can judge a map, and what is known about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

from gslts.core.camera import Camera
from gslts.datasets import Dataset, Frame
from gslts.mapping.frames import ShowFrames, require_memory, usable
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import Observation
from gslts.store.camera_files import cameras_of_map
from gslts.store.manifest import read_manifest, split_version
from gslts.store.map_folder import camera_from_json


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
        folder, _ = split_version(path)
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
    dataset: Dataset, known: Known, every: int | None = None, show_frames: ShowFrames = iter
) -> tuple[list[Observation], list[list[Observation]], tuple[str, ...]]:
    """Frames to judge by, and for each its neighbours that the map was made from.

    Frames that cannot be used are left out, as in mapping; see `gslts.mapping.frames.usable`.

    Args:
        dataset: The one that the map was made from, or another one of the same scene.
        known: Of the map.
        every: Use every so manieth frame; None means those that the map was not made from, or
            every eighth if it knows none of them.
        show_frames: Shows how far the reading is, if all frames have to be looked at.

    Returns:
        The frames, their neighbours, and what cannot be used and why.

    Raises:
        ValueError: There is no frame, or too many cannot be used.
    """
    frames = {frame.name: frame for frame in dataset.frames[::-1]}  # Of one name, the first.
    skipped = dataset.skipped
    wanted = _wanted([frame.name for frame in dataset.frames], known, every)
    require_memory(dataset.name, [frames[name] for name in _all(wanted)])
    read = None if len(frames) < len(dataset.frames) else _read(wanted, frames, known)
    if read is None:
        # Only all frames tell whether too many are bad, and which good ones are side by side.
        looks, skipped = usable(dataset, lambda one: _shrunk(known.observe(one)), show_frames)
        wanted = _wanted(list(looks), known, every)
        read = {name: known.observe(frames[name]) for name in _all(wanted)}
    if not wanted:
        why = f" that can be used; {skipped[-1]}" if skipped else ""
        raise ValueError(f"{dataset.name}: the map was made from all of its frames{why}")
    neighbours = [[read[name] for name in near] for near in wanted.values()]
    return [read[name] for name in wanted], neighbours, skipped


def judging(names: Sequence[str], known: Known, every: int | None = None) -> list[int]:
    """Which of these frames judge the map; see `held_out_of`."""
    chosen = [k for k, name in enumerate(names) if name not in known.cameras]
    if every is not None or len(chosen) == len(names):
        chosen = list(range(0, len(names), every or 8))
    return chosen


def _wanted(names: Sequence[str], known: Known, every: int | None) -> dict[str, list[str]]:
    """The frames that judge, and for each its neighbours that the map was made from."""
    beside = {k: (*names[max(0, k - 1) : k], *names[k + 1 : k + 2]) for k in range(len(names))}
    return {
        names[k]: [name for name in beside[k] if name in known.cameras]
        for k in judging(names, known, every)
    }


def _all(wanted: Mapping[str, Sequence[str]]) -> set[str]:
    return {*wanted, *chain.from_iterable(wanted.values())}


def _read(
    wanted: Mapping[str, Sequence[str]], frames: Mapping[str, Frame], known: Known
) -> dict[str, Observation] | None:
    """The frames by name; None if one cannot be read, or only some have depth."""
    try:
        read = {name: known.observe(frames[name]) for name in _all(wanted)}
    except (OSError, ValueError):
        return None
    with_depth = {bool(one.measured[0].any()) for one in read.values()}
    return None if len(with_depth) > 1 else read


def _shrunk(one: Observation) -> Observation:
    """All that tells whether it can be used: there may be no memory for the pictures of all."""
    return replace(one, rgb=(), measured=(one.measured[0].max(keepdims=True),), masks=None)


def _lenses(plain: Mapping[str, Any]) -> Lenses:
    return Lenses(camera_from_json(plain["color"]), camera_from_json(plain["depth"]))
