"""A program in Heidenhain's plain language written for another placement: shifted, and turned about the tool axis Z.

Coordinates are rewritten where they stand, everything else of a line stays. What cannot be written without knowing
where the run comes from (a coordinate alone in a turned program, behind a label) is refused by its line.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.heidenhain.plain_statements import in_inches
from toolpath_stiff.nc.heidenhain.statements import PlainStatement, read_statement
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.moves import RAPID, ReadProgram
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.reader import read
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.words import Word
from toolpath_stiff.rewriting import siemens_blocks
from toolpath_stiff.rewriting.controls import DECIMALS_INCH, DECIMALS_MM
from toolpath_stiff.rewriting.turn import Turn
from toolpath_stiff.units import MM_PER_INCH, mm_from_m

PLACED = ("L", "LN", "C", "CR", "CT", "CC", "LP", "CP", "APPR LT", "APPR LN", "APPR CT", "APPR LCT", "DEP LCT")
# What stays as it stands: what has no coordinates, or those of the machine or of the control.
KEPT = ("", "BEGIN PGM", "END PGM", "BLK FORM 0.1", "BLK FORM 0.2", "TOOL CALL", "TOOL DEF", "STOP", "M", "RND", "CHF",
        "LBL", "CALL LBL", "CYCL CALL", "DEP LT", "DEP LN", "DEP CT", "CYCL DEF 9.0", "CYCL DEF 9.1", "CYCL DEF 32.0",
        "CYCL DEF 32.1", "CYCL DEF 32.2", "FUNCTION MODE", "FN0", "FN1", "FN2", "FN3", "FN4")  # fmt: skip
DRILLING = tuple(f"CYCL DEF {number}" for number in (200, 201, 202, 203, 205, 206, 207, 209, 240))  # at a height
FORGETS = ("LBL", "CALL LBL", "DEP LT", "DEP LN", "DEP CT", "LP", "CP")  # after which X and Y are not known
COORDINATES = ("X", "Y", "Z", "IX", "IY", "PA")
INCH = re.compile(r"\bG70{1,2}\b")
MOST_ROUNDINGS = 100  # by which rounded numbers of a path of steps may add up
HINT = "place it without --write, and set the datum that is printed"


def write_placed(program: ReadProgram, text: str, turn: Turn, decimals: int | None, control: Controller) -> str:
    """Heidenhain's or Siemens' text at its new place, read again: refused where the path is not the placed one."""
    siemens = program.dialect == "siemens"
    lines, inch = split_lines(text, program.name), (INCH.search(text) if siemens else in_inches(program.source))
    unit, usual = (MM_PER_INCH, DECIMALS_INCH) if inch else (1.0, DECIMALS_MM)
    decimals = usual if decimals is None else decimals
    write = siemens_blocks.placed_lines if siemens else placed_lines
    placed = write(turn, lines, program.name, unit, decimals)
    control = replace(control, dialect=DIALECTS[program.dialect])
    again, moves = read(Request(tuple(placed), program.name, controller=control)).moves, program.moves
    if len(again) != len(moves):  # a turned tool axis may take other parts to a move
        again, moves = (m.take(np.append(np.diff(m.line) != 0, True)) for m in (again, moves))
    wrong = np.zeros(1, dtype=int)
    if np.array_equal(again.motion, moves.motion):
        ends = np.array([turn.point(mm_from_m(end[:3]).tolist()) for end in moves.end])
        off = np.abs(mm_from_m(again.end[:, :3]) - ends).max(axis=1)
        wrong = np.flatnonzero((moves.motion != RAPID) & (off > MOST_ROUNDINGS * unit * 10.0**-decimals))
    if len(wrong):
        problem = "the program written for the placement would go another way"
        raise Place(program.name, int(moves.line[wrong[0]])).fail(problem, hint="place it without --write")
    return ("\r\n" if "\r\n" in text else "\n").join([*placed, ""])


def placed_lines(turn: Turn, lines: Sequence[str], name: str, unit: float, decimals: int) -> list[str]:
    """The lines of a program at its new place; `unit`: mm of its length unit. Raises `InputError` with the line."""
    if turn.turn[2, 2] != 1.0:
        raise Place(name, 1).fail("a placement that tilts the work", "a turn about the tool axis Z", HINT)
    written, row, here = list[str](), 0, [math.nan, math.nan]
    while row < len(lines):
        statement, line = read_statement(lines, row, name), lines[row]
        if statement.head in PLACED:
            words = {word.letter: word for word in statement.words}
            new, here = _placed(turn, statement, words, here, unit, name)
            line = _edited(line, words, new, decimals)
        elif statement.head not in KEPT and statement.head[0] != "Q":
            level = statement.head in DRILLING and abs(turn.shift[2]) < unit * 10.0**-decimals
            if not level:
                problem = f"{statement.head} cannot be written for another placement"
                raise Place(name, row + 1).fail(problem, "L, CC, C, CR, CT and what has no coordinates", HINT)
        here = [math.nan, math.nan] if statement.head in FORGETS else here
        written += [line, *lines[row + 1 : statement.after]]
        row = statement.after
    return written


def _placed(
    turn: Turn,
    statement: PlainStatement,
    words: dict[str, Word],
    here: list[float],
    unit: float,
    name: str,
) -> tuple[dict[str, float], list[float]]:
    """The numbers of a statement's words at the new place; where X and Y then stand at the old one."""
    place, head = Place(name, statement.line), statement.head
    if "M91" in words or "M92" in words:
        return {}, [math.nan if key in words else v for key, v in zip("XY", here, strict=True)]
    leaning = turn.turns and words.keys() & {"A", "B", "C", "IA", "IB", "IC", "TX", "NX"}
    if leaning or any(statement.words[place].letter in COORDINATES for place in statement.computed):
        raise place.fail(f"{head} with rotary axes or Q parameters as coordinates", "numbers", HINT)
    values = {str(key): words[key].value for key in COORDINATES if key in words}
    rows, shift, new = turn.turn[:2, :2].tolist(), [v / unit for v in turn.shift.tolist()], dict[str, float]()
    steps = [values.get(f"I{key}", 0.0) for key in "XY"]
    there = [values[key] if key in values else v + s for key, v, s in zip("XY", here, steps, strict=True)]
    turned = [sum(a * v for a, v in zip(row, there, strict=True)) for row in rows]
    if turn.turns and {"X", "Y"} & values.keys():
        if any(map(math.isnan, turned)) or any(steps):
            raise place.fail(f"{head} with one coordinate of X and Y, whose other one is not known", "both", HINT)
        new = {key: v + s for key, v, s in zip("XY", turned, shift[:2], strict=True)}
    elif turn.turns and any(steps):
        new = {
            f"I{key}": sum(a * v for a, v in zip(row, steps, strict=True)) for key, row in zip("XY", rows, strict=True)
        }
    else:
        new = {key: values[key] + shift["XY".index(key)] for key in "XY" if key in values}
    if "Z" in values:
        new["Z"] = values["Z"] + shift[2]
    if "PA" in values:
        new["PA"] = values["PA"] + math.degrees(math.atan2(rows[1][0], rows[0][0]))
    return new, here if head == "CC" else there


def _edited(line: str, words: dict[str, Word], new: dict[str, float], decimals: int) -> str:
    """A line with other numbers in its words; words that it did not have stand behind the last one of these."""
    texts = dict[str, str]()
    for key, value in new.items():
        digits = f"{value:+.{decimals}f}".rstrip("0").rstrip(".") if decimals else f"{value:+.0f}"
        texts[key] = key + (digits if digits.strip("+-0.") else "+0")
    last = max((words[key].column - 1 + len(words[key].text) for key in new if key in words), default=len(line))
    line = line[:last] + "".join(f" {text}" for key, text in texts.items() if key not in words) + line[last:]
    for word in sorted((words[key] for key in new if key in words), key=lambda word: -word.column):
        line = line[: word.column - 1] + texts[word.letter] + line[word.column - 1 + len(word.text) :]
    return line
