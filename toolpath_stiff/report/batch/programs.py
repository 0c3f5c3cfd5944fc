"""Many programs: those named by files and folders, and the report folder of each."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.languages import EXTENSIONS
from toolpath_stiff.report.words import counted

# Endings of the files that a folder stands for: `.txt` is as often a note or a tool list.
ENDINGS = (".nc", ".ngc", ".tap", ".cnc", ".gcode", ".gc", ".eia", ".mpf", ".min", *EXTENSIONS)
RESERVED = ("index.html", "summary.csv")  # names beside the report folders


@dataclass(frozen=True)
class Found:
    """A program: the file as named or found in the folder named, and its path relative to that folder."""

    file: str
    inside: Path


@dataclass(frozen=True)
class FolderCount:
    """Contents of a folder argument."""

    folder: str
    programs: int
    others: int

    def __str__(self) -> str:
        about = f"; {counted(self.others, 'other file')} left alone" if self.others else ""
        return f"{self.folder}: {counted(self.programs, 'program')}{about}"


@dataclass(frozen=True)
class Listed:
    """A program to analyze: its file, a unique short name, its report folder below `--out`."""

    file: str
    name: str
    folder: Path


def find_programs(arguments: Sequence[str | Found]) -> tuple[list[Found], list[FolderCount]]:
    """Programs named by files and folders, each file once, in the order given; those of a folder by name.

    What was found before stays as it is.

    Raises
    ------
    InputError
        A folder cannot be read or holds no program.
    """
    programs: dict[str, Found] = {}
    counts = []
    for argument in arguments:
        if isinstance(argument, Found):
            inside = [argument]
        elif os.path.isdir(argument):  # noqa: PTH112  (false for a name that none can have)
            inside, count = _in_folder(argument)
            counts.append(count)
        else:
            inside = [Found(argument, Path(Path(argument).name))]
        for program in inside:
            programs.setdefault(os.path.realpath(program.file), program)
    return list(programs.values()), counts


def _in_folder(folder: str) -> tuple[list[Found], FolderCount]:
    """Programs in a folder and its subfolders; hidden ones, and folders that are symbolic links, are skipped."""

    def refuse(error: OSError) -> None:
        raise InputError(f"cannot read folder {str(error.filename)!r}: {error.strerror}")

    inside: list[Found] = []
    others = 0
    for place, folders, files in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in files:
            path = Path(place, name)
            if name.startswith("."):
                continue
            # A broken symbolic link counts as a program that cannot be read; a pipe would block for ever.
            if path.suffix.lower() in ENDINGS and (path.is_file() or (path.is_symlink() and not path.exists())):
                inside.append(Found(str(path), path.relative_to(folder)))
            else:
                others += 1
    if not inside:
        raise InputError(
            f"no NC program in folder {folder!r}",
            expected=f"files ending in {', '.join(ENDINGS)}",
            hint="name files with another ending themselves",
        )
    inside.sort(key=lambda program: [(_by_number(part), part) for part in program.inside.parts])
    return inside, FolderCount(folder, len(inside), others)


def _by_number(name: str) -> list[str | int]:
    """Sort key that puts `part2` before `part10`."""
    return [int(part) if i % 2 else part for i, part in enumerate(re.split("([0-9]+)", name))]


def report_folders(programs: Sequence[Found]) -> list[Listed]:
    """Report folder of each program: its path relative to the folder named, without the ending.

    Where two would be the same (`part.nc` and `part.tap`; capitals do not count) or one lie within another, all keep
    their endings; where that is not enough, all have the folders above that they do not share; then they are numbered.
    """
    files = [os.path.abspath(program.file) for program in programs]  # noqa: PTH100  (without `..`, links kept)
    shared = os.path.commonpath([os.path.dirname(file) for file in files]) if files else ""  # noqa: PTH120
    inside, below = [program.inside for program in programs], [Path(os.path.relpath(file, shared)) for file in files]
    numbered = [Path(f"{number}-{path.name}") for number, path in enumerate(inside, 1)]
    for paths, ending in ((inside, False), (inside, True), (below, False), (below, True), (numbered, True)):
        folders = paths if ending else [path.with_suffix("") for path in paths]
        if not _clash(folders) and not _clash(paths):
            break
    return [
        Listed(program.file, path.as_posix(), folder)
        for program, path, folder in zip(programs, paths, folders, strict=True)
    ]


def _clash(paths: Sequence[Path]) -> bool:
    """True if two paths are equal, one lies within another, or one has a name reserved for the overview."""
    keys = [tuple(part.casefold() for part in path.parts) for path in paths]
    above = {key[:n] for key in keys for n in range(1, len(key))}
    return len(set(keys)) < len(keys) or any(key in above or key[0] in RESERVED for key in keys)
