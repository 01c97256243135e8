"""Fits Gaussians to images of a room, from a rough start, and draws the result.

A furnished room is rendered with depth from two dozen viewpoints. Grey Gaussians, placed with an
error of several centimetres, are then optimized on these images by gradient descent: position,
shape, opacity and colour. Held-out views measure the quality of the result.
"""

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import room
from matplotlib.figure import Figure
from tqdm import tqdm

import gslts
from gslts.rendering.adam import AdamOptions
from gslts.rendering.rasterizer import Images

WIDTH, HEIGHT = 320, 240
TRAINING_VIEWS, HELD_OUT_VIEWS = 24, 4
GAUSSIANS = 16_000
DEPTH_WEIGHT = 0.3  # Of a metre of depth error against a unit of colour error.

# Learning rate by group of parameters: where it starts and the share of it left at the end.
LEARNING_RATES = {
    "means": (6e-3, 0.02),
    "quats": (2e-2, 0.1),
    "log_scales": (2e-2, 0.1),
    "logit_opacities": (5e-2, 0.1),
    "sh_dc": (3e-2, 0.1),
}


@dataclass(frozen=True)
class View:
    """A camera and the images that it observes."""

    camera: gslts.Camera
    target: Images


def rough_start(truth: gslts.GaussianMap, rng: np.random.Generator) -> gslts.GaussianMap:
    """Make round grey Gaussians near some of the true positions."""
    chosen = truth.select(rng.choice(truth.size, GAUSSIANS, replace=False))
    noise = rng.normal(0, 0.04, chosen.means.shape)
    return gslts.GaussianMap(
        means=(chosen.means + noise).astype(np.float32),
        quats=rng.normal(size=(GAUSSIANS, 4)).astype(np.float32),
        log_scales=np.log(rng.uniform(0.03, 0.08, (GAUSSIANS, 3))).astype(np.float32),
        logit_opacities=np.full(GAUSSIANS, -1, np.float32),
        sh=np.zeros((GAUSSIANS, 1, 3), np.float32),
    )


def rates_at(progress: float) -> gslts.AdamRates:
    """Return learning rates that fall exponentially from progress 0 to progress 1."""
    return gslts.AdamRates(
        **{name: start * left**progress for name, (start, left) in LEARNING_RATES.items()}
    )


def fit(
    start: gslts.GaussianMap,
    views: list[View],
    iterations: int,
    options: gslts.RenderOptions,
    rng: np.random.Generator,
) -> gslts.GaussianMap:
    """Optimize by gradient descent on one random view at a time."""
    rasterizer = gslts.Rasterizer(np.float32)
    adam = gslts.Adam(start, AdamOptions(beta2=0.99))
    order = np.concatenate(
        [rng.permutation(len(views)) for _ in range(iterations // len(views) + 1)]
    )
    for iteration in tqdm(range(iterations), desc="fitting", unit="view", mininterval=0.5):
        view = views[order[iteration]]
        images = rasterizer.forward(adam.map, view.camera, options)
        colour = gslts.losses.photometric_loss(images.rgb, view.target.rgb, threads=options.threads)
        depth = gslts.losses.depth_loss(images.depth, view.target.depth, threads=options.threads)
        gradients = rasterizer.backward(
            dL_drgb=colour.dL_drgb, dL_ddepth=np.float32(DEPTH_WEIGHT) * depth.dL_ddepth
        )
        adam.step(gradients, rates_at(iteration / iterations), threads=options.threads)
    return adam.map


def psnr_db(images: Images, target: Images) -> float:
    error = np.clip(images.rgb, 0, 1) - np.clip(target.rgb, 0, 1)
    return float(-10 * np.log10(np.mean(error**2)))


def depth_error_m(images: Images, target: Images) -> float:
    return float(np.mean(abs(images.depth - target.depth)))


def draw(path: Path, views: list[View], before: list[Images], after: list[Images]) -> None:
    """Draw target, before and after in columns; rows are two held-out views and a depth image."""
    far_m = max(float(view.target.depth.max()) for view in views)
    colour_map = matplotlib.colormaps["turbo_r"]
    figure = Figure(figsize=(7.8, 6.3), layout="constrained", facecolor="white")
    axes = figure.subplots(3, 3)
    for row, index in enumerate((0, 1, 0)):
        target = views[index].target
        for column, images in enumerate((target, before[index], after[index])):
            axis = axes[row, column]
            shown = images.rgb.clip(0, 1) if row < 2 else colour_map(images.depth / far_m)
            axis.imshow(shown, interpolation="lanczos")
            axis.set_axis_off()
            title = ("target", "before", "after")[column]
            if column > 0 and row < 2:
                title += f"   {psnr_db(images, target):.1f} dB"
            elif column > 0:
                title += f"   {100 * depth_error_m(images, target):.1f} cm off"
            axis.set_title(title if row < 2 else f"depth, {title}", fontsize=10)
    figure.savefig(path, dpi=100, pil_kwargs={"optimize": True})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder for the results")
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=0, help="0 means all hardware threads")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(arguments.seed)
    options = gslts.RenderOptions(threads=arguments.threads)

    truth = room.build_room()

    def views_of(cameras: list[gslts.Camera]) -> list[View]:
        return [View(camera, gslts.render(truth, camera, options)) for camera in cameras]

    size = {"width": WIDTH, "height": HEIGHT}
    training = views_of(room.cameras(TRAINING_VIEWS, **size))
    held_out = views_of(room.cameras(HELD_OUT_VIEWS, phase=0.37, **size))

    def render_held_out(gaussians: gslts.GaussianMap) -> list[Images]:
        return [gslts.render(gaussians, view.camera, options) for view in held_out]

    start = rough_start(truth, rng)
    before = render_held_out(start)
    started = time.perf_counter()
    fitted = fit(start, training, arguments.iterations, options, rng)
    seconds = time.perf_counter() - started
    after = render_held_out(fitted)

    def mean_over_held_out(measure: Any, images: list[Images]) -> float:
        return float(np.mean([measure(i, v.target) for i, v in zip(images, held_out, strict=True)]))

    metrics = {
        "gaussians": fitted.size,
        "iterations": arguments.iterations,
        "seed": arguments.seed,
        "fit_seconds": round(seconds, 2),
        "psnr_db_before": round(mean_over_held_out(psnr_db, before), 2),
        "psnr_db_after": round(mean_over_held_out(psnr_db, after), 2),
        "depth_error_m_before": round(mean_over_held_out(depth_error_m, before), 4),
        "depth_error_m_after": round(mean_over_held_out(depth_error_m, after), 4),
    }
    (arguments.out / "metrics.json").write_text(json.dumps(metrics, indent=2) + "\n")
    image = arguments.out / "before_after.png"
    draw(image, held_out, before, after)
    print(
        f"{fitted.size} Gaussians, {arguments.iterations} steps in {seconds:.0f} s: held-out views "
        f"from {metrics['psnr_db_before']:.1f} to {metrics['psnr_db_after']:.1f} dB, depth "
        f"from {100 * metrics['depth_error_m_before']:.1f} to "
        f"{100 * metrics['depth_error_m_after']:.1f} cm off; see {image}"
    )


if __name__ == "__main__":
    main()
