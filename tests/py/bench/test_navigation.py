"""Scores and ground truth of `gslts bench navigate`."""

from collections.abc import Iterator
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import surfel_room
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from gslts_bench.navigation import relocated
from gslts_bench.navigation.episodes import MIN_PATH_M, episodes_of
from gslts_bench.navigation.relocated import NOT_UPDATED, WALKS, RelocatedUnit
from gslts_bench.navigation.run import Record
from gslts_bench.navigation.tables import summarize, tabulate
from gslts_bench.navigation.truth import Truth, floor_distances_m, succeeds
from gslts_bench.navigation.walker import Walker
from gslts_bench.tables import tables_markdown
from gslts_sim.controller import Controller
from gslts_sim.home import pose
from gslts_sim.robot_body import Viewpoint


def record(success: bool, shortest_m: float, walked_m: float, room: str = "kitchen") -> Record:
    return Record(
        id=f"{room}_0/000",
        room_type=room,
        category="Mug",
        success=success,
        shortest_m=shortest_m,
        walked_m=walked_m,
        status="reached",
    )


def test_spl_by_hand() -> None:
    # Anderson et al. 2018: S l / max(p, l).
    kitchen = [record(True, 2, 2), record(True, 1, 4), record(False, 3, 3), record(True, 2, 1.9)]
    bedroom = [record(True, 1, 2, "bedroom"), record(False, 1, 0, "bedroom")]
    assert [episode.spl for episode in kitchen] == [1, 0.25, 0, 1]
    rooms = summarize([*kitchen, *bedroom])["rooms"]
    assert rooms["kitchen"]["spl"] == pytest.approx(2.25 / 4)
    assert rooms["bedroom"]["spl"] == pytest.approx(0.5 / 2)
    assert rooms["overall"]["spl"] == pytest.approx(2.75 / 6)
    assert (rooms["kitchen"]["successes"], rooms["overall"]["successes"]) == (3, 4)
    assert summarize([*kitchen, *bedroom])["far"] == {
        "episodes": 3,
        "successes": 2,
        "spl": pytest.approx(2 / 3),
        "shortest_m": pytest.approx(7 / 3),
    }


def test_moved_objects_are_counted_apart() -> None:
    def walk(name: str, success: bool, status: str = "reached") -> Record:
        walked = record(success, 1, 1)
        return walked.model_copy(update={"id": f"kitchen_0/moved_{name}", "status": status})

    moved = [walk("00/0", True), walk("00/1", False), walk("01/0", False, NOT_UPDATED)]
    found = summarize([record(True, 1, 1), *moved])
    assert found["rooms"]["overall"]["episodes"] == 1
    assert found["moved"]["successes"] == 1
    assert found["moved"]["episodes"] == 2
    assert found["moved"]["relocations"] == [1, 2]
    assert "updated: 50.0 % (1 of 2)." in tables_markdown(tabulate(found))


def relocated_unit(monkeypatch: pytest.MonkeyPatch, fails_at: int | None) -> RelocatedUnit:
    """Return work on one relocated mug, whose walks are made up; one of them may fail."""
    task = SimpleNamespace(change=SimpleNamespace(object_type="Mug"))
    bench = SimpleNamespace(
        name="kitchen_0",
        room_type="kitchen",
        tasks=lambda _: [task],
        load=lambda: None,
        map=lambda: None,
    )

    def walks(_unit: RelocatedUnit, name: str, *_: object) -> Iterator[Record]:
        for walk in range(WALKS):
            if walk == fails_at:
                raise ValueError("no luck")
            yield record(True, 1, 1).model_copy(update={"id": f"{name}/{walk}"})

    for name in ("read_semantic_map", "cameras_of_map"):
        monkeypatch.setattr(relocated, name, lambda _: {})
    monkeypatch.setattr(relocated, "ChangeDetector", SimpleNamespace(of_map=lambda _: None))
    monkeypatch.setattr(relocated, "_is_unique_relocation", lambda *_: True)
    monkeypatch.setattr(RelocatedUnit, "_walks", walks)
    return RelocatedUnit(bench, 1)


IDS = {f"kitchen_0/moved_00/{walk}" for walk in range(WALKS)}


def test_a_walk_that_fails_fails_its_object(monkeypatch: pytest.MonkeyPatch) -> None:
    added: list[dict[str, Any]] = []
    relocated_unit(monkeypatch, fails_at=1).run(frozenset(), added.append)
    assert [result["error"] for result in added] == ["ValueError: no luck"]
    added.clear()
    relocated_unit(monkeypatch, fails_at=None).run(frozenset(), added.append)
    assert {result["id"] for result in added} == IDS


