"""First map of a home, from frames that the robot records on its way."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from gslts.datasets.recording import RecordingWriter

MIN_FRAMES = 20
"""Minimum number of frames of a map: fewer do not hold out any for validation and test."""
POLL_S = 0.2
"""Time between two tests if a stop was requested, s."""


def recording_of(map_path: Path, record: Path | None) -> Path:
    """Return the folder of the recording from which a map is built.

    Args:
        map_path: Folder of the map.
        record: Folder that the user gave; None for one beside the map.
    """
    return record or map_path.with_name(f"{map_path.name}.recording")


def build_map(
    recording: Path,
    map_path: Path,
    threads: int,
    stop: threading.Event,
    log: Callable[[str], None],
) -> None:
    """Build a map from a recording with the commands of gslts, in processes of their own.

    A stop ends them; the next build continues.

    Args:
        recording: Data set.
        map_path: New folder.
        threads: 0 uses all hardware threads.
        stop: Set if the node should end.
        log: Called with one line for each step.

    Raises:
        ValueError: The recording has too few frames.
        RuntimeError: A command failed, or a stop was requested.
    """
    count = RecordingWriter(recording).count
    if count < MIN_FRAMES:
        raise ValueError(
            f"{recording}: {count} frames, a map needs {MIN_FRAMES}: drive on, then build again"
        )
    log(f"building {map_path} from {count} frames")
    resume = ["--resume"] if map_path.with_name(f"{map_path.name}.checkpoint.npz").exists() else []
    arguments = ["--preset", "fast", "--threads", str(threads), "--poses", "correct", *resume]
    _run("map", str(recording), "--out", str(map_path), *arguments, stop=stop)
    if (recording / "objects.json").exists():
        log(f"building {map_path}: words")
        _run("semantics", str(map_path), str(recording), "--source", "oracle", stop=stop)


def _run(command: str, *arguments: str, stop: threading.Event) -> None:
    """Run a command of gslts in a process; end it with SIGTERM if a stop is requested."""
    process = subprocess.Popen([sys.executable, "-m", "gslts", command, *arguments])
    try:
        while process.poll() is None:
            if stop.wait(POLL_S):
                raise RuntimeError(f"gslts {command} was stopped; the next build continues it")
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait()
    if process.returncode != 0:
        raise RuntimeError(f"gslts {command} failed with exit status {process.returncode}")
