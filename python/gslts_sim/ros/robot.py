"""The simulated robot: it drives to goals, and knows its pose by odometry only."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import Labels, RgbdFrame
from gslts.core.se3 import product
from gslts.types import Floats
from gslts_sim.actions import GRID_M
from gslts_sim.robot_body import CAMERA_HEIGHT_M, FOV_RAD, HORIZON_DEG, camera_direction
from gslts_sim.ros.drive import Drive
from gslts_sim.ros.odometry import Odometry
from gslts_sim.ros.planar_pose import PlanarPose, wrap_angle
from gslts_sim.ros.route import plan_route
from gslts_sim.ros.scripted_home import ScriptedHome
from gslts_sim.sensor import Sensor
from gslts_sim.walkable import start_position

TICK_S = 0.04
"""Step of the motion, s: odometry comes at 25 Hz. It is fixed, so that drift does not depend on the
load of the machine."""
TILT_RAD_S = 0.8
"""Speed at which the camera tilts, rad/s."""
ARRIVED_M, ARRIVED_RAD = 0.05, 1e-4
"""Distance and angle by odometry at which a goal is reached, m and rad."""
MIN_CARRY_M = 1.0
"""Minimum distance over which the robot is carried away, m, where the home has the room."""


@dataclass(frozen=True)
class RobotState:
    """Robot at a tick of its clock.

    Args:
        tick: Number of the tick.
        true: Pose in the world.
        believed: Pose in the frame of the odometry.
        tilt_rad: Angle of the camera below the horizon, rad.
        speed_m_s: Measured speed ahead, m/s.
        turn_rad_s: Measured speed of turning, rad/s.
    """

    tick: int
    true: PlanarPose
    believed: PlanarPose
    tilt_rad: float = 0.0
    speed_m_s: float = 0.0
    turn_rad_s: float = 0.0


class SimulatedRobot:
    """A robot with a tilting RGB-D camera in a home that changes.

    Args:
        home: The home.
        sensor: Its camera.
        size: Width and height of the images, px.
        seed: Seed of the drift and of where the robot is carried.
        drift: Factor of the errors of the odometry; 0 for none.
        speed: Factor of the speeds.

    Attributes:
        state: Present state; replaced as a whole, so that other threads may read it.
    """

    def __init__(
        self,
        home: ScriptedHome,
        sensor: Sensor,
        size: tuple[int, int],
        seed: int,
        drift: float,
        speed: float = 1.0,
    ) -> None:
        self._home, self._sensor, self._size, self._speed = home, sensor, size, speed
        scene = home.scene
        x, y = start_position(scene.state.home, scene.floor).tolist()
        self._drive = Drive(PlanarPose(x, y, 0.0))
        self._odometry = Odometry(seed, drift)
        self._rng = np.random.default_rng([seed, 5])
        self._goal: PlanarPose | None = None
        self._tilt_rad = 0.0
        self._planned_in = scene
        self._frames = 0
        self.state = RobotState(0, self._drive.pose, self._odometry.pose)

    @property
    def floor_m(self) -> float:
        """Height of the floor in the world, m."""
        return float(self._home.scene.state.home.space.box[0, 2])

    @property
    def changes_left(self) -> int:
        """Number of changes of the home to come."""
        return self._home.changes_left

    def advance(self) -> RobotState:
        """Let a tick pass.

        Returns:
            The new state.
        """
        self._steer()
        before, drive = self.state, self._drive
        for turn_rad, forward_m in drive.advance(TICK_S * self._speed):
            self._odometry.add(turn_rad, forward_m)
        believed = self._odometry.pose
        most = TILT_RAD_S * TICK_S * self._speed
        self.state = RobotState(
            before.tick + 1,
            drive.pose,
            believed,
            before.tilt_rad + float(np.clip(self._tilt_rad - before.tilt_rad, -most, most)),
            float(np.linalg.norm(believed.position - before.believed.position)) / TICK_S,
            (believed.yaw_rad - before.believed.yaw_rad) / TICK_S,
        )
        return self.state

    def _steer(self) -> None:
        """Plan again where that is needed; at the end of the path, turn to the goal's heading."""
        drive, goal = self._drive, self._goal
        if goal is None:
            return
        is_there = not drive.corners and drive.yaw_rad is None
        # Odometry has drifted on the path, or a change has blocked it or freed a shorter one.
        is_outdated = is_there or self._planned_in is not self._home.scene
        if is_outdated and self.go_to(goal):
            return
        if is_there and drive.length_m < ARRIVED_M:
            drive.corners = []
        if not drive.corners:
            turn_rad = wrap_angle(goal.yaw_rad - self._odometry.pose.yaw_rad)
            drive.yaw_rad = drive.pose.yaw_rad + turn_rad
            if abs(turn_rad) < ARRIVED_RAD:
                self._goal = drive.yaw_rad = None

    def go_to(self, goal: PlanarPose) -> str:
        """Drive to a pose, or to the reachable position nearest to it; replaces an earlier goal.

        Args:
            goal: In the frame of the odometry.

        Returns:
            Reason why the robot stays; empty if it drives.
        """
        scene = self._home.scene
        in_world = goal.carried(self._odometry.pose, self._drive.pose)
        path = plan_route(scene.floor, self._drive.pose.position, in_world.position)
        self._drive.stop()
        self._drive.corners = list(path.points[1:])
        self._goal = None if path.reason else goal
        self._planned_in = scene
        return path.reason

    def tilt(self, angle_rad: float) -> None:
        """Tilt the camera, within its range.

        Args:
            angle_rad: Below the horizon, rad.
        """
        low, high = np.deg2rad(HORIZON_DEG)
        self._tilt_rad = float(np.clip(angle_rad, low, high))

    def carry_away(self) -> None:
        """Put the robot down elsewhere; odometry does not notice, and its goal is forgotten."""
        positions = self._home.scene.floor.grid_positions(GRID_M)
        distances = np.linalg.norm(positions - self._drive.pose.position, axis=1)
        far = positions[distances >= min(MIN_CARRY_M, float(distances.max()))]
        x, y = far[self._rng.integers(len(far))].tolist()
        yaw_rad = self._drive.pose.yaw_rad + float(self._rng.uniform(np.pi / 2, 3 * np.pi / 2))
        self._goal = None
        self._drive = Drive(PlanarPose(x, y, yaw_rad))

    def change(self) -> str:
        """Let the next change of the home happen; may run beside `advance`, in another thread.

        Returns:
            Description of the change.

        Raises:
            ChangeError: See `ScriptedHome.change`.
        """
        return self._home.change(lambda: self._drive.pose.position)

    def observe(self, state: RobotState) -> RgbdFrame:
        """Take a frame; may run beside `advance`, in another thread.

        Args:
            state: Of this robot.

        Returns:
            The frame with labels, and the camera at its true pose.
        """
        pose = product(state.true.matrix(self.floor_m), base_from_camera(state.tilt_rad))
        camera = camera_from_fov(*self._size, FOV_RAD, pose)
        scene = self._home.scene
        frame, truth = self._sensor.take(scene.caster, camera, self._frames)
        self._frames += 1
        rows = np.append(scene.label_rows, np.int32(-1))  # -1 is the background.
        return replace(frame, labels=Labels(rows[truth.instances], self.label_names))

    @property
    def label_names(self) -> tuple[str, ...]:
        """Types of the labelled objects."""
        return self._home.label_names


def base_from_camera(tilt_rad: float) -> Floats:
    """Return the pose of the camera's optical frame on the robot.

    Args:
        tilt_rad: Angle of the camera below the horizon, rad.

    Returns:
        [4,4] base_from_camera, m; the base is on the floor, x ahead, z up.
    """
    eye = np.array([0.0, 0.0, CAMERA_HEIGHT_M])
    pose: Floats = look_at(eye, eye + camera_direction(0.0, tilt_rad))
    return pose
