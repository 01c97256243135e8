"""Full disks: one clear line, and no incomplete output."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sim_scenes
from videos import write

from gslts.io.atomic_files import write_atomic
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


@pytest.fixture(scope="module")
def visit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    robot = Controller(sim_scenes.simple_home(), width=112, height=84)
    viewpoints = [Viewpoint(1.0, 1.0, yaw, 20.0) for yaw in np.arange(0.0, 360.0, 30.0)]
    folder = tmp_path_factory.mktemp("visit") / "room"
    capture(robot, viewpoints, folder)
    return folder


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


@pytest.fixture(scope="module")
def made(visit: Path) -> Path:
    """A map for which the disk has room."""
    done = map_with_files_of(1 << 30, visit, visit.parent)
    assert done.returncode == 0, done.stderr
    return visit.parent / "made"


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files")
@pytest.mark.parametrize(
    ("largest", "file"),
    [
        ("cameras.json", ".safetensors"),
        ("versions.sqlite", "versions.sqlite"),
        ("report.html", "report.html"),
    ],
    ids=["map", "index", "later"],
)
def test_map_on_a_full_disk(
    tmp_path: Path, visit: Path, made: Path, largest: str, file: str
) -> None:
    limit = int(0.97 * (made / largest).stat().st_size)  # Times in a report have few bytes.
    done = map_with_files_of(limit, visit, tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("gslts: ")
    assert "made" in line, "the message names the file"
    assert file in line
    assert any(words in line for words in ("large", "File too", "disk I/O error"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_an_error_in_writing_names_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    opened = Path.open
    monkeypatch.setattr(Path, "open", lambda _, mode: opened(Path("/dev/full"), mode))
    with pytest.raises(OSError, match=r"No space left on device: .*/file'"):
        write_atomic(path, b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


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
