"""Occupancy grids: the same map as the files of map_server, read by the rules of Nav2."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from gslts.navigation.grid import Grid
from gslts.navigation.semantic_map import SemanticMap
from gslts.navigation.semantic_map_files import write_map_server
from gslts.types import Ints

grids = pytest.importorskip(
    "gslts.ros.grid_message", reason="needs the messages of ROS: scripts/setup ros"
)


def semantic_map() -> SemanticMap:
    """Return a map without symmetry: every cell counts."""
    layers = np.random.default_rng(0).random((2, 7, 7)) < 0.5
    layers[1] |= layers[0]
    return SemanticMap(Grid(np.array([-1.25, 3.5]), 0.05, 7), layers, (), 0.0)


def map_server_values(folder: Path) -> Ints:
    """Return the grid that map_server publishes of a file: rows from the smallest y on."""
    about = yaml.safe_load((folder / "map.yaml").read_text())
    shades = np.asarray(Image.open(folder / about["image"]))[::-1]
    occupancy = (255 - shades) / 255
    values = np.full(shades.shape, -1)
    values[occupancy > about["occupied_thresh"]] = 100
    values[occupancy < about["free_thresh"]] = 0
    return values


def test_the_grid_is_that_of_the_files(tmp_path: Path) -> None:
    own = semantic_map()
    write_map_server(own, tmp_path)
    header = grids.Header(frame_id="map")
    header.stamp.sec = 17
    message = grids.grid_message(header, own)
    info, about = message.info, yaml.safe_load((tmp_path / "map.yaml").read_text())
    assert info.resolution == pytest.approx(about["resolution"])
    position = info.origin.position
    assert [position.x, position.y, 0.0] == about["origin"]
    assert (info.origin.orientation.w, info.map_load_time.sec) == (1.0, 17)
    values = np.array(message.data).reshape(info.height, info.width)
    np.testing.assert_array_equal(values, map_server_values(tmp_path))
    assert set(values.ravel()) == {-1, 0, 100}


def test_a_cell_is_at_its_position() -> None:
    own = semantic_map()
    message = grids.grid_message(grids.Header(frame_id="map"), own)
    row, column = np.argwhere(own.obstacles)[0]
    x, y = own.grid.centers(np.array([[row, column]]))[0]
    info = message.info  # Formula of nav_msgs/OccupancyGrid.
    at = int((y - info.origin.position.y) / info.resolution) * info.width
    at += int((x - info.origin.position.x) / info.resolution)
    assert message.data[at] == 100
