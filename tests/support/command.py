"""Runs the command `gslts` as a user does, in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path


def gslts(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder, without colours and 200 columns wide."""
    program = "import sys; from gslts.cli import main; sys.argv[0] = 'gslts'; main()"
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        cwd=cwd,
        text=True,
        capture_output=True,
        check=False,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "200"},
    )
