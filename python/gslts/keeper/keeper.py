"""Long-term operation: rounds through a home, on which the map follows the changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from gslts.change.changes import Change
from gslts.change.confirmation import Report
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import ChangeMonitor
from gslts.change.visibility import Visibility
from gslts.consolidation.pipeline import consolidate_store
from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot, RobotLostError
from gslts.extension.pipeline import extend_store
from gslts.keeper.config import KeeperConfig
from gslts.keeper.coverage import plan_viewpoints
from gslts.keeper.exploration import look_around, plan_exploration
from gslts.keeper.report_queue import ReportQueue
from gslts.keeper.schedule import defer, due_reports, select_changes, still_deferred
from gslts.keeper.state import KeeperState, read_state, write_state
from gslts.localization.landmark_files import require_landmarks
from gslts.localization.localizer import Localizer
from gslts.localization.relocalizer import Relocalizer
from gslts.mapping.clock import Clock
from gslts.mapping.observation import Observation
from gslts.robots.driving import go_to
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.camera_files import cameras_of_map, cameras_of_version
from gslts.store.map_folder import open_map
from gslts.store.measurement_files import read_measurements
from gslts.store.records import Version
from gslts.update.integrate import integrate_changes
from gslts.update.publish import publish


class StoppedError(Exception):
    """A stop was requested. The next run continues with the same viewpoint."""


class MapKeeper:
    """Keeps one map up to date. A context manager, and the only writer of the map.

    Args:
        folder: Folder of the map.
        config: Settings; None means the defaults.
        should_stop: Polled between transactions; True stops the run.
        progress: Called with the name of each step that takes long.
        log: Called with one line of text for each event.

    Attributes:
        state: Progress of the rounds.
        monitor: Confirms changes over the frames.
        semantics: Of the map; None if it has none, or its models are not available.
        shown: The newest map and its version, set at once, for other threads.
        localizer: In the newest version; None if the odometry of robots is in map coordinates.

    Raises:
        OSError: The map cannot be read, or another process writes it.
        ValueError: It is no map, its state is damaged, or it lacks landmarks for a localizer.
    """

    def __init__(
        self,
        folder: Path | str,
        config: KeeperConfig | None = None,
        *,
        should_stop: Callable[[], bool] = lambda: False,
        progress: Callable[[str], None] = lambda _: None,
        log: Callable[[str], None] = lambda _: None,
    ) -> None:
        folder = Path(folder)
        self._folder, self._config = folder, KeeperConfig() if config is None else config
        self._should_stop, self._progress, self._log = should_stop, progress, log
        self._store = open_map(folder, writable=True)
        try:
            self.state = read_state(folder)
            self._map = self._store.read()
            self.shown = self._map, self.version.number
            self._cameras = cameras_of_map(folder)
            self._measurements = read_measurements(folder)
            self.semantics = MapSemantics.of_map(folder, self._config.update.threads)
            self._detector = self._new_detector()
            self.localizer: Localizer | None = None
            if self._config.relocalization is not None:
                self.localizer = Localizer(self._new_relocalizer())
            self.monitor = ChangeMonitor(self._detector, self._config.monitor)
        except BaseException:
            self._store.close()
            raise
        self._queue = ReportQueue(self.monitor)
        self._last_frame: RgbdFrame | None = None

    def __enter__(self) -> MapKeeper:
        return self

    def __exit__(self, *_: object) -> None:
        self.monitor.close()
        self._store.close()

    @property
    def version(self) -> Version:
        """Newest version of the map."""
        return self._store.version()

    @property
    def gaussian_map(self) -> GaussianMap:
        """Gaussians of the newest version."""
        return self._map

    def watch(self, frame: RgbdFrame) -> None:
        """Look for changes in a frame, and wait for the result.

        Args:
            frame: RGB-D frame that a robot observed.
        """
        self.monitor.offer(frame)
        self.monitor.wait()

    def reports(self) -> list[Report]:
        """Return changes that were confirmed since the last call, without deferred ones."""
        return due_reports(self.state.deferred, self._queue.take(), self.state.round)

    def integrate(
        self, robot: Robot, reports: Sequence[Report], recorded: Sequence[RgbdFrame] = ()
    ) -> None:
        """Integrate confirmed changes into the map, the most confident and nearest first.

        Args:
            robot: In the home; collects views of them.
            reports: Of the changes.
            recorded: Frames that the robot took since the changes; they are views as well.

        Raises:
            RobotLostError: `reports` returns again what was not integrated.
            StoppedError: A stop was requested.
            OSError: A file cannot be written; the map is that of its newest version.
        """
        waiting = list(reports)
        try:
            while waiting:
                self._stop_if_requested()
                group = select_changes([r.change for r in waiting], robot.pose()[:2, 3])
                for change in group:
                    x, y, z = change.point
                    self._log(f"{change.kind} at ({x:.2f}, {y:.2f}, {z:.2f}) m")
                self._update(robot, group, recorded)
                waiting = [r for r in waiting if all(r.change is not c for c in group)]
        except RobotLostError:
            self._queue.put_back(waiting)
            raise

    def begin_source(self, source: str) -> int:
        """Continue the rounds of a source of frames; another source starts with its first round.

        Args:
            source: Name of the source, such as the path of a recording.

        Returns:
            Number of its complete rounds.

        Raises:
            OSError: The state cannot be written.
        """
        if self.state.source != source:
            self._set_state(source=source, source_rounds=0, remaining=None)
        return self.state.source_rounds

    def go_round(
        self,
        robot: Robot,
        viewpoints: Mapping[str, Camera] | None = None,
        between: Callable[[], None] = lambda: None,
    ) -> None:
        """Continue the present round or start a new one, and integrate changes on the way.

        Args:
            robot: In the home. Viewpoints that it does not reach are skipped.
            viewpoints: Cameras to visit in this order, by name; None means some training cameras
                that cover the map.
            between: Called after each viewpoint; may move the robot.

        Raises:
            StoppedError: A stop was requested; the state is that of the last viewpoint.
            OSError: A file cannot be written; the map is that of its newest version.
        """
        cameras = self._cameras if viewpoints is None else viewpoints
        if self.state.remaining is None:
            self._set_state(remaining=self._plan() if viewpoints is None else tuple(viewpoints))
        while self.state.remaining:
            name = self.state.remaining[0]
            self._stop_if_requested()
            if name in cameras and go_to(robot, cameras[name]):
                self._progress(name)
                self.integrate(robot, self._observe(robot))
            self._set_state(remaining=self.state.remaining[1:])
            between()
        self.end_round()

    def end_round(self) -> None:
        """End the present round: deferred changes that are due are reported again if they last.

        Raises:
            OSError: The state cannot be written.
        """
        # A deferred change that was due and was not detected again no longer exists.
        number = self.state.round
        deferred = tuple(change for change in self.state.deferred if change.retry_round > number)
        self._set_state(
            remaining=None,
            round=number + 1,
            source_rounds=self.state.source_rounds + 1,
            deferred=deferred,
        )
        self.monitor.publish(self._detector)  # Deferred changes may be reported again.

    def explore(self, robot: Robot) -> None:
        """Look around in space that the robot can reach and the map does not know, and map it.

        Args:
            robot: In the home; placed in the map by its frames, and by its odometry between them.

        Raises:
            StoppedError: A stop was requested.
            OSError: A file cannot be written; the map is that of its newest version.
        """
        threads, cameras = self._config.extension.threads, list(self._cameras.values())
        positions = plan_exploration(robot, Visibility(self._map, cameras, threads))
        if len(positions) == 0:
            return
        self._log(f"unmapped space: exploring {len(positions)} positions")
        frames = {}
        for number, frame in enumerate(look_around(robot, positions, cameras)):
            self._on_progress(f"exploring, frame {number}")
            frames[f"round {self.state.round}/{number:03}"] = frame
        self.extend(frames, "exploration")

    def extend(self, frames: Mapping[str, RgbdFrame], source: str) -> None:
        """Add the space that frames show and the map does not know, as a new version.

        Args:
            frames: By name, in the order in which they were taken.
            source: Name of the recording, for the log.

        Raises:
            StoppedError: A stop was requested.
            OSError: A file cannot be written; the map is that of its newest version.
        """
        try:
            outcome = extend_store(
                self._store,
                {name: Observation.of(frame) for name, frame in frames.items()},
                source,
                self._config.extension,
                Clock(None, {}),
                on_placed=lambda *_: self._on_progress("extending"),
                report=lambda *_: self._on_progress("extending"),
            )
        except ValueError as error:
            self._log(f"not extended: {error}")
            return
        if outcome.record is not None:
            self._log(f"version {outcome.version.number}: {outcome.record.added} Gaussians added")
            self._reload()

    def let_others_write(self, write: Callable[[], None]) -> None:
        """Close the map between rounds, let something else write it, and go on with the result.

        Args:
            write: Writes the map, such as `gslts.fleet.exchange.push_map`.

        Raises:
            OSError: The map cannot be read, or another process writes it.
        """
        before = self.version
        self._store.close()
        try:
            write()
        finally:
            self._store = open_map(self._folder, writable=True)
        if self.version != before:
            self._reload()

    def consolidate(self, robot: Robot) -> None:
        """Refine what updates have changed since the last consolidation, as a new version.

        Args:
            robot: In the home; takes the views.

        Raises:
            StoppedError: A stop was requested.
            OSError: A file cannot be written; the map is that of its newest version.
        """
        try:
            done = consolidate_store(
                self._store,
                robot,
                detection=self._config.detection,
                threads=self._config.update.threads,
                progress=self._on_progress,
            )
        except ValueError as error:
            self._log(f"not consolidated: {error}")
            return
        if done.record is None:
            self._log(f"not consolidated: {done.reason}")
        else:
            self._log(f"version {done.version.number}: {done.record.refined} Gaussians refined")
            self._use_map(self._store.read(), done.version)

    def _plan(self) -> tuple[str, ...]:
        threads = self._config.update.threads
        return plan_viewpoints(self._map, self._cameras, self._config.max_viewpoints, threads)

    def _observe(self, robot: Robot) -> list[Report]:
        """Observe until changes are confirmed or discarded, and return the confirmed ones."""
        for _ in range(self._config.max_frames):
            frame = robot.observe()
            if frame is self._last_frame:  # A recording has no other frame here.
                break
            self._last_frame = frame
            self.watch(frame)
            if not self.monitor.is_pending:
                break
        return self.reports()

    def _update(self, robot: Robot, changes: list[Change], recorded: Sequence[RgbdFrame]) -> None:
        """Publish a version that shows the changes, or defer them."""
        config, cameras = self._config.update, list(self._cameras.values())
        result = integrate_changes(
            self._map,
            cameras,
            changes,
            robot,
            config,
            detector=self._detector,
            recorded=recorded,
            first_id=self._store.version().next_id,
            semantics=self.semantics,
            progress=self._on_progress,
        )
        version = publish(
            self._store, self._map, cameras, result, config, self.state.round, self.semantics
        )
        deferred = self.state.deferred
        for change, reason in result.rejected_changes:
            deferred = defer(deferred, change, reason, self.state.round)
            self._log(f"{change.kind} deferred: {reason}")
        integrated = () if version is None else result.changes
        self._set_state(deferred=still_deferred(deferred, integrated))
        if version is not None:
            self._log(f"version {version.number}: {version.gaussians} Gaussians")
            self._use_map(result.gaussian_map, version)
            self._queue.drop(integrated)

    def _reload(self) -> None:
        """Read all of the newest version, which was not made here or shows new space."""
        self._cameras = cameras_of_map(self._folder)
        self._measurements = read_measurements(self._folder)
        self._use_map(self._store.read(), self.version)

    def _use_map(self, gaussian_map: GaussianMap, version: Version) -> None:
        """Detect and localize with a new version of the map."""
        self._map, self.shown = gaussian_map, (gaussian_map, version.number)
        self._cameras |= cameras_of_version(version)
        self._detector = self._new_detector()
        self.monitor.publish(self._detector)
        if self.localizer is not None:
            self.localizer.publish(self._new_relocalizer())

    def _new_detector(self) -> ChangeDetector:
        return ChangeDetector(
            self._map,
            self._config.detection,
            cameras=self._cameras.values(),
            measurements=self._measurements,
            updates=self._store.updates(),
        )

    def _new_relocalizer(self) -> Relocalizer:
        landmarks = require_landmarks(self._folder, self._map)
        return Relocalizer(self._map, landmarks, self._config.relocalization)

    def _set_state(self, **changed: object) -> None:
        """Change the state, on disk first."""
        state = KeeperState.model_validate({**self.state.model_dump(), **changed})
        write_state(state, self._folder)
        self.state = state

    def _on_progress(self, stage: str) -> None:
        self._stop_if_requested()
        self._progress(stage)

    def _stop_if_requested(self) -> None:
        """Raise StoppedError if a stop was requested. Called only between transactions."""
        if self._should_stop():
            raise StoppedError
