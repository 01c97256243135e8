"""SAM as ONNX files: the same masks as by transformers in each layout, and files that are bad."""

from pathlib import Path

import cv2
import numpy as np
import onnx_exports
import pytest
import tiny_models
from onnx import TensorProto, helper, save_model

from gslts.semantics.sam import MaskGenerator
from gslts.semantics.sam_onnx import open_onnx_sam
from gslts.semantics.sam_transformers import TransformersSam

pytest.importorskip("transformers", reason="models need transformers")
pytest.importorskip("onnxruntime", reason="ONNX models need onnxruntime")

SIDE_PX = tiny_models.SAM_SIDE_PX


@pytest.fixture(scope="module")
def sams(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a SAM of transformers, and its exports."""
    folder = tmp_path_factory.mktemp("sams")
    tiny_models.write_sam(folder / "model")
    for layout in ("transformers", "sam", "sam of bytes", "efficient"):
        onnx_exports.write_onnx_sam(folder / layout, folder / "model", layout)
    return folder


def image(height: int, width: int) -> np.ndarray:
    rgb = np.random.default_rng(0).integers(0, 128, (height, width, 3)).astype(np.uint8)
    rgb[: height // 2, : width // 3] += np.array((120, 20, 0), np.uint8)
    return rgb


@pytest.mark.parametrize("size", [(48, 64), (96, 60)])
@pytest.mark.parametrize("layout", ["transformers", "sam", "sam of bytes"])
def test_masks_are_those_of_transformers(sams: Path, layout: str, size: tuple[int, int]) -> None:
    rgb = image(*size)
    found = MaskGenerator(open_onnx_sam(sams / layout))(rgb)
    expected = MaskGenerator(TransformersSam(sams / "model"))(rgb)
    assert sum(map(len, found)) > 10
    for masks, others in zip(found, expected, strict=True):
        assert masks.shape == others.shape
        assert (masks != others).mean() < 1e-3


def test_efficient_sam_stretches_images_and_its_masks_are_ordered_by_area(sams: Path) -> None:
    rgb = cv2.resize(image(SIDE_PX, SIDE_PX), (80, 40), interpolation=cv2.INTER_NEAREST)
    model, known = open_onnx_sam(sams / "efficient"), TransformersSam(sams / "model")
    embedded = model.embed(rgb)
    shares = np.array([[0.2, 0.3], [0.5, 0.5], [0.9, 0.1]], np.float32)
    logits, ious = model.decode(embedded, shares * model.side_px)
    areas = (logits > 0).sum(axis=(2, 3))
    assert (np.diff(areas, axis=1) >= 0).all()
    # The same masks as of the image that is stretched before.
    stretched = cv2.resize(rgb, (SIDE_PX, SIDE_PX), interpolation=cv2.INTER_LINEAR)
    expected, scores = known.decode(known.embed(stretched), shares * SIDE_PX)
    for row in range(len(shares)):
        order = np.argsort(scores[row])
        np.testing.assert_allclose(np.sort(ious[row]), scores[row][order], atol=5e-3)
        for level, ours in zip(order, np.argsort(ious[row]), strict=True):
            large = cv2.resize(expected[row, level], logits.shape[2:])
            assert ((large > 0) != (logits[row, ours] > 0)).mean() < 0.01
    assert [masks.shape[1:] for masks in MaskGenerator(model)(rgb)] == [(40, 80)] * 3


def test_bad_folders_are_named_in_one_line(sams: Path, tmp_path: Path) -> None:
    def files(layout: str) -> tuple[Path, Path]:
        (decoder,) = (sams / layout).glob("*decoder.onnx")
        (encoder,) = {*(sams / layout).glob("*.onnx")} - {decoder}
        return encoder, decoder

    encoder, decoder = files("sam")
    cases = (
        ({}, FileNotFoundError, r"there is no \*encoder\*\.onnx of a SAM; .*hf download "),
        ({"encoder.onnx": encoder}, FileNotFoundError, r"there is no \*decoder\*\.onnx of a SAM"),
        (
            {"encoder.onnx": encoder, "decoder.onnx": encoder},
            ValueError,
            r"expected an input input_points .*, got \['input_image'\]",
        ),
        (
            {"encoder.onnx": decoder, "decoder.onnx": decoder},
            ValueError,
            "expected one image as input",
        ),
        (
            {"encoder.onnx": encoder, "decoder.onnx": files("transformers")[1]},
            ValueError,
            "it has no output image_positional_embeddings, only image_embeddings",
        ),
    )
    for number, (parts, error, message) in enumerate(cases):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name, source in parts.items():
            (folder / name).write_bytes(source.read_bytes())
        with pytest.raises(error, match=message) as raised:
            open_onnx_sam(folder).embed(image(48, 64))
        assert str(raised.value).startswith(str(folder))
        assert "\n" not in str(raised.value)


@pytest.mark.parametrize("patches", [0, 62_500])
def test_an_image_side_out_of_range_is_rejected(sams: Path, tmp_path: Path, patches: int) -> None:
    (decoder,) = (sams / "sam").glob("*decoder.onnx")
    (tmp_path / "decoder.onnx").write_bytes(decoder.read_bytes())
    image, embeddings = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, (1, 3, *size))
        for name, size in (("image", ("h", "w")), ("image_embeddings", ("rows", patches)))
    )
    node = helper.make_node("Identity", ["image"], ["image_embeddings"])
    graph = helper.make_graph([node], "encoder", [image], [embeddings])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    save_model(model, tmp_path / "encoder.onnx")
    message = rf"encoder\.onnx: expected images of 1\.\.4096 px, got {16 * patches}$"
    with pytest.raises(ValueError, match=message):
        open_onnx_sam(tmp_path)


def test_a_decoder_of_one_mask_is_rejected(sams: Path, tmp_path: Path) -> None:
    """SAM's own export has an option for the best mask alone."""
    import torch

    (source,) = (sams / "sam").glob("*encoder.onnx")
    (tmp_path / "encoder.onnx").write_bytes(source.read_bytes())
    inputs = {
        "image_embeddings": torch.zeros(1, 8, 4, 4),
        "point_coords": torch.zeros(1, 2, 2),
        "point_labels": torch.zeros(1, 2),
        "mask_input": torch.zeros(1, 1, 256, 256),
        "has_mask_input": torch.zeros(1),
        "orig_im_size": torch.zeros(2),
    }
    onnx_exports.export(
        tmp_path / "decoder.onnx",
        None,
        lambda *values: (
            sum(value.sum() for value in values) * torch.ones(1, 1, 16, 16),
            sum(value.sum() for value in values) * torch.ones(1, 1),
        ),
        inputs,
        ("low_res_masks", "iou_predictions"),
    )
    message = r"expected 3 masks per point, got \(8, 1, 16, 16\) .* without --return-single-mask$"
    with pytest.raises(ValueError, match=message):
        MaskGenerator(open_onnx_sam(tmp_path))(image(48, 64))
