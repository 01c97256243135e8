"""One change of a home and the viewpoints that see it: what a scene change task is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.types import Floats
from gslts_sim import changes
from gslts_sim.actions import (
    GRID_M,
    ChangeAction,
    DisableObject,
    EnableObject,
    PlaceObjectAtPoint,
    Point,
    SceneState,
)
from gslts_sim.home import Home, HomeObject
from gslts_sim.home_source import FileSource, HomeSource
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import Viewpoint, floor_of
from gslts_sim.sensor import NOISE_PRESETS
from gslts_sim.task import (
    VIEWPOINTS,
    Box,
    Change,
    Kind,
    SensorSetup,
    Task,
    TestViewpoints,
)
from gslts_sim.viewpoints import SIZE_PX, ObjectVisibility, camera_positions, viewpoint_towards

NEAR_M = 1.75
"""Test viewpoints nearer to the change than this are near ones."""
DISTANCE_M = (0.7, 5.0)
"""Of a viewpoint from the middle of the object, in every state."""
KEPT_ASIDE = 6
"""Objects of a home that its default state lacks, at most."""
MOVED_M = 0.4
"""Relocated objects go at least as far."""
FIRST_VIEW_FRACTION = np.array([0.001, 0.25])
"""Share of the image that the object may take at the initial viewpoint, in each state with it."""
TEST_SHARE_PX = 0.0002
"""The same at a test viewpoint, in one state."""
MIN_VISIBLE_FRACTION = 0.3
"""Share of the object's points that must be seen from a place before its views are looked at."""
LOOKS_PER_PLACE = 2
"""Test viewpoints at one place, in different directions, at most."""
JITTER_DEG = 12.0


class NoTaskError(Exception):
    """Why a change makes no task."""


@dataclass(frozen=True, eq=False)
class TaskSettings:
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
class Trial:
    """A change that can be done: the object before and after, None where it is not there."""

    kind: Kind
    object_id: str
    actions: tuple[ChangeAction, ...]
    before: ObjectVisibility | None
    after: ObjectVisibility | None

    @property
    def states(self) -> list[ObjectVisibility]:
        """Those of the two that have the object."""
        return [sight for sight in (self.before, self.after) if sight is not None]


