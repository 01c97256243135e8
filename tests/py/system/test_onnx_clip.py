"""CLIP and SigLIP as ONNX files: the same embeddings as by transformers, and files that are bad."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import change_room
import numpy as np
import onnx_exports
import pytest
import tiny_models

from gslts.datasets import open_dataset
from gslts.semantics.clip import ClipEncoder
from gslts.semantics.clip_onnx import OnnxClip
from gslts.semantics.clip_source import ClipSource
from gslts.semantics.files import read_semantics
from gslts.store.map_folder import write_map_folder
from gslts_sim.capture import capture
from gslts_sim.controller import Controller

pytest.importorskip("transformers", reason="models need transformers")
pytest.importorskip("onnxruntime", reason="ONNX models need onnxruntime")

WORDS = ["red", "alarm clock", "Blue ", "é", "very " * 40]


def noise(seed: int, side: int = tiny_models.SIDE_PX) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (side, side, 3)).astype(np.uint8)


@pytest.fixture(scope="module")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a CLIP of transformers, and its export."""
    folder = tmp_path_factory.mktemp("clips")
    tiny_models.write_clip(folder / "clip")
    onnx_exports.write_onnx_clip(folder / "onnx", folder / "clip")
    return folder


def test_embeddings_of_clip_are_those_of_transformers(clips: Path) -> None:
    exported, model = OnnxClip(clips / "onnx"), ClipEncoder(clips / "clip")
    assert (exported.dims, exported.side_px) == (model.dims, model.side_px)
    images = [noise(0), noise(1) // 2]
    for encode in ("encode_images", "encode_texts"):
        inputs = images if encode == "encode_images" else WORDS
        found, expected = getattr(exported, encode)(inputs), getattr(model, encode)(inputs)
        np.testing.assert_allclose(found, expected, atol=1e-5)
        assert found.dtype == np.float32
        assert getattr(exported, encode)([]).shape == (0, tiny_models.DIMS)


def test_embeddings_of_siglip_are_those_of_transformers(tmp_path: Path) -> None:
    """Its text encoder attends to the padding, and its images have another mean."""
    import torch

    model, tokenizer = onnx_exports.write_onnx_siglip(tmp_path / "siglip")
    encoder = OnnxClip(tmp_path / "siglip")
    words = ["red", "Blue", "cup", "averylongword"]
    tokens = tokenizer(
        words, padding="max_length", truncation=True, max_length=8, return_tensors="pt"
    )
    pixels = torch.from_numpy(noise(0).astype(np.float32).transpose(2, 0, 1)[None] / 127.5 - 1)
    with torch.no_grad():
        texts = model.get_text_features(tokens.input_ids).pooler_output.numpy()
        image = model.get_image_features(pixels).pooler_output.numpy()
    for found, expected in (
        (encoder.encode_texts(words), texts),
        (encoder.encode_images([noise(0)]), image),
    ):
        lengths = np.linalg.norm(expected, axis=1, keepdims=True)
        np.testing.assert_allclose(found, expected / lengths, atol=1e-5)
    assert np.abs(encoder.encode_texts(["red"]) - encoder.encode_texts(["re"])).max() > 0.01


def test_preprocessing_of_published_models(clips: Path) -> None:
    """Sizes of CLIP, its newer form and MobileCLIP, which does not normalize."""
    folder, image = clips / "onnx", noise(2)
    config = folder / "preprocessor_config.json"
    before = config.read_text()
    (as_written,) = OnnxClip(folder).encode_images([image])
    side = tiny_models.SIDE_PX
    sizes = {"crop_size": {"height": side, "width": side}, "size": {"shortest_edge": side}}
    try:
        onnx_exports.write_preprocessing(folder, **sizes)
        np.testing.assert_array_equal(OnnxClip(folder).encode_images([image])[0], as_written)
        onnx_exports.write_preprocessing(folder, **sizes, do_normalize=False)
        other = OnnxClip(folder).encode_images([image])[0]
    finally:
        config.write_text(before)
    assert np.abs(other - as_written).max() > 0.01


def test_of_several_precisions_float32_is_read(clips: Path, tmp_path: Path) -> None:
    copy_folder(clips / "onnx", tmp_path / "clip")
    for name in ("vision_model_fp16.onnx", "text_model_quantized.onnx"):
        (tmp_path / "clip" / "onnx" / name).write_bytes(b"not read")
    found, expected = OnnxClip(tmp_path / "clip"), OnnxClip(clips / "onnx")
    image = [noise(3)]
    np.testing.assert_array_equal(found.encode_images(image), expected.encode_images(image))
    np.testing.assert_array_equal(found.encode_texts(WORDS), expected.encode_texts(WORDS))


def copy_folder(source: Path, target: Path) -> None:
    for path in source.rglob("*"):
        if path.is_file():
            copy = target / path.relative_to(source)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes())


def edit_json(name: str, **values: object) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        config = json.loads((folder / name).read_text())
        (folder / name).write_text(json.dumps({**config, **values}))

    return edit


