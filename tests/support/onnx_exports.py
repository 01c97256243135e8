"""Tiny CLIP, SigLIP and SAM models as ONNX files, in the layouts of published ones."""

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tiny_models import END, SAM_SIDE_PX, SIDE_PX

Axes = dict[str, dict[int, str]]


def export(
    path: Path,
    model: Any,
    function: Callable[..., Any],
    inputs: dict[str, Any],
    outputs: tuple[str, ...],
    axes: Axes | None = None,
) -> None:
    """Export a function of a model."""
    import torch

    class Function(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.model = model

        def forward(self, *values: Any) -> Any:
            return function(*values)

    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # Of tracing, which is right for these inputs.
        torch.onnx.export(
            Function().eval(),
            tuple(inputs.values()),
            path,
            dynamo=False,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes=axes or {},
        )


def write_onnx_clip(folder: Path, clip: Path, side: int | dict[str, int] = SIDE_PX) -> None:
    """Export the CLIP of another folder; its preprocessing is written in the old or new form."""
    import torch
    from transformers import CLIPModel, CLIPTokenizer

    model = CLIPModel.from_pretrained(clip, attn_implementation="eager")
    (folder / "onnx").mkdir(parents=True)
    export(
        folder / "onnx" / "vision_model.onnx",
        model,
        lambda pixels: model.get_image_features(pixels).pooler_output,
        {"pixel_values": torch.zeros(1, 3, SIDE_PX, SIDE_PX)},
        ("image_embeds",),
    )
    export(
        folder / "onnx" / "text_model.onnx",
        model,
        lambda tokens: model.get_text_features(tokens).pooler_output,
        {"input_ids": torch.tensor([[END - 1, 3, 4, END, END]])},
        ("text_embeds",),
        {"input_ids": {1: "length"}},
    )
    CLIPTokenizer.from_pretrained(clip, model_max_length=16).save_pretrained(folder)
    write_preprocessing(folder, crop_size=side, do_normalize=True, size=side)


def write_onnx_siglip(folder: Path) -> tuple[Any, Any]:
    """Write a SigLIP; return it, and its tokenizer."""
    import torch
    from transformers import SiglipConfig, SiglipModel

    tokenizer = siglip_tokenizer()
    small = {
        "num_hidden_layers": 1,
        "num_attention_heads": 2,
        "intermediate_size": 16,
        "hidden_size": 32,
    }
    config = SiglipConfig(
        text_config={**small, "vocab_size": len(tokenizer), "max_position_embeddings": 8},
        vision_config={**small, "image_size": SIDE_PX, "patch_size": 16},
        attn_implementation="eager",
    )
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        torch.manual_seed(0)
        model = SiglipModel(config).eval()
        for weights in model.parameters():
            if weights.ndim > 1:
                weights.normal_(std=0.2)
    folder.mkdir()
    export(
        folder / "vision_model.onnx",
        model,
        lambda pixels: model.vision_model(pixels)[:2],
        {"pixel_values": torch.zeros(1, 3, SIDE_PX, SIDE_PX)},
        ("last_hidden_state", "pooler_output"),
    )
    export(
        folder / "text_model.onnx",
        model,
        lambda tokens: model.text_model(tokens)[:2],
        {"input_ids": torch.ones(1, 8, dtype=torch.int64)},
        ("last_hidden_state", "pooler_output"),
    )
    tokenizer.save_pretrained(folder)
    size = {"height": SIDE_PX, "width": SIDE_PX}
    write_preprocessing(folder, image_mean=[0.5] * 3, image_std=[0.5] * 3, size=size)
    return model, tokenizer


def siglip_tokenizer() -> Any:
    """Return a tokenizer of one token for each letter, and one for the end and the padding."""
    from tokenizers import Tokenizer, models, normalizers, processors
    from transformers import PreTrainedTokenizerFast

    letters = [chr(code) for code in range(ord("a"), ord("z") + 1)]
    rows = {token: row for row, token in enumerate(["<unk>", "</s>", *letters])}
    tokenizer = Tokenizer(models.BPE(rows, [], unk_token="<unk>"))
    tokenizer.normalizer = normalizers.Lowercase()
    tokenizer.post_processor = processors.TemplateProcessing(
        single="$A </s>", special_tokens=[("</s>", 1)]
    )
    return PreTrainedTokenizerFast(
        tokenizer_object=tokenizer, pad_token="</s>", eos_token="</s>", model_max_length=8
    )


def write_preprocessing(folder: Path, **config: Any) -> None:
    (folder / "preprocessor_config.json").write_text(json.dumps(config))


def write_onnx_sam(folder: Path, sam: Path, layout: str) -> None:
    """Export the SAM of another folder: "transformers", "sam", "sam of bytes" or "efficient"."""
    from transformers import SamModel

    model = SamModel.from_pretrained(sam, attn_implementation="eager").eval()
    folder.mkdir()
    if layout == "transformers":
        export_as_transformers(folder, model)
    elif layout == "efficient":
        export_as_efficient_sam(folder, model)
    else:
        export_as_sam(folder, model, of_bytes=layout == "sam of bytes")


def decode(model: Any, embeddings: Any, points: Any, labels: Any, pad: bool = True) -> Any:
    """Return logits [1,N,4,s,s] and IoU [1,N,4] of the one mask and the three."""
    import torch

    prompts = model.prompt_encoder
    sparse = prompts._embed_points(points, labels, pad=pad)
    dense = prompts.no_mask_embed.weight.reshape(1, -1, 1, 1).expand_as(embeddings)
    positions = model.get_image_wide_positional_embeddings()
    decoded = [
        model.mask_decoder(embeddings, positions, sparse, dense, multimask_output=multiple)
        for multiple in (False, True)
    ]
    logits, ious = zip(*decoded, strict=True)
    return torch.cat(logits, 2), torch.cat(ious, 2)


def square(size: int = SAM_SIDE_PX) -> Any:
    import torch

    return torch.zeros(1, 3, size, size)


def embeddings_of(model: Any) -> Any:
    """Return embeddings of an image, as an example for tracing."""
    import torch

    with torch.no_grad():
        return model.get_image_embeddings(square())


def export_as_transformers(folder: Path, model: Any) -> None:
    import torch

    embeddings = embeddings_of(model)
    positions = model.get_image_wide_positional_embeddings()

    def run_decoder(points: Any, labels: Any, embeddings: Any, positions: Any) -> Any:
        sparse, dense = model.prompt_encoder(points, labels, None, None)
        logits, ious = model.mask_decoder(embeddings, positions, sparse, dense, True)
        return ious, logits

    export(
        folder / "vision_encoder.onnx",
        model,
        lambda pixels: (
            model.get_image_embeddings(pixels),
            model.get_image_wide_positional_embeddings(),
        ),
        {"pixel_values": square()},
        ("image_embeddings", "image_positional_embeddings"),
    )
    export(
        folder / "prompt_encoder_mask_decoder.onnx",
        model,
        run_decoder,
        {
            "input_points": torch.ones(1, 3, 1, 2),
            "input_labels": torch.ones(1, 3, 1, dtype=torch.int64),
            "image_embeddings": embeddings,
            "image_positional_embeddings": positions.detach(),
        },
        ("iou_scores", "pred_masks"),
        {"input_points": {1: "points"}, "input_labels": {1: "points"}},
    )


def export_as_sam(folder: Path, model: Any, of_bytes: bool) -> None:
    """Export as SAM does its decoder, and samexporter its encoder."""
    import torch

    mean = torch.tensor([123.675, 116.28, 103.53])
    std = torch.tensor([58.395, 57.12, 57.375])

    def embed_bytes(image: Any) -> Any:
        pixels = ((image - mean) / std).permute(2, 0, 1)
        padding = (0, SAM_SIDE_PX - image.shape[1], 0, SAM_SIDE_PX - image.shape[0])
        return model.get_image_embeddings(torch.nn.functional.pad(pixels, padding)[None])

    def run_decoder(
        embeddings: Any, points: Any, labels: Any, mask: Any, has_mask: Any, size: Any
    ) -> Any:
        logits, ious = decode(model, embeddings, points[:, None], labels[:, None], pad=False)
        unused = 0 * (mask.sum() + has_mask.sum() + size.sum())  # Tracing drops other inputs.
        return logits[:, 0] + unused, ious[:, 0], logits[:, 0] + unused

    export(
        folder / "mobile_sam.encoder.onnx",
        model,
        embed_bytes if of_bytes else model.get_image_embeddings,
        {"input_image": square()[0].permute(1, 2, 0) if of_bytes else square()},
        ("image_embeddings",),
        {"input_image": {0: "height", 1: "width"}} if of_bytes else None,
    )
    export(
        folder / "mobile_sam.decoder.onnx",
        model,
        run_decoder,
        {
            "image_embeddings": embeddings_of(model),
            "point_coords": torch.ones(1, 2, 2),
            "point_labels": torch.tensor([[1.0, -1.0]]),
            "mask_input": torch.zeros(1, 1, 256, 256),
            "has_mask_input": torch.zeros(1),
            "orig_im_size": torch.tensor([256.0, 256.0]),
        },
        ("masks", "iou_predictions", "low_res_masks"),
        {"point_coords": {1: "points"}, "point_labels": {1: "points"}},
    )


def export_as_efficient_sam(folder: Path, model: Any) -> None:
    import torch
    from torch.nn.functional import interpolate

    mean = torch.tensor([0.485, 0.456, 0.406]).reshape(1, 3, 1, 1)
    std = torch.tensor([0.229, 0.224, 0.225]).reshape(1, 3, 1, 1)

    def embed(images: Any) -> Any:
        stretched = interpolate(images, (SAM_SIDE_PX, SAM_SIDE_PX), mode="bilinear")
        return model.get_image_embeddings((stretched - mean) / std)

    def run_decoder(embeddings: Any, points: Any, labels: Any, size: Any) -> Any:
        scaled = points * (SAM_SIDE_PX / size.flip(0))
        logits, ious = decode(model, embeddings, scaled, labels)
        # The best mask is the first one.
        order = ious[:, :, 1:].argsort(dim=2, descending=True)
        best = logits[:, :, 1:].gather(2, order[..., None, None].expand_as(logits[:, :, 1:]))
        masks = interpolate(best[0], (int(size[0]), int(size[1])), mode="bilinear")
        return masks[None], ious[:, :, 1:].gather(2, order), best

    export(
        folder / "efficient_sam_vitt_encoder.onnx",
        model,
        embed,
        {"batched_images": square(48)},
        ("image_embeddings",),
        {"batched_images": {0: "batch", 2: "height", 3: "width"}},
    )
    export(
        folder / "efficient_sam_vitt_decoder.onnx",
        model,
        run_decoder,
        {
            "image_embeddings": embeddings_of(model),
            "batched_point_coords": torch.ones(1, 3, 1, 2),
            "batched_point_labels": torch.ones(1, 3, 1),
            "orig_im_size": torch.tensor([256, 256]),
        },
        ("output_masks", "iou_predictions", "low_res_masks"),
        {"batched_point_coords": {1: "points"}, "batched_point_labels": {1: "points"}},
    )
