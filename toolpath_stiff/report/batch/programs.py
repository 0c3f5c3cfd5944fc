"""Many programs: which ones files and folders name, the report folder of each, what became of it.

The figures that are kept of each make `summary.csv` and the table on the terminal.
"""

from __future__ import annotations

import os
import re
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.errors import InputError
from toolpath_stiff.report.words import counted, duration, only_plunges, plain, shortened
from toolpath_stiff.units import number

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
        text = f"{self.folder}: {self.programs} program{'' if self.programs == 1 else 's'}"
        if not self.left:
            return text
        others = ", ".join(f"{count} {ending or 'without an ending'}" for ending, count in self.left)
        return f"{text}; other files are left alone: {others}"


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
    found: dict[str, Found] = {}
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
            found.setdefault(os.path.realpath(program.file), program)
    return list(found.values()), counts


def endings() -> tuple[str, ...]:
    """Endings of the files that a folder stands for: NC programs, and cutter-location files."""
    from toolpath_stiff.nc.words import EXTENSIONS

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
            if path.suffix.lower() in known and (path.is_file() or _leads_nowhere(path)):
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


def _leads_nowhere(path: Path) -> bool:
    return path.is_symlink() and not path.exists()


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
    named = [_named_parts(program.file) for program in programs]  # rather these than the folders above the current one
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


def _named_parts(file: str) -> int:
    """How many folders and names the file was named by, steps upwards left out."""
    path = Path(os.path.normpath(file))
    return sum(part not in ("..", path.anchor) for part in path.parts)


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


WIDTH = 100  # columns of the terminal


MOST_NAME = 36  # of them for the name


# First columns of summary.csv -> what of the outcome they show.
TOLD = {"program": "name", "file": "file", "status": "status", "reason": "reason", "report": "opens"}


# Its further columns, keys of the figures -> decimals; the units are in the names.
COLUMNS: Mapping[str, int | None] = {
    "machine": None,
    "load": None,
    "force_N": 3,
    "samples": 0,
    "cutting_length_mm": 3,
    "rapid_length_mm": 3,
    "time_s": 3,
    "mean_N_per_mm": 4,
    "min_N_per_mm": 4,
    "max_N_per_mm": 4,
    "range_N_per_mm": 4,
    "mean_deflection_um": 4,
    "headline": None,
    "plunge_length_mm": 3,
    "plunge_mean_N_per_mm": 4,
    "plunge_min_N_per_mm": 4,
    "plunge_max_N_per_mm": 4,
    "weakest_line": 0,
    "weakest_text": None,
    "weakest_x_mm": 4,
    "weakest_y_mm": 4,
    "weakest_z_mm": 4,
    "weakest_a_deg": 5,
    "weakest_b_deg": 5,
    "weakest_c_deg": 5,
    "min_margin": 5,
    "min_margin_line": 0,
    "out_of_reach_samples": 0,
    "extrapolated_share": 5,
    "warnings": 0,
    "not_acted_upon": 0,
    "required_N_per_mm": 4,
    "lines_below_required": 0,
    "compare_machine": None,
    "compare_mean_N_per_mm": 4,
    "compare_min_N_per_mm": 4,
    "compare_mean_difference_percent": 3,
}


PLUNGE_KEYS = ("length_mm", "mean_N_per_mm", "min_N_per_mm", "max_N_per_mm")


@dataclass(frozen=True)
class Outcome:
    """What became of a program.

    Attributes
    ----------
    name
        Short, and no other program's.
    file
        Where it was read, as named.
    reason
        Why it failed, a sentence that begins with the file; "" if it did not.
    opens
        The file that shows most of it, seen from the folder of all reports; "" if it failed.
    figures
        One value for each of `COLUMNS` where there is one; nothing if it failed.
    """

    name: str
    file: str
    reason: str = ""
    opens: str = ""
    figures: Mapping[str, Any] | None = None

    @property
    def status(self) -> str:
        """Failed; partial, with samples out of reach left out; or done."""
        if self.figures is None:
            return "failed"
        return "partial" if self.figures["out_of_reach_samples"] else "done"


