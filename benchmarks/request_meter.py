"""Costs of operations on shared maps: time, requests and bytes."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import obstore


@dataclass(frozen=True)
class Cost:
    """Cost of an operation on all rooms.

    Attributes:
        calls: How often it ran.
        seconds, cpu_s: Wall and CPU time, s.
        requests, bytes: Requests to the bucket, and bytes of the objects that they carried.
    """

    calls: int
    seconds: float
    cpu_s: float
    requests: int
    bytes: int


class Meter:
    """Measures operations, with the requests that pass obstore."""

    def __init__(self) -> None:
        self.costs: dict[str, Cost] = {}
        self._lock = threading.Lock()
        self._requests = self._bytes = 0

    @contextmanager
    def measuring(self, name: str, calls: int) -> Iterator[None]:
        """Measure what is done within.

        Args:
            name: Of the operation.
            calls: How often it runs.
        """
        before = (time.perf_counter(), time.process_time(), self._requests, self._bytes)
        yield
        after = (time.perf_counter(), time.process_time(), self._requests, self._bytes)
        spent = Cost(calls, *(new - old for new, old in zip(after, before, strict=True)))
        if name in self.costs:
            old = self.costs[name]
            both = zip(vars(old).values(), vars(spent).values(), strict=True)
            spent = Cost(*(a + b for a, b in both))
        self.costs[name] = spent

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count the requests of this process."""
        get, put, list_objects = obstore.get, obstore.put, obstore.list

        def counted_get(store: Any, name: str) -> Any:
            self._count(1, 0)
            found = get(store, name)
            self._count(0, found.meta["size"])
            return found

        def counted_put(store: Any, name: str, content: bytes, **options: Any) -> Any:
            self._count(1, len(content))
            return put(store, name, content, **options)

        def counted_list(store: Any, **options: Any) -> Any:
            self._count(1, 0)
            return list_objects(store, **options)

        obstore.get, obstore.put, obstore.list = counted_get, counted_put, counted_list
        try:
            yield
        finally:
            obstore.get, obstore.put, obstore.list = get, put, list_objects

    def _count(self, requests: int, size: int) -> None:
        with self._lock:
            self._requests += requests
            self._bytes += size
