"""Words of a detector in real rooms: what is found, found falsely, and how new objects are named.

    python benchmarks/words_benchmark.py DATA --json benchmarks/results/words.json

DATA is a folder with `7scenes`, `real_changes` and `models`. The map of the 7-Scenes room is made
of its frames and taught each of the detectors; objects that were marked by hand in some images
(words_marks.json) are asked for by the name of their class. A box is right if its centre lies in
the marked boxes of all these images. The rooms of `real_changes` are mapped as they were at the
first visit, taught, and updated with each later visit alone.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.core.se3 import inverse_transform
from gslts.datasets import open_dataset
from gslts.io.atomic_files import write_atomic
from gslts.robots.recorded import RecordedRobot
from gslts.semantics.add_semantics import add_semantics
from gslts.semantics.detector import Detections, Detector
from gslts.semantics.queries import Instance, SemanticQueries
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import open_map
from gslts.store.records import UNKNOWN
from gslts.types import Floats
from gslts.update.config import UpdateConfig
from gslts.update.pipeline import update_map
from gslts.update.region import Region
from gslts_bench.homes import HomeSetup
from gslts_bench.provenance import describe_run
from gslts_bench.real.score import iou
from gslts_bench.real.visit_score import CONFIRMATION
from gslts_bench.real.visits import RealRoom, rooms_in
from gslts_bench.tables import Table, number, share

MARKS = Path(__file__).parent / "words_marks.json"
MODELS = ("yolo-fastest-1.1-xl.weights", "FastestDet.onnx")
"""Detectors in `models`; both with the 80 classes of COCO."""
ABSENT = 20
"""Number of classes that are not in the room, the first ones of the file of names."""
MIN_IOU = 0.3
"""Minimum intersection over union of a detection in an image with the box of a new object."""
SURFACE_PX_SHARE, SURFACE_QUANTILE, SURFACE_M = 0.25, 0.3, 0.08
"""Border of a marked box that is left out, and which of the depths in the rest are the object's:
those within some metres of this quantile."""


@dataclass(frozen=True)
class Mark:
    """An object that was marked by hand.

    Attributes:
        kind: Its class.
        name: For tables.
        boxes: Left, top, right and bottom, px, by name of the image.
    """

    kind: str
    name: str
    boxes: Mapping[str, Sequence[float]]


def read_marks() -> tuple[list[Mark], dict[str, Any]]:
    """Read the marked objects, and the rest of the file."""
    values = json.loads(MARKS.read_text())
    marks = [
        Mark(
            each["class"],
            each["name"],
            {f"frame-{int(frame):06d}.color": box for frame, box in each["boxes"].items()},
        )
        for each in values["objects"]
    ]
    return marks, values


def is_in_boxes(point: Floats, mark: Mark, cameras: Mapping[str, Camera]) -> bool:
    """Return whether a point is in the marked boxes of all images that the map was made from."""
    checks = []
    for frame, (left, top, right, bottom) in mark.boxes.items():
        camera = cameras.get(frame)
        if camera is not None:
            x, y, z = inverse_transform(camera.world_from_camera, point)
            u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
            checks.append(z > 0 and left <= u <= right and top <= v <= bottom)
    return bool(checks) and all(checks)


def true_place(mark: Mark, room: Path, cameras: Mapping[str, Camera], radius_m: float) -> Floats:
    """Return the mean place of a round object in the images, by the depth of its surface, m."""
    places = []
    for frame in open_dataset(room).frames:
        if frame.name not in mark.boxes or frame.name not in cameras:
            continue
        read = replace(frame.read(), camera=cameras[frame.name]).registered()
        left, top, right, bottom = mark.boxes[frame.name]
        margins = SURFACE_PX_SHARE * (right - left), SURFACE_PX_SHARE * (bottom - top)
        x0, y0 = int(left + margins[0]), int(top + margins[1])
        depth = read.depth[y0 : int(bottom - margins[1]), x0 : int(right - margins[0])]
        known = depth[depth > 0]
        near = np.abs(depth - np.quantile(known, SURFACE_QUANTILE)) < SURFACE_M
        rows, columns = np.nonzero(near & (depth > 0))
        z, camera = depth[rows, columns] + radius_m, read.camera
        x = (columns + x0 + 0.5 - camera.cx) / camera.fx * z
        y = (rows + y0 + 0.5 - camera.cy) / camera.fy * z
        pose = camera.world_from_camera
        points = np.stack([x, y, z], axis=1) @ pose[:3, :3].T + pose[:3, 3]
        places.append(np.median(points, axis=0))
    return np.asarray(np.mean(places, axis=0))


def measure_room(data: Path, model: str, source_map: Path, folder: Path) -> dict[str, Any]:
    """Teach the 7-Scenes room a detector and compare its answers with the marks.

    Args:
        data: Folder of the data.
        model: Name of the detector's file.
        source_map: Map of the room.
        folder: Folder for a copy of the map.

    Returns:
        JSON values.
    """
    path, room = folder / Path(model).stem, data / "7scenes"
    shutil.copytree(source_map, path)
    names = data / "models" / "coco.names"
    command = [sys.executable, "-c", "from gslts.cli import main; main()", "semantics"]
    given = ["--source", "detector", "--model", data / "models" / model, "--names", names]
    start_s = time.perf_counter()
    with subprocess.Popen([*command, path, room, *given], stderr=subprocess.DEVNULL) as process:
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise ValueError(f"gslts semantics failed with {model}")
    taught = {
        "wall_s": time.perf_counter() - start_s,
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "peak_bytes": 1024 * usage.ru_maxrss,
    }
    cameras, queries = cameras_of_map(path), SemanticQueries.of_map(path)
    marks, values = read_marks()
    found: dict[str, list[Instance]] = {
        name: queries.find(name) for name in names.read_text().splitlines()
    }
    right, errors_m = {}, {}
    extra = {kind: len(found[kind]) for kind in {mark.kind for mark in marks}}
    for mark in marks:
        hits = [i for i in found[mark.kind] if is_in_boxes(i.center, mark, cameras)]
        right[f"{mark.kind}: {mark.name}"] = bool(hits)
        extra[mark.kind] -= len(hits)
        radius_m = values["radius_m"].get(mark.kind)
        if hits and radius_m is not None:
            place = true_place(mark, room, cameras, radius_m)
            errors_m[mark.name] = float(np.linalg.norm(hits[0].center - place))
    absent = [name for name in found if name not in values["present"]]
    return {
        "frames": len(cameras),
        **taught,
        "right": right,
        "errors_m": errors_m,
        "extra": extra,
        "false": [name for name in absent if found[name]],
        "false_of_first": [name for name in absent[:ABSENT] if found[name]],
        "absent": len(absent),
    }


def measure_changes(data: Path, model: str, work: Path) -> list[dict[str, Any]]:
    """Update the taught map of each room with each visit, and compare names of what came.

    Args:
        data: Folder of the data.
        model: Name of the detector's file.
        work: Folder for maps.

    Returns:
        JSON values of each addition: room, visit, its name, and its names in single images.
    """
    names = data / "models" / "coco.names"
    classes = names.read_text().splitlines()
    detector = Detector(data / "models" / model, len(classes))
    models = {"model": data / "models" / model, "names": names}
    results = []
    for room in rooms_in(data / "real_changes", HomeSetup().mapping, work):
        with tempfile.TemporaryDirectory(dir=work) as folder:
            taught = Path(folder) / "taught"
            shutil.copytree(room.map(), taught)
            add_semantics(taught, room.reference, "detector", models)
            for visit in room.marked.visits:
                path = Path(folder) / visit
                shutil.copytree(taught, path)
                results += list(_additions(path, room, visit, detector, classes))
    return results


def _additions(
    path: Path, room: RealRoom, visit: str, detector: Detector, classes: Sequence[str]
) -> Iterator[dict[str, Any]]:
    frames = [frame.read() for frame, _ in room.frames(visit)]
    update_map(
        path, RecordedRobot(frames), UpdateConfig(threads=1), frames=frames, monitor=CONFIRMATION
    )
    seen = [(frame.registered().camera, detector(frame.rgb)) for frame in frames]
    with open_map(path) as store:
        events = [event for event in store.events() if event.boxes[1] is not None]
    for event in events:
        low, high = (np.array(corner) for corner in event.boxes[1] or ())
        singles = _names_in(Region("after", low, high), seen, classes)
        yield {"room": room.name, "visit": visit, "kind": event.kind, "name": event.type, **singles}


def _names_in(
    region: Region, seen: Sequence[tuple[Camera, Detections]], classes: Sequence[str]
) -> dict[str, Any]:
    """Return the best name of each image that has a detection at a region."""
    names = []
    for camera, found in seen:
        box = region.project_box(camera, 0)
        if box is None:
            continue
        ious = np.array([iou(box, tuple(map(float, each))) for each in found.boxes])
        fitting = np.flatnonzero(ious >= MIN_IOU)
        if len(fitting):  # Sorted by score.
            names.append(classes[found.classes[fitting[0]]])
    return {"in_images": names}


def tables_of(
    rooms: Mapping[str, Mapping[str, Any]], changes: Mapping[str, Sequence[Mapping[str, Any]]]
) -> list[Table]:
    """Make the tables.

    Args:
        rooms: From `measure_room`, by detector.
        changes: From `measure_changes`, by detector.
    """
    detectors = list(rooms or changes)
    tables = []
    if rooms:
        objects = next(iter(rooms.values()))["right"]
        rows = [
            [name, *("found" if rooms[d]["right"][name] else "-" for d in detectors)]
            for name in objects
        ]
        tables.append(Table("The 7-Scenes room", ["object", *detectors], rows))
        numbers = {
            "distance of the mugs from their places, cm": lambda r: ", ".join(
                f"{100 * error:.1f}" for error in r["errors_m"].values()
            ),
            "other boxes of these classes": lambda r: (
                ", ".join(f"{count} {kind}" for kind, count in sorted(r["extra"].items()) if count)
                or "none"
            ),
            f"false classes, of the first {ABSENT} that are not there": lambda r: (
                ", ".join(r["false_of_first"]) or "none"
            ),
            "false classes, of all that are not there": lambda r: (
                f"{', '.join(r['false']) or 'none'} (of {r['absent']})"
            ),
            "frames": lambda r: str(r["frames"]),
            "time, of one core": lambda r: number(r["cpu_s"], 0, "s"),
            "time": lambda r: number(r["wall_s"], 0, "s"),
            "time, of one core, for 200 frames": lambda r: number(
                r["cpu_s"] / r["frames"] * 200, 0, "s"
            ),
            "peak memory": lambda r: number(r["peak_bytes"] / 2**20, 0, "MiB"),
        }
        rows = [[name, *(of(rooms[d]) for d in detectors)] for name, of in numbers.items()]
        tables.append(Table("", ["", *detectors], rows))
    if changes:
        rows = []
        for detector, results in changes.items():
            named = [r for r in results if r["in_images"]]
            same = [r for r in named if r["name"] in r["in_images"]]
            unnamed = [r for r in results if not r["in_images"] and r["name"] != UNKNOWN]
            rows.append(
                [
                    detector,
                    str(len(results)),
                    str(len(named)),
                    share(len(same), len(named)),
                    str(len(unnamed)),
                ]
            )
        header = ["", "came", "named in an image", "named so in the log", "named by the map alone"]
        tables.append(Table("What came in the rooms of real_changes", header, rows))
    return tables


def main() -> None:
    """Measure, print the tables, and write the result."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data", type=Path, help="folder with 7scenes, real_changes and models")
    parser.add_argument("--map", type=Path, help="map of 7scenes; made if it is not given")
    parser.add_argument("--work", type=Path, default=Path("out/bench"), help="folder for maps")
    parser.add_argument("--models", nargs="+", default=list(MODELS))
    parser.add_argument("--parts", nargs="+", default=["room", "changes"])
    parser.add_argument("--json", type=Path, help="file for the result")
    args = parser.parse_args()
    args.work.mkdir(parents=True, exist_ok=True)
    rooms: dict[str, Any] = {}
    changes: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(dir=args.work) as folder:
        if "room" in args.parts:
            path = args.map or Path(folder) / "map"
            if args.map is None:
                command = [sys.executable, "-c", "from gslts.cli import main; main()", "map"]
                given = [args.data / "7scenes", "--preset", "fast", "--out", path]
                subprocess.run([*command, *given], check=True)
            for model in args.models:
                rooms[model] = measure_room(args.data, model, path, Path(folder))
        if "changes" in args.parts:
            for model in args.models:
                changes[model] = measure_changes(args.data, model, args.work)
    tables = tables_of(rooms, changes)
    print("\n\n".join(table.markdown() for table in tables))
    if args.json is not None:
        found = {"rooms": rooms, "changes": changes}
        result = {
            "title": "Words of a detector",
            **describe_run(),
            "found": found,
            "tables": [asdict(table) for table in tables],
        }
        write_atomic(args.json, (json.dumps(result, indent=1) + "\n").encode())


if __name__ == "__main__":
    main()
