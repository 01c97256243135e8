"""Checks docstrings, constants and the layout: what ruff's rules do not cover.

    python scripts/check_docstrings.py          # lists each finding; exit status 1 if there is one

- A docstring begins with none of `FIRST_WORDS`, in the packages and in `OTHER_FOLDERS`.
- A public function or method with arguments documents them in `Args:`. Exempt are commands, whose
  options have their own help and whose docstrings give an `Example:`, and docstrings that begin
  with "See `", which name the place of the documentation.
- A public module constant has a docstring, but in `UNDOCUMENTED`.
- Directly in `python/gslts` lie at most `MAX_MODULES` modules; `gslts.__all__` has at most
  `MAX_NAMES` names.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("python/gslts", "python/gslts_sim", "python/gslts_bench")
OTHER_FOLDERS = ("tests", "benchmarks", "examples", "docs", "scripts")
FIRST_WORDS = {"What", "How", "Whether", "Of", "One", "That", "Where"}
MAX_MODULES, MAX_NAMES = 3, 30
UNDOCUMENTED = ("python/gslts_sim/procedural/", "python/gslts/_core/")
"""Folders whose constants are numbers of made-up furniture, or generated."""

Function = ast.FunctionDef | ast.AsyncFunctionDef
Documented = ast.Module | ast.ClassDef | Function


def first_words(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield docstrings that begin with one of `FIRST_WORDS`."""
    for node in ast.walk(tree):
        if isinstance(node, Documented) and (doc := ast.get_docstring(node)):
            word = doc.split(maxsplit=1)[0].rstrip(",.:")
            if word in FIRST_WORDS:
                yield getattr(node, "lineno", 1), f"docstring begins with {word!r}"


def missing_args(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield public functions and methods with arguments but without `Args:`."""
    scopes: list[ast.Module | ast.ClassDef] = [tree]
    while scopes:
        for node in scopes.pop().body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                scopes.append(node)
            if not isinstance(node, Function) or node.name.startswith("_"):
                continue
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            names = {argument.arg for argument in arguments} - {"self", "cls"}
            doc = ast.get_docstring(node) or ""
            is_documented = "Args:" in doc or "Example:" in doc or doc.startswith("See `")
            if names and not is_documented:
                yield node.lineno, f"{node.name}: no Args in its docstring"


def undocumented_constants(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield module constants without a docstring below; those of one block share the last one."""
    body = tree.body
    for index, node in enumerate(body):
        name = _constant_name(node)
        if name is None:
            continue
        rest = body[index + 1 :]
        line = node.end_lineno or node.lineno
        for after in rest:
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                break
            if _constant_name(after) is None or after.lineno > line + 1:
                yield node.lineno, f"{name}: no docstring"
                break
            line = after.end_lineno or after.lineno
        else:
            yield node.lineno, f"{name}: no docstring"


def layout() -> Iterator[tuple[str, int, str]]:
    """Yield findings about the facade of the product package."""
    package = Path("python/gslts")
    modules = [path.name for path in package.glob("*.py") if path.name != "__init__.py"]
    if len(modules) > MAX_MODULES:
        yield str(package), 1, f"{len(modules)} modules, at most {MAX_MODULES}: {modules}"
    facade = package / "__init__.py"
    for node in ast.parse(facade.read_text()).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            names = ast.literal_eval(node.value)
            if len(names) > MAX_NAMES:
                yield str(facade), node.lineno, f"{len(names)} names, at most {MAX_NAMES}"


def _constant_name(node: ast.stmt) -> str | None:
    """Return the name that a statement assigns if it is a public constant, in upper case."""
    target: ast.expr | None = None
    if isinstance(node, ast.Assign):
        target = node.targets[0]
    elif isinstance(node, ast.AnnAssign):
        target = node.target
    if isinstance(target, ast.Tuple):
        target = target.elts[0]
    if isinstance(target, ast.Name) and target.id.isupper() and not target.id.startswith("_"):
        return target.id
    return None


def findings() -> Iterator[tuple[str, int, str]]:
    """Yield path, line and text of all findings."""
    for package in PACKAGES:
        for path in sorted(Path(package).rglob("*.py")):
            tree = ast.parse(path.read_text())
            checks = [first_words, missing_args]
            if not str(path).startswith(UNDOCUMENTED):
                checks.append(undocumented_constants)
            for check in checks:
                yield from ((str(path), line, text) for line, text in check(tree))
    for folder in OTHER_FOLDERS:
        for path in sorted(Path(folder).rglob("*.py")):
            tree = ast.parse(path.read_text())
            yield from ((str(path), line, text) for line, text in first_words(tree))
    yield from layout()


def main() -> None:
    """Print all findings."""
    found = list(findings())
    for path, line, text in found:
        print(f"{path}:{line}: {text}")
    if found:
        sys.exit(f"{len(found)} findings")


if __name__ == "__main__":
    main()
