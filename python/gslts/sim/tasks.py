"""Scene change tasks by the hundred: movable objects x receptacles x places.

All tasks of a home share its default state, so that one map serves them all; some objects are kept
out of it for additions.

Source: GS-LTS, sec. IV-A, Scene Change Adaptation Benchmark.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gslts.sim import changes
from gslts.sim.controller import GRID_M, floor_of
from gslts.sim.home import Floats, Home, HomeObject
from gslts.sim.home_source import FileSource, HomeSource
from gslts.sim.ray_scene import RayScene
from gslts.sim.sensor import NOISE_PRESETS
from gslts.sim.task import Action, Box, Change, Place2d, SensorSetup, Task, Viewpoint, ViewpointSets
from gslts.sim.viewpoints import SIZE_PX, Look, Sight, eyes_above, look_from

Kind = Literal["addition", "removal", "relocation"]
KINDS: tuple[Kind, ...] = ("addition", "removal", "relocation")

NEAR_M = 1.75
"""Test viewpoints nearer to the change than this are near ones."""
DISTANCE_M = (0.7, 5.0)
"""Of a viewpoint from the middle of the object, in every state."""
VIEWPOINTS = 10
"""Of each sort."""
KEPT_ASIDE = 6
"""Objects of a home that its default state lacks, at most."""
MOVED_M = 0.4
"""Relocated objects go at least as far."""
FIRST_SHARE_PX = np.array([0.001, 0.25])
"""Share of the image that the object may take at the initial viewpoint, in each state with it."""
TEST_SHARE_PX = 0.0002
"""The same at a test viewpoint, in one state."""
SEEN_SHARE = 0.3
"""Share of the object's points that must be seen from a place before its views are looked at."""
LOOKS_PER_PLACE = 2
"""Test viewpoints at one place, in different directions, at most."""
JITTER_DEG = 12.0
TRIES_PER_TASK = 12
"""Changes that are tried for each task that a home is to give."""
PATIENCE = 5
"""So many changes of a kind may fail in a home before other kinds get ahead by one task."""


class NoTaskError(Exception):
    """Why a change makes no task."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What all tasks have in common.

    Args:
        noise: Preset of the sensor.
        width: Of the images, px.
        height: Of the images, px.
        object_id: The only object that changes, if not None.
        receptacle_id: The only receptacle that objects go to, if not None; none is removed then.
    """

    noise: str = "kinect"
    width: int = 640
    height: int = 480
    object_id: str | None = None
    receptacle_id: str | None = None

    def __post_init__(self) -> None:
        if self.noise not in NOISE_PRESETS:
            known = ", ".join(NOISE_PRESETS)
            raise ValueError(f"Setting: noise must be one of {known}, got {self.noise!r}")


@dataclass(frozen=True, eq=False)
class _Trial:
    """A change that can be done: the object before and after, None where it is not there."""

    kind: Kind
    object_id: str
    actions: tuple[Action, ...]
    before: Sight | None
    after: Sight | None

    @property
    def states(self) -> list[Sight]:
        return [sight for sight in (self.before, self.after) if sight is not None]


