"""A program in Heidenhain's plain language written for another placement: shifted, and turned about the tool axis Z.

Coordinates are rewritten where they stand, everything else of a line stays. What cannot be written without knowing where
the run comes from (a coordinate alone in a turned program, behind a label) is refused by its line. mm or inch as written.
"""

import math
from collections.abc import Sequence

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.heidenhain.statements import Statement, read_statement
from toolpath_stiff.nc.place import Place
from toolpath_stiff.rewriting.turn import Turn
from toolpath_stiff.units import MM_PER_INCH

PLACED = ("L", "LN", "C", "CR", "CT", "CC", "LP", "CP", "APPR LT", "APPR LN", "APPR CT", "APPR LCT", "DEP LCT")
# What stays as it stands: what has no coordinates, or those of the machine or of the control.
KEPT = ("", "BEGIN PGM", "END PGM", "BLK FORM 0.1", "BLK FORM 0.2", "TOOL CALL", "TOOL DEF", "STOP", "M", "RND", "CHF",
        "LBL", "CALL LBL", "CYCL CALL", "DEP LT", "DEP LN", "DEP CT", "CYCL DEF 9.0", "CYCL DEF 9.1", "CYCL DEF 32.0",
        "CYCL DEF 32.1", "CYCL DEF 32.2", "FUNCTION MODE", "FN0", "FN1", "FN2", "FN3", "FN4")  # fmt: skip
BY_DEPTH = tuple(f"CYCL DEF {number}" for number in (200, 201, 202, 203, 205, 206, 207, 209, 240))
FORGETS = (
    "LBL",
    "CALL LBL",
    "DEP LT",
    "DEP LN",
    "DEP CT",
    "LP",
    "CP",
)  # after which X and Y are not known from the text
UNKNOWN = math.nan


class PlacedLanguage:
    """Rewrites the statements of a program one after another.

    Parameters
    ----------
    turn
        The rigid motion of the work.
    decimals
        Of the numbers written; None: 4 in mm, 5 in inch.
    """

    def __init__(self, turn: Turn, lines: Sequence[str], name: str, decimals: int | None) -> None:
        self.lines, self.name = lines, name
        inch = any(" INCH" in line.upper() for line in lines[:100] if "BEGIN PGM" in line.upper())
        self.unit = MM_PER_INCH if inch else 1.0
        self.decimals = decimals if decimals is not None else 5 if inch else 4
        self.turn = turn.turn.tolist()
        self.shift = [float(v) / self.unit for v in turn.shift]
        self.turns = turn.turns
        self.angle = math.degrees(math.atan2(self.turn[1][0], self.turn[0][0]))
        self.here = [UNKNOWN, UNKNOWN]

    def write(self) -> list[str]:
        """The lines of the program at its new place. Raises `InputError` with the line of what cannot be written."""
        if self.turn[2][2] != 1.0:
            raise self._fail(1, "a placement that tilts the work", "a turn about the tool axis Z")
        written, row = list[str](), 0
        while row < len(self.lines):
            statement = read_statement(self.lines, row, self.name)
            line = self.lines[row]
            if statement.head in PLACED:
                line = self._placed(statement, line)
            elif statement.head not in KEPT and not statement.head.startswith("Q"):
                lifted = statement.head in BY_DEPTH and abs(self.shift[2]) < 10.0**-self.decimals
                if not lifted:
                    raise self._fail(
                        row + 1, f"{statement.head} cannot be written for another placement", "L, CC, C, CR, CT"
                    )
            if statement.head in FORGETS:
                self.here = [UNKNOWN, UNKNOWN]
            written += [line, *self.lines[row + 1 : statement.after]]
            row = statement.after
        return written

    def _fail(self, line: int, problem: str, expected: str) -> InputError:
        hint = "place it without --write, and set the datum that is printed"
        return Place(self.name, line).fail(problem, expected, hint)

    def _placed(self, statement: Statement, line: str) -> str:
        words = {key: (written, column, text) for key, written, column, text in statement.words}
        if "M91" in words or "M92" in words:
            self.here = [UNKNOWN if letter in words else v for letter, v in zip("XY", self.here, strict=True)]
            return line
        leaning = [key for key in (*"ABC", "IA", "IB", "IC", "TX", "NX") if key in words and self.turns]
        if leaning or any("Q" in words[key][0] for key in ("X", "Y", "Z", "PA") if key in words):
            raise self._fail(
                statement.line, f"{statement.head} with rotary axes or Q parameters as coordinates", "numbers"
            )
        values = {
            key: float(words[key][0]) for key in ("X", "Y", "Z", "IX", "IY", "PA") if key in words and words[key][0]
        }
        new = dict[str, float]()
        if {"X", "Y"} & values.keys():
            there = [values.get(key, v) + 0.0 for key, v in zip("XY", self.here, strict=True)]
            if self.turns and (any(map(math.isnan, there)) or {"IX", "IY"} & values.keys()):
                raise self._fail(statement.line, f"{statement.head} with one coordinate of X and Y", "both")
            named = "XY" if self.turns else [key for key in "XY" if key in values]
            for axis, key in enumerate("XY"):
                if key in named:
                    turned = sum(self.turn[axis][i] * there[i] for i in range(2)) if self.turns else there[axis]
                    new[key] = turned + self.shift[axis]
            self.here = there if statement.head != "CC" else self.here
        elif {"IX", "IY"} & values.keys():
            step = [values.get("IX", 0.0), values.get("IY", 0.0)]
            if self.turns:
                new = {f"I{key}": sum(self.turn[axis][i] * step[i] for i in range(2)) for axis, key in enumerate("XY")}
            self.here = [v + s for v, s in zip(self.here, step, strict=True)] if statement.head != "CC" else self.here
        if "Z" in values:
            new["Z"] = values["Z"] + self.shift[2]
        if "PA" in values:
            new["PA"] = values["PA"] + self.angle
        return self._edited(line, words, new)

    def _edited(self, line: str, words: dict[str, tuple[str, int, str]], new: dict[str, float]) -> str:
        """The line with other numbers in its words, and with words that it did not have behind them."""
        last = max((words[key][1] - 1 + len(words[key][2]) for key in new if key in words), default=len(line))
        added = "".join(
            f" {key}{self._number(value)}" for key, value in new.items() if key not in words and key[0] != "P"
        )
        line = line[:last] + added + line[last:]
        for key in sorted((key for key in new if key in words), key=lambda key: -words[key][1]):
            _, column, text = words[key]
            line = f"{line[: column - 1]}{key}{self._number(new[key])}{line[column - 1 + len(text) :]}"
        return line

    def _number(self, value: float) -> str:
        text = f"{value:+.{self.decimals}f}".rstrip("0").rstrip(".")
        return text if text.strip("+-0.") else "+0"
