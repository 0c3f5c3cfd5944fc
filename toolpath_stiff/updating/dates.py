"""Dates of readings: ISO 8601, as text and as days."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.units import SECONDS_PER_DAY

EPOCH = datetime(1970, 1, 1)  # without a zone, as days are counted
EARLIEST, LATEST = 1900, 2200  # years; beyond, the year is a slip
EXPECTED = "a date as 2024-03-31, or 2024-03-31T14:05"
# Extended format of ISO 8601:2019, 5.2.2.1 and 5.4.2.1; a space for the T as RFC 3339 allows.
DATE_TIME = re.compile(r"\d{4}-\d{2}-\d{2}(?:[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d{1,6})?)?(?:Z|[+-]\d{2}:\d{2})?)?")


def day_of(text: str) -> float:
    """Days since 1970-01-01, nan of an empty cell; a time with a zone in UTC, one without as it stands.

    Raises
    ------
    InputError
        No date of ISO 8601, or none of the calendar.

    Examples
    --------
    >>> day_of("1970-01-02T06:00")
    1.25
    """
    if not text:
        return float("nan")
    try:
        found = datetime.fromisoformat(text) if DATE_TIME.fullmatch(text) else None
        if found is not None and found.tzinfo is not None:
            found = found.astimezone(UTC).replace(tzinfo=None)
    except (ValueError, OverflowError):
        found = None
    if found is None or not EARLIEST <= found.year < LATEST:
        raise MeasurementError(f"date {text!r}", expected=EXPECTED, hint=_hint(text))
    return (found - EPOCH).total_seconds() / SECONDS_PER_DAY


def _hint(text: str) -> str:
    """What the cell may be, where that can be seen."""
    if re.fullmatch(r"\d{5}(?:\.\d+)?", text):
        return "a spreadsheet's number of a day: format the column as YYYY-MM-DD before you save it"
    if re.fullmatch(r"\d{1,4}[./-]\d{1,2}[./-]\d{1,4}(?:\D.*)?", text):
        return "day and month can be mistaken for each other: format the column as YYYY-MM-DD"
    return ""


def date_text(day: float) -> str:
    """The calendar date of a count of days, as day_of counts them."""
    return (EPOCH + timedelta(days=float(np.floor(day)))).date().isoformat()


def days_since_first(days: FloatArray) -> FloatArray:
    """(n,) days since the first of them; nan stays nan."""
    return np.asarray(days - np.nanmin(days)) if np.isfinite(days).any() else days
