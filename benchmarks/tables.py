"""Writes the tables of benchmarks/results/*.json into the Markdown files beside them.

The tables of NAME.json, with commit, date, machine and command, replace what is between the lines
`<!-- tables: NAME -->` and `<!-- end -->`. Command line: `python benchmarks/tables.py [--check]`.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

from gslts_bench.tables import result_markdown

RESULTS = Path(__file__).parent / "results"
MARKED = re.compile(r"<!-- tables: (?P<name>[\w-]+) -->\n.*?<!-- end -->", re.DOTALL)


def fill(text: str, folder: Path) -> str:
    """Replace the marked parts of a text by the tables of JSON results.

    Args:
        text: Markdown with marks.
        folder: Folder of the JSON files.

    Returns:
        The text with current tables.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is no result.
    """

    def replace(match: re.Match[str]) -> str:
        path = folder / f"{match['name']}.json"
        try:
            tables = result_markdown(json.loads(path.read_bytes()))
        except (KeyError, TypeError, json.JSONDecodeError) as error:
            raise ValueError(f"{path}: this is no result of a benchmark: {error!r}") from None
        return f"<!-- tables: {match['name']} -->\n\n{tables}\n\n<!-- end -->"

    return MARKED.sub(replace, text)


def main() -> None:
    """Update all Markdown files, or check that they are up to date."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="fail if a file is out of date")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of the files")
    args = parser.parse_args()
    texts = {path: path.read_text() for path in sorted(args.results.glob("*.md"))}
    stale = {path: new for path, old in texts.items() if (new := fill(old, args.results)) != old}
    used = {match["name"] for text in texts.values() for match in MARKED.finditer(text)}
    unused = [path for path in sorted(args.results.glob("*.json")) if path.stem not in used]
    for path in unused:
        print(f"{path}: no Markdown file has `<!-- tables: {path.stem} -->`", file=sys.stderr)
    for path, text in stale.items():
        if args.check:
            print(f"{path}: out of date; run python benchmarks/tables.py", file=sys.stderr)
        else:
            path.write_text(text)
            print(f"wrote {path}")
    sys.exit(bool(unused or (args.check and stale)))


if __name__ == "__main__":
    main()
