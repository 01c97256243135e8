"""Compute from measured bytes, requests and seconds what many rooms need.

    python benchmarks/fleet_capacity.py
    python benchmarks/fleet_capacity.py --rooms 500 --updates 10 --rounds 48

prints the table of `docs/fleet.md`, or that of other buildings. `fleet_benchmark.py` checks the
requests, and that costs grow in proportion, with real stores.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, fields

from gslts.fleet.constants import MAX_PROBES

DAY_S, MONTH_DAYS, YEAR_DAYS = 86400, 30, 365
GIB, GB = 2**30, 10**9

MAP_BYTES = 130_000 * 64
"""Size of a new map of a room, bytes: 130,000 Gaussians of 64 bytes, as the 32 MB of 500,000 of
`share_benchmark.py`."""
UPDATE_BYTES = 288_660
"""Bytes of the requests of an update of 3,000 Gaussians: `share_benchmark.py`."""
SNAPSHOT_BYTES = UPDATE_BYTES - 106_000 - 32_000 - 4_000
"""Share of an update in the next snapshot, bytes. A snapshot follows as soon as the deltas since the
last one are as large, so that it adds about the size of each delta: of an update without its image,
landmarks and version object."""
UPDATE_PUTS = 4
"""Objects of an update: Gaussians, landmarks, image, version."""
PULL_CPU_S = 0.12
"""CPU time of a pull with news, s, of a map of 500,000 Gaussians: `share_benchmark.py`."""
DETECT_CPU_S, FIRST_DETECT_CPU_S, LOCALIZE_CPU_S = 0.104, 1.106, 0.685
"""CPU time of the detection in a frame and in the first one of a round, and of localization, s, of a
map of 128,286 Gaussians: `gslts bench scale`, AVX2."""
UPDATE_CPU_S = 27.4 + 0.83
"""CPU time of an update and of its commit, s, there. In small maps with few iterations it takes a
ninth: `year_benchmark.py`."""


@dataclass(frozen=True)
class Day:
    """Assumptions about a day of a room.

    Attributes:
        updates: Updates a day, of 3,000 Gaussians each.
        rounds: Rounds a day; the robot exchanges versions after each.
        frames: Frames with a detection in a round.
        pulls: Pulls a day of all other clients together, such as another robot or `building show`.
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
    """Return the number of version objects that a clone asks for, found or not.

    Args:
        known: Newest version that the clone has in common with the shared map; 0 for none.
        newest: Newest version of the shared map.
    """
    first, count, requests = max(1, known), 2, 0
    while True:
        requests += count
        if first + count - 1 > newest:
            return requests
        first, count = first + count, min(2 * count, MAX_PROBES)


def describe_capacity(rooms: int, day: Day) -> dict[str, str]:
    """Compute what rooms need.

    Args:
        rooms: Number of rooms.
        day: Of each room.

    Returns:
        Texts with units by name.
    """
    puts = rooms * day.updates * UPDATE_PUTS
    with_news = min(day.updates, day.pulls)
    news = day.updates / max(with_news, 1)
    found = version_requests(1, 1 + round(news)) + (UPDATE_PUTS - 1) * news
    gets = rooms * (
        version_requests(1, 1) * (day.rounds + day.pulls - with_news) + found * with_news
    )
    stored = day.updates * (UPDATE_BYTES + SNAPSHOT_BYTES)
    robot_s = day.updates * UPDATE_CPU_S + day.rounds * (
        LOCALIZE_CPU_S + FIRST_DETECT_CPU_S + (day.frames - 1) * DETECT_CPU_S
    )
    cores = rooms / (day.busy_h * 3600)
    busy = (puts + gets) / (day.busy_h * 3600)
    first_gib = MAP_BYTES / GIB
    year_gib = first_gib + YEAR_DAYS * stored / GIB
    month_days = MONTH_DAYS * rooms
    clones = min(rooms, day.building)
    return {
        "maps at first": f"{rooms * MAP_BYTES / GB:,.2f} GB",
        "storage, a day": f"{rooms * stored / GB:,.3f} GB",
        "storage, after a year": f"{rooms * year_gib * GIB / GB:,.0f} GB",
        "storage, in month 12, GB-months": f"{rooms * year_gib * GIB / GB:,.0f}",
        "writes (PUT), millions a month": f"{puts * MONTH_DAYS / 1e6:,.3f}",
        "reads (GET), millions a month": f"{gets * MONTH_DAYS / 1e6:,.2f}",
        "read from the bucket, a month": f"{month_days * stored / GB:,.1f} GB for each client",
        "requests a second, busy hours": f"{busy:,.2f}",
        "cores of robots, busy hours": f"{cores * robot_s:,.2f}",
        "cores of clients that pull": f"{cores * with_news * PULL_CPU_S:,.3f}",
        "cache of a client, first day": f"{clones * first_gib:,.2f} GiB",
        "cache of a client, after a year": f"{clones * year_gib:,.1f} GiB",
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
    columns = [describe_capacity(rooms, Day(**given)) for rooms in counts]
    print("| rooms |", " | ".join(f"{rooms:,}" for rooms in counts), "|")
    print("| :-- |", " | ".join("--:" for _ in counts), "|")
    for name in columns[0]:
        print(f"| {name} |", " | ".join(column[name] for column in columns), "|")


if __name__ == "__main__":
    main()
