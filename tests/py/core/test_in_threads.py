"""Work in threads: same results as a loop, and a bounded number of items in memory."""

import itertools
import threading

import pytest

from gslts.core.in_threads import map_in_threads


@pytest.mark.parametrize("threads", [0, 1, 2, 5])
def test_results_are_in_the_order_of_the_items(threads: int) -> None:
    first_waits = threading.Event()

    def double(item: int) -> int:
        if item == 0 and threads > 1:
            assert first_waits.wait(60)  # It ends after the second one.
        if item == 1:
            first_waits.set()
        return 2 * item

    assert list(map_in_threads(double, range(20), threads)) == list(range(0, 40, 2))


def test_items_are_taken_only_ahead_of_their_results() -> None:
    endless = itertools.count()
    results = map_in_threads(str, endless, 2)
    assert list(itertools.islice(results, 3)) == ["0", "1", "2"]
    results.close()
    assert next(endless) <= 8


def test_an_error_is_raised_at_its_item() -> None:
    results = map_in_threads(lambda item: 6 // item, [3, 0, 1], 2)
    assert next(results) == 2
    with pytest.raises(ZeroDivisionError):
        next(results)
