"""Figures of `benchmarks.several`, each against its bar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from benchmarks.bars import JUST_SEEN, Figure, Record, holds_truth, mean, named, share
from benchmarks.several_cases import FACTORS, MANY_OUTLIERS, WAYS
from toolpath_stiff.rig.slips import VISIBLE

COST_OF_OUTLIERS = 3.0  # percentage points


def false_name(record: Record) -> bool:
    """`identified`, and a name among them that was not hidden."""
    return record["verdict"] == "identified" and not set(record["plausible"]) <= set(record["truth"])


def all_seen(record: Record) -> bool:
    """Whether each hidden effect, alone, shows beside strut law and nuisances."""
    return all(effect["detectability"] >= JUST_SEEN for effect in record["effects"])


def all_show(record: Record) -> bool:
    """Whether each hidden effect shows beside the others, whose sizes are free (`several_seen`)."""
    return all(effect["beside"] >= JUST_SEEN for effect in record["effects"])


def held_or_listed(record: Record) -> bool:
    """Whether all that was hidden is in `plausible`, or told as neither shown nor excluded."""
    return set(record["truth"]) <= {*record["plausible"], *record["not_excluded"]}


def strongest_right(record: Record, count: int = 2) -> bool:
    """Whether the strongest effects by the size they have are in `plausible`, and nothing false is named."""
    ordered = sorted(record["effects"], key=lambda effect: -effect["size"])
    return {effect["effect"] for effect in ordered[:count]} <= set(record["plausible"]) and not false_name(record)


def rows_of_suspect(suspect: Any) -> set[int]:
    """Rows (from 1) that an entry of `suspect_rows` names: a number, or `row`, `rows`, `line` or `lines` (row + 1)."""
    if isinstance(suspect, int):
        return {suspect}
    found = _numbers(suspect.get("row")) | _numbers(suspect.get("rows"))
    return found or {line - 1 for line in _numbers(suspect.get("line")) | _numbers(suspect.get("lines"))}


def _numbers(value: Any) -> set[int]:
    return {int(one) for one in (value if isinstance(value, list) else [] if value is None else [value])}


def named_rows(record: Record) -> set[int]:
    """All rows that the diagnosis suspects."""
    return {row for suspect in record["suspects"] for row in rows_of_suspect(suspect)}


def slip_found(record: Record) -> bool:
    """Whether every slip has one of its rows named: of two exchanged readings one is enough to find the other."""
    rows = named_rows(record)
    return all(rows & set(slip["rows"]) for slip in record["slips"])


def slip_visible(record: Record) -> bool:
    """Whether every slip changes the readings by more than scatter hides."""
    return all(slip["detectability"] >= VISIBLE for slip in record["slips"])


def meant_named(record: Record) -> bool:
    """Whether the right value of each slip stands in what is said of one of its rows: it would have been believed.

    A refusal by the reader says what it expected instead: that counts.
    """
    if "refused" in record:
        return slip_found(record)
    for slip in record["slips"]:
        words = [str(s) for s in record["suspects"] if rows_of_suspect(s) & set(slip["rows"])]
        values = [value for column in slip["meant"].values() for value in column]
        if slip["kind"] == "directions_exchanged":
            hit = any("direction" in one for one in words)
        elif slip["kind"] in ("lbf_per_in", "N_per_um"):
            hit = any("lbf" in one or "N/um" in one for one in words)
        else:
            hit = any(f"{value:g}" in one for one in words for value in values)
        if not hit:
            return False
    return True


def figures(records: Sequence[Record]) -> list[Figure]:
    """Every figure, of the groups that were run."""
    groups: dict[str, Callable[[Sequence[Record]], list[Figure]]] = {
        "pair": _pairs, "three": _three, "outliers": _outliers, "stated": _stated, "slip": _slips,
    }  # fmt: skip
    return [
        figure
        for group, count in groups.items()
        if (mine := [r for r in records if r["group"] == group])
        for figure in count(mine)
    ]


def _pairs(records: Sequence[Record]) -> list[Figure]:
    at = "tilted"
    return [
        share(at, "pairs: both in `plausible`", [holds_truth(r) for r in records], at_least=0.90),
        share(at, f"the same, both with a detectability of {JUST_SEEN:g} or more",
              [holds_truth(r) for r in records if all_seen(r)]),
        share(at, "the same, each beside the other, whose sizes are free",
              [holds_truth(r) for r in records if all_show(r)]),
        share(at, "pairs: both in `plausible` or `not_excluded`", [held_or_listed(r) for r in records]),
        *_listed(at, "pairs", records),
        share(at, "pairs: `identified`, both", [named(r) for r in records]),
        share(at, "pairs: `identified`, a name that is not hidden", [false_name(r) for r in records], at_most=0.04),
        share(at, "pairs: `identified`, one of them alone",
              [r["verdict"] == "identified" and set(r["plausible"]) < set(r["truth"]) for r in records]),
        share(at, "pairs: `unexplained`", [r["verdict"] == "unexplained" for r in records]),
        share(at, "pairs: at most four names in `plausible`", [len(r["plausible"]) <= 4 for r in records]),
    ]  # fmt: skip


def _listed(at: str, what: str, records: Sequence[Record]) -> list[Figure]:
    """How many effects are told as not excluded, how often one of them is there, and how likely each was said to be."""
    listed = [(name in r["truth"], chance) for r in records for name, chance in r["not_excluded"].items()]
    return [
        mean(at, f"{what}: effects in `not_excluded`", [float(len(r["not_excluded"])) for r in records]),
        share(at, f"{what}: one that is listed there is hidden", [there for there, _ in listed]),
        mean(at, f"{what}: probability (%) that is given with it", [100.0 * chance for _, chance in listed]),
    ]


def _three(records: Sequence[Record]) -> list[Figure]:
    at = "tilted"
    return [
        share(at, "three: the strongest two in `plausible`, nothing false named", [strongest_right(r) for r in records],
              at_least=0.80),
        share(at, f"the same, all with a detectability of {JUST_SEEN:g} or more",
              [strongest_right(r) for r in records if all_seen(r)]),
        share(at, "the same, each beside the others, whose sizes are free",
              [strongest_right(r) for r in records if all_show(r)]),
        share(at, "three: all in `plausible`", [holds_truth(r) for r in records]),
        share(at, "three: all in `plausible` or `not_excluded`", [held_or_listed(r) for r in records]),
        *_listed(at, "three", records),
        share(at, "three: `identified`, a name that is not hidden", [false_name(r) for r in records], at_most=0.05),
        share(at, "three: `unexplained`", [r["verdict"] == "unexplained" for r in records]),
    ]  # fmt: skip


def _outliers(records: Sequence[Record]) -> list[Figure]:
    """What many wild readings cost on the same machines, in percentage points."""
    tests: list[tuple[str, str, Callable[[Record], bool]]] = [
        ("none", "`adequate`", lambda r: r["verdict"] == "adequate"),
        ("one", "truth in `plausible`", holds_truth),
        ("one", "`identified` and right", named),
        ("one", "no false name", lambda r: not false_name(r)),
        ("pair", "both in `plausible`", holds_truth),
        ("pair", "no false name", lambda r: not false_name(r)),
    ]
    found = []
    for hidden, what, test in tests:
        shares = {}
        for many in (False, True):
            mine = [r for r in records if r["hidden"] == hidden and (r["outliers"] == MANY_OUTLIERS) == many]
            shares[many] = [test(r) for r in mine]
            if mine:
                found.append(share("tilted", f"{'10' if many else '2'} % wild, {hidden}: {what}", shares[many]))
        if shares[True] and shares[False]:
            cost = 100.0 * (sum(shares[False]) / len(shares[False]) - sum(shares[True]) / len(shares[True]))
            found.append(
                Figure("tilted", f"10 % wild cost, {hidden}: {what}", f"{cost:+.1f} points", "",
                       f"at most {COST_OF_OUTLIERS:g}", cost <= COST_OF_OUTLIERS)
            )  # fmt: skip
    sound = [r for r in records if r["hidden"] == "none"]
    one = [r for r in records if r["hidden"] == "one"]
    return [*found, *_listed("tilted", "none hidden", sound), *_listed("tilted", "one hidden", one)]


def _stated(records: Sequence[Record]) -> list[Figure]:
    """A wrong noise is said to be wrong, and a right one is not; what it costs the verdicts."""
    found = []
    for layout, way in WAYS:
        for factor in FACTORS:
            mine = [r for r in records if (r["layout"], r["way"], r["factor"]) == (layout, way, factor)]
            none = [r for r in mine if r["hidden"] == "none"]
            one = [r for r in mine if r["hidden"] == "one"]
            if not mine:
                continue
            at = f"{layout}, {'--noise' if way == 'option' else 'sd_N_per_mm'} x {factor:g}"
            said = "the stated noise is said to be wrong"
            if factor == 1.0:
                found.append(share(at, said, [bool(r["noise_remarks"]) for r in mine], at_most=0.05))
            else:
                # Without repeats an effect can look like noise: the bar is for sound machines.
                repeats = layout == "tilted"
                found.append(
                    share(at, said, [bool(r["noise_remarks"]) for r in (mine if repeats else none)], at_least=0.90)
                )
            found += [
                share(at, "none hidden: `adequate`", [r["verdict"] == "adequate" for r in none]),
                share(at, "one hidden: truth in `plausible`", [holds_truth(r) for r in one]),
                share(at, "one hidden: `identified`, a name that is not hidden", [false_name(r) for r in one]),
                share(at, "`unexplained`", [r["verdict"] == "unexplained" for r in mine]),
            ]
    return found


def _slips(records: Sequence[Record]) -> list[Figure]:
    """Mistyped rows: found and named where they show, nothing suspected where there is none."""
    clean = [r for r in records if not r["slip"]]
    wrong = [r for r in records if r["slip"]]
    plain = [r for r in wrong if slip_visible(r)]
    faint = [r for r in wrong if not slip_visible(r)]
    # Wild readings are no slips, but one of eight standard deviations may look like one: counted, without a bar.
    beside = [bool(named_rows(r) - {row for slip in r["slips"] for row in slip["rows"]}) for r in wrong]
    return [
        share("tilted", f"slips with a detectability of {VISIBLE:g} or more: row named", [slip_found(r) for r in plain],
              at_least=0.90),
        share("tilted", "the same: and what it would be", [slip_found(r) and meant_named(r) for r in plain]),
        share("tilted", "slips that show less: row named", [slip_found(r) for r in faint]),
        share("tilted", "no slip: some row suspected", [bool(named_rows(r)) for r in clean], at_most=0.05),
        share("tilted", "a slip: another row suspected as well", beside),
        *_slips_verdicts(clean, wrong),
    ]  # fmt: skip


def _slips_verdicts(clean: Sequence[Record], wrong: Sequence[Record]) -> list[Figure]:
    """The verdict with nothing or one effect hidden; the reader may refuse a table with a slip."""
    sound, spoiled = ([r for r in some if r["hidden"] == "none"] for some in (clean, wrong))
    with_one = [r for r in wrong if r["hidden"] == "one"]
    return [
        share("tilted", "no slip, none hidden: `adequate`",
              [r["verdict"] == "adequate" for r in sound]),
        share("tilted", "a slip, none hidden: `adequate` (or refused by the reader)",
              [r["verdict"] in ("adequate", "refused") for r in spoiled]),
        share("tilted", "a slip, one hidden: truth in `plausible` (or refused)",
              [r["verdict"] == "refused" or holds_truth(r) for r in with_one]),
    ]  # fmt: skip
