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
        options = ["--room", "bedroom", "--seed", "2", "--changes", "1", "--width", "320"]
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
        assert history.version().number == 2
    assert (out / "plan.png").stat().st_size > 10_000
    with AnyReader([out / "bag"]) as bag:
        topics = {connection.topic: connection.msgcount for connection in bag.connections}
    assert topics["/gslts/pose"] > 10
    assert topics["/gslts/changes"] > 0
