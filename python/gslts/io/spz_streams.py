"""Container of .spz files: a header and one stream of bytes for each attribute.

Versions 1 to 3 are one gzip stream of a header of 16 bytes and the attributes. Version 4 has a
header of 32 bytes, records of extensions, a table of the compressed and full sizes of the streams,
and a Zstandard frame for each; an empty stream has none. In old versions, the records follow the
attributes.

Source: nianticlabs/spz, version 3, and splat-transform 2.7, whose files have version 4.
"""

from __future__ import annotations

import struct
import sys
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

MAGIC = b"NGSP"
HEADER, HEADER_4, TABLE_ENTRY = "<4sIIBBBB", "<4sIIBBBBI12x", "<QQ"
"""Magic, version, number of Gaussians, degree, fractional bits, flags, and a reserved byte or, in
version 4, the number of streams and the offset of the table; compressed and full size of a
stream."""
MORE_FLAGS = 0x82
"""Flags of files in which more follows the attributes: extensions and levels of detail."""
EXTENSIONS, RECORD = 0x02, "<II"
"""Flag of files with extensions; type and size of a record, before its content."""
COORDINATE_SYSTEM = 0xADBE0003
"""Type of the record SPZ_ADOBE_coordinate_system, whose content is a number of 32 bits."""
AXES = {0: (1, 1, 1), 1: (-1, -1, 1), 4: (1, 1, 1), 6: (1, -1, -1), 7: (-1, 1, -1)}
"""Directions of x, y and z by that number, 1 for right, up and back: none, LDB, RUB, RDF and LUF.
The others are left-handed, or swap y and z, which versions of Niantic's library do differently."""
MAX_RECORDS_BYTES = 1 << 20
"""Maximum size of the records of old versions that are read; those of cameras and axes have 32."""
MAX_RATIO = 100
"""Maximum ratio of the size of the attributes to that of the file: those of rooms have 3."""
SMALL_BYTES = 16 << 20
"""Size of attributes that any file may have, bytes: a small map can be very regular."""
MAX_FILE_BYTES = 1 << 32
"""Maximum size of a file, bytes; one of 20 million Gaussians of degree 3 has about 0.5e9."""
LEVEL_GZIP, LEVEL_ZSTD = 6, 12
"""Levels of compression. Zstandard at 19 takes seven times as long for 1% less."""
WINDOW_LOG = 27
"""Maximum window of a Zstandard frame, as a power of 2: 128 MiB, what its own tools accept."""


@dataclass(frozen=True)
class SpzHeader:
    """Header of a file, without its container.

    Args:
        version: 1 to 4.
        size: Number of Gaussians, N.
        degree: Of the spherical harmonics, 0 to 4.
        fractional_bits: Of positions.
        flags: 1 for training with antialiasing; `MORE_FLAGS`.
        axes: Directions of x, y and z, 1 for right, up and back, -1 for left, down and front.
    """

    version: int
    size: int
    degree: int
    fractional_bits: int
    flags: int = 0
    axes: tuple[int, int, int] = (1, 1, 1)

    def widths(self) -> dict[str, int]:
        """Return the bytes of a Gaussian of each attribute, in the order of the file."""
        return {
            "positions": 6 if self.version == 1 else 9,
            "alphas": 1,
            "colors": 3,
            "scales": 3,
            "rotations": 4 if self.version >= 3 else 3,
            "harmonics": 3 * ((self.degree + 1) ** 2 - 1),
        }


def pack_streams(header: SpzHeader, streams: dict[str, bytes]) -> bytes:
    """Return the bytes of a file.

    Args:
        header: Of version 3 or 4.
        streams: Of the sizes that the header says, in that order.
    """
    fields = (header.size, header.degree, header.fractional_bits, header.flags)
    if header.version < 4:
        head = struct.pack(HEADER, MAGIC, header.version, *fields, 0)
        packer = zlib.compressobj(LEVEL_GZIP, zlib.DEFLATED, 16 + zlib.MAX_WBITS)
        return packer.compress(b"".join([head, *streams.values()])) + packer.flush()
    full = [stream for stream in streams.values() if stream]
    frames = [zstd.compress(stream, level=LEVEL_ZSTD) for stream in full]
    table = [
        struct.pack(TABLE_ENTRY, len(frame), len(stream))
        for frame, stream in zip(frames, full, strict=True)
    ]
    head = struct.pack(HEADER_4, MAGIC, 4, *fields, len(full), struct.calcsize(HEADER_4))
    return b"".join([head, *table, *frames])


def unpack_streams(path: Path) -> tuple[SpzHeader, dict[str, bytes]]:
    """Read the streams of an untrusted file; their sizes are checked before they are unpacked.

    Args:
        path: A regular file.

    Returns:
        The header, and the streams, which have the sizes that it says.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged, of an unknown version, or would be too large unpacked; one line
            names the file and what is wrong.
    """
    return _Unpacker(path).unpack()


