"""Words of a block: our normalising, then pygcode's reading. The only module that knows pygcode.

pygcode 0.2.1 (unmaintained since 2017) stumbles over comments of both styles on one line, `X+1`, spaces inside words,
drops the E of `1.5E2`, and passes what it does not know. So comments, spaces, signs, exponents and N words are dealt
with before it, each word keeps its true column, and every word that pygcode does not hand back is an error.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import NamedTuple

from toolpath_stiff.errors import InputError

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[E][+-]?\d+)?"
WORD = re.compile(rf"([A-Z])({NUMBER})")
PLAIN = re.compile(r"-?(?:\d+\.?\d*|\.\d+)$")
LETTERS = frozenset("ABCDFGHIJKLMNPQRSTUVWXYZ")
CODE_DECIMALS = 1  # G59.3, G92.1: more digits are no code


class Word(NamedTuple):
    """One word: letter, value, column (from 1) and its text as it stands."""

    letter: str
    value: float
    column: int
    text: str


@dataclass(frozen=True)
class Block:
    """One line of a program, read.

    `optional`: it begins with the block-delete slash. `percent`: it holds the tape mark alone.
    """

    line: int
    words: tuple[Word, ...]
    optional: bool = False
    percent: bool = False


def read_block(text: str, line: int, name: str) -> Block:
    """Read the words of one line. Raises `InputError` with line and column."""
    # The bulk of a big program is plain words with single blanks: no comment, nothing to normalise.
    characters, columns = _strip(text, line, name)
    compact = "".join(characters)
    if not compact:
        return Block(line, ())
    if compact == "%":
        return Block(line, (), percent=True)
    start = 0
    optional = compact[0] == "/"
    if optional:
        start = 1
        while start < len(compact) and compact[start].isdigit():  # /1 to /9: numbered switches
            start += 1
    if compact.startswith("O", start):
        return _program_number(compact[start:], columns[start], line, name)
    words = _tokens(compact, columns, start, text, line, name)
    return Block(line, _through_pygcode(words, line, name), optional=optional)


def _program_number(compact: str, column: int, line: int, name: str) -> Block:
    """`O1234` alone is a program's number; any other O word steers subprograms or loops."""
    if compact[1:].isdigit():
        return Block(line, (Word("O", float(compact[1:]), column, compact),))
    raise InputError(
        f"O word {compact[:20]!r}: subprograms and loops are not supported",
        expected="plain moves",
        hint="expand subprograms and loops before analysing (the control or the post can do it)",
        file=name,
        line=line,
        column=column,
    )


def _strip(text: str, line: int, name: str) -> tuple[list[str], list[int]]:
    """Upper-case characters outside comments and blanks, with their columns."""
    characters: list[str] = []
    columns: list[int] = []
    inside = 0
    for column, character in enumerate(text, 1):
        if inside:
            if character == ")":
                inside = 0
            elif character == "(":
                raise InputError(
                    "a comment within a comment",
                    expected="`)` before the next `(`",
                    file=name,
                    line=line,
                    column=column,
                )
        elif character == "(":
            inside = column
        elif character == ";":
            break
        elif character == ")":
            raise InputError("`)` without `(`", file=name, line=line, column=column)
        elif not character.isspace() and character != "\ufeff":
            characters.append(character.upper())
            columns.append(column)
    if inside:
        raise InputError(
            "a comment is not closed", expected="`)` on the same line", file=name, line=line, column=inside
        )
    return characters, columns


def _tokens(compact: str, columns: list[int], start: int, text: str, line: int, name: str) -> list[Word]:
    """Words of the compacted text; N words are checked and left out."""
    words: list[Word] = []
    position = start
    while position < len(compact):
        match = WORD.match(compact, position)
        column = columns[position]
        if match is None:
            raise _unreadable(compact, position, column, line, name)
        letter, number = match.groups()
        end = match.end()
        original = text[column - 1 : columns[end - 1]]
        if letter == "N":
            if words:
                raise InputError(
                    f"line number {original!r} after another word",
                    expected="N at the beginning of the line",
                    file=name,
                    line=line,
                    column=column,
                )
        elif letter not in LETTERS:
            raise InputError(f"word {original!r} is not known", file=name, line=line, column=column)
        else:
            value = float(number)
            if not math.isfinite(value):
                raise InputError(f"{original!r} is not a finite number", file=name, line=line, column=column)
            words.append(Word(letter, value, column, original))
        position = end
    return words


def _unreadable(compact: str, position: int, column: int, line: int, name: str) -> InputError:
    """The error for text that is no word, with the reason if it is a known one."""
    character = compact[position]
    tail = compact[position : position + 12]
    follower = compact[position + 1 : position + 2]
    found, expected, hint = f"{tail!r} is not a word", "a letter and a number", ""
    if character.isalpha() and (not follower or follower.isalpha() or follower == "/"):
        if compact.startswith(("NAN", "INF"), position + 1):
            found, expected = f"{tail!r} is not a finite number", "a decimal number"
        else:
            found, expected = f"the word {character!r} has no number", f"a number after {character}"
    if character == "#" or follower == "#" or character == "=":
        found, expected = "variables (#) are not supported", "numbers"
        hint = "post the program without variables, or expand it on the control first"
    elif character == "[" or follower == "[":
        found, expected = "expressions ([...]) are not supported", "numbers"
        hint = "post the program without expressions"
    elif character in "@^":
        found, expected = f"polar coordinates ({character}) are not supported", "X, Y, Z words"
        hint = "post the program in Cartesian coordinates"
    elif character == "%":
        found, expected = "`%` among other words", "`%` alone on its line"
    return InputError(found, expected=expected, hint=hint, file=name, line=line, column=column)


def _through_pygcode(words: list[Word], line: int, name: str) -> tuple[Word, ...]:
    """Have pygcode read the normalised words; what it does not hand back exactly is an error."""
    if not words:
        return ()
    from pygcode.exceptions import GCodeWordStrError
    from pygcode.words import text2words

    try:
        read = list(text2words(" ".join([_plain(word) for word in words])))
    except GCodeWordStrError:
        read = []
    if len(read) == len(words):
        checked = [
            Word(word.letter, float(got.value), word.column, word.text)
            for word, got in zip(words, read, strict=True)
            if got.letter == word.letter and float(got.value) == word.value
        ]
        if len(checked) == len(words):
            return tuple(checked)
    for word in words:  # one at a time, to find the one that pygcode refuses
        try:
            (alone,) = text2words(_plain(word))
        except (GCodeWordStrError, ValueError):
            alone = None
        if alone is None or float(alone.value) != word.value:
            raise InputError(
                f"word {word.text!r} cannot be read",
                expected=_expected(word.letter),
                file=name,
                line=line,
                column=word.column,
            )
    return tuple(words)


def _plain(word: Word) -> str:
    """The word as pygcode can read it: no plus, no exponent, whole numbers where it wants them."""
    number = format(Decimal(repr(word.value)), "f")
    if number.endswith(".0"):
        number = number[:-2]
    return word.letter + number


def _expected(letter: str) -> str:
    if letter in "GM":
        return f"a code such as {letter}1 or {letter}59.3"
    if letter in "LTN":
        return "a whole number that is not negative"
    return "a decimal number"
