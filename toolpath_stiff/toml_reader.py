"""TOML files, checked: every error names file, line and key, what was found and what was expected.

A reader of our own, because validators of types (msgspec, cattrs) know no lines, state types instead of what a key
means ("6 rows of 3 numbers in mm"), and stop at what a type can say: a bound, a unit, a key that excludes another.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Self, TypeGuard

from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_utf8

LARGEST_BYTES = 4_000_000
HEADING = re.compile(r"""[ \t]*\[(\[?)([\w.'" \t-]+)\]""")
QUOTES = re.compile("['\"\t]")
KEY = re.compile(r"""([\w.'" \t-]+)=""")


class TomlReader:
    """Tables of one file, with the line of each key, so that messages can give it.

    Attributes
    ----------
    data
        What the file holds.
    file
        Its name, for messages.
    """

    def __init__(self, text: str, file: str, what: str = "", kind: type[InputError] = InputError) -> None:
        """`what` names the file in messages, `kind` is the class of its errors.

        Raises `kind` with line and column if the text is not TOML.
        """
        self.file, self.kind, lines = file, kind, text.splitlines()
        if len(text) > LARGEST_BYTES:
            raise kind(f"more than {LARGEST_BYTES / 1e6:.0f} MB", hint="is it the right file?", file=file)
        try:
            self.data: dict[str, Any] = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # also from thousands of digits or nested brackets
            place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
            line, column = (int(place[1]), int(place[2])) if place else (len(lines), None)  # at its end
            reason = str(error).split(" (at ")[0]
            fault = f"{what} is not TOML: {reason}" if what else f"not valid TOML: {reason}"
            raise kind(fault, file=file, line=line, column=column) from None
        self._places = _places(lines, self.data)

    @classmethod
    def read(cls, path: str | Path, what: str, kind: type[InputError] = InputError) -> Self:
        """Read a file, as the constructor. Raises `InputError` if it cannot be read, `kind` if it is not TOML."""
        return cls(read_utf8(path, what, LARGEST_BYTES), str(path), what, kind)

    def line_of(self, section: str, key: str = "", nth: int = 0) -> int | None:
        """Line of a key in a section (the nth of that name), or of the section's heading; None if not found."""
        numbered = f"{section}[{nth + 1}]"
        return self._places.get(f"{numbered if numbered in self._places else section}.{key}".strip("."))

    def line_at(self, where: str) -> int | None:
        """Line of a dotted name such as `kinematics.head.letter` or `tools[2].number`, or of what contains it."""
        while where and where not in self._places:
            where = where.rpartition(".")[0]
        return self._places.get(where)

    def error(self, mistake: str, expected: str = "", hint: str = "", where: str = "") -> InputError:
        """Error located at the line of the dotted name `where`."""
        return self.kind(mistake, expected=expected, hint=hint, file=self.file, line=self.line_at(where))

    def only(self, where: str, table: Document, known: Iterable[str], of: str = "") -> None:
        """Refuse keys of a table that are not known; `of` ends the sentence."""
        known = list(known)
        for key in table:
            if key not in known:
                name = f"{where}.{key}" if where else repr(key)
                raise self.error(f"{name} is not known{of}", ", ".join(known), where=f"{where}.{key}".lstrip("."))

    def needed(self, where: str, table: Document, key: str, expected: str) -> Any:
        """Value of a required key."""
        if key not in table:
            raise self.error(f"{where}.{key} is missing", expected, where=where)
        return table[key]

    def number(self, where: str, value: object, largest: float) -> float:
        """A number within +-`largest`."""
        if not is_number(value) or not abs(value) <= largest:
            raise self.error(f"{where} = {value!r}", f"a number within +-{largest:g}", where=where)
        return float(value)

    def flag(self, where: str, value: object) -> bool:
        """True or false, checked."""
        if not isinstance(value, bool):
            raise self.error(f"{where} = {value!r}", "true or false", where=where)
        return value

    def choice(self, where: str, value: object, choices: Iterable[str], expected: str) -> str:
        """A text that must be one of `choices`."""
        if not isinstance(value, str) or value not in choices:
            raise self.error(f"{where} = {value!r}", expected, where=where)
        return value

    def table(self, where: str, value: object, expected: str) -> Document:
        """A table, checked."""
        if not isinstance(value, dict):
            raise self.error(f"{where} = {value!r}", expected, where=where)
        return value


def _places(lines: Sequence[str], data: Document) -> dict[str, int]:
    """Line of the first mention of each dotted name: keys, tables, their parents; `tools[2]` is in a list of tables."""
    places: dict[str, int] = {}
    above: dict[str, int] = {}
    counts: Counter[str] = Counter()
    section = ""
    for number, line in enumerate(lines, 1):
        heading, key = HEADING.match(line), KEY.match(line)
        name = QUOTES.sub("", heading[2]).replace(" ", "") if heading else ""
        if heading and name.partition(".")[0] in data:  # else a row of an array, as [-25.4]
            counts[name] += 1
            section = f"{name}[{counts[name]}]" if heading[1] else name
            places.setdefault(section, number)
        elif key:
            name = f"{section}.{QUOTES.sub('', key[1]).strip()}".strip(".")
        places.setdefault(name, number)
        while name := name.rpartition(".")[0]:
            above.setdefault(name, number)
    return above | places


def is_number(value: object) -> TypeGuard[int | float]:
    """True if a value is a TOML number; true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_text(value: object) -> TypeGuard[str]:
    """True if a value is a non-empty text."""
    return isinstance(value, str) and bool(value.strip())


def shortened(value: object) -> str:
    """A value as text, cut short for a message."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
