"""ROS 2 bags: topics, time stamps and single messages."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gslts.datasets.dataset import reason_of

MAX_METADATA_BYTES = 1 << 24
"""Maximum size of metadata.yaml, whose YAML parser is slow; a day of splits takes 1 MiB."""


@dataclass(frozen=True)
class MessageKey:
    """Identifies a message in a bag.

    Args:
        topic: Its topic.
        recorded_ns: Time of its recording, ns.
        time_ns: Time in its header, ns.
    """

    topic: str
    recorded_ns: int
    time_ns: int


class Bag:
    """Reads messages of a bag, which stays open as long as this object lives.

    Args:
        path: Folder of the bag, or a single file .mcap or .db3.

    Raises:
        ImportError: The package rosbags is missing.
        OSError: The bag cannot be read.
        ValueError: The bag is damaged, or a topic has messages of several types.
    """

    def __init__(self, path: Path) -> None:
        try:
            from rosbags.rosbag2 import Reader
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise ImportError("ROS bags need rosbags: pip install 'gslts[ros]'") from error

        self.path = path
        metadata = path / "metadata.yaml"
        if path.is_dir() and metadata.stat().st_size > MAX_METADATA_BYTES:
            raise ValueError(f"{metadata}: larger than {MAX_METADATA_BYTES >> 20} MiB")
        self._lock = threading.Lock()
        # Only ROS's own types: type definitions in a bag are untrusted and would become code.
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
        """Type of each topic that has messages."""
        return {
            topic: connections[0].msgtype
            for topic, connections in sorted(self._connections.items())
            if any(connection.msgcount for connection in connections)
        }

    def first(self, topic: str) -> Any:
        """Read the first message of a topic.

        Args:
            topic: Name of the topic.

        Raises:
            ValueError: The message is damaged, or the topic has none.
        """
        for _, _, message in self.messages([topic]):
            return message
        raise ValueError(f"{self.path}: {topic}: there are no messages")

    def messages(self, topics: Sequence[str]) -> Iterator[tuple[str, int, Any]]:
        """Yield the messages of topics in the order of their recording.

        Args:
            topics: Names of the topics.

        Yields:
            Topic, time of the recording in ns, message.

        Raises:
            ValueError: A message is damaged.
        """
        for topic, recorded_ns, kind, raw in self._raw(topics):
            with self._naming(topic):
                message = self._types.deserialize_cdr(raw, kind)
            yield topic, recorded_ns, message

    def keys(self, topics: Sequence[str]) -> dict[str, list[MessageKey]]:
        """List the messages of topics without decoding them.

        Args:
            topics: Names of the topics; their messages must begin with a header.

        Returns:
            For each topic, its messages by the time in their headers.

        Raises:
            ValueError: A message is damaged.
        """
        found: dict[str, list[MessageKey]] = {topic: [] for topic in topics}
        for topic, recorded_ns, _, raw in self._raw(topics):
            with self._naming(topic):
                time_ns = header_time_ns(raw)
            found[topic].append(MessageKey(topic, recorded_ns, time_ns))
        for keys in found.values():
            keys.sort(key=lambda key: key.time_ns)
        return found

    def read(self, key: MessageKey) -> Any:
        """Read a message.

        Args:
            key: From `keys`.

        Raises:
            ValueError: The message is damaged.
        """
        start = key.recorded_ns
        for _, _, kind, raw in self._raw([key.topic], start, start + 1):
            with self._naming(key.topic):
                message: Any = self._types.deserialize_cdr(raw, kind)
            stamp = message.header.stamp
            if stamp.sec * 1_000_000_000 + stamp.nanosec == key.time_ns:
                return message
        raise ValueError(f"{self.path}: {key.topic}: the message at {start} ns is gone")

    def _raw(
        self, topics: Sequence[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[tuple[str, int, str, bytes]]:
        """Yield topic, time of recording in ns, type and bytes of messages."""
        connections = [each for topic in topics for each in self._connections.get(topic, [])]
        if not connections:  # The reader would take an empty list for all topics.
            return
        messages = self._reader.messages(connections, start_ns, stop_ns)
        while True:
            with self._lock, self._naming(", ".join(topics)):
                entry = next(messages, None)
            if entry is None:
                return
            connection, recorded_ns, raw = entry
            yield connection.topic, recorded_ns, connection.msgtype, raw

    @contextmanager
    def _naming(self, what: str) -> Iterator[None]:
        """Add the path to errors; the reader raises errors of any type on damaged bags."""
        try:
            yield
        except OSError:
            raise
        except Exception as error:
            raise ValueError(f"{self.path}: {what}: {reason_of(error)}") from error


def header_time_ns(message: bytes) -> int:
    """Return the time stamp of a serialized message that begins with a header, ns.

    Args:
        message: In CDR.

    Raises:
        ValueError: It is too short.
    """
    if len(message) < 12:
        raise ValueError(f"a message of {len(message)} bytes has no header")
    order: Any = "little" if message[1] & 1 else "big"  # Of CDR's encapsulation header.
    seconds = int.from_bytes(message[4:8], order, signed=True)
    return seconds * 1_000_000_000 + int.from_bytes(message[8:12], order)
