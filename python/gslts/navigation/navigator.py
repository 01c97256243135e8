"""Navigation to an object that a text names (GS-LTS, sec. III-B and IV-D)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.core.robot_body import RobotBody
from gslts.navigation.semantic_map import SemanticMap, make_semantic_map
from gslts.navigation.terrain import Terrain
from gslts.navigation.trip import NavigationResult, Trip
from gslts.navigation.upright import require_upright
from gslts.navigation.viewpoints import Target
from gslts.semantics.categories import Categories
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.registry import open_text_semantics
from gslts.semantics.source import Codec, SemanticSource
from gslts.store.map_folder import read_map


class Navigator:
    """Navigates robots to objects of one map.

    Args:
        gaussian_map: float32, with features.
        codec: Decodes the features.
        source: Encodes texts.
        body: Size of the robot; None for the default.
        categories: Names of the layers of the semantic map; none is needed for navigation.

    Attributes:
        gaussian_map: The map.
        body: Size of the robot.
        queries: Text queries on the map.
        semantic_map: 2D map of obstacles, explored area and categories.

    Raises:
        ValueError: The features do not fit the codec, or the map is empty.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        codec: Codec,
        source: SemanticSource,
        body: RobotBody | None = None,
        categories: Sequence[str] = (),
    ) -> None:
        self.body = RobotBody() if body is None else body
        self.gaussian_map = gaussian_map
        self.queries = SemanticQueries(gaussian_map, codec, source)
        self.source = self.queries.source
        self.semantic_map: SemanticMap = make_semantic_map(
            gaussian_map, self.body, Categories(tuple(categories), codec, self.source)
        )

    @classmethod
    def of_map(
        cls,
        path: Path | str,
        body: RobotBody | None = None,
        categories: Sequence[str] = (),
        text_model: Path | None = None,
        threads: int = 0,
    ) -> Navigator:
        """Read a map folder for navigation.

        Args:
            path: A map folder with semantic features, or a version of it such as MAP@3.
            body: Size of the robot; None for the default.
            categories: Names of the layers of the semantic map.
            text_model: Folder of a text model; see `open_text_source`.
            threads: For CLIP; 0 uses the default of torch.

        Returns:
            The navigator.

        Raises:
            ImportError: transformers is missing.
            OSError: A file cannot be read.
            ValueError: The map has no semantic features, z is not up, or a file is damaged.
        """
        path = Path(path)
        require_upright(path)
        codec, source = open_text_semantics(path, text_model, threads)
        return cls(read_map(path), codec, source, body, categories)

    def go(
        self, robot: Robot, text: str, on_move: Callable[[], None] = lambda: None
    ) -> NavigationResult:
        """Navigate a robot to the nearest object that matches a text, and look at it.

        Args:
            robot: In the home of the map.
            text: Such as "sofa".
            on_move: Called after each move.

        Returns:
            The result; expected failures have a status and a reason there.

        Raises:
            ValueError: The text is empty.
        """
        instances = self.queries.find(text)
        targets = [Target.of_instance(self.gaussian_map, instance) for instance in instances]
        terrain = Terrain(self.semantic_map, self.body)
        trip = Trip(robot, text, self.gaussian_map, terrain, self.source, on_move)
        return trip.go_to_any(targets)
