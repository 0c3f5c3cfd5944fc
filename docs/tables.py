"""`python docs/tables.py` writes the reader's own tables into docs/nc.md, between the lines that say so."""

from __future__ import annotations

from pathlib import Path

from toolpath_stiff.nc.codes.registry import codes_table
from toolpath_stiff.nc.cutter_location.vocabulary import words_table

PAGE = Path(__file__).with_name("nc.md")
TABLES = {"codes": codes_table, "words": words_table}


def with_tables(text: str) -> str:
    """The text of a page with each table made again."""
    for name, table in TABLES.items():
        begin, end = f"<!-- {name}: made by python docs/tables.py -->", f"<!-- end of {name} -->"
        before, rest = text.split(begin, maxsplit=1)
        after = rest.split(end, maxsplit=1)[1]
        text = f"{before}{begin}\n\n{table().strip()}\n\n{end}{after}"
    return text


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text("utf-8")), encoding="utf-8")
