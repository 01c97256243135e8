"""What change detection is asked: frames of homes in which one, several or no objects changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import BaseModel

from gslts.bench.detect_several import SeveralMaker
from gslts.bench.detect_truth import Truth, in_view_px
from gslts.bench.homes import BenchHome, default_state, shares_of
from gslts.frame import RgbdFrame
from gslts.sim.actions import GRID_M, ChangeAction, SceneState
from gslts.sim.controller import Controller
from gslts.sim.home import Floats, Home
from gslts.sim.home_source import STRICT, HomeSource
from gslts.sim.robot_body import Look, floor_of
from gslts.sim.sensor import NOISE_PRESETS, SensorNoise
from gslts.sim.task import Task, Viewpoint

CASES_CODE = ("bench/detect_cases", "bench/detect_several", "bench/detect_truth")

Part = Literal["single", "pair", "triple", "unchanged"]
PARTS: tuple[Part, ...] = ("single", "pair", "triple", "unchanged")

VISIT_POSITION_M, VISIT_ROTATION_DEG = 0.01, 0.5
"""Root mean square of the length of the error of the position, and of the angle of the error of the
rotation, of visits of unchanged homes."""
LIGHT_SHIFT_M = 0.5
"""By which the light of one lamp is moved sideways, before such a visit."""
VISIT_HORIZON_DEG = (0.0, 30.0)
"""As a robot looks that records a home."""
TRIES = 100
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
                    viewpoint=Viewpoint.of(found.look),
                    sensor_seed=int(rng.integers(1 << 31)),
                    truths=found.truths,
                )
            )
            tell(part)
    for number in range(counts.unchanged):
        cases.append(_visit(number, before.home, rng))
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
    state = before
    for action in case.actions:
        state = state.after(action)
    noise = NOISE_PRESETS[bench.setup.noise]
    if case.part == "unchanged":
        noise = noise_of_visit(noise)
    if case.light_shift_m is not None:
        state = SceneState(with_light_moved(state.home, case.light_shift_m), state.aside)
    robot = Controller(
        state,
        width=bench.setup.width,
        height=bench.setup.height,
        noise=noise,
        seed=case.sensor_seed,
    )
    robot.go(case.viewpoint.look)
    return robot.observe()


def noise_of_visit(noise: SensorNoise) -> SensorNoise:
    """The same but for the pose, whose error is that of visits of unchanged homes."""
    return replace(
        noise,
        position_std_m=VISIT_POSITION_M / np.sqrt(3),
        rotation_std_rad=np.deg2rad(VISIT_ROTATION_DEG) / np.sqrt(3),
    )


def with_light_moved(home: Home, shift_m: tuple[float, float]) -> Home:
    """The home with the light of its first lamp elsewhere, and the lamp where it was.

    Raises:
        ValueError: It has no lamp.
    """
    lamp = next((thing for thing in home.objects if thing.lights), None)
    if lamp is None:
        raise ValueError(f"{home.name}: there is no lamp whose light could be moved")
    shift = lamp.world_from_object[:3, :3].T @ np.array([*shift_m, 0.0])
    first, *others = lamp.lights
    moved = replace(first, center=first.center + shift)
    return home.with_object(replace(lamp, lights=(moved, *others)))


def _single(number: int, task: Task, before: SceneState) -> Case:
    after = before
    for action in task.change_actions:
        after = after.after(action)
    look = task.viewpoint.look
    return Case(
        name=f"single_{number:02}",
        part="single",
        actions=task.change_actions,
        viewpoint=task.viewpoint,
        sensor_seed=task.sensor.seed_after,
        truths=(Truth(change=task.change, size_px=in_view_px(task.change, before, after, look)),),
    )


def _visit(number: int, home: Home, rng: np.random.Generator) -> Case:
    """A look between the places and directions of a recording, whose grids are known."""
    angle = 2 * np.pi * rng.uniform()
    shift = LIGHT_SHIFT_M * np.array([np.cos(angle), np.sin(angle)])
    look = Look(
        _place(home, rng),
        round(float(rng.uniform(0, 360)), 1),
        round(float(rng.uniform(*VISIT_HORIZON_DEG)), 1),
    )
    x, y = np.round(shift, 4).tolist()
    return Case(
        name=f"unchanged_{number:02}",
        part="unchanged",
        viewpoint=Viewpoint.of(look),
        sensor_seed=int(rng.integers(1 << 31)),
        light_shift_m=(x, y),
    )


def _place(home: Home, rng: np.random.Generator) -> Floats:
    floor = floor_of(home)
    places = floor.places(GRID_M)
    place = places[rng.integers(len(places))]
    for _ in range(TRIES):
        near: Floats = np.round(place + rng.uniform(-GRID_M / 2, GRID_M / 2, 2), 3)
        if floor.can_stand(near):
            return near
    kept: Floats = place
    return kept


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
