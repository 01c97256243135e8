"""Code blocks of the documents: the console and Python ones are run, the shell ones are parsed."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

from gslts.cli import app

ROOT = Path(__file__).parents[2]
DOCUMENTS = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "benchmarks").rglob("*.md")),
    *sorted((ROOT / "ros").rglob("*.md")),
]
FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LANGUAGES = {
    "python": "run",
    "console": "run, and what they print is compared",
    "sh": "parsed: each command must be understood",
    "json": "parsed",
    "cmake": "not run: tests/consumer is built with them",
    "text": "not run",
}
"""By language: what happens to a block. Others are errors, but for `{toctree}` and the like."""
OTHER_PROGRAMS = {
    "apt-get", "cd", "cmake", "colcon", "cp", "ctest", "dask", "hf", "mkdir", "perf", "ros2",
    "rosdep", "rtabmap-export", "source", "unzip",
}  # fmt: skip
"""Programs whose arguments are not checked."""
KEYWORDS = {"for", "do", "done"}
NUMBER = r"-?\d(?:[\d.,]*\d)?"
COMMAND = get_command(app)


def blocks(document: Path) -> Iterator[tuple[str, str]]:
    """Yield language and text of the code blocks of a document."""
    for language, text in FENCE.findall(document.read_text()):
        if not language.startswith("{"):
            yield language, text


def run_blocks(document: Path, folder: Path, names: dict[str, Any]) -> None:
    """Run the Python and console blocks of a document in their order.

    Args:
        document: Its path.
        folder: Working directory of the commands.
        names: Global names of the Python blocks.
    """
    for language, text in blocks(document):
        if language == "python":
            exec(text, names)
        elif language == "console":
            for command, expected in _sessions(text):
                assert_printed(expected, _run(command, folder))


def assert_printed(expected: str, printed: str) -> None:
    """Compare what a command printed with a document: any number fits any, `...` anything."""
    parts = re.split(rf"(\.\.\.|{NUMBER}|\s+)", expected.strip())
    pattern = "".join(_pattern(part) for part in parts)
    assert re.fullmatch(pattern, printed.strip(), re.DOTALL), f"{expected}\n--- printed:\n{printed}"


def assert_understood(line: str) -> None:
    """Check a line of a shell block: commands, options, targets, files and extras exist."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=";&|")
    lexer.whitespace_split = True
    words: list[str] = []
    for word in [*lexer, ";"]:
        if not re.fullmatch("[;&|]+", word):
            words.append(word)
            continue
        while words and (words[0] in KEYWORDS - {"for"} or re.match(r"\w+=", words[0])):
            words.pop(0)
        if words and words[0] != "for":
            _check_command(words)
        words = []


def _sessions(text: str) -> Iterator[tuple[str, str]]:
    """Yield the commands of a console block with what they print."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        yield command, expected


def _run(command: str, folder: Path) -> str:
    """Run a command by a shell that finds the `gslts` of this interpreter."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "NO_COLOR": "1", "COLUMNS": "200"}
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}"
    return done.stdout


def _pattern(part: str) -> str:
    if part == "...":
        return ".*"
    if re.fullmatch(NUMBER, part):
        return NUMBER
    return r"\s+" if part.isspace() else re.escape(part)


def _check_command(words: list[str]) -> None:
    program, arguments = words[0].removeprefix(".venv/bin/"), words[1:]
    if Path(program).name == "gslts":
        _check_gslts(arguments)
    elif program == "make":
        targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        assert set(arguments) <= set(targets), arguments
    elif program == "pip":
        extras = re.search(r"\[(.*)\]", arguments[-1])
        assert set(extras[1].split(",") if extras else ()) <= _extras(), arguments
    elif Path(program).name in ("python", "python3"):
        assert arguments[0] == "-m" or (ROOT / arguments[0]).exists(), arguments
    elif "/" in program:
        assert program.startswith("build/") or (ROOT / program).exists(), program
    else:
        assert program in OTHER_PROGRAMS, words


def _check_gslts(arguments: list[str]) -> None:
    """Parse arguments, with types and choices unless there is a URL, which would be opened."""
    resilient = any("://" in argument for argument in arguments)
    command, name = COMMAND, "gslts"
    if arguments in (["--help"], ["--version"]):
        return
    while hasattr(command, "commands"):
        name, *arguments = arguments
        assert name in command.commands, f"gslts has no command {name}"
        command = command.commands[name]
    try:
        command.make_context(name, list(arguments), resilient_parsing=resilient)
    except Exception as error:  # Its type depends on the version of Typer.
        raise AssertionError(f"gslts ... {name} {' '.join(arguments)}: {error}") from None


def _extras() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return set(project["optional-dependencies"])
