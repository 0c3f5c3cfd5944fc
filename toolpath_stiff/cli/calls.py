"""Public functions called by what a command line gives."""

from __future__ import annotations

import inspect
from argparse import Namespace
from collections.abc import Callable
from typing import Any, TypeVar

import toolpath_stiff as tps
from toolpath_stiff.cli.progress import progress_line
from toolpath_stiff.options import arguments_of

Made = TypeVar("Made")


def given(args: Namespace, *functions: Callable[..., Any]) -> dict[str, Any]:
    """The arguments of functions that a command line gives."""
    names = {name for function in functions for name in arguments_of(function)}
    return {name: value for name, value in vars(args).items() if name in names}


def machine_for(args: Namespace) -> tps.Machine:
    """The machine that the options describe. Raises `InputError`."""
    return tps.Machine.load(**given(args, tps.Machine.load)).under(**given(args, tps.Machine.under))


def program_for(args: Namespace, file: str | None = None) -> tps.Program | None:
    """A program (unless told, the one that is named), read as the options say. Raises `InputError`."""
    file = file or args.program
    return tps.Program.read(file, **given(args, tps.Program.read)) if file else None


def data_for(args: Namespace) -> tps.Measurements | None:
    """The measurements; they are read for the machine."""
    return tps.Measurements(args.data, args.columns) if args.data else None


INPUTS: dict[str, Callable[[Namespace], Any]] = {"program": program_for, "data": data_for, "machine": machine_for}


def call(args: Namespace, function: Callable[..., Made], **more: Any) -> Made:
    """What a public function makes of a command line: options by their names, program, measurements and machine."""
    parameters = inspect.signature(function).parameters
    values = given(args, function) | more
    values |= {name: make(args) for name, make in INPUTS.items() if name in parameters and name not in more}
    with progress_line(quiet=getattr(args, "json", False)) as progress:
        return function(**values, **({"progress": progress} if "progress" in parameters else {}))
