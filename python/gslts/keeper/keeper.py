"""Rounds through a home, on which its map is kept up to date."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gslts.change.changes import Change
from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import ChangeMonitor, MonitorConfig
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.keeper.coverage import go_to, stops_of
from gslts.keeper.schedule import defer, next_changes
from gslts.keeper.state import LoopState, read_state, write_state
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_files import require_landmarks
from gslts.localization.localizer import Localizer
from gslts.localization.relocalizer import Relocalizer
from gslts.robots.localized import LocalizedRobot
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.camera_files import cameras_of_map, cameras_of_update
from gslts.store.map_folder import open_map
from gslts.store.records import Version
from gslts.update.config import UpdateConfig
from gslts.update.publish import published
from gslts.update.updater import Update, update


@dataclass(frozen=True)
class LoopConfig:
    """How a robot goes its rounds.

    Attributes:
        stops: Of a round, at most.
        looks: At one stop, while something is suspected, at most.
        watch: When a change is believed.
        detection: Of changes.
        update: Of the map.
        locate: How the robot finds out where in the map it is; None means that its odometry tells.
    """

    stops: int = 40
    looks: int = 4
    # The robot waits for what the watch says.
    watch: MonitorConfig = field(default_factory=lambda: MonitorConfig(rate_hz=1e6))
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    update: UpdateConfig = field(default_factory=UpdateConfig)
    locate: RelocalizationConfig | None = None

    def __post_init__(self) -> None:
        if self.stops < 1 or self.looks < 1:
            raise ValueError("LoopConfig: stops and looks must be positive")


class StoppedError(Exception):
    """Somebody wants the robot to stop; what it was about to do is done at the next start."""


class MapKeeper:
    """Keeps one map up to date; a context manager, which is its only writer.

    Args:
        folder: Of the map.
        config: Settings; None means the defaults.
        stopping: Whether to stop at the next safe point.
        tell: Is told of each step of what takes long.
        say: Is told what was found and done, in words.

    Raises:
        OSError: The map cannot be read, or another process writes it.
        ValueError: It is no map with versions, what is known of its rounds is damaged, or the robot
            is to be located and the map has no landmarks.
    """

    def __init__(
        self,
        folder: Path,
        config: LoopConfig | None = None,
        *,
        stopping: Callable[[], bool] = lambda: False,
        tell: Callable[[str], None] = lambda _: None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._folder, self._config = folder, LoopConfig() if config is None else config
        self._stopping, self._tell, self._say = stopping, tell, say
        self._store = open_map(folder, writable=True)
        try:
            self.state = read_state(folder)
            self._map = self._store.read()
            self._cameras = cameras_of_map(folder)
            self._semantics = MapSemantics.of_map(folder, self._config.update.threads)
            self._detector = self._detector_of_map()
            self._localizer = None
            if self._config.locate is not None:
                self._localizer = Localizer(self._relocalizer_of_map())
            self._watch = ChangeMonitor(self._detector, self._config.watch)
        except BaseException:
            self._store.close()
            raise
        self._last: RgbdFrame | None = None

    def __enter__(self) -> MapKeeper:
        return self

    def __exit__(self, *_: object) -> None:
        self._watch.close()
        self._store.close()

    @property
    def version(self) -> Version:
        """The newest one."""
        return self._store.version()

    @property
    def gaussian_map(self) -> GaussianMap:
        """Of the newest version."""
        return self._map

    @property
    def semantics(self) -> MapSemantics | None:
        """Semantics of the map; None if it has none, or its models are not available."""
        return self._semantics

    def watch(self, frame: RgbdFrame) -> None:
        """Looks for changes in what a robot sees on an errand."""
        self._watch.offer(frame)
        self._watch.wait()

    def attend(self, robot: Robot) -> None:
        """Repairs what is certain to have changed, for which the robot goes there.

        Args:
            robot: In the home.

        Raises:
            StoppedError: As `stopping` wished.
            OSError: Something cannot be written; the map is that of its newest version.
        """
        self._repair(robot, self._reported())

    def rounds_of(self, source: str) -> int:
        """How many rounds of a source of frames are done; those of another one begin anew.

        Raises:
            OSError: The state cannot be written.
        """
        if self.state.source != source:
            self._become(source=source, of_source=0, left=None)
        return self.state.of_source

    def go_round(self, robot: Robot, viewpoints: Mapping[str, Camera] | None = None) -> None:
        """Goes on with the round, or begins one, and repairs what changed on the way.

        Args:
            robot: In the home.
            viewpoints: Where to look from, in this order, by name; None means some of those that
                the map was made from, which show it. Where the robot cannot go now, it does not
                look.

        Raises:
            StoppedError: As `stopping` wished; the state is that of the last stop.
            OSError: Something cannot be written; the map is that of its newest version.
        """
        known = self._cameras if viewpoints is None else viewpoints
        if self._localizer is not None:
            robot = LocalizedRobot(robot, self._localizer)
        self._watch.publish(self._detector)  # What is deferred may be reported again.
        if self.state.left is None:
            threads = self._config.update.threads
            self._become(
                left=tuple(viewpoints)
                if viewpoints is not None
                else stops_of(self._map, known, self._config.stops, threads)
            )
        while self.state.left:
            name = self.state.left[0]
            self._pause()
            if name in known and go_to(robot, known[name]):
                self._tell(name)
                self._repair(robot, self._seen(robot))
            self._become(left=self.state.left[1:])
        # What was deferred and due, and was not seen again, is no more.
        deferred = tuple(one for one in self.state.deferred if one.until > self.state.round)
        self._become(
            left=None,
            round=self.state.round + 1,
            of_source=self.state.of_source + 1,
            deferred=deferred,
        )

    def _seen(self, robot: Robot) -> list[Change]:
        """Looks until it is certain what has changed."""
        for _ in range(self._config.looks):
            frame = robot.observe()
            if frame is self._last:  # Of a recording, which has no other one.
                break
            self._last = frame
            self.watch(frame)
            if not self._watch.is_pending:
                break
        return self._reported()

    def _reported(self) -> list[Change]:
        """What is certain since it was asked last."""
        reports = self._watch.poll()
        replaced = {report.replaces for report in reports}
        changes = [report.change for report in reports if report.number not in replaced]
        return [change for change in changes if not self._is_deferred(change)]

    def _repair(self, robot: Robot, waiting: list[Change]) -> None:
        """Works off what waits, the most certain and nearest first."""
        while waiting:
            self._pause()
            place = robot.pose()[:2, 3]
            changes = next_changes(waiting, place)
            waiting = [one for one in waiting if all(one is not other for other in changes)]
            for change in changes:
                x, y, z = change.point
                self._say(f"{change.kind} at ({x:.2f}, {y:.2f}, {z:.2f}) m")
            self._update(robot, changes)

    def _update(self, robot: Robot, changes: list[Change]) -> None:
        """Publishes a version that shows the changes, or defers them."""

        def tell(stage: str) -> None:
            self._pause()
            self._tell(stage)

        config = self._config.update
        result = update(
            self._map,
            list(self._cameras.values()),
            changes,
            robot,
            config,
            detector=self._detector,
            first_id=self._store.version().next_id,
            semantics=self._semantics,
            tell=tell,
        )
        version = published(
            self._store,
            self._map,
            self._cameras.values(),
            result,
            config,
            self.state.round,
            self._semantics,
        )
        self._defer(result)
        if version is None:
            return
        self._say(f"version {version.number}: {version.gaussians} Gaussians")
        self._map = result.gaussian_map
        self._cameras |= cameras_of_update(version)
        self._detector = self._detector_of_map()
        self._watch.publish(self._detector)
        if self._localizer is not None:
            self._localizer.publish(self._relocalizer_of_map())
        deferred = tuple(
            one
            for one in self.state.deferred
            if not any(one.is_of(change) for change in result.changes)
        )
        self._become(deferred=deferred)

    def _defer(self, result: Update) -> None:
        """What the map does not show is tried again later."""
        deferred = self.state.deferred
        for change, why in result.left:
            deferred = defer(deferred, change, why, self.state.round)
            self._say(f"{change.kind} left as it is for now: {why}")
        if result.left:
            self._become(deferred=deferred)

    def _is_deferred(self, change: Change) -> bool:
        return any(
            one.is_of(change) and one.until > self.state.round for one in self.state.deferred
        )

    def _detector_of_map(self) -> ChangeDetector:
        return ChangeDetector(self._map, self._config.detection, cameras=self._cameras.values())

    def _relocalizer_of_map(self) -> Relocalizer:
        landmarks = require_landmarks(self._folder, self._map)
        return Relocalizer(self._map, landmarks, self._config.locate)

    def _become(self, **changed: object) -> None:
        """Another state, on the disk before it is believed."""
        state = LoopState.model_validate({**self.state.model_dump(), **changed})
        write_state(state, self._folder)
        self.state = state

    def _pause(self) -> None:
        """A safe point: nothing is half done that anybody would miss."""
        if self._stopping():
            raise StoppedError
