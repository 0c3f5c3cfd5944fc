"""Figures of `benchmarks.portrait`, each against its bar."""

import math
from collections.abc import Sequence
from statistics import fmean, median

from benchmarks.bars import Figure, Record, mean, middle_of, share
from benchmarks.pages import table

LARGEST_SET = {"links": 4, "variables": 3}  # a longer list says that it cannot tell
SEEN = ("unexplained", "described")
RATIOS = ((1.3, 0.75), (1.5, 0.90))  # held-out error over the noise floor, and the share of cases that must keep to it


def right_set(record: Record, name: str) -> bool:
    """Whether an acceptable word is in the portrait's set, and the set is short enough to say something."""
    found = (record["portrait"] or {}).get(name, {})
    return 0 < len(found) <= LARGEST_SET[name] and not set(found).isdisjoint(record["effects"][0].get(name, found))


def first_right(record: Record, name: str) -> bool:
    """Whether the likeliest word is an acceptable one."""
    found = (record["portrait"] or {}).get(name, {})
    return bool(found) and max(found, key=lambda word: found[word]) in record["effects"][0].get(name, found)


def ratio(record: Record) -> float:
    """Error of the description at left-out points over what noise alone leaves there; infinite without one."""
    portrait = record["portrait"]
    if not portrait or portrait["held_out_rms_percent"] is None or not portrait["noise_floor_percent"]:
        return math.inf
    return float(portrait["held_out_rms_percent"] / portrait["noise_floor_percent"])


def named_by_catalogue(record: Record) -> bool:
    """`identified`: a name of the catalogue for what no effect of it describes."""
    return bool(record["verdict"] == "identified")


def told_beside(record: Record, name: str) -> bool:
    """Whether what looks the same as the name of the catalogue holds an acceptable word."""
    return bool(record.get("same")) and not set(record["same"][name]).isdisjoint(record["effects"][0].get(name, ()))


def figures(records: Sequence[Record]) -> list[Figure]:
    """Every figure, by layout."""
    made: list[Figure] = []
    for layout in ("tilted", "paper"):
        unknown, sound = (
            [r for r in records if r["layout"] == layout and (r["hidden"] == "none") == none] for none in (False, True)
        )
        made += _of_unknowns(layout, unknown) if unknown else []
        made += _of_sound(layout, sound) if sound else []
    return made


def _of_unknowns(layout: str, records: Sequence[Record]) -> list[Figure]:
    barred = layout == "tilted"
    drawn = [r for r in records if r["portrait"]]
    named = [r for r in records if named_by_catalogue(r)]
    ratios = [ratio(r) for r in drawn]

    def of(what: str, hits: Sequence[bool], at_least: float | None = None) -> Figure:
        return share(layout, what, hits, at_least=at_least)

    made = [
        of("unknown: `unexplained` or `described`", [r["verdict"] in SEEN for r in records], 0.92 if barred else 0.70),
        of("the same, or a portrait of what a name of the catalogue leaves",
           [r["verdict"] in SEEN or bool(r["portrait"]) for r in records]),
        of("unknown: `identified`, a name of the catalogue", [named_by_catalogue(r) for r in records]),
        of("`identified`: something is said to look the same", [bool(r.get("same")) for r in named]),
        *(of(f"`identified`: {name}, what looks the same holds the truth", [told_beside(r, name) for r in named])
          for name in LARGEST_SET),
        of("unknown: has a portrait", [bool(r["portrait"]) for r in records]),
    ]  # fmt: skip
    for name in LARGEST_SET:
        truth = f"portrait: {name}, the set holds the truth"
        made += [
            of(truth, [right_set(r, name) for r in drawn], 0.85 if barred else None),
            of(f"portrait: {name}, the likeliest is right", [first_right(r, name) for r in drawn]),
            mean(layout, f"portrait: {name}, mean size of the set", [float(len(r["portrait"][name])) for r in drawn]),
            of(f"unknown: {name} right, cases without a portrait counted as wrong",
               [right_set(r, name) for r in records]),
        ]  # fmt: skip
    for most, at_least in RATIOS:
        what = f"portrait: held-out error at most {most:g} of the noise floor"
        made.append(of(what, [r <= most for r in ratios], at_least if barred else None))
    finite, times = [r for r in ratios if math.isfinite(r)], [r["cpu"] for r in records]
    made.append(middle_of(layout, "portrait: held-out error over the noise floor, median", finite))
    return [*made, middle_of(layout, "CPU of `diagnose` with the portrait, median", times, None, " s")]


def _of_sound(layout: str, records: Sequence[Record]) -> list[Figure]:
    return [
        share(layout, "sound machine: a portrait all the same", [bool(r["portrait"]) for r in records],
              at_most=0.03 if layout == "tilted" else None),
        share(layout, "sound machine: anything but `adequate`", [r["verdict"] != "adequate" for r in records]),
        middle_of(layout, "CPU of `diagnose`, sound machine, median", [r["cpu"] for r in records], None, " s"),
    ]  # fmt: skip


def kinds_table(records: Sequence[Record], layout: str) -> list[str]:
    """How each kind fares."""
    rows = []
    mine = [r for r in records if r["layout"] == layout and r["hidden"] != "none"]
    for kind in dict.fromkeys(r["hidden"] for r in mine):
        cases = [r for r in mine if r["hidden"] == kind]
        drawn = [r for r in cases if r["portrait"]]
        cells = [len(cases), sum(r["verdict"] in SEEN for r in cases), sum(map(named_by_catalogue, cases)), len(drawn)]
        for name in LARGEST_SET:
            size = f"{fmean(len(r['portrait'][name]) for r in drawn):.1f}" if drawn else ""
            cells += [sum(right_set(r, name) for r in drawn), size]
        rows.append((kind, *cells, f"{median(map(ratio, drawn)):.2f}" if drawn else ""))
    return table(
        "unknown | cases: | unexplained or described: | identified: | portrait: | link right: | of how many: | "
        "variable right: | of how many: | held-out over floor:",
        rows,
    )


def failures_table(records: Sequence[Record]) -> list[str]:
    """Every case that counts against a bar: what it is and what was said of it."""
    rows = []
    for r in records:
        portrait = r["portrait"] or {"links": {}, "variables": {}, "terms": []}
        if r["hidden"] == "none":
            what = ["a description of a sound machine"] if r["portrait"] else []
            size = 0.0
        else:
            what = [] if r["verdict"] in SEEN else [f"not seen: {', '.join(r['plausible'])}"]
            if r["portrait"]:
                what += [f"{name} wrong" for name in LARGEST_SET if not right_set(r, name)]
                what += [f"held-out {ratio(r):.2f} of the floor"] if ratio(r) > RATIOS[0][0] else []
            size = 100.0 * r["effects"][0]["size"]
        if what:
            words = (", ".join(f"{w} {100 * p:.0f} %" for w, p in portrait[name].items()) for name in LARGEST_SET)
            rows.append((
                r["layout"], r["seed"], r["hidden"], f"{size:.1f}", r["verdict"], "; ".join(what), *words,
                "; ".join(portrait["terms"]),
            ))  # fmt: skip
    return table("layout | seed: | unknown | size, %: | verdict | what | links | variables | terms", rows)