def figures_of(summary: Mapping[str, Any]) -> dict[str, Any]:
    """The values of `COLUMNS` from a `summary.json`: small, however long the program."""
    found = {name: summary[name] for name in COLUMNS if name in summary}
    place = summary["weakest"]
    if place is not None:
        keys = ("line", "text", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
        found |= {f"weakest_{key}": place[key] for key in keys}
    plunges = summary["plunges"]
    if plunges is not None:
        found |= {f"plunge_{key}": plunges[key] for key in PLUNGE_KEYS}
    found |= {"warnings": len(summary["warnings"]), "not_acted_upon": len(summary["unsupported"])}
    if "required" in summary:
        found["required_N_per_mm"] = summary["required"]["required_N_per_mm"]
        found["lines_below_required"] = len(summary["required"]["below"])
    if "compare" in summary:
        other = summary["compare"]
        found |= {
            "compare_machine": other["machine"],
            "compare_mean_N_per_mm": other["mean_N_per_mm"],
            "compare_min_N_per_mm": other["min_N_per_mm"],
            "compare_mean_difference_percent": other["difference_percent"]["mean"],
        }
    return found


def summary_csv(outcomes: Sequence[Outcome]) -> str:
    """`summary.csv`: one row a program, failures too; a figure that does not exist is an empty cell."""
    rows = []
    for one in outcomes:
        figures = one.figures or {}
        told = [plain(getattr(one, of)) for of in TOLD.values()]
        rows.append([*told, *(_cell(figures.get(name), digits) for name, digits in COLUMNS.items())])
    return csv_text([*TOLD, *COLUMNS], rows)


def columns_of(outcomes: Sequence[Outcome]) -> dict[str, list[Any]]:
    """The same as values, column by column; None for a figure that does not exist."""
    told = {name: [getattr(one, of) for one in outcomes] for name, of in TOLD.items()}
    return {**told, **{name: [_figure(one, name) for one in outcomes] for name in COLUMNS}}


def _cell(value: Any, digits: int | None) -> str:
    if value is None:
        return ""
    return plain(str(value)) if digits is None else f"{value:.{digits}f}"


def terminal_summary(outcomes: Sequence[Outcome]) -> str:
    """One line a program that was analyzed, then the failures with their reasons; at most 100 columns but for these."""
    good = [one for one in outcomes if one.figures is not None]
    failed = [one for one in outcomes if one.figures is None]
    lines = _program_table(good) if good else []
    plunging = [plain(one.name) for one in good if only_plunges(one.figures or {})]
    if plunging:
        lines += textwrap.wrap(f"figures of plunges, nothing else is cut: {', '.join(plunging)}", WIDTH)
    partial = [one for one in good if one.status == "partial"]
    if partial:
        lines.append("cutting samples out of reach, left out:")
        lines += [f"  {plain(one.name)}: {number(_figure(one, 'out_of_reach_samples'))}" for one in partial]
    below = [one for one in good if _figure(one, "lines_below_required")]
    if below:
        lines.append(f"below the required {_figure(below[0], 'required_N_per_mm'):g} N/mm:")
        lines += [f"  {plain(one.name)}: {counted(_figure(one, 'lines_below_required'), 'line')}" for one in below]
    if failed:
        lines.append(f"{len(failed)} of {len(outcomes)} programs failed:")
        lines += [f"  {plain(one.reason)}" for one in failed]
    return "\n".join(lines)


def _program_table(good: Sequence[Outcome]) -> list[str]:
    """Names and program text to the left, figures to the right."""
    heads = ["program", "cutting mm", "time", "mean N/mm", "min N/mm"]
    compared = _figure(good[0], "compare_machine") is not None
    if compared:
        heads += ["other mean", "change"]
    heads += ["weakest line", ""]
    rows = [heads]
    for one in good:
        rows.append(
            [
                shortened(plain(one.name), MOST_NAME),
                number(_figure(one, "cutting_length_mm"), 1),
                duration(_figure(one, "time_s")),
                number(_figure(one, "mean_N_per_mm")),
                number(_figure(one, "min_N_per_mm")),
                *(_compared(one) if compared else ()),
                number(_figure(one, "weakest_line")).replace(" ", ""),
                plain(_figure(one, "weakest_text") or ""),
            ]
        )
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    last = len(heads) - 1
    aligned = (
        "  ".join(
            f"{c:<{w}}" if i in (0, last) else f"{c:>{w}}" for i, (c, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    )
    return [shortened(line.rstrip(), WIDTH) for line in aligned]


def _compared(one: Outcome) -> list[str]:
    change = _figure(one, "compare_mean_difference_percent")
    return [number(_figure(one, "compare_mean_N_per_mm")), "-" if change is None else f"{change:+.1f} %"]


def _figure(one: Outcome, name: str) -> Any:
    return (one.figures or {}).get(name)
