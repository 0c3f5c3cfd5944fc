"""Commands made from functions: options and help come from signatures and docstrings."""

from __future__ import annotations

import argparse
import difflib
import inspect
import re
from argparse import Namespace
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from operator import attrgetter
from typing import Any, NoReturn

import toolpath_stiff as tps
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import PARAMETERS, SWITCHES, Argument, Option, arguments_of
from toolpath_stiff.report.folder import quicken_pictures

# argparse takes "-10,0,800" or "-300:300" for an option; this matches every value that begins like a negative number.
NEGATIVE_VALUE = re.compile(r"^-(\d|\.\d|inf|nan)")
Run = Callable[..., int]  # of a command: all values, those of its own options by name; the exit code
PROGRAM = Argument("program", Option("PROGRAM"), "NC program or cutter-location file", required=True)
FILES = "measurement files (CSV, or FILE.xlsx[#SHEET]), or nist-table1"
DATA = Argument("data", Option("DATA", count="+"), FILES, required=True)
KEPT = "replace existing files that the tool did not write; the old ones are kept as NAME.old"
REPLACE = Argument("replace", Option("--replace"), KEPT, bool, False)
NO_PLOTS = Argument("no_plots", Option("--no-plots"), "tables and figures in numbers only, no pictures", bool, False)
JSON = Argument("json", Option("--json"), "print JSON to standard output and nothing else", bool, False)
OUT = Argument("out", Option("--out", "DIR"), "folder of the results (default: one in reports, named after the input)")
FOLDER = (OUT, REPLACE, NO_PLOTS, JSON)


@dataclass(frozen=True)
class Command:
    """A command: function that runs it and gives the exit code, sources of its options, options left out.

    It takes those of public functions by name, which are imported with what they need when the command is run.
    """

    run: Run
    takes: tuple[str | Argument, ...]
    without: tuple[str, ...] = ()

    @property
    def arguments(self) -> dict[str, Argument]:
        """All arguments by name, its own first; of one shared by several functions, the first definition."""
        arguments = dict(arguments_of(self.run))
        for part in self.takes:
            taken = {part.name: part} if isinstance(part, Argument) else arguments_of(attrgetter(part)(tps))
            arguments |= {name: argument for name, argument in taken.items() if name not in arguments}
        return {name: argument for name, argument in arguments.items() if name not in self.without}

    def __call__(self, title: str, words: Sequence[str]) -> int:
        """Run the command, or print its help; the exit code. Raises `InputError`."""
        if "-h" in words or "--help" in words:
            print(self.parser(title).format_help(), end="")
            return 0
        args = self.read(title, words)
        if not getattr(args, NO_PLOTS.name, True):
            quicken_pictures()
        return self.run(args, **{name: getattr(args, name) for name in arguments_of(self.run)})

    def parser(self, title: str) -> Parser:
        """The parser of its arguments."""
        about, _, examples = (inspect.getdoc(self.run) or "").partition(PARAMETERS)[0].partition("\n\n")
        shown = argparse.RawDescriptionHelpFormatter
        # Without abbreviations: --out, a folder elsewhere, would be --output of a command that has none.
        parser = Parser(title, None, about, examples.rstrip(), formatter_class=shown, allow_abbrev=False)
        parser._negative_number_matcher = NEGATIVE_VALUE
        for argument in self.arguments.values():
            parser.add(argument)
        return parser

    def read(self, title: str, words: Sequence[str]) -> Namespace:
        """The values of its arguments. Raises `InputError`."""
        # Before anything but switches `--block-delete` is the whole option: what follows is a program.
        words = [
            f"{word}=" if word == "--block-delete" and not SWITCHES.fullmatch(after) else word
            for word, after in zip_longest(words, words[1:], fillvalue="")
        ]
        given, rest = self.parser(title).parse_known_args(words)
        arguments = self.arguments
        if rest:
            known = [name for argument in arguments.values() for name in argument.option.name.split()]
            near = nearest(rest[0].partition("=")[0], known)
            hint = f"did you mean {near}?" if near else f"see {title} --help"
            raise InputError(f"{title} does not know {rest[0]!r}", hint=hint)
        for name in vars(given):
            other = arguments[name].option.instead_of
            if other in given:
                both = f"{arguments[name].option.name} with {arguments[other].option.name}"
                raise InputError(both, expected="one of the two")
        return Namespace(**{name: argument.default for name, argument in arguments.items()} | vars(given))


def nearest(word: str, known: Iterable[str]) -> str:
    """Known word that was probably meant; "" if none is close."""
    return next(iter(difflib.get_close_matches(word, list(known), n=1)), "")


COMMANDS: dict[str, Command] = {}  # "rig new": of the modules that are imported


def command(name: str, *takes: str | Argument, without: Iterable[str] = ()) -> Callable[[Run], Run]:
    """Make a command of a function of (all values, and its own options by name)."""

    def listed(run: Run) -> Run:
        COMMANDS[name] = Command(run, takes, tuple(without))
        return run

    return listed


class Parser(argparse.ArgumentParser):
    """A parser that raises `InputError` for mistakes."""

    def error(self, message: str) -> NoReturn:
        """Raise the message as an `InputError`."""
        raise InputError(f"{self.prog}: {message}")

    def add(self, argument: Argument) -> None:
        """Add an argument of a public function."""
        option, text = argument.option, argument.help.rstrip(".")
        if argument.default and argument.kind is not bool and "default" not in text:
            text += f" (default: {','.join(argument.words(argument.default))})"
        form: dict[str, Any] = {"default": argparse.SUPPRESS, "help": text.replace("%", "%%")}
        if not option.name.startswith("-"):
            nargs = option.count or (None if argument.required else "?")
            self.add_argument(argument.name, type=argument.value, nargs=nargs, metavar=option.name, **form)
            return
        form |= {"dest": argument.name, "required": argument.required}
        if argument.kind is bool:
            form |= {"action": "store_true"}
        else:
            choices = f"{{{','.join(option.choices)}}}" if option.choices else None
            form |= {"action": option.count or "store", "type": argument.value, "metavar": option.unit or choices}
        self.add_argument(*option.name.split(), **form)
