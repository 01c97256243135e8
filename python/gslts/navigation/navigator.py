"""To a thing that words name: GS-LTS, sec. III-B and IV-D.

A robot is there when the thing is in view and within 1 m, as in SAVN (Wortsman et al. 2019).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.core.robot_body import RobotBody
from gslts.navigation.semantic_map import SemanticMap, make_semantic_map
from gslts.navigation.terrain import Terrain
from gslts.navigation.viewpoints import Lookout, Outlook, Thing
from gslts.navigation.visibility import meant, seen
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.categories import Categories
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.source import SemanticSource
from gslts.types import Floats

Status = Literal["reached", "not found", "unreachable", "lost track"]

SUCCESS_DISTANCE_M = 1.0
"""SAVN's: no farther, along the floor, from the nearest point of the thing."""
WITHIN_M = 0.98
"""What is aimed at: poses err by about a centimetre."""
STEP_M = 0.25
OFF_M = 0.2
"""A robot on a grid of 0.25 m is up to 0.18 m from where it was sent."""
MAX_MOVES = 200
PLACES = 4
"""From so many places a thing is looked for before it counts as gone."""
ASIDE_RAD = (0.0, 0.4, -0.4)
"""To the left and to the right, where it is not in view at once."""
LEAST_SEEN = 0.5
"""Share of the points of a thing which should be seen from a place that must be: depth that is not
where the map has them tells that the thing is gone."""
LEAST_MEANT = 0.25
"""Share of them that must mean it in the picture: what is flat and gone leaves depth as it was."""
AHEAD_PITCH_RAD = 0.4
"""On the way: the robot sees the floor from about 0.7 m ahead on."""


@dataclass(frozen=True, eq=False)
class NavigationResult:
    """How it went.

    Attributes:
        status: Whether it got there, or what kept it.
        reason: In words; empty if it got there.
        path: [P,2] positions of the robot as it estimates them, x and y in the world, m.
        frame: The last that it saw, with its pose.
        replans: How often the way was not as planned.
        distance_m: From its last place to the nearest point of the thing, along the floor; None if
            it did not get there.
    """

    status: Status
    reason: str
    path: Floats
    frame: RgbdFrame
    replans: int
    distance_m: float | None = None

    @property
    def length_m(self) -> float:
        """Of its way."""
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())


