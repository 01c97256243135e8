"""The frames of a data set, read: those that a map learns from, and those that judge it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gslts.datasets import Dataset, Frame
from gslts.mapping.config import USUAL_EXTENT_M
from gslts.mapping.memory import free_memory_bytes
from gslts.mapping.observation import BYTES_PER_PIXEL, Observation

HELD_OUT_EVERY = 8
"""Every eighth frame judges the map and is not learned from."""
MOST_BAD_SHARE = 0.2
"""With more unreadable frames, something is wrong with the data set and not with a frame."""

ShowFrames = Callable[[Sequence[Frame]], Iterable[Frame]]


@dataclass(frozen=True, eq=False)
class Visit:
    """Frames of one data set in their order, by name.

    Attributes:
        training: To learn from.
        held_out: To judge by.
        neighbours: For each of these, those of `training` right before and after it.
        skipped: Frames that cannot be used, and why.
    """

    training: Mapping[str, Observation]
    held_out: Mapping[str, Observation]
    neighbours: Sequence[Sequence[Observation]]
    skipped: tuple[str, ...]

    @classmethod
    def of(
        cls,
        dataset: Dataset,
        observe: Callable[[Frame], Observation],
        judging: Callable[[Sequence[str]], Iterable[int]],
        show_frames: ShowFrames = iter,
    ) -> Visit:
        """Reads all frames.

        Args:
            dataset: Where they are.
            observe: Reads one.
            judging: Which of them are held out, given their names.
            show_frames: Shows how far the reading is.

        Raises:
            ValueError: Too many frames cannot be used, those that are left are too few, or there is
                no memory for them.
        """
        require_memory(dataset.name, dataset.frames)
        frames, bad = usable(dataset, observe, show_frames)
        names = list(frames)
        aside = [names[k] for k in judging(names)]
        training = {name: one for name, one in frames.items() if name not in set(aside)}
        if len(training) < HELD_OUT_EVERY:
            why = f"; {bad[0]}" if bad else ""
            raise ValueError(
                f"{dataset.name}: {len(frames)} frames are too few to make and judge a map{why}"
            )
        after = dict(pairwise(names))
        before = {b: a for a, b in pairwise(names)}
        return cls(
            training=training,
            held_out={name: frames[name] for name in aside},
            neighbours=[
                [
                    training[near]
                    for near in (before.get(name), after.get(name))
                    if near is not None and near in training
                ]
                for name in aside
            ],
            skipped=bad,
        )

    @property
    def has_depth(self) -> bool:
        """Whether any frame to learn from measured some."""
        return any(one.measured[0].any() for one in self.training.values())

    @property
    def extent_m(self) -> float:
        """How far cameras are from their middle at most, with a tenth more, as in 3DGS; above 0."""
        centres = np.array([one.given_pose[:3, 3] for one in self.training.values()])
        farthest_m = float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max())
        return 1.1 * farthest_m or USUAL_EXTENT_M


def usable(
    dataset: Dataset, observe: Callable[[Frame], Observation], show_frames: ShowFrames = iter
) -> tuple[dict[str, Observation], tuple[str, ...]]:
    """Reads all frames.

    Args:
        dataset: Where they are.
        observe: Reads one.
        show_frames: Shows how far the reading is.

    Returns:
        Those that can be used, by name, and why others cannot.

    Raises:
        ValueError: The others are too many.
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
    if len(bad) > MOST_BAD_SHARE * total:
        raise ValueError(
            f"{dataset.name}: {len(bad)} of {total} frames cannot be used, such as {bad[0]}"
        )
    blind = [name for name, one in frames.items() if not one.measured[0].any()]
    # Where many are without depth, the rest of them is worth more than nothing.
    if len(bad) + len(blind) <= MOST_BAD_SHARE * total:
        for name in blind:
            bad.append(f"{name}: depth is measured nowhere")
            del frames[name]
    return frames, tuple(bad)


def require_memory(dataset: str, frames: Sequence[Frame]) -> None:
    """Better to say so at once than to be killed in the middle.

    Raises:
        ValueError: There is not enough to keep all frames in it.
    """
    sizes = (frame.camera.width * frame.camera.height for frame in frames)
    needed, free = BYTES_PER_PIXEL * sum(sizes), free_memory_bytes()
    if free is not None and needed > free:
        raise ValueError(
            f"{dataset}: {len(frames)} frames take {needed / 2**30:.1f} GiB of memory "
            f"and {free / 2**30:.1f} are free: take fewer, such as one in {-(-needed // free)}"
        )


def every_eighth(names: Sequence[str]) -> range:
    """Which frames judge a map that is made."""
    return range(0, len(names), HELD_OUT_EVERY)
