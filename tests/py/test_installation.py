"""What `pip install gslts` brings, and what it leaves to extras."""

import re
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]
HEAVY = {"matplotlib", "open3d", "open3d-cpu", "scipy", "torch", "transformers"}


def names_of(requirements: list[str]) -> set[str]:
    """Name the packages of requirements, those of extras of gslts too."""
    names: set[str] = set()
    for requirement in requirements:
        extras = re.match(r"gslts\[(.+)\]", requirement)
        if extras:
            for extra in extras[1].split(","):
                names |= names_of(EXTRAS[extra])
        else:
            names |= set(re.findall(r"^[\w-]+", requirement))
    return names


def test_the_package_alone_is_lean() -> None:
    assert not names_of(PROJECT["dependencies"]) & HEAVY
    assert PROJECT["requires-python"] == ">=3.11"


def test_extras_without_models_bring_no_torch() -> None:
    with_torch = {extra for extra in EXTRAS if "torch" in names_of(EXTRAS[extra])}
    assert with_torch == {"dev", "lint", "models", "test", "torch"}


def test_messages_name_extras_that_exist() -> None:
    sources = Path(__file__).parents[2] / "python"
    named = {
        extra
        for path in sources.rglob("*.py")
        for extra in re.findall(r"pip install '?gslts\[(\w+)\]", path.read_text())
    }
    assert {"sim", "viewer", "torch"} <= named <= EXTRAS.keys()
