"""A processor that the kernels are not compiled for, emulated by QEMU."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gslts

pytestmark = pytest.mark.skipif(
    shutil.which("qemu-x86_64") is None, reason="qemu-user is not installed"
)

PACKAGE = Path(gslts.__file__).parent


def run(processor: str) -> subprocess.CompletedProcess[str]:
    """Import the check of the processor, without anything beside it."""
    code = f"import sys; sys.path.insert(0, {str(PACKAGE)!r}); import _cpu"
    command = ["qemu-x86_64", "-cpu", processor, sys.executable, "-S", "-E", "-c", code]
    return subprocess.run(command, text=True, capture_output=True, check=False)


def test_an_old_processor_is_named_in_a_line() -> None:
    done = run("core2duo")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "ImportError: the processor must be x86-64 with SSE4.2, PCLMULQDQ and AES "
        "(Intel of 2010, AMD of 2011 or newer): this one has no SSE4.2"
    )


def test_the_oldest_processor_served_passes() -> None:
    assert run("Westmere").returncode == 0


def test_commands_end_with_the_line() -> None:
    command = ["qemu-x86_64", "-cpu", "core2duo", sys.executable, "-m", "gslts", "--version"]
    done = subprocess.run(command, text=True, capture_output=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("gslts: the processor must be x86-64 with SSE4.2")
    assert len(done.stderr.splitlines()) == 1
