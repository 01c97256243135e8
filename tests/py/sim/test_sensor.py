"""Tests of the simulated camera: its errors have the statistics of the noise model."""

from dataclasses import replace

import numpy as np
import pytest
import sim_scenes

import gslts
from gslts._core import sim as core_sim
from gslts.core.frame import RgbdFrame
from gslts_sim.controller import Controller
from gslts_sim.raycast import RayCaster
from gslts_sim.sensor import Sensor, SensorNoise
from gslts_sim.texture_atlas import linear_from_srgb, srgb_from_linear


@pytest.fixture(scope="module")
def caster() -> RayCaster:
    return RayCaster(sim_scenes.simple_home())


def wall_camera(width: int = 200, height: int = 150, distance_m: float = 2.0) -> gslts.Camera:
    """Return a camera that sees only the wall y = 0, perpendicularly."""
    pose = gslts.look_at((1.0, distance_m, 1.3), (1.0, 0.0, 1.3))
    return gslts.camera_from_fov(width, height, 0.4, pose)


def room_camera() -> gslts.Camera:
    return gslts.camera_from_fov(200, 150, 1.2, gslts.look_at((0.4, 0.5, 1.6), (3.0, 2.2, 0.7)))


def test_without_noise_the_frame_is_the_truth(caster: RayCaster) -> None:
    camera = room_camera()
    frame, truth = Sensor("none").take(caster, camera, 0, previous_pose=np.eye(4))
    np.testing.assert_array_equal(frame.depth, truth.depth)
    expected = np.rint(255 * srgb_from_linear(truth.radiance.astype(np.float64).clip(0, 1)))
    np.testing.assert_array_equal(frame.rgb, expected.astype(np.uint8))
    assert frame.camera == camera


def test_a_frame_depends_on_seed_and_index_alone(caster: RayCaster) -> None:
    camera = room_camera()

    def taken(seed: int, index: int) -> bytes:
        frame, _ = Sensor("kinect", seed).take(caster, camera, index)
        return frame.rgb.tobytes() + frame.depth.tobytes() + repr(frame.camera).encode()

    assert taken(3, 5) == taken(3, 5)
    assert taken(3, 5) != taken(3, 6)
    assert taken(3, 5) != taken(4, 5)


@pytest.mark.parametrize("distance_m", [1.0, 3.5])
def test_depth_noise_grows_with_the_squared_distance(caster: RayCaster, distance_m: float) -> None:
    noise = SensorNoise(depth_std_m=0.0012, depth_std_per_m=0.0019)
    frame, truth = Sensor(noise).take(caster, wall_camera(distance_m=distance_m), 0)
    error = frame.depth - truth.depth
    expected = 0.0012 + 0.0019 * distance_m**2
    assert np.std(error) == pytest.approx(expected, rel=0.03)
    assert abs(np.mean(error)) < 4 * expected / np.sqrt(error.size)


def test_depth_is_lost_where_the_model_says(caster: RayCaster) -> None:
    camera = room_camera()
    lost = {}
    for name, noise in {
        "range": SensorNoise(depth_range_m=(2.5, 4.0)),
        "grazing": SensorNoise(grazing_rad=np.deg2rad(60)),
        "edges": SensorNoise(edge_dropout=1.0),
        "anywhere": SensorNoise(dropout=0.1, edge_dropout=0.1),
    }.items():
        frame, truth = Sensor(noise).take(caster, camera, 0)
        lost[name] = frame.depth == 0
        np.testing.assert_array_equal(frame.depth[~lost[name]], truth.depth[~lost[name]])
    np.testing.assert_array_equal(lost["range"], (truth.depth < 2.5) | (truth.depth > 4.0))
    np.testing.assert_array_equal(lost["grazing"], truth.cosines < np.float32(0.5))
    steps = np.abs(np.diff(truth.depth, axis=1)) > 0.2
    assert steps.sum() > 20
    assert lost["edges"][:, 1:][steps].all()
    assert lost["edges"].mean() < 0.1
    assert lost["anywhere"].mean() == pytest.approx(0.1, abs=0.01)


