"""Readings on pages: residuals over the workspace, before and after; indicators beside the tip; struts over time."""

from __future__ import annotations

MOST_LOOP_ROWS = 40  # on a page; all are in the document


HISTORY_QUESTIONS = {
    "history.png": (
        "Did a strut change, and when?",
        "Points: means of a date. Orange: a change, in the span in which a step lies (95 %), or along a drift.",
    )
}


HISTORY_TITLE = "Struts measured alone, over their dates"


HISTORY_HEAD = ("strut", "readings", "dates", "N/mm", "scatter %", "drift, % a year", "tension", "compression")