class _Unpacker:
    """Unpacks a file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.exists() and not path.is_file():
            self.reject("it is not a file")
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            self.reject(f"it has {size} bytes, more than {MAX_FILE_BYTES}")
        with path.open("rb") as file:
            self.data = file.read(size)

    def reject(self, problem: str) -> NoReturn:
        raise ValueError(f"{self.path}: {problem}")

    def unpack(self) -> tuple[SpzHeader, dict[str, bytes]]:
        if self.data[:4] == MAGIC:
            return self._unpack_zstd()
        if self.data[:2] != b"\x1f\x8b":
            self.reject("no .spz file: it begins with neither NGSP nor a gzip stream")
        return self._unpack_gzip()

    def _header(self, head: bytes, versions: tuple[int, ...]) -> SpzHeader:
        magic, version, size, degree, bits, flags, _ = struct.unpack(HEADER, head)
        if magic != MAGIC:
            self.reject("no .spz file: the gzip stream does not begin with NGSP")
        if version not in versions:
            self.reject(f"version {version} is not supported here; convert it to version 3 or 4")
        if degree > 4 or bits > 24:
            self.reject(f"damaged header: degree {degree}, {bits} fractional bits")
        header = SpzHeader(version, size, degree, bits, flags)
        unpacked = size * sum(header.widths().values())
        if unpacked > SMALL_BYTES + MAX_RATIO * len(self.data):
            self.reject(
                f"{size} Gaussians take {unpacked} bytes, more than {MAX_RATIO} times the file; "
                "it is damaged or meant to exhaust the memory"
            )
        return header

    def _unpack_gzip(self) -> tuple[SpzHeader, dict[str, bytes]]:
        unpacker = zlib.decompressobj(16 + zlib.MAX_WBITS)
        try:
            head = unpacker.decompress(self.data, struct.calcsize(HEADER))
            if len(head) < struct.calcsize(HEADER):
                self.reject("the file ends in its header")
            header = self._header(head, (1, 2, 3))
            wanted = header.size * sum(header.widths().values())
            body = unpacker.decompress(unpacker.unconsumed_tail, wanted + MAX_RECORDS_BYTES)
        except zlib.error as error:
            self.reject(f"damaged gzip stream: {error}")
        if len(body) < wanted:
            self.reject(f"the attributes have {len(body)} bytes, {header.size} Gaussians {wanted}")
        if not header.flags & MORE_FLAGS and (len(body) > wanted or not unpacker.eof):
            self.reject(f"the gzip stream does not end after {header.size} Gaussians")
        streams: dict[str, bytes] = {}
        begin = 0
        for name, width in header.widths().items():
            streams[name] = body[begin : begin + header.size * width]
            begin += header.size * width
        return self._with_axes(header, body, begin, len(body)), streams

    def _unpack_zstd(self) -> tuple[SpzHeader, dict[str, bytes]]:
        if len(self.data) < struct.calcsize(HEADER_4):
            self.reject("the file ends in its header")
        header = self._header(self.data[: struct.calcsize(HEADER)], (4,))
        count, offset = struct.unpack(HEADER_4, self.data[: struct.calcsize(HEADER_4)])[-2:]
        sizes = {name: header.size * width for name, width in header.widths().items()}
        sizes = {name: size for name, size in sizes.items() if size > 0}
        begin = offset + count * struct.calcsize(TABLE_ENTRY)
        if count != len(sizes) or offset < struct.calcsize(HEADER_4) or begin > len(self.data):
            self.reject(
                f"damaged header: {count} streams, expected {len(sizes)}; table at {offset}"
            )
        table = list(struct.iter_unpack(TABLE_ENTRY, self.data[offset:begin]))
        streams = dict.fromkeys(header.widths(), b"")
        for (name, size), (packed_size, full_size) in zip(sizes.items(), table, strict=True):
            if full_size != size:
                self.reject(f"{name}: {full_size} bytes for {header.size} Gaussians, not {size}")
            if packed_size > len(self.data) - begin:
                self.reject(f"{name}: the file ends in this stream")
            streams[name] = self._inflate(name, self.data[begin : begin + packed_size], size)
            begin += packed_size
        if begin != len(self.data):
            self.reject(f"{len(self.data) - begin} bytes follow the last stream")
        return self._with_axes(header, self.data, struct.calcsize(HEADER_4), offset), streams

    def _with_axes(self, header: SpzHeader, data: bytes, begin: int, end: int) -> SpzHeader:
        """Return the header with the axes in the records of extensions, if they name any."""
        while header.flags & EXTENSIONS and begin + struct.calcsize(RECORD) <= end:
            kind, size = struct.unpack_from(RECORD, data, begin)
            begin += struct.calcsize(RECORD)
            if kind == COORDINATE_SYSTEM and begin + 4 <= end:
                number = int.from_bytes(data[begin : begin + 4], "little")
                if number not in AXES:
                    self.reject(
                        f"SPZ_ADOBE_coordinate_system {number}: these axes are not supported; "
                        "store it without this extension"
                    )
                return replace(header, axes=AXES[number])
            begin += size
        return header

    def _inflate(self, name: str, frame: bytes, size: int) -> bytes:
        limit = {int(zstd.DecompressionParameter.window_log_max): WINDOW_LOG}
        unpacker = zstd.ZstdDecompressor(options=limit)
        try:
            stream = unpacker.decompress(frame, size + 1)
        except zstd.ZstdError as error:
            self.reject(f"{name}: damaged Zstandard frame: {error}")
        if len(stream) != size or not unpacker.eof:
            self.reject(f"{name}: the stream does not have {size} bytes")
        return stream
