"""Configuration of the documentation site, and the parts of it that the code generates.

    make docs        # build/site/docs/index.html

The source folder is the repository: README, change log, results of benchmarks and guides link to
each other by the same relative paths here, on the site and on the pages of a host.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gslts

ROOT = Path(__file__).parent.parent

project = "gslts"
release = re.findall(r"project\(gslts VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())[0]
root_doc = "docs/index"
include_patterns = ["*.md", "benchmarks/**.md", "docs/**", "ros/**.md"]
exclude_patterns = ["docs/api/modules.rst"]
exclude_patterns += [".*", "build", "cpp", "demo", "dist", "out", "python", "tests"]
extensions = ["myst_parser", "sphinx.ext.apidoc", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
suppress_warnings = [
    "myst.header",  # Headings of generated tables, of which a level may be left out.
    "ref.python",  # Types of one name, such as Box, in two packages.
]

html_theme = "furo"
html_title = f"gslts {release}"
html_extra_path = ["redirect"]
html_copy_source = False
html_show_copyright = False

myst_heading_anchors = 4  # As GitHub makes them: `#a-foreign-home`.

apidoc_modules = [
    {
        "path": "../python/gslts",
        "destination": "docs/api",
        "exclude_patterns": [f"../python/gslts/{name}*" for name in ("_core", "cli", "ros", "__main")],
        "automodule_options": {"members"},
        "module_first": True,
    }
]
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
default_role = "code"  # Docstrings have `names` between single quotes, as Markdown has.
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_maximum_signature_line_length = 88
add_module_names = False
toc_object_entries = False  # Or each page would carry the names of all.

SETTINGS = (
    "mapping.config.MappingConfig",
    "change.config.DetectionConfig",
    "localization.config.RelocalizationConfig",
    "update.config.UpdateConfig",
    "update.config.CollectConfig",
    "update.config.EditConfig",
    "update.config.RefineConfig",
    "keeper.config.KeeperConfig",
    "ros.config.NodeConfig",
    "ros.config.Topics",
)
"""Models of settings in `gslts`, in the order of the data flow."""


def commands() -> str:
    """Return usage, arguments and options of each command, from the program itself."""
    from typer.cli import get_docs_for_click
    from typer.main import get_command

    from gslts.cli import app

    command = get_command(app)
    text = get_docs_for_click(obj=command, ctx=command.context_class(command), name="gslts")
    text = re.sub(r"^Example: (.*(?:\n.+)*)", r"```sh\n\1\n```", text, flags=re.MULTILINE)
    text = text.replace("```console\n$ ", "```text\n")
    return text


def settings() -> str:
    """Return the documentation of all models of settings, with types and defaults."""
    return "\n".join(f"```{{eval-rst}}\n.. autoclass:: gslts.{name}\n   :no-index:\n```" for name in SETTINGS)


def headers() -> Iterator[str]:
    """Return the public C++ headers, by library."""
    for folder in sorted((ROOT / "cpp").glob("*/include")):
        yield f"## {folder.parent.name}"
        for header in sorted(folder.rglob("*.hpp")):
            yield f"### {header.relative_to(folder)}"
            yield f"```{{literalinclude}} /{header.relative_to(ROOT)}\n:language: cpp\n```"


GENERATED = {
    "docs/commands": commands,
    "docs/settings": settings,
    "docs/headers": lambda: "\n\n".join(headers()),
}
"""By page: what is appended to its text. These pages are read anew in each build."""


def append_generated(app: Any, page: str, source: list[str]) -> None:
    """Append what is generated to the text of a page.

    Args:
        app: Unused.
        page: Path of the page, without suffix.
        source: Its text, replaced.
    """
    if page in GENERATED:
        source[0] += "\n" + GENERATED[page]()


def skip_twice(app: Any, kind: str, name: str, value: Any, skip: bool, options: Any) -> bool | None:
    """Leave a compiled class that `gslts` exports to the page of `gslts`: it has no other module.

    Args:
        app: Sphinx.
        kind, skip, options: Unused.
        name: Of the class.
        value: The class.
    """
    is_compiled = str(getattr(value, "__module__", "")).startswith("gslts._core.")
    return True if is_compiled and app.env.docname != "docs/api/gslts" and name in gslts.__all__ else None


def setup(app: Any) -> None:
    """Connect the generated parts.

    Args:
        app: Sphinx.
    """
    app.connect("source-read", append_generated)
    app.connect("env-get-outdated", lambda *_: list(GENERATED))
    app.connect("autodoc-skip-member", skip_twice)
