"""Q parameters: formulas (`Q5 = 3 * (SIN Q1 - 2)`) and the functions FN 0 to FN 13, worked out by one grammar.

HEIDENHAIN, user's manual of the iTNC 530, "Programming: Q parameters" ("Basic arithmetic", "Trigonometric functions",
"Entering formulas directly"). Functions bind tightest, then ^, * and / (DIV), + and -; LEN is the root of the sum of
two squares, ANG the angle of two sides from 0 to 360 degrees; angles are in degrees.
"""

import math
import re
from collections.abc import Callable

from toolpath_stiff.nc.heidenhain.statements import NUMBER
from toolpath_stiff.nc.place import Place

_TOKEN = re.compile(rf"\s*({NUMBER}|Q[LR]?\d+|DIV|LEN|ANG|[A-Z]+|[-+*/^()])")
_RANKS = {"+": 1, "-": 1, "*": 2, "/": 2, "DIV": 2, "^": 3, "LEN": 1, "ANG": 1}
_DEEPEST = 50
PARAMETER = re.compile(r"Q[LR]?\d+")
_ASSIGNED = re.compile(r"\s*(Q[LR]?\d+)?\s*=\s*(.+)$")
_JUMP = re.compile(r'\s*IF\s*(.+?)\s*(EQU|NE|GT|LT)\s*(.+?)\s*GOTO\s*LBL\s*(?:(\d+|Q[LR]?\d+)|"([^"]*)")\s*$')
CONDITIONS = {"FN9": "EQU", "FN10": "NE", "FN11": "GT", "FN12": "LT"}
EQUAL = 1e-9


def _whole(value: float) -> float:
    return float(math.trunc(value))


def _trimmed(degrees: float) -> float:
    """Without the noise beyond the digits of a control: SIN 180 is 0."""
    return float(f"{degrees:.12g}") if abs(degrees) > 1e-14 else 0.0


FUNCTIONS: dict[str, Callable[[float], float]] = {
    "SIN": lambda v: _trimmed(math.sin(math.radians(v))), "COS": lambda v: _trimmed(math.cos(math.radians(v))),
    "TAN": lambda v: math.tan(math.radians(v)), "ASIN": lambda v: _trimmed(math.degrees(math.asin(v))),
    "ACOS": lambda v: _trimmed(math.degrees(math.acos(v))), "ATAN": lambda v: _trimmed(math.degrees(math.atan(v))),
    "SQRT": math.sqrt, "SQ": lambda v: v * v, "LN": math.log, "LOG": math.log10, "EXP": math.exp,
    "NEG": lambda v: -v, "ABS": abs, "INT": _whole, "FRAC": lambda v: v - _whole(v),
    "SGN": lambda v: float((v > 0) - (v < 0)),
}  # fmt: skip
OPERATORS: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b,
    "DIV": lambda a, b: a / b, "^": math.pow, "LEN": math.hypot,
    "ANG": lambda a, b: _trimmed(math.degrees(math.atan2(a, b)) % 360.0),
}  # fmt: skip


def assigned(head: str, rest: str, place: Place) -> tuple[str, str]:
    """Name and formula of an assignment: `Q5 = ...`, with the name as its head, or `FN 1: Q5 = ...`."""
    formula = _ASSIGNED.match(rest)
    if formula is None or not (formula[1] or head[0] == "Q"):
        raise place.fail(f"{head}{rest[:40]} is no assignment", "Q5 = +10")
    return formula[1] or head, formula[2]


def condition(
    head: str, rest: str, parameter: Callable[[str], float], place: Place
) -> tuple[bool, str | None, str | None]:
    """Whether the condition of FN 9 to FN 12 holds, and the label to which it then goes: a number, or a name."""
    jump = _JUMP.match(rest)
    if jump is None or jump[2] != CONDITIONS[head]:
        raise place.fail(f"{head}:{rest[:40]} is no condition", f"IF +Q1 {CONDITIONS[head]} +5 GOTO LBL 2")
    left, right = (work_out(jump[part], parameter, place) for part in (1, 3))
    same = abs(left - right) <= EQUAL
    holds = {"EQU": same, "NE": not same, "GT": left > right and not same, "LT": left < right and not same}
    return holds[jump[2]], jump[4], jump[5]


def work_out(text: str, parameter: Callable[[str], float], place: Place) -> float:
    """The value of an expression; `parameter` gives that of a Q parameter. Raises `InputError`.

    Examples
    --------
    >>> work_out("SQ 10 - 3^3", {}.__getitem__, Place("part.h", 1))
    73.0
    >>> work_out("2 * (Q1 + 3)", {"Q1": 2.0}.__getitem__, Place("part.h", 1))
    10.0
    """
    tokens, position = list[str](), 0
    while text[position:].strip():
        token = _TOKEN.match(text, position)
        if token is None:
            raise place.fail(f"{text[position:].strip()[:12]!r} in a formula", "numbers, Q parameters, + - * / ^ ( )")
        tokens.append(token[1])
        position = token.end()
    try:
        value = _expression(tokens[::-1], parameter, 0, 0)
    except (ArithmeticError, ValueError, IndexError) as error:
        raise place.fail(f"{text.strip()[:40]!r} cannot be worked out: {error}") from None
    if not math.isfinite(value):
        raise place.fail(f"{text.strip()[:40]!r} is no finite number")
    return value


def _expression(rest: list[str], parameter: Callable[[str], float], tightest: int, depth: int) -> float:
    """Values and operators that bind tighter than `tightest`; `rest` are the tokens left, in reverse order."""
    negative = rest[-1] == "-"
    left = _value(rest, parameter, depth)
    if negative and rest and rest[-1] == "^":
        raise ValueError("a sign before ^ may belong to either")
    while rest and _RANKS.get(rest[-1], 0) > tightest:
        operator = rest.pop()
        left = OPERATORS[operator](left, _expression(rest, parameter, _RANKS[operator], depth + 1))
    if not tightest and not depth and rest:
        raise ValueError(f"{rest[-1]} there")
    return left


def _value(rest: list[str], parameter: Callable[[str], float], depth: int) -> float:
    if depth > _DEEPEST:
        raise ValueError("too deep")
    token = rest.pop()
    if token in "+-":
        return _value(rest, parameter, depth + 1) * (-1.0 if token == "-" else 1.0)
    if token == "(":
        value = _expression(rest, parameter, 0, depth + 1)
        if not rest or rest.pop() != ")":
            raise ValueError("a bracket that is not closed")
        return value
    if token == "PI":
        return math.pi
    if token in FUNCTIONS:
        return FUNCTIONS[token](_value(rest, parameter, depth + 1))
    if token[0] == "Q":
        return parameter(token)
    return float(token.replace(",", "."))
