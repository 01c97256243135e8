"""A PLY file that promises too much takes no memory."""

import subprocess
import sys

from ply_maps import columns_of, float_map


def test_header_that_lies_takes_no_memory(tmp_path):
    """Each file promises more than fits into the address space that the child may use."""
    path = tmp_path / "map.ply"
    names = [name for name in columns_of(float_map(1)) if name[0] != "n"]
    header = "ply\nformat {} 1.0\n{}element vertex {}\n{}end_header\n"
    properties = "".join(f"property uchar {name}\n" for name in names)
    lists = "element face {}\nproperty list uint double a\n"
    contents = [
        header.format("binary_little_endian", "", 2**40, properties),
        header.format("ascii", "", 2**40, properties),
        header.format("binary_big_endian", lists.format(2**62), 1, properties),
        header.format("binary_big_endian", lists.format(1), 0, properties) + "\xff" * 4,
        header.format("binary_little_endian", "", 2**24, "property uchar x\n") + "x" * 2**24,
    ]
    script = """
import resource, sys, gslts
gslts.Rasterizer()
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 2**25, used + 2**25))
try:
    gslts.read_ply(sys.argv[1])
except ValueError as error:
    print(error)
"""
    for content in contents:
        path.write_bytes(content.encode("latin-1"))
        command = [sys.executable, "-c", script, path]
        result = subprocess.run(command, capture_output=True, text=True, check=True)
        assert result.stdout.startswith(f"{path}: "), result
        assert result.stdout.count("\n") == 1
