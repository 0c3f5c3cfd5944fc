"""`python -m benchmarks.built`: names, updates and bands on machines built of finite elements, and of springs.

Small campaigns: 12 to 28 tilted poses along X, Y, Z, one or two loads, 2 % repeat noise, 1 % clamping (of machines of
elements otherwise in each direction). Sizes are drawn: 4 to 20 % rms of elements, from just detectable to 30 % of
springs; pairs 10 and 5 %. A verdict's first explanation is added, or a draft; where that is refused, what `--auto`
finds. `believed`: the same with `--believe machine`, for faults of the machine. Errors are means along 24 poses amid
those measured, X, Y, Z, against the true stiffness; 12 more lie beyond. A pose that a machine as written does not reach
is left out of both errors, and counted. Of `known` cases, half of them sound, nothing is to be found: the effect is
added by its name, to judge the bands alone. All machines weigh alike in the shares that bands hold; that of the weakest
place is the interval of the lowest stiffness along the path, of each axis, wherever it lies. A `draft` is made
of every other clamping of a tilted campaign and put to all readings, and to those of the same machine without what it
was read off (`gone`).
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from statistics import fmean, median, pstdev

from benchmarks.bars import Figure, Record, middle_of, share
from benchmarks.built_cases import BUILT, GROUPS, JUDGED, SERIES, diagnosed, links_of_effects, make_jobs
from benchmarks.case_loop import document, run_benchmark, sound
from benchmarks.pages import table

FIRST_SEED = 91_000_000
SMALL, RISE = 3.0, 0.3  # % left that `adequate` may leave; points by which an update may raise an error
ABOVE_FLOOR = 1.2  # of the median error of sound machines as they are: what scatter of their parts leaves
COUNTS = {"sound": 50, "single": 70, "pair": 30, "outside": 70, "known": 60, "draft": 16}


def fits(effect: str, record: Record) -> bool:
    """Whether an effect's name or its link is right of something that is hidden."""
    link = links_of_effects().get(effect, "")
    same = SERIES if link in SERIES else {link}
    return any(effect in truth["names"] or same & set(truth["links"]) for truth in record["truths"])


def wrong_link(record: Record) -> bool:
    """Identified with an effect that is in none of the links of what is hidden."""
    return record["verdict"] == "identified" and not all(fits(name, record) for name in record["explanations"][0])


def holds(names: Sequence[str], record: Record) -> bool:
    """Whether names hold a right one of everything that is hidden."""
    return all(set(truth["names"]) & set(names) for truth in record["truths"])


def named(record: Record) -> bool:
    """Identified, with a right name of everything that is hidden and no other."""
    if record["verdict"] != "identified":
        return False
    first = record["explanations"][0]
    return holds(first, record) and all(any(name in truth["names"] for truth in record["truths"]) for name in first)


def listed(record: Record) -> bool:
    """`ambiguous` with the truth among at most three entries: what is alike at one place is one."""
    few = record["verdict"] == "ambiguous" and record["entries"] <= 3
    return few and any(holds(names, record) for names in record["explanations"])


def negligible(record: Record) -> bool:
    """`adequate`, and it is: no more than 3 % along the path."""
    return record["verdict"] == "adequate" and record["after"] <= SMALL


def called_ill(record: Record) -> bool:
    """A verdict that something is missing: `none` is not among the explanations."""
    return record["verdict"] != "adequate" and ["none"] not in record["explanations"]


def right_portrait(record: Record) -> bool:
    """A link of the portrait is one of those of what is hidden."""
    links = set(record["portrait"])
    links |= SERIES if links & SERIES else set()
    return any(links & set(truth["links"]) for truth in record["truths"])


