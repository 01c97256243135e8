"""Entry point of the node: the command `gslts ros`, with the arguments that ROS adds."""

import sys
from collections.abc import Sequence


def arguments_of(own: Sequence[str]) -> list[str]:
    """Return the arguments of `gslts`; those from --ros-args on go to ROS.

    Args:
        own: Arguments of the entry point, as a launch file makes them.
    """
    at = own.index("--ros-args") if "--ros-args" in own else len(own)
    return ["ros", *own[:at], *(["--", *own[at:]] if own[at:] else [])]


def main() -> None:
    """Run `gslts ros`."""
    try:
        from gslts.cli import main as run
    except ImportError as error:
        sys.exit(f"gslts_ros: {error}: activate the environment in which gslts is installed")
    sys.argv = ["gslts", *arguments_of(sys.argv[1:])]
    run()


if __name__ == "__main__":
    main()
