"""Costs of one map, in a process of its own: `python -m gslts_bench.scale.measure JOB`.

The job is a JSON file; the result is printed as JSON.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

import cv2

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_files import read_landmarks
from gslts.localization.relocalizer import Relocalizer
from gslts.semantics.autoencoder import read_autoencoder
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.source import Oracle
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import open_map
from gslts.update.config import UpdateConfig
from gslts.update.integrate import Stage, integrate_changes
from gslts.update.publish import publish
from gslts_sim.task import Task

REPEATS = 3
"""Number of measurements, of which the median counts; one more comes first, which fills caches."""
T = TypeVar("T")
"""Type of the result of a stage."""


def measure(job: dict[str, Any]) -> dict[str, Any]:
    """Measure all stages on one map.

    Args:
        job: Folder of the map as `map`, the change as `task`, autoencoder as `autoencoder`, and a
            word as `query`.

    Returns:
        CPU seconds by stage, memory in MiB, and numbers of results.
    """
    cv2.setNumThreads(1)
    folder, task = Path(job["map"]), Task.model_validate_json(json.dumps(job["task"]))
    seconds: dict[str, float] = {}
    with open_map(folder, writable=True) as store:
        gaussian_map = _once(seconds, "open", store.read)
        cameras = list(cameras_of_map(folder).values())
        detector = _once(
            seconds,
            "index",
            lambda: ChangeDetector(gaussian_map, DetectionConfig(threads=1), cameras=cameras),
        )
        robot = task.start(task.home.load(Path()), changed=True)
        frame = robot.observe()
        detection = _often(seconds, "detect", lambda: detector.detect(frame))
        landmarks = read_landmarks(folder, gaussian_map)
        relocalizer = Relocalizer(gaussian_map, landmarks, RelocalizationConfig(threads=1))
        found = _often(seconds, "localize", lambda: relocalizer.localize(frame))
        autoencoder = Path(job["autoencoder"])
        codec = read_autoencoder(autoencoder, autoencoder.stem)
        queries = _once(seconds, "words", lambda: SemanticQueries(gaussian_map, codec, Oracle()))
        objects = _often(seconds, "query", lambda: queries.find(job["query"]))
        config = UpdateConfig(threads=1)
        collected_s = [time.process_time()]

        def progress(stage: Stage) -> None:
            if stage == "collecting":
                collected_s.append(time.process_time())

        result = integrate_changes(
            gaussian_map,
            cameras,
            detection.changes,
            robot,
            config,
            detector=detector,
            progress=progress,
        )
        seconds["update"] = time.process_time() - collected_s[-1]
        _once(
            seconds, "commit", lambda: publish(store, gaussian_map, cameras, result, config, None)
        )
    return {
        "gaussians": gaussian_map.size,
        "seconds": seconds,
        "memory_mib": _peak_mib(),
        "changes": len(detection.changes),
        "located": found.status,
        "objects": len(objects),
        "rejected": result.rejected,
    }


def _peak_mib() -> float:
    """Return the maximum resident memory; that of `getrusage` may be of the parent process."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    (peak,) = (line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(peak) / 1024


def _once(seconds: dict[str, float], stage: str, call: Callable[[], T]) -> T:
    """Call a function and note its CPU time."""
    start_s = time.process_time()
    result = call()
    seconds[stage] = time.process_time() - start_s
    return result


def _often(seconds: dict[str, float], stage: str, call: Callable[[], T]) -> T:
    """Call a function several times, and note the CPU time of the first one and the median."""
    result = _once(seconds, f"first {stage}", call)
    times_s = []
    for _ in range(REPEATS):
        result = _once(seconds, stage, call)
        times_s.append(seconds[stage])
    seconds[stage] = median(times_s)
    return result


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measure(json.loads(Path(sys.argv[1]).read_text()))))
