"""Configuration of the documentation site, and the parts of it that the code generates.

    make docs        # build/site/docs/index.html

The source folder is the repository: README, change log, results of benchmarks and guides link to
each other by the same relative paths here, on the site and on the pages of a host.
"""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import gslts
import gslts.types

ROOT = Path(__file__).parent.parent

project = "gslts"
release = gslts.__version__
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
html_theme_options = {"light_css_variables": {"--code-font-size": "75%"}}  # 98 columns.
html_title = f"gslts {release}"
html_extra_path = ["redirect"]
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False

myst_heading_anchors = 4  # As GitHub makes them: `#a-foreign-home`.

os.environ["SPHINX_APIDOC_OPTIONS"] = "members"  # The setting is not read for packages.
apidoc_modules = [
    {
        "path": "../python/gslts",
        "destination": "docs/api",
        "exclude_patterns": [
            f"../python/gslts/{name}*" for name in ("_core", "cli", "ros", "__main")
        ],
        "module_first": True,
    }
]
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_type_aliases = {name: name for name in vars(gslts.types) if name[0] != "_"}
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
)
"""Models of settings in `gslts`, in the order of the data flow."""
ATTRIBUTE = r"^    (\w[\w, ]*): (.+(?:\n     .+)*)"
"""Names and meaning of attributes in the docstring of a model."""


def commands() -> str:
    """Return usage, arguments and options of each command, from the program itself."""
    from typer.cli import get_docs_for_click
    from typer.main import get_command

    from gslts.cli import app

    command = get_command(app)
    for group in (command, *command.commands.values()):
        for part in getattr(group, "commands", {}).values():
            part.short_help = part.help.partition("\n\n")[0].replace("\n", " ")  # In full.
    text = get_docs_for_click(obj=command, ctx=command.context_class(command), name="gslts")
    text = re.sub(r"^Example: (.*(?:\n.+)*)", r"```sh\n\1\n```", text, flags=re.MULTILINE)
    text = text.replace("```console\n$ ", "```text\n")
    options = r"(```.*?```|`[^`\n]*`)|(--[a-z][a-z-]*)"  # As code, or "--" becomes a dash.
    text = re.sub(options, lambda found: found[1] or f"`{found[2]}`", text, flags=re.DOTALL)
    text = text.replace("* `--help`: Show this message and exit.\n", "")
    text = re.sub(r"\*\*Options\*\*:\s+(?=#|\*\*|\Z)", "", text)
    listed, heading, rest = text[text.index("* `map`") :].partition("\n## ")
    return re.sub(r"\* `(.+)`:", r"* [`\1`](#gslts-\1):", listed) + heading + rest


def settings() -> Iterator[str]:
    """Yield a table of each model of settings: names, defaults, and what its docstring says."""
    for path in SETTINGS:
        module, name = path.rsplit(".", 1)
        model = getattr(import_module(f"gslts.{module}"), name)
        yield f"### {name}\n\nOf `gslts.{module}`.\n"
        yield "| setting | default | |\n|---|---|---|"
        text, values = inspect.cleandoc(model.__doc__), model()
        for names, meaning in re.findall(ATTRIBUTE, text, re.MULTILINE):
            for setting in filter(partial(hasattr, values), names.split(", ")):
                default = _plain(getattr(values, setting))
                yield f"| `{setting}` | {default} | {' '.join(meaning.split())} |"
        yield ""


def _plain(value: object) -> str:
    """Return a default for a table: a number, a text, or the name of a model."""
    is_simple = value is None or isinstance(value, bool | int | float | str | tuple)
    return f"`{value!r}`" if is_simple else f"`{type(value).__name__}`"


def headers() -> Iterator[str]:
    """Return the public C++ headers, by library."""
    for folder in sorted((ROOT / "cpp").glob("*/include")):
        yield f"## {folder.parent.name}"
        for header in sorted(folder.rglob("*.hpp")):
            yield f"### {header.relative_to(folder)}"
            yield f"```{{literalinclude}} /{header.relative_to(ROOT)}\n:language: cpp\n```"


GENERATED = {
    "docs/commands": commands,
    "docs/settings": lambda: "\n".join(settings()),
    "docs/headers": lambda: "\n\n".join(headers()),
}
"""By page: what is appended to its text. These pages are read anew in each build."""


def write_page(_: Any, page: str, source: list[str]) -> None:
    """Append what is generated to the text of a page, and link the names that `gslts` exports.

    Args:
        page: Path of the page, without suffix.
        source: Its text, replaced.
    """
    if page.startswith("docs/") and not page.startswith("docs/api/"):
        names = "|".join(gslts.__all__)
        source[0] = re.sub(rf"`(gslts\.)?({names})`", r"{py:obj}`\1\2 <gslts.\2>`", source[0])
    if page in GENERATED:
        source[0] += "\n" + GENERATED[page]()


def skip_twice(app: Any, _: str, name: str, value: Any, *__: Any) -> bool | None:
    """Leave a compiled class that `gslts` exports to the page of `gslts`: it has no other module.

    Args:
        app: Sphinx.
        name: Of the class.
        value: The class.
    """
    is_elsewhere = app.env.docname != "docs/api/gslts" and name in gslts.__all__
    is_compiled = str(getattr(value, "__module__", "")).startswith("gslts._core.")
    return True if is_elsewhere and is_compiled else None


def swap_colons(old: str, new: str, _: Any, kind: str, *rest: Any) -> None:
    """Replace colons in docstrings of constants, which Napoleon takes for `type: description`.

    Args:
        old: Text to replace.
        new: Its replacement.
        kind: Kind of what is documented.
        rest: Ends with the lines of the docstring, changed in place.
    """
    if kind in ("data", "attribute", "property"):
        rest[-1][:] = [line.replace(old, new) for line in rest[-1]]


def shorten_signature(_: Any, kind: str, __: str, value: Any, *___: Any) -> Any:
    """Leave out the signature of a model of settings: its attributes follow.

    Args:
        kind: Kind of what is documented.
        value: The class.
    """
    return ("", None) if kind == "class" and hasattr(value, "model_fields") else None


def setup(app: Any) -> None:
    """Connect the generated parts.

    Args:
        app: Sphinx.
    """
    app.connect("source-read", write_page)
    app.connect("env-get-outdated", lambda *_: list(GENERATED))
    app.connect("autodoc-skip-member", skip_twice)
    for priority, old, new in ((400, ":", "\0"), (600, "\0", ":")):  # Before and after Napoleon.
        swap = partial(swap_colons, old, new)
        app.connect("autodoc-process-docstring", swap, priority=priority)
    app.connect("autodoc-process-signature", shorten_signature)
