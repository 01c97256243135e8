"""What the README shows runs as written."""

import re
from dataclasses import replace
from pathlib import Path

import change_room
import pytest

from gslts_sim.capture import capture
from gslts_sim.controller import Controller

pytestmark = pytest.mark.smoke

README = Path(__file__).parents[3] / "README.md"


def demo_in(folder: Path) -> None:
    """What `make demo` leaves: a map, and pictures of before, when a box was not there yet."""
    home = change_room.home()
    before = replace(home, objects=tuple(one for one in home.objects if one.id != "Box|1"))
    folder.mkdir()
    change_room.write_room_map(folder / "map")
    robot = Controller(before, **change_room.SIZE)
    capture(robot, [change_room.LOOKS[0]] * 7, folder / "before")


def test_python_examples_run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    demo_in(tmp_path / "demo")
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    assert len(blocks) == 9
    exec("".join(blocks), {})
    printed = capsys.readouterr().out
    assert re.match(r"removal \[", printed)
    assert "(480, 640, 3) nearest" in printed
    assert "(480, 640, 3) " in printed.splitlines()[-2]
    assert printed.splitlines()[-1] == "DisableObject: DiningTable|1 is not movable"
    assert "0 changes; unreliable: None" in printed
    assert "nothing changed" in printed
    assert "[1000, " in printed
    assert "torch.Size([1, 240, 320, 3]) torch.Size([1000, 3])" in printed
