"""Other programs that read and write Gaussians: splat-transform of PlayCanvas, and three.js.

Both are npm packages, which `scripts/setup` installs into `build/judges` where there is npm.
Node.js is that of the machine, or that of Playwright.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULES = Path(os.environ.get("GSLTS_JUDGES", ROOT / "build" / "judges")) / "node_modules"
CLI = MODULES / "@playcanvas" / "splat-transform" / "bin" / "cli.mjs"


def _node() -> str | None:
    found = shutil.which("node")
    if found is None:
        try:
            import playwright
        except ImportError:
            return None
        driver = Path(playwright.__file__).parent / "driver" / "node"
        found = str(driver) if driver.exists() else None
    return found


NODE = _node()
needs_judges = pytest.mark.skipif(
    NODE is None or not CLI.exists() or not (MODULES / "three").exists(),
    reason=f"Node.js, or splat-transform and three in {MODULES}, are missing: scripts/setup "
    "installs them where there is npm",
)


def splat_transform(source: Path, out: Path, *options: str) -> None:
    """Convert a file of Gaussians with splat-transform."""
    _run(str(CLI), "-q", "-w", "-g", "cpu", *options, str(source), str(out))


def three_reads(path: Path) -> dict[str, Any]:
    """Read a .glb file with three.js: see `read_glb.mjs`."""
    script = Path(__file__).parent / "read_glb.mjs"
    result: dict[str, Any] = json.loads(_run(str(script), str(MODULES), str(path)))
    return result


def _run(*arguments: str) -> str:
    assert NODE is not None
    done = subprocess.run([NODE, *arguments], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout
