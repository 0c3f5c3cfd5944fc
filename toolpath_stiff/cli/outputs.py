"""Files that commands write: never over what they read, and what was there before is kept.

What a command writes may not be what it reads: one check for all of them, before any work is done. Every argument that
names a file is an input, but those that say where results go. With `--replace` the old file is kept beside the new one.
"""

import sys
from argparse import Namespace
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from itertools import accumulate
from pathlib import Path
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content, check_outputs, encoded, is_file, keep_old, read_bytes, write_atomically
from toolpath_stiff.results import FolderResult, json_text
from toolpath_stiff.results_folder import Rules, check_folder, holds_others, incomplete, write_folder
from toolpath_stiff.workbooks import split_name

LONGEST = 60  # letters of a default folder's name; of more files, the first and how many there are
DESTINATIONS = ("out", "output", "write")


def tell(kind: str, texts: Iterable[object]) -> None:
    """Lines on standard error: of kind "note" or "warning"."""
    for text in texts:
        print(f"tps: {kind}: {text}", file=sys.stderr)


def show(args: Namespace, result: Any, *after: str, document: Callable[[], Any] | None = None) -> int:
    """Print a result (or its text, where `document` is told), and lines after it, or with --json its document.

    Returns the exit code of success.
    """
    if args.json:
        sys.stdout.write(json_text(document()) if document else result.to_json())
    else:
        print("\n".join([str(result), *after]).removesuffix("\n"))
    return 0


def written_text(files: Iterable[Path]) -> str:
    """What was written, a file a line."""
    return "\n".join(["written:", *(f"  {file}" for file in files)])


def inputs_of(args: Namespace) -> Iterator[str]:
    """Every argument that may name a file to read; of a workbook's sheet, the workbook."""
    for name, value in vars(args).items():
        if name not in DESTINATIONS:
            words = value if isinstance(value, list) else [value]
            yield from (split_name(word)[0] for word in words if isinstance(word, str) and word)


def tell_incomplete(args: Namespace) -> None:
    """Say which folders that a command reads from hold the results of a run that was stopped."""
    folders: dict[Path, None] = {}
    for path in map(Path, inputs_of(args)):
        with suppress(OSError, ValueError):  # no file can have that name
            folders |= {path if path.is_dir() else path.parent: None} if path.exists() else {}
    tell("warning", filter(None, map(incomplete, folders)))


def check_new(args: Namespace, file: str) -> None:
    """Raise `InputError` for a file that is there, unless it may be replaced."""
    if Path(file).exists() and not args.replace:
        raise InputError(
            f"{file!r} exists already", hint="choose another name, or say --replace: the old file is kept beside it"
        )


def check_single(args: Namespace, file: str | None, *more_inputs: str | Path) -> None:
    """Raise `InputError` where a file to write is an input, unless that may be replaced."""
    check_outputs([file] if file else [], [*inputs_of(args), *more_inputs], args.replace)


def write_single(args: Namespace, contents: Mapping[Path, Content], *more_inputs: str | Path) -> list[Path]:
    """Write files; what stands there and is not the same is kept. Raises `InputError` where one is an input."""
    written = []
    for file, made in contents.items():
        check_single(args, str(file), *more_inputs)
        content = b"".join(encoded(made)) if is_file(file) else made
        if is_file(file) and read_bytes(file, "file") != content:
            kept = keep_old(file)
            if kept is not None and not getattr(args, "json", False):
                tell_kept(file, kept)
        written.append(write_atomically(file, content))
    return written


def tell_kept(file: Path, kept: Path) -> None:
    """Say where an old file is."""
    print(f"kept the old {file} as {kept}")


@dataclass(frozen=True)
class Destination:
    """The folder for the results of a run, and what must not be replaced there."""

    folder: Path
    rules: Rules

    def write(self, result: FolderResult, **options: Any) -> str:
        """Write the files of a result, all or none; what was written, a file a line."""
        files = result.files(**options)
        return written_text(write_folder(self.folder, files, command=result.command, rules=self.rules))


def destination(
    args: Namespace, kind: type[FolderResult], sources: Sequence[str], omit: Collection[str] = ()
) -> Destination:
    """The folder of --out, else `reports/<sources>-<command>` or a longer name, which then belongs to these sources.

    Raises `InputError` where the files of a result of this kind, but for `omit`, cannot be written.
    """
    suffix = "" if kind.command == "analyze" else f"-{kind.command}"
    folder = Path(args.out) if args.out else _default_folder(sources, suffix)
    rules = Rules(
        inputs=tuple(inputs_of(args)),
        of=() if args.out else tuple(sources),
        replace=args.replace,
        kept=None if args.json else tell_kept,
    )
    names = import_module("toolpath_stiff.report.folder").names
    check_folder(folder, names(kind.shown_by, not args.no_plots, omit), rules)
    return Destination(folder, rules)


def _default_folder(sources: Sequence[str], suffix: str) -> Path:
    """`reports/NAME`; where that holds results of another file of the name, the folder above stands before it."""
    names = [Path(split_name(source)[0]).stem for source in sources]
    name = "+".join(names)
    if len(name) > LONGEST and len(names) > 1:
        name = f"{names[0]}+{len(names) - 1}"
    above = [folder.name for folder in Path(split_name(sources[0])[0]).absolute().parents]
    longer = accumulate(["", *above], lambda after, folder: f"{folder}-{after}")
    folders = [Path(f"reports/{before}{name}{suffix}") for before in longer]
    return next((folder for folder in folders if not holds_others(folder, sources)), folders[0])
