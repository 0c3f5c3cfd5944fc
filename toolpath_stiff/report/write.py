"""Write the report of an analysis: everything or nothing."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from toolpath_stiff.files import Content
from toolpath_stiff.report.comparison import compare_summaries
from toolpath_stiff.results_folder import Rules, write_folder
from toolpath_stiff.units import n_per_mm_from_n_per_m

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis


def write_analysis(
    analysis: Analysis,
    out_dir: str | Path,
    *,
    plots: bool = True,
    table: Literal["csv", "parquet"] = "csv",
    required: float | None = None,
    other: Analysis | None = None,
    show_plunges: bool = False,
    rules: Rules = Rules(),  # noqa: B008  (frozen)
) -> list[Path]:
    """Write samples, summary, pictures and page of an analysis, all or none (`results_folder.write_folder`).

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
    rules
        What must not be replaced, as of `write_folder`.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        The folder cannot be written, or holds files of such names that the tool did not write.
    """
    contents = _contents(analysis, plots, table, required, other, show_plunges)
    return write_folder(out_dir, contents, command="analyze", rules=rules)


def summary_with_options(analysis: Analysis, required: float | None, other: Analysis | None) -> dict[str, Any]:
    """`analysis.summary()`, with `required` and `compare` where these were asked for; no nan, no infinity."""
    from toolpath_stiff.analysis.results import required_stiffness_missed

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


def names_of(plots: bool, table: str) -> list[str]:
    """Names of the files that `write_analysis` writes."""
    return [f"samples.{table}", "summary.json", *(["path.png", "profile.png", "report.html"] if plots else [])]


def _contents(
    analysis: Analysis, plots: bool, table: str, required: float | None, other: Analysis | None, show_plunges: bool
) -> dict[str, Callable[[], Content]]:
    """Names of the files, and what makes each."""
    from toolpath_stiff.analysis.statistics import samples_csv, samples_parquet

    summary = summary_with_options(analysis, required, other)
    contents: dict[str, Callable[[], Content]] = {
        "samples.parquet" if table == "parquet" else "samples.csv": (
            lambda: samples_parquet(analysis) if table == "parquet" else samples_csv(analysis)
        ),
        "summary.json": lambda: json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
    }
    if plots:
        from toolpath_stiff.report.page import page
        from toolpath_stiff.report.path_picture import path_picture
        from toolpath_stiff.report.profile_picture import profile_picture

        contents["path.png"] = lambda: path_picture(analysis, show_plunges=show_plunges)
        contents["profile.png"] = lambda: profile_picture(
            analysis, other=other, required=required, show_plunges=show_plunges
        )
        contents["report.html"] = lambda: page(
            analysis, summary, required=required, other=other, show_plunges=show_plunges
        )
    return contents


def _without_nan(value: Any) -> Any:
    """The same with None for every float that JSON cannot hold."""
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
