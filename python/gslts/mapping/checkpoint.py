"""Checkpoint files: the state of a mapping run between two epochs, to resume it exactly."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.datasets.dataset import reason_of
from gslts.io.atomic_files import write_atomic
from gslts.mapping.config import MappingConfig
from gslts.mapping.frames import split_held_out
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer
from gslts.mapping.report.data import CurvePoint
from gslts.rendering.adam import Adam, AdamState
from gslts.rendering.losses import Exposure
from gslts.store.map_folder import camera_from_json, camera_to_json
from gslts.types import Floats

FORMAT, VERSION = "gslts-checkpoint", 1
"""Name and version of the file format; files of another version are not read."""
MAP_ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "ids", "origin")
"""Arrays of `GaussianMap` in the file."""
ADAM_ARRAYS = ("first", "second", "steps")
"""Arrays of `AdamState` in the file."""
DAMAGE = (
    *(ValueError, KeyError, TypeError, AttributeError, OverflowError),
    *(EOFError, RuntimeError, MemoryError, zipfile.BadZipFile),
)
"""Exceptions that damaged files raise: RuntimeError comes from zipfile and deeply nested JSON,
MemoryError from shapes that the file does not hold."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Everything that a mapping run needs to go on from the end of an epoch.

    Attributes:
        config: Settings as adapted to the data set.
        frames: Names of all usable frames, in the order of the data set.
        gaussian_map: Map so far.
        adam: Moments of the optimizer.
        iteration, epoch: Number of finished steps and epochs.
        random: State of the random generator.
        poses: [F,4,4] refined world_from_camera of the training frames.
        exposures: [F,2,3] their gains and offsets.
        exposures_rejected: Indices of training frames whose last exposure fit was not plausible.
        lenses: Refined lenses.
        pose_stds: Standard deviations of the given poses, m and rad.
        curve: Points of the optimization so far.
        seeds: Number of Gaussians at the start.
        seconds: Time by stage, s.
    """

    config: MappingConfig
    frames: tuple[str, ...]
    gaussian_map: GaussianMap
    adam: AdamState
    iteration: int
    epoch: int
    random: dict[str, Any]
    poses: Floats
    exposures: Floats
    exposures_rejected: tuple[int, ...]
    lenses: Lenses
    pose_stds: tuple[float, float]
    curve: tuple[CurvePoint, ...]
    seeds: int
    seconds: dict[str, float]

    @classmethod
    def of(
        cls,
        optimizer: Optimizer,
        config: MappingConfig,
        frames: tuple[str, ...],
        curve: tuple[CurvePoint, ...],
        seeds: int,
        seconds: dict[str, float],
    ) -> Checkpoint:
        """Capture an optimization at the end of an epoch.

        Args:
            optimizer: The optimization.
            config: Settings as adapted to the data set.
            frames: Names of all usable frames, in the order of the data set.
            curve: Points of the optimization so far.
            seeds: Number of Gaussians at the start.
            seconds: Time by stage, s.
        """
        observations = optimizer.observations
        return cls(
            config=config,
            frames=frames,
            # A copy: later steps change the map in place.
            gaussian_map=optimizer.adam.map.astype(optimizer.adam.map.dtype),
            adam=optimizer.adam.state,
            iteration=optimizer.iteration,
            epoch=optimizer.epoch,
            random=dict(optimizer.rng.bit_generator.state),
            poses=np.array([frame.world_from_camera for frame in observations]),
            exposures=np.array([(o.exposure.gain, o.exposure.offset) for o in observations]),
            exposures_rejected=tuple(
                k for k, frame in enumerate(observations) if frame.exposure_rejected
            ),
            lenses=observations[0].lenses,
            pose_stds=(optimizer.config.pose_std_m, optimizer.config.pose_std_rad),
            curve=curve,
            seeds=seeds,
            seconds=seconds,
        )

    def restore_observations(self, observations: list[Observation]) -> None:
        """Set refined poses, exposures and lenses of training frames that were read again.

        Args:
            observations: Training frames; they are changed in place.
        """
        for k, frame in enumerate(observations):
            gain, offset = self.exposures[k]
            frame.world_from_camera = self.poses[k]
            frame.exposure = Exposure(gain=gain, offset=offset)
            frame.exposure_rejected = k in self.exposures_rejected
            if self.config.refine_lenses:
                frame.set_lenses(self.lenses)

    def restore_optimizer(self, optimizer: Optimizer) -> None:
        """Set the state of an optimizer.

        Args:
            optimizer: Optimizer of the same training frames.
        """
        optimizer.adam = Adam(self.gaussian_map, state=self.adam)
        optimizer.iteration, optimizer.epoch = self.iteration, self.epoch
        optimizer.rng.bit_generator.state = self.random


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint file atomically.

    Args:
        path: File; replaced if it exists.
        checkpoint: State to write.

    Raises:
        OSError: The file cannot be written; an existing one is unchanged.
    """
    state = {
        "format": FORMAT,
        "version": VERSION,
        "config": checkpoint.config.model_dump(),
        "frames": checkpoint.frames,
        "iteration": checkpoint.iteration,
        "epoch": checkpoint.epoch,
        "random": checkpoint.random,
        "lenses": [
            camera_to_json(checkpoint.lenses.color),
            camera_to_json(checkpoint.lenses.depth),
        ],
        "pose_stds": checkpoint.pose_stds,
        "exposures_rejected": checkpoint.exposures_rejected,
        "curve": [asdict(point) for point in checkpoint.curve],
        "seeds": checkpoint.seeds,
        "seconds": checkpoint.seconds,
    }
    arrays = {
        "state": np.frombuffer(json.dumps(state).encode(), np.uint8),
        "poses": checkpoint.poses,
        "exposures": checkpoint.exposures,
        **{name: getattr(checkpoint.gaussian_map, name) for name in MAP_ARRAYS},
        **{name: getattr(checkpoint.adam, name) for name in ADAM_ARRAYS},
    }
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    write_atomic(path, buffer.getvalue())


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint file.

    Args:
        path: File of `write_checkpoint`.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged, or of another version.
    """
    try:
        with zipfile.ZipFile(path) as file:
            # Without compression no array needs more memory than the file has bytes.
            if any(entry.compress_type != zipfile.ZIP_STORED for entry in file.infolist()):
                raise ValueError("it is compressed")
        with np.load(path, allow_pickle=False) as arrays:
            return _checkpoint_of({name: arrays[name] for name in arrays.files})
    except DAMAGE as error:
        raise ValueError(f"{path}: not a checkpoint of a map: {reason_of(error)}") from None


def _checkpoint_of(arrays: dict[str, Any]) -> Checkpoint:
    state = json.loads(arrays["state"].tobytes())
    if not isinstance(state, dict):
        raise ValueError("state is not a JSON object")
    if state.get("format") != FORMAT or state.get("version") != VERSION:
        raise ValueError(f"format is {state.get('format')!r}, version {state.get('version')!r}")
    color, depth = (camera_from_json(camera) for camera in state["lenses"])
    frames = tuple(state["frames"])
    training = len(frames) - sum(len(part) for part in split_held_out(frames))
    for name, shape in (("poses", (training, 4, 4)), ("exposures", (training, 2, 3))):
        array = arrays[name]
        if array.dtype != np.float64 or array.shape != shape:
            raise ValueError(f"{name}: expected float64 {shape}, got {array.dtype} {array.shape}")
    for name in ("poses", "exposures", "first", "second"):
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name}: expected finite numbers")
    if (most := arrays["steps"].max(initial=0)) > state["iteration"]:
        raise ValueError(f"steps: expected at most {state['iteration']}, got {most}")
    np.random.PCG64().state = state["random"]  # Raises if damaged.
    return Checkpoint(
        config=MappingConfig.model_validate(state["config"]),
        frames=frames,
        gaussian_map=GaussianMap(**{name: arrays[name] for name in MAP_ARRAYS}),
        adam=AdamState(**{name: arrays[name] for name in ADAM_ARRAYS}),
        iteration=int(state["iteration"]),
        epoch=int(state["epoch"]),
        random=state["random"],
        poses=arrays["poses"],
        exposures=arrays["exposures"],
        exposures_rejected=tuple(int(k) for k in state["exposures_rejected"]),
        lenses=Lenses(color, depth),
        pose_stds=(float(state["pose_stds"][0]), float(state["pose_stds"][1])),
        curve=tuple(CurvePoint(**point) for point in state["curve"]),
        seeds=int(state["seeds"]),
        seconds={stage: float(seconds) for stage, seconds in state["seconds"].items()},
    )
