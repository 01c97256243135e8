"""CPU time of short commands as the machine is and with AVX2 alone; prints a markdown table.

make demo && python benchmarks/startup_benchmark.py    # half a minute
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path
from statistics import median

from instruction_sets import AVX2_ONLY

DEMO = Path("demo")
"""What `make demo` leaves: a map with semantics, and recordings."""
RUNS = 5
"""Runs of each command, after one to warm up."""


def commands() -> list[list[str]]:
    """Return the commands of the table."""
    image = sorted((DEMO / "before" / "images").iterdir())[0]
    map_folder = str(DEMO / "map")
    return [
        ["--help"],
        ["log", map_folder],
        ["query", map_folder, "ottoman"],
        ["localize", map_folder, str(image)],
    ]


def cpu_s(words: list[str], variables: dict[str, str]) -> float:
    """Return the CPU time of one command, s."""

    def used() -> float:
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    before = used()
    subprocess.run(
        [sys.executable, "-c", "from gslts.cli import main; main()", *words],
        env={**os.environ, **variables},
        stdout=subprocess.DEVNULL,
        check=True,
    )
    return used() - before


def main() -> None:
    avx2 = {name: value for variables in AVX2_ONLY.values() for name, value in variables.items()}
    print("| command | CPU, as it is | CPU, AVX2 |\n| :-- | --: | --: |")
    for words in commands():
        times = []
        for variables in ({}, avx2):
            times.append(median([cpu_s(words, variables) for _ in range(RUNS + 1)][1:]))
        print(f"| `gslts {words[0]}` | {times[0]:.2f} s | {times[1]:.2f} s |", flush=True)


if __name__ == "__main__":
    main()
