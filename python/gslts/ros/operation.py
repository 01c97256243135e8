"""Operation of the node: builds the map if there is none, then keeps it up to date.

Lanes: the thread of ROS receives messages, `Judge` judges the newest frame, `QueryLane` answers
queries, `Recorder` writes frames, and updates, rounds and errands run in the thread of
`Operation.run`. None of them waits for another one; all that waits is bounded.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from gslts.change.config import DetectionConfig
from gslts.change.confirmation import Report
from gslts.core.frame import RgbdFrame
from gslts.core.robot import RobotLostError
from gslts.keeper.config import KeeperConfig
from gslts.keeper.describe import describe_keeper
from gslts.keeper.errand import drive_to
from gslts.keeper.keeper import MapKeeper, StoppedError
from gslts.localization.config import RelocalizationConfig
from gslts.mapping.config import PRESETS
from gslts.ros.answers import errand_answer, failure_answer
from gslts.ros.build import build_map, recording_of
from gslts.ros.config import NodeConfig
from gslts.ros.constants import ROUND_S
from gslts.ros.exploring import explore
from gslts.ros.frame_memory import FrameMemory
from gslts.ros.free_floor import FreeFloor
from gslts.ros.intake import Intake
from gslts.ros.judge import Judge, Judged
from gslts.ros.problems import Problems
from gslts.ros.query_lane import QueryLane
from gslts.ros.recorder import Recorder
from gslts.ros.requests import Request, Requests
from gslts.ros.robot import RosRobot
from gslts.ros.shown_change import detected_changes, published_changes
from gslts.ros.statuses import Status
from gslts.ros.waiting import WaitingChanges
from gslts.store.history import open_history
from gslts.trajectory.open3d import require_open3d
from gslts.types import Floats
from gslts.update.config import UpdateConfig
from gslts.viewer.beside import PagesBeside, viewer_beside
from gslts.viewer.goals import Goal

if TYPE_CHECKING:
    from gslts.ros.goals import Goals  # These two need ROS.
    from gslts.ros.publishing import Publishing

WAIT_S = 0.1
"""Time between two tests for reports and requests, s."""
HALVINGS = 2
"""Halvings of the images in which poses are tracked: 5.9 mm and 0.17 degrees median error instead
of 2.8 and 0.10, in 56 instead of 125 ms of CPU time; the detector aligns each frame once more."""
NEEDS_ACTIVE = "needs --active: the node may not drive the robot"
"""Reason for rejecting requests."""


class Operation:
    """Runs until a stop is requested.

    Args:
        config: Settings.
        intake: Frames of the robot.
        goals: Drives the robot; used if `config.active`.
        publishing: Publishes results.
        problems: Gets what goes wrong.
        stop: Set if the node should end at the next safe point.
        now_s: Returns the time of the stamps, s.
        log: Called with one line for each event.

    Attributes:
        requests: Of other nodes.
        robot: The robot; None before the first map or exploration.
    """

    def __init__(
        self,
        config: NodeConfig,
        intake: Intake,
        goals: Goals,
        publishing: Publishing,
        problems: Problems,
        stop: threading.Event,
        now_s: Callable[[], float],
        log: Callable[[str], None],
    ) -> None:
        self._config, self._intake, self._publishing = config, intake, publishing
        self._goals = goals if config.active else None
        self._problems, self._stop, self._now_s, self._log = problems, stop, now_s, log
        self.requests = Requests()
        self.robot: RosRobot | None = None
        self._queries: QueryLane | None = None
        self._keeper: MapKeeper | None = None
        self._pages = PagesBeside()
        self._activity = "starting"

    def run(self) -> None:
        """Build the map if there is none, then keep it up to date until a stop is requested.

        Raises:
            OSError: A file cannot be read or written.
            ValueError: There is no map and none should be built, or it is damaged.
            ImportError: A map should be built, and Open3D is missing.
            RuntimeError: A lane failed.
        """
        config = self._config
        try:
            if not config.map_path.exists():
                if not config.build:
                    raise ValueError(f"{config.map_path}: there is no map; --build makes one")
                require_open3d()  # Before minutes of recording.
                self._build()
            if not self._stop.is_set():
                self._keep()
        except StoppedError:
            pass

    def ask(self, words: str) -> None:
        """Answer a query beside everything else.

        Args:
            words: Such as "sofa".

        Raises:
            ValueError: There is no map yet, or too many queries wait.
        """
        if self._queries is None:
            raise ValueError("there is no map yet")
        self._queries.add(words)

    def status(self) -> Status:
        """Return the state of the map and of the robot, for diagnostics."""
        keeper, robot = self._keeper, self.robot
        if keeper is None or robot is None:
            return Status("operation", "ok", self._activity)
        activity = "the robot follows another goal" if robot.is_left_alone else self._activity
        fault = keeper.monitor.fault
        values = {"unreliable frames": keeper.monitor.counts.unreliable}
        return Status("operation", "ok" if fault is None else "warn", fault or activity, values)

    def _build(self) -> None:
        """Record frames until the word "build" comes, or until the robot has explored the room."""
        config = self._config
        recording = recording_of(config.map_path, config.record)
        memory, explores = FrameMemory(), self._goals is not None
        while not config.map_path.exists():
            recorder = Recorder(recording, self._problems)

            def record(judged: Judged, is_key: bool, recorder: Recorder = recorder) -> None:
                self._publishing.judged(judged, None)
                if is_key:
                    recorder.add(judged.frame)

            try:
                with Judge(
                    self._intake, memory, config.rate_hz, self._now_s, on_judged=record
                ) as judge:
                    self._start_robot(judge, memory, None)
                    self._gather(judge, memory, explores)
            finally:
                recorder.close()
            if self._stop.is_set():
                raise StoppedError
            self._activity = "building the map"
            try:
                build_map(recording, config.map_path, config.threads, self._stop, self._log)
            except (ValueError, RuntimeError) as error:
                if self._stop.is_set():
                    raise StoppedError from None
                explores = False  # The same frames would fail again.
                self._log(f"not built: {error}")
                self._publishing.event("not built", reason=str(error))
        self._publishing.event("built")

    def _gather(self, judge: Judge, memory: FrameMemory, explores: bool) -> None:
        """Let the robot explore as soon as frames come, or wait for the word "build"."""
        self._activity = "recording, there is no map yet"
        self._log("no map yet: recording; the command build makes a map of the recording")
        while not self._stop.is_set():
            judge.require_working()
            if explores and memory.since(0):  # The camera may start later than the node.
                explores = False
                if self._explore(memory):
                    return
            request = self.requests.take(WAIT_S)
            if request is None:
                continue
            if (request.kind, request.words) == ("command", "build"):
                return
            if (request.kind, request.words) == ("command", "explore") and self._goals is not None:
                explores = True
            else:
                self._fail(request, "there is no map yet")

    def _explore(self, memory: FrameMemory) -> bool:
        """Let the robot explore; return whether it saw everything that it can reach."""
        assert self.robot is not None
        config = self._config
        can_tilt = bool(config.topics.tilt)
        try:
            explore(self.robot, memory, config.body, can_tilt, self._stop, self._log)
        except (RobotLostError, ValueError) as error:
            self._log(f"exploration ended: {error}; the command explore goes on with it")
            return False
        self._publishing.event("explored")
        return True

    def _keep(self) -> None:
        config, memory = self._config, FrameMemory()
        recorder = None if config.record is None else Recorder(config.record, self._problems)
        keeper_config = _keeper_config(config)
        waiting = WaitingChanges(keeper_config.update.collect.steps + 1)
        with (
            viewer_beside(config.map_path, config.view, config.control) as self._pages,
            MapKeeper(
                config.map_path,
                keeper_config,
                should_stop=self._stop.is_set,
                log=self._say,
            ) as keeper,
        ):

            def on_judged(judged: Judged, is_key: bool) -> None:
                self._publishing.judged(judged, keeper.gaussian_map)
                self._pages.show(judged.frame, lambda: describe_keeper(keeper))
                if is_key and recorder is not None:
                    recorder.add(judged.frame)

            floor, self._keeper = FreeFloor(config.body), keeper
            try:
                with (
                    QueryLane(config.map_path, keeper, self._publishing) as self._queries,
                    Judge(
                        self._intake,
                        memory,
                        config.rate_hz,
                        self._now_s,
                        localizer=keeper.localizer,
                        watch=keeper.watch,
                        on_judged=on_judged,
                    ) as judge,
                ):
                    self._start_robot(judge, memory, lambda: floor.positions(keeper.gaussian_map))
                    self._log(f"{config.map_path} is version {keeper.version.number}")
                    self._run_lane(keeper, judge, memory, waiting, floor)
            finally:
                self._queries = self._keeper = None
                if recorder is not None:
                    recorder.close()

    def _run_lane(
        self,
        keeper: MapKeeper,
        judge: Judge,
        memory: FrameMemory,
        waiting: WaitingChanges,
        floor: FreeFloor,
    ) -> None:
        """Integrate changes and follow requests until a stop is requested."""
        shown_version, round_end_s = 0, time.monotonic() + ROUND_S
        while not self._stop.is_set():
            judge.require_working()
            if keeper.version.number != shown_version:
                shown_version = keeper.version.number
                self._show_map(keeper, floor, waiting)
            if time.monotonic() > round_end_s:
                keeper.end_round()
                round_end_s = time.monotonic() + ROUND_S
            try:
                if self._integrate(keeper, memory, waiting):
                    continue
            except RobotLostError as error:
                self._problems.report("robot", str(error))
            self._activity = "watching"
            request = self.requests.take(WAIT_S)
            if request is not None:
                self._follow(request, keeper, memory)
            self._follow_goal(keeper)

    def _integrate(self, keeper: MapKeeper, memory: FrameMemory, waiting: WaitingChanges) -> bool:
        """Integrate changes that can be; return whether there were any."""
        assert self.robot is not None
        new = keeper.reports()
        if new:
            waiting.add(new)
            self._show_changes(waiting)
        reports: list[Report]
        frames: list[RgbdFrame]
        if self._goals is not None and not self.robot.is_left_alone:
            reports, frames = waiting.take_all(), []
        else:
            reports, frames = waiting.take_ready(self._intake.newest_s, memory.since)
        if not reports:
            return False
        self._activity = "updating the map"
        try:
            keeper.integrate(self.robot, reports, frames)
        finally:
            waiting.add(keeper.reports())  # Also those that a lost robot left.
            self._show_changes(waiting)
        return True

    def _follow(self, request: Request, keeper: MapKeeper, memory: FrameMemory) -> None:
        """Follow a request; a failure is answered."""
        robot, words = self.robot, request.words
        assert robot is not None
        self._activity = f"{request.kind}: {words}"
        try:
            if request.kind == "command" and words == "extend":
                frames = {f"{frame.time_s:.3f}": frame for frame in memory.since(0)}
                keeper.extend(frames, "ros")
            elif words == "build" and request.kind == "command":
                raise ValueError("there is a map already")
            elif self._goals is None:
                raise ValueError(NEEDS_ACTIVE)
            else:
                robot.observe()  # The camera may start later than the node.
                self._drive(request, keeper, robot)
        except (ValueError, ImportError, RobotLostError) as error:
            self._fail(request, str(error))
        else:
            self._publishing.event("done", kind=request.kind, words=words)

    def _drive(self, request: Request, keeper: MapKeeper, robot: RosRobot) -> None:
        if request.kind == "go":
            result = drive_to(keeper, robot, request.words, body=self._config.body)
            self._publishing.answer(errand_answer(request.words, "map", result))
        elif request.words == "explore":
            keeper.explore(robot)
        elif request.words == "round":
            keeper.go_round(robot, between=lambda: self._follow_goal(keeper))
        else:
            keeper.consolidate(robot)

    def _follow_goal(self, keeper: MapKeeper) -> None:
        """Drive to what was chosen on a page, if there is something."""

        def drive(goal: Goal) -> str:
            assert self.robot is not None
            self._activity = f"go: {goal.words}"
            try:
                body = self._config.body
                return drive_to(keeper, self.robot, goal.words, goal.box, body).describe()
            except RobotLostError as error:
                return str(error)

        self._pages.follow_goal(drive)

    def _fail(self, request: Request, reason: str) -> None:
        self._log(f"{request.kind} {request.words!r}: {reason}")
        self._publishing.answer(failure_answer(request.kind, request.words, reason))

    def _start_robot(
        self, judge: Judge, memory: FrameMemory, positions: Callable[[], Floats] | None
    ) -> None:
        self.robot = RosRobot(
            memory,
            self._intake.latest_pose,
            self._intake.base_from_camera,
            judge.map_from_odometry,
            lambda: self._intake.newest_s,
            positions,
            self._goals,
            self._stop,
        )

    def _show_map(self, keeper: MapKeeper, floor: FreeFloor, waiting: WaitingChanges) -> None:
        """Publish what a new version shows."""
        version = keeper.version
        self._publishing.event("version", number=version.number, gaussians=version.gaussians)
        self._publishing.grid(floor.semantic_map(keeper.gaussian_map))
        self._show_changes(waiting)

    def _show_changes(self, waiting: WaitingChanges) -> None:
        with open_history(self._config.map_path) as history:
            shown = published_changes(history.tracks())
        self._publishing.changes([*shown, *detected_changes(waiting.changes)])

    def _say(self, line: str) -> None:
        self._log(line)
        self._publishing.event("log", line=line)


def _keeper_config(config: NodeConfig) -> KeeperConfig:
    threads = config.threads
    update = UpdateConfig(threads=threads)
    return KeeperConfig(
        max_viewpoints=config.max_viewpoints,
        detection=DetectionConfig(threads=threads),
        update=update,
        extension=PRESETS["fast"].with_settings([f"threads={threads}"]),
        relocalization=RelocalizationConfig(threads=threads, halvings=HALVINGS)
        if config.locate
        else None,
    )
