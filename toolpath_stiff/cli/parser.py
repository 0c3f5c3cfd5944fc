"""Commands as functions: their options are those of the functions that they call, their help is their docstring."""

from __future__ import annotations

import argparse
import difflib
import re
from argparse import Namespace
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from toolpath_stiff.cli.outputs import read_folders, tell_incomplete
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import SWITCHES, Argument, Option, arguments_of

# argparse takes "-10,0,800" or "-300:300" for an option; this matches every value that begins like a negative number.
NEGATIVE_VALUE = re.compile(r"^-(\d|\.\d|inf|nan)")


def own(
    words: str,
    text: str = "",
    *,
    name: str = "",
    kind: type = str,
    default: Any = None,
    required: bool = False,
    **option: Any,
) -> Argument:
    """An argument of a command alone: "--at PLAN.csv", a switch "--csv", or "DATA", which stands alone."""
    names = [word for word in words.split() if word.startswith("-")]
    unit = words.removeprefix(" ".join(names)).strip()
    if not names:
        needed = option.get("count", "+") == "+"
        return Argument(name or unit.lower(), Option(unit, **option), text, kind, default, needed)
    switch = not unit and "choices" not in option
    name = name or names[-1].strip("-").replace("-", "_")
    given_default = False if switch else default
    return Argument(
        name, Option(" ".join(names), unit, **option), text, bool if switch else kind, given_default, required
    )


PROGRAM = own("PROGRAM", "NC program or cutter-location file")
DATA = own("DATA", "measurement files (CSV, or FILE.xlsx[#SHEET]), or nist-table1", count="+")
REPLACE = own("--replace", "replace existing files that the tool did not write; the old ones are kept as NAME.old")
NO_PLOTS = own("--no-plots", "tables and figures in numbers only, no pictures")
JSON = own("--json", "print JSON to standard output and nothing else")
OUT = own("--out DIR", "folder of the results (default: one in reports, named after the input)")
FOLDER = (OUT, REPLACE, NO_PLOTS, JSON)


class Command:
    """A command: what runs it and gives the exit code; functions whose options it takes, and arguments of its own."""

    def __init__(
        self,
        run: Callable[[Namespace], int],
        *takes: Callable[..., Any] | Argument,
        without: Sequence[str] = (),
    ) -> None:
        self.run, self.takes, self.without = run, takes, without

    @property
    def arguments(self) -> dict[str, Argument]:
        """All arguments by name; of one that several functions take, the first."""
        arguments: dict[str, Argument] = {}
        for part in self.takes:
            taken = {part.name: part} if isinstance(part, Argument) else arguments_of(part)
            arguments |= {name: argument for name, argument in taken.items() if name not in arguments}
        return {name: argument for name, argument in arguments.items() if name not in self.without}

    def __call__(self, name: str, words: Sequence[str]) -> int:
        """Run the command; the exit code. Raises `InputError`."""
        args = self.read(name, words)
        tell_incomplete(read_folders(args))
        return self.run(args)

    def parser(self, name: str) -> Parser:
        """The parser of its arguments."""
        about, _, examples = (self.run.__doc__ or "").partition("\n\n")
        parser = Parser(name, about, "\n".join(line.removeprefix("    ") for line in examples.splitlines()).rstrip())
        arguments = self.arguments
        forces = any(argument.option.name == "--force" for argument in arguments.values())
        for argument in arguments.values():
            parser.add(argument, also=() if forces or argument.name != "replace" else ("--force",))
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
        for argument in arguments.values():
            other = arguments.get(argument.option.instead_of)
            if other is not None and argument.name in values and other.name in values:
                raise InputError(f"{argument.option.name} with {other.option.name}", expected="one of the two")
        return Namespace(**{key: argument.default for key, argument in arguments.items()} | values)


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

    def add(self, argument: Argument, also: Sequence[str] = ()) -> None:
        """Take an argument as words."""
        option, kinds = argument.option, dict[str, Any](default=argparse.SUPPRESS)
        text = (argument.help or option.help).rstrip(".")
        if argument.default and argument.kind is not bool and "default" not in text:
            parts = argument.default if isinstance(argument.default, tuple) else (argument.default,)
            text += f" (default: {':'.join(f'{part:g}' if isinstance(part, float) else str(part) for part in parts)})"
        kinds["help"] = text.replace("%", "%%")
        if argument.kind is bool:
            self.add_argument(*option.name.split(), *also, dest=argument.name, action="store_true", **kinds)
            return
        number = argument.kind in (int, float)
        unit = option.unit.upper().replace("%", "PERCENT") or "N" if number else option.unit
        kinds["metavar"] = unit or (f"{{{','.join(option.choices)}}}" if option.choices else None)
        if option.name.startswith("-"):
            if option.count:
                kinds["action"] = option.count
            self.add_argument(*option.name.split(), dest=argument.name, required=argument.required, **kinds)
        else:
            count = option.count or (None if argument.required else "?")
            self.add_argument(argument.name, nargs=count, **{**kinds, "metavar": option.name})


def whole_options(words: Sequence[str]) -> list[str]:
    """`--block-delete` before anything but switches is the whole option: what follows is a program."""
    return [
        f"{word}=" if word == "--block-delete" and not SWITCHES.fullmatch(after) else word
        for word, after in zip(words, [*words[1:], ""], strict=False)
    ]
