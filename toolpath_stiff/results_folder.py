"""A folder of results: the files of one run, written all or none.

A small manifest (`.tps-files.json`) names the files that a run wrote, with their checksums. The next run clears
those, and nothing else: a file that the tool did not write, or that was changed since, is somebody's own. It stays
where the run has no file of that name, and where it has one, nothing is written at all. A folder without a manifest
holds nothing of the tool's.

The new files are written into a folder beside it and flushed to the disk. Then the two folders are exchanged, which is
one step: whatever stops a run, the folder holds the old files or the new. A folder that cannot be exchanged (it has
folders in it, it is the current one, the file system does not do it) gets its files one by one: an error takes all of
them back, and what a kill cuts off there the next run carries to its end.

What one exchange cannot hold (reports of many programs, a file elsewhere) is bracketed: the folder holds
`INCOMPLETE.txt` from before the first of it until after the last, and every command that reads there says so.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from toolpath_stiff.errors import FileError
from toolpath_stiff.files import (
    Content,
    check_outputs,
    checksum,
    exchange,
    free_name,
    sync_folder,
    write_file,
    written_beside,
)
from toolpath_stiff.hints import both_names
from toolpath_stiff.locks import beside, locked, writing_errors

MANIFEST = ".tps-files.json"
INCOMPLETE = "INCOMPLETE.txt"  # a file of the run like the others, until it comes to its end
SHA256 = re.compile(r"[0-9a-f]{64}")  # what earlier versions recorded
STAGE = ".tps-stage"  # the temporary folder of a run, where it lies in the folder itself
# In the temporary folder of a run: files that are being written; the same when all are there and nothing is left but
# to move them to their places; what was moved out of their way.
NEW, WHOLE, GONE = "new", "whole", "gone"
KEPT = "kept.json"  # beside them: what was in the way -> the name that it gets
_OTHER_FOLDER = f"choose another folder with {both_names('--out')}"
ELSEWHERE = f"{_OTHER_FOLDER}, or say --replace (replace=True): the old file is kept beside the new one"


@dataclass(frozen=True)
class Manifest:
    """What a run of the tool left in a folder.

    Attributes
    ----------
    command
        Name of the command, as `analyze`.
    of
        What the results are of: names, or paths relative to the folder. Empty where the user named the folder.
    files
        File name -> checksums (`files.checksum`) that it may have; SHA-256 in records of earlier versions. Two of a
        run that was cut off between its renames: the old or the new.
    """

    command: str = ""
    of: tuple[str, ...] = ()
    files: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def text(self) -> str:
        """As JSON; nothing in it depends on when or by whom it was written. Escaped, as names need not be UTF-8."""
        entries = {name: hashes[0] if len(hashes) == 1 else list(hashes) for name, hashes in self.files.items()}
        document = {"written_by": f"tps {self.command}", "results_of": list(self.of), "checksums": entries}
        return json.dumps(document, indent=1) + "\n"


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
        Files of the same run in other folders: made before the folder changes, put in their places right after.
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
    target = Path(os.path.realpath(folder))
    marked: Mapping[str, Content | Callable[[], Content]] = {}
    if elsewhere or unfinished:
        files = "".join(f", with {file}" for file in elsewhere)
        not_yet = "While this file is here, it has not come to its end: run it again."
        marked = {INCOMPLETE: f"`tps {command}` writes here{files}. {not_yet}\n"}
    with writing_errors(folder, "write to"), _folders_above(target), locked(_lock(target), repr(str(folder))):
        _clear_up_held(target)
        in_the_way = _refused(Path(folder), [*marked, *contents], rules)
        old = read_manifest(target)
        outside, inside = _stages(target)
        stage = outside if not target.is_dir() or _can_be_exchanged(target) else inside
        try:
            new = stage / NEW
            new.mkdir(parents=True)
            sums = {
                name: (write_file(new / name, content() if callable(content) else content),)
                for name, content in {**marked, **contents}.items()
            }
            manifest = Manifest(command, _relative(target, rules.of), sums)
            write_file(new / MANIFEST, manifest.text())
            with written_beside(elsewhere) as put_elsewhere:
                kept = _put(target, stage, old, [file.name for file in in_the_way])
                put_elsewhere()
            if elsewhere and not unfinished:
                (target / INCOMPLETE).unlink()
        finally:
            for left in (outside, inside):
                if not (left / WHOLE / MANIFEST).exists():  # else it could not be taken back: the next run goes on
                    shutil.rmtree(left, ignore_errors=True)
    for name, kept_as in kept.items():
        if rules.kept is not None:
            rules.kept(Path(folder) / name, Path(folder) / kept_as)
    return [Path(folder) / name for name in contents]


def incomplete(folder: str | Path) -> str:
    """Why the results in a folder are not those of one whole run, a sentence; "" where nothing says so."""
    place = Path(folder)
    if (place / INCOMPLETE).is_file() or (place / STAGE / WHOLE / MANIFEST).is_file():
        return f"{str(folder)!r} is incomplete: the run that wrote it has not come to its end; run it again"
    return ""


def check_folder(folder: str | Path, names: Iterable[str], rules: Rules = Rules()) -> list[Path]:
    """What `write_folder` would refuse, before anything is computed; the files that it will keep with `rules.replace`.

    Raises
    ------
    InputError
        As `write_folder`.
    """
    with writing_errors(folder, "write to"):
        clear_up([folder])
        return _refused(Path(folder), names, rules)


def _refused(target: Path, names: Iterable[str], rules: Rules) -> list[Path]:
    names = list(names)
    nearest = next(path for path in (target, *target.absolute().parents) if os.path.lexists(path))
    if not nearest.is_dir():
        raise FileError(f"cannot write to {str(target)!r}: {str(nearest)!r} is not a folder")
    old = read_manifest(target)
    touched = [target / name for name in dict.fromkeys([*names, *old.files])]
    in_the_way = check_outputs(touched, rules.inputs, rules.replace)
    if rules.replace:
        return list(
            dict.fromkeys([*in_the_way, *(target / name for name in names if _objection(target, name, old, rules))])
        )
    if holds_others(target, rules.of):
        raise FileError(
            f"{str(target)!r} holds the results of {', '.join(map(repr, old.of))} (seen from there)", hint=_OTHER_FOLDER
        )
    for name in names:
        if objection := _objection(target, name, old, rules):
            raise FileError(f"{str(target / name)!r} {objection}", hint=ELSEWHERE)
    return []


def holds_others(folder: Path, of: Sequence[str]) -> bool:
    """Whether a folder that was named by default holds the results of something else."""
    old = read_manifest(folder)
    return bool(of and old.of and old.of != _relative(folder, of))


def _objection(folder: Path, name: str, old: Manifest, rules: Rules) -> str:
    """Why a file must not be replaced; nothing where it may."""
    if not os.path.lexists(folder / name):
        return ""
    if rules.fresh:
        return "is there already"
    if name not in old.files:
        return f"is there already, and no {MANIFEST} beside it says that tps wrote it"
    return "" if _is_ours(folder, name, old) else "was changed since tps wrote it"


def read_manifest(folder: Path) -> Manifest:
    """The record in a folder, empty where there is none. Raises `InputError` where it is not to be understood."""
    try:
        document = json.loads((folder / MANIFEST).read_bytes())
        listed = {
            str(name): tuple(hashes) if isinstance(hashes, list) else (str(hashes),)
            for name, hashes in document["checksums" if "checksums" in document else "sha256"].items()
            if Path(name).name == name  # never beyond the folder
        }
        return Manifest(str(document["written_by"]), tuple(map(str, document["results_of"])), listed)
    except (FileNotFoundError, NotADirectoryError):
        return Manifest()
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise FileError(
            f"{str(folder / MANIFEST)!r} does not record what tps wrote", hint="delete it, or choose another folder"
        ) from None
    except OSError as error:
        raise FileError(f"cannot read {str(folder / MANIFEST)!r}: {error.strerror}") from None


def _is_ours(folder: Path, name: str, manifest: Manifest) -> bool:
    """Whether the file is as the tool wrote it."""
    path = folder / name
    if path.is_symlink() or not path.is_file():
        return False
    try:
        known = manifest.files[name]
        if checksum(path) in known:
            return True
        if not any(map(SHA256.fullmatch, known)):
            return False
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest() in known
    except OSError as error:
        raise FileError(f"cannot read {str(path)!r}: {error.strerror}") from None


def _relative(folder: Path, of: Sequence[str]) -> tuple[str, ...]:
    """Files as seen from the folder, names that are no files as they are."""
    return tuple(Path(os.path.relpath(name, folder)).as_posix() if Path(name).exists() else name for name in of)


def _lock(folder: Path) -> Path:
    """The lock file of a folder: beside it, or in it where beside it nothing can be written."""
    return beside(folder, "lock") if os.access(folder.parent, os.W_OK) else folder / ".tps-lock"


def _stages(folder: Path) -> tuple[Path, Path]:
    """Where the temporary folder of a run may be: beside the folder, or in it."""
    return beside(folder, "stage"), folder / STAGE


def _can_be_exchanged(folder: Path) -> bool:
    """Whether a folder holds files alone, is nobody's current one and lies in one that we may write to."""
    if folder == Path(os.path.realpath(".")) or folder.is_mount() or not os.access(folder.parent, os.W_OK):
        return False
    with os.scandir(folder) as entries:
        return all(entry.is_file(follow_symlinks=False) or entry.is_symlink() for entry in entries)


