"""Durability of maps under killed processes, failing disks and damaged files."""

import errno
import os
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from store_maps import REJECTED, addition, assert_same, blobs_of, edited, grown, random_map

from gslts.io.atomic_files import write_atomic
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map, write_map_folder
from gslts.store.map_store import INDEX, MapStore
from gslts.store.writer_lock import LOCK

FAULTS = Path(__file__).parents[3] / "benchmarks" / "faults"
LOG = f"{INDEX}-wal"
COMPILER = pytest.mark.skipif(shutil.which("cc") is None, reason="no compiler of C")
MEMORY = Path("/dev/shm")
"""Folder in memory: files survive a killed process there as well, and writes are fast."""


def disturb(*arguments: str, folder: Path) -> list[str]:
    """Run the fault benchmark without a problem, and return the last row of its table."""
    place = MEMORY if os.access(MEMORY, os.W_OK) else folder
    done = subprocess.run(
        [sys.executable, FAULTS / "fault_benchmark.py", *arguments],
        env={**os.environ, "TMPDIR": str(place)},
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return re.split(r" *\| *", done.stdout.splitlines()[-1])[1:-1]


@pytest.mark.parametrize(("subject", "moments"), [("commits", 20), ("import", 8), ("map", 3)])
def test_maps_survive_kills_at_any_time(tmp_path: Path, subject: str, moments: int) -> None:
    given = ("--subjects", subject, "--moments", str(moments))
    name, runs, killed, failed, ended, problems = disturb("kill", *given, folder=tmp_path)
    assert (name, killed, failed, problems) == (subject, str(moments), "0", "0")
    assert int(runs) == moments + int(ended)


@COMPILER
@pytest.mark.parametrize(("subject", "runs"), [("commits", None), ("import", 12), ("map", 3)])
def test_maps_survive_a_failure_of_each_write(
    tmp_path: Path, subject: str, runs: int | None
) -> None:
    given = ["--subjects", subject, "--more", "1"]
    if runs is not None:
        given += ["--runs", str(runs)]
    name, done, killed, failed, _, problems = disturb("writes", *given, folder=tmp_path)
    assert (name, killed, problems) == (subject, "0", "0")
    assert int(failed) > int(done) / 2


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a map with three versions."""
    path = tmp_path / "map"
    write_map_folder(path, random_map(100), {"dataset": "room"}, {})
    grown(path, 2)
    return path


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return an environment in which no write below FAULT_FOLDER succeeds."""
    library = tmp_path_factory.mktemp("shim") / "failing_writes.so"
    source = FAULTS / "failing_writes.c"
    command = ["cc", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o", library, source]
    subprocess.run([*command, "-ldl"], check=True)
    fault = {"FAULT_AT": "1", "FAULT_LASTS": "1", "FAULT_ERRNO": str(errno.EROFS)}
    return {**os.environ, **fault, "LD_PRELOAD": str(library)}


def gslts(
    *arguments: str, cwd: Path, env: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    program = "import sys; from gslts.cli import main; sys.argv[0] = 'gslts'; main()"
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=cwd,
        env=env,
        text=True,
        capture_output=True,
        check=False,
    )


def add_version_in_log(folder: Path) -> None:
    """Add a version that is only in the write-ahead log, as a killed writer leaves it."""
    child = os.fork()
    if child == 0:
        store = MapStore(folder, writable=True)
        store.restore(1)
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    assert (folder / LOG).stat().st_size > 0


@COMPILER
def test_a_map_on_a_full_disk_is_read(folder: Path, failing: dict[str, str]) -> None:
    env = {**failing, "FAULT_FOLDER": str(folder.resolve()), "FAULT_ERRNO": str(errno.ENOSPC)}
    for at in (2, 5):  # The files that SQLite puts there.
        done = gslts("verify", "map", cwd=folder.parent, env={**env, "FAULT_AT": str(at)})
        assert (done.stdout, done.stderr) == ("3 versions are intact\n", "")


@COMPILER
@pytest.mark.parametrize("log", ["none", "left", "incomplete"])
def test_a_map_on_a_read_only_disk_is_read(folder: Path, failing: dict[str, str], log: str) -> None:
    if log != "none":
        add_version_in_log(folder)
    if log == "incomplete":
        (folder / f"{INDEX}-shm").unlink()
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    env = {**failing, "FAULT_FOLDER": str(folder.resolve())}
    done = gslts("verify", "map", cwd=folder.parent, env=env)
    if log == "incomplete":
        assert done.stderr == (
            f"gslts: map/{LOG}: cannot be read here; copy the map to a folder that can be written\n"
        )
    else:
        assert done.stderr == ""
        assert done.stdout == f"{3 if log == 'none' else 4} versions are intact\n"
    rejected = gslts("restore", "map", "1", cwd=folder.parent, env=env)
    assert rejected.returncode == 1
    assert rejected.stderr == (
        f"gslts: map/{LOCK}: Read-only file system; copy the map to a folder that can be written, "
        "or ask for permission\n"
    )
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    with open_map(folder) as store:
        assert store.version().number == (3 if log == "none" else 4)


def test_a_second_writer_is_rejected(folder: Path) -> None:
    with open_map(folder, writable=True):
        done = gslts("restore", "map", "1", cwd=folder.parent)
        assert done.returncode == 1
        assert done.stderr == "gslts: map: another process writes this map; wait until it ends\n"
        assert len(gslts("log", "map", cwd=folder.parent).stdout.splitlines()) == 3
    with open_map(folder) as store:
        assert store.version().number == 3


def test_a_newer_schema_is_not_modified(folder: Path) -> None:
    connection = sqlite3.connect(folder / INDEX)
    connection.execute("PRAGMA user_version = 8")
    connection.close()
    before = (folder / INDEX).read_bytes()
    for command in (("verify", "map"), ("restore", "map", "1")):
        done = gslts(*command, cwd=folder.parent)
        assert done.returncode == 1
        assert done.stderr == (
            f"gslts: map/{INDEX}: its schema is version 8, this gslts reads 7; a newer gslts "
            "wrote it: install that version\n"
        )
    assert (folder / INDEX).read_bytes() == before


def flip(path: Path) -> None:
    """Flip one bit of a file."""
    content = path.read_bytes()
    path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))