def test_rgb_noise_has_its_deviation(caster: RayCaster) -> None:
    camera = wall_camera()
    clean, _ = Sensor("none").take(caster, camera, 0)
    noisy, _ = Sensor(SensorNoise(rgb_std=0.02)).take(caster, camera, 0)
    error = noisy.rgb.astype(float) - clean.rgb
    # Rounding twice adds 1/6 to the variance.
    assert np.std(error) == pytest.approx(np.sqrt((255 * 0.02) ** 2 + 1 / 6), rel=0.03)


def test_exposure_and_white_balance_drift_between_visits() -> None:
    noise = SensorNoise(exposure_std=0.2, white_balance_std=0.05)
    stops = np.log2([Sensor(noise, seed).gains for seed in range(2000)])
    assert np.std(stops[:, 1]) == pytest.approx(0.2, rel=0.06)
    assert np.std(stops[:, 0] - stops[:, 1]) == pytest.approx(0.05, rel=0.06)
    assert abs(np.mean(stops)) < 0.02


def test_exposure_is_a_gain_of_the_light(caster: RayCaster) -> None:
    camera = wall_camera()
    sensor = Sensor(SensorNoise(exposure_std=0.4), seed=1)
    frame, truth = sensor.take(caster, camera, 0)
    light = linear_from_srgb(frame.rgb / 255)
    inside = (frame.rgb > 20) & (frame.rgb < 250)
    assert inside.mean() > 0.9
    ratio = (light / truth.radiance)[inside]
    assert np.median(ratio) == pytest.approx(sensor.gains[1], rel=0.01)
    assert abs(np.log2(sensor.gains[1])) > 0.05


def test_vignetting_takes_its_share_in_the_corners(caster: RayCaster) -> None:
    camera = wall_camera()
    plain, _ = Sensor("none").take(caster, camera, 0)
    dark, _ = Sensor(SensorNoise(vignetting=0.3)).take(caster, camera, 0)
    ratio = linear_from_srgb(dark.rgb / 255) / linear_from_srgb(plain.rgb / 255)
    assert ratio[0, 0].mean() == pytest.approx(0.7, abs=0.03)
    assert ratio[75, 100].mean() == pytest.approx(1.0, abs=0.02)


def test_the_believed_pose_has_the_errors_of_the_model(caster: RayCaster) -> None:
    noise = SensorNoise(position_std_m=0.01, rotation_std_rad=0.02)
    sensor, camera = Sensor(noise), wall_camera(8, 6)
    true_pose = camera.world_from_camera
    shifts, turns = [], []
    for index in range(400):
        frame, _ = sensor.take(caster, camera, index)
        pose = frame.camera.world_from_camera
        shifts.append(pose[:3, 3] - true_pose[:3, 3])
        rotation = true_pose[:3, :3].T @ pose[:3, :3]
        turns.append(0.5 * (rotation - rotation.T)[[2, 0, 1], [1, 2, 0]])
    assert np.std(shifts) == pytest.approx(0.01, rel=0.06)
    assert np.std(turns) == pytest.approx(0.02, rel=0.06)


def test_motion_blurs_edges_along_it(caster: RayCaster) -> None:
    camera = room_camera()
    still, _ = Sensor("none").take(caster, camera, 0)
    before = camera.world_from_camera
    angle = np.deg2rad(15)
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    before[:3, :3] = before[:3, :3] @ turn
    sensor = Sensor(SensorNoise(shutter_fraction=0.3))
    moved, _ = sensor.take(caster, camera, 0, previous_pose=before)
    unmoved, _ = sensor.take(caster, camera, 0, previous_pose=camera.world_from_camera)
    np.testing.assert_array_equal(unmoved.rgb, still.rgb)

    def steepest(rgb: np.ndarray) -> float:
        return float(np.percentile(np.abs(np.diff(rgb.astype(float), axis=1)), 99.9))

    assert steepest(moved.rgb) < 0.6 * steepest(still.rgb)
    np.testing.assert_array_equal(moved.depth, still.depth)


def test_bad_input_is_named() -> None:
    with pytest.raises(ValueError, match="noise must be one of none, kinect, got 'lidar'"):
        Sensor("lidar")
    camera = wall_camera(8, 6)
    rgb, depth = np.zeros((6, 8, 3), np.uint8), np.ones((6, 8), np.float32)
    with pytest.raises(ValueError, match=r"depth: expected float32 \(6, 8\), got float64"):
        RgbdFrame(rgb, depth.astype(float), camera)
    with pytest.raises(ValueError, match=r"rgb: expected uint8 \(6, 8, 3\), got uint8 \(6, 7, 3\)"):
        RgbdFrame(rgb[:, 1:], depth, camera)
    with pytest.raises(ValueError, match="not negative"):
        RgbdFrame(rgb, -depth, camera)
    with pytest.raises(ValueError, match=r"mask: expected bool \(6, 8\), got float32 \(6, 8\)"):
        RgbdFrame(rgb, depth, camera, mask=depth)


