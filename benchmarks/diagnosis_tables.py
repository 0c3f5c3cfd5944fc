"""Tables of the diagnosis benchmark beside its bars, and every case that failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise

from benchmarks.diagnosis_bars import (
    Figure,
    Record,
    holds_truth,
    mean,
    misnamed,
    named,
    share,
    truth_of,
    wilson,
)

VERDICTS = ("adequate", "identified", "described", "ambiguous", "unexplained")
PROBABILITIES = (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 1.0 + 1e-9)
DETECTABILITIES = (0.0, 4.5, 6.0, 9.0, 15.0, 30.0, float("inf"))
BAR_HEADING = ["| layout | figure | value | 95 % interval | bar | |", "| --- | --- | --- | --- | --- | --- |"]


def bars_table(found: Sequence[Figure]) -> list[str]:
    """The table of figures with their bars."""
    return [*BAR_HEADING, *(figure.line for figure in found)]


def summary(found: Sequence[Figure]) -> str:
    """What fails, in a sentence."""
    failed = [f"{figure.layout}: {figure.what}, {figure.value}" for figure in found if figure.cleared is False]
    count = sum(figure.cleared is not None for figure in found)
    if not failed:
        return f"All {count} bars are cleared."
    return f"{len(failed)} of {count} bars are not cleared. " + "; ".join(failed) + "."


def _ratio(count: int, of: int) -> str:
    low, high = wilson(count, of)
    return f"{count} of {of} ({100 * low:.0f} to {100 * high:.0f} %)" if of else "-"


def verdicts_table(records: Sequence[Record]) -> list[str]:
    """Verdicts by what was hidden."""
    lines = ["| layout | hidden | cases | " + " | ".join(VERDICTS) + " |"]
    lines.append("| --- | --- " + "| ---: " * (1 + len(VERDICTS)) + "|")
    for layout in ("tilted", "paper"):
        for group in ("none", "one", "two", "outside"):
            mine = [r["verdict"] for r in records if (r["layout"], r["group"]) == (layout, group)]
            if mine:
                counts = " | ".join(str(Counter(mine)[verdict]) for verdict in VERDICTS)
                lines.append(f"| {layout} | {group} | {len(mine)} | {counts} |")
    return lines


def effects_table(records: Sequence[Record], layout: str) -> list[str]:
    """How each effect of the catalogue fares."""
    lines = [
        "| effect | cases | in `plausible` | mean size | first | identified, right | identified, wrong | unexplained | "
        "parameters in their intervals |",
        "| --- " + "| ---: " * 8 + "|",
    ]
    one = [r for r in records if r["layout"] == layout and r["group"] == "one"]
    for name in dict.fromkeys(truth_of(r) for r in one):
        mine = [r for r in one if truth_of(r) == name]
        checks = [c["holds"] for r in mine if r.get("choice_right") for c in r["parameters"]]
        size = sum(len(r["plausible"]) for r in mine) / len(mine)
        cells = [
            sum(map(holds_truth, mine)), f"{size:.1f}", sum(r["first"] == name for r in mine), sum(map(named, mine)),
            sum(map(misnamed, mine)), sum(r["verdict"] == "unexplained" for r in mine),
            f"{sum(checks)} of {len(checks)}",
        ]  # fmt: skip
        lines.append(f"| {name} | {len(mine)} | " + " | ".join(map(str, cells)) + " |")
    return lines


def power_table(records: Sequence[Record]) -> list[str]:
    """Single effects by how strongly they show."""
    lines = [
        "| layout | detectability | cases | not `adequate` | truth in `plausible` | identified, right |",
        "| --- | --- | ---: | --- | --- | --- |",
    ]
    for layout in ("tilted", "paper"):
        one = [r for r in records if r["layout"] == layout and r["group"] == "one"]
        for low, high in pairwise(DETECTABILITIES):
            mine = [r for r in one if low <= r["effects"][0]["detectability"] < high]
            if mine:
                seen = sum(r["verdict"] != "adequate" for r in mine)
                cells = (seen, sum(map(holds_truth, mine)), sum(map(named, mine)))
                label = f"{low:g} to {high:g}" if high < 1e9 else f"from {low:g}"
                lines.append(
                    f"| {layout} | {label} | {len(mine)} | {' | '.join(_ratio(c, len(mine)) for c in cells)} |"
                )
    return lines


def calibration_table(records: Sequence[Record]) -> list[str]:
    """Stated probabilities of `none`, single effects and pairs against how often they are the truth."""
    lines = ["| layout | stated | hypotheses | mean stated | true |", "| --- | --- | ---: | ---: | --- |"]
    for layout in ("tilted", "paper"):
        mine = [r for r in records if r["layout"] == layout and r["group"] in ("one", "none")]
        claims = [
            (weight, name == ((r["truth"] or ["none"])[0]))
            for r in mine
            if r["verdict"] != "unexplained"
            for name, weight in r["probability"].items()
        ]
        for low, high in pairwise(PROBABILITIES):
            inside = [claim for claim in claims if low <= claim[0] < high]
            if inside:
                stated = sum(weight for weight, _ in inside) / len(inside)
                hits = sum(true for _, true in inside)
                label = f"{100 * low:g} to {100 * min(high, 1.0):g} %"
                lines.append(
                    f"| {layout} | {label} | {len(inside)} | {100 * stated:.1f} % | "
                    f"{100 * hits / len(inside):.1f} %, {_ratio(hits, len(inside))} |"
                )
    return lines


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
    lines = [
        "| seed | hidden | rivals | settleable | forecast | planned 2, 4, 6 | random 2, 4, 6 | after 6 planned |",
        "| ---: | --- | --- | --- | ---: | --- | --- | --- |",
    ]
    for r in sorted((r for r in records if r["group"] == "planned"), key=lambda r: r["seed"]):
        settled = {
            label: ", ".join("yes" if r[f"{label}_{n}"][2] else "no" for n in (2, 4, 6))
            for label in ("planned", "random")
            if f"{label}_6" in r
        }
        last = f"{r['planned_6'][0]}: {', '.join(r['planned_6'][1])}" if "planned_6" in r else "no plan"
        lines.append(
            f"| {r['seed']} | {truth_of(r)} | {', '.join(r['rivals'])} | {'yes' if r['settleable'] else 'no'} | "
            f"{100 * r.get('forecast', 0.0):.0f} % | {settled.get('planned', '')} | "
            f"{settled.get('random', '')} | {last} |"
        )
    return lines


def failures_table(records: Sequence[Record]) -> list[str]:
    """Every case that counts against a bar, once, with what it did."""
    tests: dict[str, Callable[[Record], str]] = {
        "none": lambda r: "" if r["verdict"] == "adequate" else "false alarm",
        "outside": lambda r: "" if r["verdict"] == "unexplained" else "not `unexplained`",
        "one": _failure_of_one,
    }
    lines = [
        "| layout | seed | hidden | size, % | detectability | what | verdict | plausible | place of truth | base's p |",
        "| --- | ---: | --- | ---: | ---: | --- | --- | --- | ---: | ---: |",
    ]
    for r in sorted(records, key=lambda r: (r["layout"] != "tilted", r["seed"])):
        what = tests[r["group"]](r) if r["group"] in tests else ""
        if what:
            effect = r["effects"][0] if r["effects"] else {"size": 0.0, "detectability": 0.0}
            lines.append(
                f"| {r['layout']} | {r['seed']} | {', '.join(r['truth']) or 'none'} | {100 * effect['size']:.1f} | "
                f"{effect['detectability']:.1f} | {what} | {r['verdict']} | {', '.join(r['plausible'])} | "
                f"{r.get('place') or ''} | {r['gate']} |"
            )
    return lines


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
    lines = [
        "| layout | seed | hidden | detectability | parameter | true | fitted | 95 % interval |",
        "| --- | ---: | --- | ---: | --- | ---: | ---: | --- |",
    ]
    for r in sorted(records, key=lambda r: (r["layout"] != "tilted", r["seed"])):
        if r["group"] != "one" or not r.get("choice_right"):
            continue
        for check in r["parameters"]:
            if not check["holds"]:
                low, high = ("infinite" if end is None else f"{end:.4g}" for end in check["interval"])
                value = "infinite" if check["value"] is None else f"{check['value']:.4g}"
                lines.append(
                    f"| {r['layout']} | {r['seed']} | {truth_of(r)} | {r['effects'][0]['detectability']:.1f} | "
                    f"{check['key']} | {check['true']:.4g} | {value} | {low} to {high} |"
                )
    return lines
