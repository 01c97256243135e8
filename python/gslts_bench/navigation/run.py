"""Navigation in one home: episodes, judged by what is true."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import BaseModel, FiniteFloat

from gslts.navigation.navigator import Navigator
from gslts.navigation.semantic_map_files import draw_semantic_map, write_picture
from gslts.semantics.source import Oracle
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.homes import MAP_S, RECORDING_S, BenchHome, default_state
from gslts_bench.navigation.episodes import CATEGORIES, Episode, episodes_of
from gslts_bench.navigation.truth import Truth, succeeds
from gslts_bench.navigation.walker import Walker
from gslts_bench.queries.semantic_homes import SEMANTICS_S, taught
from gslts_bench.work import Add, Result, Tell, message_of, validated
from gslts_sim.actions import SceneState
from gslts_sim.controller import Controller
from gslts_sim.home_source import HomeSource
from gslts_sim.robot_body import Viewpoint
from gslts_sim.strict_model import STRICT

SIZE_PX = (320, 240)
"""Of what the robot sees on its way."""
EPISODE_S = 2.0
"""About how long one takes, for the progress."""


class Record(BaseModel):
    """How an episode went.

    Attributes:
        id: Its home and its number, such as `kitchen_0/007`; `kitchen_0/moved_03/1` to an object
            that was moved.
        room_type: Of the home.
        category: That was gone to.
        success: Whether such an object is within 1 m in truth, and in the last picture.
        shortest_m: See `Episode`.
        walked_m: Length of the robot's way in truth.
        status, reason, replans: As the robot sees it; see `NavigationResult`.
        error: Why there is no result.
    """

    model_config = STRICT

    id: str
    room_type: str
    category: str
    success: bool = False
    shortest_m: FiniteFloat
    walked_m: FiniteFloat = 0.0
    status: str = ""
    reason: str = ""
    replans: int = 0
    error: str | None = None

    @property
    def spl(self) -> float:
        """Success weighted by path length (Anderson et al. 2018)."""
        return self.shortest_m / max(self.walked_m, self.shortest_m) if self.success else 0.0


@dataclass(frozen=True)
class NavigateUnit:
    """One home.

    Attributes:
        bench: The home.
        episodes: How many.
        code: Digests of the code that decides results; see `HomeSetup`.
    """

    bench: BenchHome
    episodes: int
    code: dict[str, Any] = field(
        default_factory=lambda: {
            "python": code_digest(__name__),
            "native": native_digest(),
        }
    )

    @property
    def name(self) -> str:
        """That of the home."""
        return self.bench.name

    @cached_property
    def results(self) -> Path:
        """The file of records; another one when anything that decides them is another."""
        key = digest({"map": self.bench.mapped_of, "code": self.code})
        return self.bench.work / "navigate" / f"{self.name}_{key}.jsonl"

    def picture(self, episode: str) -> Path:
        """Of an episode."""
        return self.results.with_suffix("") / f"{episode.replace('/', '_')}.png"

    def record_of(self, result: Result) -> Record | None:
        """None beyond the number of episodes; see `RecordUnit`."""
        record = validated(result, Record, self.results)
        return record if int(record.id.rpartition("/")[2]) < self.episodes else None

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes."""
        whole = MAP_S + RECORDING_S * self.bench.setup.frames + SEMANTICS_S
        return EPISODE_S * max(0, self.episodes - len(done)) + (0 if done else whole)

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Goes through the episodes that were not gone through yet.

        Raises:
            ValueError: Nothing in the home can be gone to, or no map can be made of it.
            OSError: The disk is full.
        """
        bench = self.bench
        if all(f"{self.name}/{number:03}" in done for number in range(self.episodes)):
            return
        task = bench.tasks(1)[0]
        assert isinstance(task.home, HomeSource)  # As it comes from a seed.
        state = default_state(task.home, task.initial_actions)
        truth = Truth(state.home)
        episodes = episodes_of(truth, bench.room_type, self.name, bench.seed, self.episodes)
        known = taught(bench, tell)
        navigator = Navigator(
            known.gaussian_map,
            known.autoencoder,
            Oracle(),
            categories=CATEGORIES[bench.room_type],
        )
        self.results.with_suffix("").mkdir(parents=True, exist_ok=True)
        for number, episode in enumerate(episodes):
            if episode.name in done:
                continue
            ground = Ground(state, truth, bench.setup.noise)
            try:
                record = gone(navigator, ground, episode, number, self.picture(episode.name))
            except Exception as error:  # Whatever fails is told of its episode; others go on.
                record = record_of(episode).model_copy(update={"error": message_of(error)})
            add(record.model_dump(mode="json"))
            tell(EPISODE_S)


@dataclass(frozen=True, eq=False)
class Ground:
    """A home in which a robot goes.

    Attributes:
        state: As it is, which need not be as its map shows it.
        truth: Of it.
        noise: Preset of the sensor.
    """

    state: SceneState
    truth: Truth
    noise: str


def gone(
    navigator: Navigator, ground: Ground, episode: Episode, seed: int, picture: Path | None = None
) -> Record:
    """Goes through one episode.

    Args:
        navigator: With the map that the robot believes, which may be older than the home.
        ground: Where it goes.
        episode: From where to what.
        seed: Of the noise.
        picture: File for the way on the semantic map.

    Raises:
        OSError: The picture cannot be written.
    """
    width, height = SIZE_PX
    controller = Controller(ground.state, width=width, height=height, noise=ground.noise, seed=seed)
    controller.go(Viewpoint(*episode.place, episode.yaw_deg, 0.0))
    walker = Walker(controller, ground.truth)
    journey = navigator.go(walker, episode.category)
    if picture is not None:
        shown = draw_semantic_map(navigator.semantic_map, journey.path, [episode.category])
        write_picture(shown, picture)
    return record_of(episode).model_copy(
        update={
            "success": succeeds(
                ground.truth, episode.category, walker.places[-1], walker.event.instances
            ),
            "walked_m": walker.length_m,
            "status": journey.status,
            "reason": journey.reason,
            "replans": journey.replans,
        }
    )


def record_of(episode: Episode) -> Record:
    """Of an episode that has not begun."""
    return Record(
        id=episode.name,
        room_type=episode.room_type,
        category=episode.category,
        shortest_m=episode.shortest_m,
    )