@pytest.mark.parametrize("count", range(WALKS + 1))
def test_walks_left_by_a_kill_are_made_later(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    first: list[str] = []
    unit = relocated_unit(monkeypatch, fails_at=None)
    unit.run(frozenset(), lambda result: first.append(result["id"]))
    kept, later = first[:count], list[str]()
    unit.run(frozenset(kept), lambda result: later.append(result["id"]))
    assert len(kept + later) == WALKS
    assert {*kept, *later} == IDS


def test_tables_without_a_record_are_empty() -> None:
    text = tables_markdown(tabulate(summarize([])))
    assert "| overall | - | - | - |" in text
    assert "| overall | 50.0 % (1 of 2) | 50.0 | 1.00 m |" in tables_markdown(
        tabulate(summarize([record(True, 1, 1), record(False, 1, 1)]))
    )


@cache
def truth() -> Truth:
    return Truth(surfel_room.home())


def test_paths_are_those_of_dijkstra() -> None:
    places, goals = truth().positions, [0, 7]
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    starts, ends = np.nonzero((apart > 0) & (apart < 0.36))
    free = [truth().is_straight(places[a], places[b]) for a, b in zip(starts, ends, strict=True)]
    lengths = np.where(free, apart[starts, ends], 0)
    graph = coo_matrix((lengths, (starts, ends)), apart.shape).tocsr()
    graph.eliminate_zeros()
    expected = dijkstra(graph, indices=goals, min_only=True)
    np.testing.assert_allclose(truth().metres_to(goals), expected)
    assert not all(free)  # Some steps cut the corner of the block.
    assert np.isinf(truth().metres_to([])).all()


def test_goals_are_near_and_see_the_object() -> None:
    places, mug = truth().positions, surfel_room.home()["Mug|1"]
    goals = truth().goals("Mug")
    assert goals
    # The mug stands on the block, 0.2 m from its right side.
    assert (floor_distances_m(mug, places[goals]) <= 1).all()
    assert places[goals][:, 0].max() > 2.6
    assert truth().goals("Bed") == []
    hidden = surfel_room.home().with_object(
        surfel_room.box("Box|2", (2.1, 1.3, 0.74), (2.45, 1.65, 1.1))
    )
    assert Truth(hidden).goals("Mug") == []


def test_distances_are_to_the_outline_however_it_is_turned() -> None:
    box = surfel_room.box("Box|1", (-0.5, -0.5, 0), (0.5, 0.5, 1))
    places = np.array([[2.0, 0.0], [0.1, 0.1], [1.5, 1.5]])
    np.testing.assert_allclose(floor_distances_m(box, places), [1.5, 0, 2**0.5], atol=1e-6)
    turned = box.place_at(pose(0, 0, 0, np.pi / 4), None)
    expected = [2 - 0.5**0.5, 0, 1.5 * 2**0.5 - 0.5]
    np.testing.assert_allclose(floor_distances_m(turned, places), expected, atol=1e-6)


def test_success_needs_an_object_that_is_near_and_in_view() -> None:
    robot = Controller(surfel_room.home(), width=160, height=120)

    def ends(x: float, y: float, yaw_deg: float, category: str = "Mug") -> bool:
        robot.go(Viewpoint(x, y, yaw_deg, 40.0))
        return succeeds(truth(), category, np.array([x, y]), robot.snapshot(0).instances)

    assert ends(3.0, 1.5, 180)
    assert not ends(3.0, 1.5, 0)  # It faces away.
    assert not ends(3.5, 1.5, 180)  # 1.15 m away.
    assert not ends(3.0, 1.5, 180, "Box")


def test_episodes_can_be_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "gslts_bench.navigation.episodes.CATEGORIES", {"kitchen": ("Mug", "Bed", "Box")}
    )
    drawn = episodes_of(truth(), "kitchen", "room", 3, 8)
    assert drawn[:5] == episodes_of(truth(), "kitchen", "room", 3, 5)
    assert drawn != episodes_of(truth(), "kitchen", "room", 4, 8)
    assert [episode.name for episode in drawn[:2]] == ["room/000", "room/001"]
    for pair in zip(drawn[::2], drawn[1::2], strict=True):
        assert {episode.category for episode in pair} == {"Mug", "Box"}
    for episode in drawn:
        directions = truth().metres_to(truth().goals(episode.category))
        row = np.argmin(np.linalg.norm(truth().positions - episode.position, axis=1))
        assert episode.shortest_m == directions[row] >= MIN_PATH_M
    monkeypatch.setattr("gslts_bench.navigation.episodes.CATEGORIES", {"kitchen": ("Bed",)})
    with pytest.raises(ValueError, match="room: none of Bed can be reached"):
        episodes_of(truth(), "kitchen", "room", 3, 8)


def test_the_walker_does_not_jump_over_the_block() -> None:
    controller = Controller(surfel_room.home(), width=160, height=120)
    controller.go(Viewpoint(1.25, 1.5, 0.0, 0.0))
    walker = Walker(controller, truth())
    assert not walker.move_towards(np.array([2.75, 1.5]), 0.0)
    np.testing.assert_allclose(walker.pose()[:2, 3], [1.25, 1.5])
    np.testing.assert_array_equal(walker.pose(), walker.observe().camera.world_from_camera)
    assert walker.move_towards(np.array([1.25, 0.5]), 0.0)
    assert walker.move_towards(np.array([1.27, 0.52]), 1.0)  # The same place of the grid.
    assert walker.length_m == pytest.approx(1.0)
    np.testing.assert_allclose(walker.positions, [[1.25, 1.5], [1.25, 0.5]])
