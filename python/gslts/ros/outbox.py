"""Results that the node gives to other nodes, whatever carries them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from gslts.core.gaussian_map import GaussianMap
from gslts.navigation.semantic_map import SemanticMap
from gslts.ros.judge import Judged
from gslts.ros.shown_change import ShownChange


class Outbox(Protocol):
    """Publishes results."""

    def judged(self, judged: Judged, gaussian_map: GaussianMap | None) -> None:
        """Publish the pose of a frame, and a rendering there if somebody wants it.

        Args:
            judged: Result for a frame.
            gaussian_map: Newest version of the map; None if there is none yet.
        """
        ...

    def changes(self, shown: Sequence[ShownChange]) -> None:
        """Publish the changes of objects; they replace the earlier ones.

        Args:
            shown: Published and detected changes.
        """
        ...

    def grid(self, semantic_map: SemanticMap) -> None:
        """Publish the free floor.

        Args:
            semantic_map: Of the newest version.
        """
        ...

    def event(self, event: str, **values: Any) -> None:
        """Publish an event.

        Args:
            event: Its name.
            values: Values of JSON.
        """
        ...

    def answer(self, text: str) -> None:
        """Publish an answer.

        Args:
            text: JSON of one object on one line.
        """
        ...
