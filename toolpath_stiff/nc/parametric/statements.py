"""The blocks of parametric programs: their words, assignments and control of the flow.

RS274/NGC: LinuxCNC's manual, "O Codes". Macro B: Fanuc's operator's manuals, "Custom macro" ("Branch and repetition").
A block is read once, to a `Statement`; running it works out its values.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolpath_stiff.nc.controller import Dialect
from toolpath_stiff.nc.parametric.expressions import Scanner, Value
from toolpath_stiff.nc.parametric.families import MACRO_B, NGC, NGC_WORDS
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.words import (
    LETTERS,
    WORD,
    Word,
    block_delete,
    check_length,
    check_numbers,
    program_number,
    without_comments,
)

if TYPE_CHECKING:
    from toolpath_stiff.nc.parametric.variables import Variables


_NGC_WORD = re.compile("|".join(sorted(NGC_WORDS, key=len, reverse=True)))
_O_LABEL = re.compile(r"\d+|<[^>]*>", re.ASCII)
_N_WORD = re.compile(r"N\d+(?:\.\d+)?", re.ASCII)
_LABEL = re.compile(r"(?:DO|END)(\d+)", re.ASCII)


@dataclass(frozen=True)
class Assignment:
    """`#which = value`."""

    which: Callable[[Variables], str | int]
    value: Value
    column: int


@dataclass(frozen=True)
class Steering:
    """What a block does to the flow.

    Attributes
    ----------
    kind
        An O word of RS274/NGC in upper case; "IF", "THEN", "GOTO", "WHILE", "DO" or "END" of Macro B.
    label
        Of the O word, or the number of DO and END.
    values
        Of a call; one value of a condition, of repeats, of what is returned, of the N number to go to.
    then
        Assignments of IF THEN.
    column
        Where it stands.
    """

    kind: str
    label: str
    values: tuple[Value, ...] = ()
    then: tuple[Assignment, ...] = ()
    column: int = 1


@dataclass(frozen=True)
class Statement:
    """A block that was read.

    Attributes
    ----------
    line
        From 1.
    words
        Letter, value, column, text of each word.
    assignments
        They take effect together, once all values of the block are known.
    steering
        What it does to the flow; such a block has nothing else.
    optional, switch, percent
        As in `words.Block`.
    """

    line: int
    words: tuple[tuple[str, Value | float, int, str], ...] = ()
    assignments: tuple[Assignment, ...] = ()
    steering: Steering | None = None
    optional: bool = False
    switch: int = 1
    percent: bool = False


def read_statement(text: str, place: Place, family: str, dialect: Dialect) -> Statement:
    """Read one line. Raises `InputError` with line and column.

    Examples
    --------
    >>> from toolpath_stiff.nc.controller import GENERIC
    >>> read_statement("o<slot> call [10] [#2]", Place("part.ngc", 1), NGC, GENERIC).steering.kind
    'CALL'
    """
    compact, columns = without_comments(text, place, dialect.semicolon)
    if not compact:
        return Statement(place.line)
    if compact == "%":
        return Statement(place.line, percent=True)
    check_length(compact, place)
    start, switch = block_delete(compact, 0, columns, place) if compact[0] == "/" else (0, 1)
    block = Scanner(compact, columns, place, family, position=start)
    optional = start > 0
    block.match(_N_WORD)
    if block.done:
        return Statement(place.line, optional=optional, switch=switch)
    steering = _steering(block)
    if steering is not None:
        return Statement(place.line, steering=steering, optional=optional, switch=switch)
    words, assignments = _contents(block, text)
    return Statement(place.line, tuple(words), tuple(assignments), None, optional, switch)


def _steering(block: Scanner) -> Steering | None:
    if block.text[block.position] in "O:" and not block.text[block.position + 1 :].isdigit():
        return _o_word(block)
    if block.family == NGC:
        return None
    column = block.column
    label = block.match(_LABEL)
    if label is not None:
        kind = "DO" if label[0].startswith("DO") else "END"
        _check_loop(block, label[1], column)
        steering = Steering(kind, label[1], column=column)
    elif block.text.startswith("IF[", block.position):
        steering = _if(block, column)
    elif block.text.startswith("WHILE[", block.position):
        block.next("WHILE")
        condition = block.bracket()
        label = block.match(_LABEL)
        if label is None or not label[0].startswith("DO"):
            raise block.fail("WHILE without its DO", "WHILE[...]DO1", column=column)
        _check_loop(block, label[1], column)
        steering = Steering("WHILE", label[1], (condition,), column=column)
    elif block.next("GOTO"):
        steering = Steering("GOTO", "", (block.value(),), column=column)
    else:
        return None
    return _alone(block, steering)


def _check_loop(block: Scanner, label: str, column: int) -> None:
    if label not in ("1", "2", "3"):
        raise block.fail(f"the loop number {label}", "1, 2 or 3", column=column)


def _if(block: Scanner, column: int) -> Steering:
    block.next("IF")
    condition = block.bracket()
    if block.next("GOTO"):
        return Steering("IF", "", (condition, block.value()), column=column)
    if block.next("THEN"):
        assignments = []
        while not block.done:
            assignments.append(_assignment(block))
        if assignments:
            return Steering("THEN", "", (condition,), tuple(assignments), column=column)
    raise block.fail("IF without GOTO or an assignment after THEN", "IF[...]GOTO10 or IF[...]THEN #1=0", column=column)


def _alone(block: Scanner, steering: Steering) -> Steering:
    if not block.done:
        raise block.fail(f"{block.rest()} after {steering.kind}", "a block of its own")
    return steering


def _o_word(block: Scanner) -> Steering:
    """`o100 while [...]`, `o<name> call [1] [2]`."""
    column = block.column
    if block.family == MACRO_B:
        raise block.fail(f"{block.rest()} is no program number", "O and digits, or --dialect linuxcnc")
    block.position += 1
    label = _label(block)
    kind = block.match(_NGC_WORD)
    if kind is None:
        problem = f"the O word {label} without what it does: {block.rest()}"
        raise block.fail(problem, ", ".join(NGC_WORDS).lower())
    values = []
    if kind[0] == "CALL":
        while not block.done and block.text[block.position] == "[":
            values.append(block.bracket())
        most = 30
        if len(values) > most:
            raise block.fail(f"a call with {len(values)} values", f"at most {most}", column=column)
    elif kind[0] in ("IF", "ELSEIF", "WHILE", "REPEAT") or (kind[0] in ("ENDSUB", "RETURN") and not block.done):
        values.append(block.bracket())
    return _alone(block, Steering(kind[0], label, tuple(values), column=column))


def _label(block: Scanner) -> str:
    """The number or the name in angle brackets after an O."""
    label = block.match(_O_LABEL)
    if label is None:
        raise block.fail(f"{block.rest()} is no label of an O word", "O with a number, or a name as <name>")
    return label[0] if label[0][0] == "<" else label[0].lstrip("0") or "0"


def _contents(block: Scanner, text: str) -> tuple[list[tuple[str, Value | float, int, str]], list[Assignment]]:
    """Words and assignments of a block."""
    words: list[tuple[str, Value | float, int, str]] = []
    assignments: list[Assignment] = []
    if block.text[block.position] in "O:":  # the program's number
        (word,) = program_number(block.text[block.position :], block.column, block.place).words
        return [(word.letter, word.value, word.column, word.text)], assignments
    while not block.done:
        column = block.column
        if block.text[block.position] == "#":
            assignments.append(_assignment(block))
            continue
        letter = block.text[block.position]
        if letter not in LETTERS:
            raise block.fail(f"{block.rest()} is not a word", "a letter and a value, or #1=...")
        plain = WORD.match(block.text, block.position)
        if plain is not None and not plain[3] and not _goes_on(block.text, plain.end()):
            block.position = plain.end()
            value: Value | float = float(plain[2])
        else:
            block.position += 1
            block.of_word = True
            value = block.value()
            block.of_word = False
        written = text[column - 1 : block.columns[block.position - 1]]
        if letter == "N":
            raise block.fail(
                f"line number {written!r} after another word", "N at the beginning of the line", column=column
            )
        words.append((letter, value, column, written))
    # The numbers that codes and tools may have, as in any other program.
    plain_words = [Word(parts[0], parts[1], parts[2], parts[3]) for parts in words if isinstance(parts[1], float)]
    check_numbers(plain_words, block.place)
    return words, assignments


def _goes_on(text: str, end: int) -> bool:
    """Whether an operator follows a number outside of brackets: `X1+2`, which no control takes for 3."""
    return text[end : end + 1] in ("*", "/", "+", "-")


def _assignment(block: Scanner) -> Assignment:
    column = block.column
    if not block.next("#"):
        raise block.fail(f"{block.rest()} is not an assignment", "#1=...")
    which = block.which()
    if not block.next("="):
        raise block.fail(f"a variable without its letter or `=`: {block.rest()}", "X#1, or #1=...", column=column)
    if block.done:
        raise block.fail("an assignment without a value", "#1=...")
    # A whole expression in Macro B; in NGC one value, so that an operator after it is an error.
    value = block.value() if block.family == NGC else block.expression()
    return Assignment(which, value, column)


def plain_word(letter: str, value: float, column: int, written: str, computed: bool) -> Word:
    """A word with its value; that of a computed one stands beside its text, always with a decimal point."""
    if not computed:
        return Word(letter, value, column, written)
    return Word(letter, value, column, f"{written} ({_decimal(value)})")


def _decimal(value: float) -> str:
    """A few digits, with a decimal point whatever they are: a computed number never counts increments."""
    text = f"{value:#.7g}"
    return text if "e" in text else text.rstrip("0") + "0" * text.rstrip("0").endswith(".")
