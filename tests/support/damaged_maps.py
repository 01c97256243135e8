"""Files of maps with damage at random positions."""

from collections.abc import Callable
from pathlib import Path

from hypothesis import strategies as st


def assert_map_or_one_line(path: Path, data: st.DataObject, read: Callable[[Path], object]) -> None:
    """Damage a file, and require that it is read, or an error of one line that names it."""
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        begin = data.draw(st.integers(0, len(content) - 1))
        end = begin + data.draw(st.integers(0, 5))
        content[begin:end] = data.draw(st.binary(max_size=5))
    path.write_bytes(content)
    message = f"{path}: no error"
    try:
        read(path)
    except ValueError as error:
        message = str(error)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
