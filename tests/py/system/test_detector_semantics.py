"""Words of a detector in a simulated room: commands and updates, without PyTorch."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
import pytest
import semantic_room
import update_room
from detector_files import write_color_detector

from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame
from gslts.datasets import open_dataset
from gslts.semantics.files import read_semantics, semantics_problems
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.queries import SemanticQueries
from gslts.store.map_folder import open_map, read_map, write_map_folder
from gslts.update.integrate import integrate_changes
from gslts.update.publish import publish
from gslts_sim.capture import capture
from gslts_sim.controller import Controller

NAMES = ("tomato", "book", "banana", "person")
COLORS = (change_room.RED, change_room.BLUE, change_room.YELLOW, np.full((1, 1, 3), (0, 255, 0)))
WITHOUT_TORCH = """
import sys
for name in ("torch", "transformers", "scipy", "sklearn"):
    sys.modules[name] = None
from gslts.cli import main
main()
"""


def gslts(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a process that cannot import PyTorch."""
    command = [sys.executable, "-c", WITHOUT_TORCH, *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


@pytest.fixture(scope="module")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a detector of colours and a map with its words."""
    folder = tmp_path_factory.mktemp("words")
    colors = [tuple(int(x) for x in color[0, 0]) for color in COLORS]
    write_color_detector(folder / "net.onnx", colors, 320)
    (folder / "names.txt").write_text("\n".join(NAMES) + "\n")
    robot = Controller(change_room.home(), **change_room.SIZE)
    capture(robot, semantic_room.viewpoints(), folder / "visit")
    cameras = {frame.name: frame.read().camera for frame in open_dataset(folder / "visit").frames}
    write_map_folder(folder / "map", change_room.mapped()[0], {}, cameras)
    detector = ("--model", "net.onnx", "--names", "names.txt")
    done = gslts("semantics", "map", "visit", *detector, "--threads", "1", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.smoke
def test_the_words_of_a_detector_are_found(taught: Path) -> None:
    for word, position in (("tomatoes", (2.2, 1.85)), ("book", (3.0, 1.95))):
        done = gslts("query", "map", word, "--json", cwd=taught)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)[0]
        low, high = np.array(found["low_m"]), np.array(found["high_m"])
        np.testing.assert_allclose(((low + high) / 2)[:2], position, atol=0.06)
        np.testing.assert_allclose(high - low, (0.24, 0.24, 0.3), atol=0.12)
    assert gslts("query", "map", "person", cwd=taught).stdout == "person: not found\n"
    unknown = gslts("query", "map", "unicorn", cwd=taught)
    assert unknown.stdout == "unicorn: not found\n"
    assert "none of the 4 classes of the detector" in unknown.stderr


def test_the_log_and_the_semantic_map_speak_of_the_detector(taught: Path) -> None:
    assert "semantic features from detector" in gslts("log", "map", cwd=taught).stdout
    done = gslts("semantic-map", "map", "--category", "book", "--out", "plan", cwd=taught)
    assert done.returncode == 0, done.stderr
    assert (taught / "plan" / "map.png").is_file()
    found = read_semantics(taught / "map")
    assert found is not None
    assert found[0].names == NAMES
    with open_map(taught / "map") as store:
        assert semantics_problems(store) == []


def test_an_object_that_came_is_named_by_the_detector(taught: Path, tmp_path: Path) -> None:
    semantics = MapSemantics.of_map(taught / "map", threads=1)
    assert semantics is not None
    before = read_map(taught / "map")
    cameras = list(change_room.mapped()[1].values())

    class Robot(Controller):
        def observe(self) -> RgbdFrame:
            return replace(super().observe(), labels=None)

    robot = Robot(update_room.changed_home("addition"), **change_room.SIZE)
    robot.go(change_room.VIEWPOINTS[0])
    result = integrate_changes(
        before,
        cameras,
        [update_room.detected("addition")],
        robot,
        update_room.UPDATE,
        detector=ChangeDetector(before, change_room.CONFIG, cameras=cameras),
        semantics=semantics,
    )
    write_map_folder(tmp_path / "map", before, {}, {})
    with open_map(tmp_path / "map", writable=True) as store:
        publish(store, before, [], result, update_room.UPDATE, semantics=semantics)
        (event,) = store.events()
        assert (event.kind, event.type) == ("addition", "banana")
        after = store.read()
    found = SemanticQueries(after, semantics.codec, semantics.source).find("banana")
    np.testing.assert_allclose(found[0].center, np.mean(update_room.ADDED, axis=0), atol=0.08)


@pytest.mark.parametrize(
    ("names", "extra", "message"),
    [
        ("a\nb\nc\n", (), "it has 4 (fastestdet) classes, but there are 3 names"),
        ("", (), "it has no name; expected one per line"),
        ("a\nb\nc\nd\n", ("--layout", "yolov5"), "are not of yolov5"),
        ("a\nb\nc\nd\n", ("--clip", "x"), "the source detector takes no --clip; it takes --model"),
    ],
)
def test_what_does_not_fit_is_one_clear_line(
    names: str, extra: tuple[str, ...], message: str, taught: Path, tmp_path: Path
) -> None:
    (tmp_path / "names.txt").write_text(names)
    given = ("--model", str(taught / "net.onnx"), "--names", str(tmp_path / "names.txt"))
    versions = gslts("log", "map", cwd=taught).stdout
    done = gslts("semantics", "map", "visit", "--source", "detector", *given, *extra, cwd=taught)
    assert done.returncode == 1
    assert message in done.stderr
    assert done.stderr.startswith("gslts: ")
    assert done.stderr.count("\n") == 1
    assert gslts("log", "map", cwd=taught).stdout == versions