def _put(folder: Path, stage: Path, old: Manifest, in_the_way: Iterable[str]) -> dict[str, str]:
    """The new files to their places, those of the earlier run away; what is in the way -> the name that it gets."""
    new = stage / NEW
    sync_folder(new)
    if not folder.is_dir():
        new.rename(folder)
        sync_folder(folder.parent)
        return {}
    kept = {name: free_name(name, lambda free: os.path.lexists(folder / free)) for name in in_the_way}
    # The names in the folder that are the tool's: the manifest, and the files that are as they were written.
    ours = [MANIFEST, *(name for name in old.files if name not in kept and _is_ours(folder, name, old))]
    if stage.parent != folder:
        if _exchanged(folder, new, ours, kept):
            return kept
        inside = _stages(folder)[1]
        inside.mkdir()
        new.rename(inside / NEW)
        stage = inside
    write_file(stage / KEPT, json.dumps(kept))
    (stage / NEW).rename(stage / WHOLE)
    sync_folder(stage)
    _move_in(folder, stage, old, kept)
    return kept


def _exchanged(folder: Path, new: Path, ours: Sequence[str], kept: Mapping[str, str]) -> bool:
    """Give the new folder what is the user's in the old one, and exchange them; False where that cannot be done."""
    taken = {file.name: kept.get(file.name, file.name) for file in folder.iterdir() if file.name not in ours}
    linked = []
    try:
        for name, becomes in taken.items():
            os.link(folder / name, new / becomes, follow_symlinks=False)
            linked.append(becomes)
        state = folder.stat()
        new.chmod(state.st_mode & 0o7777)
        if new.stat().st_gid != state.st_gid:
            os.chown(new, -1, state.st_gid)
    except OSError:  # no hard links here, say
        done = False
    else:
        sync_folder(new)
        done = exchange(new, folder)
    if not done:
        for becomes in linked:
            (new / becomes).unlink()
        return False
    sync_folder(folder.parent)
    for file in list(new.iterdir()):  # written by somebody else in this very moment
        now = folder / taken.get(file.name, file.name)
        if file.name not in ours and not (os.path.lexists(now) and os.path.samestat(file.lstat(), now.lstat())):
            file.replace(now)
    return True


