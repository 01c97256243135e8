"""The recorded room that several tests read."""

from pathlib import Path

import pytest
import sim_scenes
from recorded_frames import VIEWPOINTS

from gslts_sim.capture import capture
from gslts_sim.controller import Controller


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Three frames of a small room, in nerfstudio's layout."""
    robot = Controller(sim_scenes.simple_home(), width=64, height=48)
    capture(robot, VIEWPOINTS, tmp_path / "room")
    return tmp_path / "room"
