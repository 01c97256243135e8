"""Tiny CLIP and SAM models with random weights, in folders as of `hf download`."""

import json
from pathlib import Path
from typing import Any

import numpy as np

SIDE_PX = 32
DIMS = 32
SAM_SIDE_PX = 64
END = 513
"""Of the tokens: 256 bytes, the same at the end of a word, and the two ends of a text."""


def write_clip(folder: Path, seed: int = 0) -> None:
    """Write a CLIP with one token per letter and four image patches."""
    import torch
    from transformers import CLIPConfig, CLIPModel

    small = {"num_hidden_layers": 1, "num_attention_heads": 2, "intermediate_size": 16}
    config = CLIPConfig(
        text_config={
            **small,
            "hidden_size": 32,
            "vocab_size": END + 1,
            "max_position_embeddings": 16,
            "bos_token_id": END - 1,
            "eos_token_id": END,
            "pad_token_id": END,
        },
        vision_config={**small, "hidden_size": 32, "image_size": SIDE_PX, "patch_size": 16},
        projection_dim=DIMS,
        initializer_factor=10.0,
    )
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        torch.manual_seed(seed)
        model = CLIPModel(config)
        # So that the embedding depends on the image.
        attention = model.vision_model.encoder.layers[0].self_attn
        attention.v_proj.weight.mul_(5.0)
        attention.out_proj.weight.mul_(5.0)
        model.save_pretrained(folder)
    write_tokenizer(folder)


def write_tokenizer(folder: Path) -> None:
    from tokenizers.pre_tokenizers import ByteLevel

    letters = sorted(ByteLevel.alphabet())
    tokens = [
        *letters,
        *(f"{letter}</w>" for letter in letters),
        "<|startoftext|>",
        "<|endoftext|>",
    ]
    vocabulary = {token: row for row, token in enumerate(tokens)}
    assert vocabulary["<|endoftext|>"] == END
    (folder / "vocab.json").write_text(json.dumps(vocabulary))
    (folder / "merges.txt").write_text("#version: 0.2\n")


def set_text_embeddings(folder: Path, words: dict[str, np.ndarray]) -> None:
    """Set the embeddings [D] of words, by the last layer of the text encoder."""
    import torch
    from transformers import CLIPModel, CLIPTokenizer

    model, tokenizer = CLIPModel.from_pretrained(folder), CLIPTokenizer.from_pretrained(folder)
    with torch.no_grad():
        read = [
            model.text_model(**tokenizer(word, return_tensors="pt")).pooler_output[0]
            for word in words
        ]
        wanted = torch.from_numpy(np.stack(list(words.values())).astype(np.float32))
        model.text_projection.weight.copy_(torch.linalg.lstsq(torch.stack(read), wanted)[0].T)
    model.save_pretrained(folder)


def write_sam(folder: Path, seed: int = 2, **decoder: Any) -> None:
    """Its masks are blobs at random, others at other points, and all, it says, good."""
    import torch
    from transformers import SamConfig, SamModel

    vision = {
        "hidden_size": 16,
        "num_hidden_layers": 1,
        "num_attention_heads": 2,
        "image_size": SAM_SIDE_PX,
        "patch_size": 16,
        "output_channels": 8,
        "mlp_dim": 16,
        "global_attn_indexes": [0],
        "window_size": 2,
        "num_pos_feats": 4,
        "initializer_range": 0.1,
    }
    prompts = {"hidden_size": 8, "image_size": SAM_SIDE_PX, "patch_size": 16}
    masks = {"hidden_size": 8, "num_hidden_layers": 1, "num_attention_heads": 2, "mlp_dim": 16}
    config = SamConfig(
        vision_config=vision,
        prompt_encoder_config={**prompts, "mask_input_channels": 4},
        mask_decoder_config={**masks, "iou_head_hidden_dim": 8, **decoder},
    )
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        torch.manual_seed(seed)
        model = SamModel(config)
        for name, weights in model.named_parameters():
            if "positional_embedding" in name:
                weights.normal_(std=3.0)
            elif "point_embed" in name:
                weights.normal_(std=0.1)
            elif name.startswith("mask_decoder") and "bias" not in name and "norm" not in name:
                weights.normal_(std=0.7)
        head = model.mask_decoder.iou_prediction_head.proj_out
        head.weight.mul_(0.01)
        head.bias.fill_(0.9)
        for network in model.mask_decoder.output_hypernetworks_mlps:
            network.proj_out.weight.mul_(60.0)
        model.save_pretrained(folder)
