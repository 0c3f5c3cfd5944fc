"""`python -m toolpath_stiff.nc.codes.document [PAGE ...]`: the table of codes as Markdown, or into the pages named.

A page holds it between the two lines `BEGIN` and `END`.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from toolpath_stiff.files import write_atomically
from toolpath_stiff.nc.codes.contract import EVERYWHERE, Code, holds_anyway
from toolpath_stiff.nc.codes.registry import ALIASES, CODES, REFUSED

BEGIN = "<!-- codes: made by python -m toolpath_stiff.nc.codes.document docs/nc.md -->"
END = "<!-- end of codes -->"


def codes_table() -> str:
    """The codes that are understood, their other names, and those that are refused, as Markdown tables."""
    understood = [
        (code.name, code.group, _meaning(code), _function(code), _controls(code.controls), code.source)
        for code in CODES.values()
    ]
    others = [(a.name, f"as {a.code}", a.meaning, "", _controls(a.controls), a.source) for a in ALIASES.values()]
    refused = [(code.name, code.what, code.hint, code.source) for code in REFUSED.values()]
    return "\n".join(
        [
            *_rows(("code", "group", "meaning", "function in `nc/codes`", "dialects", "source"), understood + others),
            "",
            "Refused, with the line and what to do instead:",
            "",
            *_rows(("code", "what it is", "instead", "source"), refused),
            "",
        ]
    )


def _meaning(code: Code) -> str:
    return f"{code.meaning} (listed: {code.listed})" if code.listed else code.meaning


def _function(code: Code) -> str:
    if code.act is holds_anyway:
        return ""
    module = inspect.getmodule(code.act)
    assert module is not None
    return f"`{module.__name__.rsplit('.', maxsplit=1)[-1]}.{code.act.__name__}`"


def _controls(names: tuple[str, ...]) -> str:
    return "all" if names == EVERYWHERE else ", ".join(names)


def _rows(heading: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Lines of a table; successive rows that differ in their code alone are one."""
    yield f"| {' | '.join(heading)} |"
    yield f"|{' --- |' * len(heading)}"
    joined: dict[tuple[str, ...], list[str]] = {}
    for name, *cells in rows:
        joined.setdefault(tuple(cells), []).append(name)
    for cells_, names in joined.items():
        yield f"| {' '.join(names)} | {' | '.join(cells_)} |"


def main(pages: list[str]) -> int:
    """Print the table, or write it into pages."""
    if not pages:
        print(codes_table())
    for page in map(Path, pages):
        text = page.read_text(encoding="utf-8")
        before, rest = text.split(BEGIN, maxsplit=1)
        after = rest.split(END, maxsplit=1)[1]
        write_atomically(page, f"{before}{BEGIN}\n\n{codes_table()}\n{END}{after}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
