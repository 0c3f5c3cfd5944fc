"""Expressions of parametric programs: text to functions of the variables.

Two families of controls have variables (`#`). RS274/NGC is LinuxCNC's (manual, "O Codes" and "G-Code Overview",
"Expressions", "Binary Operators", "Functions"). Macro B is Fanuc's (operator's manuals, "Custom macro", "Arithmetic
and logic operation") and Haas' (mill operator's manual, "Macros"). A program that shows no sign of either is read as
far as both agree, and refused beyond.

What differs: a power `**` and `EXISTS` are NGC's; in Macro B an assignment takes a whole expression without brackets,
AND binds as `*` does, OR and XOR as `+`, and all three work on the bits of whole numbers, where NGC's are logical and
bind last; FIX and FUP round towards and from zero in Macro B, down and up in NGC; NGC's MOD is never negative, and its
EQ allows for 0.0001. A variable that nothing has set is 0 in NGC and empty in Macro B.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import add, and_, ge, gt, le, lt, mul, or_, sub, truediv, xor
from typing import TYPE_CHECKING

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.parametric.families import EITHER, MACRO_B, NGC
from toolpath_stiff.nc.place import Place

if TYPE_CHECKING:
    from toolpath_stiff.nc.parametric.variables import Variables


Value = Callable[["Variables"], float | None]  # None: an empty variable of Macro B

NUMBER = re.compile(r"\d+\.?\d*|\.\d+", re.ASCII)
NAME = re.compile(r"<([^<>]*)>")
FUNCTION = re.compile(r"ABS|ACOS|ASIN|ATAN|COS|EXISTS|EXP|FIX|FUP|LN|POW|ROUND|SIN|SQRT|TAN")
SHORT = {"RND": "ROUND", "SQR": "SQRT"}  # Fanuc's short forms
OPERATOR = re.compile(r"\*\*|MOD|AND|XOR|OR|EQ|NE|GT|GE|LT|LE|[*/+-]")
COMPARISONS = ("EQ", "NE", "GT", "GE", "LT", "LE")
LOGIC: dict[str, Callable[[int, int], int]] = {"AND": and_, "OR": or_, "XOR": xor}
# How tightly an operator binds. All are left-associative, `**` too (LinuxCNC: 2**3**2 is 64).
_SHARED = {"*": 4, "/": 4, "MOD": 4, "+": 3, "-": 3, **dict.fromkeys(COMPARISONS, 2)}
BINDS = {
    NGC: {"**": 5, **_SHARED, **dict.fromkeys(LOGIC, 1)},
    MACRO_B: {**_SHARED, "AND": 4, "OR": 3, "XOR": 3},
    EITHER: _SHARED,
}
EQUAL = 1e-4  # NGC's EQ and NE: LinuxCNC's rs274 takes 5 and 5.00009 for equal, 5 and 5.0002 not
DEEPEST = 50  # brackets, or variables of variables, within each other
MOST_OPERATIONS = 200  # in a block; LinuxCNC's has at most 255 characters
LARGEST_PLACE = 1e9
LARGEST_BITS = 2**31
NO_TANGENT_DEGREES = 1e-9


@dataclass
class Scanner:
    """A block without blanks and comments, in upper case, and how far it is read.

    Attributes
    ----------
    text, columns
        The block, and the column of each of its characters in the line.
    place
        Where it stands, for errors.
    family
        `NGC`, `MACRO_B` or `EITHER`.
    of_word
        Whether a word's value is read, not an assignment's or a condition's.
    position
        The next character.
    depth, operations
        Brackets that are open; operators so far.
    """

    text: str
    columns: Sequence[int]
    place: Place
    family: str
    of_word: bool = False
    position: int = 0
    depth: int = 0
    operations: int = 0

    @property
    def done(self) -> bool:
        """Whether all of it is read."""
        return self.position >= len(self.text)

    @property
    def column(self) -> int:
        """The column of the next character."""
        return self.columns[min(self.position, len(self.columns) - 1)]

    def next(self, what: str) -> bool:
        """Whether `what` comes next; it is then read."""
        if not self.text.startswith(what, self.position):
            return False
        self.position += len(what)
        return True

    def match(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        """What matches next, then read; None if nothing does."""
        token = pattern.match(self.text, self.position)
        if token is not None:
            self.position = token.end()
        return token

    def fail(self, problem: str, expected: str = "", hint: str = "", column: int | None = None) -> InputError:
        """An error at a column, unless given that of the next character."""
        return self.place.fail(problem, expected, hint, column or self.column)

    def rest(self) -> str:
        """The next few characters, for errors."""
        return repr(self.text[self.position : self.position + 12])

    def _missing(self, what: str, expected: str) -> InputError:
        return self.fail("the block ends here" if self.done else f"{self.rest()} is not {what}", expected)

    def _worked_out(self, name: str, column: int, work: Callable[[Variables], float]) -> Value:
        """A value whose result is a finite real number, or an error at `column`."""

        def value(variables: Variables) -> float:
            try:
                return finite(work(variables))
            except (ArithmeticError, ValueError) as error:
                raise self.fail(f"{name} cannot be worked out: {error}", column=column) from None

        return value

    def _closed(self, column: int) -> None:
        if not self.next("]"):
            raise self.fail("a bracket that is not closed", "]", column=column)

    def value(self) -> Value:
        """The value after a letter or an operator: a number, a variable, a function, an expression in brackets."""
        negative = False
        while not self.done and self.text[self.position] in "+-":
            negative ^= self.text[self.position] == "-"
            self.position += 1
        value = self._unsigned()
        return (lambda variables: -number(value(variables))) if negative else value

    def _unsigned(self) -> Value:
        literal = self.match(NUMBER)
        if literal is not None:
            constant = float(literal[0])
            if not math.isfinite(constant):
                raise self.fail(f"{literal[0][:20]!r} is not a finite number")
            return lambda variables: constant
        if self.next("#"):
            return self.variable()
        if not self.done and self.text[self.position] == "[":
            return self.bracket()
        name = self.match(FUNCTION)
        if name is not None:
            return self._function(name[0])
        for short, long in SHORT.items():
            if self.next(short):
                return self._function(long)
        raise self._missing("a value", "a value")

    def bracket(self) -> Value:
        """An expression in brackets."""
        column = self.column
        if not self.next("["):
            raise self._missing("a bracket", "[")
        self._deeper(column)
        value = self.expression()
        self._closed(column)
        self.depth -= 1
        return value

    def _deeper(self, column: int) -> None:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self.fail(f"more than {DEEPEST} brackets within each other", column=column)

    def variable(self) -> Value:
        """The variable after a `#`."""
        where, which = self.place._replace(column=self.column), self.which()
        return lambda variables: variables.get(which(variables), where)

    def which(self) -> Callable[[Variables], str | int]:
        """Which variable a `#` means: a number, the number that another one holds, an expression, a name."""
        column = self.column
        named = self.match(NAME)
        if named is not None:
            if self.family == MACRO_B:
                problem = f"#<{named[1]}> is a named variable, which Macro B does not have"
                raise self.fail(problem, "#1 to #999", column=column)
            return lambda variables: named[1]
        self._deeper(column)
        inner = self._unsigned()
        self.depth -= 1

        def numbered(variables: Variables) -> int:
            variable_number = number(inner(variables))
            if not abs(variable_number) < LARGEST_PLACE or abs(variable_number - round(variable_number)) > EQUAL:
                raise self.fail(f"#{variable_number:g}", "a whole number", column=column)
            return round(variable_number)

        return numbered

    def expression(self, tightest: int = 0) -> Value:
        """Values and operators that bind tighter than `tightest`."""
        left = self.value()
        while True:
            begin = self.position
            column = self.column if not self.done else 0
            token = self.match(OPERATOR)
            if token is None:
                return left
            operator = token[0]
            rank = BINDS[self.family].get(operator)
            if rank is None:
                hint = "name the control with --dialect"
                raise self.fail(f"{operator} is no operator of {self.family}", hint=hint, column=column)
            if rank <= tightest:
                self.position = begin
                return left
            self.operations += 1
            if self.operations > MOST_OPERATIONS:
                raise self.fail(f"more than {MOST_OPERATIONS} operators in a block", column=column)
            left = self._operation(operator, left, self.expression(rank), column)

    def _operation(self, operator: str, left: Value, right: Value, column: int) -> Value:
        family = self.family
        if operator in ("EQ", "NE"):
            return lambda variables: equality(operator, left(variables), right(variables), family)

        def work(variables: Variables) -> float:
            return operate(operator, number(left(variables)), number(right(variables)), family)

        return self._worked_out(operator, column, work)

    def _function(self, name: str) -> Value:
        column, family = self.column, self.family
        if name == "EXISTS":
            return self._exists()
        if name == "ROUND" and self.of_word and family == MACRO_B:
            raise self.fail("ROUND in a word, where it rounds to the least increment", "it in an assignment")
        if name in ("ATAN", "POW"):
            return self._of_two(name, column)
        argument = self.bracket()
        return self._worked_out(name, column, lambda variables: evaluate(name, number(argument(variables)), family))

    def _of_two(self, name: str, column: int) -> Value:
        """ATAN[y]/[x]; Macro B's ATAN[y,x] and POW[base,exponent] too."""
        start = self.position
        if not self.next("["):
            raise self._missing("a bracket", "[")
        first = self.expression()
        if self.family != NGC and self.next(","):
            second = self.expression()
            self._closed(self.columns[start])
        elif name == "ATAN" and self.next("]") and self.next("/"):
            second = self.bracket()
        else:
            raise self.fail(f"{name} with one value", "ATAN[y]/[x] or POW[base,exponent]", column=column)
        if name == "POW" and self.family == NGC:
            raise self.fail(f"POW is no function of {NGC}", column=column)

        def work(variables: Variables) -> float:
            left, right = number(first(variables)), number(second(variables))
            return math.pow(left, right) if name == "POW" else variables.angle(left, right)

        return self._worked_out(name, column, work)

    def _exists(self) -> Value:
        """EXISTS[#<name>]: 1 if the variable has been set."""
        if self.family != NGC:
            raise self.fail(f"EXISTS is no function of {self.family}")
        named = self.match(NAME) if self.next("[#") else None
        if named is None or not self.next("]"):
            raise self.fail("EXISTS without a named variable", "EXISTS[#<name>]")
        return lambda variables: float(variables.exists(named[1]))


