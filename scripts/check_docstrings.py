"""Checks docstrings, constants and the layout: what ruff's rules do not cover.

    python scripts/check_docstrings.py          # lists each finding; exit status 1 if there is one
    python scripts/check_docstrings.py --counts # prints the numbers of the layout and docstrings

- A docstring begins with none of `FIRST_WORDS`, in the packages and in `OTHER_FOLDERS`.
- A public function or method with arguments documents them in `Args:`. Exempt are commands, whose
  options have their own help and whose docstrings give an `Example:`, and docstrings that begin
  with "See `", which name the place of the documentation.
- A public module constant has a docstring, but in `UNDOCUMENTED`.
- Nothing is named `one`: a name says what the value is, such as `frame`.
- Directly in `python/gslts` lie at most `MAX_MODULES` modules; `gslts.__all__` has at most
  `MAX_NAMES` names; a file has at most `MAX_LINES` lines.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

PRODUCT = Path("python/gslts")
PACKAGES = ("python/gslts", "python/gslts_sim", "python/gslts_bench")
OTHER_FOLDERS = ("tests", "benchmarks", "examples", "docs", "scripts")
FIRST_WORDS = {"What", "How", "Whether", "Of", "One", "That", "Where"}
MAX_MODULES, MAX_NAMES, MAX_LINES = 3, 30, 400
UNDOCUMENTED = ("python/gslts_sim/procedural/", "python/gslts/_core/")
"""Folders whose constants are numbers of made-up furniture, or generated."""

Function = ast.FunctionDef | ast.AsyncFunctionDef
Documented = ast.Module | ast.ClassDef | Function
Check = Callable[[ast.Module], Iterator[tuple[int, str]]]


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


def vague_names(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield what is named `one`: variables, arguments and functions."""
    for node in ast.walk(tree):
        is_variable = isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        if (
            (is_variable and node.id == "one")
            or (isinstance(node, ast.arg) and node.arg == "one")
            or (isinstance(node, Function) and node.name == "one")
        ):
            yield node.lineno, "`one`: name what it is"


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
    """Yield findings about the facade of the product package, and files that are too long."""
    modules, names = _modules(), _facade()
    if len(modules) > MAX_MODULES:
        yield str(PRODUCT), 1, f"{len(modules)} modules, at most {MAX_MODULES}: {modules}"
    if len(names) > MAX_NAMES:
        yield str(PRODUCT / "__init__.py"), 1, f"{len(names)} names, at most {MAX_NAMES}"
    for path in _files(*PACKAGES, *OTHER_FOLDERS):
        lines = len(path.read_text().splitlines())
        if lines > MAX_LINES:
            yield str(path), lines, f"{lines} lines, at most {MAX_LINES}"


def print_counts() -> None:
    """Print the numbers by which docstrings, constants and the layout are judged."""
    trees = {path: ast.parse(path.read_text()) for path in _files(*PACKAGES, *OTHER_FOLDERS)}
    packages = [tree for path, tree in trees.items() if str(path).startswith(PACKAGES)]
    constants = {
        path: list(_constants(tree))
        for path, tree in trees.items()
        if str(path).startswith(PACKAGES) and not str(path).startswith(UNDOCUMENTED)
    }
    of_product = [names for path, names in constants.items() if path.is_relative_to(PRODUCT)]
    product = [path for path in trees if path.is_relative_to(PRODUCT)]
    undocumented = sum(len(list(undocumented_constants(trees[path]))) for path in constants)
    for count, text in (
        (_total(first_words, trees.values()), f"docstrings begin with {sorted(FIRST_WORDS)}"),
        (_total(vague_names, trees.values()), "variables, arguments and functions are named `one`"),
        (_total(missing_args, packages), "public functions with arguments lack `Args`"),
        (sum(map(len, constants.values())), f"module constants, outside of {UNDOCUMENTED}"),
        (sum(map(len, of_product)), f"- of them in {PRODUCT}"),
        (undocumented, "- statements without a docstring"),
        (len(_modules()), f"modules directly in {PRODUCT}"),
        (len(_facade()), "names in gslts.__all__"),
        (sum(len(path.read_text().splitlines()) for path in product), f"lines of {PRODUCT}"),
    ):
        print(f"{count:6} {text}")


def _total(check: Check, trees: Iterable[ast.Module]) -> int:
    return sum(len(list(check(tree))) for tree in trees)


def _files(*folders: str) -> list[Path]:
    return [path for folder in folders for path in sorted(Path(folder).rglob("*.py"))]


def _modules() -> list[str]:
    """Return the modules directly in the product package."""
    return [path.name for path in PRODUCT.glob("*.py") if path.name != "__init__.py"]


def _facade() -> list[str]:
    """Return `gslts.__all__`."""
    for node in ast.parse((PRODUCT / "__init__.py").read_text()).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return list(ast.literal_eval(node.value))
    return []


def _constants(tree: ast.Module) -> Iterator[str]:
    """Yield the names of all module constants, private ones too."""
    for node in tree.body:
        for target in _targets(node):
            for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                if isinstance(name, ast.Name) and name.id.isupper():
                    yield name.id


def _targets(node: ast.stmt) -> list[ast.expr]:
    if isinstance(node, ast.Assign):
        return node.targets
    return [node.target] if isinstance(node, ast.AnnAssign) else []


def _constant_name(node: ast.stmt) -> str | None:
    """Return the name that a statement assigns if it is a public constant, in upper case."""
    targets = _targets(node)
    target = targets[0] if targets else None
    if isinstance(target, ast.Tuple):
        target = target.elts[0]
    if isinstance(target, ast.Name) and target.id.isupper() and not target.id.startswith("_"):
        return target.id
    return None


def findings() -> Iterator[tuple[str, int, str]]:
    """Yield path, line and text of all findings."""
    for path in _files(*PACKAGES, *OTHER_FOLDERS):
        tree = ast.parse(path.read_text())
        checks: list[Check] = [first_words, vague_names]
        if str(path).startswith(PACKAGES):
            checks.append(missing_args)
            if not str(path).startswith(UNDOCUMENTED):
                checks.append(undocumented_constants)
        for check in checks:
            yield from ((str(path), line, text) for line, text in check(tree))
    yield from layout()


def main() -> None:
    """Print all findings, or the counts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--counts", action="store_true", help="print numbers, check nothing")
    if parser.parse_args().counts:
        print_counts()
        return
    found = list(findings())
    for path, line, text in found:
        print(f"{path}:{line}: {text}")
    if found:
        sys.exit(f"{len(found)} findings")


if __name__ == "__main__":
    main()
