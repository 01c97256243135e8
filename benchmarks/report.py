"""The results as markdown tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cpp_benchmark import CppResults, Timing
from targets import Verdict, simd_family


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A markdown table; all columns but the first are numbers."""
    lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def machine_lines(
    machine: dict[str, Any], source: dict[str, Any], runs: Sequence[CppResults]
) -> str:
    """What was measured, where and when."""
    caches = ", ".join(f"{name} {size}" for name, size in machine["caches"].items())
    changed = ", with uncommitted changes" if source["changed_since"] else ""
    build = runs[0].build
    lines = [
        f"- {machine['cpu']}, {machine['cores']} cores, {caches}; "
        f"{machine['memory_bytes'] / 2**30:.0f} GiB; {machine['system']}",
        f"- {build['compiler']}, {build['build_type']}, flags {build['flags']}",
        f"- commit {source['commit'] or 'none'}{changed}, {source['date']}",
        f"- load average before the run: {machine['load_average_1min']:.2f}",
    ]
    for run in runs:
        peaks = ", ".join(
            f"{threads} thread(s) {rate / 1e9:.0f} G lanes/s"
            for threads, rate in sorted(run.fma_lanes_per_s.items())
        )
        family = simd_family(run.simd_target)
        lines.append(f"- float multiply-add peak, {family} ({run.simd_target}): {peaks}")
    return "\n".join(lines)


def timing_table(timings: Sequence[Timing]) -> str:
    """All timings of one run."""
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
        for t in timings
    ]
    return table(["", "SH", "threads", "median ms", "min", "max", "CPU of caller"], rows)


def python_table(python: Sequence[Timing], cpp: Sequence[Timing]) -> str:
    """Python calls beside the same work in C++, one thread, SH degree 0."""
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
    return table(["", "Python ms", "C++ ms", "difference", "in CPU time"], rows)


def memory_table(memory: Sequence[dict[str, Any]]) -> str:
    """Peak memory and its parts."""
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
    return table(header, rows)


def verdict_table(verdicts: Sequence[Verdict]) -> str:
    """Every target with what was measured."""
    rows = [
        [
            v.what,
            f"{v.measured:.2f} {v.unit}",
            f"{'>=' if v.at_least else '<='} {v.target:.2f} {v.unit}",
            "met" if v.met else "**not met**",
        ]
        for v in verdicts
    ]
    return table(["", "measured", "target", ""], rows)
