"""2D semantic maps: obstacles, explored area, categories, and their files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import surfel_room
import yaml
from PIL import Image
from scipy.spatial import cKDTree

from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot_body import RobotBody
from gslts.io.image_files import write_image
from gslts.navigation.grid import Grid
from gslts.navigation.semantic_map import SemanticMap, make_semantic_map
from gslts.navigation.semantic_map_files import (
    CELL_PX,
    MAX_SIDE_PX,
    PATH_COLOR,
    draw_semantic_map,
    write_map_server,
)
from gslts.navigation.surface_points import floor_height_m, sample_surfaces
from gslts.semantics.categories import Categories, classify_gaussians
from gslts.semantics.source import Oracle

BODY = RobotBody()


def semantic_map_of(gaussian_map: GaussianMap, *names: str, body: RobotBody = BODY) -> SemanticMap:
    categories = Categories(names, surfel_room.autoencoder(), Oracle())
    return make_semantic_map(gaussian_map, body, categories)


def at(mask: np.ndarray, grid: Grid, *positions: tuple[float, float]) -> list[bool]:
    """Return the values of a layer at positions."""
    return [bool(mask[tuple(cell)]) for cell in grid.cells(np.array(positions))]


def test_layers_are_those_of_the_room() -> None:
    found = semantic_map_of(surfel_room.surfel_map(), "Mug", "Box", "Bed")
    size = found.grid.size
    assert found.layers.shape == (5, size, size)
    assert found.layers.dtype == np.bool_
    middle, free, beyond = (2.0, 1.5), (0.8, 0.7), (-0.4, 1.5)
    assert at(found.obstacles, found.grid, middle, free, beyond) == [True, False, False]
    assert at(found.explored, found.grid, middle, free, beyond) == [True, True, False]
    # Floor, block and box, to a cell at each rim.
    for mask, area_m2, rim_m in (
        (found.explored, 4.0 * 3.0, 14.0),
        (found.category("Mug"), 0.15 * 0.15, 0.6),
        (found.category("Box"), 0.4 * 0.4, 1.6),
    ):
        assert abs(mask.sum() * 0.05**2 - area_m2) <= 0.05 * rim_m
    assert at(found.category("Mug"), found.grid, (2.27, 1.47), (2.05, 1.47)) == [True, False]
    assert not found.category("Bed").any()
    with pytest.raises(ValueError, match=r"expected one of \('Mug', 'Box', 'Bed'\), got 'Sofa'"):
        found.category("Sofa")


def test_the_origin_of_the_map_is_arbitrary() -> None:
    room = surfel_room.surfel_map()
    shift = np.array([120.0, -45.0, 7.3])
    found = semantic_map_of(replace(room, origin=shift))
    expected = semantic_map_of(room)
    assert found.floor_m == pytest.approx(7.3, abs=0.01)
    np.testing.assert_allclose(found.grid.origin - expected.grid.origin, shift[:2], atol=0.26)
    assert found.obstacles.sum() == pytest.approx(expected.obstacles.sum(), rel=0.15)


def test_a_table_larger_than_the_visible_floor_is_no_floor() -> None:
    scales = np.array([0.025, 0.025, 0.002])
    floor = np.stack(np.meshgrid(np.arange(0, 1, 0.05), np.arange(0, 2, 0.05), [0.2]), -1)
    table = np.stack(np.meshgrid(np.arange(1, 3, 0.05), np.arange(0, 2, 0.05), [0.9]), -1)
    means = np.concatenate([floor.reshape(-1, 3), table.reshape(-1, 3)])
    own = surfel_room.gaussians(means, np.tile(scales, (len(means), 1)), [""] * len(means))
    assert floor_height_m(sample_surfaces(own, 0.05)) == pytest.approx(0.2, abs=0.01)


def test_objects_above_the_robot_are_no_obstacles() -> None:
    center, half = np.array([0.8, 0.7, 1.5]), np.array([0.3, 0.3, 0.05])
    sides = [surfel_room.face(center, half, 2, side) for side in (-1, 1)]
    means = np.concatenate([points for points, _ in sides])
    scales = np.tile(sides[0][1], (len(means), 1))
    shelf = surfel_room.gaussians(means, scales, ["Bed"] * len(means))
    room = surfel_room.concatenate(surfel_room.surfel_map(), shelf)
    low, high = (semantic_map_of(room, "Bed", body=RobotBody(height_m=h)) for h in (1.2, 1.6))
    assert at(low.obstacles, low.grid, (0.8, 0.7)) == [False]
    assert at(low.category("Bed"), low.grid, (0.8, 0.7)) == [True]
    assert at(high.obstacles, high.grid, (0.8, 0.7)) == [True]


def test_low_objects_are_no_obstacles() -> None:
    top, flat = surfel_room.face(np.array([0.8, 0.7, 0.05]), np.array([0.3, 0.3, 0.05]), 2, 1)
    rug = surfel_room.gaussians(top, np.tile(flat, (len(top), 1)), [""] * len(top))
    room = surfel_room.concatenate(surfel_room.surfel_map(), rug)
    small, large = (semantic_map_of(room, body=RobotBody(step_m=step)) for step in (0.02, 0.1))
    assert at(small.obstacles, small.grid, (0.8, 0.7)) == [True]
    assert at(large.obstacles, large.grid, (0.8, 0.7)) == [False]


@pytest.mark.parametrize(("count", "solid"), [(1, False), (2, False), (12, True)])
def test_stray_gaussians_are_no_obstacle(count: int, solid: bool) -> None:
    rng = np.random.default_rng(0)
    means = np.array([0.825, 0.725, 0.5]) + rng.uniform(-0.02, 0.02, (count, 3))
    stray = surfel_room.gaussians(means, np.full((count, 3), 0.02), [""] * count)
    found = semantic_map_of(surfel_room.concatenate(surfel_room.surfel_map(), stray))
    assert at(found.obstacles, found.grid, (0.825, 0.725)) == [solid]


@pytest.mark.parametrize("radius_m", [0.1, 0.05])
def test_small_robots_have_the_obstacles_of_others(radius_m: float) -> None:
    """The cells of a small robot are smaller than the distance of Gaussians."""
    room, body = surfel_room.surfel_map(), RobotBody(radius_m=radius_m, height_m=0.3)
    fine, coarse = make_semantic_map(room, body), make_semantic_map(room, body, cell_m=0.05)
    found, expected = (own.grid.centers(np.argwhere(own.obstacles)) for own in (fine, coarse))
    assert cKDTree(found).query(expected)[0].max() <= 0.05
    assert cKDTree(expected).query(found)[0].max() <= 0.05


def test_transparent_and_far_gaussians_are_ignored() -> None:
    rng = np.random.default_rng(0)
    haze = surfel_room.gaussians(
        np.array([0.8, 0.7, 0.5]) + rng.uniform(-0.1, 0.1, (200, 3)),
        np.full((200, 3), 0.02),
        [""] * 200,
    )
    haze = replace(haze, logit_opacities=np.full(200, -2, np.float32))
    far = surfel_room.gaussians(rng.uniform(-500, 500, (50, 3)), np.full((50, 3), 0.5), [""] * 50)
    room = surfel_room.surfel_map()
    found = semantic_map_of(surfel_room.concatenate(surfel_room.concatenate(room, haze), far))
    expected = semantic_map_of(room)
    np.testing.assert_array_equal(found.layers, expected.layers)
    np.testing.assert_array_equal(found.grid.origin, expected.grid.origin)


def test_large_gaussians_cover_all_their_cells() -> None:
    means = np.array([[x, y, 0.0] for x in (0.0, 0.6, 1.2) for y in (0.0, 0.6, 1.2)])
    floor = surfel_room.gaussians(means, np.tile([0.3, 0.3, 0.002], (9, 1)), [""] * 9)
    found = make_semantic_map(floor, BODY)
    inside = np.argwhere(np.ones_like(found.explored))
    x, y = found.grid.centers(inside).T
    middle = (x > 0) & (x < 1.2) & (y > 0) & (y < 1.2)
    assert found.explored[tuple(inside[middle].T)].all()
    assert not found.obstacles.any()


def test_the_most_relevant_category_wins() -> None:
    types = ["Mug", "Box", "Bed", ""]
    own = surfel_room.gaussians(np.zeros((4, 3)), np.full((4, 3), 0.01), types)
    rows = np.array([0, 1, 2, 3, 0])
    found = classify_gaussians(own, rows, surfel_room.autoencoder(), Oracle(), ["Box", "Mug"])
    assert found.tolist() == [1, 0, -1, -1, 1]
    assert classify_gaussians(own, rows[:0], surfel_room.autoencoder(), Oracle(), ["Box"]).size == 0
    for names in (["Mug", "Mug"], [" "]):
        with pytest.raises(ValueError, match="names: one is empty or occurs twice"):
            classify_gaussians(own, rows, surfel_room.autoencoder(), Oracle(), names)
    plain = replace(own, features=np.zeros((4, 3), np.float32))
    with pytest.raises(
        ValueError, match="features of the map have 3 dimensions, which is no multiple"
    ):
        classify_gaussians(plain, rows, surfel_room.autoencoder(), Oracle(), ["Mug"])


def test_bad_maps_are_rejected() -> None:
    room = surfel_room.surfel_map()
    nothing = room.select(np.zeros(0, np.intp))
    with pytest.raises(ValueError, match="it has no opaque Gaussian"):
        make_semantic_map(nothing, BODY)
    with pytest.raises(ValueError, match=r"size must be in 1\.\.4096"):
        make_semantic_map(room, BODY, cell_m=0.001)
    with pytest.raises(ValueError, match="cell_m: must be positive"):
        Grid(np.zeros(2), 0.0, 4)


def map_server_states(folder: Path, positions: np.ndarray) -> list[str]:
    """Return the states of positions as map_server documents them."""
    header = yaml.safe_load((folder / "map.yaml").read_text())
    image = np.asarray(Image.open(folder / header["image"]))
    x0, y0, yaw = header["origin"]
    assert yaw == 0
    assert header["negate"] == 0
    states = []
    for x, y in positions:
        column = int((x - x0) // header["resolution"])
        row = image.shape[0] - 1 - int((y - y0) // header["resolution"])
        occupied = (255 - int(image[row, column])) / 255
        if occupied > header["occupied_thresh"]:
            states.append("occupied")
        else:
            states.append("free" if occupied < header["free_thresh"] else "unknown")
    return states


def test_map_server_reads_the_files(tmp_path: Path) -> None:
    found = semantic_map_of(surfel_room.surfel_map())
    write_map_server(found, tmp_path)
    assert map_server_states(
        tmp_path, np.array([(2.0, 1.5), (0.3, 2.7), (0.8, 0.7), (-0.4, -0.4)])
    ) == [*("occupied", "occupied", "free", "unknown")]
    cells = np.random.default_rng(0).integers(0, found.grid.size, (300, 2))
    states = map_server_states(tmp_path, found.grid.centers(cells))
    for state, cell in zip(states, cells, strict=True):
        expected = "free" if found.explored[tuple(cell)] else "unknown"
        assert state == ("occupied" if found.obstacles[tuple(cell)] else expected)
    assert set(states) == {"occupied", "free", "unknown"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.pgm", "map.yaml"]


def test_the_resolution_of_a_numpy_number_is_a_number(tmp_path: Path) -> None:
    found = make_semantic_map(surfel_room.surfel_map(), BODY, cell_m=np.float64(0.05))
    write_map_server(found, tmp_path)
    assert yaml.safe_load((tmp_path / "map.yaml").read_text())["resolution"] == 0.05


def test_files_are_written_atomically(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = semantic_map_of(surfel_room.surfel_map())
    write_map_server(found, tmp_path)
    before = (tmp_path / "map.pgm").read_bytes()

    def disk_full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", disk_full)
    with pytest.raises(OSError, match=r"map\.pgm"):
        write_map_server(replace(found, layers=~found.layers), tmp_path)
    assert (tmp_path / "map.pgm").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 2


def test_images_show_layers_and_paths(tmp_path: Path) -> None:
    found = semantic_map_of(surfel_room.surfel_map(), "Mug", "Box")
    path = np.array([[0.5, 0.5], [3.5, 0.5]])
    write_image(tmp_path / "map.png", draw_semantic_map(found, path, ["Mug"]))
    image = np.asarray(Image.open(tmp_path / "map.png"))

    def pixel(x: float, y: float) -> tuple[int, ...]:
        row, column = found.grid.cells(np.array([[x, y]]))[0]
        row = found.grid.size - 1 - row  # y is upwards.
        return tuple(image[int((row + 0.5) * CELL_PX), int((column + 0.5) * CELL_PX)].tolist())

    mug = pixel(2.27, 1.47)
    assert max(mug) - min(mug) > 100
    assert pixel(0.3, 2.7) == pixel(2.0, 1.2) == (70, 70, 70)
    assert pixel(0.8, 1.5) == (255, 255, 255)
    line = image[image.shape[0] - 1 - int((0.5 - found.grid.origin[1]) / 0.05 * CELL_PX)]
    assert (np.abs(line.astype(int) - PATH_COLOR).sum(axis=1) < 60).sum() > 40 * CELL_PX


def test_images_of_large_maps_are_bounded() -> None:
    layers = np.zeros((2, 1500, 1500), np.bool_)
    layers[:, :750] = True
    large = SemanticMap(Grid(np.zeros(2), 0.05, 1500), layers, (), 0.0)
    image = draw_semantic_map(large, np.array([[10.0, 10.0], [70.0, 60.0]]))
    assert CELL_PX * 1500 > MAX_SIDE_PX >= len(image)
    assert image[len(image) - 1 - int(20 / 75 * len(image)), 10].tolist() == [70, 70, 70]
    end = image[len(image) - 1 - int(60 / 75 * len(image)), int(70 / 75 * len(image))]
    assert end.tolist() == list(PATH_COLOR)
