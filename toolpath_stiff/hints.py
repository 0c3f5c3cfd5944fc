"""Commands to paste, written in one place: quoted for the shell, with every option of the run that still matters.

A hint is a sentence and, on a line of its own that no page or terminal breaks, the command. In a result it
is one text: the sentence, a colon, a line feed, the command.
"""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import PurePath

from toolpath_stiff import defaults


def command_line(*words: object) -> str:
    """A command line of `tps`, quoted for the shell."""
    return shlex.join(["tps", *map(str, words)])


def hint(sentence: str, line: str) -> str:
    """A sentence followed by the command that it asks for."""
    return f"{sentence}:\n{line}"


def parted(text: str) -> tuple[str, str]:
    """Sentence and command of a hint; the command is "" where there is none."""
    sentence, _, line = text.partition("\n")
    return sentence, line


def options(**given: object) -> list[str]:
    """`--name value` of every argument given (neither None nor False); lists repeat it, True has no value."""
    line: list[str] = []
    for name, value in given.items():
        option = "--" + name.replace("_", "-")
        for word in value if isinstance(value, list | tuple) else [value]:
            line += [] if word is None or word is False else [option] if word is True else [option, str(word)]
    return line


@dataclass(frozen=True)
class Asked:
    """Data and options that a command on measurements was run with, for the commands suggested next.

    Attributes
    ----------
    data
        Measurement files.
    machine
        Name or file.
    effects
        Files with the user's own effects.
    columns
        Columns that the files name differently, as --columns has it.
    stated
        What is stated of the noise, as words of the command line.
    """

    data: tuple[str, ...]
    machine: str = defaults.MACHINE
    effects: tuple[str, ...] = ()
    columns: str | None = None
    stated: tuple[str, ...] = ()

    def command(self, name: str, *further: str, machine: str | None = None, effects: Sequence[str] = ()) -> str:
        """`tps name` on the same data with the same options; `further` words of that command follow the machine.

        `name` may be two words, "effects draft". `machine` is another one, `effects` are further files.
        """
        chosen = machine or self.machine
        return command_line(
            *name.split(),
            *self.data,
            *options(columns=self.columns, machine=chosen if chosen != defaults.MACHINE else None),
            *further,
            *options(effects=[*self.effects, *effects]),
            *self.stated,
        )

    @property
    def updated_machine(self) -> str:
        """File name for the machine that an update writes: beside the present machine file, never the same."""
        path = PurePath(self.machine)
        stem = path.stem if path.suffix == ".toml" else path.name
        return str(path.with_name(f"{stem}-updated.toml"))

    def new_effect(self, stem: str = "my_effect", ending: str = ".py") -> str:
        """File name for a new effect of the user's own, not among those given."""
        taken = {PurePath(file).name for file in self.effects}
        names = (f"{stem}{f'_{number}' if number > 1 else ''}{ending}" for number in count(1))
        return next(name for name in names if name not in taken)
