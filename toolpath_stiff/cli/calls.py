"""Public functions called by what a command line gives."""

import inspect
from argparse import Namespace
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import toolpath_stiff as tps
from toolpath_stiff.cli.outputs import destination, show
from toolpath_stiff.cli.progress import progress_line
from toolpath_stiff.options import arguments_of
from toolpath_stiff.results import FolderResult

Made = TypeVar("Made")


def given(args: Namespace, *functions: Callable[..., Any]) -> dict[str, Any]:
    """The arguments of functions that a command line gives."""
    names = {name for function in functions for name in arguments_of(function)}
    return {name: value for name, value in vars(args).items() if name in names}


def machine_for(args: Namespace) -> tps.Machine:
    """The machine that the options describe. Raises `InputError`."""
    return tps.Machine.load(**given(args, tps.Machine.load)).under(**given(args, tps.Machine.under))


def call(args: Namespace, function: Callable[..., Made], **more: Any) -> Made:
    """What a public function makes of a command line: options by their names, program, measurements and machine."""
    parameters = inspect.signature(function).parameters
    values = given(args, function) | more
    if "program" in parameters and "program" not in more:
        values["program"] = tps.Program.read(args.program, **given(args, tps.Program.read)) if args.program else None
    if "data" in parameters:
        values["data"] = tps.Measurements(args.data, args.columns) if args.data else None
    if "machine" in parameters and "machine" not in more:
        values["machine"] = machine_for(args)
    with progress_line(quiet=getattr(args, "json", False)) as progress:
        return function(**values, **({"progress": progress} if "progress" in parameters else {}))


def run_to_folder(
    args: Namespace,
    function: Callable[..., FolderResult],
    kind: type[FolderResult],
    sources: Sequence[str],
    **more: Any,
) -> int:
    """Make a result, write its folder, print it; the exit code of success."""
    target = destination(args, kind, sources)
    result = call(args, function, **more)
    return show(args, result, target.write(result, plots=not args.no_plots))
