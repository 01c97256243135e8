"""Work on several items at once, in threads."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def map_in_threads(
    function: Callable[[Item], Result], items: Iterable[Item], threads: int = 0
) -> Generator[Result, None, None]:
    """Apply a function to items; no more than twice as many items as threads are in memory.

    Args:
        function: Releases the lock of the interpreter most of the time; raises as in a loop.
        items: Of any number.
        threads: Number of threads; 0 uses all hardware threads.

    Yields:
        The results, in the order of the items.
    """
    threads = threads or len(os.sched_getaffinity(0))
    with ThreadPoolExecutor(threads) as pool:
        ahead: deque[Future[Result]] = deque()
        for item in items:
            if len(ahead) == 2 * threads:
                yield ahead.popleft().result()
            ahead.append(pool.submit(function, item))
        while ahead:
            yield ahead.popleft().result()
