"""Message classes of ROS in this interpreter, from the environment of the tests of ROS.

They are plain Python; only what sends them loads libraries, by that environment's interpreter.
"""

import os
import sys

from ros_peer import ros_python


def add_message_packages() -> None:
    """Make the message packages importable, if they are installed and ROS is not sourced."""
    # Before their first import: constructors and fields then check the types of their values.
    os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
    python = ros_python()
    if python is None:
        return
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    packages = str(python.parent.parent / "lib" / version / "site-packages")
    if packages not in sys.path:
        sys.path.append(packages)  # The last one: it has other versions of numpy, for example.
