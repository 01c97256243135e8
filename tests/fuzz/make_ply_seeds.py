"""Writes the hand-made part of corpus/ply: a small file of each kind, and what once went wrong.

The other files are from fuzzing. They are few, and together with these they reach every branch that
the fuzzer has found.
"""

import math
import struct
from pathlib import Path

FOLDER = Path(__file__).parent / "corpus" / "ply"

NAMES = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
NAMES += [f"scale_{i}" for i in range(3)] + [f"rot_{i}" for i in range(4)]


def header(layout: str, *lines: str) -> bytes:
    return "\n".join(["ply", f"format {layout} 1.0", *lines, "end_header\n"]).encode()


def floats(names: list[str]) -> list[str]:
    return [f"property float {name}" for name in names]


def ascii_rows(*rows: list[float]) -> bytes:
    return b"".join(" ".join(f"{x:g}" for x in row).encode() + b"\n" for row in rows)


row = [i / 4 - 1 for i in range(len(NAMES))]
vertex = ["element vertex 2", *floats(NAMES)]
degree_1 = NAMES + [f"f_rest_{i}" for i in range(9)]
face = ["element face 2", "property list uchar int vertex_indices", "property uchar red"]
binary_faces = struct.pack("<BiiiB", 3, 0, 1, 1, 255) + struct.pack("<BB", 0, 7)
bounds = [
    f"{limit}_{kind}{axis}"
    for kind, axes in [("", "xyz"), ("scale_", "xyz"), ("", "rgb")]
    for limit in ["min", "max"]
    for axis in axes
]
packed = [f"packed_{name}" for name in ["position", "rotation", "scale", "color"]]
compressed = [
    "element chunk 1",
    *floats(bounds),
    "element vertex 2",
    *(f"property uint {name}" for name in packed),
]
compressed_rows = struct.pack("<18f", *range(18)) + struct.pack(
    "<8I", 0, 0x40000000, 0x80402010, 0xFF804020, 2**32 - 1, 0x80100401, 0, 0
)
seeds = {
    "ascii": header("ascii", *vertex) + ascii_rows(row, row),
    "ascii_crlf": (header("ascii", *vertex) + ascii_rows(row, row)).replace(b"\n", b"\r\n"),
    "ascii_faces": header("ascii", *face, *vertex) + b"3 0 1 1 255\n0 7\n" + ascii_rows(row, row),
    "empty": header("ascii", "element vertex 0", *floats(NAMES)),
    "little_endian": header("binary_little_endian", "obj_info made by hand", *vertex)
    + struct.pack("<28f", *row, *row),
    "big_endian": header("binary_big_endian", *vertex) + struct.pack(">28f", *row, *row),
    "little_endian_faces": header("binary_little_endian", *face, *vertex)
    + binary_faces
    + struct.pack("<28f", *row, *row),
    "degree_1_reversed": header(
        "binary_little_endian", "element vertex 1", *floats(["nx", "ny", "nz", *degree_1][::-1])
    )
    + struct.pack("<26f", *range(26)),
    "types": header(
        "binary_big_endian",
        "element vertex 1",
        *(
            f"property {type_name} {name}"
            for type_name, name in zip(
                ["double", "char", "uchar", "short", "ushort", "int", "uint"] * 2,
                NAMES,
                strict=True,
            )
        ),
        "property list ushort double weights",
    )
    + struct.pack(">" + "dbBhHiI" * 2, *range(14))
    + struct.pack(">Hdd", 2, 0.5, 0.25),
    "infinite_opacity": header("ascii", *vertex)
    + ascii_rows([*row[:6], math.inf, -math.inf, *row[8:]], [*row[:6], -math.inf, *row[7:]]),
    "colors": header(
        "binary_little_endian",
        "element vertex 1",
        *floats([name for name in NAMES if not name.startswith("f_dc")]),
        *(f"property uchar {name}" for name in ["red", "green", "blue"]),
    )
    + struct.pack("<11f3B", *range(11), 0, 128, 255),
    "compressed": header("binary_little_endian", *compressed) + compressed_rows,
    "compressed_sh": header(
        "binary_little_endian",
        *compressed,
        "element sh 2",
        *(f"property uchar f_rest_{i}" for i in range(9)),
    )
    + compressed_rows
    + bytes([*range(0, 256, 30), *range(255, 0, -30)]),
    # The message quoted the line with its tab.
    "unprintable_with_tab": b"ply\nformat ascii 1.0\nelement vertex\t\x80 1\n",
    "gslts": header(
        "binary_little_endian",
        "comment gslts origin 4.5e6 -1e-3 7",
        *vertex,
        *floats(["feature_0", "feature_1"]),
        "property uint id_low",
        "property uint id_high",
    )
    + struct.pack("<16fII", *row, 1, 2, 5, 0)
    + struct.pack("<16fII", *row, 3, 4, 2, 1),
}
for name, contents in seeds.items():
    (FOLDER / f"{name}.ply").write_bytes(contents)
