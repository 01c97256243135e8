"""What the README shows runs as written."""

import re
from pathlib import Path

README = Path(__file__).parents[2] / "README.md"


def test_python_examples_run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    assert len(blocks) == 8
    exec("".join(blocks), {})
    printed = capsys.readouterr().out
    assert "(480, 640, 3) nearest" in printed
    assert "(480, 640, 3) " in printed.splitlines()[-2]
    assert printed.splitlines()[-1] == "DisableObject: DiningTable|1 is not movable"
    assert "0 changes; unreliable: None" in printed
    assert "nothing changed" in printed
    assert "[1000, " in printed
    assert "torch.Size([1, 240, 320, 3]) torch.Size([1000, 3])" in printed
