"""Shared steps of the commands: calling public functions with a command line, showing and writing results.

What a command writes may not be what it reads: one check for all of them, before any work is done. Every argument that
names a file is an input, but those that say where results go. With `--replace` the old file is kept beside the new one.
"""

import inspect
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import toolpath_stiff as tps
from toolpath_stiff.errors import InputError, harmless
from toolpath_stiff.files import Content, check_outputs, old_name, write_atomically
from toolpath_stiff.hints import command_line, hint
from toolpath_stiff.options import arguments_of
from toolpath_stiff.results import FolderResult, Progress, json_text
from toolpath_stiff.results_folder import Rules, check_folder
from toolpath_stiff.workbooks import split_name

Made = TypeVar("Made")
REDRAW_SECONDS = 0.5  # shorter work shows no progress
LONGEST = 60  # letters of a default folder's name; of more files, the first and how many there are
DESTINATIONS = ("out", "output", "write")


def given(args: Namespace, *functions: Callable[..., Any]) -> dict[str, Any]:
    """Arguments of functions that the command line gives."""
    names = {name for function in functions for name in arguments_of(function)}
    return {name: value for name, value in vars(args).items() if name in names}


def machine_for(args: Namespace) -> tps.Machine:
    """Machine that the options describe. Raises `InputError`."""
    return tps.Machine.load(**given(args, tps.Machine.load)).under(**given(args, tps.Machine.under))


def call(args: Namespace, function: Callable[..., Made], **more: Any) -> Made:
    """Result of a public function called from the command line: options by name, program, measurements and machine."""
    parameters = inspect.signature(function).parameters
    values = given(args, function) | more
    if "program" in parameters and "program" not in more:
        values["program"] = tps.Program.read(args.program, **given(args, tps.Program.read)) if args.program else None
    if "data" in parameters and "data" not in more:
        values["data"] = tps.Measurements(args.data, args.columns) if args.data else None
    if "machine" in parameters and "machine" not in more:
        values["machine"] = machine_for(args)
    with progress_line() as progress:
        return function(**values, **({"progress": progress} if "progress" in parameters else {}))


@contextmanager
def progress_line() -> Iterator[Progress | None]:
    """Yield the progress callback for library functions, (text, done, total), or None where nobody watches.

    It draws a line on the terminal, which is taken away at the end.
    """
    last = time.monotonic()

    def draw(text: str, done: int, total: int) -> None:
        nonlocal last
        if not total or time.monotonic() - last > REDRAW_SECONDS:
            last = time.monotonic()
            say(f"{text} {done}/{total} " if total else text)

    def say(text: str) -> None:
        # The one text that steers the terminal: it bypasses the filter of control characters.
        stream = getattr(sys.stderr, "stream", sys.stderr)
        print(f"\r\x1b[K{harmless(text)}", end="", file=stream, flush=True)

    if not sys.stderr.isatty():
        yield None
        return
    try:
        yield draw
    finally:
        say("")


def tell(kind: str, texts: Iterable[object]) -> None:
    """Print lines of a kind ("note" or "warning") on standard error."""
    for text in texts:
        print(f"tps: {kind}: {text}", file=sys.stderr)


def show(args: Namespace, result: Any, *after: str, document: Callable[[], Any] | None = None, code: int = 0) -> int:
    """Print a result (or only its text, if `document` is given) and lines after it, or with --json its document.

    Returns the exit code.
    """
    if args.json:
        sys.stdout.write(json_text(document()) if document else result.to_json())
    else:
        print("\n".join([str(result), *after]).removesuffix("\n"))
    return code


def written_text(files: Iterable[Path]) -> str:
    """List of the files written, one a line."""
    return "\n".join(["written:", *(f"  {file}" for file in files)])


def rules_of(args: Namespace, **more: Any) -> Rules:
    """Rules against overwriting: every argument that may name a file is an input; of a sheet, its workbook."""
    values = [value for name, value in vars(args).items() if name not in DESTINATIONS]
    words = [word for value in values for word in (value if isinstance(value, list) else [value])]
    inputs = tuple(split_name(word)[0] for word in words if isinstance(word, str) and word)
    return Rules(inputs, replace=args.replace, kept=None if getattr(args, "json", False) else tell_kept, **more)


def tell_kept(file: Path, kept: Path) -> None:
    """Tell where an old file is kept."""
    print(f"kept the old {file} as {kept}")


def check_single(args: Namespace, file: str | Path | None, *more_inputs: str | Path) -> None:
    """Raise `InputError` if a file to write is an input, unless it may be replaced."""
    check_outputs([file] if file else [], [*rules_of(args).inputs, *more_inputs], args.replace)


def write_single(
    args: Namespace, contents: Mapping[Path, Content], *more_inputs: str | Path, fresh: bool = False
) -> list[Path]:
    """Write files; an existing file with other content is kept, or refused with `fresh`.

    Raises `InputError` for a file that is an input.
    """
    for file, content in contents.items():
        if fresh and file.exists() and not args.replace:
            hint = "choose another name, or say --replace: the old file is kept beside it"
            raise InputError(f"{str(file)!r} exists already", hint=hint)
        check_single(args, file, *more_inputs)
        kept = old_name(file)
        write_atomically(file, content, keep=True)
        if kept.exists() and not getattr(args, "json", False):
            tell_kept(file, kept)
    return [*contents]


def write_text(args: Namespace, file: str, text: str, sentence: str, *words: str, fresh: bool = False) -> int:
    """Write a file, tell which and the next command; returns the exit code of success. Raises as `write_single`."""
    written = write_single(args, {Path(file): text}, fresh=fresh)
    print(written_text(written), hint(sentence, command_line(*words)), sep="\n")
    return 0


def destination(
    args: Namespace, kind: type[FolderResult], sources: Sequence[str], omit: Collection[str] = ()
) -> tuple[Path, Rules]:
    """Folder of --out, else `reports/<sources>-<command>`; and the rules of what may be overwritten there.

    Raises `InputError` where the files of a result of this kind, but for `omit`, cannot be written.
    """
    names = [Path(split_name(source)[0]).stem for source in sources]
    name = "+".join(names)
    if len(name) > LONGEST and len(names) > 1:
        name = f"{names[0]}+{len(names) - 1}"
    folder = Path(args.out or f"reports/{name}{'' if kind.command == 'analyze' else f'-{kind.command}'}")
    rules = rules_of(args, of=() if args.out else tuple(sources))
    files = import_module("toolpath_stiff.report.folder").names(kind.shown_by, not args.no_plots, omit)
    check_folder(folder, files, rules)
    return folder, rules


def to_folder(
    args: Namespace,
    function: Callable[..., FolderResult],
    kind: type[FolderResult],
    sources: Sequence[str],
    **more: Any,
) -> int:
    """Make a result, write its folder and print it; returns the exit code of success."""
    folder, rules = destination(args, kind, sources)
    result = call(args, function, **more)
    return show(args, result, written_text(result.save(folder, plots=not args.no_plots, rules=rules)))
