"""Cases of change detection: frames of homes in which one, several or no objects changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import BaseModel

from gslts.core.frame import RgbdFrame
from gslts_bench.detection.several import SeveralMaker
from gslts_bench.detection.shifted import draw_shifts
from gslts_bench.detection.truth import Truth, in_view_px
from gslts_bench.detection.visits import draw_visit, move_light, visit_noise
from gslts_bench.homes import BenchHome, even_shares
from gslts_sim.actions import ChangeAction, SceneState
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint
from gslts_sim.sensor import NOISE_PRESETS
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Task

Part = Literal["single", "pair", "triple", "unchanged", "shifted"]
PARTS: tuple[Part, ...] = ("single", "pair", "triple", "unchanged", "shifted")
"""Parts of the benchmark: one, two, three or no objects changed, or one was shifted a little."""

MIN_TASKS = 12
"""Minimum number of tasks made for a home: pairs and triples are combined from them."""


class Case(BaseModel):
    """A frame and the changes that should be found in it.

    Attributes:
        name: Name in its home, such as `single_03`.
        part: Part of the benchmark.
        actions: Changes of the default state.
        viewpoint: Viewpoint of the robot.
        sensor_seed: Seed of noise and exposure.
        light_shift_m: Shift of the light of a lamp in x and y; None leaves it.
        truths: Changes in view.
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
    """All cases of one home.

    Attributes:
        initial_actions: Actions that lead to its default state.
        cases: Cases of different names.
    """

    model_config = STRICT

    initial_actions: tuple[ChangeAction, ...]
    cases: tuple[Case, ...]


@dataclass(frozen=True)
class Counts:
    """Numbers of cases of a home by part."""

    single: int
    pair: int
    triple: int
    unchanged: int
    shifted: int


def make_cases(bench: BenchHome, counts: Counts) -> HomeCases:
    """Make the cases of a home; fewer where it does not give so many.

    Args:
        bench: The home.
        counts: Numbers of cases.

    Returns:
        The cases, by part.

    Raises:
        ValueError: Nothing can be changed in the home.
    """
    tasks = bench.tasks(max(MIN_TASKS, counts.single))
    before = bench.default_state(tasks[0].initial_actions)
    rng = np.random.default_rng([bench.seed, 1])
    cases = [_single(number, task, before) for number, task in enumerate(tasks[: counts.single])]
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
                    viewpoint=found.viewpoint,
                    sensor_seed=int(rng.integers(1 << 31)),
                    truths=found.truths,
                )
            )
    for number in range(counts.unchanged):
        visit = draw_visit(before.home, rng)
        cases.append(
            Case(
                name=f"unchanged_{number:02}",
                part="unchanged",
                viewpoint=visit.viewpoint,
                sensor_seed=int(rng.integers(1 << 31)),
                light_shift_m=visit.light_shift_m,
            )
        )
    cases += _make_shifted(before, counts.shifted, bench.seed)
    return HomeCases(initial_actions=tasks[0].initial_actions, cases=tuple(cases))


def take_frame(case: Case, before: SceneState, bench: BenchHome) -> RgbdFrame:
    """Take the frame of a case.

    Args:
        case: Case of the home.
        before: Default state of the home.
        bench: The home.

    Returns:
        The frame with the sensor's noise.

    Raises:
        ChangeError: An action of the case cannot be done.
        ActionError: The robot cannot stand at the viewpoint.
    """
    (frame,) = take_frames(case, before, bench, [case.viewpoint])
    return frame


def take_frames(
    case: Case, before: SceneState, bench: BenchHome, viewpoints: Iterable[Viewpoint]
) -> list[RgbdFrame]:
    """Take frames of a case from other viewpoints, in this order; see `take_frame`.

    Args:
        case: Case of the home.
        before: Default state of the home.
        bench: The home.
        viewpoints: Viewpoints of the robot.
    """
    state = before
    for action in case.actions:
        state = state.apply(action)
    noise = NOISE_PRESETS[bench.setup.noise]
    if case.part == "unchanged":
        noise = visit_noise(noise)
    if case.light_shift_m is not None:
        state = SceneState(move_light(state.home, case.light_shift_m), state.removed)
    robot = Controller(
        state,
        width=bench.setup.width,
        height=bench.setup.height,
        noise=noise,
        seed=case.sensor_seed,
    )
    frames = []
    for viewpoint in viewpoints:
        robot.go(viewpoint)
        frames.append(robot.observe())
    return frames


def _single(number: int, task: Task, before: SceneState) -> Case:
    after = before
    for action in task.change_actions:
        after = after.apply(action)
    viewpoint = task.viewpoint
    return Case(
        name=f"single_{number:02}",
        part="single",
        actions=task.change_actions,
        viewpoint=task.viewpoint,
        sensor_seed=task.sensor.seed_after,
        truths=(
            Truth(change=task.change, size_px=in_view_px(task.change, before, after, viewpoint)),
        ),
    )


def _make_shifted(before: SceneState, count: int, seed: int) -> Iterator[Case]:
    # Of their own, so that their number decides no other case.
    rng = np.random.default_rng([seed, 3])
    for number, shifted in enumerate(draw_shifts(before, count, rng)):
        yield Case(
            name=f"shifted_{number:02}",
            part="shifted",
            actions=(shifted.action,),
            viewpoint=shifted.viewpoint,
            sensor_seed=int(rng.integers(1 << 31)),
            truths=(shifted.truth,),
        )


def counts_of(tasks: int, homes: int) -> list[Counts]:
    """Spread cases over homes.

    Args:
        tasks: Number of single changes of all homes.
        homes: Number of homes.

    Returns:
        Numbers of cases of each home.
    """
    wanted = {
        "single": tasks,
        "pair": round(tasks / 6),
        "triple": round(tasks / 6),
        "unchanged": min(200, round(200 * tasks / 300)),
        "shifted": round(tasks / 3),
    }
    shares = {part: even_shares(count, homes) for part, count in wanted.items()}
    return [Counts(**{part: shares[part][home] for part in shares}) for home in range(homes)]
