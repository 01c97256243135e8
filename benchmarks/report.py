"""Tables of the rasterizer's benchmark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cpp_benchmark import CppResults, Timing
from targets import Verdict, simd_family

from gslts_bench.tables import Table


def build_table(runs: Sequence[CppResults]) -> Table:
    """Tabulate compiler and multiply-add peaks."""
    build = runs[0].build
    rows = [["compiler", f"{build['compiler']}, {build['build_type']}, {build['flags']}"]]
    for run in runs:
        family = simd_family(run.simd_target)
        for threads, rate in sorted(run.fma_lanes_per_s.items()):
            name = f"float multiply-add peak, {family}, {threads} thread(s)"
            rows.append([name, f"{rate / 1e9:.0f} G lanes/s"])
    return Table("Build", ["", ""], rows)


def timing_table(run: CppResults) -> Table:
    """Tabulate all timings of one run, ms."""
    rows = [
        [
            f"{t.case} {t.workload}",
            str(t.sh_degree),
            str(t.threads),
            f"{t.median_ms:.2f}",
            f"{t.min_ms:.2f}",
            f"{t.max_ms:.2f}",
            f"{t.median_cpu_ms:.2f}",
        ]
        for t in run.timings
    ]
    header = ["", "SH", "threads", "median ms", "min", "max", "CPU of caller"]
    return Table(f"Times, {simd_family(run.simd_target)}", header, rows)


def python_table(title: str, python: Sequence[Timing], cpp: Sequence[Timing]) -> Table:
    """Tabulate Python calls beside the same work in C++, one thread, SH degree 0.

    Args:
        title: Heading.
        python: Timings of the calls; empty if they were not measured.
        cpp: Timings of the C++ benchmark.
    """
    same_work = {(t.case, t.workload): t for t in cpp if (t.sh_degree, t.threads) == (0, 1)}
    rows = []
    for t in python:
        in_cpp = same_work[t.case, t.workload]
        rows.append(
            [
                f"{t.case} {t.workload}",
                f"{t.median_ms:.2f}",
                f"{in_cpp.median_ms:.2f}",
                f"{t.median_ms - in_cpp.median_ms:+.2f}",
                f"{t.median_cpu_ms - in_cpp.median_cpu_ms:+.2f}",
            ]
        )
    header = ["", "Python ms", "C++ ms", "difference", "in CPU time"]
    return Table(title, header, rows, "" if rows else "Not measured.")


def memory_table(memory: Sequence[dict[str, Any]]) -> Table:
    """Tabulate peak memory and its parts."""
    rows = []
    for use in memory:
        peak, returned = use["peak_bytes"], use["returned_bytes"]
        rows.append(
            [
                f"{use['workload']}, SH {use['sh']}, {use['threads']} thread(s)",
                f"{peak / 1e6:.1f}",
                f"{returned / 1e6:.1f}",
                f"{(peak - returned) / 1e6:.1f}",
                f"{use['bound_bytes'] / 1e6:.1f}",
                f"{peak / use['visible']:.0f}",
                f"{peak / use['pixels']:.0f}",
            ]
        )
    header = ["", "peak MB", "of it results", "of it working", "bound", "B/visible", "B/pixel"]
    return Table("Memory", header, rows)


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Tabulate all targets with the measured values."""
    rows = [
        [
            v.what,
            f"{v.measured:.2f} {v.unit}",
            f"{'>=' if v.at_least else '<='} {v.target:.2f} {v.unit}",
            "met" if v.met else "**not met**",
        ]
        for v in verdicts
    ]
    return Table("Targets", ["", "measured", "target", ""], rows)
