"""What is told about a finished run: the folder of the map, the report and one line."""

from __future__ import annotations

from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import FloatArray
from gslts.core.se3 import twist_of
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmark_files import KEY, landmarks_digest, write_landmarks
from gslts.mapping.engine import MappingResult
from gslts.mapping.evaluation.evaluate import Quality, shown
from gslts.mapping.lenses import Lenses
from gslts.mapping.report.data import ReportData, View
from gslts.mapping.report.page import write_report
from gslts.rendering.metrics import psnr_db
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.store.map_folder import camera_to_json, write_map_folder


def write_result(folder: Path, result: MappingResult, dataset: str) -> None:
    """Writes the folder of a map with landmarks and its report; it is there whole or not at all.

    Args:
        folder: Must not be there yet.
        result: What to write.
        dataset: Its name.

    Raises:
        OSError: It cannot be written, or is there already.
    """
    frames = (one.rgbd() for one in result.training.values())
    landmarks = extract_landmarks(result.gaussian_map, frames, threads=result.config.threads)

    def finish(part: Path) -> None:
        write_landmarks(landmarks, part)
        write_report(part / "report.html", report_of(result, dataset))

    write_map_folder(
        folder,
        result.gaussian_map,
        {**manifest_of(result, dataset), KEY: landmarks_digest(landmarks)},
        {name: one.camera() for name, one in result.training.items()},
        finish,
    )


def manifest_of(result: MappingResult, dataset: str) -> dict[str, Any]:
    """What stands beside the Gaussians, in values of JSON."""
    return {
        "gslts": metadata.version("gslts"),
        "dataset": dataset,
        "origin": result.gaussian_map.origin.tolist(),
        "config": result.config.model_dump(),
        "lenses": {"given": _plain(result.given_lenses), "found": _plain(_found(result))},
        "held_out": asdict(result.quality),
        "variants": [
            {"name": one.name, "gaussians": one.gaussian_map.size, "psnr_db": one.psnr_db}
            for one in result.variants
        ],
        "seeds": result.seeds,
        "seconds": result.seconds,
        "skipped": list(result.skipped),
    }


def summary_of(result: MappingResult) -> str:
    """One line."""
    quality = result.quality
    ways = [f"{quality.given.psnr_db:.1f} dB"]
    if quality.by_neighbours is not None:
        ways.append(f"{quality.by_neighbours.psnr_db:.1f} with poses corrected by neighbours")
    ways.append(f"{quality.refined.psnr_db:.1f} with refined ones")
    depth_m = quality.refined.depth_l1_m
    depth = ", no depth measured" if depth_m is None else f", depth {100 * depth_m:.1f} cm off"
    sizes = "".join(
        f"; {one.name} as many: {one.psnr_db - result.variants[0].psnr_db:+.2f} dB"
        for one in result.variants
        if one.name in ("half", "double")
    )
    return (
        f"{result.gaussian_map.size} Gaussians in {result.used_s:.0f} s; "
        f"{quality.refined.frames} frames kept aside: {', '.join(ways)}{depth}{sizes}; "
        f"{len(result.skipped)} frames skipped"
    )


def report_of(result: MappingResult, dataset: str) -> ReportData:
    """The pages that people look at."""
    quality = result.quality
    ways = {
        "poses as given": quality.given,
        "poses corrected by neighbours": quality.by_neighbours,
        "poses refined": quality.refined,
    }
    corrections = np.array([twist_of(one.correction) for one in result.training.values()])
    return ReportData(
        title=f"Map of {dataset}",
        summary=summary_of(result),
        metrics={name: _metrics(one) for name, one in ways.items() if one is not None},
        gaussians_needed=[
            (one.name, one.gaussian_map.size, one.psnr_db) for one in result.variants
        ],
        curve=result.curve,
        views=_views(result, result.config.threads),
        findings={
            **_lens_findings(result),
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
    for name, one in result.held_out.items():
        images = rasterizer.forward(result.gaussian_map, one.camera(), options)
        rgb = shown(images, one, threads)
        views.append(
            View(
                name=name,
                photo=one.rgb[0],
                render=_bytes(rgb),
                measured_depth=one.depth(),
                rendered_depth=images.depth.astype(np.float32),
                psnr_db=psnr_db(rgb, one.photo(), one.mask()),
                mask=one.mask(),
            )
        )
    return views


def _lens_findings(result: MappingResult) -> dict[str, str]:
    given, found = result.given_lenses, _found(result)
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
        "depth lens turned by, mrad": f"{_three(1e3 * twist[3:])} (given "
        f"{_three(1e3 * before[3:])})",
    }


def _three(numbers: NDArray[np.float64]) -> str:
    return ", ".join(f"{number:.1f}" for number in numbers)


def _found(result: MappingResult) -> Lenses:
    return next(iter(result.training.values())).lenses


def _plain(lenses: Lenses) -> dict[str, Any]:
    return {"color": camera_to_json(lenses.color), "depth": camera_to_json(lenses.depth)}


def _bytes(rgb: FloatArray) -> NDArray[np.uint8]:
    return (rgb.clip(0, 1) * 255 + 0.5).astype(np.uint8)
