"""Times `gslts.Rasterizer` as a Python program calls it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from statistics import median

import numpy as np
from cpp_benchmark import Timing

import gslts
from gslts.bench.rooms import NEAR_M, Room, make_room


def ms_a_call(call: Callable[[], object], least_seconds: float) -> tuple[float, float]:
    """Mean wall-clock and processor time, ms, over as many calls as fill the given time."""
    calls, start, cpu_start = 0, time.perf_counter(), time.thread_time()
    while True:
        call()
        calls += 1
        elapsed = time.perf_counter() - start
        if elapsed >= least_seconds:
            return 1e3 * elapsed / calls, 1e3 * (time.thread_time() - cpu_start) / calls


def time_room(
    name: str, room: Room, threads: int, repetitions: int, seconds: float
) -> list[Timing]:
    """Times forward, and forward with backward, with SH degree 0, as the C++ benchmark does."""
    full, camera = room.gaussian_map, room.camera
    gaussian_map = gslts.GaussianMap(
        means=full.means,
        quats=full.quats,
        log_scales=full.log_scales,
        logit_opacities=full.logit_opacities,
        sh=full.sh[:, :1],
    )
    options = gslts.RenderOptions(near_m=NEAR_M, alpha_min=1 / 255, threads=threads)
    rng = np.random.default_rng(1)
    size = (camera.height, camera.width)
    dL_drgb = rng.uniform(-0.5, 0.5, (*size, 3)).astype(np.float32)
    dL_ddepth = rng.uniform(-0.5, 0.5, size).astype(np.float32)
    dL_dalpha = rng.uniform(-0.5, 0.5, size).astype(np.float32)
    rasterizer = gslts.Rasterizer(np.float32)

    def forward() -> object:
        return rasterizer.forward(gaussian_map, camera, options)

    def forward_backward() -> object:
        images = rasterizer.forward(gaussian_map, camera, options)
        gradients = rasterizer.backward(dL_drgb=dL_drgb, dL_ddepth=dL_ddepth, dL_dalpha=dL_dalpha)
        return images, gradients

    timings = []
    for case, call in (("forward", forward), ("forward_backward", forward_backward)):
        call()
        wall, cpu = zip(*(ms_a_call(call, seconds) for _ in range(repetitions)), strict=True)
        timings.append(
            Timing(
                case=case,
                workload=name,
                sh_degree=0,
                threads=threads,
                median_ms=median(wall),
                min_ms=min(wall),
                max_ms=max(wall),
                median_cpu_ms=median(cpu),
                repetitions=repetitions,
            )
        )
        print(f"python {case}/{name}: {timings[-1].median_ms:.2f} ms", file=sys.stderr)
    return timings


def run_timings(names: list[str], repetitions: int, seconds: float) -> list[Timing]:
    """Times each room on one thread, where a call's overhead weighs most."""
    return [
        timing
        for name in names
        for timing in time_room(name, make_room(name), 1, repetitions, seconds)
    ]