def _move_in(folder: Path, stage: Path, old: Manifest, kept: Mapping[str, str], again: bool = False) -> None:
    """One by one, the manifest first away and last in place; an error takes all of it back.

    `again`: a run was killed in the midst of it. There is no way back then, and an error leaves it to the next run.
    """
    whole, gone = stage / WHOLE, stage / GONE
    moves: list[tuple[Path, Path]] = []

    def move(file: Path, to: Path) -> None:
        file.rename(to)
        moves.append((file, to))

    try:
        gone.mkdir(exist_ok=True)
        new = read_manifest(whole)
        # What is in its place already arrived before the kill that this run makes good.
        arrived = {name for name in new.files if not (whole / name).exists()}
        for name, becomes in kept.items():
            if name not in arrived and os.path.lexists(folder / name):
                move(folder / name, folder / becomes)
        for name in (MANIFEST, *old.files):
            if name in arrived:
                continue
            if _is_ours(folder, name, old) if name != MANIFEST else (folder / name).exists():
                move(folder / name, gone / name)
        for name in (*new.files, MANIFEST):
            if (whole / name).exists():
                if os.path.lexists(folder / name):  # somebody put it there since the run was killed
                    move(folder / name, folder / free_name(name, lambda free: os.path.lexists(folder / free)))
                move(whole / name, folder / name)
        sync_folder(folder)
    except BaseException:
        if not again:
            for file, to in reversed(moves):
                to.rename(file)
            whole.rename(stage / NEW)
        raise


def clear_up(folders: Iterable[str | Path]) -> None:
    """Take away what killed runs left for folders and beside them; one that had all its files is carried to its end."""
    targets = [Path(os.path.realpath(folder)) for folder in folders]
    for parent in dict.fromkeys(target.parent for target in targets):
        for left in (*parent.glob(".*.tps-stage"), *parent.glob(".*.tps-lock")):
            lock = left.with_name(left.name.rpartition("-")[0] + "-lock")
            with suppress(FileError, OSError), locked(lock, repr(str(left)), wait=0.0):  # a run that lives holds it
                shutil.rmtree(left, ignore_errors=True)
    for target in targets:
        if _stages(target)[1].exists():
            with locked(_lock(target), repr(str(target))):
                _clear_up_held(target)


def _clear_up_held(folder: Path) -> None:
    """The same of one folder, whose lock this run holds."""
    outside, inside = _stages(folder)
    if (inside / WHOLE / MANIFEST).exists():
        began = (inside / GONE / MANIFEST).exists()
        kept = json.loads((inside / KEPT).read_bytes()) if (inside / KEPT).exists() else {}  # an earlier version's
        _move_in(folder, inside, read_manifest(inside / GONE if began else folder), kept, again=True)
    for stage in (outside, inside):
        shutil.rmtree(stage, ignore_errors=True)


@contextmanager
def _folders_above(folder: Path) -> Iterator[None]:
    """Make the folders above; those are taken away again after an error."""
    made = [parent for parent in folder.parents if not parent.exists()]
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for parent in made:
            with suppress(OSError):  # not empty: someone else uses it by now
                parent.rmdir()
        raise