@pytest.mark.parametrize("damage", ["flip", "delete"])
def test_each_damaged_file_is_named_with_the_next_step(folder: Path, damage: str) -> None:
    for path in blobs_of(folder):
        content = path.read_bytes()
        flip(path)
        if damage == "delete":
            path.unlink()
        with open_map(folder) as store:
            (problem,) = store.find_problems()
            readable = 0
            for version in store.versions():
                try:
                    store.read(version.number)
                    readable += 1
                except (OSError, ValueError) as error:
                    assert str(error) in problem  # noqa: PT017
        assert path.name in problem
        assert "copy it from a backup, or go back to an intact version" in problem
        assert readable < 3
        path.write_bytes(content)
        with open_map(folder) as store:
            assert store.find_problems() == []


def test_a_version_is_read_without_a_damaged_snapshot(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    maps = [read_map(Path(f"{folder}@{number}")) for number in (1, 2, 3)] + grown(folder, 20)[1:]
    with open_map(folder) as store:
        later = [blob.key for number, blob in store._index.snapshots().items() if number > 1]
        assert len(later) > 1
        for path in blobs_of(folder):
            if path.stem in later:
                flip(path)
        assert len(store.find_problems()) == len(later)
        for number, expected in enumerate(maps, start=1):
            assert_same(store.read(number), expected)
        newest = f"Version {len(maps)} is read without it"
        assert newest in caplog.text


def test_a_damaged_index_is_named(folder: Path) -> None:
    with open_map(folder, writable=True) as store:
        store.commit(store.read(), UpdateCause(round=9), [addition("Mug")])
        store.add_rejection(REJECTED)
    content = (folder / INDEX).read_bytes()
    used = np.flatnonzero(np.frombuffer(content, np.uint8))  # Most of it is empty.
    rng, named = random.Random(0), 0
    for _ in range(300):
        damaged = bytearray(content)
        damaged[rng.choice(used)] ^= 1 << rng.randrange(8)
        (folder / INDEX).write_bytes(damaged)
        try:
            with open_map(folder) as store:
                named += bool(store.find_problems())
                store.events(), store.rejections()
                for version in store.versions():
                    store.read(version.number)
        except (OSError, ValueError) as error:
            assert str(folder) in str(error)  # noqa: PT017
            named += 1
    assert named > 30
    (folder / INDEX).write_bytes(content)
    with open_map(folder) as store:
        assert store.find_problems() == []


def ended_process() -> int:
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    return child.pid


def test_remains_of_a_killed_run_are_removed_by_the_next(tmp_path: Path) -> None:
    of_this, of_another = f".map.{os.getpid()}.part", f".map.{os.getppid()}.part"
    for name in (of_this, f".map.{ended_process()}.part", of_another, ".map.txt.part"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "half").write_bytes(b"half")
    left = tmp_path / f".file.{ended_process()}.part"
    left.write_bytes(b"half")
    write_map_folder(tmp_path / "map", random_map(9), {}, {})
    write_atomic(tmp_path / "file", b"whole")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"map", "file", of_another, ".map.txt.part"}
    assert_same(read_map(tmp_path / "map"), random_map(9))


def test_a_commit_succeeds_after_a_failed_one(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with open_map(folder, writable=True) as store:
        after = edited(store.read(), 9, store.version().next_id)
        monkeypatch.setattr("os.fsync", fails)
        with pytest.raises(OSError, match=r"No space left on device: .*safetensors"):
            store.commit(after, UpdateCause())
        monkeypatch.undo()
        assert store.version().number == 3
        assert store.commit(after, UpdateCause()).number == 4
        assert_same(store.read(), after)
        np.testing.assert_array_equal(store.read(3).ids, read_map(Path(f"{folder}@3")).ids)
