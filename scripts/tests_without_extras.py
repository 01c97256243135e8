"""Print the files of unit tests whose imports are all installed; on stderr, why others are not."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

TESTS, SUPPORT = Path("tests/py"), (Path("tests/support"), Path("benchmarks/faults"))
RAY_CASTER = "embreex"  # What the simulator imports late, and which only x86-64 has.


def main() -> None:
    """Print the files; name each missing package once."""
    left_out: dict[str, int] = {}
    for path in sorted(TESTS.rglob("test_*.py")):
        if path.is_relative_to(TESTS / "system"):
            continue
        missing = sorted(name for name in imports_of(path) if not is_installed(name))
        if missing:
            left_out[missing[0]] = left_out.get(missing[0], 0) + 1
        else:
            print(path)
    for name, count in sorted(left_out.items()):
        print(f"left out for want of {name}: {count} files", file=sys.stderr)


@cache
def imports_of(path: Path) -> frozenset[str]:
    """Collect the modules that a file imports, and those of the helpers of tests."""
    names: set[str] = set()
    for module in _modules(ast.parse(path.read_text())):
        helper = next((f for folder in SUPPORT if (f := folder / f"{module}.py").exists()), None)
        names |= imports_of(helper) if helper else {module}
        if module.startswith("gslts_sim"):
            names.add(RAY_CASTER)
    return frozenset(names)


def _modules(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module


@cache
def is_installed(name: str) -> bool:
    """Check that a module can be imported.

    Args:
        name: Its full name.
    """
    try:
        importlib.import_module(name)
    except ImportError:
        return False
    return True


if __name__ == "__main__":
    main()
