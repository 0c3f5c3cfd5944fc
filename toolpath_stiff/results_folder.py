"""A results folder: it holds the files of one run and of no other.

A small manifest (`.tps-files.json`) names the files that a run wrote, with their checksums. The next run clears
those, and nothing else: a file that the tool did not write, or that was changed since, is somebody's own. It stays
where the run has no file of that name, and where it has one, nothing is written at all. A folder without a manifest
holds nothing of the tool's.

The new files are made in a hidden folder within, which only one run can hold; an error until then leaves the results
as they were. Then the old ones are taken away and the new ones renamed, and meanwhile `INCOMPLETE.txt` says so.
"""

import json
import os
import shutil
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import BLOCK, Content, check_outputs, old_name, write_new, writing_errors

try:
    import fcntl
except ImportError:  # Windows: there nothing keeps two runs apart
    fcntl = None  # type: ignore[assignment]

MANIFEST = ".tps-files.json"
INCOMPLETE = "INCOMPLETE.txt"
STAGE = ".tps-stage"  # the hidden folder; what a killed run left in it the next run takes away
ELSEWHERE = "choose another folder with --out"
REPLACE = f"{ELSEWHERE}, or say --replace (replace=True): the old file is kept beside the new one"


@dataclass(frozen=True)
class Rules:
    """Files that a run must not replace or clear, besides those that the tool did not write.

    Attributes
    ----------
    inputs
        Files that the run reads.
    of
        What the results are of, where the folder is named after it by default: results of another file of the same
        name are not replaced then.
    fresh
        Files of earlier runs of the tool are not replaced either.
    replace
        Nothing is refused: what is in the way is kept beside the new file, as `NAME.old`.
    kept
        Called with each such file and the one that it is kept as.
    """

    inputs: tuple[str | Path, ...] = ()
    of: tuple[str, ...] = ()
    fresh: bool = False
    replace: bool = False
    kept: Callable[[Path, Path], None] | None = None


def write_folder(
    folder: str | Path,
    contents: Mapping[str, Content | Callable[[], Content]],
    *,
    command: str,
    rules: Rules = Rules(),
    unfinished: bool = False,
) -> list[Path]:
    """Write the files of one run, all or none, and clear those of an earlier run; the folder is made if need be.

    Parameters
    ----------
    folder
        Where to.
    contents
        File name -> content, or a function that makes it: contents are made one at a time.
    command
        Name of the command, for the manifest.
    rules
        What must not be replaced, and what to do about it.
    unfinished
        Whether the run goes on to write: the folder is marked as incomplete until its next files.

    Returns
    -------
    list of Path
        The files written to it, the manifest left out.

    Raises
    ------
    InputError
        A file of such a name is not the tool's, is an input, or the folder cannot be written. Nothing is changed then.
    """
    target, note = Path(folder), Path(folder, INCOMPLETE)
    with writing_errors(folder, "write to"), _stage(target) as stage:
        in_the_way = check_folder(target, contents, rules)
        for name, content in contents.items():
            write_new(stage / name, content() if callable(content) else content)
        sums = {name: checksum(stage / name) for name in contents}
        # Nothing in it depends on when or by whom it was written. Escaped, as names need not be UTF-8.
        document = {"written_by": f"tps {command}", "results_of": _relative(target, rules.of), "checksums": sums}
        write_new(stage / MANIFEST, json.dumps(document, indent=1) + "\n")
        if not note.exists():
            write_new(note, f"`tps {command}` writes here. While this file is here, run it again.\n")
        _, old = read_manifest(target)
        for file in (target / name for name in old):
            if file not in in_the_way and _is_ours(file, old):
                file.unlink()
        for file in (*in_the_way, *(target / name for name in contents)):
            if os.path.lexists(file):
                kept = file.rename(old_name(file))
                if rules.kept is not None:
                    rules.kept(file, kept)
        for name in (MANIFEST, *contents):
            (stage / name).replace(target / name)
        if not unfinished:
            note.unlink()
    return [target / name for name in contents]


