"""Q parameters: formulas (`Q5 = 3 * (SIN Q1 - 2)`) and the functions FN 0 to FN 13, evaluated by one grammar.

HEIDENHAIN, user's manual of the iTNC 530, "Programming: Q parameters" ("Basic arithmetic", "Trigonometric functions",
"Entering formulas directly"). Functions bind tightest, then ^, * and / (DIV), + and -; LEN is the root of the sum of
two squares, ANG the angle of two sides from 0 to 360 degrees; angles are in degrees.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from operator import truediv
from typing import ClassVar

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.heidenhain.statements import NUMBER
from toolpath_stiff.nc.parametric.expressions import ARITHMETIC, Scanner
from toolpath_stiff.nc.place import Place

PARAMETER = re.compile(r"Q[LR]?\d+")
_ASSIGNED = re.compile(r"\s*(Q[LR]?\d+)?\s*=\s*(.+)$")
_JUMP = re.compile(r'\s*IF\s*(.+?)\s*(EQU|NE|GT|LT)\s*(.+?)\s*GOTO\s*LBL\s*(?:(\d+|Q[LR]?\d+)|"([^"]*)")\s*$')
CONDITIONS = {"FN9": "EQU", "FN10": "NE", "FN11": "GT", "FN12": "LT"}
EQUAL = 1e-9
KNOWN = "numbers, Q parameters, functions, + - * / ^ ( )"
Value = float | str  # a truth value is a bool, which is a number
_TERM = re.compile(r"\s*([-+*/]?)\s*(?:([A-Z]\w*)|([\d.,]+))", re.ASCII)
Lookup = Callable[[str, int], Value]  # the value of a variable, and the column where it stands
LONGEST_BLOCK, MOST_BRACKETS = 512, 60  # characters (SIEMENS, Fundamentals, "Blocks and block format")


def whole(value: float) -> float:
    """Value without its fraction."""
    return float(math.trunc(value))


def trimmed(degrees: float) -> float:
    """Value without noise beyond the digits of a control: SIN 180 is 0."""
    return float(f"{degrees:.12g}") if abs(degrees) > 1e-14 else 0.0


COMMON: dict[str, Callable[..., float]] = {
    "SIN": lambda v: trimmed(math.sin(math.radians(v))), "COS": lambda v: trimmed(math.cos(math.radians(v))),
    "TAN": lambda v: math.tan(math.radians(v)), "ASIN": lambda v: trimmed(math.degrees(math.asin(v))),
    "ACOS": lambda v: trimmed(math.degrees(math.acos(v))), "SQRT": math.sqrt, "LN": math.log, "EXP": math.exp,
    "ABS": abs,
}  # fmt: skip
FUNCTIONS: dict[str, Callable[..., float]] = {
    **COMMON, "ATAN": lambda v: trimmed(math.degrees(math.atan(v))), "SQ": lambda v: v * v, "LOG": math.log10,
    "NEG": lambda v: -v, "INT": whole, "FRAC": lambda v: v - whole(v), "SGN": lambda v: float((v > 0) - (v < 0)),
}  # fmt: skip


def simple_pattern(part: str, others: str) -> re.Pattern[str]:
    """Pattern of a sum of products of `part`, numbers and variables, that none of the other operators follows."""
    return re.compile(rf"\s*[-+]?\s*{part}(?:\s*[-+*/]\s*{part})*(?!\s*(?:[-+*/(\[]|{others})|[\w.$])", re.ASCII)


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


@dataclass
class Formula(Scanner):
    """A block in upper case without its comment; blanks between its parts are skipped. `lookup`: variables."""

    lookup: Lookup = field(kw_only=True)

    literal: ClassVar = re.compile(NUMBER)
    operator: ClassVar = re.compile(r"DIV|LEN|ANG|[-+*/^]")
    name: ClassVar = re.compile(rf"{PARAMETER.pattern}|[A-Z]+")
    # How tightly an operator binds.
    ranks: ClassVar[Mapping[str, int]] = {"+": 1, "-": 1, "LEN": 1, "ANG": 1, "*": 2, "/": 2, "DIV": 2, "^": 3}
    operations: ClassVar[Mapping[str, Callable[[float, float], float]]] = {
        **ARITHMETIC, "DIV": truediv, "^": math.pow, "LEN": math.hypot,
        "ANG": lambda a, b: trimmed(math.degrees(math.atan2(a, b)) % 360.0),
    }  # fmt: skip

    # A sum of products of numbers and variables, to its end.
    simple: ClassVar = simple_pattern(rf"(?:{PARAMETER.pattern}|{NUMBER})", r"[,^]|DIV|LEN|ANG")

    def __post_init__(self) -> None:
        problem = f"a block of {len(self.text)} characters, or with too many brackets"
        long = len(self.text) > LONGEST_BLOCK or self.text.count("(") > MOST_BRACKETS
        self.refuse_if(long, problem, f"at most {LONGEST_BLOCK}, {MOST_BRACKETS} of them")

    def part(self, pattern: re.Pattern[str]) -> str:
        """Next text that matches, after blanks; it is then read."""
        self.blanks()
        return self.take(pattern)

    def sign(self, text: str) -> bool:
        """True if `text` comes next, after blanks; it is then read."""
        self.blanks()
        return self.next(text)

    def blanks(self) -> None:
        """Read blanks, if any come next."""
        text, position = self.text, self.position
        while text[position : position + 1].isspace():
            position += 1
        self.position = position

    def result(self, tightest: int = 0) -> Value:
        """Value of operands and operators that bind tighter than `tightest`."""
        simple = self.simple.match(self.text, self.position) if tightest < self.ranks["+"] else None
        if simple is not None and (known := self._sum(simple[0])) is not None:
            self.position = simple.end()
            return known
        left = self.operand()
        while True:
            begin = self.position
            operator = self.part(self.operator)
            if self.ranks.get(operator, 0) <= tightest:
                self.position = begin
                return left
            left = self.operated(operator, left, self.result(self.ranks[operator]), self.column_of(begin))

    def _sum(self, text: str) -> float | None:
        """Value of an expression that `simple` matches; None: for `result`, which has its errors."""
        total = product = -0.0  # which changes no number that it is added to
        try:
            for operator, name, literal in _TERM.findall(text):
                value = float(literal.replace(",", ".")) if literal else self.lookup(name, self.column)
                if type(value) is not float:
                    return None
                if operator in ("*", "/"):
                    product = product * value if operator == "*" else product / value
                else:
                    total, product = total + product, -value if operator == "-" else value
        except (ArithmeticError, InputError):
            return None
        total += product
        return total if math.isfinite(total) else None

    def real(self) -> float:
        """A number. Raises `InputError` if the value is none."""
        column = self.column
        return float(self.number(self.result(), column))

    def operand(self) -> Value:
        """A value with its sign: a number, an expression in brackets, or a named value."""
        self.blanks()
        begin = self.position
        if self.next("+"):
            self.blanks()
        literal = self.take(self.literal)
        if literal:
            return float(literal.replace("EX", "E").replace(",", "."))
        column = self.column_of(begin)
        name = self.take(self.name)
        if name:
            return self.named(name, column)
        if self.next("("):
            value = self.result()
            self.refuse_if(not self.sign(")"), "a bracket that is not closed", ")", column=column)
            return value
        if self.next("-"):
            self.refuse_if(self.begins("-"), "a sign after a sign", "brackets")
            value = -self.number(self.operand(), column)
            self.refuse_if(self.sign("^"), "a sign before ^, which may belong to either", "brackets", column=column)
            return value
        raise self.fail(f"{self.rest()} is not a value", "a value", column=column)

    def named(self, name: str, column: int) -> Value:
        """Value of a name with what belongs to it: of a function, of a Q parameter."""
        if name in FUNCTIONS:
            return self.finite(name, column, FUNCTIONS[name], self.operand())
        self.refuse_if(name != "PI" and not PARAMETER.fullmatch(name), f"{name} in a formula", KNOWN, column=column)
        return math.pi if name == "PI" else self.lookup(name, column)

    def operated(self, operator: str, left: Value, right: Value, column: int) -> Value:
        """Result of an operator."""
        values = self.number(left, column), self.number(right, column)
        return self.finite(operator, column, self.operations[operator], *values)

    def number(self, value: Value, column: int) -> float:
        """Numeric value."""
        if isinstance(value, str):
            raise self.fail(f"{value!r} is no number", "a number", column=column)
        return value


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
    scanner = Formula(text, range(begin, begin + len(text) + 1), place, "", lookup=lambda name, _: parameter(name))
    value = scanner.real()
    scanner.blanks()
    scanner.refuse_if(not scanner.done, f"{scanner.rest()} in a formula", KNOWN)
    return value
