"""Write the report of an analysis: everything or nothing."""

from __future__ import annotations

import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.report.comparison import compare_summaries
from toolpath_stiff.units import n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis

# Every name that a report may hold: those of an earlier run that the new one does not write would contradict it.
OWN_FILES = ("samples.csv", "samples.parquet", "summary.json", "path.png", "profile.png", "report.html")


def write_analysis(
    analysis: Analysis,
    out_dir: str | Path,
    *,
    plots: bool = True,
    table: Literal["csv", "parquet"] = "csv",
    required: float | None = None,
    other: Analysis | None = None,
    show_plunges: bool = False,
) -> list[Path]:
    """Write samples, summary, pictures and page of an analysis.

    All files are first written to a temporary folder beside their place and renamed at the end; an error or an
    interrupt before that leaves the folder as it was. Files of an earlier report are replaced or removed, files
    with other names are left alone.

    Parameters
    ----------
    analysis
        What to report.
    out_dir
        Folder; made if need be.
    plots
        Write `path.png`, `profile.png` and `report.html` too.
    table
        Format of the samples.
    required
        Stiffness that every cutting move should have, N/m: drawn and listed.
    other
        The same program on another machine, for comparison.
    show_plunges
        The axes and colour scales of pictures and page hold the plunges beside the headline figures too.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        The folder cannot be written.
    """
    return _all_or_nothing(Path(out_dir), _contents(analysis, plots, table, required, other, show_plunges), OWN_FILES)


def write_folder(folder: str | Path, contents: Mapping[str, str | bytes], own: Iterable[str] = ()) -> list[Path]:
    """Write files into a folder, all or none; made if need be. Raises `InputError` where that cannot be done.

    `own`: names that an earlier run may have left and that are removed unless written again.
    """
    return _all_or_nothing(Path(folder), contents.items(), own)


def _all_or_nothing(
    folder: Path, contents: Iterable[tuple[str, str | bytes | Iterable[str | bytes]]], own: Iterable[str]
) -> list[Path]:
    try:
        made = _make_parents(folder)
    except OSError as error:
        raise InputError(f"cannot write to {str(folder)!r}: {error.strerror}") from None
    try:
        return _write_and_move(folder, contents, own)
    except BaseException as error:
        for parent in made:
            with suppress(OSError):  # not empty: someone else uses it by now
                parent.rmdir()
        if isinstance(error, OSError):
            raise InputError(f"cannot write to {str(folder)!r}: {error.strerror}") from None
        raise


def summary_with_options(analysis: Analysis, required: float | None, other: Analysis | None) -> dict[str, Any]:
    """`analysis.summary()`, with `required` and `compare` where these were asked for; no nan, no infinity."""
    from toolpath_stiff.analysis.path_analysis import required_stiffness_missed

    summary = dict(analysis.summary())
    if required is not None:
        summary["required"] = {
            "required_N_per_mm": n_per_mm_from_n_per_m(required),
            "below": [
                {"line": line, "min_N_per_mm": lowest} for line, lowest in required_stiffness_missed(analysis, required)
            ],
        }
    if other is not None:
        found = dict(other.summary())
        summary["compare"] = compare_summaries(summary, found)
        summary["warnings"] = [*analysis.warnings, *_of_other(found)]
    finite: dict[str, Any] = _without_nan(summary)
    return finite


def _of_other(summary: Mapping[str, Any]) -> list[str]:
    """What the other machine's effects wait for: without them the two machines may look the same."""
    return [
        f"--compare {summary['machine']}: {one['effect']} does not act: {one['reason']}"
        for one in summary["effects_idle"]
    ]


def _contents(
    analysis: Analysis, plots: bool, table: str, required: float | None, other: Analysis | None, show_plunges: bool
) -> Iterable[tuple[str, str | bytes | Iterable[str | bytes]]]:
    """Names and contents of the files, one at a time."""
    from toolpath_stiff.analysis.tables import samples_csv, samples_parquet

    summary = summary_with_options(analysis, required, other)
    if table == "parquet":
        yield "samples.parquet", samples_parquet(analysis)
    else:
        yield "samples.csv", samples_csv(analysis)
    yield "summary.json", json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if plots:
        from toolpath_stiff.report.page import page
        from toolpath_stiff.report.path_picture import path_picture
        from toolpath_stiff.report.profile_picture import profile_picture

        yield "path.png", path_picture(analysis, show_plunges=show_plunges)
        yield "profile.png", profile_picture(analysis, other=other, required=required, show_plunges=show_plunges)
        yield "report.html", page(analysis, summary, required=required, other=other, show_plunges=show_plunges)


def _without_nan(value: Any) -> Any:
    """The same with None for every float that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _make_parents(folder: Path) -> list[Path]:
    """Make the folders above `folder`; the ones that were made, innermost first."""
    made = [parent for parent in folder.absolute().parents if not parent.exists()]
    folder.absolute().parent.mkdir(parents=True, exist_ok=True)
    return made


def _write_and_move(
    folder: Path, contents: Iterable[tuple[str, str | bytes | Iterable[str | bytes]]], own: Iterable[str]
) -> list[Path]:
    """Write to a temporary folder on the same file system, then rename: a new report folder in one go."""
    exists = folder.is_dir()
    stage = Path(tempfile.mkdtemp(dir=folder if exists else folder.absolute().parent, prefix=f".tps-{os.getpid()}-"))
    try:
        report = stage / "report"
        report.mkdir()
        names = [write_atomically(report / name, content).name for name, content in contents]
        if exists:
            for name in names:
                (report / name).replace(folder / name)
            for name in set(own) - set(names):
                (folder / name).unlink(missing_ok=True)
        else:
            report.rename(folder)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    return [folder / name for name in names]
