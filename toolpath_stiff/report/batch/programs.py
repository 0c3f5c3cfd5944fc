"""Many programs: which ones files and folders name, and the report folder of each."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from toolpath_stiff.errors import InputError

# Endings of NC programs and of nothing else: `.txt` is as often a note or a tool list.
NC_ENDINGS = (".nc", ".ngc", ".tap", ".cnc", ".gcode", ".gc", ".eia", ".mpf", ".min")


RESERVED = ("index.html", "summary.csv")  # what lies beside the report folders


@dataclass(frozen=True)
class Found:
    """A program: the file as named (or as found below the folder named), and its path as seen from that folder."""

    file: str
    inside: Path


@dataclass(frozen=True)
class FolderCount:
    """What a folder argument holds."""

    folder: str
    programs: int
    left: tuple[tuple[str, int], ...]  # endings of the other files and how many, "" for none

    def __str__(self) -> str:
        others = ", ".join(f"{count} {ending or 'without an ending'}" for ending, count in self.left)
        about = f"; other files are left alone: {others}" if others else ""
        return f"{self.folder}: {self.programs} program{'' if self.programs == 1 else 's'}{about}"


@dataclass(frozen=True)
class Listed:
    """A program to analyze: its file, a short name that no other program has, its report folder below `--out`."""

    file: str
    name: str
    folder: Path


def find_programs(arguments: Sequence[str | Found]) -> tuple[list[Found], list[FolderCount]]:
    """The programs that files and folders name, each file once, in the order given; those of a folder by name.

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


def endings() -> tuple[str, ...]:
    """Endings of the files that a folder stands for: NC programs, and cutter-location files."""
    from toolpath_stiff.nc.languages import EXTENSIONS

    return NC_ENDINGS + EXTENSIONS


def _in_folder(folder: str) -> tuple[list[Found], FolderCount]:
    """Programs in a folder and below it; hidden ones, and folders that are symbolic links, are not entered."""

    def refuse(error: OSError) -> None:
        raise InputError(f"cannot read folder {str(error.filename)!r}: {error.strerror}")

    inside, others, known = [], Counter[str](), endings()
    for place, folders, files in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in files:
            path = Path(place, name)
            if name.startswith("."):
                continue
            # A symbolic link that leads nowhere is a program that cannot be read; a pipe would wait for ever.
            if path.suffix.lower() in known and (path.is_file() or (path.is_symlink() and not path.exists())):
                inside.append(Found(str(path), path.relative_to(folder)))
            else:
                others[path.suffix.lower()] += 1
    if not inside:
        raise InputError(
            f"no NC program in folder {folder!r}",
            expected=f"files ending in {', '.join(known)}",
            hint="name files with another ending themselves",
        )
    inside.sort(key=lambda program: [(_by_number(part), part) for part in program.inside.parts])
    return inside, FolderCount(folder, len(inside), tuple(sorted(others.items())))


def _by_number(name: str) -> list[str | int]:
    """A key that puts `part2` before `part10`."""
    return [int(part) if i % 2 else part for i, part in enumerate(re.split("([0-9]+)", name))]


def report_folders(programs: Sequence[Found]) -> list[Listed]:
    """A report folder for each program: its path as seen from the folder named, without the ending.

    The ending stays where two programs differ in nothing else (`part.nc` and `part.tap`) or where one would lie within
    the other (`part.nc` and `part/side.nc`). Where two would still be the same (`a/part.nc` and `b/part.nc`), as many
    of the folders above as are needed come before. Capitals do not count: some file systems take `Part` for `part`.
    """
    files = [Path(os.path.abspath(program.file)) for program in programs]  # noqa: PTH100  (without `..`, links kept)
    whole = [file.with_suffix("") for file in files]
    while clashing := [i for i in _same_or_around(whole) if whole[i] != files[i]]:
        for i in clashing:
            whole[i] = files[i]
    shown = [len(program.inside.parts) for program in programs]
    # What each file was named by, steps upwards left out, comes before folders above the current one.
    paths = [Path(os.path.normpath(program.file)) for program in programs]
    named = [sum(part not in ("..", path.anchor) for part in path.parts) for path in paths]
    while True:
        folders, names = (
            [Path(*path.parts[-n:]) for path, n in zip(paths, shown, strict=True)] for paths in (whole, files)
        )
        clashing = sorted({*_clashing(folders), *_same_or_around(names)})
        longer = [i for i in clashing if shown[i] < named[i]]
        longer = longer or [i for i in clashing if shown[i] < len(whole[i].parts) - 1]
        if not longer:
            break
        for i in longer:
            shown[i] += 1
    return [
        Listed(program.file, name.as_posix(), folder)
        for program, name, folder in zip(programs, names, folders, strict=True)
    ]


def _same_or_around(paths: Sequence[Path]) -> list[int]:
    """Which of the paths are another one's too, or hold another one."""
    keys = [_program_key(path) for path in paths]
    times = Counter(keys)
    around = {key[:n] for key in keys for n in range(1, len(key))}
    return [i for i, key in enumerate(keys) if times[key] > 1 or key in around]


def _clashing(paths: Sequence[Path]) -> list[int]:
    """Those, and the paths that lie within another one, or have a name that is kept for the overview."""
    keys = [_program_key(path) for path in paths]
    taken = set(keys)
    within = {i for i, key in enumerate(keys) if any(key[:n] in taken for n in range(1, len(key)))}
    reserved = {i for i, key in enumerate(keys) if key[0] in RESERVED}
    return sorted({*_same_or_around(paths), *within, *reserved})


def _program_key(path: Path) -> tuple[str, ...]:
    return tuple(part.casefold() for part in path.parts)
