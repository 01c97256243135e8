"""Benchmark of navigation in one home: episodes, judged by the ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import FiniteFloat

from gslts.fleet.jobs import Add
from gslts.io.image_files import write_image
from gslts.navigation.navigator import Navigator
from gslts.navigation.semantic_map_files import draw_semantic_map
from gslts.semantics.source import Oracle
from gslts_bench.homes import BenchHome
from gslts_bench.navigation.episodes import Episode, categories_of, episodes_of
from gslts_bench.navigation.truth import Truth, succeeds
from gslts_bench.navigation.walker import Walker
from gslts_bench.queries.semantic_map import read_semantic_map
from gslts_bench.runner import BenchRecord, BenchUnit, attempt
from gslts_sim.actions import SceneState
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint

SIZE_PX = (320, 240)
"""Size of the robot's images on its path."""


class Record(BenchRecord):
    """Result of an episode.

    The id is home and number, such as `kitchen_0/007`; `kitchen_0/moved_03/1` for an object that
    was relocated.

    Attributes:
        room_type: Room type of the home.
        category: Category that the robot goes to.
        success: Whether such an object is within 1 m and in the last image, by the ground truth.
        shortest_m: See `Episode`.
        walked_m: Length of the robot's true path.
        status, reason, replans: Result as the robot knows it; see `NavigationResult`.
    """

    room_type: str
    category: str
    success: bool = False
    shortest_m: FiniteFloat
    walked_m: FiniteFloat = 0.0
    status: str = ""
    reason: str = ""
    replans: int = 0

    @classmethod
    def of(cls, episode: Episode) -> Record:
        """Make the record of an episode that has not begun.

        Args:
            episode: The episode.
        """
        return cls(
            id=episode.name,
            room_type=episode.room_type,
            category=episode.category,
            shortest_m=episode.shortest_m,
        )

    def as_json(self) -> dict[str, Any]:
        """Return the record with its SPL as JSON values."""
        return {**super().as_json(), "spl": self.spl}

    @property
    def spl(self) -> float:
        """Success weighted by path length (Anderson et al. 2018)."""
        return self.shortest_m / max(self.walked_m, self.shortest_m) if self.success else 0.0

    @property
    def is_relocated(self) -> bool:
        """True if the object was relocated after mapping."""
        return "/moved_" in self.id


@dataclass(frozen=True)
class NavigateUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        episodes: Number of episodes.
    """

    topic = "navigate"
    record = Record

    episodes: int

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return self.episodes

    def is_asked(self, record: Record) -> bool:
        """Return whether this run asks for the episode of a record.

        Args:
            record: A record in the file of results.
        """
        return int(record.id.rpartition("/")[2]) < self.episodes

    def run(self, done: frozenset[str], add: Add) -> None:
        """Run the episodes that have no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        bench = self.bench
        if all(f"{self.name}/{number:03}" in done for number in range(self.episodes)):
            return
        state = bench.default_state()
        ground = Ground(state, Truth(state.home), bench.setup.noise)
        episodes = episodes_of(ground.truth, bench.room_type, self.name, bench.seed, self.episodes)
        known = read_semantic_map(bench)
        navigator = Navigator(
            known.gaussian_map,
            known.codec,
            Oracle(),
            categories=categories_of(bench.room_type, state.home),
        )
        for number, episode in enumerate(episodes):
            if episode.name not in done:
                image = self.image(episode.name)
                run = partial(run_episode, navigator, ground, episode, number, image)
                add(attempt(Record.of(episode), run).model_dump(mode="json"))


@dataclass(frozen=True, eq=False)
class Ground:
    """A home in which a robot moves.

    Attributes:
        state: State of the home, which may differ from its map.
        truth: Ground truth of that state.
        noise: Preset of the sensor's noise.
    """

    state: SceneState
    truth: Truth
    noise: str


def run_episode(
    navigator: Navigator, ground: Ground, episode: Episode, seed: int, image: Path | None = None
) -> dict[str, Any]:
    """Run one episode.

    Args:
        navigator: Plans on a map that may be older than the home.
        ground: Home of the robot.
        episode: Start and category.
        seed: Seed of the sensor's noise.
        image: File for the path on the semantic map.

    Returns:
        Result fields of `Record`.

    Raises:
        OSError: The image cannot be written.
    """
    width, height = SIZE_PX
    controller = Controller(ground.state, width=width, height=height, noise=ground.noise, seed=seed)
    controller.go(Viewpoint(*episode.position, episode.yaw_deg, 0.0))
    walker = Walker(controller, ground.truth)
    walk = navigator.go(walker, episode.category)
    if image is not None:
        image.parent.mkdir(parents=True, exist_ok=True)
        shown = draw_semantic_map(navigator.semantic_map, walk.path, [episode.category])
        write_image(image, shown)
    instances = walker.event.instances
    return {
        "success": succeeds(ground.truth, episode.category, walker.positions[-1], instances),
        "walked_m": walker.length_m,
        "status": walk.status,
        "reason": walk.reason,
        "replans": walk.replans,
    }


def copy_images(
    units: Sequence[BenchUnit[Record, BenchHome]], records: Sequence[Record], folder: Path
) -> None:
    """Copy the image of each episode to a folder.

    Args:
        units: Units of the run.
        records: Records of the run.
        folder: Folder for the images.

    Raises:
        OSError: An image cannot be written.
    """
    import shutil

    for record in records:
        for unit in units:
            path = unit.image(record.id)
            if record.id.startswith(unit.bench.name) and path.is_file():
                end = "reached" if record.success else "failed"
                shutil.copyfile(path, folder / f"{path.stem}_{record.category}_{end}.png")
