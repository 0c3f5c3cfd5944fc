"""Programs that `rs274` is never given, and words that only confuse it.

LinuxCNC executes Python in comments (`;py,...`, `(py,...)`, `(pyrun,...)`), user M codes (M100 to M199) as executables,
and subprograms of other files. A program with these is refused here, before anything is started. The copy that rs274
reads has no comments at all, so the first would not run even if it passed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.linuxcnc.inputs import NAMED, TOKEN, TOKENS, Line
from toolpath_stiff.nc.place import Place

# `py,`, `pyrun`, `pyreload`, and `py` alone or before anything but a letter or digit, whatever blanks are in between;
# a comment within a comment counts, though LinuxCNC does not look there.
PYTHON = re.compile(r"[\s(;]*p\s*y(?:\s*(?:[^\w\s]|$|r\s*u\s*n|r\s*e\s*l\s*o\s*a\s*d)|\s)", re.IGNORECASE)
# Of all functions, operators and O words only MOD has an M in it.
M_WORD = re.compile(r"M(?!OD)([+-]?[0-9.]+)?", re.ASCII)
SUBPROGRAM = re.compile(r"O(<[^<>]*>|\d+)(SUB|CALL)?")
OPENS_OR_ENDS = re.compile(r"O(<[^<>]*>|\d+)(END)?(SUB|IF|WHILE|REPEAT)")
M98 = re.compile(r"M[+]?0*98(?!\d)")
NUMBER_ONLY = re.compile(r"O(\d+)$")


def refuse_other_programs(lines: Iterable[Line], name: str) -> None:
    """Raise `InputError`, with the line, for a program that must not be given to `rs274`."""
    calls: list[tuple[str, int]] = []
    defined: set[str] = set()
    for line in lines:
        for column, text in line.comments:
            if PYTHON.match(text):
                raise _refused("a comment that runs Python", Place(name, line.number, column))
        if "M" in line.words:
            _check_m_codes(line, name)
        _take_subprogram(line, name, calls, defined)
    for key, number in calls:
        if key not in defined:
            raise Place(name, number).fail(
                f"subprogram O{key} is not in the program",
                "subprograms in the same file",
                "copy it into the program; other files are not read",
            )


def _refused(problem: str, place: Place) -> ProgramError:
    return place.fail(
        f"{problem}: LinuxCNC's interpreter is not started on such a program",
        "a program that runs no other",
        "remove it, or read the program with --interpreter builtin",
    )


def _check_m_codes(line: Line, name: str) -> None:
    place = Place(name, line.number)
    for digits in M_WORD.findall(NAMED.sub("<>", line.words)):
        if not digits:
            raise _refused("an M code that is computed, and might be a user's (M100 to M199)", place)
        try:
            code = float(digits)
        except ValueError:
            raise place.fail(f"M{digits} is not an M code") from None
        # Rounded as LinuxCNC does (interp_read.cc: the nearest integer), and to be safe both neighbours.
        if 99.0 < code < 200.0:
            raise _refused(f"the user M code M{digits} (M100 to M199 run a program)", place)


def _take_subprogram(line: Line, name: str, calls: list[tuple[str, int]], defined: set[str]) -> None:
    """The subprogram that a line calls or defines: O words may call only what the program itself has.

    LinuxCNC would go and look for a file.
    """
    place, subprogram = Place(name, line.number), SUBPROGRAM.match(line.words)
    if subprogram and "/" in subprogram[1]:  # it would be looked for there, if what defines it here is left out
        raise _refused("a subprogram whose name is a path", place)
    if subprogram and subprogram[2] == "CALL":
        calls.append((_key(subprogram[1]), line.number))
    elif subprogram and (subprogram[2] == "SUB" or NUMBER_ONLY.match(line.words)):
        defined.add(_key(subprogram[1]))
    elif line.words.startswith("O") and "CALL" in NAMED.sub("<>", line.words):
        raise _refused("a call of a subprogram whose name is computed", place)
    elif M98.search(line.words):
        called = re.search(r"P(\d+)", line.plain)
        if called is None:
            raise _refused("M98 without the number of its subprogram", place)
        calls.append((_key(called[1]), line.number))


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


KNOWN_M = frozenset((*range(10), 19, 30, *range(48, 54), *range(60, 69), *range(70, 74), *range(96, 200)))
# Codes of other controls that change no path, with their words (as in `codes.registry`); the first three are
# LinuxCNC's own with any other word.
OTHERS_CODES = {"G5": "P", "G5.1": "QR", "G8": "P", "G9": "", "G103": "P", "G187": "PE", "G254": "", "G255": ""}
OWN_CODES = ("G5", "G5.1", "G8")
MAY_CONFUSE = frozenset("GMDHIJK")
ARC_CODES = frozenset(("G0", "G1", "G2", "G3", "G17", "G18", "G19", "G20", "G21", "G40", "G90", "G91", "G94"))
Dropped = tuple[int, str]  # line, word


def without_others(lines: Iterable[Line]) -> tuple[list[Line], list[Dropped]]:
    """The lines without words of other controls that change no path and that rs274 refuses; and those words.

    Blocks of plain words alone are looked at; what is left of one is a part of its words, each as it was.
    """
    kept, dropped = [], list[Dropped]()
    for line in lines:
        looked_at = line.rest is None and MAY_CONFUSE & set(line.words) and TOKENS.fullmatch(line.words)
        confusing = _confusing(line.words) if looked_at else ()
        if confusing:
            dropped += [(line.number, word) for word in confusing]
            left = (match[0] for match in TOKEN.finditer(line.words) if match[0] not in confusing)
            kept.append(replace(line, words="".join(left)))
        else:
            kept.append(line)
    return kept, dropped


def _confusing(words: str) -> tuple[str, ...]:
    """The words of a block that rs274 need not see."""
    tokens = [(letter, digits, float(digits)) for letter, digits in TOKEN.findall(words)]
    codes = {f"{letter}{number:g}" for letter, _, number in tokens if letter in "GM"}
    letters = {letter for letter, _, _ in tokens}
    # M codes that it has not; those that it rounds to a user's are the fence's.
    out = {code for code in codes if code[0] == "M" and "." not in code and float(code[1:]) not in KNOWN_M}
    for code in codes & OTHERS_CODES.keys():
        meant = set(OTHERS_CODES[code])
        if code not in OWN_CODES or (letters & meant and letters <= meant | set("GMFST")):
            out.add(code)
    taken = {letter for code in out for letter in OTHERS_CODES.get(code, "")}
    if out == codes and any(code[0] == "M" for code in out) and not letters & set("XYZABC"):
        taken |= set("PQERS")  # parameters of the M code
    # D and H beside a tool or its length, where nothing uses them.
    tool = "T" in letters or "M6" in codes
    if (tool or "G43" in codes) and not any(code.startswith(("G41", "G42", "G96")) for code in codes):
        taken.add("D")
    if tool and not any(code.startswith(("G43", "G76")) for code in codes):
        taken.add("H")
    centres = {letter: number for letter, _, number in tokens if letter in "IJK"}
    if len(centres) == 3 and any(centres.values()) and all(code in ARC_CODES or code[0] == "M" for code in codes):
        taken |= {letter for letter, value in centres.items() if not value}  # out of the arc's plane
    return tuple(
        letter + digits for letter, digits, number in tokens if letter in taken or f"{letter}{number:g}" in out
    )
