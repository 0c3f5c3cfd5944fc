"""Lexer: lines to blocks, blocks to words. The only module that knows pygcode.

pygcode 0.2.1 (unmaintained since 2017) fails on comments of both styles in one line, on `X+1` and on spaces inside
words, drops the E of `1.5E2`, and ignores what it does not know. So comments, spaces, signs, exponents and N words are
handled before it is called, each word keeps its true column, and every word that pygcode does not return is an error.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import NamedTuple

from pygcode.exceptions import GCodeWordStrError
from pygcode.words import text2words

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.place import Place

NUMBER = r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)"  # possessive: an attempt that fails does not try shorter numbers
# ASCII digits alone: the digits of other scripts are not numbers to any control.
WORD = re.compile(rf"([A-Z]|,[CR])({NUMBER})(E[+-]?\d++)?", re.ASCII)
AXES = "XYZABC"
CORNERS = (",C", ",R")  # chamfer and rounding of the corner to the next block (Fanuc, Haas)
LETTERS = frozenset((*"ABCDEFGHIJKLMNPQRSTUVWXYZ", *CORNERS))
COMMENT = re.compile("[();]")
EXPRESSION = re.compile(r"[#\[]")
NO_EXPONENT = frozenset("GMNT")  # `M67E1` is two words
# A longer line is no block.
LONGEST_BLOCK = 2_000  # characters without comments and blanks; LinuxCNC reads 255
MOST_DIGITS = 9  # in a program number, its O included
NAMED_TAPE = re.compile(r"%[^,%();]{1,24},[-MX]+,?", re.ASCII)  # `%name,MX--,` begins a program (Fagor 8055)
# Marlin's texts to the operator: M117 Milling, M0 Attach the probe.
MESSAGE = re.compile(r"(\s*(?:N\d+\s*)?M0*(?:117|118|0|1))\s+[A-Z\"']{2}", re.IGNORECASE)
HAS_E_WORD = re.compile(r"M0*6[678](?![\d.])", re.ASCII)  # analog inputs and outputs, numbered by E


class Word(NamedTuple):
    """One word: letter, value, column (from 1) and its text as written."""

    letter: str
    value: float
    column: int
    text: str


@dataclass(frozen=True)
class Block:
    """One line of a program, split into words.

    `optional`: it begins with the block-delete slash; `switch`: the number of the slash, 1 to 9 (`/` is `/1`).
    `percent`: it holds the tape mark alone. `rest`: where a slash stands in the middle, the number of words before it;
    those behind it are left out where its switch is on (Fanuc, Haas).
    """

    line: int
    words: tuple[Word, ...]
    optional: bool = False
    percent: bool = False
    switch: int = 1
    rest: int | None = None


def read_block(text: str, line: int, name: str, semicolon: bool = True) -> Block:
    """Read the words of one line. Raises `InputError` with line and column.

    `semicolon`: whether `;` begins a comment; else it ends the block, and nothing but blanks may follow it.

    Examples
    --------
    >>> block = read_block("N10 G01 X 1.5 (to the edge) Y-2", 1, "part.nc")
    >>> [(word.letter, word.value, word.column) for word in block.words]
    [('G', 1.0, 5), ('X', 1.5, 9), ('Y', -2.0, 29)]
    """
    place = Place(name, line)
    message = MESSAGE.match(text)
    compact, columns = without_comments(message[1] if message else text, place, semicolon)
    if not compact:
        return Block(line, ())
    if compact == "%" or NAMED_TAPE.fullmatch(compact):
        return Block(line, (), percent=True)
    if compact[0] == "$" and "=" in compact:
        return Block(line, (Word("$", 0.0, columns[0], text.strip()),))
    if len(compact) > LONGEST_BLOCK:
        raise place.fail(f"a block of {len(compact)} characters without comments", f"at most {LONGEST_BLOCK}")
    slash, start, rest, switch = compact.find("/"), 0, None, 1
    if slash > 0 and EXPRESSION.search(compact):  # a quotient
        slash = -1
    if slash >= 0:
        behind, switch = block_delete(compact, slash, columns, place)
        start = 0 if slash else behind
    if compact.startswith(("O", ":"), start):  # `:` is O on ISO tape
        return program_number(compact[start:], columns[start], place)
    words = _tokens(compact, columns, start, text, place, slash if slash > 0 else None)
    if slash > 0:
        rest = len(words)
        words += _tokens(compact, columns, behind, text, place)
    through_pygcode(words, place)
    return Block(line, tuple(words), optional=slash == 0, switch=switch, rest=rest)


def block_delete(compact: str, slash: int, columns: Sequence[int], place: Place) -> tuple[int, int]:
    """The end of a block-delete slash and its number, and the switch that it names."""
    end = slash + 1
    while end < len(compact) and "0" <= compact[end] <= "9":
        end += 1
    switch = int(compact[slash + 1 : end] or 1) if end < slash + 3 else 0
    if not 1 <= switch <= 9:
        raise place.fail(
            f"block-delete switch {compact[slash : min(end, slash + 20)]!r}", "/ or /1 to /9", column=columns[slash]
        )
    return end, switch


def program_number(compact: str, column: int, place: Place) -> Block:
    """The block of a program number: `O1234` alone; any other O word controls subprograms or loops."""
    if compact[1:].isascii() and compact[1:].isdigit():
        if len(compact) > MOST_DIGITS:
            raise place.fail(f"a program number of {len(compact) - 1} digits", "O and up to 8 digits", column=column)
        return Block(place.line, (Word("O", float(compact[1:]), column, compact),))
    problem = f"O word {compact[:20]!r}: subprograms and loops are not supported"
    hint = "expand it before analyzing (the control or the post can do it), or give --interpreter linuxcnc"
    raise place.fail(problem, "plain moves", hint, column)


def without_comments(text: str, place: Place, semicolon: bool) -> tuple[str, Sequence[int]]:
    """Upper-case text without comments and blanks, and the column of each of its characters."""
    if text.isascii() and not COMMENT.search(text):  # shortcut for the bulk of a big program
        compact = "".join(text.split()).upper()
        if len(compact) == len(text):
            return compact, range(1, len(text) + 1)
        return compact, [column for column, character in enumerate(text, 1) if not character.isspace()]
    characters: list[str] = []
    columns: list[int] = []
    depth = begun = 0
    for column, character in enumerate(text, 1):
        if character == "(":  # Haas' controls have comments within comments
            begun = begun if depth else column
            depth += 1
        elif depth:
            depth -= character == ")"
        elif character == ";":
            if not semicolon and without_comments(text[column:].replace(";", " "), place, semicolon)[0]:
                problem = f"{text[column:].strip()[:20]!r} after `;`, which ends the block in this dialect"
                raise place.fail(problem, "comments in parentheses, one block a line", column=column)
            break
        elif character == ")":
            raise place.fail("`)` without `(`", column=column)
        elif not character.isspace() and character != "\ufeff":
            # Some letters of other scripts get longer in upper case, and some become ASCII letters.
            characters.append(character.upper() if character.isascii() else character)
            columns.append(column)
    if depth:
        raise place.fail("a comment is not closed", "`)` on the same line", column=begun)
    return "".join(characters), columns


def _tokens(
    compact: str, columns: Sequence[int], start: int, text: str, place: Place, stop: int | None = None
) -> list[Word]:
    """Words of the compacted text; N words are checked and left out."""
    words: list[Word] = []
    position = start
    stop = len(compact) if stop is None else stop
    while position < stop:
        match = WORD.match(compact, position, stop)
        column = columns[position]
        if match is None:
            raise _unreadable(compact, position, column, place)
        letter, number, exponent = match.groups()
        end = match.end()
        if exponent:
            # An exponent has no blanks before it; `X1 E5` is two words, not a hundred metres.
            begin = match.start(3)
            if letter in NO_EXPONENT or (columns[begin] - columns[begin - 1] > 1) or HAS_E_WORD.search(compact):
                end = begin
            else:
                number += exponent
        original = text[column - 1 : columns[end - 1]]
        position, value = end, float(number)
        if letter not in LETTERS:
            raise place.fail(f"word {original!r} is not known", column=column)
        if not math.isfinite(value):
            raise place.fail(f"{original!r} is not a finite number", column=column)
        if letter == "T" and value != int(value):  # Fagor's T1.2: tool 1 with offset 2
            offset = float(number.partition(".")[2])
            words += [Word("T", float(int(value)), column, original), Word("D", offset, column, original)]
        elif letter != "N":
            words.append(Word(letter, value, column, original))
        elif words:
            raise place.fail(
                f"line number {original!r} after another word", "N at the beginning of the line", column=column
            )
    return words


def _unreadable(compact: str, position: int, column: int, place: Place) -> InputError:
    """The error for text that is no word."""
    character, follower = compact[position], compact[position + 1 : position + 3].lstrip("+-")[:1]
    if character == "%":
        return place.fail("`%` among other words", "`%` alone on its line", "take the name behind it away", column)
    if character in "@^":
        hint = "X and Y, or --interpreter linuxcnc"
        raise place.fail(f"{compact[position : position + 12]!r} is a polar word of LinuxCNC's", "", hint, column)
    if character in LETTERS and (not follower or follower in LETTERS or follower == "/"):
        return place.fail(f"the word {character!r} has no number", f"a number after {character}", column=column)
    return place.fail(f"{compact[position : position + 12]!r} is not a word", "a letter and a number", column=column)


def through_pygcode(words: Sequence[Word], place: Place) -> None:
    """Let pygcode read the normalised words; raise an error for any that it does not return exactly."""
    known = [word for word in words if word.letter not in CORNERS]
    returned: list[tuple[str, float]] = []
    try:
        for word in text2words(" ".join([_plain(word) for word in known])):
            returned.append((word.letter, float(word.value)))
    except (GCodeWordStrError, ValueError):
        returned.append(("", math.nan))
    for word, read in zip(known, [*returned, ("", math.nan)], strict=False):
        if read != (word.letter, word.value):
            code = f"a code such as {word.letter}1 or {word.letter}59.3"
            expected = code if word.letter in "GM" else "a whole number that is not negative"
            raise place.fail(f"word {word.text!r} cannot be read", expected, column=word.column)


def _plain(word: Word) -> str:
    """The word in a form that pygcode can read: no plus, no exponent, whole numbers where it requires them."""
    number = repr(word.value)
    if "e" in number:
        number = format(Decimal(number), "f")
    return word.letter + number.removesuffix(".0")
