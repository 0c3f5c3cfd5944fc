"""The blocks of parametric programs: which family they show, their words, assignments and control of the flow.

RS274/NGC: LinuxCNC's manual, "O Codes". Macro B: Fanuc's operator's manuals, "Custom macro" ("Branch and repetition").
A block is read once, to a `Statement`; running it works out its values.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolpath_stiff.nc.controller import Dialect
from toolpath_stiff.nc.parametric.expressions import EITHER, MACRO_B, NGC, Scanner, Value
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.words import (
    LETTERS,
    WORD,
    Word,
    block_delete,
    check_length,
    program_number,
    through_pygcode,
    without_comments,
)

if TYPE_CHECKING:
    from toolpath_stiff.nc.parametric.variables import Variables


NGC_WORDS = (
    "SUB", "ENDSUB", "CALL", "RETURN", "IF", "ELSEIF", "ELSE", "ENDIF", "WHILE", "ENDWHILE", "DO", "REPEAT",
    "ENDREPEAT", "BREAK", "CONTINUE",
)  # fmt: skip


_NGC_WORD = re.compile("|".join(sorted(NGC_WORDS, key=len, reverse=True)))


_NUMBERED = re.compile(r"\d+", re.ASCII)


_N_WORD = re.compile(r"N\d+(?:\.\d+)?", re.ASCII)


_LABEL = re.compile(r"(?:DO|END)(\d+)", re.ASCII)


# What only one family has, in a line without comments and blanks, in upper case.
_BEGIN = r"^(?:/\d?)?(?:N\d+)?"


_NGC_SIGN = re.compile(
    rf"{_BEGIN}O(?:<|\[|#|\d+(?:{'|'.join(NGC_WORDS)}))|#<|\*\*|EXISTS\["  # o<x> sub, #<name>
)


_MACRO_SIGN = re.compile(rf"{_BEGIN}(?:IF\[|WHILE\[|GOTO[\d#\[]|DO\d|END\d)|G6[5-7](?!\d)|POW\[")


_ANY_SIGN = re.compile(r"[#\[]")


_COMMENT = re.compile(r"\([^)]*\)|;.*")


_SUSPECT = re.compile(r"[#\[oOiIwWdD]|[gG]\s*0*6")


def uses_variables(lines: tuple[str, ...]) -> bool:
    """Whether any line holds a variable, an expression, or control of the flow.

    Examples
    --------
    >>> uses_variables(("G1 X10 (#1)",)), uses_variables(("#1 = 5", "G1 X#1"))
    (False, True)
    """
    return any(sign.search(text) for _, text in _bare(lines) for sign in (_ANY_SIGN, _NGC_SIGN, _MACRO_SIGN))


def _bare(lines: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Number and text of lines that may matter, without comments and blanks, in upper case."""
    for number, line in enumerate(lines, 1):
        if _SUSPECT.search(line):
            yield number, "".join(_COMMENT.sub(" ", line).split()).upper()


def family_of(lines: tuple[str, ...], dialect: Dialect, name: str) -> str:
    """The family of a program: the dialect's or, for `generic`, that of which the program shows signs.

    Raises
    ------
    ProgramError
        It shows signs of both.
    """
    if dialect.name == "linuxcnc":
        return NGC
    if dialect.name in ("fanuc", "haas"):
        return MACRO_B
    signs = {}
    for family, sign in ((NGC, _NGC_SIGN), (MACRO_B, _MACRO_SIGN)):
        first = next((number for number, text in _bare(lines) if sign.search(text)), None)
        if first is not None:
            signs[family] = first
    if len(signs) == 2:
        raise Place(name, max(signs.values())).fail(
            f"line {signs[NGC]} is of LinuxCNC's language (O words, #<name>, **), line {signs[MACRO_B]} of Macro B "
            "(IF GOTO, WHILE DO, G65)",
            hint="name the control with --dialect",
        )
    return next(iter(signs), EITHER)


@dataclass(frozen=True)
class Label:
    """The label of an O word: its text, or the value that gives it."""

    text: str
    number: Value | None = None

    def known(self, variables: Variables) -> str:
        """The label when the block runs."""
        if self.number is None:
            return self.text
        value = self.number(variables)
        return f"{0 if value is None else round(value)}"


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
    label: Label
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
        steering = Steering(kind, Label(label[1]), column=column)
    elif block.text.startswith("IF[", block.position):
        steering = _if(block, column)
    elif block.text.startswith("WHILE[", block.position):
        block.next("WHILE")
        condition = block.bracket()
        label = block.match(_LABEL)
        if label is None or not label[0].startswith("DO"):
            raise block.fail("WHILE without its DO", "WHILE[...]DO1", column=column)
        _check_loop(block, label[1], column)
        steering = Steering("WHILE", Label(label[1]), (condition,), column=column)
    elif block.next("GOTO"):
        steering = Steering("GOTO", Label(""), (block.value(),), column=column)
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
        return Steering("IF", Label(""), (condition, block.value()), column=column)
    if block.next("THEN"):
        assignments = []
        while not block.done:
            assignments.append(_assignment(block))
        if assignments:
            return Steering("THEN", Label(""), (condition,), tuple(assignments), column=column)
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
    label = _label(block, column)
    kind = block.match(_NGC_WORD)
    if kind is None:
        raise block.fail(
            f"the O word {label.text or 'of a value'} without what it does: {block.rest()}",
            ", ".join(NGC_WORDS).lower(),
        )
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


def _label(block: Scanner, column: int) -> Label:
    digits = block.match(_NUMBERED)
    if digits is not None:
        return Label(digits[0].lstrip("0") or "0")
    if block.next("<"):
        end = block.text.find(">", block.position)
        if end < 0:
            raise block.fail("an O word whose name is not closed", ">", column=column)
        name = block.text[block.position - 1 : end + 1]
        block.position = end + 1
        return Label(name)
    return Label("", block.value())


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
    through_pygcode(plain_words, block.place)
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
