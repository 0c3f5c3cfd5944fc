"""Dates of readings: what offices and loggers write, to ISO 8601; as days since 1970, and back.

A year or a month alone keeps its precision as text ("2021", "2021-03", ISO 8601:2019, 5.2.2.2) and counts as its
middle. Which of two numbers is the day is told by a date of the set that can be read in one way only; dots go with the
day first (DIN 1355-1, and the common use where dots stand).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError, MeasurementError
from toolpath_stiff.units import SECONDS_PER_DAY

Order = Literal["dmy", "mdy"]


ORDERS: tuple[Order, ...] = ("dmy", "mdy")


EPOCH = datetime(1970, 1, 1)  # without a zone, as days are counted


EARLIEST, LATEST = 1900, 2200  # years; beyond, the year is a slip


MID_YEAR, MID_MONTH = (7, 2), 15  # the day that a year, a month alone counts as


TWO_DIGITS = 69  # years 69 to 99 are of the last century (POSIX strptime, %y)


SERIALS = 20_000, 80_000  # days of a spreadsheet that are taken for dates: 1954 to 2119


SERIAL_ZERO = datetime(1899, 12, 30)  # day 0 of Excel's 1900 system, its 29 February 1900 counted (ECMA-376, 18.17.4.1)


EXPECTED = "a date as 2024-03-31, 2024-03-31T14:05, 31.03.2024, 31 Mar 2024, 2024-03 or 2024"


WRITE_ISO = "write the dates as YYYY-MM-DD"


# Extended format of ISO 8601:2019, 5.2.2.1, 5.2.2.2 and 5.4.2.1; a space for the T as RFC 3339 allows.
DATE_TIME = re.compile(r"\d{4}-\d{2}-\d{2}(?:[T ]\d{2}:\d{2}(?::\d{2}(?:\.\d{1,6})?)?(?:Z|[+-]\d{2}:\d{2})?)?")


REDUCED = re.compile(r"(\d{4})(?:-(\d{2}))?")


MONTHS = {
    name: number
    for number, names in enumerate(
        (
            "jan january januar jänner janvier", "feb february februar février", "mar march mär märz mrz mars",
            "apr april avril", "may mai", "jun june juni juin", "jul july juli juillet", "aug august août",
            "sep sept september septembre", "oct october okt oktober octobre", "nov november novembre",
            "dec december dez dezember décembre",
        ),
        start=1,
    )
    for name in names.split()
}  # fmt: skip


_MONTH = r"(?P<month>[a-zäéû]{3,9})\.?"


_DAY = r"(?P<day>\d{1,2})(?:st|nd|rd|th)?\.?"


_YEAR = r"(?P<year>\d{4}|'?\d{2})"


WORDED = (
    re.compile(rf"{_DAY}[ -]*{_MONTH}[ ,-]*{_YEAR}"),
    re.compile(rf"{_MONTH}[ -]*{_DAY}[ ,]+{_YEAR}"),
    re.compile(rf"(?P<year>\d{{4}})[ -]*{_MONTH}[ -]*{_DAY}"),
    re.compile(rf"{_MONTH}[ ,-]*(?P<year>\d{{4}})"),
    re.compile(rf"(?P<year>\d{{4}})[ -]*{_MONTH}"),
)


NUMBERED = (
    re.compile(r"(?P<year>\d{4})(?P<mark>[-/. ])(?P<month>\d{1,2})(?P=mark)(?P<day>\d{1,2})\.?"),
    re.compile(r"(?P<year>(?:19|20)\d{2})(?P<month>\d{2})(?P<day>\d{2})"),
    re.compile(r"(?P<day>\d{1,2})\. ?(?P<month>\d{1,2})\. ?(?P<year>\d{4}|\d{2})"),
    re.compile(r"(?P<year>\d{4})[-/.](?P<month>\d{1,2})"),
    re.compile(r"(?P<month>\d{1,2})[-/.](?P<year>\d{4})"),
    re.compile(r"(?P<year>\d{4})"),
)


EITHER = re.compile(r"(?P<one>\d{1,2})(?P<mark>[/-])(?P<other>\d{1,2})(?P=mark)(?P<year>\d{4}|\d{2})")


WITH_TIME = re.compile(
    r"(?P<date>.+?)(?:T|,? +|,)(?P<hour>\d{1,2})[:h](?P<minute>\d{2})(?::(?P<second>\d{2})(?:[.,]\d+)?)?"
    r"(?: ?(?P<half>[ap])\.?m\.?)?(?P<zone>Z| ?[+-]\d{2}:\d{2})?",
    re.IGNORECASE,
)


WEEKDAY = re.compile(r"(?:mon|tue|wed|thu|fri|sat|sun|mo|di|mi|do|fr|sa|so)[a-z]*[.,] *", re.IGNORECASE)


# Within a name, where letters may stand before and after.
IN_NAME = (
    re.compile(r"(?<!\d)(?:19|20)\d{2}([-_.])(?:0[1-9]|1[0-2])\1(?:[0-2]\d|3[01])(?!\d)"),
    re.compile(r"(?<!\d)\d{1,2}([-_./])\d{1,2}\1(?:19|20)\d{2}(?!\d)"),
    re.compile(r"(?<!\d)(?:19|20)\d{2}(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])(?!\d)"),
    re.compile(rf"(?<![^\W_])(?:\d{{1,2}}[ _-]*)?(?:{'|'.join(MONTHS)})[ _-]*(?:19|20)\d{{2}}(?!\d)", re.IGNORECASE),
    re.compile(r"(?<!\d)(?:19|20)\d{2}[-_](?:0[1-9]|1[0-2])(?![\d-])"),
    re.compile(r"(?<![^\W_])(?:19|20)\d{2}(?![^\W_])"),
)


def order_of(text: str | None) -> Order | None:
    """An order by its name. Raises `InputError`."""
    for order in ORDERS:
        if text == order:
            return order
    if text is not None:
        raise MeasurementError(f"date order {text!r}", expected=" or ".join(ORDERS))
    return None


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
        found = datetime.fromisoformat(text) if DATE_TIME.fullmatch(text) else _middle(text)
        if found is not None and found.tzinfo is not None:
            found = found.astimezone(UTC).replace(tzinfo=None)
    except (ValueError, OverflowError):
        found = None
    if found is None or not EARLIEST <= found.year < LATEST:
        raise MeasurementError(f"date {text!r}", expected=EXPECTED)
    return (found - EPOCH).total_seconds() / SECONDS_PER_DAY


def _middle(text: str) -> datetime | None:
    """The day that a year or a month alone counts as."""
    found = REDUCED.fullmatch(text)
    if found is None:
        return None
    month, day = (int(found[2]), MID_MONTH) if found[2] else MID_YEAR
    return datetime(int(found[1]), month, day)


def date_text(day: float) -> str:
    """The calendar date of a count of days, as day_of counts them."""
    return (EPOCH + timedelta(days=float(np.floor(day)))).date().isoformat()


def short_dates(texts: Iterable[str]) -> dict[float, str]:
    """Day -> text of the dates that are a year or a month alone."""
    return {float(np.floor(day_of(text))): text for text in texts if REDUCED.fullmatch(text)}


def days_since_first(days: FloatArray) -> FloatArray:
    """(n,) days since the first of them; nan stays nan."""
    return np.asarray(days - np.nanmin(days)) if np.isfinite(days).any() else days


def like_date(text: str) -> bool:
    """Whether a cell is a date with year, month and day, in whatever order."""
    read = _read(text)
    return read is not None and bool(read.iso[0]) and not REDUCED.fullmatch(read.iso[0]) and not read.serial


class _Read(NamedTuple):
    """ISO 8601 with the day first and with the month first; the same where only one can be meant; "" where neither."""

    iso: tuple[str, str]
    serial: bool = False


def _read(text: str) -> _Read | None:
    """A cell as a date; None where it is none."""
    text = WEEKDAY.sub("", " ".join(text.split()), count=1) if WEEKDAY.match(text) else " ".join(text.split())
    if re.fullmatch(r"\d{5}(?:\.\d+)?", text) and SERIALS[0] <= float(text) < SERIALS[1]:
        found = SERIAL_ZERO + timedelta(minutes=round(1440.0 * float(text)))
        iso = found.date().isoformat() if "." not in text else found.isoformat(timespec="minutes")
        return _Read((iso, iso), serial=True)
    timed = WITH_TIME.fullmatch(text)
    date, tail = (timed["date"], _time(timed)) if timed else (text, "")
    if timed and not tail:
        return None
    either = EITHER.fullmatch(date)
    if either:
        one, other, year = int(either["one"]), int(either["other"]), _year(either["year"])
        found_dates = _iso(year, other, one), _iso(year, one, other)
        shown = [one_date and one_date + tail for one_date in found_dates]
        return _Read((shown[0], shown[1])) if any(shown) else None
    for pattern in NUMBERED:
        if match := pattern.fullmatch(date):
            parts = match.groupdict()
            return _one(_iso(_year(parts["year"]), int(parts.get("month") or 0), int(parts.get("day") or 0)), tail)
    for pattern in WORDED:
        match = pattern.fullmatch(date.casefold())
        if match and match["month"] in MONTHS:
            parts = match.groupdict()
            return _one(_iso(_year(parts["year"]), MONTHS[parts["month"]], int(parts.get("day") or 0)), tail)
    return None


def _one(iso: str, tail: str) -> _Read | None:
    """A date that can be read in one way; a year or a month has no time of the day."""
    if not iso or (tail and REDUCED.fullmatch(iso)):
        return None
    return _Read((iso + tail, iso + tail))


def _year(text: str) -> int:
    text = text.removeprefix("'")
    return int(text) if len(text) > 2 else int(text) + (1900 if int(text) >= TWO_DIGITS else 2000)


def _iso(year: int, month: int, day: int) -> str:
    """ISO 8601; "" where the calendar has no such day. Month or day 0 is not given."""
    if not EARLIEST <= year < LATEST:
        return ""
    try:
        datetime(year, month or 1, day or 1)
    except ValueError:
        return ""
    return f"{year:04d}" + (f"-{month:02d}" if month else "") + (f"-{day:02d}" if day else "")


def _time(match: re.Match[str]) -> str:
    """The time of the day as ISO 8601 has it, with its T; "" where there is none such."""
    hour, half = int(match["hour"]), (match["half"] or "").casefold()
    if half and not 1 <= hour <= 12:
        return ""
    hour = hour % 12 + 12 * (half == "p") if half else hour
    if hour > 23 or int(match["minute"]) > 59 or int(match["second"] or 0) > 60:
        return ""
    second = f":{match['second']}" if match["second"] else ""
    return f"T{hour:02d}:{match['minute']}{second}{(match['zone'] or '').strip().upper()}"


class Dates(NamedTuple):
    """Dates of a set by how they are written, in ISO 8601; and what reading them left to be said."""

    iso: dict[str, str]
    notes: list[str]

    def of(self, text: str) -> str:
        """A cell's date in ISO 8601; a cell that is none as it stands, for `day_of` to refuse it."""
        return self.iso.get(text, text)


