"""`gslts view`, as a user meets it; what its page shows is in test_view.py."""

import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest
import scenes
from command import LONG_S, MAIN
from command import gslts as run

from gslts.store.map_folder import write_map_folder
from gslts.viewer.beside import viewer_beside


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with a map in `map`, and an empty folder `none`."""
    write_map_folder(tmp_path / "map", scenes.random_map(30, dtype=np.float32), {}, {})
    (tmp_path / "none").mkdir()
    return tmp_path


def test_view_serves_until_it_is_interrupted(folder: Path) -> None:
    command = [sys.executable, "-c", MAIN, "view", "map", "--port", "0"]
    with subprocess.Popen(command, cwd=folder, text=True, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("open http://127.0.0.1:")
        with urllib.request.urlopen(line.split()[1], timeout=LONG_S) as page:
            assert b"<html" in page.read()
        process.send_signal(signal.SIGINT)
        assert process.stdout.read() == ""
    assert process.returncode == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("none",), "none: it has no manifest.json; gslts map makes a map"),
        (("map@1",), "give the folder of the map, map, not one version of it"),
        (("map", "--host", "0.0.0.0"), "give a --token"),
        (("map", "--token", "secret"), "--token: must match"),
        (("map", "--port", "taken"), "in use; give another --port"),
    ],
)
def test_what_cannot_be_viewed(folder: Path, arguments: tuple[str, ...], message: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        done = run("view", *(port if a == "taken" else a for a in arguments), cwd=folder)
    assert done.returncode == 1
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_view_beside_a_command(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    output, give_up_s = "", time.monotonic() + LONG_S
    with viewer_beside(folder / "map", True):
        while "\n" not in output:
            assert time.monotonic() < give_up_s
            time.sleep(0.05)
            output += capfd.readouterr().out
        url = output.split()[1]
        urllib.request.urlopen(url, timeout=LONG_S).close()
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(url, timeout=LONG_S)
    with viewer_beside(folder / "map", False):
        pass
