"""Expressions of Siemens' language, worked out where they stand.

SIEMENS, SINUMERIK 840D sl, Programming Manual Job Planning, "Flexible NC programming" ("Arithmetic operations",
"Comparison and logic operations", "Priority of the operations"): NOT binds tightest, then * / DIV MOD, + -, AND,
XOR, OR (those of bits are not read), the concatenation <<, and comparisons last. Angles are in degrees.
"""

import math
import re
from collections.abc import Callable, Container
from dataclasses import dataclass
from operator import add, ge, gt, le, lt, mul, sub, truediv

from toolpath_stiff.nc.heidenhain.expressions import FUNCTIONS as OF_NUMBERS
from toolpath_stiff.nc.parametric.expressions import Scanner

Value = float | str  # a truth value is a bool, which is a number
Lookup = Callable[[str, int], Value]  # the value of a variable, and the column where it stands

BLANK = re.compile(r"\s*")
NUMBER = re.compile(r"(?:\d++\.?\d*|\.\d+)(?:EX[+-]?\d+)?", re.ASCII)
STRING = re.compile(r'"[^"]*"')
NAME = re.compile(r"\$?[A-Z_]\w*", re.ASCII)
OPERATOR = re.compile(r"<<|<>|<=|>=|==|[-+*/<>]|(?:DIV|MOD|AND|XOR|OR)\b")
COMPARISONS: dict[str, Callable[[float, float], bool]] = {"<": lt, ">": gt, "<=": le, ">=": ge}
LOGIC: dict[str, Callable[[bool, bool], bool]] = {
    "AND": lambda a, b: a and b, "OR": lambda a, b: a or b, "XOR": lambda a, b: a != b,
}  # fmt: skip
ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "+": add, "-": sub, "*": mul, "/": truediv, "DIV": lambda a, b: float(math.trunc(a / b)), "MOD": math.fmod,
}  # fmt: skip
RANKS = {
    **dict.fromkeys((*COMPARISONS, "==", "<>"), 1), "<<": 2, "OR": 3, "XOR": 4, "AND": 5, "+": 6, "-": 6,
    **dict.fromkeys(("*", "/", "DIV", "MOD"), 7),
}  # fmt: skip
EQUAL = 1e-12  # relative, of two numbers that are the same (Job Planning, "Precision correction on comparison errors")
FUNCTIONS: dict[str, Callable[..., float]] = {
    **{name: OF_NUMBERS[name] for name in ("SIN", "COS", "TAN", "ASIN", "ACOS", "SQRT", "LN", "EXP", "ABS")},
    "POT": lambda v: v * v, "TRUNC": OF_NUMBERS["INT"], "MINVAL": min, "MAXVAL": max,
    "ROUND": lambda v: math.copysign(math.floor(abs(v) + 0.5), v),
    "ATAN2": lambda y, x: float(f"{math.degrees(math.atan2(y, x)):.12g}"),
    "BOUND": lambda least, most, v: max(least, min(most, v)),
}  # fmt: skip
CONSTANTS: dict[str, Value] = {"TRUE": True, "FALSE": False, "$PI": math.pi}


def no_variable(name: str, column: int) -> Value:
    """The value of a variable where there are none."""
    raise ValueError(f"{name} is no number")


