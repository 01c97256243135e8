"""A day of a building of many rooms with tiny maps, in real stores and a real bucket.

    python benchmarks/fleet_benchmark.py --rooms 1000
    python benchmarks/fleet_benchmark.py --rooms 1000 --store azurite

makes a map of some floor Gaussians for each room and pushes it. In each room a robot commits
updates with frames, landmarks, an image and an object change, and pushes each. Another client reads
`building.json` from the bucket, clones the maps, pulls the news, and plans a route through the
building. The bucket is a folder, or Azurite (`faults/object_store.py`).

The same day is simulated in a few rooms first. Costs of a room there, times the number of rooms,
are the computed costs of many rooms; computed requests are those of `fleet_capacity.py`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import obstore
from fleet_capacity import UPDATE_PUTS, version_requests
from request_meter import Cost, Meter
from share_benchmark import AZURITE, commit_update, object_store

from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.building import Building
from gslts.fleet.building_file import MAX_FILE_BYTES, BuildingFile, Door, Room, write_building_file
from gslts.fleet.exchange import push_map
from gslts.semantics.files import write_autoencoder
from gslts.semantics.source import Oracle
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.store.causes import SemanticsCause
from gslts.store.delta import Delta
from gslts.store.map_folder import open_map, write_map_folder
from gslts.store.records import ObjectEvent

ROOM_M, OVERLAP_M, SPACING_M = 3.0, 0.75, 0.5
"""Edge of a room, the floor of the neighbours that its map shows, and distance of Gaussians, m."""
CODE_DIMS, FLOOR = 8, "Floor"
"""Length of the semantic features of the last room, and the name of all that it shows."""
BOX = ((0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
"""Box of the objects of all updates, m."""
NEW_MAP_PUTS = 4
"""Objects of a new map without measurements: Gaussians, manifest, cameras, version."""
UPDATES = 3
"""Updates of a room with a tiny map."""


def floor_map() -> GaussianMap:
    """Return some flat Gaussians on the floor of a room."""
    line = np.arange(SPACING_M / 2 - OVERLAP_M, ROOM_M + OVERLAP_M, SPACING_M)
    x, y = (axis.ravel() for axis in np.meshgrid(line, line))
    return GaussianMap(
        means=np.stack([x, y, np.zeros_like(x)], axis=1).astype(np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (x.size, 1)),
        log_scales=np.tile(np.log(np.float32([SPACING_M / 2, SPACING_M / 2, 0.002])), (x.size, 1)),
        logit_opacities=np.full(x.size, 4, np.float32),
        sh=np.zeros((x.size, 1, 3), np.float32),
        features=np.zeros((x.size, 0), np.float32),
    )


def repaint(before: GaussianMap, _: int) -> Delta:
    """Return an update that gives two Gaussians other colours."""
    changed = before.select(np.arange(2))
    nothing = before.select(np.arange(0))
    return Delta(np.zeros(0, np.uint64), nothing, replace(changed, sh=changed.sh + np.float32(0.1)))


def add_words(folder: Path) -> None:
    """Give a map semantic features, by which all of it is found as floor."""
    embeddings = Oracle().encode((FLOOR, "Wall"))
    autoencoder = train_autoencoder(embeddings, CODE_DIMS, steps=100)
    cause = SemanticsCause(
        source="oracle",
        dataset="building",
        levels=1,
        code_dims=CODE_DIMS,
        names=(FLOOR,),
        autoencoder=write_autoencoder(autoencoder, folder),
    )
    with open_map(folder, writable=True) as store:
        now = store.read()
        codes = np.tile(autoencoder.encode(embeddings[:1]), (now.size, 1))
        store.commit_features(replace(now, features=codes.astype(np.float32)), cause)


def describe_building(rooms: int) -> BuildingFile:
    """Return rooms in rows and columns, with a door to each neighbour.

    Args:
        rooms: Number of rooms.
    """
    columns = math.ceil(math.sqrt(rooms))

    def pose(number: int) -> tuple[float, float]:
        return number % columns * ROOM_M, number // columns * ROOM_M

    def door(number: int, other: int) -> Door:
        (x, y), (other_x, other_y) = pose(number), pose(other)
        middle = ((x + other_x + ROOM_M) / 2, (y + other_y + ROOM_M) / 2, 0.0)
        return Door(rooms=(room_name(number), room_name(other)), position_m=middle)

    doors = [door(k, k + 1) for k in range(rooms - 1) if (k + 1) % columns]
    doors += [door(k, k + columns) for k in range(rooms - columns)]
    by_name = {room_name(k): _room(k, *pose(k)) for k in range(rooms)}
    return BuildingFile(rooms=by_name, doors=tuple(doors))


def _room(number: int, x: float, y: float) -> Room:
    rows = ((1.0, 0.0, 0.0, x), (0.0, 1.0, 0.0, y), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    return Room(map=room_name(number), building_from_map=rows)


def room_name(number: int) -> str:
    """Return the name of a room and its map.

    Args:
        number: Of the room.
    """
    return f"room_{number:05}"


def simulate_day(folder: Path, url: str, rooms: int) -> tuple[dict[str, Cost], dict[str, float]]:
    """Simulate robots and a client in a building for a day.

    Args:
        folder: Empty, for the maps of the robots and the cache of the client.
        url: Of a folder in a bucket.
        rooms: Number of rooms.

    Returns:
        Costs by operation, and further numbers.
    """
    os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
    rng, meter = np.random.default_rng(0), Meter()
    content, folders = describe_building(rooms), [folder / room_name(k) for k in range(rooms)]
    file = folder / "building.json"
    write_building_file(content, file)
    for path in folders:
        write_map_folder(path, floor_map(), {"dataset": path.name}, {})
    store = obstore.store.from_url(url, **({"mkdir": True} if url.startswith("file") else {}))
    obstore.put(store, file.name, file.read_bytes())
    with meter.counting():
        with meter.measuring("push a new map", rooms):
            for path in folders:
                push_map(path, f"{url}/{path.name}")
        show(meter, "show, cloning", url, rooms)
        for number in range(UPDATES):
            event = ObjectEvent(kind="addition", type=f"Mug {number}", boxes=(None, BOX))
            for path in folders:
                with meter.measuring("commit", 1):
                    commit_update(path, rng, repaint, 10, 1000, [event])
                with meter.measuring("push", 1):
                    push_map(path)
        histories = show(meter, f"show, pulling {UPDATES} updates", url, rooms)
        assert all(len(history.changes) == UPDATES for history in histories.values())
        show(meter, "show, no news", url, rooms)
        add_words(folders[-1])
        push_map(folders[-1])
        Building.read(f"{url}/{file.name}").map_path(room_name(rooms - 1))
        building = Building.read(f"{url}/{file.name}")
        with meter.measuring("query", rooms):
            answer = building.query(FLOOR.lower())
        with meter.measuring("plan", rooms):
            route = building.plan(answer, np.full(2, ROOM_M / 2), room_name(0))
        assert route.legs, route.reason
    numbers = {
        "building.json, bytes a room": file.stat().st_size / rooms,
        "rooms of the route": len(route.legs),
        "length of the route, m": route.length_m,
    }
    return meter.costs, numbers


def show(meter: Meter, name: str, url: str, rooms: int) -> dict[str, Any]:
    """Read the histories of all rooms, as `gslts building show` does.

    Args:
        meter: Measures it.
        name: Of the operation.
        url: Of the folder in the bucket.
        rooms: Number of rooms.
    """
    with meter.measuring(name, rooms):
        histories, problems = Building.read(f"{url}/building.json").histories()
    assert not problems, problems
    return histories


def computed_requests(rooms: int) -> dict[str, int]:
    """Return the requests of the operations on all rooms, as `fleet_capacity.py` counts them.

    Args:
        rooms: Number of rooms.

    Returns:
        Requests by operation.
    """
    none = version_requests(1, 1)
    updates = version_requests(1, 1 + UPDATES) + UPDATES * (UPDATE_PUTS - 1)
    clone = version_requests(0, 1) + NEW_MAP_PUTS - 1
    return {
        "push a new map": rooms * (version_requests(0, 0) + NEW_MAP_PUTS),
        "show, cloning": 1 + rooms * clone,
        "commit": 0,
        "push": rooms * UPDATES * (none + UPDATE_PUTS),
        f"show, pulling {UPDATES} updates": 1 + rooms * updates,
        "show, no news": 1 + rooms * none,
        "query": rooms * none,
        "plan": 0,
    }


def print_table(few: dict[str, Cost], many: dict[str, Cost], rooms: tuple[int, int]) -> None:
    """Print measured against computed costs of many rooms.

    Args:
        few: Costs by operation in a building of few rooms.
        many: The same in a building of many rooms.
        rooms: Numbers of rooms of both.
    """
    factor, requests = rooms[1] / rooms[0], computed_requests(rooms[1])
    print("|  | calls | requests | computed | bytes | computed | CPU s | computed | ms a call |")
    print("| :-- |" + 8 * " --: |")
    for name, cost in many.items():
        small = few[name]
        cells = [
            f"{cost.calls:,}",
            f"{cost.requests:,}",
            f"{requests[name]:,}",
            f"{cost.bytes:,}",
            f"{factor * small.bytes:,.0f}",
            f"{cost.cpu_s:.1f}",
            f"{factor * small.cpu_s:.1f}",
            f"{1000 * cost.seconds / cost.calls:.1f}",
        ]
        print(f"| {name} |", " | ".join(cells), "|")


def main() -> None:
    """Measure, and print tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rooms", type=int, default=1000)
    parser.add_argument("--few", type=int, default=20, help="rooms of the building before")
    parser.add_argument("--store", choices=["folder", "azurite"], default="folder")
    given = parser.parse_args()
    azurite = given.store == "azurite"
    opened: Callable[[], Any] = object_store if azurite else nullcontext
    with tempfile.TemporaryDirectory() as name, opened() as port:
        folder, bucket = Path(name), f"file://{name}/bucket"
        if azurite:
            os.environ.update(AZURITE.environment(port))
            bucket = AZURITE.bucket
        few, _ = simulate_day(_new(folder / "few"), f"{bucket}/few", given.few)
        many, numbers = simulate_day(_new(folder / "many"), f"{bucket}/many", given.rooms)
    print_table(few, many, (given.few, given.rooms))
    numbers["building.json, maximum number of rooms"] = (
        MAX_FILE_BYTES // numbers["building.json, bytes a room"]
    )
    print(json.dumps(numbers, indent=1))


def _new(folder: Path) -> Path:
    folder.mkdir()
    return folder


if __name__ == "__main__":
    main()
