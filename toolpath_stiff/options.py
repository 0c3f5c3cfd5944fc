"""Options, each defined once: by the annotation and the docstring of a public function's argument.

From there come the option of the commands, its help, the check for whoever calls from Python, and the sentence that
says what is wrong, the same for both.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, wraps
from typing import Any, TypeVar, Unpack, cast, get_args, get_origin, get_type_hints

from toolpath_stiff.errors import InputError

F = TypeVar("F", bound=Callable[..., Any])
PARAMETERS = "Parameters\n----------\n"  # of a docstring
SWITCHES = re.compile(r"[1-9](?:,[1-9])*")  # of block delete


@dataclass(frozen=True)
class Option:
    """Name of an argument on the command line, and the values it may have.

    Attributes
    ----------
    name
        "--step"; several with spaces; without dashes, that of a positional argument.
    unit
        Of a number; of anything else, how it is written.
    above, at_least, below, at_most
        Bounds of a number, or of both ends of LO:HI.
    choices
        The only words that there are.
    read
        Makes a value of a word; raises `ValueError` with what was expected.
    count
        "?", "*" or "+" of a positional argument; "append" of an option that may be given several times.
    instead_of
        The argument that cannot be given as well.
    help
        For commands, where several functions share the option.

    Examples
    --------
    >>> Option("--margin", "%", at_least=0, below=50).expected
    'at least 0 and less than 50 %'
    """

    name: str
    unit: str = ""
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    choices: Sequence[str] = ()
    read: Callable[[str], Any] | None = None
    count: str = ""
    instead_of: str = ""
    help: str = ""

    @property
    def expected(self) -> str:
        """Numbers allowed, in words."""
        bounds = {"more than": self.above, "at least": self.at_least, "less than": self.below, "at most": self.at_most}
        words = [f"{word} {bound:g}" for word, bound in bounds.items() if bound is not None]
        allowed = " and ".join(words) or "a finite number"
        return f"{self.unit}, each {allowed}" if self.read else f"{allowed} {self.unit}".strip()

    def holds(self, number: float) -> bool:
        """True for a finite number within the bounds."""
        return (
            math.isfinite(number)
            and (self.above is None or number > self.above)
            and (self.at_least is None or number >= self.at_least)
            and (self.below is None or number < self.below)
            and (self.at_most is None or number <= self.at_most)
        )


@dataclass(frozen=True)
class Argument:
    """An argument of a function that is an option of commands; `kind` is bool, int, float or, for all else, str."""

    name: str
    option: Option
    help: str = ""
    kind: type = str
    default: Any = None
    required: bool = False

    def value(self, word: str) -> Any:
        """Value of a command-line word. Raises `InputError`."""
        if not word.strip() and self.option.read is not switches:  # a shell variable that is not set
            raise self._wrong(repr(word), self.option.unit or "a value")
        try:
            value = self.option.read(word) if self.option.read else word
        except ValueError as error:
            raise self._wrong(word, str(error)) from None
        number = self.check(value)
        return value if number is None else number

    def check(self, value: Any) -> float | None:
        """A number converted to the argument's kind; None for other values. Raises `InputError` if not allowed."""
        if self.option.choices and value not in self.option.choices:
            raise self._wrong(value, f"one of {', '.join(self.option.choices)}")
        if self.option.read is low_high:
            for end in value if isinstance(value, Sequence) else [value]:
                self._number(end)
        if self.kind not in (int, float):
            return None
        number = self._number(value)
        if self.kind is int and number != int(number):
            raise self._wrong(value, "a whole number")
        return int(number) if self.kind is int else number

    def _number(self, value: Any) -> float:
        number = number_in(value)
        if not self.option.holds(number):
            raise self._wrong(value, self.option.expected)
        return number

    def words(self, value: Any) -> list[str]:
        """A value as command-line words: several for an option that may be given several times."""
        if isinstance(value, Mapping):
            value = [f"{key}={part:.10g}" for key, part in value.items()]
        parts = value if isinstance(value, list | tuple | frozenset | set) else [value]
        words = [f"{part:.10g}" if isinstance(part, int | float) else str(part) for part in parts]
        return words if self.option.count else [(":" if self.option.read is low_high else ",").join(words)]

    def _wrong(self, value: Any, expected: str) -> InputError:
        name = self.option.name.split()[-1] if self.option.name.startswith("-") else self.name
        return InputError(f"{name} {str(value)[:60]}", expected=expected)


