"""Files of recordings, damaged at random: each is an error of one line, or is read."""

import random
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from phone_recordings import pack, write_polycam, write_r3d
from rtabmap_exports import write_rtabmap
from scan_recordings import write_replica, write_scannet, write_sens

from gslts.cli.localize import read_frames
from gslts.datasets import open_dataset

TRIES = 40
"""Damaged files of each format; 1,500 of each were tried once."""
INSERTED = (bytes(50), b"9" * 400, b"nan", b"-inf ", b"1e999", b"{[", b"\xff" * 8)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Cut content off, change or insert bytes, or replace it."""
    changed = bytearray(content)
    kind = rng.randrange(4)
    at = rng.randrange(len(changed) + 1)
    if kind == 0:
        return content[:at]
    if kind == 1:
        return rng.randbytes(rng.randrange(2000))
    if kind == 2:
        changed[at:at] = rng.choice(INSERTED)
    else:
        for _ in range(rng.choice((1, 4, 40))):
            near = min(len(changed), rng.choice((200, 1 << 30)))  # Headers are at the start.
            changed[rng.randrange(near)] = rng.randrange(256)
    return bytes(changed)


@pytest.mark.parametrize(
    "write",
    [
        write_polycam,
        write_r3d,
        lambda folder: pack(write_r3d(folder)),
        write_rtabmap,
        write_scannet,
        lambda folder: write_sens(folder.parent.parent / "room.sens"),
        write_replica,
    ],
    ids=["polycam", "r3d", "r3d packed", "rtabmap", "scannet", "sens", "replica"],
)
def test_damaged_files_are_errors_or_read(tmp_path: Path, write: Callable[[Path], Path]) -> None:
    path, rng = write(tmp_path / "set" / "room"), random.Random(5)
    files = sorted(file for file in tmp_path.rglob("*") if file.is_file())
    files = [file for file in files if path.is_dir() or file == path]
    read, messages = 0, list[str]()
    for _ in range(TRIES):
        victim = rng.choice(files)
        content = victim.read_bytes()
        victim.write_bytes(damaged(content, rng))
        try:
            for frame in open_dataset(path).frames:
                with suppress(OSError, ValueError):
                    frame.read()
                    read += 1
        except (OSError, ValueError) as error:
            messages.append(str(error))
        victim.write_bytes(content)
    assert not any("\n" in message for message in messages)
    assert read > 0, "the undamaged files are still good"


def test_a_damaged_frame_does_not_stop_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_scannet(tmp_path / "room")
    images = sorted((tmp_path / "room").rglob("*.jpg"))
    images[0].write_bytes(images[0].read_bytes()[:-200])
    names = [frame.name for frame in open_dataset(tmp_path / "room").frames]
    assert list(read_frames(tmp_path / "room", None)) == names[1:]
    (line,) = (line for line in capsys.readouterr().err.splitlines() if "skipped" in line)
    assert line.startswith(f"skipped {names[0]}: ")
    for image in images:
        image.write_bytes(image.read_bytes()[:-200])
    with pytest.raises(ValueError, match="room: none of its frames can be read"):
        read_frames(tmp_path / "room", None)