def lose(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def overwrite(name: str, content: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_text(content) and None


def swap_models(folder: Path) -> None:
    """Put the text model in the place of the image model."""
    (folder / "onnx/vision_model.onnx").write_bytes((folder / "onnx/text_model.onnx").read_bytes())


PROCESSOR, TOKENS = "preprocessor_config.json", "tokenizer_config.json"
HOW = r"hf download \S+/\S+ --local-dir "


@pytest.mark.parametrize(
    ("spoil", "error", "message"),
    [
        (lose("onnx/vision_model.onnx"), FileNotFoundError, rf"no vision_model\*\.onnx; .*{HOW}"),
        (lose("onnx/text_model.onnx"), FileNotFoundError, rf"no text_model\*\.onnx; .*{HOW}"),
        (lose(PROCESSOR), FileNotFoundError, rf"no preprocessor_config\.json; .*{HOW}"),
        (lose(TOKENS), FileNotFoundError, rf"no tokenizer_config\.json; .*{HOW}"),
        (lose("tokenizer.json"), FileNotFoundError, rf"no tokenizer\.json; .*{HOW}"),
        (overwrite("onnx/text_model.onnx", "no model"), ValueError, "it is no ONNX model"),
        (overwrite("tokenizer.json", "{}"), ValueError, "it is no tokenizer"),
        (overwrite(TOKENS, "[" * 100_000), ValueError, "it is no JSON object"),
        (overwrite(PROCESSOR, "7"), ValueError, "it is no JSON object"),
        (swap_models, ValueError, r"expected an output image_embeds or pooler_output, got"),
        (edit_json(PROCESSOR, crop_size=1 << 40), ValueError, r"size must be in 1\.\.4096 px, got"),
        (edit_json(PROCESSOR, crop_size={"width": 9}), ValueError, r"size must be in .*, got None"),
        (edit_json(PROCESSOR, image_std=[1, 0, 1]), ValueError, "must be three numbers, got"),
        (edit_json(PROCESSOR, image_mean=["a", 0, 0]), ValueError, "must be three numbers, got"),
        (edit_json(TOKENS, model_max_length=10**30), ValueError, r"must be in 3\.\.1024, got 1000"),
        (edit_json(TOKENS, pad_token="<nothing>"), ValueError, "'<nothing>' is no token"),
    ],
)
def test_bad_folders_are_named_in_one_line(
    clips: Path,
    tmp_path: Path,
    spoil: Callable[[Path], None],
    error: type[Exception],
    message: str,
) -> None:
    folder = tmp_path / "clip"
    copy_folder(clips / "onnx", folder)
    spoil(folder)
    with pytest.raises(error, match=message) as raised:
        OnnxClip(folder)
    assert str(raised.value).startswith(str(folder))
    assert "\n" not in str(raised.value)


def test_a_missing_folder_is_named_without_transformers(
    clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "transformers", None)
    nowhere = tmp_path / "nowhere"
    with pytest.raises(FileNotFoundError, match=f"{nowhere}: no such folder; .*{HOW}"):
        ClipSource.from_folders(nowhere)
    with pytest.raises(FileNotFoundError, match=f"{nowhere}: no such folder; .*{HOW}"):
        ClipSource.from_folders(clips / "onnx", nowhere)


def test_models_that_do_not_belong_together_are_named(clips: Path, tmp_path: Path) -> None:
    """A text model of another CLIP, and one with weights that are not finite."""
    import torch

    copy_folder(clips / "onnx", tmp_path / "other")
    for numbers, message in (
        (torch.ones(1, 7), "its embeddings have 32 numbers, those of texts 7: export both"),
        (torch.full((1, 7), torch.nan), "the weights give embeddings that are not finite"),
    ):
        onnx_exports.export(
            tmp_path / "other" / "onnx" / "text_model.onnx",
            None,
            lambda tokens, numbers=numbers: numbers + 0 * tokens.sum(),
            {"input_ids": torch.ones(1, 5, dtype=torch.int64)},
            ("text_embeds",),
            {"input_ids": {1: "length"}},
        )
        with pytest.raises(ValueError, match=message):
            OnnxClip(tmp_path / "other").encode_images([noise(0)])


def test_commands_run_without_torch(clips: Path, tmp_path: Path) -> None:
    tiny_models.write_sam(tmp_path / "of_transformers")
    onnx_exports.write_onnx_sam(tmp_path / "sam", tmp_path / "of_transformers", "transformers")
    robot = Controller(change_room.home(), **change_room.SIZE)
    capture(robot, change_room.VIEWPOINTS[:2], tmp_path / "visit")
    cameras = {frame.name: frame.read().camera for frame in open_dataset(tmp_path / "visit").frames}
    write_map_folder(tmp_path / "map", change_room.mapped()[0], {}, cameras)

    def run(*arguments: object) -> str:
        code = (
            "import sys; sys.modules['torch'] = None; from gslts.cli import main; "
            "sys.argv[0] = 'gslts'; main()"
        )
        command = [sys.executable, "-c", code, *map(str, arguments)]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        assert result.returncode == 0, result.stderr
        return result.stdout

    models = ("--clip", clips / "onnx", "--sam", tmp_path / "sam", "--code-dims", "8")
    run("semantics", tmp_path / "map", tmp_path / "visit", *models, "--threads", "1")
    recorded = read_semantics(tmp_path / "map")
    assert recorded is not None
    assert (recorded[0].source, recorded[0].levels) == ("clip", 3)
    assert isinstance(json.loads(run("query", tmp_path / "map", "red", "--json")), list)
