"""LPIPS against the layers written out one by one, and `gslts eval` with and without weights."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scenes
import torch
from command import gslts as run
from PIL import Image
from torch import nn
from torch.nn import functional

import gslts
from gslts.frame import RgbdFrame
from gslts.lpips import LEAST_PX, Lpips
from gslts.map_folder import write_map_folder
from gslts.mapping.assess import assess

SIZES = ((64, 3, 11), (192, 64, 5), (384, 192, 3), (256, 384, 3), (256, 256, 3))
ROWS = (0, 3, 6, 8, 10)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Random ones, in the layout of torchvision's and the authors' files."""
    random = torch.Generator().manual_seed(0)
    folder = tmp_path_factory.mktemp("weights")
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


def pictures() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    first = rng.random((61, 83, 3)).astype(np.float32)
    return first, (0.7 * first + 0.3 * rng.random(first.shape)).astype(np.float32)


def by_hand(first: np.ndarray, second: np.ndarray, weights: tuple[Path, Path]) -> float:
    """As the authors' code computes it: torchvision's layers, a convolution for each head."""
    backbone, heads = (torch.load(path) for path in weights)
    alexnet = nn.Sequential(
        nn.Conv2d(3, 64, kernel_size=11, stride=4, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2),
        nn.Conv2d(64, 192, kernel_size=5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2),
        nn.Conv2d(192, 384, kernel_size=3, padding=1), nn.ReLU(),
        nn.Conv2d(384, 256, kernel_size=3, padding=1), nn.ReLU(),
        nn.Conv2d(256, 256, kernel_size=3, padding=1), nn.ReLU(),
    )  # fmt: skip
    names = {name.removeprefix("features."): one for name, one in backbone.items()}
    alexnet.load_state_dict({name: one for name, one in names.items() if name[0].isdigit()})
    shift = torch.tensor([-0.030, -0.088, -0.188]).reshape(1, 3, 1, 1)
    scale = torch.tensor([0.458, 0.448, 0.450]).reshape(1, 3, 1, 1)
    layers = []
    for picture in (first, second):
        x = torch.tensor(picture.transpose(2, 0, 1)[None]) * 2 - 1
        x = (x - shift) / scale
        outputs = []
        for number, layer in enumerate(alexnet):
            x = layer(x)
            if number in (1, 4, 7, 9, 11):
                outputs.append(x / (torch.sqrt(torch.sum(x**2, dim=1, keepdim=True)) + 1e-10))
        layers.append(outputs)
    total = 0.0
    for number, (one, other) in enumerate(zip(*layers, strict=True)):
        head = heads[f"lin{number}.model.1.weight"]
        total += float(functional.conv2d((one - other) ** 2, head).mean().detach())
    return total


def test_distances_are_those_of_the_layers(weights: tuple[Path, Path]) -> None:
    first, second = pictures()
    lpips = Lpips(*weights)
    distance = lpips.distance(first, second)
    assert distance == pytest.approx(by_hand(first, second, weights), rel=1e-5)
    assert distance > 0.1
    assert lpips.distance(second, first) == pytest.approx(distance, rel=1e-6)
    assert lpips.distance(first, first) == 0
    assert lpips.distance(first, 0.5 * first + 0.5 * second) < distance
    swapped = lpips.distance(first[..., ::-1], second[..., ::-1])
    assert abs(swapped - distance) > 1e-4, "red is not blue"
    wide = lpips.distance(3 * first - 1, second)
    assert wide == lpips.distance((3 * first - 1).clip(0, 1), second)


def test_pictures_must_fit(weights: tuple[Path, Path]) -> None:
    lpips = Lpips(*weights)
    least = np.zeros((LEAST_PX, LEAST_PX, 3))
    assert lpips.distance(least, least) == 0
    with pytest.raises(ValueError, match="at least 31 px a side, got 31 x 30"):
        lpips.distance(least[1:], least[1:])
    with pytest.raises(ValueError, match="of one size"):
        lpips.distance(least, np.zeros((40, 40, 3)))


