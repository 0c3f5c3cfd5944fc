"""Struts measured alone over their dates: lines for the terminal."""

from toolpath_stiff.readings.history import StrutHistory, StrutOverTime
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import plain

TITLE = "Struts measured alone, over their dates"
HEAD = ("strut", ">readings", ">dates", ">N/mm", ">scatter %", ">drift, % a year", ">tension", ">compression")


def _row(strut: StrutOverTime) -> tuple[str, ...]:
    drift, sides = strut.drift_percent_per_year, strut.sides
    return (
        strut.strut,
        str(strut.readings),
        str(len(strut.dates)),
        f"{strut.stiffness_N_per_mm:,.0f}",
        "-" if strut.scatter_percent is None else f"{strut.scatter_percent:.1f}",
        "-" if drift is None else f"{drift:+.2f} +- {strut.drift_sd_percent_per_year:.2f}",
        *(("-", "-") if sides is None else (f"{sides.tension_N_per_mm:,.0f}", f"{sides.compression_N_per_mm:,.0f}")),
    )


def history_text(history: StrutHistory, undated: bool = False) -> list[str]:
    """Lines for the terminal; without dates and without both signs of the force, only if `undated` are wanted."""
    if not (undated or any(len(strut.dates) > 1 or strut.sides for strut in history.struts)):
        return []
    scatter = history.scatter_percent
    remark = "" if scatter is None else f"scatter from date to date {scatter:.2g} %: {history.scatter_from}"
    sentences = [f"  {plain(line)}" for line in (remark, *history.sentences) if line]
    return ["", TITLE.lower(), *ShownTable(HEAD, [*map(_row, history.struts)]).lines(2, 0), *sentences]
