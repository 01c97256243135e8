"""Runs the C++ benchmark and reads its results."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any


@dataclass(frozen=True)
class Timing:
    """Milliseconds per call over repetitions, each a mean over many calls."""

    case: str
    """forward, forward_backward, region_..., float64_..., or a part of training"""
    workload: str
    sh_degree: int
    threads: int
    median_ms: float
    min_ms: float
    max_ms: float
    median_cpu_ms: float
    """Processor time of the calling thread; far below `median_ms` if others kept the core busy."""
    repetitions: int
    visible: int = 0
    """Gaussians in view."""


@dataclass(frozen=True)
class CppResults:
    """Run of the benchmark with one instruction set."""

    simd_target: str
    build: dict[str, str]
    fma_lanes_per_s: dict[int, float]
    """Maximum rate of all threads together, by number of threads."""
    timings: list[Timing]


def run_timings(
    binary: Path, workloads: Path, simd: str, filter_regex: str, repetitions: int, seconds: float
) -> CppResults:
    """Run the selected benchmarks; their progress goes to stderr.

    Args:
        binary: `gslts_raster_benchmark`.
        workloads: Folder that `workloads.py` wrote.
        simd: Instruction set, such as "avx2"; empty: the best that the machine has.
        filter_regex: Names to run, such as "forward/M/.*".
        repetitions: How often each benchmark is repeated; the median counts.
        seconds: Least time of one repetition.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "timings.json"
        command = [
            str(binary),
            f"--workloads={workloads}",
            *([f"--simd={simd}"] if simd else []),
            f"--benchmark_filter={filter_regex}",
            f"--benchmark_repetitions={repetitions}",
            f"--benchmark_min_time={seconds}",
            "--benchmark_display_aggregates_only=true",
            f"--benchmark_out={out}",
        ]
        subprocess.run(command, check=True, stdout=sys.stderr)
        return read_results(json.loads(out.read_text()))


def read_results(report: dict[str, Any]) -> CppResults:
    """Read the JSON of Google Benchmark."""
    context = report["context"]
    repetitions: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for run in report["benchmarks"]:
        if run.get("error_occurred"):
            raise RuntimeError(f"{run['name']}: {run['error_message']}")
        if run["run_type"] == "iteration":
            repetitions[run["run_name"]].append(run)
    fma = {
        runs[0]["threads"]: max(fma_rate(run) for run in runs)
        for name, runs in repetitions.items()
        if name.startswith("fma_peak")
    }
    return CppResults(
        simd_target=context["simd_target"],
        build={key: context[key].strip() for key in ("compiler", "build_type", "flags")},
        fma_lanes_per_s=fma,
        timings=[
            read_timing(name, runs)
            for name, runs in repetitions.items()
            if not name.startswith("fma_peak")
        ],
    )


def fma_rate(run: dict[str, Any]) -> float:
    """Read multiply-adds per second; on one thread, per second of processor time.

    Other programs must not lower the peak, because the targets would grow with it.
    """
    rate: float = run["fma_lanes_per_s"]
    return rate * run["real_time"] / run["cpu_time"] if run["threads"] == 1 else rate


def read_timing(name: str, runs: list[dict[str, Any]]) -> Timing:
    """Read the repetitions of a benchmark named case/workload/sh:degree/threads:n/real_time."""
    case, workload, sh_degree, threads, _ = name.split("/")
    times = [run["real_time"] for run in runs]
    return Timing(
        case=case,
        workload=workload,
        sh_degree=int(sh_degree.removeprefix("sh:")),
        threads=int(threads.removeprefix("threads:")),
        median_ms=median(times),
        min_ms=min(times),
        max_ms=max(times),
        median_cpu_ms=median(run["cpu_time"] for run in runs),
        repetitions=len(times),
        visible=int(runs[0]["visible"]),
    )


def run_memory(
    binary: Path, workloads: Path, name: str, sh_degree: int, threads: int
) -> dict[str, Any]:
    """Measure the memory of one render and its backward pass in a fresh process."""
    command = [
        str(binary),
        f"--workloads={workloads}",
        f"--memory={name}",
        f"--sh={sh_degree}",
        f"--threads={threads}",
    ]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    result: dict[str, Any] = json.loads(output)
    return result
