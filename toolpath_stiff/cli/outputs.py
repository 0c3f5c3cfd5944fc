"""Files that commands write: never over what they read, and what was there before is kept.

What a command writes may not be what it reads: one check for all of them, before any work is done. Every argument that
names a file is an input, but those that say where results go. With `--replace` (`--force` is the same where it has no
other meaning) the old file is kept beside the new one.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content, check_outputs, encoded, is_file, keep_old, read_bytes
from toolpath_stiff.results_folder import Rules, check_folder, holds_others, incomplete, write_folder

if TYPE_CHECKING:
    from toolpath_stiff.results import FolderResult

LONGEST = 60  # letters of a default folder's name; of more files, the first and how many there are
PNG, PNG_HEAD_BYTES = b"\x89PNG", 54  # signature, IHDR and pHYs, in which other writers differ
MARK_BYTES = 4096  # of a file, within which a command knows what it wrote itself
DESTINATIONS = ("out", "output", "write")


def inputs_of(args: Namespace) -> Iterator[str]:
    """Every argument that may name a file to read; of a workbook's sheet, the workbook."""
    from toolpath_stiff.workbooks import split_name

    for name, value in vars(args).items():
        if name not in DESTINATIONS:
            named = [one for one in (value if isinstance(value, list) else [value]) if isinstance(one, str) and one]
            yield from (split_name(one)[0] for one in named)


def tell_incomplete(folders: Iterable[Path]) -> None:
    """Say which of these folders hold the results of a run that was stopped."""
    for told in filter(None, map(incomplete, dict.fromkeys(folders))):
        print(f"tps: warning: {told}", file=sys.stderr)


def read_folders(args: Namespace) -> list[Path]:
    """The folders that a command reads from."""
    found = []
    for name in inputs_of(args):
        with suppress(OSError, ValueError):  # no file can have that name
            found += [Path(name) if Path(name).is_dir() else Path(name).parent] if Path(name).exists() else []
    return found


def check_written(
    args: Namespace, files: Iterable[str | Path | None], more_inputs: Iterable[str | Path] = ()
) -> list[Path]:
    """Refuse to write over an input; the inputs that are to be replaced, for `keep`.

    `files` are all that the command will write or remove. Raises `InputError`, which names --replace.
    """
    outputs = [file for file in files if file]
    return check_outputs(outputs, [*inputs_of(args), *more_inputs], args.replace)


def check_new(args: Namespace, file: str) -> list[Path]:
    """The same for a template, which writes over nothing at all."""
    if Path(file).exists() and not args.replace:
        raise InputError(
            f"{file!r} exists already", hint="choose another name, or say --replace: the old file is kept beside it"
        )
    return [Path(file)] if Path(file).exists() else []


def check_single(args: Namespace, file: str | None, mark: bytes = b"") -> list[Path]:
    """The same for one file of a name that the user chose; what stands there is to be kept unless it bears the mark.

    A single file has no record of what wrote it, as a folder has: `mark` is at the head of what the tool writes.
    """
    replaced = check_written(args, [file])
    if not file or replaced or not is_file(file):
        return replaced
    try:
        with Path(file).open("rb") as stream:
            ours = bool(mark) and mark in stream.read(MARK_BYTES)
    except OSError:
        ours = False
    return [] if ours else [Path(file)]


def check_made(args: Namespace, contents: Mapping[Path, Content]) -> list[Path]:
    """The same for files whose content is made already; what stands there is to be kept unless it is the tool's.

    That is what has the same content, and a picture of the same size and resolution that begins as ours do.
    """
    replaced = check_written(args, contents)
    for file, content in contents.items():
        made = b"".join(encoded(content))
        begin = made[:PNG_HEAD_BYTES] if made.startswith(PNG) else made
        if file not in replaced and is_file(file):
            found = read_bytes(file, "file")
            if found != made and not (begin is not made and found.startswith(begin)):
                replaced.append(file)
    return replaced


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

    def write(
        self,
        contents: Mapping[str, Content | Callable[[], Content]],
        elsewhere: Mapping[str | Path, Content] = MappingProxyType({}),
    ) -> list[Path]:
        """Write the files, all or none, and those elsewhere; see `write_folder`."""
        return write_folder(self.folder, contents, command=self.command, rules=self.rules, elsewhere=elsewhere)


def show(
    args: Namespace,
    result: FolderResult,
    target: Destination,
    also: Mapping[str | Path, Content] = MappingProxyType({}),
    **options: Any,
) -> int:
    """Save a result and the files `also`, print it as text or as JSON; the exit code of success."""
    files = result.files(plots=not args.no_plots, **options)
    written = [*target.write(files, also), *map(Path, also)]
    if args.json:
        sys.stdout.write(result.to_json())
    else:
        print(f"{result}\n{written_text(written)}")
    return 0


def written_text(files: Iterable[Path]) -> str:
    """What was written, a file a line."""
    from toolpath_stiff.report.words import plain

    return "\n".join(["written:", *(f"  {plain(str(file))}" for file in files)])


def destination(args: Namespace, command: str, sources: Sequence[str], suffix: str = "") -> Destination:
    """The folder of --out, else `reports/<sources><suffix>` or a longer name, which then belongs to these sources."""
    rules = Rules(
        inputs=tuple(inputs_of(args)),
        of=() if args.out else tuple(sources),
        replace=args.replace,
        kept=None if args.json else tell_kept,
    )
    return Destination(Path(args.out) if args.out else _default_folder(sources, suffix), command, rules)


def _default_folder(sources: Sequence[str], suffix: str) -> Path:
    """`reports/NAME`; where that holds results of another file of the name, the folder above stands before it."""
    from toolpath_stiff.workbooks import split_name

    name = joined_names(sources)
    default = folder = Path(f"reports/{name}{suffix}")
    for above in Path(split_name(sources[0])[0]).absolute().parents:
        if not holds_others(folder, sources):
            return folder
        name = f"{above.name}-{name}"
        folder = Path(f"reports/{name}{suffix}")
    return default


def joined_names(sources: Sequence[str]) -> str:
    """Files by their names without folder, ending and sheet: `first+second`."""
    from toolpath_stiff.workbooks import split_name

    names = [Path(split_name(source)[0]).stem for source in sources]
    joined = "+".join(names)
    return joined if len(joined) <= LONGEST or len(names) == 1 else f"{names[0]}+{len(names) - 1}"
