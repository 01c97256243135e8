"""Semantics of a map folder: frames of another map, and options that a source does not take."""

from functools import partial
from pathlib import Path

import change_room
import pytest
from typer.testing import CliRunner

from gslts.cli import app
from gslts.datasets import open_dataset
from gslts.semantics.add_semantics import add_semantics
from gslts.semantics.registry import SourceName, check_options, open_text_semantics
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.store.fingerprints import FINGERPRINTS, fingerprint
from gslts.store.map_folder import open_map, write_map_folder
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint

VIEWPOINTS = (*change_room.VIEWPOINTS, Viewpoint(4.0, 3.0, 210.0, 20.0))


def capture_visit(folder: Path, viewpoints: tuple[Viewpoint, ...] = VIEWPOINTS) -> Path:
    capture(Controller(change_room.home(), **change_room.SIZE), viewpoints, folder)
    return folder


@pytest.fixture(autouse=True)
def _fast_training(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "gslts.semantics.train_autoencoder.train_autoencoder",
        partial(train_autoencoder, steps=20),
    )


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with visits whose frames have the same names."""
    folder = tmp_path_factory.mktemp("visits")
    capture_visit(folder / "own")
    capture_visit(folder / "other", VIEWPOINTS[::-1])
    return folder


def write_map(folder: Path, visits: Path) -> Path:
    """Write a map of the first visit, which knows its frames."""
    frames = [frame.read() for frame in open_dataset(visits / "own").frames]
    names = [frame.name for frame in open_dataset(visits / "own").frames]
    manifest = {FINGERPRINTS: {n: fingerprint(f.rgb) for n, f in zip(names, frames, strict=True)}}
    cameras = {name: frame.camera for name, frame in zip(names, frames, strict=True)}
    write_map_folder(folder, change_room.mapped()[0], manifest, cameras)
    return folder


def test_frames_of_another_visit_are_rejected(visits: Path, tmp_path: Path) -> None:
    """They have the names of those of the map."""
    path = write_map(tmp_path / "map", visits)
    with pytest.raises(ValueError, match=r"map was made from no frame of .*other; give the data"):
        add_semantics(path, visits / "other", code_dims=8, threads=1)
    with open_map(path) as store:
        assert len(store.versions()) == 1
    moved = (visits / "own").rename(visits / "moved")
    assert add_semantics(path, moved, code_dims=8, threads=1).number == 2
    moved.rename(visits / "own")


def test_a_mistyped_map_is_named_before_models_are_opened(visits: Path, tmp_path: Path) -> None:
    models = {"model": tmp_path / "none.onnx", "names": tmp_path / "none.txt"}
    with pytest.raises(FileNotFoundError, match=r"nowhere: there is no such folder; gslts map"):
        add_semantics(tmp_path / "nowhere", visits / "own", models=models)
    path = write_map(tmp_path / "map", visits)
    with pytest.raises(ValueError, match="was made from no frame"):
        add_semantics(path, visits / "other", models=models)
    with pytest.raises(FileNotFoundError, match=r"none\.txt"):
        add_semantics(path, visits / "own", models=models)


@pytest.mark.parametrize(
    ("source", "given", "message"),
    [
        ("oracle", {"text_model"}, "oracle takes no --text-model; it takes --code-dims, --refine"),
        ("oracle", {"layout", "clip"}, "oracle takes no --clip, --layout; it takes --code-dims"),
        ("clip", {"clip", "sam", "layout"}, "clip takes no --layout; it takes --clip, --sam, "),
        ("clip", {"clip"}, "clip needs --clip and --sam, got --clip"),
        ("detector", {"model", "names", "refine"}, "detector takes no --refine; it takes --model"),
        ("detector", {"model", "names", "code_dims"}, "detector takes no --code-dims; "),
        ("detector", set(), "detector needs --model and --names, got none"),
    ],
)
def test_options_that_a_source_does_not_take_are_rejected(
    source: SourceName, given: set[str], message: str
) -> None:
    with pytest.raises(ValueError, match=f"^the source {message}"):
        check_options(source, given)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--code-dims", "8"), "detector takes no --code-dims"),
        (("--refine", "5"), "detector takes no --refine"),
        (("--source", "oracle", "--layout", "yolov8"), "oracle takes no --layout, --model"),
        (("--clip", "x", "--sam", "y", "--text-model", "z"), "clip takes no --model"),
    ],
)
def test_unused_options_of_the_command_are_named(
    options: tuple[str, ...], message: str, visits: Path, tmp_path: Path
) -> None:
    path = write_map(tmp_path / "map", visits)
    given = ("--model", "net.onnx", "--names", "names.txt", *options)
    with pytest.raises(ValueError, match=f"^the source {message}"):
        CliRunner().invoke(
            app, ["semantics", str(path), str(visits / "own"), *given], catch_exceptions=False
        )


def test_words_of_labels_take_no_text_model(visits: Path, tmp_path: Path) -> None:
    path = write_map(tmp_path / "map", visits)
    add_semantics(path, visits / "own", code_dims=8, threads=1)
    with pytest.raises(ValueError, match=r"map: .* leave out --text-model"):
        open_text_semantics(path, tmp_path)
