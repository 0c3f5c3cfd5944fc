"""Options, said once: the annotation and the docstring of a public function's argument.

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
    """What commands call an argument, and the values that it may have.

    Attributes
    ----------
    name
        "--step"; several with spaces; without dashes, that of a positional argument.
    unit
        Of a number; of anything else, how it is written.
    above, at_least, below, at_most
        Bounds of a number.
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
    '0 to less than 50 %'
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
        """The numbers that it may be, in words."""
        low = self.at_least if self.above is None else self.above
        high = self.at_most if self.below is None else self.below
        if low is None:
            return "a finite number"
        least = f"more than {low:g}" if self.above is not None else f"{low:g}"
        if high is None:
            return f"{least}{'' if self.above is not None else ' or more'} {self.unit}".strip()
        joined = "at most " if self.above is not None else "" if self.below is None else "less than "
        return f"{least} {'and' if self.above is not None else 'to'} {joined}{high:g} {self.unit}".strip()

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
    """An argument of a function that is an option of commands; `kind` is bool, int, float or, of all else, str."""

    name: str
    option: Option
    help: str = ""
    kind: type = str
    default: Any = None
    required: bool = False

    def value(self, words: Any) -> Any:
        """The value that a command line gives: of a word, of several, or True. Raises `InputError`."""
        if isinstance(words, list):
            return [self.value(word) for word in words]
        if not isinstance(words, str):
            return words
        try:
            value = self.option.read(words) if self.option.read else words
        except ValueError as error:
            raise self._wrong(words, str(error)) from None
        number = self.check(value)
        return value if number is None else number

    def check(self, value: Any) -> float | None:
        """A number as one of its kind; None for what is none. Raises `InputError` for what it may not be."""
        if self.option.choices and value not in self.option.choices:
            raise self._wrong(value, f"one of {', '.join(self.option.choices)}")
        if self.kind not in (int, float):
            return None
        number = number_in(value)
        shown = f"{number:g}" if not math.isnan(number) or not isinstance(value, str) else value
        if not self.option.holds(number):
            raise self._wrong(shown, self.option.expected)
        if self.kind is float:
            return number
        if number != int(number):
            raise self._wrong(shown, "a whole number")
        return int(number)

    def _wrong(self, value: Any, expected: str) -> InputError:
        name = self.option.name.split()[-1] if self.option.name.startswith("-") else self.name
        same = name.strip("-").replace("-", "_").lower() == self.name
        return InputError(f"{name} {str(value)[:60]}{'' if same else f' ({self.name})'}", expected=expected)


def number_in(value: Any) -> float:
    """A number; nan for what is none, as `1_000`, which Python reads."""
    try:
        return math.nan if "_" in str(value) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    """The annotations of a function; types that only type checkers import stand as `object`."""
    unknown: dict[str, Any] = {}
    while True:
        try:
            return get_type_hints(function, None, unknown, include_extras=True)
        except NameError as error:
            unknown[str(error.name)] = object


@cache
def arguments_of(function: Callable[..., Any]) -> dict[str, Argument]:
    """The arguments of a function that are options, by name."""
    function = inspect.unwrap(getattr(function, "__func__", function))
    texts, hints = parameter_texts(function), _hints(function)
    for name, hint in tuple(hints.items()):
        if get_origin(hint) is Unpack:  # the rest of the arguments, as a dictionary of options
            hints |= _hints(get_args(hints.pop(name))[0])
    arguments = {}
    for name, hint in hints.items():
        parts = [hint, *get_args(hint)]
        marks = [mark for part in parts for mark in getattr(part, "__metadata__", ())]
        option = next((mark for mark in marks if isinstance(mark, Option)), None)
        if option is not None:
            parameter = inspect.signature(function).parameters.get(name)
            default = parameter.default if parameter else None
            kinds = [kind for part in parts for kind in (part, *get_args(part)) if kind in (bool, int, float)]
            arguments[name] = Argument(
                name,
                option,
                option.help or texts.get(name, ""),
                kinds[0] if kinds and option.read is None else str,
                None if default is inspect.Parameter.empty else default,
                default is inspect.Parameter.empty,
            )
    return arguments


def words_of(function: Callable[..., Any], given: Mapping[str, Any]) -> list[str]:
    """Arguments of a function as the command takes them; those that are the function's own values go without saying.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> words_of(tps.place, {"x_mm": (-50, 50), "z_values_mm": (700, 800), "partial": None})
    ['--x', '-50:50', '--z-values', '700,800']
    """
    words: list[str] = []
    for name, argument in arguments_of(function).items():
        value = given.get(name)
        if value is None or value is False or value == argument.default:
            continue
        if isinstance(value, Mapping):
            value = [f"{key}={part:.10g}" for key, part in value.items()]
        several = value if isinstance(value, list | tuple | frozenset | set) else [value]
        shown = [f"{part:.10g}" if isinstance(part, int | float) else str(part) for part in several]
        joined = shown if argument.option.count else [(":" if argument.option.read is low_high else ",").join(shown)]
        option = argument.option.name.split()[-1]
        words += [option] if value is True else [word for text in joined for word in (option, text)]
    return words


def parameter_texts(function: Callable[..., Any]) -> dict[str, str]:
    """What a docstring says of each argument."""
    section = (inspect.getdoc(function) or "").partition(PARAMETERS)[2].partition("\n\n")[0]
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        if line.startswith(" "):
            texts.update({name: f"{texts.get(name, '')} {line.strip()}".strip() for name in names})
        else:
            names = line.split(", ")
    return texts


def finite_number(text: str) -> float:
    """A finite number in plain digits."""
    number = number_in(text)
    if not math.isfinite(number):
        raise ValueError("finite numbers")
    return number


def numbers(text: str) -> tuple[float, ...]:
    """`1,2,3`."""
    return tuple(map(finite_number, text.split(",")))


def distinct_numbers(text: str) -> tuple[float, ...]:
    """The same, each once."""
    return tuple(dict.fromkeys(numbers(text)))


def low_high(text: str) -> tuple[float, float]:
    """`LO:HI`, or one number for both ends."""
    parts = text.split(":")
    if len(parts) not in (1, 2):
        raise ValueError("LO:HI or one number")
    low, high = finite_number(parts[0]), finite_number(parts[-1])
    if low > high:
        raise ValueError(f"LO:HI, but the lower bound {low:g} is above the upper bound {high:g}")
    return low, high


def switches(text: str) -> frozenset[int] | bool:
    """Block-delete switches, `2,3`; nothing, what the option means alone."""
    if not text:
        return True
    if not SWITCHES.fullmatch(text):
        raise ValueError("switches 1 to 9, as 2,3")
    return frozenset(map(int, text.split(",")))


def names(text: str) -> tuple[str, ...]:
    """`first,second`."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def checked(function: F) -> F:
    """The function; what it is given is held against its options first."""
    positions = list(inspect.signature(function).parameters)

    @wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        arguments = arguments_of(function)
        for name, value in {**dict(zip(positions, args, strict=False)), **named}.items():
            if name in arguments and value is not None:
                arguments[name].check(value)
        return function(*args, **named)

    return cast("F", call)