def number_in(value: Any) -> float:
    """Number that a text holds; nan if none, or if only Python would read it (`1_000`)."""
    try:
        return math.nan if "_" in str(value) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


@cache
def arguments_of(function: Callable[..., Any]) -> dict[str, Argument]:
    """The arguments of a function that are options, by name."""
    function = inspect.unwrap(getattr(function, "__func__", function))
    texts, hints = parameter_texts(function), get_type_hints(function, include_extras=True)
    for name in [name for name, hint in hints.items() if get_origin(hint) is Unpack]:  # a dictionary of options
        hints |= get_type_hints(get_args(hints.pop(name))[0], include_extras=True)
    parameters, arguments = inspect.signature(function).parameters, {}
    for name, hint in hints.items():
        option = next((mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, Option)), None)
        if option is not None:
            kinds = [kind for kind in (hint.__origin__, *get_args(hint.__origin__)) if kind in (bool, int, float)]
            kind = kinds[0] if kinds and option.read is None else str
            default = parameters[name].default if name in parameters else None
            required = default is inspect.Parameter.empty
            text = option.help or texts.get(name, "")
            arguments[name] = Argument(name, option, text, kind, None if required else default, required)
    return arguments


def words_of(function: Callable[..., Any], given: Mapping[str, Any]) -> list[str]:
    """Arguments of a function as command-line words; those equal to the function's defaults are left out.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> words_of(tps.place, {"x_mm": (-50, 50), "z_values_mm": (700, 800), "partial": None})
    ['--x', '-50:50', '--z-values', '700,800']
    """
    words: list[str] = []
    for name, argument in arguments_of(function).items():
        value, option = given.get(name), argument.option.name.split()[-1]
        if value is not None and value is not False and value != argument.default:
            words += [option] if value is True else [word for text in argument.words(value) for word in (option, text)]
    return words


def parameter_texts(function: Callable[..., Any]) -> dict[str, str]:
    """Description of each argument in a docstring."""
    section = (inspect.getdoc(function) or "").partition(PARAMETERS)[2].partition("\n\n")[0]
    entries = re.findall(r"^(\S.*)\n((?: .*\n?)+)", section, re.M)
    return {name: " ".join(text.split()) for names, text in entries for name in names.split(", ")}


def finite_number(text: str) -> float:
    """A finite number, in plain digits."""
    if "," in text:
        raise ValueError("numbers with decimal points, several with spaces between them: 0 0 900")
    number = number_in(text)
    if not math.isfinite(number):
        raise ValueError("finite numbers")
    return number


def numbers(text: str) -> tuple[float, ...]:
    """Numbers of `1,2,3`."""
    return tuple(map(finite_number, text.split(",")))


def low_high(text: str) -> tuple[float, float]:
    """Low and high end of `LO:HI`; a single number is both."""
    parts = text.split(":")
    if len(parts) not in (1, 2):
        raise ValueError("LO:HI or one number")
    low, high = finite_number(parts[0]), finite_number(parts[-1])
    if low > high:
        raise ValueError(f"LO:HI, but the lower bound {low:g} is above the upper bound {high:g}")
    return low, high


def switches(text: str) -> frozenset[int] | bool:
    """Block-delete switches of `2,3`; for an empty text, the meaning of the option alone."""
    if not text:
        return True
    if not SWITCHES.fullmatch(text):
        raise ValueError("switches 1 to 9, as 2,3")
    return frozenset(map(int, text.split(",")))


def names(text: str) -> tuple[str, ...]:
    """Names of `first,second`."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def checked(function: F) -> F:
    """Decorate a function so that its arguments are checked against its options first."""
    positions = list(inspect.signature(function).parameters)

    @wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        arguments = arguments_of(function)
        for name, value in {**dict(zip(positions, args, strict=False)), **named}.items():
            if name in arguments and value is not None:
                arguments[name].check(value)
        return function(*args, **named)

    return cast("F", call)
