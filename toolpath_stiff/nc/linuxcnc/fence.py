"""The fence: programs that are never given to `rs274`.

LinuxCNC executes Python in comments (`;py,...`, `(py,...)`, `(pyrun,...)`), user M codes (M100 to M199) as executables,
and subprograms of other files. A program with these is refused here, before anything is started; user M codes that
stand plainly in their block are taken out of the copy, with a warning each. That copy has no comments at all, so
Python would not run even if it passed.
"""

import re
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.lines import read_lines
from toolpath_stiff.nc.linuxcnc.inputs import NAMED, Line, split
from toolpath_stiff.nc.place import Place

# `py,`, `pyrun`, `pyreload`, and `py` alone or before anything but a letter or digit, whatever blanks are in between;
# a comment within a comment counts, though LinuxCNC does not look there.
PYTHON = re.compile(r"[(;][\s(;]*p\s*y(?:\s*(?:[^\w\s]|$|r\s*u\s*n|r\s*e\s*l\s*o\s*a\s*d)|\s)", re.IGNORECASE)
# Only MOD, of all functions, operators and O words, contains an M.
M_WORD = re.compile(r"M(?!OD)([+-]?[0-9.]+)?", re.ASCII)
SUBPROGRAM = re.compile(r"O(<[^<>]*>|\d+)(SUB|CALL)?")
ENDS = re.compile(r"(?:END)?SUB")
M98 = re.compile(r"M[+]?0*98(?!\d)")
NUMBER_ONLY = re.compile(r"O(\d+)$")


USER_CODE = re.compile(r"M0*1\d\d(?![\d.])", re.ASCII)
PARAMETER = re.compile(r"[PQ][+-]?(?:\d+\.?\d*|\.\d+|#+\d*)", re.ASCII)


def without_user_codes(line: Line) -> Line:
    """Line without its user M codes and their P and Q; unchanged beside a G code, to which these may belong."""
    codes, parameters = [*USER_CODE.finditer(line.plain)], [*PARAMETER.finditer(line.plain)]
    if not codes or line.words.startswith("O") or (parameters and "G" in line.plain):
        return line
    taken = {place for match in (*codes, *parameters) for place in range(*match.span())}
    kept = [place for place in range(len(line.words)) if place not in taken]
    words, columns = "".join(line.words[place] for place in kept), [line.columns[place] for place in kept]
    return replace(line, words=words, columns=columns, user_codes=tuple(match[0] for match in codes))


def called_files(lines: list[Line], folder: str | None) -> tuple[list[Line], dict[int, int]]:
    """Subs of a folder's files (`name.ngc`) that a program calls, numbered on from it, and the calling line of each."""
    subs, callers = list[Line](), dict[int, int]()
    defined = {_key(match[1]) for line in lines if (match := SUBPROGRAM.match(line.words)) and match[2] == "SUB"}
    queue = deque(lines if folder is not None else ())
    while queue:
        line = queue.popleft()
        called = SUBPROGRAM.match(line.words)
        if called is None or called[2] != "CALL" or "/" in called[1] or _key(called[1]) in defined:
            continue
        defined.add(_key(called[1]))
        file = Path(folder or "") / f"{_key(called[1]).strip('<>').lower()}.ngc"
        inside = split(read_lines(file), file.name) if file.is_file() else []
        kept = [row for row, text in enumerate(inside) if text.words.startswith("O") and ENDS.search(text.words)]
        for text in inside[kept[0] : kept[-1] + 1] if kept else ():
            number = len(lines) + len(subs) + 1
            callers[number] = callers.get(line.number, line.number)
            subs.append(without_user_codes(replace(text, number=number)))
            queue.append(subs[-1])
    return subs, callers


def refuse_other_programs(lines: Iterable[Line], name: str) -> None:
    """Raise `InputError`, with the line, for a program that must not be given to `rs274`."""
    calls: list[tuple[str, int]] = []
    defined: set[str] = set()
    for line in lines:
        if PYTHON.search(line.text):
            raise _refused("a comment that runs Python", Place(name, line.number))
        if "M" in line.words:
            _check_m_codes(line, name)
        _take_subprogram(line, name, calls, defined)
    for key, number in calls:
        if key not in defined:
            expected = "subprograms in the same file, or as name.ngc in a folder"
            problem = f"subprogram O{key} is not in the program"
            raise Place(name, number).fail(problem, expected, "--subprograms FOLDER")


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
    """Take the subprogram that a line calls or defines: O words may only call those in the program itself.

    LinuxCNC would go and look for a file.
    """
    place, subprogram = Place(name, line.number), SUBPROGRAM.match(line.words)
    if subprogram and "/" in subprogram[1]:  # LinuxCNC would look for it elsewhere if its definition here were skipped
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


def _key(name: str) -> str:
    return name if name.startswith("<") else str(int(name))
