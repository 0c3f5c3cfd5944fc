"""Plain straight statements (L with X, Y, Z, F) as G0 and G1, so that many are executed at a time (`plain_lines`)."""

import re
from collections.abc import Sequence

PLAIN = re.compile(
    r"\s*\d*\s*L((?:\s*[XYZ][+-]?\d{1,6}(?:\.\d{0,6})?)+)(?:\s*R0)?"
    r"(?:\s*F\s*(?:(MAX)|(\d{0,5}[1-9]\d{0,5}(?:\.\d*)?)))?\s*(?:;.*)?",
    re.IGNORECASE,
)
EMPTY = re.compile(r"\s*\d*\s*(?:[;*%].*)?")
CORNER = re.compile(r"[\s/\dN]*(?:RND|CHF)\b", re.IGNORECASE)
INCH = re.compile(r"\s*(?:N?\d+\s+)?BEGIN\s+PGM\b.*\bINCH\s*(?:;.*)?$", re.IGNORECASE)


def in_inches(lines: Sequence[str]) -> bool:
    """True if a program's BEGIN PGM states inches."""
    return any(INCH.match(line) for line in lines[:100])


def corner_follows(lines: Sequence[str], row: int) -> bool:
    """True if the next statement from a line on (from 0) is a corner (RND, CHF)."""
    while row < len(lines) and not CORNER.match(lines[row]):
        if not EMPTY.fullmatch(lines[row]):
            return False
        row += 1
    return row < len(lines)


def as_g_code(lines: Sequence[str]) -> list[str]:
    """Plain statements as G code; "?", which plain lines do not include, for all others and for the last of a run.

    Examples
    --------
    >>> as_g_code(("L X+1 Y+0 F100", "", "L IX+1 FMAX", "L X2", "L Y1 FMAX", "L Z5 M5"))
    ['?', '', '?', 'G1 X2', '?', '?']
    """
    texts, follows, inch = list[str](), False, in_inches(lines)
    for line in reversed(lines):
        plain = PLAIN.fullmatch(line)
        if plain is None:
            follows = follows and EMPTY.fullmatch(line) is not None
            texts.append("" if EMPTY.fullmatch(line) else "?")
            continue
        axes, rapid, feed = plain.groups(default="")
        texts.append(f"G{'0' if rapid else '1'}{axes}{feed and f'F{feed}'}" if follows and not (feed and inch) else "?")
        follows = True
    return texts[::-1]
