"""Semantics of a map folder: frames of another map, and options that a source does not take."""

import json
from functools import partial
from pathlib import Path

import change_room
import pytest
import update_room
from typer.testing import CliRunner

from gslts.cli import app
from gslts.datasets import open_dataset
from gslts.semantics.add_semantics import add_semantics
from gslts.semantics.registry import SourceName, check_options, open_text_semantics
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.store.map_folder import open_map, write_map_folder
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

VIEWPOINTS = (*change_room.VIEWPOINTS, Viewpoint(4.0, 3.0, 210.0, 20.0))


def capture_visit(
    folder: Path, viewpoints: tuple[Viewpoint, ...] = VIEWPOINTS, home: Home | None = None
) -> Path:
    capture(Controller(home or change_room.home(), **change_room.SIZE), viewpoints, folder)
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
    capture_visit(folder / "changed", home=update_room.changed_home("addition"))
    capture_visit(folder / "other", VIEWPOINTS[::-1])
    large = Controller(change_room.home(), width=320, height=240)
    capture(large, VIEWPOINTS, folder / "large")
    return folder


def write_map(folder: Path, visits: Path, psnr_db: float | None = None) -> Path:
    """Write a map of the first visit, which records the PSNR of its frames."""
    cameras = {frame.name: frame.read().camera for frame in open_dataset(visits / "own").frames}
    manifest = {} if psnr_db is None else {"training_psnrs_db": dict.fromkeys(cameras, psnr_db)}
    write_map_folder(folder, change_room.mapped()[0], manifest, cameras)
    return folder


@pytest.mark.parametrize(
    ("visit", "psnr_db"), [("own", None), ("own", 28.0), ("changed", None), ("other", 14.0)]
)
def test_frames_that_the_map_shows_as_well_as_recorded_are_used(
    visit: str, psnr_db: float | None, visits: Path, tmp_path: Path
) -> None:
    """Also after a few changes, and of a map that is as bad by its own record."""
    path = write_map(tmp_path / "map", visits, psnr_db)
    assert add_semantics(path, visits / visit, code_dims=8, threads=1).number == 2


@pytest.mark.parametrize(
    ("visit", "psnr_db", "message"),
    [
        ("other", None, r"a median PSNR of 17\.\d dB, expected about 2\d\.\d; give the dataset"),
        ("other", 28.0, r"a median PSNR of 17\.\d dB, expected about 28\.0; give the dataset"),
        ("own", 45.0, r"a median PSNR of 2\d\.\d dB, expected about 45\.0; give the dataset"),
        ("large", None, r"0 has 320 x 240 px, that of .*map 160 x 120 px; give the dataset"),
    ],
)
def test_other_frames_of_the_same_names_are_rejected(
    visit: str, psnr_db: float | None, message: str, visits: Path, tmp_path: Path
) -> None:
    path = write_map(tmp_path / "map", visits, psnr_db)
    with pytest.raises(ValueError, match=message) as raised:
        add_semantics(path, visits / visit, code_dims=8, threads=1)
    assert str(raised.value).startswith(f"{visits / visit}: ")
    assert str(path) in str(raised.value)
    with open_map(path) as store:
        assert len(store.versions()) == 1


def test_records_that_are_no_numbers_are_not_used(visits: Path, tmp_path: Path) -> None:
    path = write_map(tmp_path / "map", visits)
    manifest = json.loads((path / "manifest.json").read_text())
    names = [frame.name for frame in open_dataset(visits / "own").frames]
    for damaged in (None, [], "x", dict.fromkeys(names, "x")):
        text = json.dumps({**manifest, "training_psnrs_db": damaged})
        (path / "manifest.json").write_text(text)
        with pytest.raises(ValueError, match=r"expected about 2\d\.\d"):
            add_semantics(path, visits / "other", threads=1)


def test_a_mistyped_map_is_named_before_models_are_opened(visits: Path, tmp_path: Path) -> None:
    models = {"model": tmp_path / "none.onnx", "names": tmp_path / "none.txt"}
    with pytest.raises(FileNotFoundError, match=r"nowhere: there is no such folder; gslts map"):
        add_semantics(tmp_path / "nowhere", visits / "own", models=models)
    path = write_map(tmp_path / "map", visits)
    with pytest.raises(ValueError, match=r"expected about 2\d\.\d"):
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
