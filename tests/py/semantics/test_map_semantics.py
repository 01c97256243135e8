"""Semantics of a map folder: thresholds, and files that were changed since."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from detector_files import write_color_detector

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics import map_semantics, registry
from gslts.semantics.files import write_autoencoder
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.registry import open_text_semantics
from gslts.semantics.source import Oracle
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.semantics.vocabulary import UNRELATED
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import open_map, write_map_folder

NAMES = ("tomato", "book", "banana")


def write_words(folder: Path, features: np.ndarray, **cause: Any) -> None:
    """Write a map folder with semantic features."""
    size = len(features)
    gaussian_map = GaussianMap(
        means=np.random.default_rng(0).uniform(0, 1, (size, 3)).astype(np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.full((size, 3), -4, np.float32),
        logit_opacities=np.full(size, 3, np.float32),
        sh=np.zeros((size, 1, 3), np.float32),
        features=features.astype(np.float32),
    )
    write_map_folder(folder, gaussian_map, {}, {})
    with open_map(folder, writable=True) as store:
        cause = {"dataset": "visit", "levels": 1, "code_dims": features.shape[1], **cause}
        store.commit_features(gaussian_map, SemanticsCause(**cause))


class Unsure(Oracle):
    """Matches whatever fits a text better than the canonical phrases, as CLIP does."""

    threshold = 0.5
    unrelated = UNRELATED


def test_updates_and_navigation_have_the_threshold_of_queries(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    codec = train_autoencoder(Oracle().encode(NAMES), 8, steps=400)
    path = tmp_path / "map"
    path.mkdir()
    digest = write_autoencoder(codec, path)
    (path / "semantics").rename(tmp_path / "semantics")
    path.rmdir()
    features = np.repeat(codec.encode(Oracle().encode(NAMES)), 20, axis=0)
    write_words(path, features, source="clip", names=(), autoencoder=digest)
    (tmp_path / "semantics").rename(path / "semantics")
    monkeypatch.setattr(map_semantics, "open_source", lambda *_: Unsure())
    monkeypatch.setattr(registry, "open_text_source", lambda *_: Unsure())
    threshold = SemanticQueries.of_map(path).threshold
    assert threshold > Unsure.threshold
    assert open_text_semantics(path)[1].threshold == threshold
    semantics = MapSemantics.of_map(path)
    assert semantics is not None
    assert semantics.source.threshold == threshold


@pytest.mark.parametrize(
    "changed",
    ["book\ntomato\nbanana", "#tomato\nbook\nbanana", "book\nbanana", "#\ntomato\nbook", ""],
)
def test_other_names_than_those_of_the_map_are_not_used(
    changed: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write_color_detector(tmp_path / "net.onnx", [(200, 40, 30), (30, 60, 200), (230, 200, 30)], 320)
    names = tmp_path / "names.txt"
    names.write_text("\n".join(NAMES))
    models = {"model": str(tmp_path / "net.onnx"), "names": str(names)}
    path = tmp_path / "map"
    write_words(path, np.ones((5, 4)), source="detector", names=NAMES, models=models)
    semantics = MapSemantics.of_map(path)
    assert semantics is not None
    assert semantics.source.names == NAMES
    assert not caplog.text
    names.write_text(changed)
    assert MapSemantics.of_map(path) is None
    assert f"new objects will have no semantic features: {names}: " in caplog.text
