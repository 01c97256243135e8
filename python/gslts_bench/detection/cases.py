"""What change detection is asked: frames of homes in which one, several or no objects changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import BaseModel

from gslts.core.frame import RgbdFrame
from gslts_bench.detection.several import SeveralMaker
from gslts_bench.detection.truth import Truth, in_view_px
from gslts_bench.detection.visits import draw_visit, noise_of_visit, with_light_moved
from gslts_bench.homes import BenchHome, default_state, shares_of
from gslts_sim.actions import ChangeAction, SceneState
from gslts_sim.controller import Controller
from gslts_sim.home_source import HomeSource
from gslts_sim.robot_body import Viewpoint
from gslts_sim.sensor import NOISE_PRESETS
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Task

Part = Literal["single", "pair", "triple", "unchanged"]
PARTS: tuple[Part, ...] = ("single", "pair", "triple", "unchanged")

LEAST_TASKS = 12
"""Of a home, so that there are changes to put together."""


class Case(BaseModel):
    """One frame, and what should be found in it.

    Attributes:
        name: Such as `single_03`.
        part: Of the benchmark.
        actions: From the default state.
        viewpoint: Of the robot.
        sensor_seed: Of the noise, with the exposure.
        light_shift_m: By which the light of a lamp is moved in x and y.
        truths: What differs from the default state.
    """

    model_config = STRICT

    name: str
    part: Part
    actions: tuple[ChangeAction, ...] = ()
    viewpoint: Viewpoint
    sensor_seed: int
    light_shift_m: tuple[float, float] | None = None
    truths: tuple[Truth, ...] = ()


class HomeCases(BaseModel):
    """All that is asked in one home.

    Attributes:
        home: How to rebuild it.
        initial_actions: To its default state.
        cases: Of different names.
    """

    model_config = STRICT

    home: HomeSource
    initial_actions: tuple[ChangeAction, ...]
    cases: tuple[Case, ...]


@dataclass(frozen=True)
class Counts:
    """How many cases of each part a home is to have."""

    single: int
    pair: int
    triple: int
    unchanged: int


def cases_of(bench: BenchHome, counts: Counts, tell: Callable[[Part], None]) -> HomeCases:
    """The cases of a home; fewer where it does not give so many.

    Args:
        bench: The home.
        counts: How many.
        tell: Is told each that was made.

    Raises:
        ValueError: Nothing can be changed in it.
    """
    tasks = bench.tasks(max(LEAST_TASKS, counts.single))
    source = tasks[0].home
    assert isinstance(source, HomeSource)  # As a bench's home comes from a seed.
    before = default_state(source, tasks[0].initial_actions)
    rng = np.random.default_rng([bench.seed, 1])
    cases = []
    for number, task in enumerate(tasks[: counts.single]):
        cases.append(_single(number, task, before))
        tell("single")
    several = SeveralMaker(before, tasks, rng)
    wanted: tuple[tuple[Part, int, int], ...] = (
        ("pair", 2, counts.pair),
        ("triple", 3, counts.triple),
    )
    for part, size, count in wanted:
        for number, found in enumerate(several.make(size, count)):
            cases.append(
                Case(
                    name=f"{part}_{number:02}",
                    part=part,
                    actions=found.actions,
                    viewpoint=found.look,
                    sensor_seed=int(rng.integers(1 << 31)),
                    truths=found.truths,
                )
            )
            tell(part)
    for number in range(counts.unchanged):
        visit = draw_visit(before.home, rng)
        cases.append(
            Case(
                name=f"unchanged_{number:02}",
                part="unchanged",
                viewpoint=visit.look,
                sensor_seed=int(rng.integers(1 << 31)),
                light_shift_m=visit.light_shift_m,
            )
        )
        tell("unchanged")
    return HomeCases(home=source, initial_actions=tasks[0].initial_actions, cases=tuple(cases))


def frame_of(case: Case, before: SceneState, bench: BenchHome) -> RgbdFrame:
    """What the robot sees.

    Args:
        case: Of that home.
        before: Its default state.
        bench: The home.

    Raises:
        ChangeError: An action cannot be done.
        ActionError: The robot cannot stand there.
    """
    (frame,) = frames_of(case, before, bench, [case.viewpoint])
    return frame


def frames_of(
    case: Case, before: SceneState, bench: BenchHome, looks: Iterable[Viewpoint]
) -> list[RgbdFrame]:
    """What the robot sees in some looks, one after the other; see `frame_of`."""
    state = before
    for action in case.actions:
        state = state.apply(action)
    noise = NOISE_PRESETS[bench.setup.noise]
    if case.part == "unchanged":
        noise = noise_of_visit(noise)
    if case.light_shift_m is not None:
        state = SceneState(with_light_moved(state.home, case.light_shift_m), state.removed)
    robot = Controller(
        state,
        width=bench.setup.width,
        height=bench.setup.height,
        noise=noise,
        seed=case.sensor_seed,
    )
    frames = []
    for look in looks:
        robot.go(look)
        frames.append(robot.observe())
    return frames


def _single(number: int, task: Task, before: SceneState) -> Case:
    after = before
    for action in task.change_actions:
        after = after.apply(action)
    look = task.viewpoint
    return Case(
        name=f"single_{number:02}",
        part="single",
        actions=task.change_actions,
        viewpoint=task.viewpoint,
        sensor_seed=task.sensor.seed_after,
        truths=(Truth(change=task.change, size_px=in_view_px(task.change, before, after, look)),),
    )


def counts_of(tasks: int, homes: int) -> list[Counts]:
    """Of each home, for so many single changes in all."""
    wanted = {
        "single": tasks,
        "pair": round(tasks / 6),
        "triple": round(tasks / 6),
        "unchanged": min(200, round(200 * tasks / 300)),
    }
    shares = {part: shares_of(count, homes) for part, count in wanted.items()}
    return [Counts(**{part: shares[part][home] for part in shares}) for home in range(homes)]
