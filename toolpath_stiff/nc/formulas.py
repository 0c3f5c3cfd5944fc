"""Expressions worked out where they stand, as controls with words of their own have them.

A grammar is a subclass: its operators, how tightly each binds, and what a name means. Angles are in degrees.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from toolpath_stiff.nc.parametric.expressions import ARITHMETIC, Scanner

Value = float | str  # a truth value is a bool, which is a number
Lookup = Callable[[str, int], Value]  # the value of a variable, and the column where it stands

BLANK = re.compile(r"\s*")
LONGEST_BLOCK, MOST_BRACKETS = 512, 60  # characters (SIEMENS, Fundamentals, "Blocks and block format")


def whole(value: float) -> float:
    """Without what stands behind the point."""
    return float(math.trunc(value))


def trimmed(degrees: float) -> float:
    """Without the noise beyond the digits of a control: SIN 180 is 0."""
    return float(f"{degrees:.12g}") if abs(degrees) > 1e-14 else 0.0


FUNCTIONS: dict[str, Callable[..., float]] = {
    "SIN": lambda v: trimmed(math.sin(math.radians(v))), "COS": lambda v: trimmed(math.cos(math.radians(v))),
    "TAN": lambda v: math.tan(math.radians(v)), "ASIN": lambda v: trimmed(math.degrees(math.asin(v))),
    "ACOS": lambda v: trimmed(math.degrees(math.acos(v))), "SQRT": math.sqrt, "LN": math.log, "EXP": math.exp,
    "ABS": abs,
}  # fmt: skip


@dataclass
class FormulaScanner(Scanner):
    """A block in upper case without its comment; blanks between its parts are passed over. `lookup`: variables."""

    lookup: Lookup = field(kw_only=True)

    literal: ClassVar[re.Pattern[str]]
    operator: ClassVar[re.Pattern[str]]
    name: ClassVar[re.Pattern[str]]
    ranks: ClassVar[Mapping[str, int]]  # how tightly an operator binds
    operations: ClassVar[Mapping[str, Callable[[float, float], float]]] = ARITHMETIC

    def __post_init__(self) -> None:
        problem = f"a block of {len(self.text)} characters, or with too many brackets"
        long = len(self.text) > LONGEST_BLOCK or self.text.count("(") > MOST_BRACKETS
        self.refuse_if(long, problem, f"at most {LONGEST_BLOCK}, {MOST_BRACKETS} of them")

    def part(self, pattern: re.Pattern[str]) -> str:
        """What matches next behind blanks, then read."""
        self.take(BLANK)
        return self.take(pattern)

    def sign(self, text: str) -> bool:
        """Whether that comes next behind blanks; it is then read."""
        self.take(BLANK)
        return self.next(text)

    def result(self, tightest: int = 0) -> Value:
        """Values and operators that bind tighter than `tightest`."""
        left = self.operand()
        while True:
            begin, column = self.position, self.column
            operator = self.part(self.operator)
            if self.ranks.get(operator, 0) <= tightest:
                self.position = begin
                return left
            left = self.operated(operator, left, self.result(self.ranks[operator]), column)

    def real(self) -> float:
        """A number. Raises `InputError` where it is none."""
        column = self.column
        return float(self.number(self.result(), column))

    def operand(self) -> Value:
        """A value with its sign: a number, an expression in brackets, what a name stands for."""
        self.take(BLANK)
        column = self.column
        self.next("+")
        if self.sign("("):
            value = self.result()
            self.refuse_if(not self.sign(")"), "a bracket that is not closed", ")", column=column)
            return value
        if self.next("-"):
            self.refuse_if(self.begins("-"), "a sign after a sign", "brackets")
            return -self.number(self.operand(), column)
        literal = self.take(self.literal)
        if literal:
            return float(literal.replace("EX", "E").replace(",", "."))
        name = self.take(self.name)
        self.refuse_if(not name, f"{self.rest()} is not a value", "a value", column=column)
        return self.named(name, column)

    def named(self, name: str, column: int) -> Value:
        """The value of a name, with what belongs to it."""
        return self.lookup(name, column)

    def operated(self, operator: str, left: Value, right: Value, column: int) -> Value:
        """The value of an operator."""
        values = self.number(left, column), self.number(right, column)
        return self.finite(operator, column, self.operations[operator], *values)

    def number(self, value: Value, column: int) -> float:
        """The number that a value is."""
        if isinstance(value, str):
            raise self.fail(f"{value!r} is no number", "a number", column=column)
        return value
