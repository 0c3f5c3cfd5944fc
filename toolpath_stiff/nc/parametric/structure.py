"""What belongs together in a parametric program: O words, DO and END; and the letters of a macro call to its variables.

LinuxCNC's manual, "O Codes"; Fanuc's operator's manuals, "Custom macro" ("Branch and repetition", "Macro call").
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.words import Word

if TYPE_CHECKING:
    from toolpath_stiff.nc.parametric.statements import Steering


Fail = Callable[..., InputError]  # (line from 0, found, expected, hint, column)


OPENERS = {"ENDSUB": "SUB", "ENDIF": "IF", "ENDWHILE": "WHILE", "ENDREPEAT": "REPEAT"}


SHOWN = 40  # characters of a label in a message


LOOPS = ("WHILE", "DO", "REPEAT")


# Macro B, argument specification I and II ("Macro call", "Argument specification").
ARGUMENTS = {
    "A": 1, "B": 2, "C": 3, "D": 7, "E": 8, "F": 9, "H": 11, "I": 4, "J": 5, "K": 6, "M": 13, "Q": 17, "R": 18, "S": 19,
    "T": 20, "U": 21, "V": 22, "W": 23, "X": 24, "Y": 25, "Z": 26,
}  # fmt: skip


SECOND_KIND = {"A": 1, "B": 2, "C": 3}  # then I, J, K up to ten times, from #4


LAST_LOCAL = 33


WHOLE_ARGUMENTS = frozenset("DHMST")  # numbers of tools, offsets and speeds: no decimal point belongs to them


@dataclass
class Structure:
    """Where O words of RS274/NGC belong to each other; lines from 0.

    Attributes
    ----------
    subs
        Label -> line of `sub`.
    end
        Line of `sub`, `if`, `while`, `do`, `repeat` -> line that closes it.
    start
        The other way round.
    branches
        Line of `if` -> lines of its `elseif`, `else` and `endif`; each of those -> line of the `if`.
    inside
        Line of `break` or `continue` -> line that opens its loop.
    faults
        Line that fits nowhere -> what to say if the run comes to it.
    """

    subs: dict[str, int] = field(default_factory=dict)
    end: dict[int, int] = field(default_factory=dict)
    start: dict[int, int] = field(default_factory=dict)
    branches: dict[int, list[int]] = field(default_factory=dict)
    branch_of: dict[int, int] = field(default_factory=dict)
    inside: dict[int, int] = field(default_factory=dict)
    faults: dict[int, InputError] = field(default_factory=dict)


@dataclass(frozen=True)
class _Opened:
    """A structure that is not closed yet."""

    kind: str
    label: str
    row: int


def structure_of(steerings: Iterable[tuple[int, Steering]], firsts: set[int], fail: Fail) -> Structure:
    """Where the O words of a program belong to each other.

    Parameters
    ----------
    steerings
        The blocks that steer, with their lines (from 0), in order.
    firsts
        First lines of files, which have labels of their own.
    fail
        Makes the error of a line.
    """
    structure = Structure()
    opened: list[_Opened] = []
    labels: list[dict[str, int]] = [{}]  # of the file, and of the sub that is open
    for row, steering in steerings:
        if row in firsts:
            labels = [{}]
        fault = _pair(structure, opened, labels, row, steering)
        if fault:
            structure.faults[row] = fail(row, *fault, column=steering.column)
    endless = {start.row: f"o{start.label.lower()[:SHOWN]} {start.kind.lower()} has no end" for start in opened}
    # `break` and `continue` go to that end.
    leaving = {row: f"{endless[loop]} (line {loop + 1})" for row, loop in structure.inside.items() if loop in endless}
    for row, text in (endless | leaving).items():
        structure.faults[row] = fail(row, text)
    return structure


def _pair(
    structure: Structure, opened: list[_Opened], labels: list[dict[str, int]], row: int, steering: Steering
) -> tuple[str, ...]:
    """Add one O word; returns what is wrong with it and what was expected, nothing if it fits."""
    kind, label = steering.kind, steering.label.text
    last = opened[-1] if opened else _Opened("", "", 0)
    closes_do = kind == "WHILE" and (last.kind, last.label) == ("DO", label)
    if kind in ("SUB", "IF", "DO", "REPEAT") or (kind == "WHILE" and not closes_do):
        return _open(structure, opened, labels, _Opened(kind, label, row))
    if kind in OPENERS or closes_do:
        if last.label != label or not (closes_do or last.kind == OPENERS[kind]):
            return _unpaired(steering)
        opened.pop()
        if kind == "ENDSUB":
            labels.pop()
        structure.end[last.row], structure.start[row] = row, last.row
        if kind == "ENDIF":
            structure.branches[last.row].append(row)
    elif kind in ("ELSE", "ELSEIF"):
        if (last.kind, last.label) != ("IF", label):
            return _unpaired(steering)
        structure.branches[last.row].append(row)
        structure.branch_of[row] = last.row
    elif kind in ("BREAK", "CONTINUE"):
        loops = [start.row for start in opened if start.label == label and start.kind in LOOPS]
        if not loops:
            return _unpaired(steering)
        structure.inside[row] = loops[-1]
    return ()


def _open(structure: Structure, opened: list[_Opened], labels: list[dict[str, int]], start: _Opened) -> tuple[str, ...]:
    if start.label in labels[-1] or not start.label:
        place = f"is in line {labels[-1][start.label] + 1} already" if start.label else "is not known before it runs"
        return (f"the label o{start.label.lower()[:SHOWN]} {place}", "each label once")
    labels[-1][start.label] = start.row
    opened.append(start)
    if start.kind == "SUB":
        structure.subs[start.label] = start.row
        labels.append({})
    elif start.kind == "IF":
        structure.branches[start.row] = []
    return ()


def _unpaired(steering: Steering) -> tuple[str, ...]:
    return (
        f"o{steering.label.text.lower()[:SHOWN]} {steering.kind.lower()} does not belong to what is open before it",
    )


def loops_of(steerings: Iterable[tuple[int, Steering]], fail: Fail) -> dict[int, int]:
    """Line of WHILE DO or DO -> line of its END, and back; from 0. Raises `InputError` for one without the other."""
    loops: dict[int, int] = {}
    opened: list[tuple[str, int]] = []
    for row, steering in steerings:
        label = steering.label.text
        if steering.kind in ("WHILE", "DO"):
            opened.append((label, row))
        elif steering.kind == "END":
            if not opened or opened[-1][0] != label:
                raise fail(row, f"END{label} without DO{label}", column=steering.column)
            _, start = opened.pop()
            loops[row], loops[start] = start, row
    for label, row in opened:
        raise fail(row, f"DO{label} has no END{label}")
    return loops


def arguments_of(
    words: Iterable[Word], increments: bool, fault: Callable[[Word, str, str], InputError]
) -> dict[int, float | None]:
    """The local variables that the words of a macro call give.

    Parameters
    ----------
    words
        Those after G65 or G66.
    increments
        Whether numbers without a decimal point count increments on the control.
    fault
        Makes the error of a word: what is wrong with it, what was expected.
    """
    words = [word for word in words if word.letter not in "PL"]
    letters = [word.letter for word in words]
    second = any(letters.count(letter) > 1 for letter in "IJK")
    arguments: dict[int, float | None] = {}
    triple, previous = -1, "K"
    for word in words:
        if second and word.letter in "IJK":
            triple += word.letter <= previous
            previous = word.letter
            place = 4 + 3 * triple + "IJK".index(word.letter)
        else:
            place = (SECOND_KIND if second else ARGUMENTS).get(word.letter, 0)
        if not 1 <= place <= LAST_LOCAL or place in arguments:
            expected = "each letter once; with I, J, K repeated no other ones than A, B, C"
            raise fault(word, "cannot be an argument of this call", expected)
        if increments and word.value and "." not in word.text and word.letter not in WHOLE_ARGUMENTS:
            raise fault(word, "has no decimal point, and parameters of the control scale it", f"{word.text}.")
        arguments[place] = word.value
    return arguments
