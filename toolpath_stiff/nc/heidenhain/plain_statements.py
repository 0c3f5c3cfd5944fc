"""Plain statements (L, CC and C with numbers alone) as G0 to G3, so that many are executed at a time (`plain_lines`).

Where the tool stands is followed as far as such statements say: steps become points, and arcs get I and J from it.
"""

import math
import re
from collections.abc import Sequence

from toolpath_stiff.nc.heidenhain.points import ON_CIRCLE_MM

_NUMBER = r"[+-]?\d{1,6}(?:\.\d{0,6})?"
PLAIN = re.compile(
    rf"\s*\d*\s*(?P<head>L|C)(?P<axes>(?:\s*I?[XYZ]{_NUMBER})+)(?:\s*DR(?P<turn>[+-]))?(?:\s*R0)?"
    r"(?:\s*F\s*(?:(?P<max>MAX)|(?P<feed>\d{1,6}(?:\.\d*)?)))?(?P<m>(?:\s*M0?(?:[345789]|1[34]))*)\s*(?:;.*)?",
    re.IGNORECASE,
)
CENTER = re.compile(rf"\s*\d*\s*CC\s*X\s*({_NUMBER})\s*Y\s*({_NUMBER})\s*(?:;.*)?", re.IGNORECASE)
AXIS = re.compile(rf"(I?)([XYZ])({_NUMBER})", re.IGNORECASE)
EMPTY = re.compile(r"\s*\d*\s*(?:[;*].*)?")
CORNER = re.compile(r"\s*/?\s*(?:N?\d+\s)?\s*(?:RND|CHF)\b", re.IGNORECASE)
INCH = re.compile(r"\s*(?:N?\d+\s+)?BEGIN\s+PGM\b.*\bINCH\s*(?:;.*)?$", re.IGNORECASE)


def in_inches(lines: Sequence[str]) -> bool:
    """Whether a program's BEGIN PGM says so."""
    return any(INCH.match(line) for line in lines[:100])


def corner_follows(lines: Sequence[str], row: int) -> bool:
    """Whether the next statement from a line on (from 0) is a corner (RND, CHF)."""
    while row < len(lines) and EMPTY.fullmatch(lines[row]):
        row += 1
    return row < len(lines) and CORNER.match(lines[row]) is not None


def as_g_code(lines: Sequence[str], to_corner: Sequence[bool]) -> tuple[list[str], dict[int, tuple[float, float]]]:
    """Plain statements as G code, "?", which no run of plain lines takes, for all others; circle centres by line.

    Examples
    --------
    >>> as_g_code(("L X+1 Y+0 F100", "CC X+2 Y+0", "C X+3 DR-", "L IX+1 FMAX", "M5"), [False] * 5)[0]
    ['G1X+1Y+0F100', '', 'G2X+3I1.000000000J0.000000000', 'G0X4.000000', '?']
    """
    texts, poles, here, center = list[str](), dict[int, tuple[float, float]](), dict[str, float](), None
    inch = in_inches(lines)
    for row, line in enumerate(lines):
        if EMPTY.fullmatch(line):
            texts.append("")
            continue
        text, plain, pole = "?", PLAIN.fullmatch(line), CENTER.fullmatch(line)
        if pole is not None:
            center = poles[row] = (float(pole[1]), float(pole[2]))
            text = ""
        elif plain is not None and (plain["head"] in "cC") == (plain["turn"] is not None):
            there, axes = _followed(here, plain["axes"].upper())
            code, middle = "G0" if plain["max"] else "G1", ""
            if plain["turn"]:
                code, middle = "G3" if plain["turn"] == "+" else "G2", _center_words(here, there, center)
            feed = plain["feed"] or ""
            slow = plain["m"] or (feed and (inch or not feed.strip("0."))) or (plain["turn"] and not middle)
            text, here = f"{code}{axes}{middle}{'F' if feed else ''}{feed}" if axes and not slow else "?", there
        else:
            here, center = {}, None
        texts.append("?" if to_corner[row] else text)
    return texts, poles


def _followed(here: dict[str, float], axes: str) -> tuple[dict[str, float], str]:
    """Where axis words lead as far as that is known, and the words as they name that point; none where it is not."""
    there, words = dict(here), dict[str, str]()
    for step, letter, digits in AXIS.findall(axes):
        if letter in words or (step and letter not in here):
            return {key: value for key, value in there.items() if key not in axes}, ""
        there[letter] = round(here[letter] + float(digits), 6) if step else float(digits)
        words[letter] = f"{there[letter]:.6f}" if step else digits
    return there, "".join(letter + words[letter] for letter in "XYZ" if letter in words)


def _center_words(here: dict[str, float], there: dict[str, float], center: tuple[float, float] | None) -> str:
    """I and J of an arc in the plane whose start and centre are known; "" where they are not, or do not fit."""
    if center is None or not here.keys() & there.keys() >= {"X", "Y"} or here.get("Z") != there.get("Z"):
        return ""
    (x, y), start, end = center, math.dist(center, (here["X"], here["Y"])), math.dist(center, (there["X"], there["Y"]))
    fits = min(start, end) > ON_CIRCLE_MM and abs(start - end) < ON_CIRCLE_MM / 2.0
    return f"I{x - here['X']:.9f}J{y - here['Y']:.9f}" if fits else ""
