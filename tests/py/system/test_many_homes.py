"""Homes of many seeds are sound."""

import multiprocessing

import home_checks

from gslts.sim import ROOM_TYPES


def test_hundred_homes_of_each_type_are_sound():
    seeds = [(room_type, seed) for room_type in ROOM_TYPES for seed in range(100)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.starmap(home_checks.complaints, seeds, chunksize=10)
    assert [complaint for of_home in found for complaint in of_home] == []
