"""Tables of the diagnosis benchmark beside its bars, and every case that failed."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from benchmarks.bars import Record, holds_truth, misnamed, named, truth_of, wilson
from benchmarks.pages import table

VERDICTS = ("adequate", "identified", "described", "ambiguous", "unexplained")
PROBABILITIES = (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98, 1.0 + 1e-9)


def verdicts_table(records: Sequence[Record]) -> list[str]:
    """Verdicts by what was hidden."""
    rows = []
    for layout in ("tilted", "paper"):
        for group in ("none", "one", "outside"):
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
            low, high = (f"{100 * end:.0f}" for end in wilson(int(hits), len(inside)))
            share_true = f"{100 * hits / len(inside):.1f} % ({low} to {high} %)"
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
