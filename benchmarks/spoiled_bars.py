"""Figures of `benchmarks.spoiled`, each against its bar."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from benchmarks.bars import Figure, Record, holds_truth, named, share
from benchmarks.spoiled_cases import FACTORS, MANY_OUTLIERS, WAYS
from tests.rig.slips import VISIBLE

COST_OF_OUTLIERS = 3.0  # percentage points
Test = Callable[[Record], bool]


def false_name(record: Record) -> bool:
    """`identified`, and a name among them that was not hidden."""
    return record["verdict"] == "identified" and not set(record["plausible"]) <= set(record["truth"])


def told(verdict: str) -> Test:
    """Whether a record has that verdict."""
    return lambda record: bool(record["verdict"] == verdict)


def named_rows(record: Record) -> set[int]:
    """All rows that the diagnosis suspects."""
    return {row for suspect in record["suspects"] for row in suspect["rows"]}


def slip_found(record: Record) -> bool:
    """Whether every slip has one of its rows named: of two exchanged readings one is enough to find the other."""
    return all(named_rows(record) & set(slip["rows"]) for slip in record["slips"])


def slip_visible(record: Record) -> bool:
    """Whether every slip changes the readings by more than scatter hides."""
    return all(slip["detectability"] >= VISIBLE for slip in record["slips"])


def meant_named(record: Record) -> bool:
    """Whether what belongs there stands in what is said of a row of each slip; a refusal says what it expected."""
    return "refused" in record or all(_meant_in(record, slip) for slip in record["slips"])


def _meant_in(record: Record, slip: dict[str, Any]) -> bool:
    words = " ".join(str(suspect) for suspect in record["suspects"] if set(suspect["rows"]) & set(slip["rows"]))
    if slip["kind"] == "directions_exchanged":
        return "direction" in words
    if slip["kind"] in ("lbf_per_in", "N_per_um"):
        return "lbf" in words or "N/um" in words
    return any(f"{value:g}" in words for column in slip["meant"].values() for value in column)


def figures(records: Sequence[Record]) -> list[Figure]:
    """Every figure, of the groups that were run."""
    groups = {"outliers": _outliers, "stated": _stated, "slip": _slips}
    return [
        figure
        for group, count in groups.items()
        if (mine := [r for r in records if r["group"] == group])
        for figure in count(mine)
    ]


def _each(records: Sequence[Record], what: str, test: Test, where: Test | None = None, **bars: float) -> Figure:
    """The share of the cases, or of some of them, that pass a test."""
    return share("tilted", what, [test(r) for r in records if where is None or where(r)], **bars)


def _outliers(records: Sequence[Record]) -> list[Figure]:
    """What many wild readings cost on the same machines, in percentage points."""
    tests: list[tuple[str, str, Test]] = [
        ("none", "`adequate`", told("adequate")),
        ("one", "truth in `plausible`", holds_truth),
        ("one", "`identified` and right", named),
        ("one", "no false name", lambda r: not false_name(r)),
        ("two", "both in `plausible`", holds_truth),
        ("two", "no false name", lambda r: not false_name(r)),
    ]
    made = []
    for hidden, what, test in tests:
        mine = [r for r in records if r["hidden"] == hidden]
        few, many = ([test(r) for r in mine if (r["outliers"] == MANY_OUTLIERS) == many] for many in (False, True))
        made += [share("tilted", f"{n} % wild, {hidden}: {what}", hits) for n, hits in ((2, few), (10, many)) if hits]
        if few and many:
            cost = 100.0 * (sum(few) / len(few) - sum(many) / len(many))
            of, bar = f"10 % wild cost, {hidden}: {what}", f"at most {COST_OF_OUTLIERS:g}"
            made.append(Figure("tilted", of, f"{cost:+.1f} points", "", bar, cost <= COST_OF_OUTLIERS))
    return made


def _stated(records: Sequence[Record]) -> list[Figure]:
    """A wrong noise is said to be wrong, and a right one is not; what it costs the verdicts."""
    made = []
    for layout, way, factor in ((layout, way, factor) for layout, way in WAYS for factor in FACTORS):
        mine = [r for r in records if (r["layout"], r["way"], r["factor"]) == (layout, way, factor)]
        none, one = ([r for r in mine if r["hidden"] == hidden] for hidden in ("none", "one"))
        if not mine:
            continue
        name = f"{layout}, {'--noise' if way == 'option' else 'sd_N_per_mm'} x {factor:g}"
        # Without repeats an effect can look like noise: the bar is for sound machines.
        judged = mine if factor == 1.0 or layout == "tilted" else none
        bar = {"at_most": 0.05} if factor == 1.0 else {"at_least": 0.90}
        made += [
            share(name, "the stated noise is said to be wrong", [bool(r["noise_remarks"]) for r in judged], **bar),
            share(name, "none hidden: `adequate`", list(map(told("adequate"), none))),
            share(name, "one hidden: truth in `plausible`", list(map(holds_truth, one))),
            share(name, "one hidden: `identified`, a name that is not hidden", list(map(false_name, one))),
            share(name, "`unexplained`", list(map(told("unexplained"), mine))),
        ]
    return made


def _slips(records: Sequence[Record]) -> list[Figure]:
    """Mistyped rows: found and named where they show, nothing suspected where there is none.

    Wild readings are no slips, but one of eight standard deviations may look like one: counted, without a bar. The
    reader may refuse a table with a slip.
    """

    def beside(record: Record) -> bool:
        return bool(named_rows(record) - {row for slip in record["slips"] for row in slip["rows"]})

    clean, wrong = (partial(_each, [r for r in records if bool(r["slip"]) == slip]) for slip in (False, True))
    none, one = ((lambda r, hidden=hidden: r["hidden"] == hidden) for hidden in ("none", "one"))
    shown = f"slips with a detectability of {VISIBLE:g} or more: row named"
    sound = "a slip, none hidden: `adequate` (or refused by the reader)"
    held = "a slip, one hidden: truth in `plausible` (or refused)"
    return [
        wrong(shown, slip_found, slip_visible, at_least=0.90),
        wrong("the same: and what it would be", lambda r: slip_found(r) and meant_named(r), slip_visible),
        wrong("slips that show less: row named", slip_found, lambda r: not slip_visible(r)),
        clean("no slip: some row suspected", lambda r: bool(named_rows(r)), at_most=0.05),
        wrong("a slip: another row suspected as well", beside),
        clean("no slip, none hidden: `adequate`", told("adequate"), none),
        wrong(sound, lambda r: r["verdict"] in ("adequate", "refused"), none),
        wrong(held, lambda r: r["verdict"] == "refused" or holds_truth(r), one),
    ]
