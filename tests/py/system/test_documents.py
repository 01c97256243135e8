"""The Python examples of README and guides run as written, and links lead somewhere."""

import re
from pathlib import Path

import change_room
import pytest

from gslts_sim.capture import capture
from gslts_sim.controller import Controller

pytestmark = pytest.mark.smoke

ROOT = Path(__file__).parents[3]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PRINTED = {
    "README.md": [r"\S+ removal \[", r"\(480, 640, 3\) nearest \d", r"loss 0\.\d+, SSIM"],
    "concepts.md": [r"\[1000\] GaussianMap"],
    "pytorch.md": [r"torch\.Size\(\[1, 240, 320, 3\]\) torch\.Size\(\[1000, 3\]\)"],
    "simulator.md": [r"\(480, 640, 3\) \d", r"DisableObject: DiningTable\|1 is not movable"],
    "tutorial.md": [r"1 changes; unreliable: None"],
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


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_python_examples_run(
    document: Path, folder: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    blocks = re.findall(r"```python\n(.*?)```", document.read_text(), re.DOTALL)
    assert bool(blocks) == (document.name in PRINTED)
    exec("".join(blocks), {})
    printed = capsys.readouterr().out
    for pattern in PRINTED.get(document.name, []):
        assert re.search(pattern, printed), printed


@pytest.mark.parametrize("document", [*DOCUMENTS, ROOT / "CONTRIBUTING.md"], ids=lambda p: p.name)
def test_links_lead_to_files(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", document.read_text()):
        if not target.startswith("http"):
            assert (document.parent / target).exists(), target