def read_dates(texts: Iterable[str], order: Order | None = None, remedy: str = WRITE_ISO) -> Dates:
    """Dates of one set, as they are written in cells, heads and names.

    Parameters
    ----------
    texts
        As written; those of ISO 8601 and those that are no dates are left as they are.
    order
        Whether the day or the month stands first between slashes or dashes; None: what the set shows.
    remedy
        What to do where that cannot be told, for the message.

    Raises
    ------
    InputError
        Dates that can be read in two ways, or of both orders in one set.

    Examples
    --------
    >>> read_dates(["04/03/2021", "16/09/2021", "12 Mar 2022", "2019"]).iso
    {'04/03/2021': '2021-03-04', '16/09/2021': '2021-09-16', '12 Mar 2022': '2022-03-12'}
    """
    found = {text: _as_iso(text) or _read(text) for text in dict.fromkeys(texts) if text}
    return _settled({text: read for text, read in found.items() if read is not None}, order, remedy)


def _as_iso(text: str) -> _Read | None:
    """A date that is written so already, in whatever precision."""
    try:
        day_of(text)
    except InputError:
        return None
    return _Read((text, text))


def _settled(found: dict[str, _Read], order: Order | None, remedy: str) -> Dates:
    """One reading of each; raises `InputError` where there are two."""
    doubtful = [text for text, read in found.items() if read.iso[0] != read.iso[1]]
    sure = {name: [t for t in doubtful if not found[t].iso[1 - k]] for k, name in enumerate(ORDERS)}
    chosen = _order_of(found, doubtful, sure, order, remedy)
    which = 0 if chosen is None else ORDERS.index(chosen)
    iso = {text: read.iso[which] or text for text, read in found.items()}
    shown_by = sure[chosen or "dmy"][0] if doubtful and order is None else ""
    return Dates({text: one for text, one in iso.items() if text != one}, _notes_on(found, iso, chosen, shown_by))


