"""Expressions of Siemens' language, evaluated where they stand.

SIEMENS, SINUMERIK 840D sl, Programming Manual Job Planning, "Flexible NC programming" ("Arithmetic operations",
"Comparison and logic operations", "Priority of the operations"): NOT binds tightest, then * / DIV MOD, + -, AND,
XOR, OR (those of bits are not read), the concatenation <<, and comparisons last. Angles are in degrees.
"""

import math
import re
from collections.abc import Callable, Container
from operator import ge, gt, le, lt
from typing import ClassVar

from toolpath_stiff.nc.parametric.expressions import ARITHMETIC
from toolpath_stiff.nc.parametric.formulas import COMMON, Formula, Value, simple_pattern, whole

STRING = re.compile(r'"[^"]*"')
ELEMENT = re.compile(r"\[[\d,]+\]")
TIMES = re.compile(r"P(?=\s*[=\d(])")
NAME = re.compile(r"\$?[A-Z_]\w*", re.ASCII)
# Of the machine: outputs, data of the PLC, timers; group 1: what keeps its value.
SET_HERE = re.compile(r"\$A_(?:OUTA?|DB[BWDR])\[|\$AC_(MARKER|PARAM)\[|\$AC_TIMER\[")
COMPARISONS: dict[str, Callable[[float, float], bool]] = {"<": lt, ">": gt, "<=": le, ">=": ge}
LOGIC: dict[str, Callable[[bool, bool], bool]] = {
    "AND": lambda a, b: a and b, "OR": lambda a, b: a or b, "XOR": lambda a, b: a != b,
}  # fmt: skip
EQUAL = 1e-12  # relative, of two numbers that are the same (Job Planning, "Precision correction on comparison errors")
FUNCTIONS: dict[str, Callable[..., float]] = {
    **COMMON, "POT": lambda v: v * v, "TRUNC": whole, "ROUNDUP": math.ceil, "MINVAL": min, "MAXVAL": max,
    "ROUND": lambda v: math.copysign(math.floor(abs(v) + 0.5), v),
    "ATAN2": lambda y, x: float(f"{math.degrees(math.atan2(y, x)):.12g}"),
    "BOUND": lambda least, most, v: max(least, min(most, v)),
}  # fmt: skip
CONSTANTS: dict[str, Value] = {"TRUE": True, "FALSE": False, "$PI": math.pi}


def array_of(name: str) -> str:
    """The array to which an element belongs; for any other variable a name that no array has."""
    return name.partition("[")[0] + "[]" if ELEMENT.search(name) else ""


class SiemensScanner(Formula):
    """Scanner of a block in Siemens' language."""

    literal: ClassVar = re.compile(r"(?:\d++\.?\d*|\.\d+)(?:EX[+-]?\d+)?", re.ASCII)
    operator: ClassVar = re.compile(r"<<|<>|<=|>=|==|[-+*/<>]|(?:DIV|MOD|AND|XOR|OR)\b")
    simple: ClassVar = simple_pattern(r"(?:[A-Z_]\w*|\d+\.?\d*|\.\d+)", r"[<>=]|(?:DIV|MOD|AND|XOR|OR)\b")
    name: ClassVar = re.compile(rf'"|{NAME.pattern}', re.ASCII)
    ranks: ClassVar = {
        **dict.fromkeys((*COMPARISONS, "==", "<>"), 1), "<<": 2, "OR": 3, "XOR": 4, "AND": 5, "+": 6, "-": 6,
        **dict.fromkeys(("*", "/", "DIV", "MOD"), 7),
    }  # fmt: skip
    operations: ClassVar = {**ARITHMETIC, "DIV": lambda a, b: whole(a / b), "MOD": math.fmod}

    def named(self, name: str, column: int) -> Value:
        """The value of a text, NOT, a function, a constant, or a variable."""
        if name == '"':
            self.position -= 1
            return self.take(STRING)[1:-1]
        if name == "NOT":
            return not self._truth(self.operand(), "NOT", column)
        if self.begins("(") and name in FUNCTIONS:
            values = [self.number(value, column) for value in self.arguments() if value is not None]
            return self.finite(name, column, FUNCTIONS[name], *values)
        self.refuse_if(self.begins("("), f"{name} is no function that is known", column=column)
        return CONSTANTS[name] if name in CONSTANTS else self.lookup(name + self.index(), column)

    def index(self) -> str:
        """The index of an array's element as variables' names hold it: "[2]", "[1,3]"; "" if there is none."""
        if not self.next("["):
            return ""
        column, parts = self.column_of(self.position - 1), list[str]()
        while not parts or self.sign(","):
            begin, value = self.position, self.part(NAME)
            if not value or not self.text.startswith(("]", ","), self.position):  # the name of an axis is none
                self.position = begin
                value = f"{self.real():g}"
            parts.append(value)
        self.refuse_if(not self.sign("]"), "an index that is not closed", "]", column=column)
        return f"[{','.join(parts)}]"

    def times(self) -> int:
        """The number of runs: P after a call, or after a repeat."""
        if not self.part(TIMES):
            return 1
        self.sign("=")
        value = self.real()
        self.refuse_if(value != int(value) or not 0 <= value <= 9999, f"P{value:g} repeats", "0 to 9999")
        return int(value)

    def arguments(self, named: Container[int] = ()) -> list[Value | None]:
        """The values in the brackets that follow, separated by commas; None for an omitted one.

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

    def operated(self, operator: str, left: Value, right: Value, column: int) -> Value:
        """The result of an operator."""
        if operator == "<<":
            return "".join(value if isinstance(value, str) else f"{value:g}" for value in (left, right))
        if operator in LOGIC:
            return LOGIC[operator](self._truth(left, operator, column), self._truth(right, operator, column))
        if isinstance(left, str) and isinstance(right, str) and operator in ("==", "<>"):
            return (left == right) == (operator == "==")
        if operator in self.operations:
            return super().operated(operator, left, right, column)
        a, b = self.number(left, column), self.number(right, column)
        same = math.isclose(a, b, rel_tol=EQUAL, abs_tol=0.0)
        if operator in ("==", "<>"):
            return same == (operator == "==")
        return operator in ("<=", ">=") if same else COMPARISONS[operator](a, b)

    def _truth(self, value: Value, operator: str, column: int) -> bool:
        problem = f"{operator} of what is no truth value: it binds tighter than comparisons do"
        self.refuse_if(not isinstance(value, bool), problem, "comparisons in brackets", column=column)
        return bool(value)