def figures_of(built: str, records: Sequence[Record]) -> list[Figure]:
    """The figures of one build, each beside its bar."""
    sound_ones, single, pair, outside, known, drafts = ([r for r in records if r["group"] == group] for group in GROUPS)
    hidden, seen = [*single, *pair, *outside], [r for r in single if not negligible(r)]
    judged = [*sound_ones, *hidden]
    unexplained = [r for r in outside if r["verdict"] == "unexplained"]
    planned = [r | r.get("planned", {}) for r in seen]
    shares: list[tuple[str, Sequence[Record], Callable[[Record], bool], float | None, float | None]] = [
        ("identified with a wrong link", hidden, wrong_link, None, 0.02),
        ("single: right, or ambiguous with the truth among three", seen, lambda r: named(r) or listed(r), 0.90, None),
        ("single: identified right at once", seen, named, 0.50, None),
        ("single: identified right after a plan", planned, named, 0.70, None),
        ("single: wrong link after a plan", planned, wrong_link, None, None),
        ("pair: right, or ambiguous with the truth among three", pair, lambda r: named(r) or listed(r), 0.85, None),
        ("outside: identified as another link", outside, wrong_link, None, 0.03),
        ("outside, unexplained: right link in the portrait", unexplained, right_portrait, 0.75, None),
        ("`adequate` with more than 3 % left", hidden,
         lambda r: r["verdict"] == "adequate" and not negligible(r), None, 0.0),
        ("draft: one is made", drafts, lambda r: bool(r["drafted"]), None, None),
        ("draft: named by new readings", [r for r in drafts if r["drafted"]], lambda r: r["same"], None, None),
        ("draft: named though gone", [r for r in drafts if r["drafted"]], lambda r: r["gone"], None, 0.05),
        ("sound: called ill", sound_ones, called_ill, None, 0.02),
        ("sound: anything but `adequate`", sound_ones, lambda r: r["verdict"] != "adequate", None, None),
        ("sound: rows left out", sound_ones, lambda r: r["left_out"] > 0, None, 0.0),
        ("ill: rows left out", hidden, lambda r: r["left_out"] > 0, None, 0.02),
        ("error along the path rises by more than 0.3 points", judged,
         lambda r: r["after"] > r["before"] + RISE, None, 0.0),
        ("the same after a plan", planned, lambda r: r["after"] > r["before"] + RISE, None, 0.0),
        ("a machine was written that does not reach the whole path", [r for r in judged if r["updated"]],
         lambda r: r.get("unreached", 0) > 0, None, None),
    ]  # fmt: skip
    made = [share(built, what, [rule(r) for r in some], least, most) for what, some, rule, least, most in shares]
    floor = round(ABOVE_FLOOR * median(r["before"] for r in sound_ones), 2) if sound_ones else None
    after_plan = [r | r.get("planned", {}) for r in hidden]
    believed = [r for r in hidden if "believed" in r]
    errors = (
        ("before", "before", hidden, None),
        ("where a machine was written, before", "before", [r for r in hidden if r["updated"]], None),
        ("where a machine was written, after", "after", [r for r in hidden if r["updated"]], floor),
        ("all, after", "after", hidden, None),
        ("all of the machine, before", "before", believed, None),
        ("all of the machine, after", "after", believed, None),
        ("all of the machine, after, believed", "believed", believed, None),
        ("all, after, with a plan where a single effect is ambiguous", "after", after_plan, None),
    )
    medians = [
        middle_of(built, f"error along the path, {what}, median", [r[key] for r in some], most, " %")
        for what, key, some, most in errors
    ]
    bands = (
        ("along the path, 95 %", "band_near", 0.93, 0.97),
        ("weakest place, 95 %", "band_weakest", 0.93, 0.97),
        ("beyond, 90 %", "band_beyond", 0.85, 1.0),
    )
    for of, some in (("bands hold", judged), ("known: bands hold", known)):
        for what, key, low, high in bands:
            if held := [r[key] for r in some if r.get(key) is not None]:
                value, ends = fmean(held), f"{100 * low:g} to {100 * high:g} %"
                words = f"{100 * value:.1f} % of {len(held)} machines"
                reach = 1.96 * pstdev(held) / len(held) ** 0.5  # machine by machine: places of one err together
                between = f"{100 * (value - reach):.1f} to {min(100 * (value + reach), 100):.1f} %"
                made.append(Figure(built, f"{of} {what}", words, between, ends, low <= value <= high))
    cpu = middle_of(built, "CPU of `diagnose`, median", [r["cpu"] for r in judged], None, " s")
    return [figure for figure in (*made, *medians, cpu) if figure.value != "no cases"]


def cases_table(records: Sequence[Record]) -> list[str]:
    """Each case."""
    rows = []
    for r in records:
        sizes = ", ".join(f"{100 * truth['size']:.0f}" for truth in r["truths"])
        marks = ["wrong link"] * wrong_link(r) + ["right"] * named(r) + ["listed"] * listed(r)
        said = "; ".join(" + ".join(names) for names in r["explanations"][:3]) or ", ".join(r["portrait"])
        rows.append((r["built"], r["group"], r["seed"], r["hidden"], sizes, r["readings"], r["verdict"], said,
                     ", ".join(marks), f"{r['before']:.1f}", f"{r['after']:.1f}"))  # fmt: skip
    return table("built | group | seed: | hidden | size, %: | readings: | verdict | said | | before: | after:", rows)


def report(records: Sequence[Record], command: str) -> tuple[str, bool]:
    """The document, and whether all bars are cleared."""
    good = sound(records, lambda r: (r["built"], GROUPS.index(r["group"]), r["seed"]))
    figures = [figure for way in BUILT for figure in figures_of(way, [r for r in good if r["built"] == way])]
    judged = [r for r in good if r["group"] in JUDGED]
    counts = Counter((r["built"], r["group"], r["verdict"]) for r in judged)
    verdicts = [f"- {built}, {group}, `{verdict}`: {n}" for (built, group, verdict), n in sorted(counts.items())]
    parts = [("Verdicts", verdicts), ("Cases", judged and cases_table(judged))]
    return document("Machines built otherwise", __doc__, figures, parts, records, command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and print; exit code 1 if a bar is not cleared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.built", description=__doc__)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default: {FIRST_SEED}")
    parser.add_argument("--built", nargs="+", choices=BUILT, default=BUILT, help="default: both")
    for group, count in COUNTS.items():
        parser.add_argument(f"--{group}", type=int, default=count, help=f"cases of each build (default: {count})")
    return run_benchmark(
        parser, arguments, lambda args: make_jobs(args.first_seed, vars(args), args.built), diagnosed, report
    )


if __name__ == "__main__":
    sys.exit(main())
