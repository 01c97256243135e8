"""Semantic maps as occupancy grids of Nav2."""

from __future__ import annotations

import array

import numpy as np
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Header

from gslts.navigation.semantic_map import SemanticMap

OCCUPIED, FREE, UNKNOWN = 100, 0, -1
"""Values of cells, as map_server of Nav2 publishes them in its trinary mode."""


def grid_message(header: Header, semantic_map: SemanticMap) -> OccupancyGrid:
    """Return the obstacles and the explored floor of a map.

    Args:
        header: Its frame is that of the map; its stamp becomes the time of the map as well.
        semantic_map: The map; its grid is at height 0, as Nav2 expects it.
    """
    cells = np.full(semantic_map.obstacles.shape, UNKNOWN, np.int8)
    cells[semantic_map.explored] = FREE
    cells[semantic_map.obstacles] = OCCUPIED
    grid, data = semantic_map.grid, array.array("b")
    data.frombytes(cells.data)  # Rows along x, from the smallest y on: the order of both.
    message = OccupancyGrid(header=header, data=data)
    info = message.info
    info.map_load_time, info.resolution = header.stamp, grid.cell_m
    info.width = info.height = grid.size
    info.origin.position.x, info.origin.position.y = grid.origin.tolist()
    info.origin.orientation.w = 1.0
    return message
