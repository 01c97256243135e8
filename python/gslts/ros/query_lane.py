"""Lane that answers queries, beside updates and errands."""

from __future__ import annotations

import queue
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from gslts.core.gaussian_map import GaussianMap
from gslts.keeper.keeper import MapKeeper
from gslts.ros.answers import failure_answer, query_answer
from gslts.ros.constants import MAX_REQUESTS
from gslts.semantics.queries import SemanticQueries

if TYPE_CHECKING:
    from gslts.ros.publishing import Publishing  # Needs ROS.


class QueryLane:
    """Answers queries in a thread of its own; use it in a `with` statement.

    Args:
        map_path: Folder of the map, named in errors.
        keeper: Of the map.
        publishing: Gets the answers.
    """

    def __init__(self, map_path: Path, keeper: MapKeeper, publishing: Publishing) -> None:
        self._map_path, self._keeper, self._publishing = map_path, keeper, publishing
        self._made: tuple[GaussianMap, SemanticQueries] | None = None
        self._words: queue.Queue[str | None] = queue.Queue(MAX_REQUESTS)
        self._thread = threading.Thread(target=self._work, name="gslts-queries", daemon=True)

    def __enter__(self) -> QueryLane:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._words.put(None)
        self._thread.join()

    def add(self, words: str) -> None:
        """Queue a query and return at once.

        Args:
            words: Checked.

        Raises:
            ValueError: Too many queries wait.
        """
        try:
            self._words.put_nowait(words)
        except queue.Full:
            raise ValueError(f"busy: {MAX_REQUESTS} queries wait already") from None

    def _work(self) -> None:
        while (words := self._words.get()) is not None:
            try:
                self._publishing.answer(self._answer(words))
            except Exception as error:  # Answered, as nobody else would see it.
                self._publishing.answer(failure_answer("query", words, str(error)))

    def _answer(self, words: str) -> str:
        semantics, (gaussian_map, version) = self._keeper.semantics, self._keeper.shown
        if semantics is None:
            raise ValueError(f"{self._map_path}: it has no words; gslts semantics adds them")
        if self._made is None or self._made[0] is not gaussian_map:
            queries = SemanticQueries(gaussian_map, semantics.codec, semantics.source)
            self._made = gaussian_map, queries
        return query_answer(words, "map", version, self._made[1].find(words))
