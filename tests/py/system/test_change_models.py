"""Features from models: ONNX files and folders of transformers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import change_room
import numpy as np
import pytest
from change_images import texture
from change_room import VIEWPOINTS, see

from gslts.change.detector import ChangeDetector
from gslts.change.features import FeatureExtractor, feature_extractor

PATCH = 16


def patch_weights(depth: int = 5) -> np.ndarray:
    """Return the weights [D,3,16,16] of an encoder of one layer."""
    rng = np.random.default_rng(0)
    return rng.normal(0, 0.1, (depth, 3, PATCH, PATCH)).astype(np.float32)


def write_onnx(
    path: Path,
    shape: tuple = (1, 3, 64, 96),
    *,
    inputs: int = 1,
    flat: bool = False,
    half: bool = False,
) -> None:
    """Return an encoder from [1,3,H,W] to [1,5,H/16,W/16], like a small EfficientSAM."""
    from onnx import TensorProto, checker, helper, numpy_helper, save_model

    kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
    names = [f"image_{k}" for k in range(inputs)]
    weights = patch_weights()
    if half:
        weights = weights.astype(np.float16)
    nodes = [
        helper.make_node(
            "Conv", ["image_0", "weights"], ["patches"], strides=[PATCH, PATCH], name="patches"
        )
    ]
    if flat:
        nodes.append(helper.make_node("Flatten", ["patches"], ["embeddings"]))
    else:
        nodes.append(helper.make_node("Identity", ["patches"], ["embeddings"]))
    graph = helper.make_graph(
        nodes,
        "encoder",
        [helper.make_tensor_value_info(name, kind, shape) for name in names],
        [helper.make_tensor_value_info("embeddings", kind, ("b", "n") if flat else list("bdhw"))],
        [numpy_helper.from_array(weights, "weights")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    if len(shape) == 4:
        checker.check_model(model)
    save_model(model, path)


def by_numpy(image: np.ndarray) -> np.ndarray:
    """Return [h,w,5] the output of that encoder for an image [H,W,3] of its own size."""
    height, width = image.shape[:2]
    patches = image.reshape(height // PATCH, PATCH, width // PATCH, PATCH, 3)
    return np.einsum("aibjc,dcij->abd", patches, patch_weights())


def test_an_onnx_encoder_gets_the_image_unchanged(tmp_path: Path) -> None:
    write_onnx(tmp_path / "encoder.onnx")
    encoder = feature_extractor(f"onnx:{tmp_path / 'encoder.onnx'}")
    image = np.random.default_rng(1).random((64, 96, 3)).astype(np.float32)
    features = encoder(image)
    assert features.dtype == np.float32
    np.testing.assert_allclose(features, by_numpy(image), atol=1e-4)
    # An image of another size is resized first.
    assert encoder(texture(0)).shape == (4, 6, 5)


def test_open_sides_of_an_onnx_encoder_are_those_of_sam(tmp_path: Path) -> None:
    write_onnx(tmp_path / "encoder.onnx", ("batch", 3, "height", "width"))
    encoder = feature_extractor(f"onnx:{tmp_path / 'encoder.onnx'}")
    assert encoder(texture(0)).shape == (64, 64, 5)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"shape": (1, 1, 64, 64)}, r"expected one input \[1,3,H,W\], got \[1, 1, 64, 64\]"),
        ({"shape": (3, 64, 64)}, r"expected one input \[1,3,H,W\], got \[3, 64, 64\]|no ONNX"),
        ({"inputs": 2}, r"expected one input \[1,3,H,W\], got \[1, 3, 64, 96\], \[1, 3, 64, 96\]"),
        ({"half": True}, r"expected an input of float32, got tensor\(float16\)"),
        ({"shape": (1, 3, 1 << 17, 64)}, "are larger than 4096 px"),
        ({"flat": True}, r"expected features \[1,D,h,w\], got \[1, 120\]"),
    ],
)
def test_onnx_models_other_than_encoders_are_named(
    tmp_path: Path, settings: dict, message: str
) -> None:
    path = tmp_path / "encoder.onnx"
    write_onnx(path, **settings)
    with pytest.raises(ValueError, match=message) as raised:
        feature_extractor(f"onnx:{path}")
    assert str(raised.value).startswith(f"{path}: ")


def test_files_other_than_onnx_are_named(tmp_path: Path) -> None:
    path = tmp_path / "encoder.onnx"
    with pytest.raises(FileNotFoundError, match=r"encoder\.onnx"):
        feature_extractor(f"onnx:{path}")
    path.write_bytes(b"no model at all")
    with pytest.raises(ValueError, match=r"encoder\.onnx: it is no ONNX model"):
        feature_extractor(f"onnx:{path}")
    with pytest.raises(IsADirectoryError):
        feature_extractor(f"onnx:{tmp_path}")


VISION = {
    "hidden_size": 16,
    "num_hidden_layers": 1,
    "num_attention_heads": 2,
    "image_size": 64,
    "patch_size": 16,
}


def write_dinov2(folder: Path) -> None:
    from transformers import Dinov2Config, Dinov2Model

    Dinov2Model(Dinov2Config(**VISION)).save_pretrained(folder)


def write_sam(folder: Path, *, encoder_only: bool = False) -> None:
    from transformers import SamConfig, SamModel, SamVisionConfig, SamVisionModel

    vision = SamVisionConfig(
        **VISION,
        output_channels=8,
        mlp_dim=16,
        global_attn_indexes=[0],
        window_size=2,
        initializer_range=0.1,  # That of SAM, 1e-10, is no start for numbers that are compared.
    )
    if encoder_only:
        SamVisionModel(vision).save_pretrained(folder)
        return
    prompts = {"hidden_size": 8, "image_size": 64, "patch_size": 16, "mask_input_channels": 4}
    masks = {"hidden_size": 8, "num_hidden_layers": 1, "num_attention_heads": 2, "mlp_dim": 16}
    config = SamConfig(
        vision_config=vision,
        prompt_encoder_config=prompts,
        mask_decoder_config={**masks, "iou_head_hidden_dim": 8},
    )
    SamModel(config).save_pretrained(folder)


def write_sam_encoder(folder: Path) -> None:
    write_sam(folder, encoder_only=True)


def test_tokens_of_dinov2_are_those_of_their_patches(tmp_path: Path) -> None:
    """Without the class token: a patch changes its own features most."""
    write_dinov2(tmp_path)
    encoder = feature_extractor(f"transformers:{tmp_path}")
    image = np.full((64, 64, 3), 0.5, np.float32)
    changed = image.copy()
    changed[16:32, 48:64] = 1, 0, 0
    before, after = encoder(image), encoder(changed)
    assert before.shape == (4, 4, 16)
    assert before.dtype == np.float32
    change = np.abs(after - before).sum(axis=-1)
    assert np.unravel_index(change.argmax(), change.shape) == (1, 3)


def normalized(image: np.ndarray) -> Any:
    """Normalize to [1,3,H,W] as published for DINOv2 and SAM, with ImageNet statistics."""
    import torch

    pixels = torch.from_numpy(image).permute(2, 0, 1)[None] / 255
    mean = torch.tensor([0.485, 0.456, 0.406])[:, None, None]
    std = torch.tensor([0.229, 0.224, 0.225])[:, None, None]
    return (pixels - mean) / std


def test_features_of_dinov2_are_its_tokens(tmp_path: Path) -> None:
    import torch
    from transformers import AutoModel

    write_dinov2(tmp_path)
    image = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    features = feature_extractor(f"transformers:{tmp_path}")(image.astype(np.float32) / 255)
    model = AutoModel.from_pretrained(tmp_path).eval()
    with torch.no_grad():
        tokens = model(pixel_values=normalized(image)).last_hidden_state
    assert tokens.shape == (1, 17, 16)
    np.testing.assert_allclose(features.reshape(16, 16), tokens[0, 1:].numpy(), atol=1e-5)


@pytest.mark.parametrize("write", [write_sam, write_sam_encoder])
def test_features_of_sam_are_its_image_embeddings(
    tmp_path: Path, write: Callable[[Path], None]
) -> None:
    import torch
    from transformers import AutoModel

    write(tmp_path)
    image = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    features = feature_extractor(f"transformers:{tmp_path}")(image.astype(np.float32) / 255)
    model = AutoModel.from_pretrained(tmp_path).eval()
    encoder = getattr(model, "vision_encoder", model)
    with torch.no_grad():
        embeddings = encoder(normalized(image)).last_hidden_state
    assert embeddings.shape == (1, 8, 4, 4)
    assert embeddings.std() > 0.1
    np.testing.assert_allclose(features, embeddings[0].permute(1, 2, 0).numpy(), atol=1e-4)


def spoil_config(folder: Path) -> None:
    (folder / "config.json").write_text("{no json")


def spoil_kind(folder: Path) -> None:
    (folder / "config.json").write_text('{"model_type": "sculptor"}')


def spoil_weights(folder: Path) -> None:
    (folder / "model.safetensors").write_bytes(b"\xff" * 100)


def lose_a_weight(folder: Path) -> None:
    from safetensors.torch import load_file, save_file

    weights = load_file(folder / "model.safetensors")
    del weights["embeddings.cls_token"]
    save_file(weights, folder / "model.safetensors", metadata={"format": "pt"})


def pickle_weights(folder: Path) -> None:
    import torch
    from safetensors.torch import load_file

    torch.save(load_file(folder / "model.safetensors"), folder / "pytorch_model.bin")
    (folder / "model.safetensors").unlink()


def bring_code(folder: Path) -> None:
    (folder / "config.json").write_text(
        '{"model_type": "sculptor", "auto_map": {"AutoConfig": "code.C", "AutoModel": "code.M"}}'
    )
    (folder / "code.py").write_text("raise SystemExit('it ran')")


@pytest.mark.parametrize(
    ("spoil", "error", "message"),
    [
        (spoil_config, ValueError, r"config\.json is no JSON object"),
        (spoil_kind, ValueError, "sculptor"),
        (spoil_weights, ValueError, "header"),
        (lose_a_weight, ValueError, r"its weights lack embeddings\.cls_token"),
        (
            pickle_weights,
            ValueError,
            r"pytorch_model\.bin is pickled and could run code: it is not read",
        ),
        (bring_code, ValueError, "custom code"),
    ],
)
def test_damaged_models_are_named(
    tmp_path: Path,
    spoil: Callable[[Path], None],
    error: type[Exception],
    message: str,
) -> None:
    folder = tmp_path / "encoder"
    write_dinov2(folder)
    spoil(folder)
    with pytest.raises(error, match=message) as raised:
        feature_extractor(f"transformers:{folder}")
    assert str(folder) in str(raised.value)


def test_models_without_images_are_named(tmp_path: Path) -> None:
    from transformers import BertConfig, BertModel, CLIPConfig, CLIPModel

    with pytest.raises(FileNotFoundError, match=r"there is no config\.json"):
        feature_extractor(f"transformers:{tmp_path}")
    small = {"hidden_size": 8, "num_hidden_layers": 1, "num_attention_heads": 2}
    text = {**small, "vocab_size": 16, "intermediate_size": 8}
    BertModel(BertConfig(**text)).save_pretrained(tmp_path / "bert")
    with pytest.raises(ValueError, match="bert: its configuration lacks image_size"):
        feature_extractor(f"transformers:{tmp_path / 'bert'}")
    both = CLIPConfig(
        text_config={**text, "eos_token_id": 1, "bos_token_id": 0, "pad_token_id": 1},
        vision_config={**VISION, "intermediate_size": 8},
        projection_dim=8,
    )
    CLIPModel(both).save_pretrained(tmp_path / "clip")
    with pytest.raises(ValueError, match="clip: a CLIPModel is no encoder of images"):
        feature_extractor(f"transformers:{tmp_path / 'clip'}")


@pytest.mark.parametrize("kind", ["onnx", "dinov2", "sam"])
def test_the_detector_works_with_features_of_models(tmp_path: Path, kind: str) -> None:
    """Random encoders still detect an added box, as 18 of 18 with other seeds do."""
    import torch

    torch.manual_seed(0)
    write: dict[str, Callable[[Path], None]] = {
        "onnx": write_onnx,
        "dinov2": write_dinov2,
        "sam": write_sam,
    }
    write[kind](tmp_path / "encoder")
    name = f"{'onnx' if kind == 'onnx' else 'transformers'}:{tmp_path / 'encoder'}"
    features: FeatureExtractor = feature_extractor(name)
    detector = ChangeDetector(change_room.mapped()[0], change_room.CONFIG, features=features)
    added = change_room.thing("Box|3", 2.6, 1.8, change_room.YELLOW, "Block|1")
    for viewpoint in VIEWPOINTS:
        detection = detector.detect(see(change_room.home().with_object(added), viewpoint))
        assert [change.kind for change in detection.changes] == ["addition"]
        assert detection.feature_mask is not None
        assert detection.feature_mask.shape == (120, 160)
