"""The examples run, and a short fit already improves the images."""

import json
import re
import subprocess
import sys
from pathlib import Path

from drawn import assert_drawn

EXAMPLES = Path(__file__).parents[3] / "examples"


def run_example(name: str, *arguments: str) -> str:
    """Run an example; return what it prints."""
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def test_demo_improves_the_held_out_views(tmp_path):
    output = run_example("fit_scene.py", "--iterations", "120", "--out", str(tmp_path))
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["psnr_db_after"] > metrics["psnr_db_before"] + 5
    assert metrics["depth_error_m_after"] < metrics["depth_error_m_before"]
    assert_drawn(tmp_path / "before_after.png")
    assert str(tmp_path / "before_after.png") in output


def test_training_with_torch_improves_the_held_out_views(tmp_path):
    output = run_example(
        "train_torch.py", "--gaussians", "4000", "--iterations", "120", "--out", str(tmp_path)
    )
    before, after = map(float, re.search(r"from ([\d.]+) to ([\d.]+) dB", output).groups())
    assert after > before + 5
    assert_drawn(tmp_path / "before_after.png")