def test_lights_are_dimmed_moved_and_switched_off_by_visit() -> None:
    home = sim_scenes.furnished_home(lamp="Mug|1")  # One light of the ceiling, one of a lamp.
    same = Sensor(SensorNoise(), 3).lights(home)
    for light, before in zip(same, home.all_lights, strict=True):
        np.testing.assert_array_equal(light.center, before.center)
        np.testing.assert_array_equal(light.radiance, before.radiance)
    noise = SensorNoise(light_std=0.5, light_off=0.3, light_shift_m=0.2)
    visits = [Sensor(noise, seed).lights(home) for seed in range(400)]
    stops = [np.log2(lit[0].radiance[0] / home.all_lights[0].radiance[0]) for lit in visits]
    assert np.std(stops) == pytest.approx(0.5, rel=0.1)
    owners = [[light.owner for light in lit] for lit in visits]
    assert np.mean([len(those) == 1 for those in owners]) == pytest.approx(0.3, abs=0.07)
    assert all(those[0] is None for those in owners), "daylight is never switched off"
    assert all((lit[0].center == home.all_lights[0].center).all() for lit in visits)
    lamps = [light for lit in visits for light in lit if light.owner]
    shifts = np.array([light.center - home.all_lights[1].center for light in lamps])
    assert 0.15 < np.abs(shifts[:, :2]).max() <= 0.2
    assert (shifts[:, 2] == 0).all()
    only_lamps = replace(home, lights=())
    assert len(Sensor(SensorNoise(light_off=1.0), 0).lights(only_lamps)) == 1, "one always shines"
    without = [Sensor(noise, seed).lights(home.without(["Mug|1"])) for seed in range(9)]
    for lit, fewer in zip(visits, without, strict=False):
        np.testing.assert_array_equal(lit[0].radiance, fewer[0].radiance)


def test_controllers_see_in_the_light_of_their_visit() -> None:
    home = sim_scenes.furnished_home()
    frames = [
        Controller(home, width=32, height=24, noise=SensorNoise(light_std=1.0), seed=seed)
        .observe()
        .rgb.mean()
        for seed in range(4)
    ]
    assert np.ptp(frames) > 1


def test_every_light_has_the_colour_of_the_standard() -> None:
    """Compare C++ with numpy's power, through each of its tables, outside of 0 to 1 and for NaN."""
    light = np.concatenate([np.linspace(-0.1, 1.1, 100_001), [np.nan, np.inf, -np.inf]])
    radiance = np.repeat(light[None, :, None], 3, axis=2)
    rgb = core_sim.measure_color(
        radiance, normals=None, gains=(1, 1, 1), vignetting=0, noise_std=0, threads=1
    )
    expected = np.rint(255 * srgb_from_linear(np.nan_to_num(radiance).clip(0, 1)))
    np.testing.assert_array_equal(rgb, expected.astype(np.uint8))


def test_sensors_do_not_depend_on_threads() -> None:
    rng = np.random.default_rng(0)
    radiance, normals = rng.uniform(size=(7, 5, 3)), rng.normal(size=(7, 5, 3))
    depth, cosines = rng.uniform(0, 5, (2, 7, 5)).astype(np.float32)
    images = [
        core_sim.measure_color(
            radiance,
            normals=normals,
            gains=(1, 0.9, 1.1),
            vignetting=0.1,
            noise_std=0.1,
            threads=threads,
        ).tobytes()
        + core_sim.measure_depth(
            depth,
            cosines,
            normals=normals[..., 0].copy(),
            uniforms=radiance[..., 0].copy(),
            std_m=0.1,
            std_per_m=0.1,
            range_m=(0.1, 4),
            least_cosine=0.1,
            edge_dropout=0.5,
            dropout=0.1,
            threads=threads,
        ).tobytes()
        for threads in (1, 2, 5)
    ]
    assert images[0] == images[1] == images[2]
