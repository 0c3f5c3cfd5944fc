"""What `rs274` is never given: programs that run other programs.

LinuxCNC executes Python in comments (`;py,...`, `(py,...)`, `(pyrun,...)`), user M codes (M100 to M199) as executables,
and subprograms of other files. Such a program is refused here, before anything is started. The copy that rs274 reads
has no comments at all, so the first would not run even if it passed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.linuxcnc.copy import NAMED, Line

# `py,`, `pyrun`, `pyreload`, and `py` alone or before anything but a letter or digit, whatever blanks are in between;
# a comment within a comment counts, though LinuxCNC does not look there.
PYTHON = re.compile(r"[\s(;]*p\s*y(?:\s*(?:[^\w\s]|$|r\s*u\s*n|r\s*e\s*l\s*o\s*a\s*d)|\s)", re.IGNORECASE)
# Of all functions, operators and O words only MOD has an M in it.
M_WORD = re.compile(r"M(?!OD)([+-]?[0-9.]+)?", re.ASCII)
SUBPROGRAM = re.compile(r"O(<[^<>]*>|\d+)(SUB|CALL)?")
OPENS_OR_ENDS = re.compile(r"O(<[^<>]*>|\d+)(END)?(SUB|IF|WHILE|REPEAT)")
M98 = re.compile(r"M[+]?0*98(?!\d)")
NUMBER_ONLY = re.compile(r"O(\d+)$")


def check(lines: Iterable[Line], name: str) -> None:
    """Raise `InputError`, with the line, for a program that must not be given to `rs274`."""
    lines = list(lines)
    for line in lines:
        for column, text in line.comments:
            if PYTHON.match(text):
                raise _refused("a comment that runs Python", name, line.number, column)
        if "M" in line.words:
            _check_m_codes(line, name)
    _check_calls(lines, name)


def _refused(found: str, name: str, line: int, column: int | None = None) -> InputError:
    return InputError(
        f"{found}: LinuxCNC's interpreter is not started on such a program",
        expected="a program that runs no other",
        hint="remove it, or read the program with --interpreter builtin",
        file=name,
        line=line,
        column=column,
    )


def _check_m_codes(line: Line, name: str) -> None:
    for match in M_WORD.finditer(NAMED.sub("<>", line.words)):
        digits = match[1]
        if digits is None:
            raise _refused("an M code that is computed, and might be a user's (M100 to M199)", name, line.number)
        try:
            code = float(digits)
        except ValueError:
            raise InputError(f"M{digits} is not an M code", file=name, line=line.number) from None
        # Rounded as LinuxCNC does (interp_read.cc: the nearest integer), and to be safe both neighbours.
        if 99.0 < code < 200.0:
            raise _refused(f"the user M code M{digits} (M100 to M199 run a program)", name, line.number)


def _check_calls(lines: list[Line], name: str) -> None:
    """O words may call only what the program itself defines: LinuxCNC would go and look for a file."""
    calls: list[tuple[str, int]] = []
    defined: set[str] = set()
    for line in lines:
        match = SUBPROGRAM.match(line.words)
        if match and "/" in match[1]:  # it would be looked for there, if what defines it here is left out
            raise _refused("a subprogram whose name is a path", name, line.number)
        if match and match[2] == "SUB":
            defined.add(_key(match[1]))
        elif match and match[2] == "CALL":
            calls.append((_key(match[1]), line.number))
        elif NUMBER_ONLY.match(line.words):
            defined.add(_key(line.words[1:]))
        elif line.words.startswith("O") and "CALL" in NAMED.sub("<>", line.words):
            raise _refused("a call of a subprogram whose name is computed", name, line.number)
        elif M98.search(line.words):
            called = re.search(r"P(\d+)", line.plain)
            if called is None:
                raise _refused("M98 without the number of its subprogram", name, line.number)
            calls.append((_key(called[1]), line.number))
    for key, number in calls:
        if key not in defined:
            raise InputError(
                f"subprogram O{key} is not in the program",
                expected="subprograms in the same file",
                hint="copy it into the program; other files are not read",
                file=name,
                line=number,
            )


def unclosed(lines: Iterable[Line]) -> int | None:
    """The line of the first O word whose end is missing."""
    opened: dict[str, int] = {}
    for line in lines:
        match = OPENS_OR_ENDS.match(line.words)
        if match and match[2]:
            opened.pop(_key(match[1]), None)
        elif match:
            opened.setdefault(_key(match[1]), line.number)
    return min(opened.values(), default=None)


def _key(name: str) -> str:
    return name if name.startswith("<") else str(int(name))
