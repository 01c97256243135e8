"""A short day over ROS 2: a robot maps a small room, finds a change, and goes to an object."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from ros_peer import MISSING, own_domain, ros_python
from rosbags.highlevel import AnyReader

from gslts.store.history import open_history

pytestmark = [
    pytest.mark.system,
    pytest.mark.long,
    pytest.mark.skipif(bool(MISSING), reason=MISSING),
]


def test_a_robot_lives_a_day(tmp_path: Path) -> None:
    with own_domain() as domain:
        command = [str(ros_python()), "-m", "gslts", "bench", "ros", "--out", "day"]
        # A teddy bear on the bed; in the home 2 the change lies on a wardrobe of 2.2 m.
        options = ["--room", "bedroom", "--seed", "3", "--changes", "1", "--width", "320"]
        done = subprocess.run(
            [*command, *options, "--viewpoints", "8", "--speed", "4"],
            cwd=tmp_path,
            env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    out = tmp_path / "day"
    result = json.loads((out / "result.json").read_text())
    assert result["changes"] == 1
    assert result["found"] == 1
    assert result["untrue"] == 0
    assert result["errand"] == "reached"
    with open_history(out / "map") as history:
        (event,) = history.events()
        assert (event.type, event.version) == ("TeddyBear", history.version().number)
    assert (out / "plan.png").stat().st_size > 10_000
    with AnyReader([out / "bag"]) as bag:
        topics = {connection.topic: connection.msgcount for connection in bag.connections}
    assert topics["/gslts/pose"] > 10
    assert topics["/gslts/changes"] > 0
