"""Help and examples of all commands, and the modules that they import."""

import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.main import get_command

import gslts
from gslts._core import simd
from gslts.cli import app
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.files import write_autoencoder
from gslts.semantics.source import Oracle
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import open_map, write_map_folder

pytestmark = pytest.mark.smoke

MODELS = {"torch", "transformers", "open3d", "matplotlib", "scipy", "sklearn"}
HEAVY = {*MODELS, "cv2", "numpy", "pydantic", "PIL", "gslts._core"}


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


def imported_by(program: str, *arguments: str) -> tuple[str, set[str]]:
    """Run a program; return what it prints and the modules that it imported."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{program}\nprint(*sys.modules)", *arguments],
        text=True,
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr
    *printed, modules = done.stdout.splitlines()
    return "\n".join(printed), set(modules.split())


COMMAND = """
from typer.main import get_command
from gslts.cli import app
try:
    get_command(app)()
except SystemExit as end:
    assert end.code == 0
"""


def test_help_imports_nothing_heavy() -> None:
    printed, modules = imported_by(COMMAND, "--help")
    assert "Photorealistic" in printed
    assert not HEAVY & modules


def test_importing_gslts_imports_none_of_its_parts() -> None:
    _, modules = imported_by("import gslts")
    assert not HEAVY & modules


def test_every_public_name_is_there_and_no_other() -> None:
    program = """
import gslts
import gslts.rendering.rasterizer, gslts.rendering.losses
assert all(hasattr(gslts, name) for name in gslts.__all__), gslts.__all__
assert set(gslts.__all__) <= set(dir(gslts))
assert callable(gslts.render)
assert gslts.losses.photometric_loss
try:
    gslts.missing
except AttributeError as error:
    print(error)
"""
    assert imported_by(program)[0] == "module 'gslts' has no attribute 'missing'"


@pytest.fixture(scope="module")
def semantic_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a map of a few Gaussians with semantic features."""
    folder = tmp_path_factory.mktemp("semantic_map") / "map"
    names = ("Mug", "Wall")
    autoencoder = train_autoencoder(Oracle().encode(names), 8, steps=100)
    points = np.random.default_rng(0).uniform(0, 0.1, (200, 3)).astype(np.float32)
    some = GaussianMap(
        means=points,
        quats=np.tile(np.float32([1, 0, 0, 0]), (200, 1)),
        log_scales=np.full((200, 3), -4, np.float32),
        logit_opacities=np.full(200, 3, np.float32),
        sh=np.zeros((200, 1, 3), np.float32),
    )
    write_map_folder(folder, some, {"dataset": "made up"}, {})
    cause = SemanticsCause(
        source="oracle",
        dataset="made up",
        levels=1,
        code_dims=8,
        names=names,
        autoencoder=write_autoencoder(autoencoder, folder),
    )
    features = autoencoder.encode(np.repeat(Oracle().encode(["Mug"]), 200, axis=0))
    with open_map(folder, writable=True) as store:
        store.commit_features(replace(some, features=features), cause)
    return folder


def test_a_query_imports_neither_models_nor_plotting(semantic_map: Path) -> None:
    printed, modules = imported_by(COMMAND, "query", str(semantic_map), "mug")
    assert printed.startswith("mug at (0.05, 0.05, 0.05) m")
    assert not MODELS & modules


def test_the_log_imports_neither_numpy_nor_the_extension(semantic_map: Path) -> None:
    printed, modules = imported_by(COMMAND, "log", str(semantic_map))
    assert "semantic features from oracle" in printed
    assert not (HEAVY - {"pydantic"}) & modules  # Typer itself imports pydantic.


def test_the_version_is_printed() -> None:
    program = "from typer.main import get_command; from gslts.cli import app; get_command(app)()"
    done = subprocess.run(
        [sys.executable, "-c", program, "--version"], text=True, capture_output=True
    )
    assert (done.returncode, done.stdout) == (0, f"gslts {gslts.__version__} ({simd.target()})\n")
