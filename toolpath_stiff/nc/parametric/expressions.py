"""Expressions of parametric programs: text as functions of the variables.

Two families of controls have variables (`#`). RS274/NGC is LinuxCNC's (manual, "O Codes" and "G-Code Overview",
"Expressions", "Binary Operators", "Functions"). Macro B is Fanuc's (operator's manuals, "Custom macro", "Arithmetic
and logic operation") and Haas' (mill operator's manual, "Macros"). A program that shows no sign of either is read as
far as both agree, and refused beyond.

What differs: a power `**` and `EXISTS` are NGC's; in Macro B an assignment takes a whole expression without brackets,
AND binds as `*` does, OR and XOR as `+`, and all three work on the bits of whole numbers, where NGC's are logical and
bind last; FIX and FUP round towards and from zero in Macro B, down and up in NGC; NGC's MOD is never negative, and its
EQ allows for 0.0001. A variable that nothing has set is 0 in NGC and empty in Macro B.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import add, and_, ge, gt, le, lt, mul, or_, sub, truediv, xor

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.parametric.families import EITHER, MACRO_B, NGC
from toolpath_stiff.nc.parametric.variables import Variables, Which
from toolpath_stiff.nc.place import Place

Value = Callable[[Variables], float | None]  # None: an empty variable of Macro B

NUMBER = re.compile(r"\d+\.?\d*|\.\d+", re.ASCII)
SIGNS = re.compile(r"[+-]*")
NAME = re.compile(r"<[^<>]*>")
FUNCTION = re.compile(r"ABS|ACOS|ASIN|ATAN|COS|EXISTS|EXP|FIX|FUP|LN|POW|RND|ROUND|SIN|SQRT|SQR|TAN")
SHORT = {"RND": "ROUND", "SQR": "SQRT"}  # Fanuc's short forms
OPERATOR = re.compile(r"\*\*|MOD|AND|XOR|OR|EQ|NE|GT|GE|LT|LE|[*/+-]")
COMPARISONS = ("EQ", "NE", "GT", "GE", "LT", "LE")
LOGIC: dict[str, Callable[[int, int], int]] = {"AND": and_, "OR": or_, "XOR": xor}
# Precedence of operators. All are left-associative, even `**` (LinuxCNC: 2**3**2 is 64).
_SHARED = {"*": 4, "/": 4, "MOD": 4, "+": 3, "-": 3, **dict.fromkeys(COMPARISONS, 2)}
BINDS = {
    NGC: {"**": 5, **_SHARED, **dict.fromkeys(LOGIC, 1)},
    MACRO_B: {**_SHARED, "AND": 4, "OR": 3, "XOR": 3},
    EITHER: _SHARED,
}
EQUAL = 1e-4  # NGC's EQ and NE: LinuxCNC's rs274 takes 5 and 5.00009 for equal, 5 and 5.0002 not
LARGEST_PLACE = 1e9
LARGEST_BITS = 2**31
NO_TANGENT_DEGREES = 1e-9


@dataclass
class Scanner:
    """A block without blanks and comments, in upper case, and the position read so far.

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
    """

    text: str
    columns: Sequence[int]
    place: Place
    family: str
    of_word: bool = False
    position: int = 0

    @property
    def done(self) -> bool:
        """True if all of it is read."""
        return self.position >= len(self.text)

    @property
    def column(self) -> int:
        """Column of the next character."""
        return self.columns[min(self.position, len(self.columns) - 1)]

    def begins(self, *texts: str) -> bool:
        """True if one of these texts comes next."""
        return self.text.startswith(texts, self.position)

    def next(self, text: str) -> bool:
        """True if the text comes next; it is then read."""
        begins = self.begins(text)
        self.position += len(text) * begins
        return begins

    def take(self, pattern: re.Pattern[str]) -> str:
        """Next text that matches, which is then read; "" if none does."""
        token = pattern.match(self.text, self.position)
        if token is None:
            return ""
        self.position = token.end()
        return token[0]

    def fail(self, problem: str, expected: str = "", hint: str = "", column: int | None = None) -> InputError:
        """Error at a column, by default that of the next character."""
        return self.place.fail(problem, expected, hint, column or self.column)

    def refuse_if(
        self, refused: object, problem: str, expected: str = "", hint: str = "", column: int | None = None
    ) -> None:
        """Raise the error if `refused`."""
        if refused:
            raise self.fail(problem, expected, hint, column)

    def rest(self) -> str:
        """The next few characters, for errors."""
        return repr(self.text[self.position : self.position + 12])

    def _missing(self, what: str, expected: str) -> InputError:
        return self.fail("the block ends here" if self.done else f"{self.rest()} is not {what}", expected)

    def finite(self, name: str, column: int, work: Callable[..., float], *values: object) -> float:
        """Result of a function or operator: a finite real number, or an error at `column`."""
        try:
            result = float(work(*values))
            if not math.isfinite(result):
                raise ValueError("the result is no finite number")
        except (ArithmeticError, ValueError, TypeError) as error:
            raise self.fail(f"{name} cannot be worked out: {error}", column=column) from None
        return result

    def _worked_out(self, name: str, column: int, work: Callable[[Variables], float]) -> Value:
        return lambda variables: self.finite(name, column, work, variables)

    def _open(self) -> int:
        """Column of the opening bracket, which is read."""
        column = self.column
        if not self.next("["):
            raise self._missing("a bracket", "[")
        return column

    def _close(self, column: int) -> None:
        self.refuse_if(not self.next("]"), "a bracket that is not closed", "]", column=column)

    def value(self) -> Value:
        """Value after a letter or an operator: a number, a variable, a function, an expression in brackets."""
        negative = self.take(SIGNS).count("-") % 2
        value = self._unsigned()
        return (lambda variables: -number(value(variables))) if negative else value

    def _unsigned(self) -> Value:
        literal = self.take(NUMBER)
        if literal:
            constant = float(literal)
            return lambda variables: constant
        if self.next("#"):
            return self.variable()
        if self.begins("["):
            return self.bracket()
        name = self.take(FUNCTION)
        if name:
            return self._function(SHORT.get(name, name))
        raise self._missing("a value", "a value")

    def bracket(self) -> Value:
        """An expression in brackets."""
        column = self._open()
        value = self.expression()
        self._close(column)
        return value

    def variable(self) -> Value:
        """Variable after a `#`."""
        place, which = self.place._replace(column=self.column), self.which()
        return lambda variables: variables.get(which(variables), place)

    def which(self) -> Callable[[Variables], Which]:
        """Variable that a `#` means: by a number, by the number in another one, by an expression, by a name."""
        column = self.column
        name = self.take(NAME)[1:-1]
        problem = f"#<{name}> is a named variable, which Macro B does not have"
        self.refuse_if(name and self.family == MACRO_B, problem, "#1 to #999", column=column)
        if name:
            return lambda variables: name
        inner = self._unsigned()

        def numbered(variables: Variables) -> int:
            variable_number = number(inner(variables))
            if not abs(variable_number) < LARGEST_PLACE or abs(variable_number - round(variable_number)) > EQUAL:
                raise self.fail(f"#{variable_number:g}", "a whole number", column=column)
            return round(variable_number)

        return numbered

    def expression(self, tightest: int = 0) -> Value:
        """Value of operands and operators that bind tighter than `tightest`."""
        left = self.value()
        while True:
            begin, column = self.position, self.column
            operator = self.take(OPERATOR)
            if not operator:
                return left
            rank = BINDS[self.family].get(operator)
            if rank is None:
                hint = "name the control with --dialect"
                raise self.fail(f"{operator} is no operator of {self.family}", hint=hint, column=column)
            if rank <= tightest:
                self.position = begin
                return left
            left = self._operation(operator, left, self.expression(rank), column)

    def _operation(self, operator: str, left: Value, right: Value, column: int) -> Value:
        return self._worked_out(
            operator, column, lambda variables: operate(operator, left(variables), right(variables), self.family)
        )

    def _function(self, name: str) -> Value:
        column, family = self.column, self.family
        if name == "EXISTS":
            return self._exists()
        in_word = name == "ROUND" and self.of_word and family == MACRO_B
        self.refuse_if(in_word, "ROUND in a word, where it rounds to the least increment", "it in an assignment")
        if name in ("ATAN", "POW"):
            return self._of_two(name, column)
        argument = self.bracket()
        return self._worked_out(name, column, lambda variables: evaluate(name, number(argument(variables)), family))

    def _of_two(self, name: str, column: int) -> Value:
        """ATAN[y]/[x]; in Macro B also ATAN[y,x] and POW[base,exponent]."""
        start = self._open()
        first = self.expression()
        if self.family != NGC and self.next(","):
            second = self.expression()
            self._close(start)
        elif name == "ATAN" and self.next("]/"):
            second = self.bracket()
        else:
            raise self.fail(f"{name} with one value", "ATAN[y]/[x] or POW[base,exponent]", column=column)

        def work(variables: Variables) -> float:
            left, right = number(first(variables)), number(second(variables))
            return math.pow(left, right) if name == "POW" else variables.angle(left, right)

        return self._worked_out(name, column, work)

    def _exists(self) -> Value:
        """EXISTS[#<name>]: 1 if the variable has been set."""
        name = self.take(NAME)[1:-1] if self.family == NGC and self.next("[#") else ""
        self.refuse_if(not name or not self.next("]"), f"EXISTS in {self.family}", "EXISTS[#<name>], on LinuxCNC")
        return lambda variables: float(variables.exists(name))


def number(value: float | None) -> float:
    """Value as operators take it: an empty variable counts as 0."""
    return 0.0 if value is None else value


def operate(operator: str, left: float | None, right: float | None, family: str) -> float:
    """Result of an operator.

    EQ and NE allow for 0.0001 in NGC; to Macro B empty is not 0 ("Custom macro", "Handling of an empty variable").
    Logic is of truth values in NGC, of bits in Macro B; MOD is never negative in NGC.
    """
    a, b = number(left), number(right)
    if operator in ("EQ", "NE"):
        same = abs(a - b) < EQUAL if family == NGC else left == right
        return float(same == (operator == "EQ"))
    if operator in LOGIC and family == NGC:
        return float(LOGIC[operator](a != 0.0, b != 0.0))
    if operator in LOGIC:
        if any(value != round(value) or not 0 <= value < LARGEST_BITS for value in (a, b)):
            raise ValueError("its values are not whole numbers from 0")
        return float(LOGIC[operator](round(a), round(b)))
    if operator != "MOD":
        return float(ARITHMETIC[operator](a, b))
    if family != NGC and (a < 0.0 or b < 0.0):
        raise ValueError("controls differ in the remainder of negative numbers")
    rest = math.fmod(a, b)
    return rest + abs(b) if rest < 0.0 else rest


def evaluate(name: str, value: float, family: str) -> float:
    """Result of a function: FIX and FUP go down and up in NGC, towards and away from zero in Macro B.

    Angles are in degrees, to 14 digits: LinuxCNC works them out in long double, where ASIN[0.5] is 30, exactly; MOD and
    FIX make something else of 30.000000000000004.
    """
    if name in ("FIX", "FUP"):
        if family == EITHER and value < 0.0:
            raise ValueError(f"controls differ in {name} of a negative number")
        up = (name == "FUP") != (family == MACRO_B and value < 0.0)
        return float(math.ceil(value) if up else math.floor(value))
    if name == "TAN" and abs(abs(math.fmod(value, 180.0)) - 90.0) < NO_TANGENT_DEGREES:
        raise ValueError("the angle is 90 degrees")  # the result would depend on digits that differ between controls
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
