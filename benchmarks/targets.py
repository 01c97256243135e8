"""Targets of the rasterizer beside measured values; results/rasterizer.md explains them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cpp_benchmark import CppResults, Timing

AVX512_MS = {
    "forward": {"S": 3.0, "M": 12.0, "L": 55.0},
    "forward_backward": {"S": 8.0, "M": 30.0, "L": 135.0},
}
"""Maximum ms on one core, SH degree 0, with AVX-512 on a core of the reference peak."""
TRAINING_MS = {
    ("photometric_loss", 1): {"S": 0.8, "M": 2.5, "L": 10.0},
    ("train", 1): {"M": 35.0},
    ("train", 2): {"M": 20.0},
}
"""The same of parts of training, by number of threads."""
REFERENCE_LANES_PER_S = {"AVX-512": 119e9, "AVX2": 59.5e9}
"""Float multiply-adds per second of a core of the machine on which the targets were set."""
SLOWDOWN = {"AVX-512": 1.0, "AVX2": 1.6}
"""Maximum ratio of times to those with AVX-512."""
MAX_LIFT_SHARE = 3.0
"""Maximum ratio of back-projecting 32 channels to a forward pass."""
MAX_ADAM_NS = 5.0
"""Maximum time of Adam per parameter of a visible Gaussian."""
PARAMETERS_SH0 = 14
"""Number of parameters of a Gaussian with SH degree 0."""
MAX_REGION_FIT_S = 1.0
"""Maximum time of 250 training steps on a tenth of the pixels of M."""
MIN_SPEEDUP = 1.8
"""Minimum speed-up of two threads."""
MAX_REGION_SHARE = 0.15
"""Maximum ratio of the time for a tenth of the pixels to that for all."""


MAX_TORCH_RATIO = 1.25
"""Maximum ratio of the time through PyTorch to that in C++."""


@dataclass(frozen=True)
class Verdict:
    """A measured value beside its target, both in `unit`."""

    what: str
    measured: float
    target: float
    unit: str
    at_least: bool = False
    """True if the value must reach the target instead of staying within it."""

    @property
    def met(self) -> bool:
        """True if the target is met."""
        return self.measured >= self.target if self.at_least else self.measured <= self.target


def simd_family(simd_target: str) -> str:
    """Return the name of an instruction set in the targets."""
    return {"avx512": "AVX-512", "avx2": "AVX2"}.get(simd_target, simd_target)


def find(timings: Sequence[Timing], case: str, workload: str, threads: int = 1) -> float | None:
    """Return the median with SH degree 0, ms; None if it was not measured."""
    for timing in timings:
        if (timing.case, timing.workload, timing.sh_degree, timing.threads) == (
            case,
            workload,
            0,
            threads,
        ):
            return timing.median_ms
    return None


def time_verdicts(results: CppResults) -> list[Verdict]:
    """Compare times with targets scaled to this core's peak."""
    family = simd_family(results.simd_target)
    if family not in SLOWDOWN or 1 not in results.fma_lanes_per_s:
        return []
    scale = SLOWDOWN[family] * REFERENCE_LANES_PER_S[family] / results.fma_lanes_per_s[1]
    cases = {(case, 1): targets for case, targets in AVX512_MS.items()} | TRAINING_MS
    return [
        Verdict(
            f"{family}: {case} {workload}" + (f", {threads} threads" if threads > 1 else ""),
            measured,
            scale * target,
            "ms",
        )
        for (case, threads), targets in cases.items()
        for workload, target in targets.items()
        if (measured := find(results.timings, case, workload, threads)) is not None
    ]


def speedup_verdicts(results: CppResults) -> list[Verdict]:
    """Compare two threads with one."""
    verdicts = []
    for case in AVX512_MS:
        for workload in ("M", "L"):
            single, two = (find(results.timings, case, workload, threads) for threads in (1, 2))
            if single and two:
                what = f"two threads over one: {case} {workload}"
                verdicts.append(Verdict(what, single / two, MIN_SPEEDUP, "x", at_least=True))
    return verdicts


def region_verdicts(results: CppResults) -> list[Verdict]:
    """Compare a masked tenth of the pixels with the full image."""
    verdicts = []
    for case, targets in AVX512_MS.items():
        for workload in targets:
            full = find(results.timings, case, workload)
            region = find(results.timings, f"region_{case}", workload)
            if full and region:
                what = f"region of 10 % over all: {case} {workload}"
                verdicts.append(Verdict(what, 100 * region / full, 100 * MAX_REGION_SHARE, "%"))
    return verdicts


def training_verdicts(results: CppResults) -> list[Verdict]:
    """Compare back-projection, Adam and a local fit with their targets."""
    verdicts = []
    for workload in ("S", "M", "L"):
        forward = find(results.timings, "forward", workload)
        lift = find(results.timings, "lift32", workload)
        if forward and lift:
            what = f"lifting 32 channels over forward: {workload}"
            verdicts.append(Verdict(what, lift / forward, MAX_LIFT_SHARE, "x"))
        adam = find(results.timings, "adam", workload)
        visible = next((t.visible for t in results.timings if t.workload == workload), 0)
        if adam and visible:
            nanoseconds = 1e6 * adam / (visible * PARAMETERS_SH0)
            what = f"Adam per parameter: {workload}"
            verdicts.append(Verdict(what, nanoseconds, MAX_ADAM_NS, "ns"))
    for threads in (1, 2):
        iteration = find(results.timings, "region_train", "M", threads)
        if iteration:
            what = f"250 iterations on a region of 10 %: M, {threads} thread(s)"
            verdicts.append(Verdict(what, 0.25 * iteration, MAX_REGION_FIT_S, "s"))
    return verdicts


def torch_verdicts(timings: Sequence[Timing], results: CppResults) -> list[Verdict]:
    """Compare PyTorch with C++ on M, one thread."""
    verdicts = []
    for case in AVX512_MS:
        torch, cpp = find(timings, case, "M"), find(results.timings, case, "M")
        if torch and cpp:
            verdicts.append(
                Verdict(f"PyTorch over C++: {case} M", torch / cpp, MAX_TORCH_RATIO, "x")
            )
    return verdicts


def memory_verdicts(memory: Sequence[dict[str, float]]) -> list[Verdict]:
    """Compare peak memory with 300 bytes per visible Gaussian and 64 per pixel."""
    return [
        Verdict(
            f"memory: {use['workload']}, SH {use['sh']}, {use['threads']} thread(s)",
            use["peak_bytes"] / 1e6,
            use["bound_bytes"] / 1e6,
            "MB",
        )
        for use in memory
    ]
