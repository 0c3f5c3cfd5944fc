"""Lines of a program file: bytes to text, text to lines."""

import codecs
import re
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from toolpath_stiff.errors import ProgramError
from toolpath_stiff.files import check_regular
from toolpath_stiff.nc.place import Place

# Caps. Longer is no NC program, and what reads a line takes time by the square of its length.
LARGEST_FILE = 512 << 20  # bytes: some ten million lines
LONGEST_LINE = 10_000  # characters, comments included
PORTION = 100  # lines
# Control characters that no text file holds. It may hold tab, line feed, form feed, carriage return, and the old
# end-of-file mark of CP/M and DOS (0x1A), which some posts still append.
BINARY = re.compile("[\x00-\x08\x0b\x0e-\x19\x1b-\x1f\x7f]")
_COMMENT = re.compile(r'"[^"]*"|;.*')
_BINARY_BYTES = bytes(code for code in range(128) if BINARY.match(chr(code)))


def read_lines(path: str | Path) -> tuple[str, ...]:
    """Lines of a program file, without line ends; LF, CRLF or CR.

    Raises
    ------
    InputError
        The file cannot be read, is larger than `LARGEST_FILE`, or is not text.
    """
    return split_lines(read_text(path)[0], Path(path).name)


def read_text(path: str | Path) -> tuple[str, str]:
    """Text of a program file with its line ends, and its encoding: UTF-8 (with or without BOM) or Latin-1.

    Raises `InputError` where the file cannot be read or is larger than `LARGEST_FILE`.
    """
    try:
        check_regular(Path(path))  # not even a pipe of the shell: a program is read more than once
        with Path(path).open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise ProgramError(f"cannot read {str(path)!r}: {error.strerror}") from None
    except ValueError as error:  # a NUL in the name
        raise ProgramError(f"cannot read {str(path)!r}: {error}") from None
    if len(content) > LARGEST_FILE:
        problem, expected = "a file that is too large to be read", f"an NC program of at most {LARGEST_FILE >> 20} MB"
        raise ProgramError(problem, expected=expected, hint="split the program", file=Path(path).name)
    encoding = "utf-8-sig" if content.startswith(codecs.BOM_UTF8) else "utf-8"
    try:
        return content.decode(encoding), encoding
    except UnicodeDecodeError:
        return content.decode("latin-1"), "latin-1"


def split_lines(text: str, name: str) -> tuple[str, ...]:
    r"""Split into lines; a byte that no text holds is an error with its line and column.

    Examples
    --------
    >>> split_lines("G0 X1\r\nM30\r\n", "part.nc")
    ('G0 X1', 'M30')
    """
    joined = text.replace("\r\n", "\n").replace("\r", "\n")
    binary = BINARY.search(joined) if _any_binary(joined) else None
    if binary is not None:
        offset = binary.start()
        place = Place(name, joined.count("\n", 0, offset) + 1, offset - joined.rfind("\n", 0, offset))
        raise place.fail(f"binary byte 0x{ord(binary[0]):02X}", "the text of an NC program")
    lines = joined.replace("\x1a", "").replace("\x0c", " ").split("\n")
    if not lines[-1]:
        lines.pop()
    if max(map(len, lines), default=0) > LONGEST_LINE:
        row = next(row for row, line in enumerate(lines) if len(line) > LONGEST_LINE)
        raise Place(name, row + 1).fail(f"a line of {len(lines[row])} characters", f"lines of at most {LONGEST_LINE}")
    return tuple(lines)


def code_text(line: str) -> str:
    """Line without its comment and continuation mark, in upper case; columns are kept."""
    text = _COMMENT.sub(lambda part: part[0] if part[0].startswith('"') else "", line) if ";" in line else line
    return text.rstrip().rstrip("~").rstrip().upper()


class TextLines(Sequence[str]):
    """Lines kept as texts of `PORTION` lines: those of a long program then take a third of the memory.

    Examples
    --------
    >>> lines = TextLines(("G21", "", "M30"))
    >>> len(lines), lines[-1], lines[:2], [*lines]
    (3, 'M30', ['G21', ''], ['G21', '', 'M30'])
    """

    def __init__(self, lines: Sequence[str]) -> None:
        self._count = len(lines)
        self._parts = ["\n".join(lines[first : first + PORTION]) for first in range(0, len(lines), PORTION)]

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: Any) -> Any:
        rows = range(self._count)[index]
        if isinstance(rows, int):
            return self._parts[rows // PORTION].split("\n")[rows % PORTION]
        part = slice(min(rows, default=0) // PORTION, max(rows, default=-1) // PORTION + 1)
        lines, first = "\n".join(self._parts[part]).split("\n"), part.start * PORTION
        return [lines[row - first] for row in rows]

    def __iter__(self) -> Iterator[str]:
        return chain.from_iterable(part.split("\n") for part in self._parts)


def _any_binary(text: str) -> bool:
    """True if a text contains any of `BINARY`; takes a fifth of a search's time, as UTF-8 has the same bytes."""
    content = text.encode("utf-8", "surrogatepass")
    return len(content.translate(None, _BINARY_BYTES)) != len(content)
