"""Blocks of parametric programs: words, assignments and flow control.

RS274/NGC: LinuxCNC's manual, "O Codes". Macro B: Fanuc's operator's manuals, "Custom macro" ("Branch and repetition").
A block is read once, to a `Statement`; running it works out its values.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from toolpath_stiff.nc.controller import Dialect
from toolpath_stiff.nc.parametric.expressions import EQUAL, Scanner, Value
from toolpath_stiff.nc.parametric.families import MACRO_B, NGC, NGC_WORDS
from toolpath_stiff.nc.parametric.variables import Variables
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.words import (
    LETTERS,
    WHOLE_WORDS,
    WORD,
    Block,
    Word,
    block_delete,
    program_number,
    through_pygcode,
    without_comments,
)

_NGC_WORD = re.compile("|".join(sorted(NGC_WORDS, key=len, reverse=True)))
_O_LABEL = re.compile(r"\d+|<[^>]*>", re.ASCII)
_N_WORD = re.compile(r"N\d+(?:\.\d+)?", re.ASCII)
_LOOP = re.compile(r"(?:DO|END)\d+", re.ASCII)
LONGEST_BLOCK = 255  # characters without comments and blanks: what LinuxCNC reads
MOST_VALUES = 30  # of a call

# `#which = value`: works both out; what that gives sets the variable. In a block all are worked out before any is set.
Assignment = Callable[[Variables], Callable[[], None]]


@dataclass(frozen=True)
class Steering:
    """Effect of a block on the flow.

    Attributes
    ----------
    kind
        An O word of RS274/NGC in upper case; of Macro B "IF GOTO", "IF THEN", "GOTO", "WHILE LOOP", "LOOP" (DO) or
        "END".
    label
        Of the O word, or the number of DO and END.
    shown
        Both as messages have them.
    values
        Of a call; one value of a condition, of repeats, of what is returned, of the N number to go to.
    then
        Assignments of IF THEN.
    column
        Where it stands.
    """

    kind: str
    label: str
    shown: str
    column: int
    values: tuple[Value, ...] = ()
    then: tuple[Assignment, ...] = ()


@dataclass(frozen=True)
class Statement:
    """A block after reading.

    Attributes
    ----------
    block
        Its words; those that are computed have the value 0.
    computed
        Place of a word in the block -> its value.
    assignments
        They take effect together.
    steering
        What it does to the flow; such a block has nothing else.
    """

    block: Block
    computed: Mapping[int, Value] = field(default_factory=dict)
    assignments: tuple[Assignment, ...] = ()
    steering: Steering | None = None


def read_statement(text: str, place: Place, family: str, dialect: Dialect) -> Statement:
    """Read one line. Raises `InputError` with line and column.

    Examples
    --------
    >>> from toolpath_stiff.nc.controller import GENERIC
    >>> read_statement("o<slot> call [10] [#2]", Place("part.ngc", 1), NGC, GENERIC).steering.kind
    'CALL'
    """
    compact, columns = without_comments(text, place, dialect.semicolon)
    if compact in ("", "%"):
        return Statement(Block(place.line, (), percent=compact == "%"))
    if len(compact) > LONGEST_BLOCK:
        problem = f"a block of {len(compact)} characters without comments and blanks"
        raise place.fail(problem, f"at most {LONGEST_BLOCK}")
    start, switch = block_delete(compact, 0, columns, place) if compact[0] == "/" else (0, 1)
    scanner = Scanner(compact, columns, place, family, position=start)
    scanner.take(_N_WORD)
    steering = _steering(scanner)
    if steering is not None and not scanner.done:
        raise scanner.fail(f"{scanner.rest()} after {steering.shown}", "a block of its own")
    words, computed, assignments = list[Word](), dict[int, Value](), list[Assignment]()
    if scanner.begins("O", ":"):
        words += program_number(compact[scanner.position :], scanner.column, place).words
        scanner.position = len(compact)
    while not scanner.done:
        if scanner.begins("#"):
            assignments.append(_assignment(scanner))
            continue
        word, value = _word(scanner, text)
        if value is not None:
            computed[len(words)] = value
        words.append(word)
    # Numbers that codes and tools may have, as in any program.
    through_pygcode([word for index, word in enumerate(words) if index not in computed], place)
    block = Block(place.line, tuple(words), optional=start > 0, switch=switch)
    return Statement(block, computed, tuple(assignments), steering)


def _steering(scanner: Scanner) -> Steering | None:
    column = scanner.column
    if scanner.begins("O", ":") and not scanner.text[scanner.position + 1 :].isdigit():
        return _o_word(scanner)
    if scanner.family == NGC:
        return None
    loop = scanner.take(_LOOP)
    if loop:
        kind = "END" if loop.startswith("END") else "LOOP"
        return Steering(kind, _loop_label(scanner, loop, column), loop, column)
    if scanner.next("GOTO"):
        return Steering("GOTO", "", "GOTO", column, (scanner.value(),))
    if scanner.begins("WHILE[") and scanner.next("WHILE"):
        condition = scanner.bracket()
        loop = scanner.take(_LOOP)
        scanner.refuse_if(not loop.startswith("DO"), "WHILE without its DO", "WHILE[...]DO1", column=column)
        return Steering("WHILE LOOP", _loop_label(scanner, loop, column), f"WHILE {loop}", column, (condition,))
    if scanner.begins("IF[") and scanner.next("IF"):
        condition = scanner.bracket()
        if scanner.next("GOTO"):
            return Steering("IF GOTO", "", "IF GOTO", column, (condition, scanner.value()))
        assignments = list[Assignment]()
        while scanner.next("THEN") or (assignments and not scanner.done):
            assignments.append(_assignment(scanner))
        if assignments:
            return Steering("IF THEN", "", "IF THEN", column, (condition,), tuple(assignments))
        expected = "IF[...]GOTO10 or IF[...]THEN #1=0"
        raise scanner.fail("IF without GOTO or an assignment after THEN", expected, column=column)
    return None


def _loop_label(scanner: Scanner, loop: str, column: int) -> str:
    label = loop.lstrip("DOEN")
    scanner.refuse_if(label not in ("1", "2", "3"), f"the loop number {label}", "1, 2 or 3", column=column)
    return label


def _o_word(scanner: Scanner) -> Steering:
    """`o100 while [...]`, `o<name> call [1] [2]`."""
    column = scanner.column
    scanner.refuse_if(scanner.family == MACRO_B, f"{scanner.rest()} is no number of a program", "--dialect linuxcnc")
    scanner.position += 1
    label = scanner.take(_O_LABEL)
    scanner.refuse_if(not label, f"{scanner.rest()} is no label of an O word", "O with a number, or a name as <name>")
    label = label if label[0] == "<" else label.lstrip("0") or "0"
    kind = scanner.take(_NGC_WORD)
    scanner.refuse_if(not kind, f"the O word {label} without what it does", ", ".join(NGC_WORDS).lower())
    values = []
    while kind == "CALL" and scanner.begins("["):
        values.append(scanner.bracket())
    scanner.refuse_if(len(values) > MOST_VALUES, f"a call with {len(values)} values", f"at most {MOST_VALUES}")
    if kind in ("IF", "ELSEIF", "WHILE", "REPEAT") or (kind in ("ENDSUB", "RETURN") and not scanner.done):
        values.append(scanner.bracket())
    return Steering(kind, label, f"o{label} {kind}".lower(), column, tuple(values))


def _word(scanner: Scanner, text: str) -> tuple[Word, Value | None]:
    """A word, and its value if computed."""
    column, letter = scanner.column, scanner.text[scanner.position]
    scanner.refuse_if(letter not in LETTERS, f"{scanner.rest()} is not a word", "a letter and a value, or #1=...")
    plain, value = WORD.match(scanner.text, scanner.position), None
    # An operator after a number outside of brackets, `X1+2`: no control takes it for 3.
    if plain is not None and not plain[3] and scanner.text[plain.end() : plain.end() + 1] not in tuple("*/+-"):
        scanner.position = plain.end()
    else:
        scanner.position, scanner.of_word = scanner.position + 1, True
        value, scanner.of_word = scanner.value(), False
    written = text[column - 1 : scanner.columns[scanner.position - 1]]
    scanner.refuse_if(
        letter == "N", f"line number {written!r} after another word", "N at the beginning of the line", column=column
    )
    return Word(letter, float(plain[2]) if plain is not None and value is None else 0.0, column, written), value


def _assignment(scanner: Scanner) -> Assignment:
    place = scanner.place._replace(column=scanner.column)
    scanner.refuse_if(not scanner.next("#"), f"{scanner.rest()} is not an assignment", "#1=...")
    which = scanner.which()
    if not scanner.next("="):
        raise place.fail(f"a variable without its letter or `=`: {scanner.rest()}", "X#1, or #1=...")
    scanner.refuse_if(scanner.done, "an assignment without a value", "#1=...")
    # A whole expression in Macro B; in NGC a single value, so that an operator after it is an error.
    value = scanner.value() if scanner.family == NGC else scanner.expression()
    return lambda variables: partial(variables.set, which(variables), value(variables), place)


def worked_out(statement: Statement, variables: Variables, place: Place) -> Block:
    """Block with the values of its words; a word with an empty variable counts as absent (Macro B)."""
    if not statement.computed:
        return statement.block
    block, words = statement.block, []
    for index, word in enumerate(block.words):
        if index not in statement.computed:
            words.append(word)
            continue
        value = statement.computed[index](variables)
        if value is not None:
            words.append(_computed_word(word, _whole(word, value, place) if word.letter in WHOLE_WORDS else value))
    return Block(block.line, tuple(words), block.optional, block.percent, block.switch)


def _whole(word: Word, value: float, place: Place) -> float:
    """Code or number that a value stands for, rounded as LinuxCNC's interpreter does."""
    whole = round(value, 1 if word.letter in "GM" else 0)
    if abs(whole - value) > EQUAL or whole < 0.0:
        expected = f"a code such as {word.letter}1" if word.letter in "GM" else "a whole number from 0"
        raise place.fail(f"{word.text} is {word.letter}{value:g}", expected, column=word.column)
    return whole


def _computed_word(word: Word, value: float) -> Word:
    """Computed word with its value, which is in its text too, always with a decimal point.

    So a computed number never counts increments.
    """
    digits = f"{value:#.7g}"
    if "e" not in digits:
        digits = digits.rstrip("0") + "0" * digits.rstrip("0").endswith(".")
    return Word(word.letter, value, word.column, f"{word.text} ({digits})")
