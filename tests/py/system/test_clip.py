"""The semantic source of SAM and CLIP, with tiny models: images, texts, masks and queries."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
import pytest
import tiny_models
from PIL import Image
from typer.testing import CliRunner

from gslts.cli import app
from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.datasets import open_dataset
from gslts.semantics.clip import ClipEncoder
from gslts.semantics.clip_source import ClipSource
from gslts.semantics.embed import embed_semantics
from gslts.semantics.files import read_semantics
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.masks import crop_to_mask, paint_labels, suppress_duplicates
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.registry import open_source, open_text_source
from gslts.semantics.sam import MaskGenerator
from gslts.semantics.sam_transformers import TransformersSam
from gslts.semantics.source import CANONICAL
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import write_map_folder
from gslts_sim.capture import capture
from gslts_sim.controller import Controller

pytest.importorskip("transformers", reason="models need transformers")

RED, BLUE = (200, 40, 30), (30, 60, 200)


def plain(color: tuple[int, int, int]) -> np.ndarray:
    """Return an image of one colour, of the size that CLIP takes."""
    return np.full((tiny_models.SIDE_PX, tiny_models.SIDE_PX, 3), color, np.uint8)


def noise(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)


def image_by_transformers(folder: Path, rgb: np.ndarray) -> np.ndarray:
    """Return [D] the embedding by transformers itself of an image that is read from a file."""
    import torch
    from transformers import CLIPImageProcessorPil, CLIPModel

    side = tiny_models.SIDE_PX
    processor = CLIPImageProcessorPil(
        size={"shortest_edge": side}, crop_size={"height": side, "width": side}
    )
    Image.fromarray(rgb).save(folder / "image.png")
    pixels = processor(Image.open(folder / "image.png"), return_tensors="pt").pixel_values
    with torch.no_grad():
        found = CLIPModel.from_pretrained(folder).get_image_features(pixels).pooler_output[0]
    return (found / found.norm()).numpy()


def test_image_embeddings_are_those_of_transformers(tmp_path: Path) -> None:
    tiny_models.write_clip(tmp_path)
    encoder = ClipEncoder(tmp_path, threads=1)
    assert (encoder.dims, encoder.side_px) == (tiny_models.DIMS, tiny_models.SIDE_PX)
    ramp = noise(32, 32) // 2 + np.linspace(0, 120, 32).astype(np.uint8)[:, None]
    images = [plain(RED), noise(32, 32), ramp]
    found = encoder.encode_images(images)
    assert found.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, rtol=1e-6)
    expected = [image_by_transformers(tmp_path, image) for image in images]
    np.testing.assert_allclose(found, expected, atol=1e-4)
    # A wrong order of channels or axes gives other embeddings.
    for wrong in (ramp[..., ::-1], ramp.transpose(1, 0, 2), ramp[::-1], ramp[:, ::-1]):
        (other,) = encoder.encode_images([np.ascontiguousarray(wrong)])
        assert np.abs(other - expected[2]).max() > 0.02
    np.testing.assert_array_equal(encoder.encode_images(images), found)
    assert encoder.encode_images([]).shape == (0, tiny_models.DIMS)


def test_text_embeddings_are_those_of_transformers(tmp_path: Path) -> None:
    import torch
    from transformers import CLIPModel, CLIPTokenizer

    tiny_models.write_clip(tmp_path)
    words = ["red", "alarm clock", "Blue ", "é"]
    source = ClipSource(ClipEncoder(tmp_path, threads=1))
    found = source.encode(words)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, rtol=1e-6)
    tokens = CLIPTokenizer.from_pretrained(tmp_path)(words, padding=True, return_tensors="pt")
    with torch.no_grad():
        expected = CLIPModel.from_pretrained(tmp_path).get_text_features(**tokens).pooler_output
    np.testing.assert_allclose(found, expected / expected.norm(dim=1, keepdim=True), atol=1e-5)
    # Batching, case and truncated ends do not change an embedding.
    np.testing.assert_array_equal(source.encode(["blue", "red"]), found[[2, 0]])
    assert source.encode(["very " * 40]).shape == (1, source.dims)
    assert source.encode([]).shape == (0, source.dims)


EARLY_FIELDS = {
    "_name_or_path": "",
    "add_cross_attention": False,
    "architectures": None,
    "bad_words_ids": None,
    "chunk_size_feed_forward": 0,
    "id2label": {"0": "LABEL_0", "1": "LABEL_1"},
    "is_encoder_decoder": False,
    "length_penalty": 1.0,
    "max_length": 20,
    "num_beams": 1,
    "output_attentions": False,
    "pruned_heads": {},
    "return_dict": True,
    "tokenizer_class": None,
    "torch_dtype": None,
    "torchscript": False,
    "transformers_version": "4.29.0.dev0",
    "use_bfloat16": False,
}
"""Fields that config.json of openai/clip-vit-base-patch32 and facebook/sam-vit-huge has in each of
its parts, as it was published."""


def rewrite_config(folder: Path, parts: tuple[str, ...], **values: object) -> None:
    """Write `config.json` as the early ones are: with `EARLY_FIELDS` in each part."""
    config = json.loads((folder / "config.json").read_text())
    for part in parts:
        config[part] = {**config[part], **EARLY_FIELDS, **values}
        if config["model_type"] == "clip":
            config[f"{part}_dict"] = None
    config |= {"_commit_hash": None, "transformers_version": None, "torch_dtype": "float32"}
    (folder / "config.json").write_text(json.dumps(config))


def test_configurations_as_they_were_published(tmp_path: Path) -> None:
    clip, sam = tmp_path / "clip", tmp_path / "sam"
    tiny_models.write_clip(clip)
    tiny_models.write_sam(sam)
    image = noise(32, 32)
    embeddings = ClipEncoder(clip, threads=1).encode_images([image])
    texts = ClipEncoder(clip, threads=1).encode_texts(["red"])
    before = TransformersSam(sam, threads=1).embed(image).values
    rewrite_config(clip, ("text_config", "vision_config"))
    rewrite_config(
        sam, ("mask_decoder_config", "prompt_encoder_config", "vision_config"), model_type=""
    )
    encoder = ClipEncoder(clip, threads=1)
    np.testing.assert_array_equal(encoder.encode_images([image]), embeddings)
    np.testing.assert_array_equal(encoder.encode_texts(["red"]), texts)
    np.testing.assert_array_equal(TransformersSam(sam, threads=1).embed(image).values, before)


def test_the_number_of_threads_is_restored(tmp_path: Path) -> None:
    import torch

    tiny_models.write_clip(tmp_path)
    before = torch.get_num_threads()
    ClipEncoder(tmp_path, threads=before + 1).encode_texts(["red"])
    assert torch.get_num_threads() == before
    assert not torch.is_inference_mode_enabled()


def test_crops_are_centred_on_black() -> None:
    rgb = noise(9, 12)
    mask = np.zeros((9, 12), bool)
    mask[2:4, 3:7] = True
    mask[2, 3] = False
    expected = np.zeros((4, 4, 3), np.uint8)
    expected[1:3] = rgb[2:4, 3:7]
    expected[1, 0] = 0
    np.testing.assert_array_equal(crop_to_mask(rgb, mask, 4), expected)
    assert crop_to_mask(rgb, mask, 32).shape == (32, 32, 3)


def test_duplicates_are_suppressed_and_the_smallest_mask_is_on_top() -> None:
    masks = np.zeros((3, 10, 10), bool)
    masks[0, :9] = True
    masks[1] = True
    masks[2, :2, :2] = True
    assert suppress_duplicates(masks, np.array([0.8, 0.9, 0.7], np.float32)).tolist() == [1, 2]
    assert suppress_duplicates(masks, np.array([0.9, 0.9, 0.7], np.float32)).tolist() == [0, 2]
    assert suppress_duplicates(masks[:0], np.zeros(0, np.float32)).tolist() == []
    labels = paint_labels(masks)
    assert labels.dtype == np.int32
    expected = np.ones((10, 10))
    expected[:9], expected[:2, :2] = 0, 2
    np.testing.assert_array_equal(labels, expected)
    assert (paint_labels(masks[:0]) == -1).all()


def masks_by_transformers(folder: Path, rgb: np.ndarray) -> np.ndarray:
    """Return [1024,3,H,W] masks at all points of the grid by the processor of transformers."""
    import torch
    from transformers import SamImageProcessorPil, SamModel

    side = tiny_models.SAM_SIDE_PX
    processor = SamImageProcessorPil(
        size={"longest_edge": side}, pad_size={"height": side, "width": side}
    )
    inputs = processor(Image.fromarray(rgb), return_tensors="pt")
    height, width = rgb.shape[:2]
    small = inputs["reshaped_input_sizes"][0].tolist()
    points = [
        [
            (column + 0.5) / 32 * width * small[1] / width,
            (row + 0.5) / 32 * height * small[0] / height,
        ]
        for row in range(32)
        for column in range(32)
    ]
    with torch.no_grad():
        output = SamModel.from_pretrained(folder)(
            pixel_values=inputs["pixel_values"], input_points=torch.tensor(points)[None, :, None]
        )
    (masks,) = processor.post_process_masks(
        output.pred_masks, inputs["original_sizes"], inputs["reshaped_input_sizes"]
    )
    return masks.numpy()


def max_difference(masks: np.ndarray, known: np.ndarray) -> float:
    """Return the largest share of pixels in which a mask differs from the nearest known one."""
    flat, other = (x.reshape(len(x), -1).astype(np.float32) for x in (masks, known))
    differing = flat.sum(1)[:, None] + other.sum(1) - 2 * flat @ other.T
    return float(differing.min(axis=1).max() / flat.shape[1])


@pytest.mark.parametrize("size", [(48, 96), (96, 60)])
def test_masks_are_those_of_transformers(tmp_path: Path, size: tuple[int, int]) -> None:
    tiny_models.write_sam(tmp_path)
    rgb = noise(*size) // 2
    rgb[: size[0] // 2, : size[1] // 3] += np.array((120, 20, 0), np.uint8)
    found = MaskGenerator(TransformersSam(tmp_path, threads=1))(rgb)
    known = masks_by_transformers(tmp_path, rgb)
    assert [masks.shape[1:] for masks in found] == [size] * 3
    assert sum(map(len, found)) > 20
    wrong = masks_by_transformers(tmp_path, np.ascontiguousarray(rgb[..., ::-1]))
    for level, masks in enumerate(found):
        assert max_difference(masks, known[:, 2 - level]) < 1e-3
        if len(masks) > 5:
            assert max_difference(masks, wrong[:, 2 - level]) > 0.02
    again = MaskGenerator(TransformersSam(tmp_path, threads=1))(rgb)
    for masks, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(masks, other)


def test_a_level_without_masks_is_empty(tmp_path: Path) -> None:
    import torch
    from transformers import SamModel

    tiny_models.write_sam(tmp_path / "sam")
    tiny_models.write_clip(tmp_path / "clip")
    model = SamModel.from_pretrained(tmp_path / "sam")
    with torch.no_grad():
        model.mask_decoder.iou_prediction_head.proj_out.bias.fill_(0.1)
    model.save_pretrained(tmp_path / "sam")
    source = open_source("clip", {"clip": tmp_path / "clip", "sam": tmp_path / "sam"}, threads=1)
    segments = source.segments(two_boxes()[0])
    assert segments.embeddings.shape == (0, tiny_models.DIMS)
    assert (segments.labels == -1).all()


def two_boxes() -> list[RgbdFrame]:
    """Return frames of a red box and a blue one."""
    return [change_room.see(change_room.home(), viewpoint) for viewpoint in change_room.VIEWPOINTS]


def true_masks(frames: list[RgbdFrame]) -> Callable[[np.ndarray], list[np.ndarray]]:
    """Return a mask generator with one level: the masks of the simulator."""
    known = {}
    for frame in frames:
        assert frame.labels is not None
        numbers = np.unique(frame.labels.instances)
        masks = np.stack([frame.labels.instances == k for k in numbers if k >= 0])
        known[frame.rgb.tobytes()] = [masks, masks[:0], masks[:0]]
    return lambda rgb: known[rgb.tobytes()]


def test_segments_are_the_visible_masks(tmp_path: Path) -> None:
    """Hidden masks have no embedding; pixels outside the mask of the frame have no label."""
    tiny_models.write_clip(tmp_path)
    encoder = ClipEncoder(tmp_path, threads=1)
    pose = look_at((0, 0, 0), (0, 1, 0))
    camera = camera_from_fov(8, 6, 1.0, pose)
    seen = np.ones((6, 8), bool)
    seen[:, 7] = False
    frame = RgbdFrame(noise(6, 8), np.zeros((6, 8), np.float32), camera, mask=seen)
    left, right, beyond = (np.zeros((6, 8), bool) for _ in range(3))
    left[:, :4], right[:, 4:], beyond[:, 7] = True, True, True
    whole = left | right
    levels = [np.stack([whole, left, right]), np.stack([beyond, left]), np.zeros((0, 6, 8), bool)]
    segments = ClipSource(encoder, lambda _: levels).segments(frame)
    expected = np.full((3, 6, 8), -1)
    expected[0, :, :4], expected[0, :, 4:7], expected[1, :, :4] = 0, 1, 2
    np.testing.assert_array_equal(segments.labels, expected)
    images = [crop_to_mask(frame.rgb, mask & seen, encoder.side_px) for mask in (left, right, left)]
    np.testing.assert_array_equal(segments.embeddings, encoder.encode_images(images))
    with pytest.raises(ValueError, match="it has no SAM to segment frames with"):
        ClipSource(encoder).segments(frame)


def test_queries_for_red_and_blue_find_the_boxes(tmp_path: Path) -> None:
    """The text embeddings are set from the image embeddings of transformers itself."""
    tiny_models.write_clip(tmp_path)
    frames = two_boxes()
    masks, *_ = true_masks(frames)(frames[0].rgb)
    shown = [
        image_by_transformers(tmp_path, crop_to_mask(frames[0].rgb, mask, tiny_models.SIDE_PX))
        for mask in masks
    ]
    # The boxes come last.
    *other, red, blue = np.linalg.pinv(np.stack(shown)).T
    everything_else = sum(other)
    words = {"red": red - blue - everything_else, "blue": blue - red - everything_else}
    words |= dict.fromkeys(CANONICAL, everything_else)
    tiny_models.set_text_embeddings(tmp_path, words)
    source = ClipSource(ClipEncoder(tmp_path, threads=1), true_masks(frames))
    source.unrelated = CANONICAL  # The embeddings of other words are random, and may be red.
    gaussian_map, _ = change_room.mapped()
    found = embed_semantics(gaussian_map, frames, source, code_dims=8, threads=1)
    assert found.features.shape == (gaussian_map.size, 24)
    with_features = replace(gaussian_map, features=found.features)
    queries = SemanticQueries(with_features, found.codec, source)
    for word, position in (("red", (2.2, 1.85)), ("blue", (3.0, 1.95))):
        best = queries.find(word)[0]
        np.testing.assert_allclose(best.center[:2], position, atol=0.1)
        np.testing.assert_allclose(best.high - best.low, (0.24, 0.24, 0.3), atol=0.15)


def test_commands_add_semantics_and_answer_queries(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tiny_models.write_clip(tmp_path / "clip")
    tiny_models.write_sam(tmp_path / "sam")
    robot = Controller(change_room.home(), **change_room.SIZE)
    capture(robot, change_room.VIEWPOINTS[:2], tmp_path / "visit")
    cameras = {frame.name: frame.read().camera for frame in open_dataset(tmp_path / "visit").frames}
    write_map_folder(tmp_path / "map", change_room.mapped()[0], {}, cameras)
    clip, sam = ["--clip", str(tmp_path / "clip")], ["--sam", str(tmp_path / "sam")]
    add = ["semantics", str(tmp_path / "map"), str(tmp_path / "visit")]
    query = ["query", str(tmp_path / "map"), "red", "--json"]

    def run(*arguments: str) -> str:
        result = CliRunner().invoke(app, arguments, catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.stdout

    with pytest.raises(ValueError, match="the source clip needs --clip and --sam, got --clip"):
        run(*add, *clip)
    run(*add, *clip, *sam, "--code-dims", "8", "--threads", "1")
    recorded = read_semantics(tmp_path / "map")
    assert recorded is not None
    cause, _ = recorded
    assert (cause.source, cause.levels) == ("clip", 3)
    assert cause.models == {"clip": clip[1], "sam": sam[1]}
    first = run(*query)
    assert isinstance(json.loads(first), list)
    assert MapSemantics.of_map(tmp_path / "map") is not None
    # Queries need no SAM, and CLIP may be moved; without SAM, updates are possible, with a warning.
    (tmp_path / "sam").rename(tmp_path / "gone")
    assert MapSemantics.of_map(tmp_path / "map") is None
    assert "new objects will have no semantic features" in caplog.text
    (tmp_path / "clip").rename(tmp_path / "moved")
    with pytest.raises(FileNotFoundError, match=r"is not there; give its folder with --clip DIR"):
        run(*query)
    assert run(*query, "--clip", str(tmp_path / "moved")) == first


def test_bad_sources_are_rejected() -> None:
    oracle = SemanticsCause.model_construct(source="oracle")
    assert open_text_source(oracle).dims == 512
    with pytest.raises(ValueError, match="the source oracle takes no --clip; it takes --code-dims"):
        open_source("oracle", {"clip": Path("clip")})
    with pytest.raises(ValueError, match="does not record the folder of its CLIP"):
        open_text_source(oracle.model_copy(update={"source": "clip"}))
