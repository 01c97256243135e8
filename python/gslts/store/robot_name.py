"""Name of the robot that writes a map. Does not import NumPy."""

from __future__ import annotations

import os
import re
import socket

VARIABLE = "GSLTS_ROBOT"
"""Environment variable with the name; without it, robots are named by their host."""
NAME = r"[\w.@-]{1,64}"
"""Names as `gslts log` prints them: no white space, no control characters."""


def robot_name() -> str:
    """Return the name of this robot, which `gslts log` shows with all that it adds to a map.

    Raises:
        ValueError: The environment variable holds no name.
    """
    given = os.environ.get(VARIABLE)
    if given is None:
        return re.sub(r"[^\w.@-]", "-", socket.gethostname())[:64] or "unknown"
    if not re.fullmatch(NAME, given):
        raise ValueError(
            f"{VARIABLE}: a name has 1 to 64 letters, digits or characters of _.@-, got {given!r}"
        )
    return given
