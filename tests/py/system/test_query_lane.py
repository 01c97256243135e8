"""Queries over ROS, answered in a thread of their own beside a keeper."""

import json
import queue
from pathlib import Path
from types import SimpleNamespace

import change_room
from semantic_room import embedded_map, map_semantics
from update_room import LOOP

from gslts.keeper.keeper import MapKeeper
from gslts.ros.query_lane import QueryLane
from gslts.store.map_folder import write_map_folder

WAIT_S = 120
"""Longer than any answer takes on a busy machine."""


def test_queries_are_answered_beside_the_keeper(tmp_path: Path) -> None:
    gaussian_map, _ = embedded_map()
    write_map_folder(tmp_path / "map", gaussian_map, {}, change_room.mapped()[1])
    answers: queue.Queue[str] = queue.Queue()
    outbox = SimpleNamespace(answer=answers.put)
    with MapKeeper(tmp_path / "map", LOOP, log=print) as keeper:
        with QueryLane(tmp_path / "map", keeper, outbox) as lane:
            lane.add("block")
            without = json.loads(answers.get(timeout=WAIT_S))
        keeper.semantics = map_semantics()
        with QueryLane(tmp_path / "map", keeper, outbox) as lane:
            lane.add("block")
            lane.add("dragon")
            found, missing = (json.loads(answers.get(timeout=WAIT_S)) for _ in range(2))
    assert (without["status"], without["query"]) == ("failed", "block")
    assert "gslts semantics adds them" in without["reason"]
    assert (found["query"], found["status"], found["version"]) == ("block", "found", 1)
    assert found["objects"][0]["score"] > 0.5
    assert (missing["query"], missing["status"], missing["objects"]) == ("dragon", "not found", [])
