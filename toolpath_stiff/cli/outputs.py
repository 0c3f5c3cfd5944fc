"""Files that commands write: never over what they read, and what was there before is kept.

What a command writes may not be what it reads: one check for all of them, before any work is done. Every argument that
names a file is an input, but those that say where results go. With `--replace` (`--force` is the same where it has no
other meaning) the old file is kept beside the new one.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content, check_outputs, encoded, is_file, keep_old, read_bytes, write_atomically
from toolpath_stiff.results import FolderResult, json_text
from toolpath_stiff.results_folder import Rules, check_folder, holds_others, incomplete, write_folder
from toolpath_stiff.workbooks import split_name

LONGEST = 60  # letters of a default folder's name; of more files, the first and how many there are
PNG, PNG_HEAD_BYTES = b"\x89PNG", 54  # signature, IHDR and pHYs, in which other writers differ
MARK_BYTES = 4096  # of a file, within which a command knows what it wrote itself
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
    from toolpath_stiff.report.words import plain

    return "\n".join(["written:", *(f"  {plain(str(file))}" for file in files)])


def inputs_of(args: Namespace) -> Iterator[str]:
    """Every argument that may name a file to read; of a workbook's sheet, the workbook."""
    for name, value in vars(args).items():
        if name not in DESTINATIONS:
            words = value if isinstance(value, list) else [value]
            yield from (split_name(word)[0] for word in words if isinstance(word, str) and word)


def tell_incomplete(folders: Iterable[Path]) -> None:
    """Say which of these folders hold the results of a run that was stopped."""
    tell("warning", filter(None, map(incomplete, dict.fromkeys(folders))))


def read_folders(args: Namespace) -> list[Path]:
    """The folders that a command reads from."""
    folders = []
    for path in map(Path, inputs_of(args)):
        with suppress(OSError, ValueError):  # no file can have that name
            folders += [path if path.is_dir() else path.parent] if path.exists() else []
    return folders


def check_new(args: Namespace, file: str) -> list[Path]:
    """The file if it is there, for `keep`. Raises `InputError` then unless it may be replaced."""
    if Path(file).exists() and not args.replace:
        raise InputError(
            f"{file!r} exists already", hint="choose another name, or say --replace: the old file is kept beside it"
        )
    return [Path(file)] if Path(file).exists() else []


def check_single(args: Namespace, file: str | None, mark: bytes = b"") -> list[Path]:
    """The file if it is there and not the tool's, for `keep`. Raises `InputError` where it is an input.

    A single file has no record of what wrote it, as a folder has: `mark` is at the head of what the tool writes.
    """
    if not file:
        return []
    replaced = check_outputs([file], inputs_of(args), args.replace)
    if replaced or not is_file(file):
        return replaced
    with suppress(OSError), Path(file).open("rb") as stream:
        if mark and mark in stream.read(MARK_BYTES):
            return []
    return [Path(file)]


def write_made(args: Namespace, contents: Mapping[Path, Content], more_inputs: Iterable[str | Path] = ()) -> list[Path]:
    """Write files; what stands there is kept unless it is the tool's. Raises `InputError` where one is an input.

    The tool's is what has the same content, and a picture of the same size and resolution that begins as ours do.
    """
    replaced = check_outputs(contents, [*inputs_of(args), *more_inputs], args.replace)
    for file, content in contents.items():
        made = b"".join(encoded(content))
        begin = made[:PNG_HEAD_BYTES] if made.startswith(PNG) else made
        if file not in replaced and is_file(file):
            present = read_bytes(file, "file")
            if present != made and not (begin is not made and present.startswith(begin)):
                replaced.append(file)
    keep(replaced, quiet=getattr(args, "json", False))
    return [write_atomically(file, content) for file, content in contents.items()]


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

    def write(
        self, result: FolderResult, elsewhere: Mapping[str, Content] = MappingProxyType({}), **options: Any
    ) -> list[Path]:
        """Write the files of a result, all or none, and those elsewhere; see `write_folder`."""
        files = result.files(**options)
        others: dict[str | Path, Content] = dict(elsewhere.items())
        return write_folder(self.folder, files, command=self.command, rules=self.rules, elsewhere=others)


def destination(
    args: Namespace, kind: type[FolderResult], sources: Sequence[str], omit: Collection[str] = ()
) -> Destination:
    """The folder of --out, else `reports/<sources>-<command>` or a longer name, which then belongs to these sources.

    Raises `InputError` where the files of a result of this kind, but for `omit`, cannot be written.
    """
    suffix = "" if kind.command == "analyze" else f"-{kind.command}"
    rules = Rules(
        inputs=tuple(inputs_of(args)),
        of=() if args.out else tuple(sources),
        replace=args.replace,
        kept=None if args.json else tell_kept,
    )
    target = Destination(Path(args.out) if args.out else _default_folder(sources, suffix), kind.command, rules)
    names = import_module("toolpath_stiff.report.folder").names
    check_folder(target.folder, names(kind.shown_by, not args.no_plots, omit), rules)
    return target


def _default_folder(sources: Sequence[str], suffix: str) -> Path:
    """`reports/NAME`; where that holds results of another file of the name, the folder above stands before it."""
    names = [Path(split_name(source)[0]).stem for source in sources]
    name = "+".join(names)
    if len(name) > LONGEST and len(names) > 1:
        name = f"{names[0]}+{len(names) - 1}"
    default = folder = Path(f"reports/{name}{suffix}")
    for above in Path(split_name(sources[0])[0]).absolute().parents:
        if not holds_others(folder, sources):
            return folder
        name = f"{above.name}-{name}"
        folder = Path(f"reports/{name}{suffix}")
    return default
