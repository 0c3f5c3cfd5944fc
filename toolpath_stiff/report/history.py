"""Struts measured alone over their dates: text, a section of a page, a picture."""

from __future__ import annotations

from datetime import date
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from toolpath_stiff.readings.dates import date_text, day_of
from toolpath_stiff.report.figure import INK, MUTED, SECOND_ORANGE, drawn, house_style, new_figure
from toolpath_stiff.report.pages import bullets, markup, picture, section, table
from toolpath_stiff.report.words import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from toolpath_stiff.readings.history import StrutHistory, StrutOverTime


QUESTIONS = {
    "history.png": (
        "Did a strut change, and when?",
        "Points: means of a date. Orange: a change, in the span in which a step lies (95 %), or along a drift.",
    )
}


TITLE = "Struts measured alone, over their dates"


HEAD = ("strut", "readings", "dates", "N/mm", "scatter %", "drift, % a year", "tension", "compression")


def dated(history: StrutHistory) -> bool:
    """Whether some strut was measured on several dates."""
    return any(len(strut.dates) > 1 for strut in history.struts)


def _shown(history: StrutHistory) -> bool:
    return dated(history) or any(strut.sides for strut in history.struts)


def _row(strut: StrutOverTime) -> tuple[str, ...]:
    """A strut under `HEAD`."""
    drift, sides = strut.drift_percent_per_year, strut.sides
    return (
        plain(strut.strut),
        str(strut.readings),
        str(len(strut.dates)),
        f"{strut.stiffness_N_per_mm:,.0f}",
        "-" if strut.scatter_percent is None else f"{strut.scatter_percent:.1f}",
        "-" if drift is None else f"{drift:+.2f} +- {strut.drift_sd_percent_per_year:.2f}",
        *(("-", "-") if sides is None else (f"{sides.tension_N_per_mm:,.0f}", f"{sides.compression_N_per_mm:,.0f}")),
    )


def _remark(history: StrutHistory) -> list[str]:
    """How far readings scatter from date to date."""
    scatter = history.scatter_percent
    return [] if scatter is None else [f"scatter from date to date {scatter:.2g} %: {history.scatter_from}"]


def history_text(history: StrutHistory, undated: bool = False) -> list[str]:
    """Lines for the terminal; without dates and without both signs of the force only where `undated` are wanted."""
    if not (undated or _shown(history)):
        return []
    rows = [HEAD, *map(_row, history.struts)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEAD))]
    lines = [
        "  " + "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
        for row in rows
    ]
    sentences = [f"  {plain(line)}" for line in [*_remark(history), *history.sentences]]
    return ["", TITLE.lower(), *lines, *sentences]


def history_section(history: StrutHistory) -> list[Markup]:
    """The section of a page; none without dates and without both signs of the force."""
    if not _shown(history):
        return []
    listed = table(HEAD, [("", row) for row in map(_row, history.struts)], range(1, len(HEAD)))
    remark = markup('<p class="muted">{}</p>', "; ".join(_remark(history)))
    pictures = {"history.png": history_png(history)} if dated(history) else {}
    return [
        section(TITLE, bullets(history.sentences) + listed + remark),
        picture("history.png", pictures, QUESTIONS),
    ]


@drawn
def history_png(history: StrutHistory) -> Figure:
    """PNG: stiffness of each strut over the date, the mean before and after a step, the span in which it lies."""
    struts = [strut for strut in history.struts if len(strut.dates) > 1]
    with house_style():
        figure = new_figure(9.0, 1.7 * len(struts) + 0.9)
        panels = figure.subplots(len(struts), 1, squeeze=False, sharex=True).ravel()
        for axes, strut in zip(panels, struts, strict=True):
            _strut(axes, strut)
        panels[-1].set_xlabel("date")
        height = figure.get_size_inches()[1]
        figure.suptitle(f"{TITLE}: N/mm", x=0.02, ha="left", weight="bold", color=INK)
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 1.0 - 0.3 / height))
        return figure


def _strut(axes: Axes, strut: StrutOverTime) -> None:
    """One strut: dates as points, changes in orange."""

    def day(text: str) -> Any:  # matplotlib takes dates, its types do not say so
        return date.fromisoformat(date_text(day_of(text)))  # a year or a month alone is its middle

    days = [day(mean.date) for mean in strut.dates]
    axes.plot(days, [mean.stiffness_N_per_mm for mean in strut.dates], "o", color=MUTED, markersize=4.0)
    for change in strut.changes:
        ends = [day(change.after), day(change.before)]
        if change.kind == "step":
            axes.axvspan(*ends, color=SECOND_ORANGE, alpha=0.25, linewidth=0.0)
        axes.plot(ends, [change.from_N_per_mm, change.to_N_per_mm], color=SECOND_ORANGE, linewidth=1.6)
    axes.set_title(strut.strut, fontsize=9.0)
    axes.tick_params(labelsize=8)
