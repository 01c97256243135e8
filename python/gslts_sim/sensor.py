"""RGB-D camera in a simulated home, with a noise model.

Depth noise: Nguyen, Izadi and Lovell 2012, sec. 3.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np

from gslts._core import sim as core_sim
from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import rotation, rotation_vector
from gslts.types import Bytes, Floats, Floats32
from gslts_sim.home import AreaLight, Home
from gslts_sim.raycast import RayCaster, View

BLUR_SAMPLES = 5
"""Number of renderings that are averaged for motion blur; the time of a frame is proportional."""


@dataclass(frozen=True)
class SensorNoise:
    """Noise model of a camera; the defaults are a perfect camera.

    Args:
        rgb_std: Standard deviation of each colour value, for values from 0 to 1.
        exposure_std: Standard deviation of the exposure of a visit, in stops (log2 of the gain).
        white_balance_std: Standard deviation of log2 of the gains of red and blue in a visit.
        vignetting: Fraction of the light that is lost in the corners.
        shutter_fraction: Fraction of the motion since the last frame in which the shutter is open.
        depth_std_m: Constant part of the standard deviation of depth, m.
        depth_std_per_m: Its growth with the squared distance, m/m^2.
        depth_range_m: Minimum and maximum depth that is measured, m.
        grazing_rad: Maximum angle between ray and surface normal at which depth is measured, rad.
        edge_dropout: Probability of no depth at a pixel at a depth edge.
        dropout: Probability of no depth at any other pixel.
        light_std: Standard deviation of the strength of each light in a visit, in stops.
        light_off: Probability that a lamp is off in a visit; one light is always on.
        light_shift_m: Maximum horizontal shift of a lamp in a visit, m.
        position_std_m: Standard deviation of each coordinate of the believed position, m.
        rotation_std_rad: Standard deviation of the believed rotation about each axis, rad.
    """

    rgb_std: float = 0.0
    exposure_std: float = 0.0
    white_balance_std: float = 0.0
    vignetting: float = 0.0
    shutter_fraction: float = 0.0
    depth_std_m: float = 0.0
    depth_std_per_m: float = 0.0
    depth_range_m: tuple[float, float] = (0.0, np.inf)
    grazing_rad: float = np.pi / 2
    edge_dropout: float = 0.0
    dropout: float = 0.0
    light_std: float = 0.0
    light_off: float = 0.0
    light_shift_m: float = 0.0
    position_std_m: float = 0.0
    rotation_std_rad: float = 0.0


NOISE_PRESETS = {
    "none": SensorNoise(),
    "kinect": SensorNoise(
        rgb_std=0.01,
        exposure_std=0.1,
        white_balance_std=0.04,
        vignetting=0.15,
        shutter_fraction=0.1,
        depth_std_m=0.0012,
        depth_std_per_m=0.0019,
        depth_range_m=(0.4, 6.0),
        grazing_rad=np.deg2rad(82),
        edge_dropout=0.5,
        dropout=0.002,
        position_std_m=0.005,
        rotation_std_rad=np.deg2rad(0.2),
    ),
}
"""Noise models by name. `kinect`: depth as measured by Nguyen et al. for the Kinect; drift and pose
error of an indoor robot with good odometry."""


class Sensor:
    """The camera of one visit of a home.

    Args:
        noise: A noise model, or the name of one of `NOISE_PRESETS`.
        seed: Seed of the visit: of its drift, and of the noise of each frame.

    Raises:
        ValueError: There is no preset of that name.
    """

    def __init__(self, noise: SensorNoise | str = "none", seed: int = 0) -> None:
        if isinstance(noise, str):
            if noise not in NOISE_PRESETS:
                names = ", ".join(NOISE_PRESETS)
                raise ValueError(f"Sensor: noise must be one of {names}, got {noise!r}")
            noise = NOISE_PRESETS[noise]
        self.noise = noise
        self._seed = seed
        rng = np.random.default_rng([seed, 0])
        exposure = noise.exposure_std * rng.normal()
        red, blue = noise.white_balance_std * rng.normal(size=2)
        self.gains: Floats = 2 ** np.array([exposure + red, exposure, exposure + blue])

    def lights(self, home: Home) -> tuple[AreaLight, ...]:
        """Return the lights that are on in this visit, with their strength and position.

        Args:
            home: With its lights.
        """
        noise, lights, shining = self.noise, [], []
        for row, light in enumerate(home.all_lights):
            # Each light has its own random stream: other lamps may come and go.
            key = zlib.crc32((light.owner or f"daylight {row}").encode())
            rng = np.random.default_rng([self._seed, 2, key])
            strength, off = 2 ** (noise.light_std * rng.normal()), rng.random() < noise.light_off
            shift = noise.light_shift_m * rng.uniform(-1, 1, 3) * (1, 1, 0)
            if light.owner is None:  # Daylight neither moves nor is switched off.
                shift, off = np.zeros(3), False
            lights.append(
                replace(light, center=light.center + shift, radiance=strength * light.radiance)
            )
            if not off:
                shining.append(lights[-1])
        return tuple(shining or lights[:1])

    def take(
        self, caster: RayCaster, camera: Camera, index: int, previous_pose: Floats | None = None
    ) -> tuple[RgbdFrame, View]:
        """Take a frame.

        Args:
            caster: Ray caster of the home.
            camera: Camera at its true pose.
            index: Number of the frame in the visit, from 0; it decides the noise.
            previous_pose: [4,4] world_from_camera of the previous frame, m, for motion blur.

        Returns:
            The frame with the camera pose that the robot believes, and the noise-free view.
        """
        truth = caster.render(camera)
        radiance = truth.radiance.astype(np.float64)
        if previous_pose is not None and self.noise.shutter_fraction > 0:
            poses = _poses_between(
                previous_pose, camera.world_from_camera, self.noise.shutter_fraction
            )
            views = [caster.render(at_pose(camera, pose)).radiance for pose in poses]
            radiance = (radiance + sum(views)) / BLUR_SAMPLES
        rng = np.random.default_rng([self._seed, 1, index])
        frame = RgbdFrame(
            rgb=self._rgb(radiance, rng),
            depth=self._depth(truth, rng),
            camera=self._believe(camera, rng),
            time_s=float(index),
        )
        return frame, truth

    def believed_pose(self, camera: Camera, index: int) -> Floats:
        """Return the pose that the robot believes before it takes a frame.

        Args:
            camera: Camera at its true pose.
            index: Number of the next frame in the visit, from 0; it decides the noise.

        Returns:
            [4,4] world_from_camera, m.
        """
        rng = np.random.default_rng([self._seed, 3, index])
        return self._believe(camera, rng).world_from_camera

    def _rgb(self, radiance: Floats, rng: np.random.Generator) -> Bytes:
        noise = self.noise
        return core_sim.measure_color(
            radiance,
            normals=rng.normal(size=radiance.shape) if noise.rgb_std > 0 else None,
            gains=tuple(self.gains),
            vignetting=noise.vignetting,
            noise_std=noise.rgb_std,
            threads=0,
        )

    def _depth(self, truth: View, rng: np.random.Generator) -> Floats32:
        noise = self.noise
        return core_sim.measure_depth(
            truth.depth,
            truth.cosines,
            normals=rng.normal(size=truth.depth.shape),
            uniforms=rng.uniform(size=truth.depth.shape),
            std_m=noise.depth_std_m,
            std_per_m=noise.depth_std_per_m,
            range_m=noise.depth_range_m,
            least_cosine=np.cos(noise.grazing_rad),
            edge_dropout=noise.edge_dropout,
            dropout=noise.dropout,
            threads=0,
        )

    def _believe(self, camera: Camera, rng: np.random.Generator) -> Camera:
        if self.noise.position_std_m == 0 and self.noise.rotation_std_rad == 0:
            return camera
        pose = camera.world_from_camera
        pose[:3, 3] += self.noise.position_std_m * rng.normal(size=3)
        pose[:3, :3] = pose[:3, :3] @ rotation(self.noise.rotation_std_rad * rng.normal(size=3))
        return at_pose(camera, pose)


def _poses_between(start: Floats, end: Floats, fraction: float) -> list[Floats]:
    """Return poses at equal steps over the last `fraction` of a motion, without its end."""
    turn = rotation_vector(end[:3, :3].T @ start[:3, :3])
    poses = []
    for back in np.linspace(0, fraction, BLUR_SAMPLES)[1:]:
        pose = np.eye(4)
        pose[:3, 3] = end[:3, 3] + back * (start[:3, 3] - end[:3, 3])
        pose[:3, :3] = end[:3, :3] @ rotation(back * turn)
        poses.append(pose)
    return poses
