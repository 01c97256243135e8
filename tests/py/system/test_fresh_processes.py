"""Rendering, imports and homes in processes that have just started."""

import multiprocessing
import subprocess
import sys
from pathlib import Path

import home_checks
import numpy as np
import pytest
import scenes
from command import LONG_S
from home_checks import digest

from gslts_sim import make_home


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_child_renders_what_its_parent_renders(method):
    expected = scenes.render_bytes(2)  # The pool has started before the child does.
    with multiprocessing.get_context(method).Pool(1) as pool:
        assert pool.apply_async(scenes.render_bytes, (2,)).get(timeout=LONG_S) == expected
    assert scenes.render_bytes(2) == expected


def test_the_package_is_imported_only_to_start_it() -> None:
    code = "import sys, gslts_sim.thor.robot; sys.exit('ai2thor' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_gslts_alone_does_not_import_torch():
    code = "import sys, gslts; sys.exit('torch' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_run_is_quiet_beside_other_libraries() -> None:
    """OpenCV, torch and PCL in one process; nothing is printed."""
    script = (
        "import torch, cv2, numpy as np\n"
        "from gslts._core.reloc import CloudRule, register_clouds\n"
        "points = np.random.default_rng(0).uniform(0, 1, (3000, 3)).astype(np.float32)\n"
        "points[:, 2] = 0\n"
        "found = register_clouds(points, points, np.eye(4), rule=CloudRule())\n"
        "assert found.overlap == 1\n"
        "torch.ones(1000, 100) @ torch.ones(100, 100)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_same_seed_same_home():
    code = (
        "from home_checks import digest\nfrom gslts_sim import make_home\n"
        "print(digest(make_home('living_room', 7)))"
    )
    environment = {
        "PYTHONHASHSEED": "1",
        "PYTHONPATH": str(Path(home_checks.__file__).parent),
    }
    fresh = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment
    ).stdout.strip()
    assert digest(make_home("living_room", 7)) == fresh
    assert digest(make_home("living_room", np.int64(7))) == fresh
    assert digest(make_home("living_room", 8)) != fresh
