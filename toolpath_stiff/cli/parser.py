"""Commands made of functions: their options and their help are signatures and docstrings."""

from __future__ import annotations

import argparse
import difflib
import inspect
import re
from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, NoReturn

import toolpath_stiff as tps
from toolpath_stiff.cli.outputs import tell_incomplete
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import PARAMETERS, SWITCHES, Argument, Option, arguments_of

# argparse takes "-10,0,800" or "-300:300" for an option; this matches every value that begins like a negative number.
NEGATIVE_VALUE = re.compile(r"^-(\d|\.\d|inf|nan)")


def switch(name: str, text: str) -> Argument:
    """A switch that several commands have."""
    return Argument(name.replace("-", "_"), Option(f"--{name}"), text, bool, False)


PROGRAM = Argument("program", Option("PROGRAM"), "NC program or cutter-location file", required=True)
FILES = "measurement files (CSV, or FILE.xlsx[#SHEET]), or nist-table1"
DATA = Argument("data", Option("DATA", count="+"), FILES, required=True)
REPLACE = switch("replace", "replace existing files that the tool did not write; the old ones are kept as NAME.old")
NO_PLOTS = switch("no-plots", "tables and figures in numbers only, no pictures")
JSON = switch("json", "print JSON to standard output and nothing else")
OUT = Argument("out", Option("--out", "DIR"), "folder of the results (default: one in reports, named after the input)")
FOLDER = (OUT, REPLACE, NO_PLOTS, JSON)


@dataclass(frozen=True)
class Command:
    """A command: what runs it and gives the exit code, what it takes options of, names of options that it leaves.

    It takes those of public functions by name, which are imported with what they need when the command is run.
    """

    run: Callable[..., int]
    takes: tuple[str | Argument, ...]
    without: tuple[str, ...] = ()

    @property
    def arguments(self) -> dict[str, Argument]:
        """All arguments by name, its own first; of one that several functions take, the first."""
        arguments = dict(arguments_of(self.run))
        for part in self.takes:
            taken = {part.name: part} if isinstance(part, Argument) else arguments_of(attrgetter(part)(tps))
            arguments |= {name: argument for name, argument in taken.items() if name not in arguments}
        return {name: argument for name, argument in arguments.items() if name not in self.without}

    def __call__(self, name: str, words: Sequence[str]) -> int:
        """Run the command; the exit code. Raises `InputError`."""
        args = self.read(name, words)
        tell_incomplete(args)
        return self.run(args, **{key: getattr(args, key) for key in arguments_of(self.run)})

    def parser(self, name: str) -> Parser:
        """The parser of its arguments."""
        about, _, examples = (inspect.getdoc(self.run) or "").partition(PARAMETERS)[0].partition("\n\n")
        parser = Parser(name, about, examples.rstrip())
        for argument in self.arguments.values():
            parser.add(argument)
        return parser

    def read(self, name: str, words: Sequence[str]) -> Namespace:
        """The values of its arguments. Raises `InputError`."""
        typed, rest = self.parser(name).parse_known_args(whole_options(words))
        arguments = self.arguments
        if rest:
            known = [option for argument in arguments.values() for option in argument.option.name.split()]
            near = difflib.get_close_matches(rest[0].partition("=")[0], known, n=1)
            raise InputError(
                f"{name} does not know {rest[0]!r}", hint=f"did you mean {near[0]}?" if near else f"see {name} --help"
            )
        values = {key: arguments[key].value(word) for key, word in vars(typed).items()}
        for key in values:
            other = arguments[key].option.instead_of
            if other in values:
                names = (arguments[key].option.name, arguments[other].option.name)
                raise InputError(" with ".join(names), expected="one of the two")
        return Namespace(**{key: argument.default for key, argument in arguments.items()} | values)


COMMANDS: dict[str, Command] = {}  # "rig new": of the modules that are imported


def command(
    name: str, *takes: str | Argument, without: Iterable[str] = ()
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Make a command of a function of (all values, those of its own options by name)."""

    def listed(run: Callable[..., int]) -> Callable[..., int]:
        COMMANDS[name] = Command(run, takes, tuple(without))
        return run

    return listed


class Parser(argparse.ArgumentParser):
    """A parser of words: values may begin with a minus, a mistake is an `InputError`."""

    def __init__(self, name: str, about: str, examples: str) -> None:
        super().__init__(
            prog=name, description=about, epilog=examples, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        self._negative_number_matcher = NEGATIVE_VALUE

    def error(self, message: str) -> NoReturn:
        """Raise what is wrong."""
        raise InputError(f"{self.prog}: {message}")

    def add(self, argument: Argument) -> None:
        """Take an argument as words."""
        option, kinds = argument.option, dict[str, Any](default=argparse.SUPPRESS)
        text = argument.help.rstrip(".")
        if argument.default and argument.kind is not bool and "default" not in text:
            parts = argument.default if isinstance(argument.default, tuple) else (argument.default,)
            text += f" (default: {':'.join(f'{part:g}' if isinstance(part, float) else str(part) for part in parts)})"
        kinds["help"] = text.replace("%", "%%")
        if not option.name.startswith("-"):
            count = option.count or (None if argument.required else "?")
            self.add_argument(argument.name, nargs=count, metavar=option.name, **kinds)
            return
        kinds |= {"dest": argument.name, "required": argument.required}
        if argument.kind is bool:
            kinds["action"] = "store_true"
        else:
            number = argument.kind in (int, float)
            unit = option.unit.upper().replace("%", "PERCENT") or "N" if number else option.unit
            kinds["metavar"] = unit or (f"{{{','.join(option.choices)}}}" if option.choices else None)
            kinds["action"] = option.count or "store"
        self.add_argument(*option.name.split(), **kinds)


def whole_options(words: Sequence[str]) -> list[str]:
    """`--block-delete` before anything but switches is the whole option: what follows is a program."""
    return [
        f"{word}=" if word == "--block-delete" and not SWITCHES.fullmatch(after) else word
        for word, after in zip(words, [*words[1:], ""], strict=False)
    ]
