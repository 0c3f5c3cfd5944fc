"""Dates of readings in ISO 8601, as days since 1970, and back.

A year or a month alone keeps its precision as text ("2021", "2021-03", ISO 8601:2019, 5.2.2.2) and counts as its
middle. Other forms are said by a mapping of columns.
"""

import re
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from functools import lru_cache

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError, MeasurementError
from toolpath_stiff.units import SECONDS_PER_DAY

EPOCH = datetime(1970, 1, 1)  # without a zone, as days are counted
EARLIEST, LATEST = 1900, 2200  # years; beyond, the year is a slip
MID_YEAR, MID_MONTH = (7, 2), 15  # the day that a year, a month alone counts as
EXPECTED = "a date as 2024-03-31, 2024-03-31T14:05, 2024-03 or 2024"
OTHERWISE = 'say how dates are written: --columns "date=date:DD.MM.YYYY" (columns=)'
# Extended format of ISO 8601:2019, 5.2.2.1, 5.2.2.2 and 5.4.2.1; a space for the T as RFC 3339 allows.
DATE_TIME = re.compile(r"\d{4}-\d{2}-\d{2}(?:[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d{1,6})?)?(?:Z|[+-]\d{2}:\d{2})?)?")
REDUCED = re.compile(r"(\d{4})(?:-(\d{2}))?")


@lru_cache(maxsize=1024)  # asked of every record
def day_of(text: str) -> float:
    """Days since 1970-01-01, nan of an empty cell; a time with a zone in UTC, one without as it stands.

    Raises
    ------
    InputError
        No date of ISO 8601, or none of the calendar.

    Examples
    --------
    >>> day_of("1970-01-02T06:00"), day_of("1970-01")
    (1.25, 14.0)
    """
    if not text:
        return float("nan")
    try:
        moment = datetime.fromisoformat(text) if DATE_TIME.fullmatch(text) else _middle(text)
        if moment is not None and moment.tzinfo is not None:
            moment = moment.astimezone(UTC).replace(tzinfo=None)
    except (ValueError, OverflowError):
        moment = None
    if moment is None or not EARLIEST <= moment.year < LATEST:
        raise MeasurementError(f"date {text!r}", expected=EXPECTED, hint=OTHERWISE)
    return (moment - EPOCH).total_seconds() / SECONDS_PER_DAY


def _middle(text: str) -> datetime | None:
    """The day that a year or a month alone counts as."""
    match = REDUCED.fullmatch(text)
    if match is None:
        return None
    month, day = (int(match[2]), MID_MONTH) if match[2] else MID_YEAR
    return datetime(int(match[1]), month, day)


def is_date(text: str) -> bool:
    """Whether a cell is a date of ISO 8601."""
    try:
        return not np.isnan(day_of(text))
    except InputError:
        return False


def date_text(day: float) -> str:
    """The calendar date of a count of days, as day_of counts them."""
    return (EPOCH + timedelta(days=float(np.floor(day)))).date().isoformat()


def short_dates(texts: Iterable[str]) -> dict[float, str]:
    """Day -> text of the dates that are a year or a month alone."""
    return {float(np.floor(day_of(text))): text for text in texts if REDUCED.fullmatch(text)}


def days_since_first(days: FloatArray) -> FloatArray:
    """(n,) days since the first of them; nan stays nan."""
    return np.asarray(days - np.nanmin(days)) if np.isfinite(days).any() else days
