"""Trains Gaussians on images of a room with plain PyTorch, and draws the result.

The program is written like a trainer for gsplat: parameters with activations, Adam, and a loss on
one random image at a time. Only the import of `rasterization` differs.
"""

import argparse
import math
from pathlib import Path

import numpy as np
import room
import torch
from PIL import Image
from torch import Tensor
from tqdm import tqdm

import gslts
from gslts.torch import rasterization

WIDTH, HEIGHT = 320, 240
TRAINING_VIEWS, HELD_OUT_VIEWS = 24, 4

# Step of Adam by parameter.
LEARNING_RATES = {
    "means": 2e-3,
    "quats": 1e-2,
    "log_scales": 1e-2,
    "logit_opacities": 3e-2,
    "colors": 1e-2,
}


class View:
    """An image and its camera."""

    def __init__(self, truth: gslts.GaussianMap, camera: gslts.Camera) -> None:
        viewmat = np.linalg.inv(camera.world_from_camera)
        K = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
        self.viewmats = torch.tensor(viewmat, dtype=torch.float32)[None]
        self.Ks = torch.tensor(K, dtype=torch.float32)[None]
        self.target = torch.from_numpy(gslts.render(truth, camera).rgb.clip(0, 1))


def rough_start(truth: gslts.GaussianMap, size: int) -> dict[str, Tensor]:
    """Make parameters of round grey Gaussians near some of the true positions."""
    chosen = torch.randperm(truth.size)[:size]
    means = torch.from_numpy(truth.means.copy())[chosen]
    start = {
        "means": means + 0.04 * torch.randn(size, 3),
        "quats": torch.randn(size, 4),
        "log_scales": torch.empty(size, 3).uniform_(0.03, 0.08).log(),
        "logit_opacities": torch.full((size,), -1.0),
        "colors": torch.full((size, 3), 0.5),
    }
    return {name: tensor.requires_grad_() for name, tensor in start.items()}


def render(parameters: dict[str, Tensor], view: View) -> Tensor:
    """Render a view, [H,W,3] colours."""
    image, _, _ = rasterization(
        parameters["means"],
        parameters["quats"],
        parameters["log_scales"].exp(),
        parameters["logit_opacities"].sigmoid(),
        parameters["colors"],
        view.viewmats,
        view.Ks,
        WIDTH,
        HEIGHT,
    )
    return image[0]


def train(parameters: dict[str, Tensor], views: list[View], iterations: int) -> None:
    """Optimize `parameters` in place by gradient descent on one random view at a time."""
    groups = [{"params": [parameters[name]], "lr": rate} for name, rate in LEARNING_RATES.items()]
    optimizer = torch.optim.Adam(groups, betas=(0.9, 0.99), eps=1e-15)
    scheduler = torch.optim.lr_scheduler.ExponentialLR(optimizer, 0.1 ** (1 / iterations))
    for _ in tqdm(range(iterations), desc="training", unit="view", mininterval=0.5):
        view = views[int(torch.randint(len(views), ()))]
        loss = (render(parameters, view) - view.target).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        scheduler.step()


@torch.no_grad()
def render_all(parameters: dict[str, Tensor], views: list[View]) -> list[Tensor]:
    """Render the colours of all views, 0 to 1."""
    return [render(parameters, view).clamp(0, 1) for view in views]


def mean_psnr_db(images: list[Tensor], views: list[View]) -> float:
    errors = [
        float((image - view.target).square().mean())
        for image, view in zip(images, views, strict=True)
    ]
    return sum(-10 * math.log10(error) for error in errors) / len(errors)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/torch"), help="folder for the image")
    parser.add_argument("--gaussians", type=int, default=16_000)
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    torch.manual_seed(arguments.seed)

    truth = room.build_room()
    size = {"width": WIDTH, "height": HEIGHT}
    training = [View(truth, camera) for camera in room.cameras(TRAINING_VIEWS, **size)]
    held_out = [View(truth, camera) for camera in room.cameras(HELD_OUT_VIEWS, phase=0.37, **size)]

    parameters = rough_start(truth, arguments.gaussians)
    before = render_all(parameters, held_out)
    train(parameters, training, arguments.iterations)
    after = render_all(parameters, held_out)

    # Rows: two held-out views. Columns: target, before, after.
    targets = [view.target for view in held_out]
    rows = [torch.cat(row, dim=1) for row in zip(targets, before, after, strict=True)]
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "before_after.png"
    Image.fromarray((255 * torch.cat(rows[:2])).round().byte().numpy()).save(path)
    print(
        f"held-out views from {mean_psnr_db(before, held_out):.1f} to "
        f"{mean_psnr_db(after, held_out):.1f} dB; see {path}"
    )


if __name__ == "__main__":
    main()
