"""Semantic sources, autoencoder, relevance and lifting of features."""

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import change_room
import numpy as np
import pytest

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import Labels
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import render
from gslts.semantics.autoencoder import Autoencoder, autoencoder_bytes, read_autoencoder
from gslts.semantics.embed import embed_semantics
from gslts.semantics.lift import lift_features
from gslts.semantics.source import CANONICAL, Oracle, Segments, relevance
from gslts.semantics.train_autoencoder import loss_and_gradients, train_autoencoder


def test_relevance_by_hand() -> None:
    embeddings = np.array([[1, 0], [0, 1], [0.6, 0.8]], np.float32)
    query, canonical = np.array([1, 0], np.float32), np.array([[0, 1], [0, -1]], np.float32)
    expected = [1 / (1 + np.exp(-1)), 1 / (1 + np.exp(1)), 1 / (1 + np.exp(0.2))]
    found = relevance(embeddings @ query, embeddings @ canonical.T)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_oracle_embeddings_of_types_differ() -> None:
    oracle = Oracle()
    names = ["Mug", "AlarmClock", "Sofa", *CANONICAL]
    embeddings = oracle.encode(names)
    cosines = embeddings @ embeddings.T
    np.testing.assert_allclose(np.diag(cosines), 1, rtol=1e-6)
    assert np.abs(cosines - np.diag(np.diag(cosines))).max() < 0.2
    np.testing.assert_array_equal(oracle.encode(["alarm clock"]), embeddings[1:2])


def test_the_oracle_needs_labels() -> None:
    frame = change_room.see(change_room.home(), change_room.VIEWPOINTS[0])
    segments = Oracle().segments(frame)
    assert frame.labels is not None
    assert segments.labels.shape == (1, 120, 160)
    types = np.array([*frame.labels.types, ""])[frame.labels.instances]
    mug = segments.embeddings[segments.labels[0][types == "Box"]]
    np.testing.assert_array_equal(mug, np.broadcast_to(Oracle().encode(["Box"]), mug.shape))
    assert (segments.labels[0][types == ""] == -1).all()
    with pytest.raises(ValueError, match="Oracle: the frame has no labels"):
        Oracle().segments(replace(frame, labels=None))


def test_frames_without_a_segment_are_rejected() -> None:
    frame = change_room.see(change_room.home(), change_room.VIEWPOINTS[0])
    nothing = Labels(np.full(frame.depth.shape, -1, np.int32), ())
    gaussian_map, _ = change_room.mapped()
    with pytest.raises(ValueError, match=r"^embed_semantics: frames: none has a segment$"):
        embed_semantics(gaussian_map, [replace(frame, labels=nothing)], Oracle())


