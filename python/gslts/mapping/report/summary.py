"""Results of a mapping run: folder of the map, manifest, report and a one-line summary."""

from __future__ import annotations

from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.se3 import twist_of
from gslts.datasets import Dataset
from gslts.io.images import to_rgb8
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmark_files import write_landmarks
from gslts.mapping.engine import MappingResult
from gslts.mapping.evaluation.evaluate import Quality, rgb_as_exposed
from gslts.mapping.lenses import Lenses
from gslts.mapping.measure import measure_recording
from gslts.mapping.report.data import ReportData, View
from gslts.mapping.report.page import write_report
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.store.fingerprints import FINGERPRINTS, fingerprint
from gslts.store.map_folder import camera_to_json, write_map_folder
from gslts.store.measurement_files import write_measurements
from gslts.store.trajectory_file import TRAJECTORY, write_trajectory
from gslts.types import Floats

MIN_TRAINING_PSNR_DB = 19.0
"""Minimum PSNR of a training frame that the map reproduces, dB: errors of a ninth of the range. A
blurred recording (7-Scenes) has 21 dB and more, with 23 in the mean; a map whose colours drifted
apart had 14 to 18 in half of its frames, frames of a plain room at wrong poses 18 to 19."""
NAMED_FRAMES = 5
"""Maximum number of frames that the warning names."""
MAX_POOR_SHARE = 0.1
"""Maximum share of training frames that are not reproduced without a warning: some are blurred, or
show somebody who walked by."""


def write_result(
    folder: Path, result: MappingResult, dataset: str, estimated: Dataset | None = None
) -> None:
    """Write the folder of a map with landmarks, measurements and report atomically.

    Args:
        folder: New folder; must not exist.
        result: Result of `make_map`.
        dataset: Name of the data set.
        estimated: The data set at poses that were estimated for it; None if it gave the poses.

    Raises:
        OSError: The folder cannot be written, or exists.
    """
    frames = list(result.training.values())
    landmarks = extract_landmarks(
        result.gaussian_map, (frame.rgbd() for frame in frames), threads=result.config.threads
    )
    measurements = measure_recording(result.gaussian_map, frames, result.config.threads)

    def finish(part: Path) -> dict[str, str]:
        write_report(part / "report.html", report_of(result, dataset))
        if estimated is not None:
            write_trajectory(part / TRAJECTORY, estimated)
        return {
            "landmarks": write_landmarks(landmarks, part),
            "measurements": write_measurements(measurements, part),
        }

    write_map_folder(
        folder,
        result.gaussian_map,
        manifest_of(result, dataset),
        {name: frame.camera() for name, frame in result.training.items()},
        finish,
    )


def manifest_of(result: MappingResult, dataset: str) -> dict[str, Any]:
    """Return the manifest of a map, in values of JSON.

    Args:
        result: Result of `make_map`.
        dataset: Name of the data set.
    """
    return {
        "gslts": metadata.version("gslts"),
        "dataset": dataset,
        "origin": result.gaussian_map.origin.tolist(),
        "config": result.config.model_dump(),
        "lenses": {"given": _plain(result.given_lenses), "found": _plain(_found_lenses(result))},
        "test": None if result.quality is None else asdict(result.quality),
        "test_frames": list(result.test),
        "validation_frames": list(result.validation),
        FINGERPRINTS: {
            name: fingerprint(frame.rgb[0])
            for name, frame in {**result.training, **result.held_out}.items()
        },
        "exposures_rejected": _exposures_rejected(result),
        "training_psnrs_db": result.training_psnrs_db,
        "warning": warning_of(result),
        "variants": [
            {
                "name": variant.name,
                "gaussians": variant.gaussian_map.size,
                "validation_psnr_db": variant.psnr_db,
            }
            for variant in result.variants
        ],
        "seeds": result.seeds,
        "seconds": result.seconds,
        "skipped": list(result.skipped),
    }


def summary_of(result: MappingResult) -> str:
    """Summarize a result in one line.

    Args:
        result: Result of `make_map`.
    """
    changes = "".join(
        f"; {variant.name} as many: {variant.psnr_db - result.variants[0].psnr_db:+.2f} dB"
        for variant in result.variants
        if variant.name in ("half", "double")
    )
    return (
        f"{result.gaussian_map.size} Gaussians in {result.used_s:.0f} s; "
        f"{_quality_of(result)}{changes}; {len(result.skipped)} frames skipped"
    )


def warning_of(result: MappingResult) -> str | None:
    """Return one line if the map does not reproduce the frames it was made from, else None.

    Args:
        result: Result of `make_map`.
    """
    psnrs_db = result.training_psnrs_db
    poor = [name for name, psnr in psnrs_db.items() if not psnr >= MIN_TRAINING_PSNR_DB]
    if len(poor) <= MAX_POOR_SHARE * len(psnrs_db):
        return None
    named = ", ".join(poor[:NAMED_FRAMES]) + (", ..." if len(poor) > NAMED_FRAMES else "")
    return (
        f"the map does not show {len(poor)} of {len(psnrs_db)} training frames (PSNR below "
        f"{MIN_TRAINING_PSNR_DB:.0f} dB): {named}; check their poses and depths"
    )


