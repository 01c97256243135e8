"""Mapping that is interrupted and resumed from a checkpoint."""

import signal
from dataclasses import replace
from pathlib import Path

import pytest
from command import gslts as run
from command import stopped_at
from map_recordings import CONFIG, MAP_ARRAYS, record_room, require_same

from gslts.datasets import open_dataset
from gslts.mapping.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from gslts.mapping.engine import make_map
from gslts.store.map_folder import read_map


@pytest.fixture(scope="module")
def recorded() -> dict[str, Path]:
    return record_room()


def test_a_resumed_run_makes_the_same_map(
    recorded: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gslts.mapping.engine.SAVE_EVERY_S", 0.0)
    dataset = open_dataset(recorded["kinect"])
    config = CONFIG.model_copy(update={"iterations": 300, "variant_steps": 2})
    saved: list[Path] = []

    def save(checkpoint: Checkpoint) -> None:
        saved.append(tmp_path / f"{len(saved)}.npz")
        write_checkpoint(saved[-1], checkpoint)

    whole = make_map(dataset, config, save=save)
    assert len(saved) >= 5
    assert read_checkpoint(saved[0]).iteration == 0, "after initialization"
    for path in (saved[0], saved[3], saved[-1]):
        rest = make_map(dataset, config, resume=read_checkpoint(path))
        require_same(whole, rest)
        assert [p.iteration for p in rest.curve] == [p.iteration for p in whole.curve]
        assert rest.quality == whole.quality
        assert [variant.psnr_db for variant in rest.variants] == [
            variant.psnr_db for variant in whole.variants
        ]
    start = read_checkpoint(saved[0])
    with pytest.raises(ValueError, match="the checkpoint is of other settings"):
        make_map(dataset, CONFIG, resume=start)
    with pytest.raises(ValueError, match="the checkpoint is of other frames"):
        make_map(open_dataset(recorded["none"]), config, resume=replace(start, frames=("a",)))


def test_damaged_checkpoints_are_rejected(recorded: dict[str, Path], tmp_path: Path) -> None:
    saved = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gslts.mapping.engine.SAVE_EVERY_S", 0.0)
        config = CONFIG.model_copy(update={"iterations": 60})
        make_map(open_dataset(recorded["kinect"]), config, save=saved.append)
    path = tmp_path / "map.checkpoint.npz"
    write_checkpoint(path, saved[0])
    content = path.read_bytes()
    for torn in (b"", content[:1000], content[:-100], content.replace(b"gslts-", b"other-")):
        path.write_bytes(torn)
        with pytest.raises(ValueError, match="not a checkpoint of a map"):
            read_checkpoint(path)


def test_a_killed_run_can_be_resumed(recorded: dict[str, Path], tmp_path: Path) -> None:
    arguments = ["map", recorded["kinect"], "--out", "map", "--preset", "fast"]
    arguments += ["--iterations", "150", "--threads", "1"]
    save_often = "import gslts.mapping.engine as engine; engine.SAVE_EVERY_S = 0.0\n"
    once = save_often + stopped_at("gslts.mapping.checkpoint:write_checkpoint", 1)
    checkpoint = tmp_path / "map.checkpoint.npz"
    none = run(*arguments, "--resume", cwd=tmp_path)
    assert none.stderr == (
        "gslts: map.checkpoint.npz is missing: there is no interrupted run to continue\n"
    )
    for again in ((), ("--resume",), ("--resume",)):
        killed = run(*arguments, *again, cwd=tmp_path, before=once)
        assert killed.returncode == -signal.SIGKILL, killed.stderr
        assert not (tmp_path / "map").exists()
    assert checkpoint.exists()
    done = run(*arguments, cwd=tmp_path)
    assert done.returncode == 1
    assert "continue it with --resume, or remove" in done.stderr
    done = run(*arguments, "--resume", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert not checkpoint.exists()
    resumed = read_map(tmp_path / "map")
    arguments[3] = "whole"
    assert run(*arguments, cwd=tmp_path).returncode == 0
    whole = read_map(tmp_path / "whole")
    for name in MAP_ARRAYS:
        assert getattr(resumed, name).tobytes() == getattr(whole, name).tobytes(), name
