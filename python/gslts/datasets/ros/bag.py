"""A ROS 2 bag, of which messages are read one by one."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gslts.datasets.dataset import reason_of

MOST_METADATA_BYTES = 1 << 24


@dataclass(frozen=True)
class Place:
    """Where a message is in a bag: its topic, when it was recorded, and the time in its header."""

    topic: str
    recorded_ns: int
    time_ns: int


class Bag:
    """A bag that is open as long as anything refers to it.

    Args:
        path: Its folder, or a single file .mcap or .db3.

    Raises:
        ImportError: The package rosbags is missing.
        OSError: It cannot be read.
        ValueError: It is damaged, or a topic has messages of several types.
    """

    def __init__(self, path: Path) -> None:
        try:
            from rosbags.rosbag2 import Reader
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise ImportError("ROS bags need rosbags: pip install 'gslts[ros]'") from error

        self.path = path
        metadata = path / "metadata.yaml"
        if path.is_dir() and metadata.stat().st_size > MOST_METADATA_BYTES:
            raise ValueError(f"{metadata}: larger than {MOST_METADATA_BYTES >> 20} MiB")
        self._lock = threading.Lock()
        # Only ROS's own types are known: what a bag says about its types is never made code of.
        self._types = get_typestore(Stores.ROS2_HUMBLE)
        with self._naming("the bag"):
            self._reader = Reader(path)
            self._reader.open()
        weakref.finalize(self, self._reader.close)
        self._connections: dict[str, list[Any]] = {}
        for connection in self._reader.connections:
            self._connections.setdefault(connection.topic, []).append(connection)

    @property
    def topics(self) -> dict[str, str]:
        """The type of each topic that has messages."""
        return {
            topic: connections[0].msgtype
            for topic, connections in sorted(self._connections.items())
            if any(connection.msgcount for connection in connections)
        }

    def first(self, topic: str) -> Any:
        """The first message of a topic.

        Raises:
            ValueError: It is damaged, or there is none.
        """
        for _, _, message in self.messages([topic]):
            return message
        raise ValueError(f"{self.path}: {topic}: there are no messages")

    def messages(self, topics: Sequence[str]) -> Iterator[tuple[str, int, Any]]:
        """All messages of some topics as they were recorded: topic, time of that in ns, message."""
        for topic, recorded_ns, kind, raw in self._raw(topics):
            with self._naming(topic):
                message = self._types.deserialize_cdr(raw, kind)
            yield topic, recorded_ns, message

    def places(self, topics: Sequence[str]) -> dict[str, list[Place]]:
        """Where the messages of topics are, in the order of their headers' times.

        The messages, which must begin with a header, are not decoded.
        """
        found: dict[str, list[Place]] = {topic: [] for topic in topics}
        for topic, recorded_ns, _, raw in self._raw(topics):
            if len(raw) < 12:
                raise ValueError(f"{self.path}: {topic}: a message of {len(raw)} bytes")
            order: Any = "little" if raw[1] & 1 else "big"  # Of CDR's encapsulation header.
            seconds = int.from_bytes(raw[4:8], order, signed=True)
            nanoseconds = int.from_bytes(raw[8:12], order)
            time_ns = seconds * 1_000_000_000 + nanoseconds
            found[topic].append(Place(topic, recorded_ns, time_ns))
        for places in found.values():
            places.sort(key=lambda place: place.time_ns)
        return found

    def read(self, place: Place) -> Any:
        """The message at a place.

        Raises:
            ValueError: It is damaged.
        """
        start = place.recorded_ns
        for _, _, kind, raw in self._raw([place.topic], start, start + 1):
            with self._naming(place.topic):
                message: Any = self._types.deserialize_cdr(raw, kind)
            stamp = message.header.stamp
            if stamp.sec * 1_000_000_000 + stamp.nanosec == place.time_ns:
                return message
        raise ValueError(f"{self.path}: {place.topic}: the message at {start} ns is gone")

    def _raw(
        self, topics: Sequence[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[tuple[str, int, str, bytes]]:
        """Topic, time of recording in ns, type and bytes of messages."""
        connections = [one for topic in topics for one in self._connections.get(topic, [])]
        if not connections:  # To the reader this would mean all.
            return
        messages = self._reader.messages(connections, start_ns, stop_ns)
        while True:
            with self._lock, self._naming(", ".join(topics)):
                one = next(messages, None)
            if one is None:
                return
            connection, recorded_ns, raw = one
            yield connection.topic, recorded_ns, connection.msgtype, raw

    @contextmanager
    def _naming(self, what: str) -> Iterator[None]:
        """Makes what goes wrong say where; on damaged bags the reader raises errors of any kind."""
        try:
            yield
        except OSError:
            raise
        except Exception as error:
            raise ValueError(f"{self.path}: {what}: {reason_of(error)}") from error