def _quality_of(result: MappingResult) -> str:
    quality = result.quality
    if quality is None:
        return f"{len(result.training)} training frames, too few to hold out any for a test"
    psnrs = [f"{quality.given.psnr_db:.1f} dB"]
    if quality.by_neighbours is not None:
        psnrs.append(f"{quality.by_neighbours.psnr_db:.1f} with poses corrected by neighbours")
    psnrs.append(f"{quality.refined.psnr_db:.1f} with refined poses")
    depth_m = quality.refined.depth_l1_m
    depth = ", no depth measured" if depth_m is None else f", depth error {100 * depth_m:.1f} cm"
    return f"{quality.refined.frames} test frames: {', '.join(psnrs)}{depth}"


def report_of(result: MappingResult, dataset: str) -> ReportData:
    """Return the content of the report.

    Args:
        result: Result of `make_map`.
        dataset: Name of the data set.
    """
    quality = result.quality
    by_poses: dict[str, Quality | None] = {}
    if quality is not None:
        by_poses = {
            "poses as given": quality.given,
            "poses corrected by neighbours": quality.by_neighbours,
            "poses refined": quality.refined,
        }
    corrections = np.array([twist_of(frame.correction) for frame in result.training.values()])
    return ReportData(
        title=f"Map of {dataset}",
        summary=summary_of(result),
        metrics={
            poses: _metrics(figures) for poses, figures in by_poses.items() if figures is not None
        },
        variants=[(v.name, v.gaussian_map.size, v.psnr_db) for v in result.variants],
        curve=result.curve,
        views=_views(result, result.config.threads),
        frames={"test": result.test, "validation": result.validation},
        findings={
            **_training_findings(result),
            **_lens_findings(result),
            **_exposure_findings(result),
            **{f"seconds for {stage}": f"{s:.1f}" for stage, s in result.seconds.items()},
        },
        pose_shifts_m=np.linalg.norm(corrections[:, :3], axis=1).tolist(),
        pose_turns_rad=np.linalg.norm(corrections[:, 3:], axis=1).tolist(),
        skipped=result.skipped,
        config=result.config.model_dump(),
    )


def _metrics(quality: Quality) -> dict[str, float]:
    metrics = {"PSNR, dB": quality.psnr_db, "SSIM": quality.ssim}
    if quality.depth_l1_m is not None:
        metrics["depth error, cm"] = 100 * quality.depth_l1_m
    return metrics


def _views(result: MappingResult, threads: int) -> list[View]:
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    views = []
    for name in result.test:
        frame = result.held_out[name]
        images = rasterizer.forward(result.gaussian_map, frame.camera(), options)
        rgb = rgb_as_exposed(images, frame, threads)
        views.append(
            View(
                name=name,
                photo=frame.rgb[0],
                render=to_rgb8(rgb),
                measured_depth=frame.depth(),
                rendered_depth=images.depth.astype(np.float32),
                psnr_db=psnr_db(rgb, frame.color(), frame.mask()),
                mask=frame.mask(),
            )
        )
    return views


def _lens_findings(result: MappingResult) -> dict[str, str]:
    given, found = result.given_lenses, _found_lenses(result)
    twist = twist_of(found.depth.world_from_camera)
    before = twist_of(given.depth.world_from_camera)
    names = ("fx", "fy", "cx", "cy")
    intrinsics = ", ".join(
        f"{name} {getattr(found.color, name):.1f} (given {getattr(given.color, name):.1f})"
        for name in names
    )
    return {
        "colour camera, px": intrinsics,
        "depth lens from the colour camera, mm": f"{_three(1e3 * twist[:3])} (given "
        f"{_three(1e3 * before[:3])})",
        "depth lens rotated by, mrad": f"{_three(1e3 * twist[3:])} (given "
        f"{_three(1e3 * before[3:])})",
    }


def _exposures_rejected(result: MappingResult) -> list[str]:
    return [name for name, frame in result.training.items() if frame.exposure_rejected]


def _training_findings(result: MappingResult) -> dict[str, str]:
    psnrs_db, warning = list(result.training_psnrs_db.values()), warning_of(result)
    mean_db, min_db = float(np.mean(psnrs_db)), min(psnrs_db)
    findings = {"PSNR of training frames, dB": f"{mean_db:.1f} (lowest {min_db:.1f})"}
    return findings if warning is None else {"warning": warning, **findings}


def _exposure_findings(result: MappingResult) -> dict[str, str]:
    rejected = _exposures_rejected(result)
    if not rejected:
        return {}
    return {"exposure not plausible, an earlier one kept": ", ".join(rejected)}


def _three(numbers: Floats) -> str:
    return ", ".join(f"{number:.1f}" for number in numbers)


def _found_lenses(result: MappingResult) -> Lenses:
    return next(iter(result.training.values())).lenses


def _plain(lenses: Lenses) -> dict[str, Any]:
    return {"color": camera_to_json(lenses.color), "depth": camera_to_json(lenses.depth)}
