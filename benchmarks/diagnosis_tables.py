"""Tables of the diagnosis benchmark beside its bars, and every case that failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from benchmarks.bars import Record, bars_table, holds_truth, mean, misnamed, named, share, truth_of, wilson
from benchmarks.pages import table

VERDICTS = ("adequate", "identified", "described", "ambiguous", "unexplained")
PROBABILITIES = (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 1.0 + 1e-9)
DETECTABILITIES = (0.0, 4.5, 6.0, 9.0, 15.0, 30.0, float("inf"))


def _ratio(count: int, of: int) -> str:
    low, high = wilson(count, of)
    return f"{count} of {of} ({100 * low:.0f} to {100 * high:.0f} %)" if of else "-"


def verdicts_table(records: Sequence[Record]) -> list[str]:
    """Verdicts by what was hidden."""
    rows = []
    for layout in ("tilted", "paper"):
        for group in ("none", "one", "two", "outside"):
            mine = [r["verdict"] for r in records if (r["layout"], r["group"]) == (layout, group)]
            if mine:
                rows.append((layout, group, len(mine), *(Counter(mine)[verdict] for verdict in VERDICTS)))
    return table(f"layout | hidden | cases: | {' | '.join(f'{verdict}:' for verdict in VERDICTS)}", rows)


def effects_table(records: Sequence[Record], layout: str) -> list[str]:
    """How each effect of the catalogue fares."""
    rows = []
    one = [r for r in records if r["layout"] == layout and r["group"] == "one"]
    for name in dict.fromkeys(truth_of(r) for r in one):
        mine = [r for r in one if truth_of(r) == name]
        checks = [c["holds"] for r in mine if r.get("choice_right") for c in r["parameters"]]
        size = sum(len(r["plausible"]) for r in mine) / len(mine)
        rows.append((
            name, len(mine), sum(map(holds_truth, mine)), f"{size:.1f}", sum(r["first"] == name for r in mine),
            sum(map(named, mine)), sum(map(misnamed, mine)), sum(r["verdict"] == "unexplained" for r in mine),
            f"{sum(checks)} of {len(checks)}",
        ))  # fmt: skip
    return table(
        "effect | cases: | in `plausible`: | mean size: | first: | identified, right: | identified, wrong: | "
        "unexplained: | parameters in their intervals:",
        rows,
    )


def power_table(records: Sequence[Record]) -> list[str]:
    """Single effects by how strongly they show."""
    rows = []
    for layout in ("tilted", "paper"):
        one = [r for r in records if r["layout"] == layout and r["group"] == "one"]
        for low, high in pairwise(DETECTABILITIES):
            mine = [r for r in one if low <= r["effects"][0]["detectability"] < high]
            if mine:
                seen = sum(r["verdict"] != "adequate" for r in mine)
                counts = (seen, sum(map(holds_truth, mine)), sum(map(named, mine)))
                label = f"{low:g} to {high:g}" if high < 1e9 else f"from {low:g}"
                rows.append((layout, label, len(mine), *(_ratio(count, len(mine)) for count in counts)))
    return table("layout | detectability | cases: | not `adequate` | truth in `plausible` | identified, right", rows)


def calibration_table(records: Sequence[Record]) -> list[str]:
    """Stated probabilities of `none`, single effects and pairs against how often they are the truth."""
    rows = []
    for layout in ("tilted", "paper"):
        mine = [r for r in records if r["layout"] == layout and r["group"] in ("one", "none")]
        claims = [
            (weight, name == ((r["truth"] or ["none"])[0]))
            for r in mine
            if r["verdict"] != "unexplained"
            for name, weight in r["probability"].items()
        ]
        for label, inside in by_probability(claims, PROBABILITIES):
            stated, hits = (sum(column) for column in zip(*inside, strict=True))
            share_true = f"{100 * hits / len(inside):.1f} %, {_ratio(int(hits), len(inside))}"
            rows.append((layout, label, len(inside), f"{100 * stated / len(inside):.1f} %", share_true))
    return table("layout | stated | hypotheses: | mean stated: | true", rows)


def by_probability(
    claims: Sequence[tuple[float, bool]], ends: Sequence[float]
) -> Iterator[tuple[str, list[tuple[float, bool]]]]:
    """The claims (stated probability, whether it is so) between each two ends, under a label."""
    for low, high in pairwise(ends):
        inside = [claim for claim in claims if low <= claim[0] < high]
        if inside:
            yield f"{100 * low:g} to {100 * min(high, 1.0):g} %", inside


def two_table(records: Sequence[Record]) -> list[str]:
    """Two hidden effects: no bar."""
    found = []
    for layout in ("tilted", "paper"):
        mine = [r for r in records if r["layout"] == layout and r["group"] == "two"]
        if mine:
            found += [
                share(layout, "two hidden: both in `plausible`", [holds_truth(r) for r in mine]),
                share(layout, "two hidden: `identified`, both", [named(r) for r in mine]),
                share(layout, "two hidden: `identified`, one of them alone",
                      [r["verdict"] == "identified" and set(r["plausible"]) < set(r["truth"]) for r in mine]),
                share(layout, "two hidden: `identified`, a name that is not hidden",
                      [r["verdict"] == "identified" and not set(r["plausible"]) <= set(r["truth"]) for r in mine]),
                share(layout, "two hidden: `unexplained`", [r["verdict"] == "unexplained" for r in mine]),
            ]  # fmt: skip
    return bars_table(found)


def misstated_table(records: Sequence[Record]) -> list[str]:
    """What a wrongly stated scatter does."""
    found = []
    for factor in sorted({r["factor"] for r in records if r["group"] == "misstated"}):
        mine = [r for r in records if r["group"] == "misstated" and r["factor"] == factor]
        one, none = ([r for r in mine if bool(r["truth"]) == hidden] for hidden in (True, False))
        layout = f"paper, sd stated x {factor:g}"
        found += [
            share(layout, "none hidden: anything but `adequate`", [r["verdict"] != "adequate" for r in none]),
            share(layout, "none hidden: `identified`", [r["verdict"] == "identified" for r in none]),
            share(layout, "one hidden: the truth is in `plausible`", [holds_truth(r) for r in one]),
            share(layout, "one hidden: `identified` and right", [named(r) for r in one]),
            share(layout, "one hidden: `identified` and wrong", [misnamed(r) for r in one]),
            share(layout, "one hidden: `unexplained`", [r["verdict"] == "unexplained" for r in one]),
            mean(layout, "one hidden: mean size of `plausible`", [float(len(r["plausible"])) for r in one]),
        ]
    return bars_table(found)


def planned_table(records: Sequence[Record]) -> list[str]:
    """Every ambiguous case and what further poses made of it."""
    rows = []
    for r in sorted((r for r in records if r["group"] == "planned"), key=lambda r: r["seed"]):
        settled = [
            ", ".join("yes" if r[f"{label}_{n}"][2] else "no" for n in (2, 4, 6)) if f"{label}_6" in r else ""
            for label in ("planned", "random")
        ]
        last = f"{r['planned_6'][0]}: {', '.join(r['planned_6'][1])}" if "planned_6" in r else "no plan"
        rows.append((
            r["seed"], truth_of(r), ", ".join(r["rivals"]), "yes" if r["settleable"] else "no",
            f"{100 * r.get('forecast', 0.0):.0f} %", *settled, last,
        ))  # fmt: skip
    return table(
        "seed: | hidden | rivals | settleable | forecast: | planned 2, 4, 6 | random 2, 4, 6 | after 6 planned", rows
    )


def failures_table(records: Sequence[Record]) -> list[str]:
    """Every case that counts against a bar, once, with what it did."""
    tests: dict[str, Callable[[Record], str]] = {
        "none": lambda r: "" if r["verdict"] == "adequate" else "false alarm",
        "outside": lambda r: "" if r["verdict"] == "unexplained" else "not `unexplained`",
        "one": _failure_of_one,
    }
    rows = []
    for r in sorted(records, key=lambda r: (r["layout"] != "tilted", r["seed"])):
        what = tests[r["group"]](r) if r["group"] in tests else ""
        if what:
            effect = r["effects"][0] if r["effects"] else {"size": 0.0, "detectability": 0.0}
            rows.append((
                r["layout"], r["seed"], ", ".join(r["truth"]) or "none", f"{100 * effect['size']:.1f}",
                f"{effect['detectability']:.1f}", what, r["verdict"], ", ".join(r["plausible"]),
                r.get("place") or "", r["gate"],
            ))  # fmt: skip
    return table(
        "layout | seed: | hidden | size, %: | detectability: | what | verdict | plausible | place of truth: | "
        "base's p:",
        rows,
    )


def _failure_of_one(record: Record) -> str:
    found = []
    if misnamed(record):
        found.append("wrong name")
    if not holds_truth(record):
        found.append("truth not in `plausible`")
    if record["layout"] == "tilted":
        if record["first"] != truth_of(record):
            found.append("first place wrong")
        if not named(record) and not found:
            found.append("not named")
    return ", ".join(found)


def missed_intervals_table(records: Sequence[Record]) -> list[str]:
    """Every parameter of the right effect whose interval misses its true value."""
    rows = []
    for r in sorted(records, key=lambda r: (r["layout"] != "tilted", r["seed"])):
        for check in r["parameters"] if r["group"] == "one" and r.get("choice_right") else ():
            if not check["holds"]:
                low, high, value = (
                    "infinite" if number is None else f"{number:.4g}" for number in (*check["interval"], check["value"])
                )
                rows.append((
                    r["layout"], r["seed"], truth_of(r), f"{r['effects'][0]['detectability']:.1f}", check["key"],
                    f"{check['true']:.4g}", value, f"{low} to {high}",
                ))  # fmt: skip
    return table("layout | seed: | hidden | detectability: | parameter | true: | fitted: | 95 % interval", rows)