def number(value: float | None) -> float:
    """A value as operators take it: an empty variable counts as 0."""
    return 0.0 if value is None else value


def finite(value: float) -> float:
    """The value. Raises `ValueError` unless it is a finite real number."""
    if isinstance(value, complex) or not math.isfinite(value):
        raise ValueError("the result is no finite number")
    return float(value)


def equality(operator: str, left: float | None, right: float | None, family: str) -> float:
    """EQ and NE; empty is not 0 to Macro B ("Custom macro", "Handling of an empty variable")."""
    same = abs(number(left) - number(right)) < EQUAL if family == NGC else left == right
    return float(same == (operator == "EQ"))


def operate(operator: str, left: float, right: float, family: str) -> float:
    """The value of an operator: logic of truth values in NGC, of bits in Macro B; MOD never negative in NGC."""
    if operator in LOGIC:
        if family == NGC:
            return float(LOGIC[operator](left != 0.0, right != 0.0))
        if any(value != round(value) or not 0 <= value < LARGEST_BITS for value in (left, right)):
            raise ValueError("its values are not whole numbers from 0")
        return float(LOGIC[operator](round(left), round(right)))
    if operator in ("/", "MOD") and right == 0.0:
        raise ValueError("the divisor is 0")
    if operator != "MOD":
        return float(ARITHMETIC[operator](left, right))
    if family != NGC and (left < 0.0 or right < 0.0):
        raise ValueError("controls differ in the remainder of negative numbers")
    rest = math.fmod(left, right)
    return rest + abs(right) if rest < 0.0 else rest


