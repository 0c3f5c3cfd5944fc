"""What a command writes may not be what it reads: one check for all of them, before any work is done.

Every argument that names a file is an input, but those that say where results go. With `--replace` (`--force` is the
same where it has no other meaning) the old file is kept beside the new one.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from toolpath_stiff.errors import InputError, harmless
from toolpath_stiff.files import Content, check_outputs, keep_old, write_atomically
from toolpath_stiff.results_folder import Rules, check_folder, write_folder

if TYPE_CHECKING:
    from toolpath_stiff.api.results import FolderResult, Progress

LONGEST = 60  # letters of a default folder's name; of more files, the first and how many there are
DESTINATIONS = ("out", "output", "write")


def add_replace_option(parser: argparse.ArgumentParser, *, force: bool = True) -> None:
    """`--replace`, and `--force` for the same unless that means something else here."""
    parser.add_argument(
        "--replace",
        *(["--force"] if force else []),
        action="store_true",
        dest="replace",
        help="replace existing files that the tool did not write; the old ones are kept as NAME.old",
    )


def inputs_of(args: argparse.Namespace) -> Iterator[str]:
    """Every argument that may name a file to read; of a workbook's sheet, the workbook."""
    from toolpath_stiff.workbook import split_name

    for name, value in vars(args).items():
        if name not in DESTINATIONS:
            named = [one for one in (value if isinstance(value, list) else [value]) if isinstance(one, str) and one]
            yield from (split_name(one)[0] for one in named)


def check_written(
    args: argparse.Namespace, files: Iterable[str | Path | None], more_inputs: Iterable[str | Path] = ()
) -> list[Path]:
    """Refuse to write over an input; the inputs that are to be replaced, for `keep`.

    `files` are all that the command will write or remove. Raises `InputError`, which names --replace.
    """
    outputs = [file for file in files if file]
    return check_outputs(outputs, [*inputs_of(args), *more_inputs], args.replace)


def check_new(args: argparse.Namespace, file: str) -> list[Path]:
    """The same for a template, which writes over nothing at all."""
    if Path(file).exists() and not args.replace:
        raise InputError(
            f"{file!r} exists already", hint="choose another name, or say --replace: the old file is kept beside it"
        )
    return [Path(file)] if Path(file).exists() else []


def keep(replaced: Iterable[Path], quiet: bool = False) -> None:
    """Keep what is about to be replaced, and say where."""
    for file in replaced:
        kept = keep_old(file)
        if kept is not None and not quiet:
            tell_kept(file, kept)


def tell_kept(file: Path, kept: Path) -> None:
    """Say where an old file is."""
    print(f"kept the old {file} as {kept}")


@dataclass(frozen=True)
class Destination:
    """The folder for the results of a run, by what command, and what must not be replaced there."""

    folder: Path
    command: str
    rules: Rules

    def check(self, names: Iterable[str]) -> Destination:
        """Itself, if files of these names could be written. Raises `InputError`."""
        check_folder(self.folder, names, self.rules)
        return self

    def write(self, contents: Mapping[str, Content | Callable[[], Content]]) -> list[Path]:
        """Write the files, all or none; see `write_folder`."""
        return write_folder(self.folder, contents, command=self.command, rules=self.rules)


def show(
    args: argparse.Namespace,
    result: FolderResult,
    target: Destination,
    also: Mapping[str, Content] = MappingProxyType({}),
    **options: Any,
) -> int:
    """Save a result, then the files `also`, print it as text or as JSON; the exit code of success."""
    written = result.save(target.folder, plots=not args.no_plots, rules=target.rules, **options)
    written += [write_atomically(file, content) for file, content in also.items()]
    if args.json:
        sys.stdout.write(result.to_json())
    else:
        print(f"{result}\n{written_text(written)}")
    return 0


def written_text(files: Iterable[Path]) -> str:
    """What was written, a file a line."""
    from toolpath_stiff.report.words import plain

    return "\n".join(["written:", *(f"  {plain(str(file))}" for file in files)])


def destination(args: argparse.Namespace, command: str, sources: Sequence[str], suffix: str = "") -> Destination:
    """The folder of --out, else `reports/<sources><suffix>`, which then belongs to these sources."""
    rules = Rules(
        inputs=tuple(inputs_of(args)),
        of=() if args.out else tuple(sources),
        replace=args.replace,
        kept=None if args.json else tell_kept,
    )
    return Destination(Path(args.out or f"reports/{joined_names(sources)}{suffix}"), command, rules)


def joined_names(sources: Sequence[str]) -> str:
    """Files by their names without folder, ending and sheet: `first+second`."""
    from toolpath_stiff.workbook import split_name

    names = [Path(split_name(source)[0]).stem for source in sources]
    joined = "+".join(names)
    return joined if len(joined) <= LONGEST or len(names) == 1 else f"{names[0]}+{len(names) - 1}"


# -- progress ----------------------------------------------------------------------------------------------------------

QUIET_SECONDS = 0.5  # work shorter than this shows no bar
REDRAW_SECONDS = 0.1
WIDTH = 30


def say(text: str) -> None:
    """Replace the line of progress, where someone watches; "" takes it away."""
    if sys.stderr.isatty():
        # The one text that steers the terminal, past what takes control characters out of all others.
        stream = getattr(sys.stderr, "stream", sys.stderr)
        stream.write(f"\r\x1b[K{harmless(text)}")
        stream.flush()


@contextmanager
def progress_line(quiet: bool = False) -> Iterator[Progress | None]:
    """Yield what functions of the library call with (text, done, in all), or None where nobody watches.

    What has a number is drawn as a bar, once it takes longer than a moment; the line is taken away at the end.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    started: dict[str, float] = {}
    last = 0.0

    def draw(text: str, done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        start = started.setdefault(text, now)
        if not total:
            say(text)
            return
        if now - start < QUIET_SECONDS or now - last < REDRAW_SECONDS:
            return
        last = now
        filled = WIDTH * done // total
        bar = "#" * filled + "." * (WIDTH - filled)
        left = (now - start) * (total - done) / max(done, 1)
        say(f"{text} [{bar}] {done}/{total}, {left:.0f} s left ")

    try:
        yield draw
    finally:
        say("")
