"""A folder of results: the files of one run, written all or none.

A small manifest (`.tps-files.json`) names the files that a run wrote, with their SHA-256. The next run clears those,
and nothing else: a file that the tool did not write, or that was changed since, is somebody's own. It stays where the
run has no file of that name, and where it has one, nothing is written at all. A folder without a manifest holds nothing
of the tool's.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from toolpath_stiff.errors import FileError
from toolpath_stiff.files import Content, check_outputs, encoded, keep_old, write_atomically

MANIFEST = ".tps-files.json"
STAGE = ".tps-{process}-"  # begins the name of the temporary folder of a run
ELSEWHERE = "choose another folder with --out, or say --replace: the old file is then kept beside the new one"


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
        File name -> SHA-256 that it may have. Two of a run that was cut off between its renames: the old or the new.
    """

    command: str = ""
    of: tuple[str, ...] = ()
    files: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def text(self) -> str:
        """As JSON; nothing in it depends on when or by whom it was written. Escaped, as names need not be UTF-8."""
        entries = {name: hashes[0] if len(hashes) == 1 else list(hashes) for name, hashes in self.files.items()}
        document = {"written_by": f"tps {self.command}", "results_of": list(self.of), "sha256": entries}
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

    Returns
    -------
    list of Path
        The files written, the manifest left out.

    Raises
    ------
    InputError
        A file of such a name is not the tool's, is an input, or the folder cannot be written. Nothing is changed then.
    """
    target = Path(folder)
    with _folders_above(target):
        in_the_way = check_folder(target, contents, rules)
        old = read_manifest(target)
        exists = target.is_dir()
        place = target if exists else target.absolute().parent
        stage = Path(tempfile.mkdtemp(dir=place, prefix=STAGE.format(process=os.getpid())))
        try:
            made = stage / "results"
            made.mkdir()
            hashes = {name: _write(made / name, content) for name, content in contents.items()}
            new = Manifest(command, _relative(target, rules.of), {name: (sha,) for name, sha in hashes.items()})
            for file in in_the_way:
                kept = keep_old(file)
                if kept is not None and rules.kept is not None:
                    rules.kept(file, kept)
            if exists:
                _move_into(target, made, old, new)
            else:
                write_atomically(made / MANIFEST, new.text())
                made.rename(target)
        finally:
            shutil.rmtree(stage, ignore_errors=True)
    return [target / name for name in contents]


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
    in_the_way = check_outputs(touched, rules.inputs, rules.replace)
    if rules.replace:
        return list(dict.fromkeys([*in_the_way, *(target / name for name in names if _told(target, name, old, rules))]))
    if rules.of and old.of and old.of != _relative(target, rules.of):
        raise FileError(
            f"{str(target)!r} holds the results of {', '.join(map(repr, old.of))} (seen from there)",
            hint="choose another folder with --out",
        )
    for name in names:
        if told := _told(target, name, old, rules):
            raise FileError(f"{str(target / name)!r} {told}", hint=ELSEWHERE)
    return []


def _told(folder: Path, name: str, old: Manifest, rules: Rules) -> str:
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
            for name, hashes in document["sha256"].items()
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
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest() in manifest.files[name]
    except OSError as error:
        raise FileError(f"cannot read {str(path)!r}: {error.strerror}") from None


def _relative(folder: Path, of: Sequence[str]) -> tuple[str, ...]:
    """Files as seen from the folder, names that are no files as they are."""
    return tuple(Path(os.path.relpath(one, folder)).as_posix() if Path(one).exists() else one for one in of)


def _write(path: Path, content: Content | Callable[[], Content]) -> str:
    """Write one file; its SHA-256."""
    digest = hashlib.sha256()

    def pieces() -> Iterator[bytes]:
        for piece in encoded(content() if callable(content) else content):
            digest.update(piece)
            yield piece

    write_atomically(path, pieces())
    return digest.hexdigest()


def _move_into(folder: Path, made: Path, old: Manifest, new: Manifest) -> None:
    """Rename the new files to their places, clear what is left of the earlier run.

    The manifest is written before and after: cut off in between, the next run knows the old files and the new as ours.
    """
    both = {name: old.files.get(name, ()) + new.files.get(name, ()) for name in (*old.files, *new.files)}
    write_atomically(folder / MANIFEST, Manifest(new.command, new.of, both).text())
    for name in new.files:
        (made / name).replace(folder / name)
    for name in set(old.files) - set(new.files):
        if _is_ours(folder, name, old):
            (folder / name).unlink()
    write_atomically(folder / MANIFEST, new.text())


@contextmanager
def _folders_above(folder: Path) -> Iterator[None]:
    """Make the folders above; those are taken away again after an error, which becomes an `InputError`."""
    made = [parent for parent in folder.absolute().parents if not parent.exists()]
    try:
        folder.absolute().parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException as error:
        for parent in made:
            with suppress(OSError):  # not empty: someone else uses it by now
                parent.rmdir()
        if isinstance(error, OSError):
            raise FileError(f"cannot write to {str(folder)!r}: {error.strerror}") from None
        raise
