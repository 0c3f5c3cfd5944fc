"""A folder of results: the files of one run, and nothing of another.

A small manifest (`.tps-files.json`) names the files that a run wrote, with their checksums. The next run clears
those, and nothing else: a file that the tool did not write, or that was changed since, is somebody's own. It stays
where the run has no file of that name, and where it has one, nothing is written at all. A folder without a manifest
holds nothing of the tool's.

The new files are made in a hidden folder within, which only one run can hold; an error until then leaves the results
as they were. Then the old ones are taken away and the new ones renamed, and meanwhile `INCOMPLETE.txt` says so: every
command that reads there asks to run again what was cut off.
"""

import json
import os
import shutil
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from toolpath_stiff.errors import FileError
from toolpath_stiff.files import BLOCK, Content, check_outputs, old_name, write_atomically, write_new, writing_errors
from toolpath_stiff.hints import both_names

try:
    import fcntl
except ImportError:  # Windows: there nothing keeps two runs apart
    fcntl = None  # type: ignore[assignment]

MANIFEST = ".tps-files.json"
INCOMPLETE = "INCOMPLETE.txt"
STAGE = ".tps-stage"  # the hidden folder; what a killed run left in it the next run takes away
_OTHER_FOLDER = f"choose another folder with {both_names('--out')}"
ELSEWHERE = f"{_OTHER_FOLDER}, or say --replace (replace=True): the old file is kept beside the new one"


@dataclass(frozen=True)
class Manifest:
    """What a run left in a folder: file name -> `checksum`.

    `of` says what the results are of: names, or paths relative to the folder. Empty where the user named the folder.
    """

    of: tuple[str, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Rules:
    """What a run must not replace or clear beside what is not the tool's.

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
    elsewhere: Mapping[str | Path, Content] = MappingProxyType({}),
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
    elsewhere
        Files of the same run in other folders: put in their places right before those of the folder.
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
    target = Path(folder)
    with writing_errors(folder, "write to"), _made(target.absolute()), _stage(target) as stage:
        in_the_way = check_folder(target, contents, rules)
        sums = {}
        for name, content in contents.items():
            write_new(stage / name, content() if callable(content) else content)
            sums[name] = checksum(stage / name)
        # Nothing in it depends on when or by whom it was written. Escaped, as names need not be UTF-8.
        document = {"written_by": f"tps {command}", "results_of": _relative(target, rules.of), "checksums": sums}
        write_new(stage / MANIFEST, json.dumps(document, indent=1) + "\n")
        note, incomplete_before = target / INCOMPLETE, bool(incomplete(target))
        if not incomplete_before:
            write_new(note, f"`tps {command}` writes here. While this file is here, run it again.\n")
        try:
            for file, other in elsewhere.items():
                write_atomically(file, other)
        except BaseException:
            if not incomplete_before:
                note.unlink()
            raise
        old = read_manifest(target)
        for name in old.files:
            if target / name not in in_the_way and _is_ours(target / name, old):
                (target / name).unlink()
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
def _made(folder: Path) -> Iterator[None]:
    """The folder is there; after an error it is taken away again, with those above that were made for it."""
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for place in made:
            with suppress(OSError):  # not empty: someone else uses it by now
                place.rmdir()
        raise


@contextmanager
def _stage(folder: Path) -> Iterator[Path]:
    """An empty folder within, of this run alone. Raises `InputError` where another run has it."""
    stage = folder / STAGE
    stage.mkdir(exist_ok=True)
    handle = None if fcntl is None else os.open(stage, os.O_RDONLY)
    try:
        if handle is not None and not _held(handle):
            hint = "wait for it, or choose another folder"
            raise FileError(f"{str(folder)!r} is being written by another run", hint=hint)
        try:
            for left in stage.iterdir():
                left.unlink()
            yield stage
        finally:
            shutil.rmtree(stage, ignore_errors=True)
    finally:
        if handle is not None:
            os.close(handle)


def _held(handle: int) -> bool:
    """Whether this run has the lock of an open folder; it ends with the process."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks keeps nobody out
        return True
    return True


def incomplete(folder: str | Path) -> str:
    """Why the results in a folder are not those of one whole run, a sentence; "" where nothing says so."""
    if not (Path(folder) / INCOMPLETE).is_file():
        return ""
    return f"{str(folder)!r} is incomplete: the run that wrote it has not come to its end; run it again"


def check_folder(folder: str | Path, names: Iterable[str], rules: Rules = Rules()) -> list[Path]:
    """What `write_folder` would refuse, before anything is computed; the files that it will keep with `rules.replace`.

    Raises
    ------
    InputError
        As `write_folder`.
    """
    target, names = Path(folder), list(names)
    nearest = next(path for path in (target, *target.absolute().parents) if os.path.lexists(path))
    if not nearest.is_dir():
        raise FileError(f"cannot write to {str(target)!r}: {str(nearest)!r} is not a folder")
    old = read_manifest(target)
    touched = [target / name for name in dict.fromkeys([*names, *old.files])]
    read = check_outputs(touched, rules.inputs, rules.replace)
    if not rules.replace and holds_others(target, rules.of):
        others = ", ".join(map(repr, old.of))
        raise FileError(f"{str(target)!r} holds the results of {others} (seen from there)", hint=_OTHER_FOLDER)
    objections = {target / name: _objection(target / name, old, rules) for name in names}
    for file, objection in objections.items():
        if objection and not rules.replace:
            raise FileError(f"{str(file)!r} {objection}", hint=ELSEWHERE)
    return list(dict.fromkeys([*read, *(file for file, objection in objections.items() if objection)]))


def holds_others(folder: Path, of: Sequence[str]) -> bool:
    """Whether a folder that was named by default holds the results of something else."""
    old = read_manifest(folder)
    return bool(of and old.of and old.of != _relative(folder, of))


def _objection(file: Path, old: Manifest, rules: Rules) -> str:
    """Why a file must not be replaced; nothing where it may."""
    if not os.path.lexists(file):
        return ""
    if rules.fresh:
        return "is there already"
    if file.name not in old.files:
        return f"is there already, and no {MANIFEST} beside it says that tps wrote it"
    return "" if _is_ours(file, old) else "was changed since tps wrote it"


def read_manifest(folder: Path) -> Manifest:
    """The record in a folder, empty where there is none. Raises `InputError` where it is not to be understood."""
    file = folder / MANIFEST
    try:
        if not file.exists():
            return Manifest()
        document = json.loads(file.read_bytes())
        sums = {name: str(known) for name, known in document["checksums"].items() if Path(name).name == name}
        return Manifest(tuple(map(str, document["results_of"])), sums)
    except OSError as error:
        raise FileError(f"cannot read {str(file)!r}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        hint = "delete it, or choose another folder"
        raise FileError(f"{str(file)!r} does not record what tps wrote", hint=hint) from None


def _is_ours(file: Path, manifest: Manifest) -> bool:
    """Whether the file is as the tool wrote it."""
    with writing_errors(file, "read"):
        return not file.is_symlink() and file.is_file() and checksum(file) == manifest.files[file.name]


def checksum(path: Path) -> str:
    """CRC-32 and length of a file's content, by which an edit is seen. Raises `OSError`.

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
    """Files as seen from the folder, names that are no files as they are."""
    return tuple(Path(os.path.relpath(name, folder)).as_posix() if Path(name).exists() else name for name in of)
