"""Sampling of single changes of a home, and their scene change tasks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts_sim import changes
from gslts_sim.actions import (
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
from gslts_sim.sensor import NOISE_PRESETS
from gslts_sim.task import Box, Change, Kind, SensorSetup, Task
from gslts_sim.task_viewpoints import (
    NoTaskError,
    candidate_positions,
    initial_viewpoint,
    near_and_far_viewpoints,
)
from gslts_sim.viewpoints import ObjectVisibility

MAX_WITHHELD = 6
"""Maximum number of objects that are removed from the default state of a home, so that they can be
added by tasks; at most a third of the free objects."""
MIN_RELOCATION_M = 0.4
"""Minimum distance of a relocation, m: the boxes before and after do not overlap for most
objects."""


@dataclass(frozen=True, eq=False)
class TaskSettings:
    """Settings that all tasks share.

    Args:
        noise: Preset of the sensor.
        width: Of the images, px.
        height: Of the images, px.
        object_id: The only object that changes; None for all.
        receptacle_id: The only receptacle that objects are put on; then there are no removals. None
            for all.

    Raises:
        ValueError: There is no such preset.
    """

    noise: str = "kinect"
    width: int = 640
    height: int = 480
    object_id: str | None = None
    receptacle_id: str | None = None

    def __post_init__(self) -> None:
        if self.noise not in NOISE_PRESETS:
            known = ", ".join(NOISE_PRESETS)
            raise ValueError(f"TaskSettings: noise must be one of {known}, got {self.noise!r}")


@dataclass(frozen=True, eq=False)
class ProposedChange:
    """A feasible change.

    Args:
        kind: Addition, removal or relocation.
        object_id: Of the changed object.
        actions: That make the change.
        before: The object before the change; None if it is added.
        after: The object after the change; None if it is removed.
    """

    kind: Kind
    object_id: str
    actions: tuple[ChangeAction, ...]
    before: ObjectVisibility | None
    after: ObjectVisibility | None

    @property
    def states(self) -> list[ObjectVisibility]:
        """The object in each of the two states that has it."""
        return [state for state in (self.before, self.after) if state is not None]


class ChangeSampler:
    """Samples changes of a home: movable objects x receptacles x positions.

    Args:
        home: With all its objects.
        settings: Settings that all tasks share.
        rng: Source of all randomness.
        done: Actions so far and the state after them. None removes some objects first, so that
            there is something to add.

    Raises:
        ValueError: The settings ask for an object or receptacle that cannot be used.
    """

    def __init__(
        self,
        home: Home,
        settings: TaskSettings,
        rng: np.random.Generator,
        done: tuple[tuple[ChangeAction, ...], SceneState] | None = None,
    ) -> None:
        self._rng, self._settings = rng, settings
        _require_usable(home, settings)
        if done is None:
            withheld = self._draw_withheld(home) if settings.object_id is None else []
            actions = tuple(DisableObject(objectId=obj.id) for obj in withheld)
            done = (actions, SceneState(home).apply_all(actions))
        self._complete_home = home
        self._initial_actions, self._state = done
        self._home = self._state.home
        self._scene = RayScene(self._home)
        self._sensor_seeds = rng.integers(1 << 31, size=2)

    def advance(self, task: Task) -> ChangeSampler:
        """Return a sampler for the home after a task.

        Args:
            task: A task of this sampler.
        """
        actions = (*task.initial_actions, *task.change_actions)
        done = (actions, task.apply_change(self._state))
        return ChangeSampler(self._complete_home, self._settings, self._rng, done)

    def _draw_withheld(self, home: Home) -> list[HomeObject]:
        free = [obj for obj in _free_objects(home) if obj.id != self._settings.receptacle_id]
        rows = self._rng.permutation(len(free))[: min(MAX_WITHHELD, len(free) // 3)]
        return [free[row] for row in sorted(rows.tolist())]

    def objects(self, kind: Kind) -> list[HomeObject]:
        """Return the objects that can be changed.

        Args:
            kind: Addition, removal or relocation.
        """
        if kind == "addition":
            return list(self._state.removed.values())
        if kind == "removal" and self._settings.receptacle_id is not None:
            return []
        wanted = self._settings.object_id
        return [obj for obj in _free_objects(self._home) if wanted in (None, obj.id)]

    def propose(self, kind: Kind, obj: HomeObject) -> ProposedChange:
        """Sample a change.

        Args:
            kind: Addition, removal or relocation.
            obj: One of `objects(kind)`.

        Raises:
            NoTaskError: The sampled change is impossible.
        """
        before = None
        if kind != "addition":
            before = ObjectVisibility(self._home, self._scene, obj.id)
        if kind == "removal":
            return ProposedChange(kind, obj.id, (DisableObject(objectId=obj.id),), before, None)
        actions: list[ChangeAction] = []
        home = self._home
        if kind == "addition":
            try:
                home = changes.enable(home, obj)
            except changes.ChangeError as reason:
                raise NoTaskError(str(reason)) from None
            actions.append(EnableObject(objectId=obj.id))
        placement = self._draw_placement(home, obj)
        shift = placement.position - obj.world_from_object[:3, 3]
        if kind == "relocation" and np.linalg.norm(shift) < MIN_RELOCATION_M:
            raise NoTaskError(f"moved less than {MIN_RELOCATION_M:g} m")
        x, y, z = placement.position.tolist()
        point = Point(x=x, y=y, z=z)
        actions.append(
            PlaceObjectAtPoint(objectId=obj.id, position=point, rotation=placement.yaw_deg)
        )
        after = ObjectVisibility(placement.home, RayScene(placement.home), obj.id)
        return ProposedChange(kind, obj.id, tuple(actions), before, after)

    def _draw_placement(self, home: Home, obj: HomeObject) -> changes.Placement:
        receptacles = [
            other
            for other in changes.possible_receptacles(home, obj)
            if self._settings.receptacle_id in (None, other.id)
        ]
        if not receptacles:
            raise NoTaskError(f"{obj.type} belongs on the floor")
        receptacle = receptacles[self._rng.integers(len(receptacles))]
        placement = changes.draw_place(home, obj, receptacle, self._rng)
        if placement is None:
            raise NoTaskError(f"no room on a {receptacle.type} for a {obj.type}")
        return placement

    def task(self, source: HomeSource | FileSource, proposal: ProposedChange) -> Task:
        """Make the task of a change.

        Args:
            source: Reference to the home.
            proposal: A change of this sampler.

        Raises:
            NoTaskError: The change is not seen well enough.
        """
        home, targets = self._home, proposal.states
        changed = home.without([proposal.object_id])
        if proposal.after is not None:
            changed = proposal.after.home
        positions = candidate_positions(home, changed, targets, self._rng)
        obj = targets[0].obj
        task = Task(
            home=source,
            sensor=self._sensor_setup(),
            viewpoint=initial_viewpoint(home, targets, positions, self._rng),
            initial_actions=self._initial_actions,
            change_actions=proposal.actions,
            change=Change(
                kind=proposal.kind,
                object_id=obj.id,
                object_type=obj.type,
                box_before=_box(proposal.before),
                box_after=_box(proposal.after),
            ),
            test_viewpoints=near_and_far_viewpoints(home, targets, positions, self._rng),
        )
        try:
            task.apply_change(self._state)
        except ValueError as reason:
            raise NoTaskError(f"does not replay: {reason}") from None
        return task

    def _sensor_setup(self) -> SensorSetup:
        settings = self._settings
        seed_before, seed_after = self._sensor_seeds.tolist()
        return SensorSetup(
            noise=settings.noise,
            width=settings.width,
            height=settings.height,
            seed_before=seed_before,
            seed_after=seed_after,
        )


def _require_usable(home: Home, settings: TaskSettings) -> None:
    """Raise ValueError if the settings ask for an object that the home does not have."""
    if settings.object_id is not None:
        try:
            changes.disable(home, settings.object_id)
        except changes.ChangeError as reason:
            raise ValueError(f"{home.name}: {reason}") from None
    receptacle = settings.receptacle_id
    if receptacle is not None and (receptacle not in home or not home[receptacle].receptacle):
        raise ValueError(f"{home.name}: there is no receptacle {receptacle}")


def _free_objects(home: Home) -> list[HomeObject]:
    """Return the movable objects that stand on something and carry nothing."""
    carrying = {obj.parent for obj in home.objects}
    return [
        obj
        for obj in home.objects
        if obj.movable and obj.parent is not None and obj.id not in carrying
    ]


def _box(target: ObjectVisibility | None) -> Box | None:
    if target is None:
        return None
    low, high = np.round(target.obj.box_in_world, 6).tolist()
    return (tuple(low), tuple(high))
