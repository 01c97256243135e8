"""What is asked about in the map of a home: frames, and where they were taken in truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial

from gslts.core.frame import RgbdFrame
from gslts.datasets import Frame, open_dataset
from gslts.mapping.frames import HELD_OUT_EVERY
from gslts.types import Floats
from gslts_bench.detection.cases import Case
from gslts_bench.homes import BenchHome, Tell
from gslts_bench.relocalization.frames import Batch, Part, batches_of
from gslts_sim.actions import SceneState
from gslts_sim.capture import true_poses


@dataclass(frozen=True, eq=False)
class Question:
    """One frame.

    Attributes:
        frame: Where it was taken, and its name there, such as `kitchen_3/visit_07`.
        part: What it is asked for.
        seed: Of what is random about it.
        look: Sees it; and [4,4] world_from_camera in truth.
    """

    frame: str
    part: Part
    seed: int
    look: Callable[[], tuple[RgbdFrame, Floats]]

    @property
    def is_strange(self) -> bool:
        """Whether it was taken in another home."""
        return self.part == "another home"


def questions_of(
    bench: BenchHome, views: int, code: str, tell: Tell = lambda _: None
) -> Iterator[Question]:
    """All that is asked about in the map of a home.

    Args:
        bench: The home.
        views: Frames of each part, at most.
        code: Digest of the code that makes frames.
        tell: Is told of work done, in the seconds that it usually takes.

    Raises:
        ValueError: Nothing can be changed in one of the homes.
        OSError: A recording cannot be read or written.
    """
    yield from _kept_aside(bench, views, tell)
    for batch in batches_of(bench, views, code, tell):
        before = cache(batch.before)
        for case in batch.cases.cases:
            name = f"{batch.bench.name}/{case.name}"
            look = partial(_look, batch, case, before)
            yield Question(name, batch.part(case), case.sensor_seed, look)


def _kept_aside(bench: BenchHome, views: int, tell: Tell) -> Iterator[Question]:
    """Frames of the recording that maps are made without."""
    folder = bench.recording(tell)
    frames, true = open_dataset(folder).frames, true_poses(folder)
    for number in list(range(0, len(frames), HELD_OUT_EVERY))[:views]:
        frame = frames[number]
        look = partial(_read, frame, true[frame.name])
        yield Question(f"{bench.name}/kept_{frame.name}", "kept aside", number, look)


def _read(frame: Frame, true: Floats) -> tuple[RgbdFrame, Floats]:
    return frame.read(), true


def _look(batch: Batch, case: Case, before: Callable[[], SceneState]) -> tuple[RgbdFrame, Floats]:
    return batch.look(case, before())