@dataclass
class SiemensScanner(Scanner):
    """A block in upper case without its comment; blanks between its parts are passed over. `lookup`: variables."""

    lookup: Lookup = no_variable

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
        left = self._operand()
        while True:
            begin, column = self.position, self.column
            operator = self.part(OPERATOR)
            if RANKS.get(operator, 0) <= tightest:
                self.position = begin
                return left
            left = self._operated(operator, left, self.result(RANKS[operator]), column)

    def real(self) -> float:
        """A number. Raises `InputError` where it is none."""
        column, value = self.column, self.result()
        if isinstance(value, str):
            raise self.fail(f"{value!r} is no number", "a number", column=column)
        return float(value)

    def _operand(self) -> Value:
        self.take(BLANK)
        column = self.column
        self.next("+")
        if self.next("("):
            value = self.result()
            self.refuse_if(not self.sign(")"), "a bracket that is not closed", ")", column=column)
            return value
        if self.next("-"):
            self.refuse_if(self.begins("-"), "a sign after a sign", "brackets")
            return -self._number(self._operand(), column)
        literal = self.take(NUMBER)
        if literal:
            return float(literal.replace("EX", "E"))
        if self.begins('"'):
            return self.take(STRING)[1:-1]
        name = self.take(NAME)
        self.refuse_if(not name, f"{self.rest()} is not a value", "a value", column=column)
        if name == "NOT":
            return not self._truth(self._operand(), "NOT", column)
        if self.begins("(") and name in FUNCTIONS:
            values = [self._number(value, column) for value in self.arguments() if value is not None]
            return self._worked(name, column, FUNCTIONS[name], values)
        self.refuse_if(self.begins("("), f"{name} is no function that is known", column=column)
        return CONSTANTS[name] if name in CONSTANTS else self.lookup(name + self.index(), column)

    def index(self) -> str:
        """The index behind the name of an array, as names have it: "[2]", "[1,3]"; "" where there is none."""
        column, parts = self.column, list[str]()
        if not self.next("["):
            return ""
        while not parts or self.sign(","):
            begin, value = self.position, self.part(NAME)
            if not value or not self.text.startswith(("]", ","), self.position):  # the name of an axis is none
                self.position = begin
                value = f"{self.real():g}"
            parts.append(value)
        self.refuse_if(not self.sign("]"), "an index that is not closed", "]", column=column)
        return f"[{','.join(parts)}]"

    def arguments(self, named: Container[int] = ()) -> list[Value | None]:
        """The values in the brackets that come next, separated by commas; None for one that is left out.

        Of those at the places `named` the name of the variable.
        """
        column, values = self.column, list[Value | None]()
        self.sign("(")
        while not self.sign(")"):
            self.refuse_if(self.done, "a bracket that is not closed", ")", column=column)
            if self.sign(","):
                values.append(None)
                continue
            values.append(self.part(NAME) + self.index() if len(values) in named else self.result())
            self.refuse_if(not self.sign(",") and not self.begins(")"), f"{self.rest()} in the brackets", ", or )")
        return values

    def _operated(self, operator: str, left: Value, right: Value, column: int) -> Value:
        if operator == "<<":
            return "".join(value if isinstance(value, str) else f"{value:g}" for value in (left, right))
        if operator in LOGIC:
            return LOGIC[operator](self._truth(left, operator, column), self._truth(right, operator, column))
        if isinstance(left, str) and isinstance(right, str) and operator in ("==", "<>"):
            return (left == right) == (operator == "==")
        a, b = self._number(left, column), self._number(right, column)
        if operator in ARITHMETIC:
            return self._worked(operator, column, ARITHMETIC[operator], [a, b])
        same = math.isclose(a, b, rel_tol=EQUAL, abs_tol=0.0)
        if operator in ("==", "<>"):
            return same == (operator == "==")
        return operator in ("<=", ">=") if same else COMPARISONS[operator](a, b)

    def _number(self, value: Value, column: int) -> float:
        if isinstance(value, str):
            raise self.fail(f"{value!r} is no number", "a number", column=column)
        return value

    def _truth(self, value: Value, operator: str, column: int) -> bool:
        problem = f"{operator} of what is no truth value: it binds tighter than comparisons do"
        self.refuse_if(not isinstance(value, bool), problem, "comparisons in brackets", column=column)
        return bool(value)

    def _worked(self, name: str, column: int, work: Callable[..., float], values: list[float]) -> float:
        try:
            result = float(work(*values))
            if not math.isfinite(result):
                raise ValueError("the result is no finite number")
        except (ArithmeticError, ValueError, TypeError) as error:
            raise self.fail(f"{name} cannot be worked out: {error}", column=column) from None
        return result
