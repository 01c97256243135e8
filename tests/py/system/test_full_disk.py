"""Full disks: one clear line, and no incomplete output."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sim_scenes
from store_maps import random_map
from videos import write

from gslts.io.atomic_files import write_atomic
from gslts.store.map_folder import write_map_folder
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint

LIMITED = """
import resource, signal, sys
from gslts.cli import main
sys.argv[0] = "gslts"
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
limit = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
main()
"""


def map_with_files_of(limit: int, visit: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Map a recording in a process whose files have at most so many bytes."""
    command = ["map", str(visit), "--out", "made", "--preset", "fast", "--iterations", "4"]
    return subprocess.run(
        [sys.executable, "-c", LIMITED, str(limit), *command],
        cwd=folder,
        text=True,
        capture_output=True,
        check=False,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files")
@pytest.mark.parametrize(
    ("frames", "limit", "file"),
    # SQLite needs 32 KiB; before them, a map of few frames needs 6 kB at most, and the report of
    # many frames is the largest file.
    [(12, 1000, ".safetensors"), (12, 20_000, "versions.sqlite"), (60, None, "report.html")],
    ids=["map", "index", "later"],
)
def test_map_on_a_full_disk(tmp_path: Path, frames: int, limit: int | None, file: str) -> None:
    visit, whole, full = (tmp_path / name for name in ("visit", "whole", "full"))
    robot = Controller(sim_scenes.simple_home(), width=64, height=48)
    yaws = np.linspace(0.0, 360.0, frames, endpoint=False)
    capture(robot, [Viewpoint(1.0, 1.0, yaw, 20.0) for yaw in yaws], visit)
    whole.mkdir()
    full.mkdir()
    if limit is None:
        done = map_with_files_of(1 << 30, visit, whole)
        assert done.returncode == 0, done.stderr
        limit = (whole / "made" / file).stat().st_size - 200  # The times in it differ in length.
    done = map_with_files_of(limit, visit, full)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("gslts: ")
    assert "made" in line, "the message names the file"
    assert file in line
    assert any(words in line for words in ("large", "File too", "disk I/O error"))
    assert list(full.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_an_error_in_writing_names_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    opened, full = Path.open, Path("/dev/full")
    monkeypatch.setattr(Path, "open", lambda _, *given, **named: opened(full, *given, **named))
    with pytest.raises(OSError, match=r"No space left on device: .*/file'"):
        write_atomic(path, b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("folder", ["missing", "file"])
def test_an_error_in_opening_names_the_file(tmp_path: Path, folder: str) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(OSError, match=rf"directory: '{tmp_path}/{folder}/page\.html'"):
        write_atomic(tmp_path / folder / "page.html", b"new")


def test_an_error_of_a_new_map_names_its_folder(tmp_path: Path) -> None:
    folder = tmp_path / (250 * "a")  # Its partial folder has a longer name.
    with pytest.raises(OSError, match=rf"name too long: '{folder}'$"):
        write_map_folder(folder, random_map(5), {}, {})


def test_a_folder_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "page.html").mkdir()
    with pytest.raises(IsADirectoryError, match=rf"Is a directory: '{tmp_path}/page\.html'$"):
        write_atomic(tmp_path / "page.html", b"new")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


VIDEO_LIMITED = """
import resource, signal, sys
from pathlib import Path
from videos import write
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
write(Path("a.mp4"), 100)
"""


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.99, 0.9987])
def test_a_video_on_a_full_disk_keeps_the_old_file(tmp_path: Path, share: float) -> None:
    write(tmp_path / "a.mp4", 100)
    limit = int(share * (tmp_path / "a.mp4").stat().st_size)
    (tmp_path / "a.mp4").write_bytes(b"old")
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path += {sys.path}\n{VIDEO_LIMITED}", str(limit)],
        cwd=tmp_path,
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("OSError: a.mp4: "), done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_bytes() == b"old"
