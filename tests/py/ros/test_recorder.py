"""Frames of a running robot are recorded; what goes wrong is a problem, and recording goes on."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from gslts.core.camera import camera_from_fov
from gslts.core.frame import Labels, RgbdFrame
from gslts.datasets.recording import RecordingWriter
from gslts.ros.problems import Problems
from gslts.ros.recorder import Recorder

FRAME = RgbdFrame(
    np.zeros((6, 8, 3), np.uint8),
    np.ones((6, 8), np.float32),
    camera_from_fov(8, 6, 1.0, np.eye(4)),
)


def test_a_frame_that_cannot_be_recorded_is_a_problem(tmp_path: Path) -> None:
    said: list[str] = []
    recorder = Recorder(tmp_path, Problems(said.append))
    (tmp_path / "objects.json").write_text("damaged")
    recorder.add(replace(FRAME, labels=Labels(np.zeros((6, 8), np.int32), ("Mug",))))
    recorder.add(FRAME)
    recorder.close()
    assert len(said) == 1
    assert said[0].startswith(f"recording: {tmp_path / 'objects.json'}: ")
    assert RecordingWriter(tmp_path).count == 1
