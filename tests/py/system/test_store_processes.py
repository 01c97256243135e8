"""Concurrent access of several processes to one map."""

import multiprocessing
import os
import shutil
import tempfile
from pathlib import Path

import pytest
from command import LONG_S
from store_maps import ROOM, random_map

from gslts.store.map_store import MapStore

pytestmark = pytest.mark.smoke


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return the folder of a map with one version."""
    MapStore.create(tmp_path, random_map(100), ROOM)
    return tmp_path


def _open_writable(folder: Path, answer: multiprocessing.Queue) -> None:
    try:
        MapStore(folder, writable=True).close()
        answer.put("")
    except OSError as error:
        answer.put(str(error))


def test_one_process_writes_at_a_time(folder: Path) -> None:
    context = multiprocessing.get_context("fork")
    answer = context.Queue()
    with MapStore(folder, writable=True):
        other = context.Process(target=_open_writable, args=(folder, answer))
        other.start()
        assert "another process writes this map" in answer.get(timeout=LONG_S)
        other.join()
    other = context.Process(target=_open_writable, args=(folder, answer))
    other.start()
    assert answer.get(timeout=LONG_S) == ""
    other.join()


def _read_without_permission(folder: Path, answer: multiprocessing.Queue) -> None:
    if os.geteuid() == 0:
        os.seteuid(65534)
    answers = []
    for writable in (False, True):
        try:
            with MapStore(folder, writable=writable) as store:
                answers.append(f"{len(store.versions())} versions, {store.read().size} Gaussians")
        except OSError as error:
            answers.append(str(error))
    answer.put(answers)


def test_a_write_protected_map_is_read(folder: Path) -> None:
    with tempfile.TemporaryDirectory() as name:  # Folders of pytest are closed to other users.
        map_path = Path(name) / "map"
        shutil.copytree(folder, map_path)
        for path in (Path(name), map_path, *map_path.rglob("*")):
            path.chmod(0o555 if path.is_dir() else 0o444)
        context = multiprocessing.get_context("fork")
        answer = context.Queue()
        reader = context.Process(target=_read_without_permission, args=(map_path, answer))
        reader.start()
        read, rejected = answer.get(timeout=LONG_S)
        reader.join()
        Path(name).chmod(0o755)
        for path in (map_path, *map_path.rglob("*")):
            path.chmod(0o755)
    assert read == "1 versions, 100 Gaussians"
    assert rejected.endswith(
        "Permission denied; copy the map to a folder that can be written, or ask for permission"
    )
