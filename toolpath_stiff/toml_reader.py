"""TOML files, checked: every error names file, line and key, what was found and what was expected.

A reader of our own, because validators of types (msgspec, cattrs) know no lines, state types instead of what a key
means ("6 rows of 3 numbers in mm"), and stop at what a type can say: a bound, a unit, a key that excludes another.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeGuard

from toolpath_stiff.errors import InputError

LARGEST_BYTES = 4_000_000
LARGEST_INTEGER = 2**63 - 1  # TOML 1.0: "64-bit signed integers"
HEADING = re.compile(r"""[ \t]*\[\[?([\w.'" \t-]+)\]""")
NTH = re.compile(r"(.*)\[(\d+)\]")


class TomlReader:
    """The tables of one file, and its lines, so that messages can name them.

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
        self.file, self.lines, self.kind = file, text.splitlines(), kind
        if len(text) > LARGEST_BYTES:
            raise kind(f"more than {LARGEST_BYTES / 1e6:.0f} MB", hint="is it the right file?", file=file)
        try:
            self.data: dict[str, Any] = tomllib.loads(text)
        except (ValueError, RecursionError) as error:  # or thousands of digits, or of brackets
            place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
            line, column = (int(place[1]), int(place[2])) if place else (len(self.lines), None)  # at its end
            reason = str(error).split(" (at ")[0]
            fault = f"{what} is not TOML: {reason}" if what else f"not valid TOML: {reason}"
            raise kind(fault, file=file, line=line, column=column) from None
        self._check_values()

    def _check_values(self) -> None:
        """Refuse integers that TOML does not know: numbers that are none of Python's floats."""
        values: list[object] = [self.data]
        for value in values:  # what a table or an array holds comes after it
            if isinstance(value, dict | list):
                values += value.values() if isinstance(value, dict) else value
            elif isinstance(value, int) and abs(value) > LARGEST_INTEGER:
                raise self.kind("an integer beyond 64 bits", expected="a smaller number", file=self.file)

    @classmethod
    def read(cls, path: str | Path, what: str, kind: type[InputError] = InputError) -> TomlReader:
        """Read a file, as the constructor. Raises `kind` if it cannot be read or is not TOML."""
        try:
            with Path(path).open("rb") as stream:
                text = stream.read(LARGEST_BYTES + 1).decode("utf-8-sig")  # one more than the constructor takes
        except OSError as error:
            raise kind(f"cannot read {what} {str(path)!r}: {error.strerror}") from None
        except UnicodeDecodeError:
            raise kind(f"{what} is not a text file", file=str(path)) from None
        return cls(text, str(path), what, kind)

    def line_of(self, section: str, key: str = "", nth: int = 0) -> int | None:
        """Line of a key of a section (the nth of its name), or of its heading; None if it is not found."""
        inside, seen = section == "", -1
        for number, line in enumerate(self.lines, 1):
            heading = self._heading(line)
            if heading:
                seen += heading == section
                inside = heading == section and seen == nth
                if inside and not key:
                    return number
            elif inside and key and re.match(rf"\s*(?:[\"']?{re.escape(key)}[\"']?\s*=|{re.escape(key)}\s*\.)", line):
                return number
        return None

    def line_at(self, where: str) -> int | None:
        """Line of a dotted name such as `kinematics.head.letter` or `tools[2].number`; else of what it stands in."""
        while where:
            line = self._line_exactly(where)
            if line is not None:
                return line
            where = where.rpartition(".")[0]
        return None

    def _line_exactly(self, where: str) -> int | None:
        """The same of the name itself; a key in quotes may hold dots."""
        parts = where.split(".")
        for count in range(len(parts) - 1, -1, -1):
            section, key = ".".join(parts[:count]), ".".join(parts[count:])
            nth = NTH.fullmatch(section)
            line = self.line_of(nth[1], key, int(nth[2]) - 1) if nth else self.line_of(section, key)
            if line is not None:
                return line
        nth = NTH.fullmatch(where)
        line = self.line_of(nth[1], "", int(nth[2]) - 1) if nth else self.line_of(where)
        return line or next(
            (n for n, text in enumerate(self.lines, 1) if self._heading(text).startswith(f"{where}.")), None
        )

    def _heading(self, line: str) -> str:
        """The table that a line is the heading of, without blanks and quotes; "" if it is none."""
        heading = HEADING.match(line)
        name = re.sub(r"[ \t'\"]", "", heading[1]) if heading else ""
        return name if name.partition(".")[0] in self.data else ""  # else a row of an array, as [-25.4]

    def error(self, mistake: str, expected: str = "", hint: str = "", where: str = "") -> InputError:
        """An error at the line of the dotted name `where`."""
        return self.kind(mistake, expected=expected, hint=hint, file=self.file, line=self.line_at(where))

    def only(self, where: str, table: Mapping[str, Any], known: Iterable[str], of: str = "") -> None:
        """Refuse a key of a table that is not known; `of` ends the sentence."""
        known = list(known)
        for key in table:
            if key not in known:
                name = f"{where}.{key}" if where else repr(key)
                raise self.error(f"{name} is not known{of}", ", ".join(known), where=f"{where}.{key}".lstrip("."))

    def needed(self, where: str, table: Mapping[str, Any], key: str, expected: str) -> Any:
        """The value of a key that must be there."""
        if key not in table:
            raise self.error(f"{where}.{key} is missing", expected, where=where)
        return table[key]

    def number(self, where: str, value: object, largest: float) -> float:
        """A number within +-`largest`."""
        if not is_number(value) or not abs(value) <= largest:
            raise self.error(f"{where} = {value!r}", f"a number within +-{largest:g}", where=where)
        return float(value)

    def flag(self, where: str, value: object) -> bool:
        """True or false."""
        if not isinstance(value, bool):
            raise self.error(f"{where} = {value!r}", "true or false", where=where)
        return value

    def choice(self, where: str, value: object, choices: Iterable[str], expected: str) -> str:
        """One of some texts."""
        if not isinstance(value, str) or value not in choices:
            raise self.error(f"{where} = {value!r}", expected, where=where)
        return value

    def table(self, where: str, value: object, expected: str) -> dict[str, Any]:
        """A table."""
        if not isinstance(value, dict):
            raise self.error(f"{where} = {value!r}", expected, where=where)
        return value


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether a value is a TOML number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_text(value: object) -> TypeGuard[str]:
    """Whether a value is a text that is not empty."""
    return isinstance(value, str) and bool(value.strip())


def shortened(value: object) -> str:
    """A value as it stands, cut for a message."""
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
