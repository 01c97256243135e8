"""The command `gslts detect`."""

from __future__ import annotations

import json
import re
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gslts.cli.arguments import Map
from gslts.cli.localize import Localize, localizer_of
from gslts.cli.mapping import Dataset, Threads, echo_skipped
from gslts.io.messages import to_line

if TYPE_CHECKING:
    from gslts.change.changes import Change
    from gslts.change.detection import Detection

# What a command needs is imported inside it, so that `gslts --help` answers at once.


class Strategy(StrEnum):
    """Strategies of `gslts.change.config.DetectionConfig`."""

    OBJECTS = "objects"
    GS_LTS = "gs_lts"


def detect(
    map_path: Map,
    dataset: Dataset,
    frame: Annotated[
        list[str] | None,
        typer.Option(help="Name of a frame; may be given several times. Default: all."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="New or empty folder for an image of each frame.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object per frame.")
    ] = False,
    strategy: Annotated[
        Strategy, typer.Option(help="Any number of objects, or the rule printed in GS-LTS.")
    ] = Strategy.OBJECTS,
    features: Annotated[
        str, typer.Option(help="Feature extractor: gradients, onnx:FILE or transformers:DIR.")
    ] = "gradients",
    halvings: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=2,
            help="Halvings of the sides of a frame before the comparison. Default: as many as "
            "leave a width of 320 px.",
        ),
    ] = None,
    localize: Localize = False,
    threads: Threads = 0,
) -> None:
    """Detect object changes by comparing RGB-D or colour frames with a map.

    Example: gslts detect out/map_kitchen_3 out/visit --frame 00007 --out out/changes
    """
    from tqdm import tqdm

    from gslts.change.config import DetectionConfig
    from gslts.change.detector import ChangeDetector
    from gslts.change.features import feature_extractor
    from gslts.change.overlay import overlay
    from gslts.datasets import open_dataset
    from gslts.io.atomic_files import empty_folder
    from gslts.io.image_files import write_image

    config = DetectionConfig(strategy=strategy.value, halvings=halvings, threads=threads)
    opened = open_dataset(dataset, posed=not localize)
    known = {entry.name: entry for entry in opened.frames}
    for name in frame or []:
        if name not in known:
            raise ValueError(f"{dataset}: there is no frame {name!r}")
    detector = ChangeDetector.of_map(map_path, config, features=feature_extractor(features))
    localizer = localizer_of(map_path, threads) if localize else None
    if out is not None:
        empty_folder(out)
    echo_skipped(opened.left_out)
    names = frame or list(known)
    for number, name in enumerate(tqdm(names, desc="detecting", unit="frame", disable=None)):
        try:
            read = known[name].read()
            detection = detector.detect(
                read if localizer is None else localizer.localize_frame(read)
            )
        except (OSError, ValueError) as error:  # A damaged file does not stop the others.
            _echo_error(name, error, as_json=as_json)
            continue
        if as_json:
            typer.echo(json.dumps(_plain(name, detection, read.camera.width)))
        else:
            typer.echo(_line(name, detection))
        if out is not None:
            stem = re.sub(r"[^\w.-]+", "-", name)
            write_image(out / f"{number:05}_{stem}.png", overlay(detection))


def _echo_error(name: str, error: Exception, *, as_json: bool) -> None:
    reason = to_line(str(error))
    plain = {"frame": name, "unreliable": reason, "changes": [], "unknown": []}
    typer.echo(json.dumps(plain) if as_json else f"{name}: unreliable: {reason}")


def _line(name: str, detection: Detection) -> str:
    if detection.unreliable is not None:
        return f"{name}: unreliable: {detection.unreliable}"
    if not detection.changes:
        return f"{name}: no change"
    return f"{name}: " + "; ".join(_summary(change) for change in detection.changes)


def _summary(change: Change) -> str:
    x, y, z = change.point
    where = "at" if change.is_measured else "at or in front of"
    return (
        f"{change.kind} {where} ({x:.2f}, {y:.2f}, {z:.2f}) m, confidence {change.confidence:.2f}"
    )


def _plain(name: str, detection: Detection, width_px: int) -> dict[str, Any]:
    """Return JSON values of a result; boxes are in the pixels of a frame of this width."""
    return {
        "frame": name,
        "unreliable": detection.unreliable,
        "changes": [
            {
                "kind": change.kind,
                "confidence": change.confidence,
                "point_m": change.point.tolist(),
                "is_measured": change.is_measured,
                "box_before_m": _corners(change, 0),
                "box_after_m": _corners(change, 1),
                "motion": None if change.motion is None else change.motion.tolist(),
                "box_px": change.box_px("after", width_px) or change.box_px("before", width_px),
                "pixels": [0 if mask is None else int(mask.sum()) for mask in change.masks],
            }
            for change in detection.changes
        ],
        "unknown": [
            {"reason": region.reason, "box_px": region.box_px(width_px)}
            for region in detection.unknown
        ],
    }


def _corners(change: Change, side: int) -> list[list[float]] | None:
    box = change.boxes[side]
    return None if box is None else [corner.tolist() for corner in box]
