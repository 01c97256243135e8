"""Documents agree with the code: examples run as written, messages and variables exist."""

import ast
import json
import re
from pathlib import Path

import change_room
import pytest
from documents import (
    DOCUMENTS,
    LANGUAGES,
    ROOT,
    assert_printed,
    assert_understood,
    blocks,
    run_blocks,
)

from gslts_sim.capture import capture
from gslts_sim.controller import Controller

OF_THE_DEMO = ["tutorial.md", "queries.md"]
"""Pages that go on with the files that the first command of the tutorial makes."""
PRINTED = {
    "README.md": [r"\S+ removal \[", r"\(480, 640, 3\) nearest \d", r"loss 0\.\d+, SSIM"],
    "changes.md": [r"1 changes; unreliable: None"],
    "concepts.md": [r"\[1000\] GaussianMap"],
    "localize.md": [r"lost |ok \(4, 4\)"],
    "navigation.md": [r"None"],
    "python.md": [r"1 \d+\n", r"\(240, 320, 3\) \(240, 320\)"],
    "pytorch.md": [r"torch\.Size\(\[1, 240, 320, 3\]\) torch\.Size\(\[1000, 3\]\)"],
    "simulator.md": [r"\(480, 640, 3\) \d", r"DisableObject: DiningTable\|1 is not movable"],
}
"""By document: what its examples print, line by line where it matters."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the files of `make demo`: a map, and later images in which a box is gone."""
    folder = tmp_path_factory.mktemp("documents")
    (folder / "demo").mkdir()
    change_room.write_room_map(folder / "demo" / "map")
    robot = Controller(change_room.home().without(["Box|1"]), **change_room.SIZE)
    capture(robot, change_room.VIEWPOINTS[:2], folder / "demo" / "after")
    return folder


def identify(document: Path) -> str:
    return str(document.relative_to(ROOT))


@pytest.mark.smoke
@pytest.mark.parametrize("document", DOCUMENTS, ids=identify)
def test_every_block_is_of_a_kind_that_is_checked(document: Path) -> None:
    for language, text in blocks(document):
        assert language in LANGUAGES, f"```{language}: expected one of {', '.join(LANGUAGES)}"
        if language == "sh":
            for line in text.replace("\\\n", " ").splitlines():
                assert_understood(line)
        elif language == "json":
            json.loads(text)


@pytest.mark.smoke
@pytest.mark.parametrize(
    "line",
    [
        "gslts map RECORDING",
        "gslts map RECORDING --out out/map --preset quick",
        "cd out && gslts detct out/map LATER",
        "gslts log out/map --nothing  # a comment",
        "make nothing",
        "scripts/nothing",
        "pip install '.[nothing]'",
        "nothing",
    ],
)
def test_bad_commands_are_noticed(line: str) -> None:
    with pytest.raises(AssertionError):
        assert_understood(line)


@pytest.mark.smoke
def test_other_output_is_noticed() -> None:
    assert_printed("wrote 7 views ...\nat (1.5, -2) m", "wrote 12 views to x\nat (-0.25, 3.0) m\n")
    for printed in ("wrote 7 views", "wrote 7 views\nat (1.5) m", "wrote x views\nat (1.5, -2) m"):
        with pytest.raises(AssertionError):
            assert_printed("wrote 7 views ...\nat (1.5, -2) m", printed)


@pytest.mark.smoke
@pytest.mark.parametrize("name", PRINTED)
def test_examples_run(
    name: str, folder: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (document,) = (path for path in DOCUMENTS if identify(path) in (name, f"docs/{name}"))
    run_blocks(document, folder, {})
    printed = capsys.readouterr().out
    for pattern in PRINTED[name]:
        assert re.search(pattern, printed), printed


@pytest.mark.smoke
def test_no_example_is_left_out() -> None:
    run = [*PRINTED, *OF_THE_DEMO]
    with_code = {
        document.name
        for document in DOCUMENTS
        if any(language in ("python", "console") for language, _ in blocks(document))
    }
    assert with_code == set(run)


@pytest.mark.long
def test_tutorial_runs_as_written(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in OF_THE_DEMO:
        run_blocks(ROOT / "docs" / name, tmp_path, {})
    printed = capsys.readouterr().out
    assert re.search(r"^\d{5} (removal|addition|relocation) \[", printed, re.MULTILINE)


@pytest.mark.smoke
def test_messages_of_the_questions_are_those_of_the_code() -> None:
    messages = list(_texts_of_the_code())
    shown = [text for kind, text in blocks(ROOT / "docs" / "faq.md") if kind == "text"]
    assert shown
    for line in "".join(shown).splitlines():
        parts = [part.strip(" :") for part in line.split("...") if part.strip(" :;,")]
        pattern = re.compile(".*".join(map(re.escape, parts)), re.DOTALL)
        assert any(map(pattern.search, messages)), f"faq.md: no message is {line!r}"


@pytest.mark.smoke
def test_variables_of_the_environment_are_listed() -> None:
    read = {text for text in _texts_of_the_code() if re.fullmatch(r"GSLTS_[A-Z_]+", text)}
    listed = re.findall(r"^\| `(GSLTS_[A-Z_]+)`", (ROOT / "docs/settings.md").read_text(), re.M)
    assert read == set(listed)


def _texts_of_the_code() -> list[str]:
    """Return all strings of the product, of f-strings the constant parts."""
    texts = []
    for path in (ROOT / "python" / "gslts").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                parts = (part.value for part in node.values if isinstance(part, ast.Constant))
                texts.append("\0".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
    return texts
