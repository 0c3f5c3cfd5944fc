"""Lexer of plain lines, many at a time (`plain_lines`): array arithmetic over the characters of a chunk.

Lines of words alone are most of a program. A character is a digit, a point, a sign, a letter or the end of a line; a
word reaches from its letter to the next one, and its number is its digits as a whole number over a power of ten. Both
are exact up to 15 digits, so that their quotient is rounded once, as `float` rounds (Clinger, "How to read floating
point numbers accurately", 1990). A line with a comment, a longer number or anything else is not plain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.nc.geometry import CENTER_LETTERS
from toolpath_stiff.nc.words import AXES

ByteArray = NDArray[np.uint8]

LETTERS = AXES + CENTER_LETTERS
# Keys of the columns of words, in the order in which a plain line has them: that of every CAM system, F in front or
# behind, S last.
FIRST_F, LAST_F = "F in front", "F behind"
KEYS = ("N", "G", FIRST_F, *LETTERS, LAST_F, "S")
NO_CODE = -1  # the code of a line without a G word
NONE, BARE, POINTED, BROKEN = range(4)  # form of a number: none, without a point, ending with it, with decimals

_POINT, _SIGN, _LETTER, _END, _OTHER = range(1, 6)
MOST_DIGITS = 15
_TENS = 10.0 ** np.arange(MOST_DIGITS + 1)  # exact
_BEFORE = b"0" * 16  # so that 16 characters stand before any place in the text
_MASKS = np.array([0x0F0F0F0F0F0F0F0F & ~((1 << 8 * (8 - n)) - 1) for n in range(9)], dtype=np.uint64)  # n digits
_SHIFTS = np.arange(0, 72, 8, dtype=np.uint64)  # past n digits
_PAIRS, _EVEN, _ODD = np.uint64(0x000000FF000000FF), np.uint64(100 + (1000000 << 32)), np.uint64(1 + (10000 << 32))
_FEED_RANK = KEYS.index(FIRST_F)


def _tables() -> tuple[ByteArray, NDArray[np.int8]]:
    """Class and rank (place in `KEYS`; -1 for none) of each byte; lower-case letters count as upper-case ones."""
    kinds, ranks = np.full(256, _OTHER, dtype=np.uint8), np.full(256, -1, dtype=np.int8)
    kinds[ord(".")], kinds[ord("\n")] = _POINT, _END
    kinds[[ord("+"), ord("-")]] = _SIGN
    for rank, key in enumerate(KEYS):
        if key != LAST_F:
            for letter in (key[0], key[0].lower()):
                kinds[ord(letter)], ranks[ord(letter)] = _LETTER, rank
    return kinds, ranks


_KINDS, _RANKS = _tables()


@dataclass(frozen=True)
class PlainWords:
    """Words of n plain lines in columns.

    `code` (n,) is the digit of the G word or `NO_CODE`; `count` (n,) how many words there are besides N. `values` has
    for each of `KEYS` after G that any line has the number (n,), nan where there is none, `forms` how it is written.
    """

    code: IntArray
    count: IntArray
    values: dict[str, FloatArray]
    forms: dict[str, ByteArray]

    def part(self, start: int, end: int) -> PlainWords:
        """The lines from `start` to `end`, with only the columns in which they have words."""
        forms = {key: form[start:end] for key, form in self.forms.items()}
        forms = {key: form for key, form in forms.items() if form.any()}
        values = {key: self.values[key][start:end] for key in forms}
        return PlainWords(self.code[start:end], self.count[start:end], values, forms)


def lex(lines: Sequence[str]) -> tuple[PlainWords, IntArray]:
    """The words of lines, and the lines (from 0) that are not plain."""
    characters = "\n".join(lines).replace(";\n", "\n").encode("ascii", "replace").translate(None, b" \t")
    buffer = b"%b\n%b\n" % (_BEFORE, characters)
    codes = np.frombuffer(buffer, dtype=np.uint8)
    marks = np.flatnonzero(codes - np.uint8(ord("0")) > 9)  # all characters but digits
    kinds = np.append(_KINDS[codes[marks]], np.array([_END, _END], dtype=np.uint8))
    first = np.flatnonzero(kinds[:-2] >= _LETTER)  # start of a word, end of a line, or a character that is neither
    following = np.append(first[1:], len(marks))
    begin, kind = marks[first], kinds[first]
    end = np.append(begin[1:], len(codes))
    is_end = kind == _END
    line = np.cumsum(is_end) - 1
    signed = kinds[first + 1] == _SIGN
    pointed = kinds[first + 1 + signed] == _POINT
    last = first + signed + pointed
    sign, point = marks.take(first + 1, mode="clip"), np.where(pointed, marks.take(last, mode="clip"), end)
    digits, decimals = end - begin - 1 - (last - first), end - point - pointed
    rank = _RANKS[codes[begin]].astype(np.int64)
    feeds = np.flatnonzero(rank == _FEED_RANK)  # in front if at most N and G stand before it
    rank[feeds[(rank[feeds - 1] >= _FEED_RANK) & (kind[feeds - 1] == _LETTER)]] = KEYS.index(LAST_F)
    unsigned = (rank < _FEED_RANK + 1) | (rank >= len(KEYS) - 2)
    bad = (digits < 1) | (digits > MOST_DIGITS) | (unsigned & signed) | ((rank < _FEED_RANK) & pointed)
    bad |= (signed & (sign > begin + 1)) | (following > last + 1)  # signs misplaced, or too many
    bad[1:] |= rank[1:] <= rank[:-1]
    bad |= kind == _OTHER
    bad[is_end] = (end > begin + 1)[is_end]  # numbers without a letter
    value = _values(buffer, point, end, digits, decimals)
    value[codes[sign] == ord("-")] *= -1.0
    bad |= (rank == KEYS.index("G")) & ((digits > 2) | (value > 3.0))
    odd = np.zeros(len(lines) + 1, dtype=bool)
    odd[line[bad]] = True
    kept = ~is_end & ~odd[line]
    form = np.where(pointed, np.where(decimals == 0, POINTED, BROKEN), BARE).astype(np.uint8)
    return _in_columns(len(lines), line[kept], rank[kept], value[kept], form[kept]), np.flatnonzero(odd)


def _values(buffer: bytes, point: IntArray, end: IntArray, digits: IntArray, decimals: IntArray) -> FloatArray:
    """The unsigned numbers of words of up to `MOST_DIGITS` digits: `decimals` of these before `end`.

    Eight characters are one word of 64 bits, whose digits add up by pairs, fours and eights: three multiplications.
    Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51 (2021) 1700.
    """
    eights = np.ndarray(len(buffer) - 7, dtype="<u8", buffer=buffer, strides=(1,))  # the eight bytes from each place on
    bits = eights[end - 8] & _MASKS.take(decimals, mode="clip")
    bits |= (eights[point - 8] & _MASKS.take(digits - decimals, mode="clip")) >> _SHIFTS.take(decimals, mode="clip")
    mantissa = _sum_of_digits(bits)
    longer = np.flatnonzero((digits > 8) & (digits <= MOST_DIGITS))
    if len(longer):
        after = decimals[longer]
        places = ((point[longer], digits[longer] - after), (end[longer], after))
        before, behind = (
            1e8 * _sum_of_digits(eights[place - 16] & _MASKS.take(count - 8, mode="clip"))
            + _sum_of_digits(eights[place - 8] & _MASKS.take(count, mode="clip"))
            for place, count in places
        )
        mantissa[longer] = before * _TENS[after] + behind
    return np.asarray(mantissa / _TENS.take(decimals, mode="clip"))


def _sum_of_digits(bits: NDArray[np.uint64]) -> FloatArray:
    """The whole number that each group of eight digits makes, last digit in the highest byte, zero bytes in front."""
    pairs = bits * 10 + (bits >> 8)
    return np.asarray((((pairs & _PAIRS) * _EVEN + ((pairs >> 16) & _PAIRS) * _ODD) >> 32).astype(np.float64))


def _in_columns(n: int, line: IntArray, rank: IntArray, value: FloatArray, form: ByteArray) -> PlainWords:
    """Words of n lines in columns."""
    code = np.full(n, NO_CODE, dtype=np.int64)
    values, forms = dict[str, FloatArray](), dict[str, ByteArray]()
    for place in np.flatnonzero(np.bincount(rank, minlength=len(KEYS))).tolist():
        words = np.flatnonzero(rank == place)
        key, into = KEYS[place], line[words]
        if key == "G":
            code[into] = value[words]
        elif key != "N":
            values[key], forms[key] = np.full(n, np.nan), np.full(n, NONE, dtype=np.uint8)
            values[key][into], forms[key][into] = value[words], form[words]
    return PlainWords(code, np.bincount(line[rank > 0], minlength=n), values, forms)
