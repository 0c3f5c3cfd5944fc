"""Dates of readings in ISO 8601, as days since 1970, and back. Other forms are declared by a mapping of columns."""

import math
import re
from datetime import UTC, datetime, timedelta
from functools import lru_cache

from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.units import SECONDS_PER_DAY

EPOCH = datetime(1970, 1, 1)  # without a zone, as days are counted
EARLIEST, LATEST = 1900, 2200  # years; beyond, the year is a slip
EXPECTED = "a date as 2024-03-31 or 2024-03-31T14:05"
OTHERWISE = 'say how dates are written: --columns "date=date:DD.MM.YYYY" (columns=), a year alone "date=date:YYYY"'
# Extended format of ISO 8601:2019, 5.2.2.1 and 5.4.2.1; a space for the T as RFC 3339 allows.
DATE_TIME = re.compile(r"\d{4}-\d{2}-\d{2}(?:[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d{1,6})?)?(?:Z|[+-]\d{2}:\d{2})?)?")


@lru_cache(maxsize=1024)  # called for every record
def day_of(text: str) -> float:
    """Days since 1970-01-01, nan for an empty cell; a time with a zone is converted to UTC, one without is kept.

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
        moment = datetime.fromisoformat(text) if DATE_TIME.fullmatch(text) else None
        if moment is not None and moment.tzinfo is not None:
            moment = moment.astimezone(UTC).replace(tzinfo=None)
    except (ValueError, OverflowError):
        moment = None
    if moment is None or not EARLIEST <= moment.year < LATEST:
        raise MeasurementError(f"date {text!r}", expected=EXPECTED, hint=OTHERWISE)
    return (moment - EPOCH).total_seconds() / SECONDS_PER_DAY


def date_text(day: float) -> str:
    """Calendar date of a number of days as counted by `day_of`."""
    return (EPOCH + timedelta(days=math.floor(day))).date().isoformat()
