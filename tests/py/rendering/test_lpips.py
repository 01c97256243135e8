"""LPIPS compared with its layers written out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scenes
import torch
from lpips_files import dim_map, frames_of, write_weights
from torch import nn
from torch.nn import functional

from gslts.mapping.evaluation.rendering import evaluate_rendering
from gslts.rendering.metrics import MIN_SIDE_PX, Lpips


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return write_weights(tmp_path_factory.mktemp("weights"))


def images() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    first = rng.random((61, 83, 3)).astype(np.float32)
    return first, (0.7 * first + 0.3 * rng.random(first.shape)).astype(np.float32)


def by_hand(first: np.ndarray, second: np.ndarray, weights: tuple[Path, Path]) -> float:
    """Compute LPIPS as the authors do: layers of torchvision, a convolution for each head."""
    backbone, heads = (torch.load(path) for path in weights)
    alexnet = nn.Sequential(
        nn.Conv2d(3, 64, kernel_size=11, stride=4, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2),
        nn.Conv2d(64, 192, kernel_size=5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2),
        nn.Conv2d(192, 384, kernel_size=3, padding=1), nn.ReLU(),
        nn.Conv2d(384, 256, kernel_size=3, padding=1), nn.ReLU(),
        nn.Conv2d(256, 256, kernel_size=3, padding=1), nn.ReLU(),
    )  # fmt: skip
    names = {name.removeprefix("features."): tensor for name, tensor in backbone.items()}
    alexnet.load_state_dict({name: tensor for name, tensor in names.items() if name[0].isdigit()})
    shift = torch.tensor([-0.030, -0.088, -0.188]).reshape(1, 3, 1, 1)
    scale = torch.tensor([0.458, 0.448, 0.450]).reshape(1, 3, 1, 1)
    layers = []
    for image in (first, second):
        x = torch.tensor(image.transpose(2, 0, 1)[None]) * 2 - 1
        x = (x - shift) / scale
        outputs = []
        for number, layer in enumerate(alexnet):
            x = layer(x)
            if number in (1, 4, 7, 9, 11):
                outputs.append(x / (torch.sqrt(torch.sum(x**2, dim=1, keepdim=True)) + 1e-10))
        layers.append(outputs)
    total = 0.0
    for number, (a, b) in enumerate(zip(*layers, strict=True)):
        head = heads[f"lin{number}.model.1.weight"]
        total += float(functional.conv2d((a - b) ** 2, head).mean().detach())
    return total


def test_distances_are_those_of_the_layers(weights: tuple[Path, Path]) -> None:
    first, second = images()
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


def test_sizes_of_images_are_checked(weights: tuple[Path, Path]) -> None:
    lpips = Lpips(*weights)
    least = np.zeros((MIN_SIDE_PX, MIN_SIDE_PX, 3))
    assert lpips.distance(least, least) == 0
    with pytest.raises(ValueError, match="at least 31 px a side, got 31 x 30"):
        lpips.distance(least[1:], least[1:])
    with pytest.raises(ValueError, match="of one size"):
        lpips.distance(least, np.zeros((40, 40, 3)))


def test_files_that_are_no_weights_are_rejected(weights: tuple[Path, Path], tmp_path: Path) -> None:
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
    """Creates a file if it is unpickled unsafely."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple:
        return Path.touch, (self.path,)


def test_the_exposure_is_fitted(weights: tuple[Path, Path]) -> None:
    gaussian_map, lpips = dim_map(), Lpips(*weights)
    found = evaluate_rendering(gaussian_map, frames_of(gaussian_map, 0.7), lpips)
    other = evaluate_rendering(
        gaussian_map, frames_of(scenes.random_map(150, seed=5, dtype=np.float32), 1.0), lpips
    )
    assert found.lpips is not None
    assert other.lpips is not None
    assert found.lpips < 0.05 * other.lpips
    assert found.render_ms > 0
    assert evaluate_rendering(gaussian_map, frames_of(gaussian_map, 1.0)).lpips is None
    with pytest.raises(ValueError, match="there is no frame"):
        evaluate_rendering(gaussian_map, [])


def test_pixels_outside_the_mask_do_not_count(
    weights: tuple[Path, Path],
) -> None:
    gaussian_map, lpips = dim_map(), Lpips(*weights)
    whole = frames_of(gaussian_map, 0.7)
    seen = np.ones((60, 80), np.bool_)
    seen[:, :25] = False
    black = [np.where(seen[..., None], frame.rgb, 0) for frame in whole]
    masked = [replace(frame, rgb=rgb, mask=seen) for frame, rgb in zip(whole, black, strict=True)]
    without = [replace(frame, mask=None) for frame in masked]
    found, wrong = (
        evaluate_rendering(gaussian_map, frames, lpips).lpips for frames in (masked, without)
    )
    assert found is not None
    assert wrong is not None
    assert found < 0.05 * wrong
    nothing = [replace(frame, mask=np.zeros_like(seen)) for frame in masked]
    assert evaluate_rendering(gaussian_map, nothing, lpips).lpips == 0
