"""Cases of the benchmark of change detection."""

from pathlib import Path

from gslts_bench.detection.cases import counts_of
from gslts_bench.homes import HomeSetup, homes_of


def test_work_is_spread_evenly() -> None:
    counts = counts_of(301, 12)
    assert sorted(numbers.single for numbers in counts) == [25] * 11 + [26]
    assert (
        sum(numbers.pair for numbers in counts) == sum(numbers.triple for numbers in counts) == 50
    )
    assert sum(numbers.unchanged for numbers in counts) == 200
    assert sum(numbers.unchanged for numbers in counts_of(30, 3)) == 20
    homes = homes_of(range(4), [], HomeSetup(), Path("work"))
    assert len({home.name for home in homes}) == 12