def evaluate(name: str, value: float, family: str) -> float:
    """The value of a function: FIX and FUP go down and up in NGC, towards and from zero in Macro B.

    Angles are in degrees, to 14 digits: LinuxCNC works them out in long double, where ASIN[0.5] is 30, exactly; MOD and
    FIX make something else of 30.000000000000004.
    """
    if name in ("FIX", "FUP"):
        if family == EITHER and value < 0.0:
            raise ValueError(f"controls differ in {name} of a negative number")
        up = (name == "FUP") != (family == MACRO_B and value < 0.0)
        return float(math.ceil(value) if up else math.floor(value))
    if name == "TAN" and abs(abs(math.fmod(value, 180.0)) - 90.0) < NO_TANGENT_DEGREES:
        raise ValueError("the angle is 90 degrees")  # digits that no control shares decide
    if name in OF_ANGLES:
        return float(f"{OF_ANGLES[name](math.radians(value)):.14g}")
    if name in TO_ANGLES:
        return float(f"{math.degrees(TO_ANGLES[name](value)):.14g}")
    if name == "ROUND":  # half away from zero
        return math.copysign(math.floor(abs(value) + 0.5), value)
    return OF_NUMBERS[name](value)


OF_NUMBERS: dict[str, Callable[[float], float]] = {"ABS": abs, "EXP": math.exp, "LN": math.log, "SQRT": math.sqrt}
OF_ANGLES = {"SIN": math.sin, "COS": math.cos, "TAN": math.tan}
TO_ANGLES = {"ACOS": math.acos, "ASIN": math.asin}
ARITHMETIC: dict[str, Callable[[float, float], float]] = {
    "**": math.pow, "*": mul, "/": truediv, "+": add, "-": sub, "GT": gt, "GE": ge, "LT": lt, "LE": le,
}  # fmt: skip
