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
UNPAIRED = "does not belong to what is open before it"


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


Opened = list[tuple[int, "Steering"]]  # lines and O words that nothing has closed yet


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
    structure, opened = Structure(), Opened()
    labels: list[set[str]] = [set()]  # of the file, and of the sub that is open
    for row, steering in steerings:
        if row in firsts:
            labels = [set()]
        fault = _pair(structure, opened, labels, row, steering)
        if fault:
            structure.faults[row] = fail(row, f"{shown(steering)} {fault}", column=steering.column)
    for start, steering in opened:
        for row in (start, *(row for row, loop in structure.inside.items() if loop == start)):
            structure.faults[row] = fail(row, f"{shown(steering)} (line {start + 1}) has no end")
    return structure


def shown(steering: Steering) -> str:
    """An O word as messages have it."""
    return f"o{steering.label.lower()[:SHOWN]} {steering.kind.lower()}"


def _pair(structure: Structure, opened: Opened, labels: list[set[str]], row: int, steering: Steering) -> str:
    """Add one O word; returns what is wrong with it, "" if it fits."""
    kind, label = steering.kind, steering.label
    start, last = (opened[-1][0], (opened[-1][1].kind, opened[-1][1].label)) if opened else (0, ("", ""))
    closes_do = kind == "WHILE" and last == ("DO", label)
    if kind in ("SUB", "IF", "DO", "REPEAT") or (kind == "WHILE" and not closes_do):
        if label in labels[-1]:
            return "has a label that is there already"
        labels[-1].add(label)
        opened.append((row, steering))
        if kind == "SUB":
            structure.subs[label] = row
            labels.append(set())
        elif kind == "IF":
            structure.branches[row] = []
    elif kind in OPENERS or closes_do:
        if not closes_do and last != (OPENERS[kind], label):
            return UNPAIRED
        opened.pop()
        if kind == "ENDSUB":
            labels.pop()
        structure.end[start], structure.start[row] = row, start
        if kind == "ENDIF":
            structure.branches[start].append(row)
    elif kind in ("ELSE", "ELSEIF"):
        if last != ("IF", label):
            return UNPAIRED
        structure.branches[start].append(row)
        structure.branch_of[row] = start
    elif kind in ("BREAK", "CONTINUE"):
        loops = [first for first, word in opened if word.label == label and word.kind in LOOPS]
        if not loops:
            return UNPAIRED
        structure.inside[row] = loops[-1]
    return ""


def loops_of(steerings: Iterable[tuple[int, Steering]], fail: Fail) -> dict[int, int]:
    """Line of WHILE DO or DO -> line of its END, and back; from 0. Raises `InputError` for one without the other."""
    loops: dict[int, int] = {}
    opened: list[tuple[str, int]] = []
    for row, steering in steerings:
        label = steering.label
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
