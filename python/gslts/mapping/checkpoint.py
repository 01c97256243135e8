"""The state of a run of the mapping engine on the disk, to go on exactly where it stopped."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.datasets.dataset import reason_of
from gslts.io.atomic_files import write_atomic
from gslts.mapping.config import MappingConfig
from gslts.mapping.frames import every_eighth
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer
from gslts.mapping.report.data import CurvePoint
from gslts.rendering.adam import Adam, AdamState
from gslts.rendering.losses import Exposure
from gslts.store.map_folder import camera_from_json, camera_to_json

FORMAT, VERSION = "gslts-checkpoint", 1
MAP_ARRAYS = ("means", "quats", "log_scales", "logit_opacities", "sh", "ids", "origin")
ADAM_ARRAYS = ("first", "second", "steps")
DAMAGE = (
    *(ValueError, KeyError, TypeError, AttributeError, OverflowError),
    *(EOFError, RuntimeError, zipfile.BadZipFile),
)
"""What damage raises; RuntimeError is that of zipfile and of JSON that is nested too deeply."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Between two epochs of the optimisation.

    Attributes:
        config: As given by the user.
        frames: Names of all frames that were read.
        gaussian_map: So far.
        adam: What Adam remembers.
        iteration, epoch: Done.
        random: State of the generator.
        poses: [F,4,4] of the frames learned from.
        exposures: [F,2,3] their gains and offsets.
        lenses: As corrected.
        pose_stds: How far given poses were found to be off, m and rad.
        curve: So far.
        seeds: Gaussians at the start.
        seconds: By stage.
    """

    config: MappingConfig
    frames: tuple[str, ...]
    gaussian_map: GaussianMap
    adam: AdamState
    iteration: int
    epoch: int
    random: dict[str, Any]
    poses: NDArray[np.float64]
    exposures: NDArray[np.float64]
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
        """Of an optimisation between two epochs."""
        observations = optimizer.observations
        return cls(
            config=config,
            frames=frames,
            gaussian_map=optimizer.adam.map,
            adam=optimizer.adam.state,
            iteration=optimizer.iteration,
            epoch=optimizer.epoch,
            random=dict(optimizer.rng.bit_generator.state),
            poses=np.array([one.pose for one in observations]),
            exposures=np.array([(one.exposure.gain, one.exposure.offset) for one in observations]),
            lenses=observations[0].lenses,
            pose_stds=(optimizer.config.pose_std_m, optimizer.config.pose_std_rad),
            curve=curve,
            seeds=seeds,
            seconds=seconds,
        )

    def restore_observations(self, observations: list[Observation]) -> None:
        """Gives frames that were read anew what had been found out about them."""
        for one, pose, (gain, offset) in zip(observations, self.poses, self.exposures, strict=True):
            one.pose, one.exposure = pose, Exposure(gain=gain, offset=offset)
            if self.config.refine_lenses:
                one.set_lenses(self.lenses)

    def restore_optimizer(self, optimizer: Optimizer) -> None:
        """Lets an optimizer of the same observations go on from here."""
        optimizer.adam = Adam(self.gaussian_map, state=self.adam)
        optimizer.iteration, optimizer.epoch = self.iteration, self.epoch
        optimizer.rng.bit_generator.state = self.random


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Writes a file, or leaves the one that was there.

    Raises:
        OSError: It cannot be written.
    """
    known = {
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
        "curve": [asdict(point) for point in checkpoint.curve],
        "seeds": checkpoint.seeds,
        "seconds": checkpoint.seconds,
    }
    arrays = {
        "known": np.frombuffer(json.dumps(known).encode(), np.uint8),
        "poses": checkpoint.poses,
        "exposures": checkpoint.exposures,
        **{name: getattr(checkpoint.gaussian_map, name) for name in MAP_ARRAYS},
        **{name: getattr(checkpoint.adam, name) for name in ADAM_ARRAYS},
    }
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    write_atomic(path, buffer.getvalue())


def read_checkpoint(path: Path) -> Checkpoint:
    """Reads what `write_checkpoint` wrote.

    Raises:
        OSError: It cannot be read.
        ValueError: It is damaged, or of another version.
    """
    try:
        with zipfile.ZipFile(path) as file:
            # Nothing is compressed: no array can take more memory than the file has bytes.
            if any(entry.compress_type != zipfile.ZIP_STORED for entry in file.infolist()):
                raise ValueError("it is compressed")
        with np.load(path, allow_pickle=False) as arrays:
            return _checkpoint_of({name: arrays[name] for name in arrays.files})
    except DAMAGE as error:
        raise ValueError(f"{path}: it is no checkpoint of a map: {reason_of(error)}") from None


def _checkpoint_of(arrays: dict[str, NDArray[Any]]) -> Checkpoint:
    known = json.loads(arrays["known"].tobytes())
    if not isinstance(known, dict):
        raise ValueError("known is no object of JSON")
    if known.get("format") != FORMAT or known.get("version") != VERSION:
        raise ValueError(f"format is {known.get('format')!r}, version {known.get('version')!r}")
    color, depth = (camera_from_json(one) for one in known["lenses"])
    frames = tuple(known["frames"])
    training = len(frames) - len(every_eighth(frames))
    for name, shape in (("poses", (training, 4, 4)), ("exposures", (training, 2, 3))):
        array = arrays[name]
        if array.dtype != np.float64 or array.shape != shape:
            raise ValueError(f"{name}: expected float64 {shape}, got {array.dtype} {array.shape}")
    np.random.PCG64().state = known["random"]  # Checks it.
    return Checkpoint(
        config=MappingConfig.model_validate(known["config"]),
        frames=frames,
        gaussian_map=GaussianMap(**{name: arrays[name] for name in MAP_ARRAYS}),
        adam=AdamState(**{name: arrays[name] for name in ADAM_ARRAYS}),
        iteration=int(known["iteration"]),
        epoch=int(known["epoch"]),
        random=known["random"],
        poses=arrays["poses"],
        exposures=arrays["exposures"],
        lenses=Lenses(color, depth),
        pose_stds=(float(known["pose_stds"][0]), float(known["pose_stds"][1])),
        curve=tuple(CurvePoint(**point) for point in known["curve"]),
        seeds=int(known["seeds"]),
        seconds={stage: float(seconds) for stage, seconds in known["seconds"].items()},
    )