class Navigator:
    """Leads robots through one map.

    Args:
        gaussian_map: float32, with features.
        autoencoder: Of the features.
        source: Of words.
        body: Of the robot.
        categories: Layers of the semantic map; none is needed to go to a thing.

    Raises:
        ValueError: The features are not those of the autoencoder, or the map is empty.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        autoencoder: Autoencoder,
        source: SemanticSource,
        body: RobotBody | None = None,
        categories: Sequence[str] = (),
    ) -> None:
        self.body = RobotBody() if body is None else body
        self.gaussian_map, self.source = gaussian_map, source
        self.queries = SemanticQueries(gaussian_map, autoencoder, source)
        self.semantic_map: SemanticMap = make_semantic_map(
            gaussian_map, self.body, Categories(tuple(categories), autoencoder, source)
        )

    def go(
        self, robot: Robot, text: str, tell: Callable[[], None] = lambda: None
    ) -> NavigationResult:
        """Lets a robot go to the nearest thing that fits a text, and look at it.

        Args:
            robot: In the home of the map.
            text: Such as "sofa".
            tell: Is told of each move.

        Returns:
            How it went; what can be expected to fail is told there.

        Raises:
            ValueError: The text is empty.
        """
        things = [Thing.of(self.gaussian_map, one) for one in self.queries.find(text)]
        return _Trip(self, robot, text, tell).to(things)


@dataclass(frozen=True, eq=False)
class _Goal:
    """A place to go to, and what should be seen from there.

    Attributes:
        place: (2,) m.
        key: Rows of the thing and of the place.
        outlook: From the place to the thing.
    """

    place: Floats
    key: tuple[int, int]
    outlook: Outlook


class _Trip:
    """A robot on its way."""

    def __init__(
        self, navigator: Navigator, robot: Robot, text: str, tell: Callable[[], None]
    ) -> None:
        self._robot, self._text, self._tell = robot, text, tell
        self._source = navigator.source
        self._terrain = Terrain(navigator.semantic_map, navigator.body)
        self._frame = robot.observe()
        self._places = robot.reachable_positions()
        self._lookout = Lookout(navigator.gaussian_map, self._frame.camera)
        self._outlooks: dict[tuple[int, int], Outlook] = {}
        self._done: set[tuple[int, int]] = set()
        self._way = [self._here]
        self._replans = self._steps = 0

    @property
    def _here(self) -> Floats:
        """(2,) where the robot believes to be."""
        here: Floats = self._frame.camera.world_from_camera[:2, 3].copy()
        return here

    def to(self, things: Sequence[Thing]) -> NavigationResult:
        """Goes to the nearest of some things that it gets to see."""
        name = self._text
        if not things:
            return self._ended("not found", f"the map knows no {name}")
        if not self._terrain.is_known(self._here):
            x, y = self._here.tolist()
            return self._ended("lost track", f"the map knows no floor around ({x:.2f}, {y:.2f})")
        looked = [0] * len(things)
        while self._steps < MAX_MOVES:
            goal = self._nearest([k for k, times in enumerate(looked) if times < PLACES], things)
            if goal is None and any(looked):
                return self._ended("not found", f"no {name} is where the map has one")
            if goal is None:
                return self._ended("unreachable", self._why_not(things))
            if not self._walk(goal):
                continue
            thing = things[goal.key[0]]
            if self._sees(thing, goal):
                distance_m = float(thing.distances_m(self._here[None])[0])
                return self._ended("reached", "", distance_m)
            looked[goal.key[0]] += 1
            self._done.add(goal.key)
        return self._ended("lost track", f"it was not there after {self._steps} moves")

    def _ended(
        self, status: Status, reason: str, distance_m: float | None = None
    ) -> NavigationResult:
        way = np.array(self._way)
        return NavigationResult(status, reason, way, self._frame, self._replans, distance_m)

    def _why_not(self, things: Sequence[Thing]) -> str:
        where = f"within {SUCCESS_DISTANCE_M:g} m of any {self._text}"
        if not any((one.distances_m(self._places) <= WITHIN_M).any() for one in things):
            return f"the robot can stand at no place {where}"
        return f"no way leads to a place {where} that it can be seen from"

    def _nearest(self, wanted: Sequence[int], things: Sequence[Thing]) -> _Goal | None:
        """The place with the shortest way from which one of the things should be seen."""
        metres = self._terrain.metres(self._here, self._places)
        order = []
        for number in wanted:
            near = things[number].distances_m(self._places) <= WITHIN_M
            rows = np.flatnonzero(near & np.isfinite(metres)).tolist()
            order += [(float(metres[row]), number, row) for row in rows]
        for _, number, row in sorted(order):
            key, place = (number, row), self._places[row]
            if key in self._done:
                continue
            if key not in self._outlooks:
                self._outlooks[key] = self._lookout.outlook(place, things[number])
            if self._outlooks[key].enough:
                return _Goal(place, key, self._outlooks[key])
        return None

    def _walk(self, goal: _Goal) -> bool:
        """Goes to a place in steps; False as soon as the way is not as planned."""
        way = self._terrain.way(self._here, goal.place)
        if way.reason:
            self._done.add(goal.key)
            return False
        corners = list(way.points[1:])
        while np.linalg.norm(goal.place - self._here) > OFF_M / 2 and self._steps < MAX_MOVES:
            target = self._ahead(corners)
            x, y = (target - self._here).tolist()
            arrived = self._move(target, float(np.arctan2(y, x)), AHEAD_PITCH_RAD)
            is_off = not arrived or np.linalg.norm(self._here - target) > OFF_M
            if is_off:
                self._terrain.block(target, self._here)
            is_new = self._terrain.learns(self._frame)
            if is_off or (is_new and not self._terrain.is_free([self._here, *corners[:-1]])):
                self._replans += 1
                return False
            if target is corners[-1]:
                break
        return True

    def _ahead(self, corners: list[Floats]) -> Floats:
        """(2,) the point a step ahead on a way, whose passed corners are removed."""
        left, at = STEP_M, self._here
        while len(corners) > 1 and np.linalg.norm(corners[0] - at) <= left:
            left -= float(np.linalg.norm(corners[0] - at))
            at = corners.pop(0)
        way = corners[0] - at
        metres = float(np.linalg.norm(way))
        return corners[0] if metres <= left else at + way * (left / metres)

    def _move(self, place: Floats, yaw_rad: float, pitch_rad: float) -> bool:
        arrived = self._robot.move_towards(place, yaw_rad, pitch_rad)
        self._frame = self._robot.observe()
        self._steps += 1
        self._way.append(self._here)
        self._tell()
        return arrived

    def _sees(self, thing: Thing, goal: _Goal) -> bool:
        """Whether the thing is in view, at once or after a look around."""
        outlook = goal.outlook
        expected = thing.points[outlook.seen]
        for aside_rad in ASIDE_RAD:
            self._move(goal.place, outlook.yaw_rad + aside_rad, outlook.pitch_rad)
            frame = self._frame.registered()
            near = thing.distances_m(self._here[None])[0] <= SUCCESS_DISTANCE_M
            if near and self._shows(frame, expected):
                return True
        return False

    def _shows(self, frame: RgbdFrame, points: Floats) -> bool:
        """Whether a registered frame shows a thing, of which these points should be seen."""
        if seen(points, frame.camera, frame.depth).mean() < LEAST_SEEN:
            return False
        try:
            found = meant(points, frame, self._source, self._text)
        except ValueError:  # The source knows words only, or the frame has no labels.
            return True
        return bool(found.mean() >= LEAST_MEANT)