@contextmanager
def _stage(folder: Path) -> Iterator[Path]:
    """An empty folder inside, held by one run at a time: the next one waits, if the file system has locks."""
    folder.mkdir(parents=True, exist_ok=True)
    lock = os.open(folder, os.O_RDONLY) if fcntl else -1
    stage = folder / STAGE
    try:
        if fcntl:
            with suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_EX)  # it ends with the process
        shutil.rmtree(stage, ignore_errors=True)
        stage.mkdir()
        yield stage
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        if fcntl:
            os.close(lock)


def check_folder(folder: str | Path, names: Iterable[str], rules: Rules = Rules()) -> list[Path]:
    """Check before computing that `write_folder` will not refuse; returns the files that `rules.replace` will keep.

    Raises
    ------
    InputError
        As `write_folder`.
    """
    target = Path(folder)
    of, sums = read_manifest(target)
    files = [target / name for name in names]
    in_the_way = check_outputs([*files, *(target / name for name in sums)], rules.inputs, rules.replace)
    if rules.of and of and of != _relative(target, rules.of) and not rules.replace:
        raise InputError(f"{str(target)!r} holds the results of {', '.join(of)} (seen from there)", hint=ELSEWHERE)
    for file in files:
        objection = _objection(file, sums, rules) if os.path.lexists(file) else ""
        if objection and not rules.replace:
            raise InputError(f"{str(file)!r} {objection}", hint=REPLACE)
        in_the_way += [file] * bool(objection)
    return list(dict.fromkeys(in_the_way))


def _objection(file: Path, sums: Mapping[str, str], rules: Rules) -> str:
    """Reason why an existing file must not be replaced; "" if it may be."""
    if rules.fresh:
        return "is there already"
    if file.name not in sums:
        return f"is there already, and no {MANIFEST} beside it says that tps wrote it"
    return "" if _is_ours(file, sums) else "was changed since tps wrote it"


def read_manifest(folder: Path) -> tuple[tuple[str, ...], dict[str, str]]:
    """Sources of the results in a folder, relative to it (() if not recorded), and file -> `checksum`.

    Both empty where there is no record. Raises `InputError` where it is not to be understood.
    """
    file = folder / MANIFEST
    with writing_errors(file, "read"):
        if not file.exists():
            return (), {}
        try:
            document = json.loads(file.read_bytes())
            sums = {name: str(known) for name, known in document["checksums"].items() if Path(name).name == name}
            return tuple(map(str, document["results_of"])), sums
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise InputError(
                f"{str(file)!r} does not record what tps wrote", hint=f"delete it, or {ELSEWHERE}"
            ) from None


def _is_ours(file: Path, sums: Mapping[str, str]) -> bool:
    """True if the file is unchanged since the tool wrote it."""
    with writing_errors(file, "read"):
        return not file.is_symlink() and file.is_file() and checksum(file) == sums[file.name]


def checksum(path: Path) -> str:
    """CRC-32 and length of a file's content, which reveal an edit. Raises `OSError`.

    A file that grew or shrank has another length, and CRC-32 misses one in 4e9 of the other changes (none within 32
    bits; Peterson and Brown, "Cyclic codes for error detection", Proc. IRE 49 (1961) 228). Against somebody who forges
    a file nothing is to be kept here, and SHA-256 of a table of a million lines takes as long as its pictures.
    """
    crc = size = 0
    with path.open("rb", buffering=0) as stream:
        while block := stream.read(BLOCK):
            crc, size = zlib.crc32(block, crc), size + len(block)
    return f"{crc:08x}-{size}"


def _relative(folder: Path, of: Sequence[str]) -> tuple[str, ...]:
    """Files relative to the folder; names that are not files stay unchanged."""
    return tuple(Path(os.path.relpath(name, folder)).as_posix() if Path(name).exists() else name for name in of)