class TaskMaker:
    """Makes tasks, as many of each kind, and of every type of object if it can.

    Args:
        setting: What they have in common.
        seed: Same seed and same homes, same tasks.

    Attributes:
        refused: How often changes were refused, for each reason.
    """

    def __init__(self, setting: Setting, seed: int) -> None:
        self.refused: Counter[str] = Counter()
        self._setting, self._seed = setting, seed
        self._homes = 0
        self._kinds: Counter[Kind] = Counter()
        self._types: Counter[str] = Counter()

    def make(self, source: HomeSource | FileSource, home: Home, count: int) -> list[Task]:
        """Up to `count` tasks of a home.

        Raises:
            ValueError: The setting asks for an object or receptacle that cannot be used.
        """
        rng = np.random.default_rng([self._seed, self._homes])
        self._homes += 1
        traversal = _Home(home, self._setting, rng)
        tasks: list[Task] = []
        left = {kind: traversal.objects(kind) for kind in KINDS}
        failures: Counter[Kind] = Counter()
        for _ in range(TRIES_PER_TASK * count):
            kinds = [kind for kind in KINDS if left[kind]]
            if len(tasks) == count or not kinds:
                break
            # The kind that is behind, unless this home keeps refusing it.
            kind = min(kinds, key=lambda name: self._kinds[name] + failures[name] // PATIENCE)
            due = [thing for thing in left[kind] if self._type_is_due(thing.type)] or left[kind]
            thing = due[rng.integers(len(due))]
            try:
                tasks.append(traversal.task(source, traversal.trial(kind, thing)))
            except NoTaskError as reason:
                self.refused[str(reason)] += 1
                failures[kind] += 1
                if kind == "removal":  # Nothing about it could turn out otherwise.
                    left[kind].remove(thing)
                continue
            self._kinds[kind] += 1
            self._types[thing.type] += 1
            if kind == "removal" or self._setting.object_id is None:
                left[kind].remove(thing)
        return tasks

    def _type_is_due(self, name: str) -> bool:
        """Whether a type has not had more than its share yet."""
        mean = self._types.total() / max(1, len(self._types))
        return self._types[name] <= mean


class _Home:
    """A home whose objects are traversed."""

    def __init__(self, home: Home, setting: Setting, rng: np.random.Generator) -> None:
        self._rng, self._setting = rng, setting
        _refuse_impossible(home, setting)
        aside = self._draw_aside(home) if setting.object_id is None else []
        self._aside = {thing.id: thing for thing in aside}
        self._initial = tuple(_disable(thing.id) for thing in aside)
        self._home = home.without(self._aside)
        self._scene = RayScene(self._home)
        self._sensor_seeds = rng.integers(1 << 31, size=2)

    def _draw_aside(self, home: Home) -> list[HomeObject]:
        free = [thing for thing in _free_objects(home) if thing.id != self._setting.receptacle_id]
        rows = self._rng.permutation(len(free))[: min(KEPT_ASIDE, len(free) // 3)]
        return [free[row] for row in sorted(rows.tolist())]

    def objects(self, kind: Kind) -> list[HomeObject]:
        """What can be added, removed or relocated."""
        if kind == "addition":
            return list(self._aside.values())
        if kind == "removal" and self._setting.receptacle_id is not None:
            return []
        wanted = self._setting.object_id
        return [thing for thing in _free_objects(self._home) if wanted in (None, thing.id)]

    def trial(self, kind: Kind, thing: HomeObject) -> _Trial:
        """A change of that kind, by chance.

        Raises:
            NoTaskError: It is not possible.
        """
        before = None if kind == "addition" else Sight(self._home, self._scene, thing.id)
        if kind == "removal":
            return _Trial(kind, thing.id, (_disable(thing.id),), before, None)
        actions: list[Action] = []
        home = self._home
        if kind == "addition":
            home = changes.enable(home, thing)
            actions.append(Action(action="EnableObject", arguments={"objectId": thing.id}))
        receptacles = [
            other
            for other in changes.possible_receptacles(home, thing)
            if self._setting.receptacle_id in (None, other.id)
        ]
        if not receptacles:
            raise NoTaskError(f"{thing.type} belongs on the floor")
        receptacle = receptacles[self._rng.integers(len(receptacles))]
        drawn = changes.draw_place(home, thing, receptacle, self._rng)
        if drawn is None:
            raise NoTaskError("no room on the receptacle")
        way = drawn.position - thing.world_from_object[:3, 3]
        if kind == "relocation" and np.linalg.norm(way) < MOVED_M:
            raise NoTaskError(f"moved less than {MOVED_M:g} m")
        x, y, z = drawn.position.tolist()
        arguments = {
            "objectId": thing.id,
            "position": {"x": x, "y": y, "z": z},
            "rotation": drawn.yaw_deg,
        }
        actions.append(Action(action="PlaceObjectAtPoint", arguments=arguments))
        after = Sight(drawn.home, RayScene(drawn.home), thing.id)
        return _Trial(kind, thing.id, tuple(actions), before, after)

    def task(self, source: HomeSource | FileSource, trial: _Trial) -> Task:
        """The task of a change.

        Raises:
            NoTaskError: It is not seen well enough.
        """
        changed = self._home.without([trial.object_id]) if trial.after is None else trial.after.home
        floors = [floor_of(self._home), floor_of(changed)]
        places = floors[0].places(GRID_M)
        places = places[[floors[1].can_stand(place) for place in places]]
        eyes = eyes_above(self._home, places)
        for sight in trial.states:
            metres = np.linalg.norm(eyes - sight.middle, axis=1)
            kept = (metres >= DISTANCE_M[0]) & (metres <= DISTANCE_M[1])
            places, eyes = places[kept], eyes[kept]
        if len(places) == 0:
            raise NoTaskError("not seen from one place in all states")
        places = places[self._rng.permutation(len(places))]
        first = self._first_look(trial, places)
        near, far = self._test_looks(trial, places)
        setting = self._setting
        seed_before, seed_after = self._sensor_seeds.tolist()
        thing = trial.states[0].thing
        return Task(
            home=source,
            sensor=SensorSetup(
                noise=setting.noise,
                width=setting.width,
                height=setting.height,
                seed_before=seed_before,
                seed_after=seed_after,
            ),
            viewpoint=_viewpoint(first),
            initial_actions=self._initial,
            change_actions=trial.actions,
            change=Change(
                kind=trial.kind,
                object_id=thing.id,
                object_type=thing.type,
                box_before=_box(trial.before),
                box_after=_box(trial.after),
            ),
            test_viewpoints=ViewpointSets(
                near=tuple(map(_viewpoint, near)), far=tuple(map(_viewpoint, far))
            ),
        )

    def _first_look(self, trial: _Trial, places: Floats) -> Look:
        """A look that sees the object in every state that has it."""
        shares = np.min([sight.seen_share(places) for sight in trial.states], axis=0)
        target = np.mean([sight.middle for sight in trial.states], axis=0)
        least, most = FIRST_SHARE_PX * np.prod(SIZE_PX)
        for place in places[shares >= SEEN_SHARE]:
            look = look_from(self._home, place, target, self._jitter())
            if all(least <= sight.seen_px(look) <= most for sight in trial.states):
                return look
        raise NoTaskError("not seen from one place in all states")

    def _test_looks(self, trial: _Trial, places: Floats) -> tuple[list[Look], list[Look]]:
        """Looks that see the object in one of its states, near and far ones."""
        near: list[Look] = []
        far: list[Look] = []
        shares = [sight.seen_share(places) for sight in trial.states]
        order = [row for _ in range(LOOKS_PER_PLACE) for row in range(len(places))]
        for turn, number in enumerate(order):
            place, state = places[number], turn % len(trial.states)
            sight = trial.states[state]
            distance = float(np.linalg.norm(eyes_above(self._home, place[None]) - sight.middle))
            found = near if distance < NEAR_M else far
            if len(found) == VIEWPOINTS or shares[state][number] < SEEN_SHARE:
                continue
            look = look_from(self._home, place, sight.middle, self._jitter())
            if sight.seen_px(look) >= TEST_SHARE_PX * np.prod(SIZE_PX):
                found.append(look)
        for name, found in (("near", near), ("far", far)):
            if len(found) < VIEWPOINTS:
                raise NoTaskError(f"seen from fewer than {VIEWPOINTS} {name} viewpoints")
        return near, far

    def _jitter(self) -> Floats:
        return self._rng.uniform(-JITTER_DEG, JITTER_DEG, 2)


def _refuse_impossible(home: Home, setting: Setting) -> None:
    """Raises ValueError where a setting asks for what the home does not have."""
    if setting.object_id is not None:
        try:
            changes.disable(home, setting.object_id)
        except changes.ChangeError as reason:
            raise ValueError(f"{home.name}: {reason}") from None
    on = setting.receptacle_id
    if on is not None and (on not in home or not home[on].receptacle):
        raise ValueError(f"{home.name}: there is no receptacle {on}")


def _free_objects(home: Home) -> list[HomeObject]:
    """Movable objects on which nothing stands."""
    carrying = {thing.parent for thing in home.objects}
    return [thing for thing in home.objects if thing.movable and thing.id not in carrying]


def _disable(object_id: str) -> Action:
    return Action(action="DisableObject", arguments={"objectId": object_id})


def _viewpoint(look: Look) -> Viewpoint:
    x, y = look.place.tolist()
    return Viewpoint(position=Place2d(x=x, y=y), rotation=look.yaw_deg, horizon=look.horizon_deg)


def _box(sight: Sight | None) -> Box | None:
    if sight is None:
        return None
    low, high = np.round(sight.thing.box_in_world, 6).tolist()
    return (tuple(low), tuple(high))
