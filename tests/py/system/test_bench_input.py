"""Bad input of the benchmarks: one line each, before anything is made."""

from pathlib import Path

import pytest
from command import gslts


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--seeds", "3:3"), "--seeds: expected A:B with 0 <= A < B, got '3:3'"),
        (("--seeds", "4"), "--seeds: expected A:B"),
        (("--seeds", "4999:5001"), "4999 to 5000 are not of one split"),
        (("--seeds", "20000:20001"), "20000 to 20000 are not of one split"),
        (("--seeds", "-1:4"), "--seeds: expected A:B"),
        (("--jobs", "0"), "Invalid value for '--jobs'"),
        (("--tasks", "0"), "Invalid value for '--tasks'"),
        (("--json", "/dev/null/a.json"), "/dev/null"),
        (("--json", "."), "gslts: . is a folder"),
        (("--size", "640"), "--size: expected WxH"),
        (("--room", "garage"), "expected some of kitchen, living_room, bedroom"),
        (("--set", "iterations=0"), "iterations=0"),
        (("--images", "full"), "full is not empty"),
    ],
)
def test_bad_input_is_rejected_in_one_line(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a").touch()
    rejected = gslts("bench", "detect", "--work", "work", *arguments, cwd=tmp_path)
    assert rejected.returncode in (1, 2)
    assert "Traceback" not in rejected.stderr
    assert message in rejected.stderr
    assert not (tmp_path / "work").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--fold", "1"), "--fold is for --real"),
        (("--real", ".", "--ablation"), "--ablation, --trade and --home are for homes"),
        (("--real", "nowhere"), "there is no such file"),
    ],
)
def test_incompatible_options_are_rejected(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    process = gslts("bench", "relocalize", *arguments, cwd=tmp_path)
    assert process.returncode != 0
    assert message in process.stderr
    assert len(process.stderr.splitlines()) == 1
