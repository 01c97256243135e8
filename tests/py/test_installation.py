"""Requirements of the package alone, and those of its extras."""

import re
import runpy
import sys
import tomllib
from pathlib import Path

import pytest

from gslts.cli import extra_with

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
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
    named = {
        extra
        for path in (ROOT / "python").rglob("*.py")
        for extra in re.findall(r"pip install '?gslts\[(\w+)\]", path.read_text())
    }
    assert {"sim", "viewer", "torch"} <= named <= EXTRAS.keys()


def test_a_wheel_is_tested_with_what_is_installed(tmp_path: Path) -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "tests_without_extras.py"))
    path = tmp_path / "test_it.py"
    path.write_text("import json\n\ndef test_it():\n    from missing_package.part import it\n")
    assert script["imports_of"](path) == {"json", "missing_package.part"}
    assert script["is_installed"]("json")
    assert not script["is_installed"]("missing_package.part")


def test_the_demonstration_without_its_extra_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("embreex")
    from gslts_bench.demo import QUICK, run_day

    monkeypatch.setitem(sys.modules, "embreex", None)
    monkeypatch.delitem(sys.modules, "embreex.rtcore_scene", raising=False)
    with pytest.raises(ImportError, match=r"pip install 'gslts\[sim\]'"):
        run_day(tmp_path / "out", QUICK, threads=1, bar=lambda items, _: items, say=print)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_package_names_its_extra() -> None:
    assert extra_with("matplotlib.figure") == ": pip install 'gslts[sim]'"
    assert extra_with("scipy") == ": pip install 'gslts[bench]'"
    assert extra_with("numpy") == extra_with("gslts.nothing") == ""
