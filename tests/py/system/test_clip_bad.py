"""CLIP and SAM in folders that are damaged, incomplete or malicious."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tiny_models

from gslts.semantics.clip import ClipEncoder
from gslts.semantics.sam_transformers import TransformersSam

pytest.importorskip("transformers", reason="models need transformers")


def lose_folder(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


def lose_config(folder: Path) -> None:
    (folder / "config.json").unlink()


def lose_weights(folder: Path) -> None:
    (folder / "model.safetensors").unlink()


def lose_merges(folder: Path) -> None:
    (folder / "merges.txt").unlink()


def spoil_config(folder: Path) -> None:
    (folder / "config.json").write_text("[]")


def spoil_model_type(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps({**config, "model_type": "siglip"}))


def widen(folder: Path) -> None:
    config = json.loads((folder / "config.json").read_text())
    for part in ("text_config", "prompt_encoder_config"):
        if part in config:
            config[part]["hidden_size"] *= 2
    (folder / "config.json").write_text(json.dumps(config))


def cut_weights(folder: Path) -> None:
    path = folder / "model.safetensors"
    path.write_bytes(path.read_bytes()[:-100])


def edit_weights(folder: Path, edit: Callable[[dict], None]) -> None:
    from safetensors.torch import load, save_file

    weights = load((folder / "model.safetensors").read_bytes())
    edit(weights)
    save_file(weights, folder / "model.safetensors", metadata={"format": "pt"})


def lose_a_weight(folder: Path) -> None:
    edit_weights(folder, lambda weights: weights.pop(max(weights)))


def spoil_tokenizer(folder: Path) -> None:
    (folder / "vocab.json").write_text("{no json")


def other_tokenizer(folder: Path) -> None:
    words = json.loads((folder / "vocab.json").read_text())
    (folder / "vocab.json").write_text(json.dumps({**words, "more</w>": len(words)}))


HOW = r"hf download \S+/\S+ --local-dir "
BOTH = [
    (lose_folder, FileNotFoundError, f"no such folder; .*{HOW}"),
    (lose_config, FileNotFoundError, rf"no config\.json; .*{HOW}"),
    (lose_weights, FileNotFoundError, rf"no model\.safetensors; .*{HOW}"),
    (spoil_config, ValueError, r"config\.json is no JSON object"),
    (spoil_model_type, ValueError, r"expected a model of type \w+, got siglip"),
    (widen, ValueError, r"do not fit its config\.json: \S+: expected \[.*\], got \["),
    (cut_weights, ValueError, "its weights cannot be read: .*incomplete"),
    (lose_a_weight, ValueError, r"its weights lack \w+\."),
]
CLIP_ONLY = [
    (lose_merges, FileNotFoundError, rf"no tokenizer\.json and no vocab\.json .*{HOW}"),
    (spoil_tokenizer, ValueError, "the tokenizer cannot be read"),
    (other_tokenizer, ValueError, "the tokenizer does not belong to the weights"),
]


@pytest.mark.parametrize(
    ("kind", "spoil", "error", "message"),
    [
        *(("clip", *case) for case in (*BOTH, *CLIP_ONLY)),
        *(("sam", *case) for case in BOTH),
    ],
)
def test_damaged_models_are_named_in_one_line(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    kind: str,
    spoil: Callable[[Path], None],
    error: type[Exception],
    message: str,
) -> None:
    folder = tmp_path / "model"
    write, read = {
        "clip": (tiny_models.write_clip, ClipEncoder),
        "sam": (tiny_models.write_sam, TransformersSam),
    }[kind]
    write(folder)
    spoil(folder)
    capfd.readouterr()
    with pytest.raises(error, match=message) as raised:
        read(folder)
    assert str(raised.value).startswith(f"{folder}: ")
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def test_weights_that_are_not_finite_are_named(tmp_path: Path) -> None:
    tiny_models.write_clip(tmp_path)
    edit_weights(tmp_path, lambda weights: weights["visual_projection.weight"].fill_(np.nan))
    with pytest.raises(ValueError, match="the weights give embeddings that are not finite"):
        ClipEncoder(tmp_path).encode_images([np.zeros((32, 32, 3), np.uint8)])


def test_a_sam_with_another_number_of_levels_is_rejected(tmp_path: Path) -> None:
    tiny_models.write_sam(tmp_path, num_multimask_outputs=2)
    with pytest.raises(ValueError, match="expected 3 masks per point, got 2"):
        TransformersSam(tmp_path)


class Trap:
    """Creates a folder when it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple:
        return Path.mkdir, (self.folder,)


@pytest.mark.parametrize("name", ["pytorch_model.bin", "adapter_model.bin"])
def test_pickled_weights_do_not_run(tmp_path: Path, name: str) -> None:
    import torch

    folder, ran = tmp_path / "clip", tmp_path / "it_ran"
    tiny_models.write_clip(folder)
    torch.save({"logit_scale": Trap(ran)}, folder / name)
    torch.load(folder / name, weights_only=False)
    assert ran.exists()
    ran.rmdir()
    # Beside safetensors it is ignored.
    ClipEncoder(folder)
    if name == "adapter_model.bin":
        config = json.loads((folder / "config.json").read_text())
        (folder / "config.json").write_text(json.dumps({**config, "transformers_weights": name}))
        message = f"names other weights, {name}; only model.safetensors is read"
    else:
        lose_weights(folder)
        message = f"{name} is pickled and could run code: it is not read; .*save_pretrained"
    with pytest.raises(ValueError, match=message):
        ClipEncoder(folder)
    assert not ran.exists()


def test_without_transformers_the_message_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "transformers", None)
    for read in (ClipEncoder, TransformersSam):
        with pytest.raises(ImportError, match=r"pip install 'gslts\[models\]'"):
            read(tmp_path)