@pytest.mark.parametrize(
    ("labels", "message"),
    [
        (np.zeros((4, 2, 2), np.int32), r"labels: expected int32 \[1\.\.3,H,W\]"),
        (np.zeros((1, 2, 2), np.int64), r"labels: expected int32 .* got int64"),
        (np.full((1, 2, 2), 2, np.int32), r"labels: must be in -1\.\.1"),
    ],
)
def test_bad_segments_are_rejected(labels: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Segments(labels, np.eye(2, dtype=np.float32))


@pytest.mark.parametrize("code_dims", [8, 32])
def test_embeddings_are_reconstructed_from_codes(code_dims: int, tmp_path: Path) -> None:
    names = [f"Object{k}" for k in range(40)]
    embeddings = Oracle().encode(names)
    model = train_autoencoder(embeddings, code_dims)
    codes = model.encode(embeddings)
    assert codes.shape == (40, code_dims)
    found = model.decode(codes)
    assert (found * embeddings).sum(axis=1).min() > 0.95
    assert (np.argmax(found @ embeddings.T, axis=1) == np.arange(40)).all()
    mixed = (codes + codes[::-1]) / 2
    np.testing.assert_allclose(
        model.cosines(mixed, embeddings), model.decode(mixed) @ embeddings.T, atol=2e-5
    )
    content = autoencoder_bytes(model)
    path = tmp_path / "autoencoder.safetensors"
    path.write_bytes(content)
    again = read_autoencoder(path, hashlib.sha256(content).hexdigest())
    np.testing.assert_array_equal(again.decode(codes), found)
    with pytest.raises(ValueError, match=r"autoencoder\.safetensors: the file is damaged"):
        read_autoencoder(path, hashlib.sha256(b"").hexdigest())


def test_training_is_repeatable() -> None:
    embeddings = Oracle().encode(["Mug", "Cup"])
    np.testing.assert_array_equal(
        train_autoencoder(embeddings, steps=20).encode(embeddings),
        train_autoencoder(embeddings, steps=20).encode(embeddings),
    )


def test_training_minimizes_the_losses_of_langsplat() -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is the oracle of the gradients")
    functional = torch.nn.functional
    embeddings = Oracle().encode([f"Object{k}" for k in range(5)])
    weights = dict(train_autoencoder(embeddings, 8, steps=3).weights)
    loss, gradients = loss_and_gradients(weights, embeddings)
    tensors = {name: torch.tensor(array, requires_grad=True) for name, array in weights.items()}

    def apply(part: str, x: Any) -> Any:
        hidden = functional.linear(x, tensors[f"{part}.0.weight"], tensors[f"{part}.0.bias"])
        hidden = functional.gelu(hidden, approximate="tanh")
        x = functional.linear(hidden, tensors[f"{part}.2.weight"], tensors[f"{part}.2.bias"])
        return functional.normalize(x, dim=1)

    batch = torch.tensor(embeddings)
    decoded = apply("decoder", apply("encoder", batch))
    expected = 1 - (decoded * batch).sum(dim=1).mean() + ((decoded - batch) ** 2).sum(dim=1).mean()
    expected.backward()
    assert loss == pytest.approx(float(expected.detach()), rel=1e-5)
    for name, tensor in tensors.items():
        np.testing.assert_allclose(gradients[name], tensor.grad, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize(
    "content",
    [b"", b"\x80\x04K\x01.", b"{}" * 99],
)
def test_bad_files_are_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "autoencoder.safetensors"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"autoencoder\.safetensors: not an autoencoder"):
        read_autoencoder(path, hashlib.sha256(content).hexdigest())


def test_bad_lengths_are_rejected() -> None:
    embeddings = Oracle().encode(["Mug"])
    with pytest.raises(ValueError, match=r"code_dims must be in 8\.\.64, got 65"):
        train_autoencoder(embeddings, 65)
    with pytest.raises(ValueError, match="expected at least one, got none"):
        train_autoencoder(embeddings[:0])
    with pytest.raises(ValueError, match="must have at least 32 dimensions, got 8"):
        train_autoencoder(embeddings[:, :8], 32)


def test_bad_weights_are_rejected() -> None:
    weights = dict(train_autoencoder(Oracle().encode(["Mug"]), 8, steps=1).weights)
    fewer = {name: array for name, array in weights.items() if name != "decoder.2.bias"}
    turned, wide = weights["decoder.0.weight"].T.copy(), weights["encoder.0.weight"].astype(float)
    nothing = np.full(8, np.nan, np.float32)
    bad = {
        "missing or unknown: decoder.2.bias": fewer,
        "decoder.0: expected": {**weights, "decoder.0.weight": turned},
        "encoder.0.weight: got float64": {**weights, "encoder.0.weight": wide},
        "encoder.2.bias: a number is not finite": {**weights, "encoder.2.bias": nothing},
    }
    for message, bad_weights in bad.items():
        with pytest.raises(ValueError, match=message):
            Autoencoder(bad_weights)


def test_lifted_features_are_those_of_a_dense_solve() -> None:
    rng = np.random.default_rng(0)
    gaussian_map = GaussianMap(
        means=rng.normal(0, 0.3, (12, 3)),
        quats=rng.normal(size=(12, 4)),
        log_scales=rng.normal(-2, 0.3, (12, 3)),
        logit_opacities=rng.normal(0.5, 1, 12),
        sh=rng.normal(size=(12, 1, 3)),
    ).astype(np.float32)
    views = []
    for angle in (0.0, 1.0, 2.5):
        eye = (2 * np.cos(angle), 2 * np.sin(angle), 0.5)
        camera = camera_from_fov(40, 30, 0.6, look_at(eye, (0, 0, 0)))
        known = rng.random((30, 40)) < 0.7
        labels = np.where(known, np.arange(1200).reshape(30, 40), -1).astype(np.int32)
        views.append((camera, labels, rng.random((1200, 8), np.float32)))
    found = lift_features(gaussian_map, views, 8, threads=1)
    # Blending weights, by rendering one feature channel per Gaussian.
    sums, weights = np.zeros((12, 8)), np.zeros(12)
    for camera, labels, features in views:
        blend_weights = render(
            replace(gaussian_map, features=np.eye(12, dtype=np.float32)), camera
        ).features
        for row in range(12):
            share = np.where(labels >= 0, blend_weights[..., row], 0)
            sums[row] += (share[..., None] * features[labels]).sum(axis=(0, 1))
            weights[row] += share.sum()
    np.testing.assert_allclose(found, sums / weights[:, None], rtol=2e-3, atol=2e-4)
