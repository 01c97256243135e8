"""Command `gslts semantics`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gslts.cli.arguments import WritableMap
from gslts.cli.mapping import Dataset, Threads

# Imports of commands are inside the functions, so that `gslts --help` answers at once.


class Source(StrEnum):
    """Semantic sources."""

    ORACLE = "oracle"
    CLIP = "clip"
    DETECTOR = "detector"


def semantics(
    map_path: WritableMap,
    dataset: Dataset,
    source: Annotated[
        Source | None,
        typer.Option(
            help="detector: a detector or instance segmentation network; clip: SAM and CLIP; "
            "oracle: ground-truth labels of the dataset. By default the source whose models are "
            "given, oracle without any."
        ),
    ] = None,
    clip: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="CLIP, SigLIP or MobileCLIP in ONNX (vision_model.onnx, text_model.onnx, "
            "tokenizer), or CLIP of transformers in safetensors.",
        ),
    ] = None,
    sam: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="SAM, MobileSAM or EfficientSAM in ONNX (encoder and decoder), or SAM of "
            "transformers in safetensors.",
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Detector: .onnx, or .weights of Darknet with its .cfg beside it."
        ),
    ] = None,
    names: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Names of the classes of the detector, one per line."),
    ] = None,
    layout: Annotated[
        str | None,
        typer.Option(help="Layout of the outputs of the detector, if it is not recognized."),
    ] = None,
    text_model: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Model of sentence embeddings: model.onnx and tokenizer.json."
        ),
    ] = None,
    code_dims: Annotated[
        int | None,
        typer.Option(
            min=8,
            max=64,
            help="Length of the semantic feature of a Gaussian, but for a detector. Default: 32.",
        ),
    ] = None,
    refine: Annotated[
        int,
        typer.Option(
            min=0, help="Gradient steps after the closed-form solution, but for a detector."
        ),
    ] = 0,
    threads: Threads = 0,
) -> None:
    """Add semantic features to a map, from the frames it was made from.

    Example: gslts semantics out/map out/day/before

    Example: gslts semantics out/map out/visit --model yolo.onnx --names names.txt

    Example: gslts semantics out/map out/visit --clip models/clip --sam models/sam
    """
    import time

    from tqdm import tqdm

    from gslts.semantics.add_semantics import add_semantics

    given = {"clip": clip, "sam": sam, "model": model, "names": names, "text_model": text_model}
    models = {name: path for name, path in given.items() if path}
    start_s = time.perf_counter()
    version = add_semantics(
        map_path,
        dataset,
        source.value if source else None,
        models,
        code_dims=code_dims,
        layout=layout,
        refine=refine,
        threads=threads,
        progress=lambda frames: tqdm(frames, desc="semantics", unit="frame", disable=None),
    )
    typer.echo(
        f"{map_path}: added semantic features as version {version.number}, in "
        f"{time.perf_counter() - start_s:.0f} s"
    )
