"""Blocks in Siemens' language at another place: shifted, and turned about the tool axis Z.

Words of coordinates are written anew where they stand (X10, X=IC(10), X=AC(10), I=AC(10), A3=0.5), everything else of
a line stays. What cannot be written without running the program (parameters as coordinates, frames, polar words) is
refused by its line.
"""

import math
import re
from collections.abc import Sequence

from toolpath_stiff.nc.heidenhain.statements import code_text
from toolpath_stiff.nc.place import Place
from toolpath_stiff.rewriting.turn import Turn

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)"
WORD = re.compile(
    rf"(?<![A-Z\d_$\"])(?:([XYZIJ])({NUMBER})|([XYZIJ]|[AB]3)\s*=\s*(?:(IC|AC)\s*\(\s*)?({NUMBER})\s*(?(4)\)|))(?![\w.*/+-])"
)
COORDINATE = re.compile(r"(?<![A-Z\d_$])(?:[XYZIJ](?=[\d.+-]|\s*=)|[AB]3(?=\s*=))")
IN_MACHINE = re.compile(r"\b(?:SUPA|G153|G53)\b")
FIXED = re.compile(r"\b(?:A?(?:TRANS|ROT|SCALE|MIRROR)|CYCLE800|HOLES[12]|G11[012]|CIP|WORKPIECE|(?:AP|RP|AR)(?==))\b")
STRING = re.compile(r'"[^"]*"')
CYCLE = re.compile(r"\bCYCLE8\d+\b")
ROTARY = re.compile(r"(?<![A-Z\d_$])(?:[ABC](?!3\s*=)(?:[\d.+-]|\s*=)|G1[89]\b)")
FORGETS = re.compile(r"(?:^|\s)(?:[A-Z_]{2}\w*:|GOTO|IF\b|ELSE|END|FOR\b|WHILE|LOOP|REPEAT|RET\b|PROC\b|L\d)|%_N_")
HINT = "place it without --write, and set the offset that is printed"


def placed_lines(turn: Turn, lines: Sequence[str], name: str, unit: float, decimals: int) -> list[str]:
    """The lines of a program at its new place; `unit`: mm of its length unit. Raises `InputError` with the line."""
    if turn.turn[2, 2] != 1.0:
        raise Place(name, 1).fail("a placement that tilts the work", "a turn about the tool axis Z", HINT)
    written, here, absolute = list[str](), [math.nan, math.nan], True
    for row, line in enumerate(lines):
        text, place = STRING.sub(lambda quoted: " " * len(quoted[0]), code_text(line)), Place(name, row + 1)
        absolute = "G91" not in text and (absolute or "G90" in text)
        words = {} if text.startswith("%") else {_key(word, absolute): word for word in WORD.finditer(text)}
        fixed = FIXED.search(text) or (CYCLE.search(text) if abs(turn.shift[2]) >= unit * 10.0**-decimals else None)
        fixed = fixed or (ROTARY.search(text) if turn.turns else None)
        machine, starts = IN_MACHINE.search(text), [word.start() for word in words.values()]
        computed = any(word.start() not in starts for word in COORDINATE.finditer(text))
        if fixed is not None or (computed and not machine):
            problem = (
                f"{fixed[0].strip() if fixed else 'a computed coordinate'} cannot be written for another placement"
            )
            raise place.fail(problem, "numbers, G0 to G3 and CYCLE81 to CYCLE89", HINT)
        if FORGETS.search(text) or machine:
            here = [math.nan, math.nan]
        if words and not machine:
            values = {key: float(word[2] or word[5]) for key, word in words.items()}
            new, here = _placed(turn, values, here, unit, place)
            written.append(_edited(line, words, new, absolute, decimals))
        else:
            written.append(line)
    return written


def _key(word: re.Match[str], absolute: bool) -> str:
    """X of a point, IX of a step; I of a centre from the start, @I of a point; A3."""
    letter, form = word[1] or word[3], word[4]
    if letter in "IJ":
        return f"@{letter}" if form == "AC" else letter
    step = letter in "XYZ" and (form == "IC" or (form is None and not absolute))
    return f"I{letter}" if step else letter


def _placed(
    turn: Turn, values: dict[str, float], here: list[float], unit: float, place: Place
) -> tuple[dict[str, float], list[float]]:
    """The numbers of a block's words at the new place, and where X and Y then stand at the old one."""
    (a, b), (c, d) = turn.turn[:2, :2].tolist()
    shift, new = [v / unit for v in turn.shift.tolist()], dict[str, float]()
    steps = [values.get(f"I{key}", 0.0) for key in "XY"]
    there = [values.get(key, v + s) for key, v, s in zip("XY", here, steps, strict=True)]
    for pair in ("XY", ("@I", "@J")):
        given = [key for key in pair if key in values]
        point = there if pair == "XY" else [values.get(key, math.nan) for key in pair]
        if given and turn.turns:
            if any(map(math.isnan, point)):
                raise place.fail("one coordinate of a pair whose other one is not known", "both", HINT)
            x, y = point
            new |= {pair[0]: a * x + b * y + shift[0], pair[1]: c * x + d * y + shift[1]}
        else:
            new |= {key: values[key] + shift[pair.index(key)] for key in given}
    for pair in (("IX", "IY"), "IJ", ("A3", "B3")):
        if turn.turns and values.keys() & {*pair} and not (pair[0] == "IX" and "X" in new):
            x, y = (values.get(key, 0.0) for key in pair)
            new |= {pair[0]: a * x + b * y, pair[1]: c * x + d * y}
    if "Z" in values:
        new["Z"] = values["Z"] + shift[2]
    return new, there


def _edited(line: str, words: dict[str, re.Match[str]], new: dict[str, float], absolute: bool, decimals: int) -> str:
    """A line with other numbers in its words; words that it did not have stand behind the last one of these."""
    texts = dict[str, str]()
    for key, value in new.items():
        number = f"{value:.{decimals}f}".rstrip("0").rstrip(".") if decimals else f"{value:.0f}"
        number, letter = (
            "0" if number == "-0" else number,
            key.lstrip("@") if key in ("I", "J", "@I", "@J") else key[-1],
        )
        form = "AC" if key[0] == "@" or (key in ("X", "Y", "Z") and not absolute) else ""
        form = "IC" if key in ("IX", "IY") and absolute else form
        texts[key] = f"{key}={number}" if key[1:] == "3" else f"{letter}={form}({number})" if form else letter + number
    old = {key: next((word for kind in (key, f"I{key}") if (word := words.get(kind))), None) for key in texts}
    last = max(word.end() for word in words.values())
    line = line[:last] + "".join(f" {texts[key]}" for key, word in old.items() if word is None) + line[last:]
    for key, word in sorted(old.items(), key=lambda item: -(item[1].start() if item[1] else 0)):
        if word is not None:
            line = line[: word.start()] + texts[key] + line[word.end() :]
    return line
