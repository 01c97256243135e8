"""Kills `gslts ros` at random moments, in a home that changes; the map must never be wrong.

    build/ros/bin/python benchmarks/faults/ros_faults_benchmark.py --kills 50 --work out/ros_faults

A simulated robot lives a day over ROS 2. Each run of the node is asked for a round and killed
(SIGKILL) after a random time. Meanwhile the home changes, somebody carries the robot away, its
clock is set back, its poses stop for 10 s, and the robot with its camera driver restarts, so that
its odometry starts anew at zero. After each kill the map must verify; after the last one, the node
ends a round, and no event may be untrue.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from gslts.store.history import open_history
from gslts_bench.days.events import is_untrue, true_events, was_found
from gslts_bench.ros.day import make_day, start, stop
from gslts_bench.ros.director import Director

KILL_S = (3.0, 80.0)
"""Time of a run before it is killed, s: from the first frames to the end of a round."""
RESTART_EVERY, CARRY_EVERY = 10, 4
"""Number of kills after which the robot restarts, and after which it is carried away."""
CLOCK_EVERY, POSES_EVERY, FAULT_AFTER_S = 3, 5, 15.0
"""Number of kills after which the clock is set back, and after which poses stop, both some seconds
after the round has begun."""
LEASE_S = 25.0
"""Time after which DDS has forgotten a killed node, s: 20 s with Fast DDS."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1, help="of the moments")
    parser.add_argument("--room", default="living_room")
    parser.add_argument("--home", type=int, default=3, help="seed of the home")
    parser.add_argument("--changes", type=int, default=6)
    parser.add_argument("--work", type=Path, required=True, help="new folder")
    parser.add_argument("--json", type=Path, help="file for the result")
    given = parser.parse_args()
    # In a domain of their own, on this machine alone.
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    given.work.mkdir(parents=True)
    result = run(given)
    print(json.dumps(result))
    if given.json:
        given.json.write_text(json.dumps(result, indent=1) + "\n")
    if result["damaged"] or result["untrue"]:
        sys.exit(1)


def run(given: argparse.Namespace) -> dict[str, int]:
    """Run all kills; return the counts."""
    work, random_ = given.work, random.Random(given.seed)
    home = (given.room, str(given.home))
    events = make_day(work, home, (), given.changes, frames=200)
    gslts("map", work / "day" / "before", "--out", work / "map", "--preset", "fast")
    robot_options = ("sim", "ros", *home, "--day", f"{work}/day/day.json", "--rate", "4")
    changed = damaged = 0
    with Director(work / "bag", print) as director:
        robot = start(work, "robot", *robot_options)
        director.odometry_from_world()
        for kill in range(given.kills):
            if kill % RESTART_EVERY == RESTART_EVERY - 1:
                stop(robot, "robot")  # Its home is as at first: so are the changes from now on.
                robot = start(work, "robot", *robot_options)
                director.poses.clear()
                director.odometry_from_world()  # Waits until the robot is there.
                for _ in range(changed):
                    director.ask_robot("change")
            node = start_node(work, director)
            if kill % CARRY_EVERY == CARRY_EVERY - 1:
                director.ask_robot("carry_away")
            if changed < len(events) * (kill + 1) // given.kills:
                print(f"{kill}: {director.ask_robot('change')}", flush=True)
                changed += 1
            director.say("command", "round")
            end_s = time.monotonic() + random_.uniform(*KILL_S)
            time.sleep(min(FAULT_AFTER_S, max(0.0, end_s - time.monotonic())))
            if kill % CLOCK_EVERY == CLOCK_EVERY - 1:
                director.ask_robot("set_clock_back")
            if kill % POSES_EVERY == POSES_EVERY - 1:
                director.ask_robot("lose_poses")
            try:
                node.wait(max(0.0, end_s - time.monotonic()))
                raise RuntimeError(f"the node ended by itself; see {work}/gslts.log")
            except subprocess.TimeoutExpired:
                node.send_signal(signal.SIGKILL)
                node.wait()
            damaged += gslts("verify", work / "map", check=False)
        time.sleep(LEASE_S)
        node = start_node(work, director)
        director.say("command", "round")
        director.wait("event", "done")
        stop(node, "gslts")
        stop(robot, "robot")
    with open_history(work / "map") as history:
        versions, reported = len(history.versions()), history.events()
    true = true_events([event.change for event in events[:changed]])
    return {
        "kills": given.kills,
        "damaged": damaged,
        "versions": versions,
        "changes": len(true),
        "found": sum(was_found(change, reported) for change in true),
        "events": len(reported),
        "untrue": sum(is_untrue(event, true) for event in reported),
    }


def start_node(work: Path, director: Director) -> subprocess.Popen[bytes]:
    """Start the node, and wait until it has loaded the map."""
    node = start(
        work,
        "gslts",
        *("ros", "--map", str(work / "map"), "--active", "--pose", "/camera/pose"),
        *("--tilt", "/tilt_controller/commands", "--viewpoints", "12"),
    )
    while True:
        try:
            director.wait("event", "version")
            return node
        except RuntimeError as error:  # The round of a node that was killed meanwhile.
            print(f"before: {error}", flush=True)


def gslts(*arguments: object, check: bool = True) -> bool:
    """Run a command; return whether it failed."""
    command = [sys.executable, "-m", "gslts", *map(str, arguments)]
    done = subprocess.run(command, check=check, stdout=subprocess.DEVNULL)
    return done.returncode != 0


if __name__ == "__main__":
    main()
