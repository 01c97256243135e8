""".spz files, written by hand so that every field can be wrong, and read number by number."""

import gzip
import struct
from collections.abc import Sequence

from gslts.io.spz_streams import zstd

HEADER = "<4sIIBBBB"


def header(version: int, size: int, degree: int, *, bits: int = 12, flags: int = 0) -> bytes:
    """Return a header of versions 1 to 3, with which that of version 4 begins, too."""
    return struct.pack(HEADER, b"NGSP", version, size, degree, bits, flags, 0)


def gzip_file(head: bytes, *streams: bytes) -> bytes:
    """Return a file of versions 1 to 3."""
    return gzip.compress(head + b"".join(streams), mtime=0)


def zstd_file(
    head: bytes,
    streams: Sequence[bytes],
    *,
    extensions: bytes = b"",
    table: Sequence[tuple[int, int]] | None = None,
) -> bytes:
    """Return a file of version 4; the table of sizes is that of the streams unless given."""
    frames = [zstd.compress(stream) for stream in streams]
    sizes = [(len(frame), len(stream)) for frame, stream in zip(frames, streams, strict=True)]
    entries = [struct.pack("<QQ", *entry) for entry in (sizes if table is None else table)]
    full_head = head[:15] + struct.pack("<BI12x", len(streams), 32 + len(extensions))
    return b"".join([full_head, extensions, *entries, *frames])


# A Gaussian of degree 1: each stream of version 3.
POSITION = struct.pack("<3i", 1 << 12, -(3 << 11), 5)  # 4 bytes each, of which 3 are used.
POSITION = b"".join(POSITION[4 * k : 4 * k + 3] for k in range(3))
ALPHA, COLOR, SCALE = bytes([51]), bytes([0, 128, 255]), bytes([0, 160, 255])
ROTATION = struct.pack("<I", 3 << 30 | (512 | 511) << 20 | 0 << 10 | 100)
HARMONICS = bytes([0, 128, 248, 8, 16, 24, 120, 136, 144])
STREAMS = (POSITION, ALPHA, COLOR, SCALE, ROTATION, HARMONICS)
