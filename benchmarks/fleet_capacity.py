"""Compute from measured bytes, requests and seconds what many rooms need.

    python benchmarks/fleet_capacity.py
    python benchmarks/fleet_capacity.py --rooms 500 --updates 10 --rounds 48

prints the table of `docs/fleet.md`, or that of other buildings. `fleet_benchmark.py` checks with
real stores the requests, and that costs grow in proportion to the rooms.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, fields

from gslts.fleet.constants import MAX_PROBES

MONTH_DAYS, YEAR_DAYS = 30, 365
GIB, GB = 2**30, 10**9

MAP_BYTES, MAP_CACHE_BYTES = 8_329_618, 8_419_496
"""Size of a new map of 130,000 Gaussians in the bucket and in a clone, bytes:
`history_benchmark.py`."""
UPDATE_BYTES, UPDATE_CACHE_BYTES = 288_660, 324_240
"""Size of an update of 3,000 Gaussians, bytes: of the requests of its push (`share_benchmark.py`),
and in a clone, uncompressed (`history_benchmark.py`, 15 versions)."""
SNAPSHOT_BYTES = 184_968
"""Share of an update in snapshots, bytes: the size of its delta, uncompressed. A snapshot follows
as soon as the deltas since the last one are as large, here after each 45 updates:
`history_benchmark.py`."""
VERSION_BYTES = 10_000
"""Size of a version object with 12 frames, bytes (`gslts.fleet.constants`): a pull without news
reads the newest one."""
UPDATE_PUTS = 4
"""Objects of an update: Gaussians, landmarks, image, version."""
NEWS_CPU_S, NO_NEWS_CPU_S, SHOW_CPU_S = 0.37, 0.006, 0.35
"""CPU time of a pull of an update, of one without news, and of reading what happened, s, after a
year of three updates a day: `history_benchmark.py`. With 15 versions: 0.05, 0.003 and 0.002."""
DETECT_CPU_S, FIRST_DETECT_CPU_S, LOCALIZE_CPU_S = 0.090, 0.352, 0.170
"""CPU time of the detection in a frame and in the first frame of a round, and of localization, s,
in a map of 128,286 Gaussians with images of 320 x 240: `gslts bench scale` of commit
57e06141."""
UPDATE_CPU_S = 7.67 + 0.22
"""CPU time of an update and of its commit, s, there. In small maps with few iterations it takes
half of it: `year_benchmark.py`."""


@dataclass(frozen=True)
class Day:
    """Assumptions about a day of a room.

    Attributes:
        updates: Updates a day, of 3,000 Gaussians each.
        rounds: Rounds a day; the robot exchanges versions after each.
        frames: Frames with a detection in a round.
        pulls: How often a day another client runs `gslts building show`.
        busy_h: Hours in which all of this happens.
        building: Rooms of a building: a client has clones of these.
    """

    updates: int = 3
    rounds: int = 24
    frames: int = 12
    pulls: int = 24
    busy_h: int = 8
    building: int = 50


def version_requests(known: int, newest: int) -> int:
    """Return the number of version objects that a clone asks for, found or not, and of listings.

    Args:
        known: Newest version that the clone has in common with the shared map; 0 for none.
        newest: Newest version of the shared map.
    """
    first, count, requests = max(1, known), 2, int(known == 0)
    while True:
        requests += count
        if first + count - 1 > newest:
            return requests
        first, count = first + count, min(2 * count, MAX_PROBES)


def compute_capacity(rooms: int, day: Day) -> dict[str, float]:
    """Compute what rooms need.

    Args:
        rooms: Number of rooms.
        day: Of each room.

    Returns:
        Numbers by name with unit.
    """
    with_news = min(day.updates, day.pulls)
    news = math.ceil(day.updates / max(with_news, 1))
    without_news = day.pulls - with_news
    puts = rooms * day.updates * UPDATE_PUTS
    gets = rooms * (
        (day.rounds + without_news) * version_requests(1, 1)
        + with_news * version_requests(1, 1 + news)
        + day.updates * (UPDATE_PUTS - 1)
    )
    robot_cpu_s = day.updates * UPDATE_CPU_S + day.rounds * (
        LOCALIZE_CPU_S + FIRST_DETECT_CPU_S + (day.frames - 1) * DETECT_CPU_S
    )
    client_cpu_s = with_news * NEWS_CPU_S + without_news * NO_NEWS_CPU_S + day.pulls * SHOW_CPU_S
    unchanged = rooms * (day.rounds + without_news)
    busy_s = day.busy_h * 3600
    day_bytes = rooms * day.updates * (UPDATE_BYTES + SNAPSHOT_BYTES)
    year_updates = YEAR_DAYS * day.updates
    cache_bytes = MAP_CACHE_BYTES + year_updates * (UPDATE_CACHE_BYTES + SNAPSHOT_BYTES)
    own_rooms = min(rooms, day.building)
    return {
        "storage: new maps, GB": rooms * MAP_BYTES / GB,
        "storage: a day, GB": day_bytes / GB,
        "storage: after a year, GB (GB-months a month)": (rooms * MAP_BYTES + YEAR_DAYS * day_bytes)
        / GB,
        "writes (PUT), millions a month": puts * MONTH_DAYS / 1e6,
        "reads (GET), millions a month": gets * MONTH_DAYS / 1e6,
        "bytes read, GB a month": ((day_bytes + unchanged * VERSION_BYTES) * MONTH_DAYS / GB),
        "requests a second, busy hours": (puts + gets) / busy_s,
        "cores of robots, busy hours": rooms * robot_cpu_s / busy_s,
        "cores of clients, busy hours": rooms * client_cpu_s / busy_s,
        f"cache of a client of {day.building} rooms, new maps, GiB": (
            own_rooms * MAP_CACHE_BYTES / GIB
        ),
        f"cache of a client of {day.building} rooms, after a year, GiB": (
            own_rooms * cache_bytes / GIB
        ),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rooms", type=int, nargs="+", default=[10, 1000, 100_000])
    for field in fields(Day):
        parser.add_argument(f"--{field.name.replace('_', '-')}", type=int, default=field.default)
    given = vars(parser.parse_args())
    counts = given.pop("rooms")
    columns = [compute_capacity(rooms, Day(**given)) for rooms in counts]
    print("| rooms |", " | ".join(f"{rooms:,}" for rooms in counts), "|")
    print("| :-- |", " | ".join("--:" for _ in counts), "|")
    for name in columns[0]:
        print(f"| {name} |", " | ".join(_format(column[name]) for column in columns), "|")


def _format(value: float) -> str:
    """Return a number with two digits, or all before its point."""
    digits = max(0, 1 - math.floor(math.log10(value))) if value else 0
    return f"{value:,.{digits}f}"


if __name__ == "__main__":
    main()
