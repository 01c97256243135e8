"""Weights of LPIPS, and frames and maps to be judged by them."""

import json
from pathlib import Path

import numpy as np
import scenes
import torch
from PIL import Image

import gslts
from gslts.core.frame import RgbdFrame

SIZES = ((64, 3, 11), (192, 64, 5), (384, 192, 3), (256, 384, 3), (256, 256, 3))
ROWS = (0, 3, 6, 8, 10)


def write_weights(folder: Path) -> tuple[Path, Path]:
    """Write random weights in the layout of torchvision's and the authors' files."""
    random = torch.Generator().manual_seed(0)
    backbone, heads = {}, {}
    for number, (row, (outputs, inputs, kernel)) in enumerate(zip(ROWS, SIZES, strict=True)):
        shape = (outputs, inputs, kernel, kernel)
        scale = (inputs * kernel**2) ** -0.5
        backbone[f"features.{row}.weight"] = scale * torch.randn(shape, generator=random)
        backbone[f"features.{row}.bias"] = 0.1 * torch.randn(outputs, generator=random)
        heads[f"lin{number}.model.1.weight"] = torch.rand((1, outputs, 1, 1), generator=random)
    backbone["classifier.1.weight"] = torch.zeros(2, 2)  # There is more in it than is needed.
    torch.save(backbone, folder / "alexnet.pth")
    torch.save(heads, folder / "alex.pth")
    return folder / "alexnet.pth", folder / "alex.pth"


def frames_of(gaussian_map: gslts.GaussianMap, gain: float) -> list[RgbdFrame]:
    """Return what three cameras see of a map, all colours times a gain."""
    frames = []
    for angle in (0.0, 1.0, 2.0):
        camera = scenes.orbit_camera(80, 60, angle_rad=angle)
        images = gslts.render(gaussian_map, camera)
        photo = np.rint(255 * (gain * images.rgb).clip(0, 1)).astype(np.uint8)
        frames.append(RgbdFrame(photo, images.depth, camera))
    return frames


def dim_map() -> gslts.GaussianMap:
    """No colour is clipped."""
    gaussian_map = scenes.random_map(200, dtype=np.float32)
    return gslts.GaussianMap(
        means=gaussian_map.means,
        quats=gaussian_map.quats,
        log_scales=gaussian_map.log_scales,
        logit_opacities=gaussian_map.logit_opacities,
        sh=gaussian_map.sh.clip(-1.2, 1.2),
    )


def write_nerfstudio(folder: Path, frames: list[RgbdFrame]) -> None:
    """Write frames without depth in nerfstudio's layout."""
    folder.mkdir()
    entries = []
    for number, frame in enumerate(frames):
        Image.fromarray(frame.rgb).save(folder / f"{number}.png")
        pose = frame.camera.world_from_camera @ np.diag([1.0, -1, -1, 1])
        entries.append({"file_path": f"{number}.png", "transform_matrix": pose.tolist()})
    camera = frames[0].camera
    header = {
        "w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy,
        "cx": camera.cx, "cy": camera.cy, "frames": entries,
    }  # fmt: skip
    (folder / "transforms.json").write_text(json.dumps(header))