def _order_of(
    found: dict[str, _Read], doubtful: list[str], sure: dict[Order, list[str]], order: Order | None, remedy: str
) -> Order | None:
    """The order of day and month: as asked, or as the dates of the set show; None where none is in doubt."""
    if order is None and sure["dmy"] and sure["mdy"]:
        raise MeasurementError(
            f"date {sure['dmy'][0]!r} has the day first and {sure['mdy'][0]!r} the month",
            expected="one order in all dates of a set",
            hint=remedy,
        )
    chosen = order or next((name for name in ORDERS if sure[name]), None)
    if doubtful and chosen is None:
        one, other = found[doubtful[0]].iso
        raise MeasurementError(
            f"date {doubtful[0]!r} could be {one} or {other}, and no other date of the set tells", hint=remedy
        )
    return chosen


def _notes_on(found: dict[str, _Read], iso: dict[str, str], chosen: Order | None, shown_by: str) -> list[str]:
    """What was taken for granted; `shown_by`: the date that tells the order of the others, if one had to."""
    notes = []
    if shown_by:
        first = "day" if chosen == "dmy" else "month"
        notes.append(f"dates are read with the {first} first, as {shown_by!r} shows")
    if any(read.serial for read in found.values()):
        text = next(text for text, read in found.items() if read.serial)
        notes.append(f"a spreadsheet's numbers of days are read as dates: {text} as {iso[text]}")
    short = [one for one in iso.values() if REDUCED.fullmatch(one)]
    if short:
        notes.append(f"a year or a month alone counts as its middle: {short[0]} as {date_text(day_of(short[0]))}")
    return notes


def dates_in(name: str) -> list[str]:
    """What looks like a date in the name of a file, a sheet or a folder; the fullest kind that there is."""
    for pattern in IN_NAME:
        found = [match[0].replace("_", "-") for match in pattern.finditer(name)]
        if found:
            return found
    return []


def finer(one: str, other: str) -> str | None:
    """The more precise of two dates of ISO 8601 that agree; None where they do not."""
    short, full = sorted((one, other), key=len)
    return full if full.startswith(short) else None
