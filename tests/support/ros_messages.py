"""Message classes of ROS in this interpreter, from the environment of the tests of ROS.

They are plain Python; only what sends them loads libraries, by that environment's interpreter.
"""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def add_message_packages() -> None:
    """Make the message packages importable, if they are installed and ROS is not sourced."""
    # Before their first import: constructors and fields then check the types of their values.
    os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
    python = Path(os.environ.get("GSLTS_ROS_PYTHON", ROOT / "build/ros/bin/python"))
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    packages = python.parent.parent / "lib" / version / "site-packages"
    # At the end: it has packages of other versions as well, such as numpy.
    if packages.is_dir() and str(packages) not in sys.path:
        sys.path.append(str(packages))