class Traversal:
    """A home whose objects are traversed: movable objects x receptacles x places.

    Args:
        home: With all its objects.
        setting: What all tasks have in common.
        rng: Decides everything.
        done: What was done to the home, and how it is since. None means that some objects are taken
            aside, so that there is something to add.

    Raises:
        ValueError: The setting asks for an object or receptacle that cannot be used.
    """

    def __init__(
        self,
        home: Home,
        setting: TaskSettings,
        rng: np.random.Generator,
        done: tuple[tuple[ChangeAction, ...], SceneState] | None = None,
    ) -> None:
        self._rng, self._setting = rng, setting
        _refuse_impossible(home, setting)
        if done is None:
            aside = self._draw_aside(home) if setting.object_id is None else []
            actions = tuple(DisableObject(objectId=thing.id) for thing in aside)
            done = (actions, SceneState(home).apply_all(actions))
        self._whole = home
        self._initial, self._state = done
        self._home, self._aside = self._state.home, self._state.removed
        self._scene = RayScene(self._home)
        self._sensor_seeds = rng.integers(1 << 31, size=2)

    def advance(self, task: Task) -> Traversal:
        """Of the home in which a task was done."""
        actions = (*task.initial_actions, *task.change_actions)
        done = (actions, task.apply_change(self._state))
        return Traversal(self._whole, self._setting, self._rng, done)

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

    def trial(self, kind: Kind, thing: HomeObject) -> Trial:
        """A change of that kind, by chance.

        Raises:
            NoTaskError: It is not possible.
        """
        before = None if kind == "addition" else ObjectVisibility(self._home, self._scene, thing.id)
        if kind == "removal":
            return Trial(kind, thing.id, (DisableObject(objectId=thing.id),), before, None)
        actions: list[ChangeAction] = []
        home = self._home
        if kind == "addition":
            try:
                home = changes.enable(home, thing)
            except changes.ChangeError as reason:
                raise NoTaskError(str(reason)) from None
            actions.append(EnableObject(objectId=thing.id))
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
            raise NoTaskError(f"no room on a {receptacle.type} for a {thing.type}")
        way = drawn.position - thing.world_from_object[:3, 3]
        if kind == "relocation" and np.linalg.norm(way) < MOVED_M:
            raise NoTaskError(f"moved less than {MOVED_M:g} m")
        x, y, z = drawn.position.tolist()
        actions.append(
            PlaceObjectAtPoint(
                objectId=thing.id, position=Point(x=x, y=y, z=z), rotation=drawn.yaw_deg
            )
        )
        after = ObjectVisibility(drawn.home, RayScene(drawn.home), thing.id)
        return Trial(kind, thing.id, tuple(actions), before, after)

    def task(self, source: HomeSource | FileSource, trial: Trial) -> Task:
        """The task of a change.

        Raises:
            NoTaskError: It is not seen well enough.
        """
        changed = self._home.without([trial.object_id]) if trial.after is None else trial.after.home
        floors = [floor_of(self._home), floor_of(changed)]
        places = floors[0].grid_positions(GRID_M)
        places = places[[floors[1].can_stand(place) for place in places]]
        eyes = camera_positions(self._home, places)
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
        task = Task(
            home=source,
            sensor=SensorSetup(
                noise=setting.noise,
                width=setting.width,
                height=setting.height,
                seed_before=seed_before,
                seed_after=seed_after,
            ),
            viewpoint=first,
            initial_actions=self._initial,
            change_actions=trial.actions,
            change=Change(
                kind=trial.kind,
                object_id=thing.id,
                object_type=thing.type,
                box_before=_box(trial.before),
                box_after=_box(trial.after),
            ),
            test_viewpoints=TestViewpoints(near=tuple(near), far=tuple(far)),
        )
        try:
            task.apply_change(self._state)
        except ValueError as reason:
            raise NoTaskError(f"does not replay: {reason}") from None
        return task

    def _first_look(self, trial: Trial, places: Floats) -> Viewpoint:
        """A look that sees the object in every state that has it."""
        shares = np.min([sight.visible_fraction(places) for sight in trial.states], axis=0)
        target = np.mean([sight.middle for sight in trial.states], axis=0)
        least, most = FIRST_VIEW_FRACTION * np.prod(SIZE_PX)
        for place in places[shares >= MIN_VISIBLE_FRACTION]:
            look = viewpoint_towards(self._home, place, target, self._jitter())
            if all(least <= sight.visible_px(look) <= most for sight in trial.states):
                return look
        raise NoTaskError("not seen from one place in all states")

    def _test_looks(self, trial: Trial, places: Floats) -> tuple[list[Viewpoint], list[Viewpoint]]:
        """Looks that see the object in one of its states, near and far ones."""
        near: list[Viewpoint] = []
        far: list[Viewpoint] = []
        shares = [sight.visible_fraction(places) for sight in trial.states]
        order = [(turn, row) for turn in range(LOOKS_PER_PLACE) for row in range(len(places))]
        for turn, number in order:
            place, state = places[number], (turn + number) % len(trial.states)
            sight = trial.states[state]
            distance = float(
                np.linalg.norm(camera_positions(self._home, place[None]) - sight.middle)
            )
            found = near if distance < NEAR_M else far
            if len(found) == VIEWPOINTS or shares[state][number] < MIN_VISIBLE_FRACTION:
                continue
            look = viewpoint_towards(self._home, place, sight.middle, self._jitter())
            known = any(look == other for other in found)
            if not known and sight.visible_px(look) >= TEST_SHARE_PX * np.prod(SIZE_PX):
                found.append(look)
        for name, found in (("near", near), ("far", far)):
            if len(found) < VIEWPOINTS:
                raise NoTaskError(f"seen from fewer than {VIEWPOINTS} {name} viewpoints")
        return near, far

    def _jitter(self) -> Floats:
        return self._rng.uniform(-JITTER_DEG, JITTER_DEG, 2)


def _refuse_impossible(home: Home, setting: TaskSettings) -> None:
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
    """Movable objects that stand on something, and on which nothing stands."""
    carrying = {thing.parent for thing in home.objects}
    return [
        thing
        for thing in home.objects
        if thing.movable and thing.parent is not None and thing.id not in carrying
    ]


def _box(sight: ObjectVisibility | None) -> Box | None:
    if sight is None:
        return None
    low, high = np.round(sight.thing.box_in_world, 6).tolist()
    return (tuple(low), tuple(high))
