"""Measures the rasterizer on fixed workloads and compares the results with the targets.

Writes build/bench/results.json and prints Markdown tables; progress goes to stderr.

    python benchmarks/run.py            # some minutes; leave the machine alone meanwhile
    python benchmarks/run.py --quick    # S and M, two short repetitions: to see that all works
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cpp_benchmark
import python_benchmark
import report
import targets
from cpp_benchmark import Timing
from workloads import FOLDER, REPOSITORY, workload_path, write_workload

from gslts_bench.provenance import describe_run
from gslts_bench.synthetic_rooms import SIZES, make_room
from gslts_bench.tables import result_markdown

BUILD = REPOSITORY / "build" / "bench"
BINARY = BUILD / "benchmarks" / "gslts_raster_benchmark"
MIN_REPETITIONS = 9
"""Minimum number of repetitions: fewer give no stable median on a machine with other work."""
BUSY_LOAD = 0.5
"""Load average above which other programs disturb the measurement."""


def note(message: str) -> None:
    """Print a message to stderr."""
    print(message, file=sys.stderr, flush=True)


def write_missing_workloads(names: list[str]) -> None:
    """Generate the workloads that are missing or older than the generator."""
    generator = Path(__file__).with_name("workloads.py").stat().st_mtime
    for name in names:
        path = workload_path(name)
        if not path.exists() or path.stat().st_mtime < generator:
            note(f"generating workload {name}")
            write_workload(make_room(name), path)


def measure(args: argparse.Namespace) -> dict[str, Any]:
    """Run all benchmarks; return the result as JSON values with tables."""
    names = ["S", "M"] if args.quick else list(SIZES)
    repetitions, seconds = (2, 0.05) if args.quick else (args.repetitions, 0.3)
    origin = describe_run()
    load = origin["machine"]["load_average_1min"]
    if load > BUSY_LOAD:
        note(f"warning: the load average is {load:.2f}; close other programs")
    write_missing_workloads(names)

    any_name = f"({'|'.join(names)})"
    native = cpp_benchmark.run_timings(
        args.binary, FOLDER, "", f"fma_peak|/{any_name}/", repetitions, seconds
    )
    runs = [native]
    if native.simd_target == "avx512":
        one_core = f"fma_peak|^forward(_backward)?/{any_name}/sh:0/threads:1/"
        runs.append(
            cpp_benchmark.run_timings(args.binary, FOLDER, "avx2", one_core, repetitions, seconds)
        )
    python: list[Timing] = []
    in_torch: list[Timing] = []
    if importlib.util.find_spec("gslts") is None:
        note("gslts is not installed in this Python: its calls are not measured")
    else:
        time_calls = python_benchmark.run_timings
        python = time_calls(python_benchmark.numpy_calls, names, repetitions, seconds)
        in_torch = time_calls(python_benchmark.torch_calls, names, repetitions, seconds)
    note("measuring memory")
    memory = [
        cpp_benchmark.run_memory(args.binary, FOLDER, name, sh_degree, threads)
        for name in names
        for sh_degree in (0, 3)
        for threads in (1, 2)
    ]

    verdicts = [verdict for run in runs for verdict in targets.time_verdicts(run)]
    verdicts += targets.speedup_verdicts(native) + targets.region_verdicts(native)
    verdicts += targets.training_verdicts(native) + targets.torch_verdicts(in_torch, native)
    verdicts += targets.memory_verdicts(memory)
    tables = [
        report.build_table(runs),
        report.verdict_table(verdicts),
        *(report.timing_table(run) for run in runs),
        report.python_table("Python calls", python, native.timings),
        report.python_table("PyTorch calls", in_torch, native.timings),
        report.memory_table(memory),
    ]
    return {
        "title": "Rasterizer",
        **origin,
        "tables": [asdict(table) for table in tables],
        "quick": args.quick,
        "cpp": [asdict(run) for run in runs],
        "python": [asdict(timing) for timing in python],
        "torch": [asdict(timing) for timing in in_torch],
        "memory": memory,
        "targets": [{**asdict(verdict), "met": verdict.met} for verdict in verdicts],
    }


def main() -> None:
    """Measure, print the tables and write the JSON."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a short run without L; not a result")
    parser.add_argument("--repetitions", type=int, default=MIN_REPETITIONS, help="at least 9")
    parser.add_argument("--binary", type=Path, default=BINARY, help="gslts_raster_benchmark")
    parser.add_argument("--out", type=Path, default=BUILD / "results.json")
    args = parser.parse_args()
    if args.repetitions < MIN_REPETITIONS:
        parser.error(f"--repetitions must be at least {MIN_REPETITIONS}, got {args.repetitions}")
    if not os.access(args.binary, os.X_OK):
        sys.exit(
            f"run.py: {args.binary} does not exist; build it with `cmake --build --preset bench`"
        )
    result = measure(args)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    args.out.write_text(json.dumps(result, indent=2) + "\n")
    print(result_markdown(result))
    note(f"wrote {args.out}")


if __name__ == "__main__":
    main()
