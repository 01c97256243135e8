"""What every command tells of itself."""

import shlex
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from typer.main import get_command

import gslts
from gslts.cli import app

pytestmark = pytest.mark.smoke

HEAVY = {"torch", "cv2", "open3d", "transformers", "scipy", "sklearn", "pydantic", "PIL"}


def commands(group: Any, way: str = "gslts") -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, f"{way} {name}")
        else:
            yield f"{way} {name}", command


EVERY = dict(commands(get_command(app)))


@pytest.mark.parametrize("way", EVERY)
def test_every_command_has_an_example_that_it_understands(way: str) -> None:
    command = EVERY[way]
    _, *examples = " ".join(command.help.split()).split("Example: ")
    assert examples
    for example in examples:
        assert example.startswith(f"{way} ")
        arguments = shlex.split(example.removeprefix(way))
        context = command.context_class(command, resilient_parsing=True)
        values, left, _ = command.make_parser(context).parse_args(arguments)
        assert left == []
        assert values


def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys; from typer.main import get_command; from gslts.cli import app\n"
        "try:\n    get_command(app)(['--help'])\nexcept SystemExit:\n    print(*sys.modules)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", program], text=True, capture_output=True, check=True
    ).stdout
    assert "Photorealistic" in printed
    assert not HEAVY & set(printed.splitlines()[-1].split())


def test_the_version_is_told() -> None:
    program = "from typer.main import get_command; from gslts.cli import app; get_command(app)()"
    done = subprocess.run(
        [sys.executable, "-c", program, "--version"], text=True, capture_output=True
    )
    assert (done.returncode, done.stdout) == (0, f"gslts {gslts.__version__}\n")