def test_files_that_are_no_weights_are_named(weights: tuple[Path, Path], tmp_path: Path) -> None:
    backbone, heads = weights
    with pytest.raises(FileNotFoundError, match=r"gone\.pth"):
        Lpips(tmp_path / "gone.pth", heads)
    with pytest.raises(ValueError, match=r"alex\.pth: there is no tensor features\.0\.weight"):
        Lpips(heads, heads)
    bad = tmp_path / "bad.pth"
    for content in (b"", b"no weights", backbone.read_bytes()[:5000]):
        bad.write_bytes(content)
        with pytest.raises(ValueError, match=r"bad\.pth: PyTorch cannot read it as weights"):
            Lpips(bad, heads)
    torch.save([1], bad)
    with pytest.raises(ValueError, match=r"bad\.pth: expected a state dict, got list"):
        Lpips(bad, heads)
    torch.save(Runs(tmp_path / "ran"), bad)
    with pytest.raises(ValueError, match=r"bad\.pth: PyTorch cannot read it as weights"):
        Lpips(bad, heads)
    assert not (tmp_path / "ran").exists(), "a file of weights must not run code"
    changed = torch.load(heads)
    changed["lin2.model.1.weight"] = torch.zeros(1, 383, 1, 1)
    torch.save(changed, bad)
    with pytest.raises(ValueError, match=r"lin2\.model\.1\.weight: expected \(1, 384, 1, 1\), got"):
        Lpips(backbone, bad)
    changed["lin2.model.1.weight"] = torch.full((1, 384, 1, 1), torch.nan)
    torch.save(changed, bad)
    with pytest.raises(ValueError, match="holds a number that is not finite"):
        Lpips(backbone, bad)


class Runs:
    """Makes a file when it is unpickled without care."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple:
        return Path.touch, (self.path,)


def frames_of(gaussian_map: gslts.GaussianMap, gain: float) -> list[RgbdFrame]:
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


def test_assessments_fit_the_exposure(weights: tuple[Path, Path]) -> None:
    gaussian_map, lpips = dim_map(), Lpips(*weights)
    found = assess(gaussian_map, frames_of(gaussian_map, 0.7), lpips)
    other = assess(
        gaussian_map, frames_of(scenes.random_map(150, seed=5, dtype=np.float32), 1.0), lpips
    )
    assert found.lpips is not None
    assert other.lpips is not None
    assert found.lpips < 0.05 * other.lpips
    assert 0 < found.render_ms < 1000
    assert assess(gaussian_map, frames_of(gaussian_map, 1.0)).lpips is None
    with pytest.raises(ValueError, match="there is no frame"):
        assess(gaussian_map, [])


def test_what_the_camera_did_not_see_is_not_assessed(weights: tuple[Path, Path]) -> None:
    gaussian_map, lpips = dim_map(), Lpips(*weights)
    whole = frames_of(gaussian_map, 0.7)
    seen = np.ones((60, 80), np.bool_)
    seen[:, :25] = False
    black = [np.where(seen[..., None], frame.rgb, 0) for frame in whole]
    masked = [replace(frame, rgb=rgb, mask=seen) for frame, rgb in zip(whole, black, strict=True)]
    without = [replace(frame, mask=None) for frame in masked]
    found, wrong = (assess(gaussian_map, frames, lpips).lpips for frames in (masked, without))
    assert found is not None
    assert wrong is not None
    assert found < 0.05 * wrong
    nothing = [replace(frame, mask=np.zeros_like(seen)) for frame in masked]
    assert assess(gaussian_map, nothing, lpips).lpips == 0


def test_eval_command(weights: tuple[Path, Path], tmp_path: Path) -> None:
    gaussian_map = dim_map()
    write_map_folder(tmp_path / "map", gaussian_map, {}, {})
    write_nerfstudio(tmp_path / "set", frames_of(gaussian_map, 1.0))
    arguments = ("set", "--every", "1")
    done = run("eval", "map", *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "no LPIPS: it needs weights, --lpips-backbone and --lpips-heads" in done.stdout
    done = run("eval", "map@1", *arguments, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["lpips"] is None
    assert result["given"]["psnr_db"] > 40
    assert result["gaussians"] == 200
    assert result["bytes"] == gaussian_map.nbytes
    assert result["bytes_per_gaussian"] == pytest.approx(result["bytes"] / 200)
    assert 0 < result["render_ms"] < 1000
    files = ("--lpips-backbone", weights[0], "--lpips-heads", weights[1])
    done = run("eval", "map", *arguments, "--json", *files, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert 0 < json.loads(done.stdout)["lpips"] < 0.1
    done = run("eval", "map", *arguments, *files[:2], cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr == "gslts: LPIPS needs both --lpips-backbone and --lpips-heads\n"
    done = run("eval", "map", *arguments, *files[:3], weights[0], cwd=tmp_path)
    assert done.returncode == 1
    assert "alexnet.pth: there is no tensor lin0.model.1.weight" in done.stderr


def write_nerfstudio(folder: Path, frames: list[RgbdFrame]) -> None:
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
