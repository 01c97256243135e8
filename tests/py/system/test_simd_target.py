"""The instruction set of the kernels can be named from outside."""

import os
import subprocess
import sys

import pytest

from gslts._core import simd

pytestmark = pytest.mark.smoke

RENDER = """
import numpy as np
import gslts
from gslts._core import simd

gslts.Rasterizer(np.float32)
print(simd.target())
"""


def run(command: list[str], simd: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "GSLTS_SIMD": simd}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def gslts(*words: str, simd: str) -> subprocess.CompletedProcess[str]:
    program = "from gslts.cli import main; main()"
    return run([sys.executable, "-c", program, *words], simd)


@pytest.mark.parametrize("name", simd.targets())
def test_the_variable_restricts_the_kernels(name: str) -> None:
    assert run([sys.executable, "-c", RENDER], name).stdout.strip() == name
    assert gslts("--version", simd=name).stdout.strip().endswith(f"({name})")


def test_an_empty_variable_restricts_nothing() -> None:
    if "GSLTS_SIMD" in os.environ:
        pytest.skip("these tests run restricted")
    assert run([sys.executable, "-c", RENDER], "").stdout.strip() == simd.target()


@pytest.mark.parametrize("name", ["avx1024", "AVX2", "neon"])
def test_other_names_are_rejected_in_one_line(name: str) -> None:
    if name in simd.targets():
        pytest.skip(f"this machine can use {name}")
    message = f'GSLTS_SIMD is "{name}", but this machine can use {", ".join(simd.targets())}'
    rejected = gslts("--version", simd=name)
    assert (rejected.returncode, rejected.stderr, rejected.stdout) == (1, f"gslts: {message}\n", "")
    assert message in run([sys.executable, "-c", RENDER], name).stderr
