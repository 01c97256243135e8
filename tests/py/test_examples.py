"""The demo runs, and a short fit already makes the pictures better."""

import json
import subprocess
import sys
from pathlib import Path

DEMO = Path(__file__).parents[2] / "examples" / "fit_scene.py"


def test_demo_improves_the_views_kept_aside(tmp_path):
    command = [sys.executable, str(DEMO), "--iterations", "120", "--out", str(tmp_path)]
    output = subprocess.run(command, check=True, capture_output=True, text=True, timeout=300).stdout
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["psnr_db_after"] > metrics["psnr_db_before"] + 5
    assert metrics["depth_error_m_after"] < metrics["depth_error_m_before"]
    assert (tmp_path / "before_after.png").stat().st_size > 10_000
    assert str(tmp_path / "before_after.png") in output
