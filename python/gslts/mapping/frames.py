"""Frames of a data set in memory, split into training, validation and test frames.

Training frames make the map. Validation frames end the optimization early and choose between
variants (see `gslts.mapping.engine`). Test frames do neither: only they are reported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gslts.core.se3 import se3_retract, twist_of
from gslts.datasets import Dataset, Frame
from gslts.mapping.config import USUAL_EXTENT_M
from gslts.mapping.memory import free_memory_bytes
from gslts.mapping.observation import BYTES_PER_PIXEL, Observation

HELD_OUT_EVERY = 8
"""Every 8th frame is held out from training, as usual for 3DGS (Kerbl et al. 2023)."""
MIN_TRAINING_FRAMES = 4
"""Minimum number of training frames: a robot at one place sees a table from about so many sides."""
MIN_FRAMES_TO_HOLD_OUT = 10
"""With fewer frames none is held out: each shows what no other does, and the one or two held out
would measure what the map does not know."""
MAX_BAD_SHARE = 0.2
"""Maximum share of unusable frames; with more, the data set as a whole is at fault."""

ShowFrames = Callable[[Sequence[Frame]], Iterable[Frame]]
Split = Callable[[Sequence[str]], tuple[Sequence[int], Sequence[int]]]
"""Chooses validation and test frames: indices of both into the names of all usable frames."""


@dataclass(frozen=True, eq=False)
class HeldOutFrames:
    """Frames that a map was not trained on, of one purpose: validation or test.

    Attributes:
        observations: By name, in the order of the data set.
        neighbours: For each of them, the training frames right before and after it.
    """

    observations: Mapping[str, Observation]
    neighbours: Sequence[Sequence[Observation]]

    def by_neighbours(self) -> list[Observation]:
        """Return the frames that have neighbours, their given poses corrected as those were.

        This corrects the pose without any pixel of the frame itself.
        """
        corrected = []
        for observation, neighbours in zip(
            self.observations.values(), self.neighbours, strict=True
        ):
            if neighbours:
                twist = np.mean([twist_of(near.correction) for near in neighbours], axis=0)
                corrected.append(observation.at_pose(se3_retract(observation.given_pose, twist)))
        return corrected


@dataclass(frozen=True, eq=False)
class FrameSplit:
    """Usable frames of one data set by purpose.

    Attributes:
        names: All frames in the order of the data set.
        training: Frames to train on, by name, in that order.
        validation: Frames that end the optimization and choose between variants.
        test: Frames to report on.
        skipped: Frames that cannot be used, and why.
    """

    names: tuple[str, ...]
    training: Mapping[str, Observation]
    validation: HeldOutFrames
    test: HeldOutFrames
    skipped: tuple[str, ...]

    @classmethod
    def read(
        cls,
        dataset: Dataset,
        observe: Callable[[Frame], Observation],
        split: Split,
        show_frames: ShowFrames = iter,
    ) -> FrameSplit:
        """Read all frames of a data set.

        Args:
            dataset: Data set to read.
            observe: Reads one frame.
            split: Chooses validation and test frames; all others are training frames.
            show_frames: Shows the progress of reading.

        Raises:
            ValueError: Too many frames cannot be used, too few are left, or memory is too small.
        """
        require_memory(dataset.name, dataset.frames)
        frames, bad = read_usable(dataset, observe, show_frames)
        result = cls.of(frames, split, bad)
        if len(result.training) < MIN_TRAINING_FRAMES:
            raise ValueError(
                f"{dataset.name}: {len(frames)} frames are too few to make a map, "
                f"{MIN_TRAINING_FRAMES} are needed"
            )
        return result

    @classmethod
    def of(
        cls, frames: Mapping[str, Observation], split: Split, skipped: tuple[str, ...] = ()
    ) -> FrameSplit:
        """Split frames by purpose.

        Args:
            frames: By name, in the order of the data set.
            split: Chooses validation and test frames; all others are training frames.
            skipped: Frames that cannot be used, and why.
        """
        names = list(frames)
        validation, test = ([names[k] for k in rows] for rows in split(names))
        held_out = {*validation, *test}
        training = {name: frame for name, frame in frames.items() if name not in held_out}
        beside = neighbours_of(names)

        def hold_out(chosen: Sequence[str]) -> HeldOutFrames:
            return HeldOutFrames(
                {name: frames[name] for name in chosen},
                [[training[near] for near in beside[name] if near in training] for name in chosen],
            )

        return cls(tuple(names), training, hold_out(validation), hold_out(test), skipped)

    @property
    def held_out(self) -> list[Observation]:
        """Validation and test frames."""
        return [*self.validation.observations.values(), *self.test.observations.values()]

    @property
    def has_depth(self) -> bool:
        """True if any training frame has measured depth."""
        return any(frame.has_depth for frame in self.training.values())

    @property
    def extent_m(self) -> float:
        """Radius of the training cameras around their mean plus a tenth, as in 3DGS; above 0."""
        centres = np.array([frame.given_pose[:3, 3] for frame in self.training.values()])
        farthest_m = float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())
        return 1.1 * farthest_m or USUAL_EXTENT_M


def observe(frame: Frame) -> Observation:
    """Read a frame that mapping can use.

    Args:
        frame: Frame on the disk.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged, or the mask of the frame leaves nothing to compare.
    """
    observation = Observation.of(frame.read())
    mask = observation.mask(1)
    if mask is not None and not mask.any():
        raise ValueError("its mask leaves no pixel at half the resolution")
    return observation


def split_held_out(names: Sequence[str]) -> tuple[range, range]:
    """Hold out every 8th frame: alternately for test and for validation; none of few frames.

    Args:
        names: Usable frames in the order of the data set.

    Returns:
        Indices of the validation frames and of the test frames.
    """
    if len(names) < MIN_FRAMES_TO_HOLD_OUT:
        return range(0), range(0)
    held_out = range(0, len(names), HELD_OUT_EVERY)
    return held_out[1::2], held_out[::2]


def neighbours_of(names: Sequence[str]) -> dict[str, list[str]]:
    """Return the names before and after each name.

    Args:
        names: Frames in the order of the data set.
    """
    beside: dict[str, list[str]] = {name: [] for name in names}
    for before, after in pairwise(names):
        beside[before].append(after)
        beside[after].append(before)
    return beside


def read_usable(
    dataset: Dataset, observe: Callable[[Frame], Observation], show_frames: ShowFrames = iter
) -> tuple[dict[str, Observation], tuple[str, ...]]:
    """Read all frames that can be used.

    A frame is left out if it cannot be read, if another frame has its name, or if it has no depth
    in a data set where nearly all frames have some. Missing images are named and no error.

    Args:
        dataset: Data set to read.
        observe: Reads one frame.
        show_frames: Shows the progress of reading.

    Returns:
        Usable frames by name, and for the others the reason.

    Raises:
        ValueError: Too many frames cannot be used.
    """
    frames: dict[str, Observation] = {}
    bad = list(dataset.skipped)
    for frame in show_frames(dataset.frames):
        try:
            if frame.name in frames:
                raise ValueError("there is another frame of that name")
            frames[frame.name] = observe(frame)
        except (OSError, ValueError) as error:
            bad.append(f"{frame.name}: {error}")
    total = len(dataset.frames) + len(dataset.skipped)
    if len(bad) > MAX_BAD_SHARE * total:
        raise ValueError(
            f"{dataset.name}: {len(bad)} of {total} frames cannot be used, such as {bad[0]}"
        )
    without_depth = [name for name, frame in frames.items() if not frame.has_depth]
    # If many frames have no depth, their colours are worth more than nothing.
    if len(bad) + len(without_depth) <= MAX_BAD_SHARE * total:
        for name in without_depth:
            bad.append(f"{name}: depth is measured nowhere")
            del frames[name]
    return frames, (*bad, *dataset.missing)


def require_memory(dataset: str, frames: Sequence[Frame]) -> None:
    """Check that all frames fit into memory, before any is read.

    Args:
        dataset: Name of the data set, for the message.
        frames: Frames to be kept in memory.

    Raises:
        ValueError: They do not fit.
    """
    sizes = (frame.camera.width * frame.camera.height for frame in frames)
    needed, free = BYTES_PER_PIXEL * sum(sizes), free_memory_bytes()
    if free is not None and needed > free:
        raise ValueError(
            f"{dataset}: {len(frames)} frames take {needed / 2**30:.1f} GiB of memory "
            f"and {free / 2**30:.1f} are free: take fewer, such as one in {-(-needed // free)}"
        )
