"""Formulas: expressions worked out where they stand, by the grammar of a control's language. Angles are in degrees."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.parametric.expressions import Scanner

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


def simple_pattern(part: str, others: str) -> re.Pattern[str]:
    """Pattern of a sum of products of `part`, numbers and variables, that none of the other operators follows."""
    return re.compile(rf"\s*[-+]?\s*{part}(?:\s*[-+*/]\s*{part})*(?!\s*(?:[-+*/(\[]|{others})|[\w.$])", re.ASCII)


@dataclass
class Formula(Scanner):
    """A block in upper case without its comment, by the grammar of a language; blanks between its parts are skipped.

    Attributes
    ----------
    lookup
        What gives the values of variables.
    literal, operator, name
        Patterns of the language's numbers, operators, and names of variables, functions and constants.
    simple
        Pattern of a sum of products of numbers and variables, to its end.
    ranks, operations
        How tightly an operator binds, and what it does.
    """

    lookup: Lookup = field(kw_only=True)

    literal: ClassVar[re.Pattern[str]]
    operator: ClassVar[re.Pattern[str]]
    name: ClassVar[re.Pattern[str]]
    simple: ClassVar[re.Pattern[str]]
    ranks: ClassVar[Mapping[str, int]]
    operations: ClassVar[Mapping[str, Callable[[float, float], float]]]

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
        """Value of a name with what belongs to it."""
        return self.lookup(name, column)

    def operated(self, operator: str, left: Value, right: Value, column: int) -> Value:
        """Result of an operator."""
        values = self.number(left, column), self.number(right, column)
        return self.finite(operator, column, self.operations[operator], *values)

    def number(self, value: Value, column: int) -> float:
        """Numeric value."""
        if isinstance(value, str):
            raise self.fail(f"{value!r} is no number", "a number", column=column)
        return value
