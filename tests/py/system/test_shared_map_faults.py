"""Four robots on one shared map, killed and with failing requests; errors of a store."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import misbehaving_proxy
import pytest
from command import gslts
from object_store import AZURITE, PROGRAMS, S3, StoreProgram, free_port, object_store
from synthetic_rooms import change_room, write_rooms

BENCHMARK = Path(misbehaving_proxy.__file__).with_name("shared_map_benchmark.py")


def needs(program: StoreProgram) -> pytest.MarkDecorator:
    """Return the mark of tests that start a program."""
    return pytest.mark.skipif(
        program.find() is None,
        reason=f"{program.executable} is missing: {program.package}, and set {program.variable}",
    )


STORES = ["folder", *(pytest.param(name, marks=needs(PROGRAMS[name])) for name in PROGRAMS)]
URL = f"{AZURITE.bucket}/rooms"
NO_WRITING = "the credentials do not permit writing; check the URL, or ask the owner of the bucket"


@pytest.mark.parametrize("store", STORES)
def test_no_update_is_lost_or_doubled(store: str) -> None:
    done = subprocess.run(
        [sys.executable, BENCHMARK, "--store", store, "--moments", "8"],
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    name, _, killed, _, versions, _, problems = re.split(r" *\| *", done.stdout.splitlines()[-1])[
        1:-1
    ]
    assert (name, killed, problems) == (store, "8", "0")
    assert int(versions) > 1


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Return the port of a store that is named by the environment."""
    with object_store() as port:
        for name, value in AZURITE.environment(port).items():
            monkeypatch.setenv(name, value)
        yield port


@needs(AZURITE)
def test_errors_of_a_store_are_one_line(
    tmp_path: Path, store: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_rooms(tmp_path / "map")
    assert gslts("push", "map", URL, cwd=tmp_path).returncode == 0
    change_room(tmp_path / "map", 0)
    state = (tmp_path / "map" / "remote.json").read_bytes()

    def failed(*arguments: str) -> str:
        done = gslts(*arguments, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (1, "")
        return done.stderr

    absent = "az://absent/rooms"
    assert failed("push", "map", absent) == (
        f"gslts: {absent}: there is no such bucket; create it, or check the URL\n"
    )
    assert failed("clone", absent, "new") == (
        f"gslts: {absent}: there is no shared map; check the URL and the bucket, or push one\n"
    )
    monkeypatch.delenv("AZURE_STORAGE_ACCOUNT_KEY")
    assert failed("push", "map") == (
        f"gslts: {URL}: there are no credentials: set AZURE_STORAGE_ACCOUNT_NAME and "
        "AZURE_STORAGE_ACCOUNT_KEY\n"
    )
    reading = AZURITE.environment(store, read_only=True)
    monkeypatch.setenv("AZURE_STORAGE_SAS_KEY", reading["AZURE_STORAGE_SAS_KEY"])
    assert failed("push", "map") == f"gslts: {URL}: {NO_WRITING}\n"
    assert (
        gslts("clone", URL, "clone", cwd=tmp_path).stdout == "clone is version 1: 300 Gaussians\n"
    )
    monkeypatch.setenv("AZURE_STORAGE_ENDPOINT", f"http://127.0.0.1:{free_port()}/x")
    assert failed("pull", "map") == (
        f"gslts: {URL}: the store cannot be reached; check the network, the endpoint and the URL\n"
    )
    assert (tmp_path / "map" / "remote.json").read_bytes() == state


@needs(S3)
def test_errors_of_s3_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_rooms(tmp_path / "map")
    with object_store(S3) as port:
        for name, value in S3.environment(port).items():
            monkeypatch.setenv(name, value)
        url, absent = f"{S3.bucket}/rooms", "s3://absent/rooms"
        assert gslts("push", "map", url, cwd=tmp_path).returncode == 0
        done = gslts("clone", url, "clone", cwd=tmp_path)
        assert done.stdout == "clone is version 1: 300 Gaussians\n"
        for arguments, message in (
            (("push", "map", absent), "there is no such bucket; create it, or check the URL"),
            (
                ("clone", absent, "new"),
                "there is no shared map; check the URL and the bucket, or push one",
            ),
        ):
            done = gslts(*arguments, cwd=tmp_path)
            assert (done.returncode, done.stdout) == (1, "")
            assert done.stderr == f"gslts: {absent}: {message}\n"
        change_room(tmp_path / "map", 0)
        state = (tmp_path / "map" / "remote.json").read_bytes()
        for name, value in S3.environment(port, read_only=True).items():
            monkeypatch.setenv(name, value)
        done = gslts("push", "map", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (1, f"gslts: {url}: {NO_WRITING}\n")
        assert (tmp_path / "map" / "remote.json").read_bytes() == state
        done = gslts("clone", url, "reading", cwd=tmp_path)
        assert done.stdout == "reading is version 1: 300 Gaussians\n"
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        done = gslts("restore", url, "1", cwd=tmp_path)
        assert done.returncode == 1
        (cached,) = (tmp_path / "cache" / "gslts" / "maps").iterdir()
        assert done.stderr == (
            f"gslts: {url}: {NO_WRITING}; what was not pushed stays in {cached}: "
            f"gslts push {cached} tries again\n"
        )
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "wrong")
        done = gslts("pull", "reading", cwd=tmp_path)
        assert "the store does not accept the credentials; check AWS_ACCESS_KEY_ID" in done.stderr
    done = gslts("pull", "map", cwd=tmp_path)
    assert done.stderr == (
        f"gslts: {url}: the store cannot be reached; check the network, the endpoint and the URL\n"
    )
