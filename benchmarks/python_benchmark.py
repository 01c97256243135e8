"""Times of gslts as Python programs call it, through NumPy and through PyTorch."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from statistics import median

import numpy as np
from cpp_benchmark import Timing
from numpy.typing import NDArray

from gslts.core.gaussian_map import SH_C0
from gslts_bench.synthetic_rooms import NEAR_PLANE_M, Room, make_room

Calls = dict[str, Callable[[], object]]
"""Functions by case: forward, and forward with backward, on one thread with SH degree 0."""


def ms_a_call(call: Callable[[], object], least_seconds: float) -> tuple[float, float]:
    """Return mean wall-clock and processor time, ms, over the calls that fill the given time."""
    calls, start, cpu_start = 0, time.perf_counter(), time.thread_time()
    while True:
        call()
        calls += 1
        elapsed = time.perf_counter() - start
        if elapsed >= least_seconds:
            return 1e3 * elapsed / calls, 1e3 * (time.thread_time() - cpu_start) / calls


def image_gradients(room: Room) -> dict[str, NDArray[np.float32]]:
    """Make gradients of a loss that depends on colour, depth and alpha."""
    rng = np.random.default_rng(1)
    size = (room.camera.height, room.camera.width)
    return {
        "dL_drgb": rng.uniform(-0.5, 0.5, (*size, 3)).astype(np.float32),
        "dL_ddepth": rng.uniform(-0.5, 0.5, size).astype(np.float32),
        "dL_dalpha": rng.uniform(-0.5, 0.5, size).astype(np.float32),
    }


def numpy_calls(room: Room) -> Calls:
    """Make calls of `gslts.Rasterizer` with the work of the C++ benchmark."""
    import gslts

    full, camera = room.gaussian_map, room.camera
    gaussian_map = gslts.GaussianMap(
        means=full.means,
        quats=full.quats,
        log_scales=full.log_scales,
        logit_opacities=full.logit_opacities,
        sh=full.sh[:, :1],
    )
    options = gslts.RenderOptions(near_m=NEAR_PLANE_M, alpha_min=1 / 255, threads=1)
    gradients = image_gradients(room)
    rasterizer = gslts.Rasterizer(np.float32)

    def forward() -> object:
        return rasterizer.forward(gaussian_map, camera, options)

    def forward_backward() -> object:
        return forward(), rasterizer.backward(**gradients)

    return {"forward": forward, "forward_backward": forward_backward}


def torch_calls(room: Room) -> Calls:
    """Make calls of `gslts.torch.rasterization` for colours and alpha, without depth."""
    import torch

    from gslts.torch import rasterization

    torch.set_num_threads(1)
    full, camera = room.gaussian_map, room.camera
    arrays = {
        "means": full.means.copy(),
        "quats": full.quats.copy(),
        "scales": np.exp(full.log_scales),
        "opacities": 1 / (1 + np.exp(-full.logit_opacities)),
        "colors": 0.5 + np.float32(SH_C0) * full.sh[:, 0],
        "viewmats": np.linalg.inv(camera.world_from_camera)[None].astype(np.float32),
    }
    inputs = {name: torch.from_numpy(array).requires_grad_() for name, array in arrays.items()}
    K = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
    view = {
        "Ks": torch.tensor([K], dtype=torch.float32),
        "width": camera.width,
        "height": camera.height,
        "near_plane": NEAR_PLANE_M,
    }
    gradients = image_gradients(room)
    dL_dimage = torch.from_numpy(gradients["dL_drgb"])[None]
    dL_dalpha = torch.from_numpy(gradients["dL_dalpha"])[None, ..., None]

    def forward() -> object:
        with torch.no_grad():
            return rasterization(**inputs, **view)

    def forward_backward() -> object:
        image, alpha, _ = rasterization(**inputs, **view)
        return torch.autograd.grad((image, alpha), list(inputs.values()), (dL_dimage, dL_dalpha))

    return {"forward": forward, "forward_backward": forward_backward}


def run_timings(
    make_calls: Callable[[Room], Calls], names: list[str], repetitions: int, seconds: float
) -> list[Timing]:
    """Time the calls for each workload on one thread, where overhead matters most."""
    timings = []
    for name in names:
        for case, call in make_calls(make_room(name)).items():
            call()
            wall, cpu = zip(*(ms_a_call(call, seconds) for _ in range(repetitions)), strict=True)
            timings.append(
                Timing(
                    case=case,
                    workload=name,
                    sh_degree=0,
                    threads=1,
                    median_ms=median(wall),
                    min_ms=min(wall),
                    max_ms=max(wall),
                    median_cpu_ms=median(cpu),
                    repetitions=repetitions,
                )
            )
            what = f"{make_calls.__name__} {case}/{name}"
            print(f"{what}: {timings[-1].median_ms:.2f} ms", file=sys.stderr)
    return timings
