"""Struts measured alone over their dates: text, a section of a page, a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

from markupsafe import Markup

from toolpath_stiff.readings.dates import date_text, day_of
from toolpath_stiff.readings.history import history_lines
from toolpath_stiff.report.figure import INK, MUTED, SECOND_ORANGE, drawn, house_style, new_figure
from toolpath_stiff.report.pages import bullets, markup, picture, section, table
from toolpath_stiff.report.readings import HISTORY_HEAD, HISTORY_QUESTIONS, HISTORY_TITLE
from toolpath_stiff.report.words import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.readings.history import HistoryDocument, StrutEntry


def dated(history: HistoryDocument) -> bool:
    """Whether some strut was measured on several dates."""
    return any(len(one["dates"]) > 1 for one in history["struts"])


def _shown(history: HistoryDocument) -> bool:
    return dated(history) or any(one["sides"] for one in history["struts"])


def _figure_of(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _rows(history: HistoryDocument) -> list[tuple[str, ...]]:
    """Strut, readings, dates, stiffness, scatter, drift, tension, compression."""
    return [
        (
            plain(one["strut"]),
            str(one["readings"]),
            str(len(one["dates"])),
            f"{one['stiffness_N_per_mm']:,.0f}",
            _figure_of(one["scatter_percent"]),
            "-"
            if one["drift_percent_per_year"] is None
            else f"{one['drift_percent_per_year']:+.2f} +- {one['drift_sd_percent_per_year']:.2f}",
            *(
                ("-", "-")
                if one["sides"] is None
                else (f"{one['sides']['tension_N_per_mm']:,.0f}", f"{one['sides']['compression_N_per_mm']:,.0f}")
            ),
        )
        for one in history["struts"]
    ]


def _remark(history: HistoryDocument) -> list[str]:
    """How far readings scatter from date to date."""
    if history["scatter_percent"] is None:
        return []
    return [f"scatter from date to date {history['scatter_percent']:.2g} %: {history['scatter_from']}"]


def history_text(history: HistoryDocument, undated: bool = False) -> list[str]:
    """Lines for the terminal; without dates and without both signs of the force only where `undated` are wanted."""
    if not (undated or _shown(history)):
        return []
    rows = [HISTORY_HEAD, *_rows(history)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HISTORY_HEAD))]
    lines = [
        "  " + "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]
    said = [f"  {plain(line)}" for line in [*_remark(history), *history_lines(history)]]
    return ["", HISTORY_TITLE.lower(), *lines, *said]


def history_section(history: HistoryDocument) -> list[Markup]:
    """The section of a page; none without dates and without both signs of the force."""
    if not _shown(history):
        return []
    listed = table(HISTORY_HEAD, [("", row) for row in _rows(history)], range(1, len(HISTORY_HEAD)))
    remark = markup('<p class="muted">{}</p>', "; ".join(_remark(history)))
    pictures = {"history.png": history_png(history)} if dated(history) else {}
    return [
        section(HISTORY_TITLE, bullets([*history_lines(history)]) + listed + remark),
        picture("history.png", pictures, HISTORY_QUESTIONS),
    ]


@drawn
def history_png(history: HistoryDocument) -> Figure:
    """PNG: stiffness of each strut over the date, the mean before and after a step, the span in which it lies."""
    struts = [one for one in history["struts"] if len(one["dates"]) > 1]
    with house_style():
        figure = new_figure(9.0, 1.7 * len(struts) + 0.9)
        panels = figure.subplots(len(struts), 1, squeeze=False, sharex=True).ravel()
        for axes, one in zip(panels, struts, strict=True):
            _strut(axes, one)
        panels[-1].set_xlabel("date")
        height = figure.get_size_inches()[1]
        figure.suptitle(f"{HISTORY_TITLE}: N/mm", x=0.02, ha="left", weight="bold", color=INK)
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.3 / height))
        return figure


def _strut(axes: Axes, one: StrutEntry) -> None:
    """One strut: dates as points, changes in orange."""
    from datetime import date

    def day(text: str) -> date:
        return date.fromisoformat(date_text(day_of(text)))  # a year or a month alone is its middle

    days = [day(entry["date"]) for entry in one["dates"]]
    axes.plot(days, [entry["stiffness_N_per_mm"] for entry in one["dates"]], "o", color=MUTED, markersize=4.0)  # type: ignore[arg-type]
    for change in one["changes"]:
        ends = [day(change["after"]), day(change["before"])]
        levels = [change["from_N_per_mm"], change["to_N_per_mm"]]
        if change["kind"] == "step":
            axes.axvspan(ends[0], ends[1], color=SECOND_ORANGE, alpha=0.25, linewidth=0.0)  # type: ignore[arg-type]
        axes.plot(ends, levels, color=SECOND_ORANGE, linewidth=1.6)  # type: ignore[arg-type]
    axes.set_title(one["strut"], fontsize=9.0)
    axes.tick_params(labelsize=8)
