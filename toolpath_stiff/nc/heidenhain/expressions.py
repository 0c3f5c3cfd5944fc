"""Q parameters: formulas (`Q5 = 3 * (SIN Q1 - 2)`) and the functions FN 0 to FN 13, evaluated by one grammar.

HEIDENHAIN, user's manual of the iTNC 530, "Programming: Q parameters" ("Basic arithmetic", "Trigonometric functions",
"Entering formulas directly"). Functions bind tightest, then ^, * and / (DIV), + and -; LEN is the root of the sum of
two squares, ANG the angle of two sides from 0 to 360 degrees; angles are in degrees.
"""

import math
import re
from collections.abc import Callable
from operator import truediv
from typing import ClassVar

from toolpath_stiff.nc.heidenhain.statements import NUMBER
from toolpath_stiff.nc.parametric.expressions import ARITHMETIC
from toolpath_stiff.nc.parametric.formulas import COMMON, Formula, Value, simple_pattern, trimmed, whole
from toolpath_stiff.nc.place import Place

PARAMETER = re.compile(r"Q[LR]?\d+")
_ASSIGNED = re.compile(r"\s*(Q[LR]?\d+)?\s*=\s*(.+)$")
_JUMP = re.compile(r'\s*IF\s*(.+?)\s*(EQU|NE|GT|LT)\s*(.+?)\s*GOTO\s*LBL\s*(?:(\d+|Q[LR]?\d+)|"([^"]*)")\s*$')
CONDITIONS = {"FN9": "EQU", "FN10": "NE", "FN11": "GT", "FN12": "LT"}
EQUAL = 1e-9
KNOWN = "numbers, Q parameters, functions, + - * / ^ ( )"
FUNCTIONS: dict[str, Callable[..., float]] = {
    **COMMON, "ATAN": lambda v: trimmed(math.degrees(math.atan(v))), "SQ": lambda v: v * v, "LOG": math.log10,
    "NEG": lambda v: -v, "INT": whole, "FRAC": lambda v: v - whole(v), "SGN": lambda v: float((v > 0) - (v < 0)),
}  # fmt: skip


def assigned(head: str, rest: str, place: Place) -> tuple[str, str, Place]:
    """Name, formula and its place in an assignment: `Q5 = ...`, with the name as its head, or `FN 1: Q5 = ...`."""
    formula = _ASSIGNED.match(rest)
    if formula is None or not (formula[1] or head[0] == "Q"):
        raise place.fail(f"{head}{rest[:40]} is no assignment", "Q5 = +10")
    return formula[1] or head, formula[2], place._replace(column=(place.column or 1) + formula.start(2))


def condition(
    head: str, rest: str, parameter: Callable[[str], float], place: Place
) -> tuple[bool, str | None, str | None]:
    """True if the condition of FN 9 to FN 12 holds, and the label to jump to then: a number, or a name."""
    jump = _JUMP.match(rest)
    if jump is None or jump[2] != CONDITIONS[head]:
        raise place.fail(f"{head}:{rest[:40]} is no condition", f"IF +Q1 {CONDITIONS[head]} +5 GOTO LBL 2")
    begin = place.column or 1
    left, right = (work_out(jump[n], parameter, place._replace(column=begin + jump.start(n))) for n in (1, 3))
    same = abs(left - right) <= EQUAL
    holds = {"EQU": same, "NE": not same, "GT": left > right and not same, "LT": left < right and not same}
    return holds[jump[2]], jump[4], jump[5]


class PlainFormula(Formula):
    """A formula of Q parameters."""

    literal: ClassVar = re.compile(NUMBER)
    operator: ClassVar = re.compile(r"DIV|LEN|ANG|[-+*/^]")
    name: ClassVar = re.compile(rf"{PARAMETER.pattern}|[A-Z]+")
    simple: ClassVar = simple_pattern(rf"(?:{PARAMETER.pattern}|{NUMBER})", r"[,^]|DIV|LEN|ANG")
    ranks: ClassVar = {"+": 1, "-": 1, "LEN": 1, "ANG": 1, "*": 2, "/": 2, "DIV": 2, "^": 3}
    operations: ClassVar = {
        **ARITHMETIC, "DIV": truediv, "^": math.pow, "LEN": math.hypot,
        "ANG": lambda a, b: trimmed(math.degrees(math.atan2(a, b)) % 360.0),
    }  # fmt: skip

    def named(self, name: str, column: int) -> Value:
        """Value of a function, of PI, of a Q parameter."""
        if name in FUNCTIONS:
            return self.finite(name, column, FUNCTIONS[name], self.operand())
        self.refuse_if(name != "PI" and not PARAMETER.fullmatch(name), f"{name} in a formula", KNOWN, column=column)
        return math.pi if name == "PI" else super().named(name, column)


def work_out(text: str, parameter: Callable[[str], float], place: Place) -> float:
    """Value of an expression; `parameter` gives the values of Q parameters. Raises `InputError`.

    Examples
    --------
    >>> work_out("SQ 10 - 3^3", {}.__getitem__, Place("part.h", 1))
    73.0
    >>> work_out("2 * (Q1 + 3)", {"Q1": 2.0}.__getitem__, Place("part.h", 1))
    10.0
    """
    begin = place.column or 1
    scanner = PlainFormula(text, range(begin, begin + len(text) + 1), place, "", lookup=lambda name, _: parameter(name))
    value = scanner.real()
    scanner.blanks()
    scanner.refuse_if(not scanner.done, f"{scanner.rest()} in a formula", KNOWN)
    return value
