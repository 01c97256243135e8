"""Frames that are localized in the map of a home, with their true poses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial

from gslts.core.frame import RgbdFrame
from gslts.datasets import Frame, open_dataset
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.types import Floats
from gslts_bench.detection.cases import Case
from gslts_bench.homes import BenchHome
from gslts_bench.relocalization.frames import Batch, Part, batches_of
from gslts_sim.actions import SceneState
from gslts_sim.capture import true_poses


@dataclass(frozen=True, eq=False)
class View:
    """A frame that is taken when it is asked for.

    Attributes:
        frame: Home where it is taken and its name there, such as `kitchen_3/visit_07`.
        part: Part of the benchmark.
        seed: Seed of all randomness about it.
        take: Takes it; also returns the true world_from_camera [4,4].
    """

    frame: str
    part: Part
    seed: int
    take: Callable[[], tuple[RgbdFrame, Floats]]

    @property
    def is_foreign(self) -> bool:
        """True if it is taken in another home than that of the map."""
        return self.part == "another home"


def views_of(bench: BenchHome, count: int) -> Iterator[View]:
    """Yield all frames that are localized in the map of a home.

    Args:
        bench: The home.
        count: Maximum number of frames per part.

    Raises:
        ValueError: Nothing can be changed in one of the homes.
        OSError: A recording cannot be read or written.
    """
    yield from _held_out(bench, count)
    for batch in batches_of(bench, count):
        before = cache(batch.before)
        for case in batch.cases.cases:
            name = f"{batch.bench.name}/{case.name}"
            take = partial(_take, batch, case, before)
            yield View(name, batch.part(case), case.sensor_seed, take)


def _held_out(bench: BenchHome, count: int) -> Iterator[View]:
    """Yield the frames of the recording that neither trained nor validated the map."""
    folder, record = bench.recording(), TrainingRecord.read(bench.map())
    frames, true = open_dataset(folder).frames, true_poses(folder)
    for number in record.choose_test([frame.name for frame in frames])[:count]:
        frame = frames[number]
        take = partial(_read, frame, true[frame.name])
        yield View(f"{bench.name}/kept_{frame.name}", "held-out", number, take)


def _read(frame: Frame, true: Floats) -> tuple[RgbdFrame, Floats]:
    return frame.read(), true


def _take(batch: Batch, case: Case, before: Callable[[], SceneState]) -> tuple[RgbdFrame, Floats]:
    return batch.take(case, before())
