"""A map of one half of the room of `change_room`, and recordings of the other half."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
from shared import made_once, viewpoints_all_around

from gslts.datasets import Dataset, open_dataset
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.report.summary import write_result
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

MIDDLE_M, OVERLAP_M = 1.9, 0.8
"""The map is of frames that look at smaller x, the recording of those that look farther, m."""
CONFIG = MappingConfig(
    iterations=800, patience=1.0, rough_epochs=0, coarse_share=0.3, variant_steps=0, threads=1
)
EXACT = CONFIG.model_copy(update={"pose_std_m": 0.001, "pose_std_rad": 0.0005})
"""Of the map itself, whose given poses are exact."""


def viewpoints() -> list[Viewpoint]:
    """Return viewpoints all around the room."""
    return viewpoints_all_around("change_room", change_room.home(), 48)


def x_ahead(viewpoint: Viewpoint) -> float:
    """Return x of the point 1.5 m ahead of the camera, m."""
    return viewpoint.x + 1.5 * float(np.cos(np.deg2rad(viewpoint.yaw_deg)))


def map_of_half(folder: Path, middle_m: float = MIDDLE_M) -> Path:
    """Copy the map of the half to a new folder, as `gslts map` writes it."""

    def make(made: Path) -> None:
        made.mkdir()
        near = [viewpoint for viewpoint in viewpoints() if x_ahead(viewpoint) < middle_m]
        capture(Controller(change_room.home(), **change_room.SIZE), near, made / "visit")
        dataset = open_dataset(made / "visit")
        write_result(made / "map", make_map(dataset, EXACT), dataset.name)

    shutil.copytree(made_once(f"half_room_{middle_m}", make) / "map", folder)
    return folder


def recording(folder: Path, home: Home | None = None) -> Path:
    """Record the other half, and the part of the map beside it."""
    far = [viewpoint for viewpoint in viewpoints() if x_ahead(viewpoint) > MIDDLE_M - OVERLAP_M]
    capture(Controller(home or change_room.home(), **change_room.SIZE), far, folder)
    return folder


def known_recording(folder: Path, home: Home | None = None) -> Path:
    """Record what the map shows."""
    near = [viewpoint for viewpoint in viewpoints() if x_ahead(viewpoint) < MIDDLE_M]
    capture(Controller(home or change_room.home(), **change_room.SIZE), near[::3], folder)
    return folder


def with_poses(folder: Path, change: "callable") -> Dataset:
    """Open a recording after a change of its list of poses [F,4,4]."""
    path = folder / "transforms.json"
    content = json.loads(path.read_text())
    poses = np.array([frame["transform_matrix"] for frame in content["frames"]])
    for frame, pose in zip(content["frames"], change(poses), strict=True):
        frame["transform_matrix"] = pose.tolist()
    path.write_text(json.dumps(content))
    return open_dataset(folder)


def true_poses(folder: Path) -> dict[str, np.ndarray]:
    """Return the true poses [4,4] of the cameras of a recording, by name of the frame."""
    dataset = open_dataset(folder)
    return {frame.name: frame.camera.world_from_camera for frame in dataset.frames}


def without_frames(dataset: Dataset, step: int) -> Dataset:
    """Return every n-th frame."""
    return replace(dataset, frames=dataset.frames[::step])
