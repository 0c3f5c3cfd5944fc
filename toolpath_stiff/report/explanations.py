"""The words and figures of a diagnosis, the same on the terminal, in the pictures and on the page.

Everything here takes entries of `diagnose.json`; whatever is absent or None is shown as "-" or left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from toolpath_stiff.documents import Document
from toolpath_stiff.hints import parted
from toolpath_stiff.inference.candidates import choice_text
from toolpath_stiff.inference.errors import scatter_text
from toolpath_stiff.inference.noise import GUESSES
from toolpath_stiff.report.words import WIDTH, counted, labelled, machine_text, plain, shortened
from toolpath_stiff.units import number

NONE = "none"
LEAST = 0.005  # probability from which a row is more than "< 0.5 %"
SETTLED = ("does not fit", "ruled out")

AS_GIVEN = "as given"

HEADLINES = {
    "adequate": "Nothing is missing that these data could show",
    "identified": "One explanation is far likelier than any other",
    "described": "One description fits, read off these very readings: new ones must confirm it",
    "ambiguous": "These data cannot tell several explanations apart",
    "unexplained": "Something is missing, and nothing in the catalogue accounts for it",
}


def figure_of(entry: Document | None, name: str) -> float | None:
    """A finite number of an entry, or None."""
    value = (entry or {}).get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)


def significant(value: float | None, digits: int = 3) -> str:
    """Three significant digits, in thousands as usual, with an exponent where there would be rows of zeros."""
    if value is None or not math.isfinite(value):
        return "-"
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 < size < 5:
        return f"{float(f'{value:.{digits - 1}e}'):.{max(digits - 1 - size, 0)}f}"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def percent(value: float | None, digits: int = 1) -> str:
    """A figure that is in per cent already."""
    return "-" if value is None else f"{value:.{digits}f} %"


def probability_text(value: float | None) -> str:
    """A probability from 0 to 1 as per cent; what rounds to 0 or 100 without being it says so."""
    if value is None:
        return "-"
    if 0.0 < value < 0.005:
        return "< 0.5 %"
    if 0.995 < value < 1.0:
        return "> 99.5 %"
    return f"{100.0 * value:.0f} %"


def effect_names(entry: Document) -> list[str]:
    """Effects of a candidate (`effect`) or a pair (`effects`)."""
    return [plain(name) for name in entry.get("effects") or [entry["effect"]]]


def name_text(entry: Document) -> str:
    """Name with what it acts on: "weak_strut (strut 3)"; a pair as "a + b"."""
    parts = []
    for name in effect_names(entry):
        inner = (entry.get("parameters") or {}).get(name)  # of a pair: sizes and choices together
        own: Document = inner if isinstance(inner, Mapping) else entry.get("choice") or {}
        acts_on = [choice_text(key, value) for key, value in own.items() if _says_something(value)]
        parts.append(plain(f"{name} ({', '.join(acts_on)})") if acts_on else name)
    return " + ".join(parts)


def _says_something(value: object) -> bool:
    return value not in ("", 0, None) and not isinstance(value, Mapping)


def parameter_texts(entry: Document, intervals: bool = True) -> list[str]:
    """Each fitted size in words: "radial 5.12 nm/N (4.40 to 5.90)"; those of a pair one effect after the other."""
    parameters = entry.get("parameters") or {}
    texts = []
    for key, value in parameters.items():
        if isinstance(value, Mapping) and "value" not in value:  # a pair: effect -> its parameters
            texts += [f"{key} {text}" for text in parameter_texts({"parameters": value}, intervals)]
        elif isinstance(value, Mapping):
            texts.append(_parameter_text(str(key), value, intervals))
    return texts


def _parameter_text(key: str, value: Document, intervals: bool) -> str:
    unit = str(value.get("unit") or "")
    name = parameter_name(key, unit)
    size = value.get("value")
    # JSON holds no infinity; a stiffness without end is null there.
    text = f"{name} {significant(size) if isinstance(size, int | float) else '-'} {unit}".rstrip()
    interval = value.get("interval")
    if intervals and isinstance(interval, list | tuple) and len(interval) == 2:
        low, high = (significant(end) if isinstance(end, int | float) else "no limit" for end in interval)
        text += f" ({low} to {high})"
    return plain(text)


def parameter_name(key: str, unit: str) -> str:
    """The name in a machine file's key, `bar_stiffness_N_per_m`, without the unit and its underscores."""
    tail = unit.replace("/", "_per_").replace(" ", "_").replace("%", "percent")
    return (key.removesuffix(f"_{tail}") if tail else key).replace("_", " ")


def explanations(document: Document) -> list[str]:
    """What is left standing: effects, `none`, pairs as "a + b"."""
    return [plain(name) for name in document["explanations"]]


def is_plausible(entry: Document, document: Document) -> bool:
    """Whether it is one of the explanations left standing; a member of a pair alone is not."""
    return " + ".join(effect_names(entry)) in explanations(document)


def is_offered(entry: Document, document: Document) -> bool:
    """False only where the diagnosis says so and does not rely on it all the same."""
    return entry.get("eligible") is not False or is_plausible(entry, document)


def model_rows(document: Document) -> list[dict[str, Any]]:
    """The machine file as given, then with its strut law refitted: the first rows of every table and ladder."""
    base = document["baseline"]
    first = {**base["as_given"], "effect": AS_GIVEN, "title": "the machine file as it stands"}
    return [first, {**base, "effect": NONE, "title": "no further effect"}]


def row_name(entry: Document) -> str:
    """Name of a row: "as given", "strut law refitted (none)", or the effects with what they act on."""
    return "strut law refitted (none)" if entry.get("effect") == NONE else name_text(entry)


def best_explanation(document: Document) -> Document | None:
    """The entry that `best` names; else the likeliest candidate or pair that is offered, the first of equals."""
    found = [*document["candidates"], *document["pairs"]]
    for entry in found:
        if " + ".join(effect_names(entry)) == document["best"]:
            return dict(entry)
    offered = [entry for entry in found if is_offered(entry, document)]
    return max(offered, key=lambda e: figure_of(e, "probability") or 0.0, default=None)


def remark_text(entry: Document) -> str:
    """How it stands, and what is against it."""
    own = str(entry.get("remark") or "")
    said = str(entry.get("words") or "")
    if entry.get("eligible") is False and (figure_of(entry, "probability") or 0.0) < LEAST:
        return plain(own or "not offered")
    settled = entry.get("adequate") is False and said not in SETTLED
    return plain("; ".join(part for part in (said, own or ("leaves structure" if settled else "")) if part))


def noise_floor_percent(document: Document) -> float | None:
    """Mean absolute error that scatter alone would leave."""
    floor: float | None = document["baseline"]["noise_floor_percent"]
    return floor


def missing_text(entry: Document) -> str:
    """An effect that cannot be tested and why: "thermal_drift (no time_min)"."""
    columns = ", ".join(entry["missing"])
    return plain(f"{entry['effect']} ({f'no {columns}' if columns else 'nothing in these data depends on it'})")


def size_text(entry: Document) -> str:
    """The smallest size of an effect that would have been seen."""
    return plain(f"{significant(entry['size'])} {entry['unit']}".rstrip())


def hidden_name(entry: Document) -> str:
    """Effect and parameter of an entry of `detectable`."""
    return plain(f"{entry['effect']} {entry['parameter'].replace('_', ' ')}".rstrip())


def floor_text(document: Document) -> str:
    """The noise floor in words; a guess says so."""
    guess = _guess(document)
    return percent(noise_floor_percent(document), 2) + (f" ({guess} guess)" if guess else "")


def _guess(document: Document) -> str:
    """Which guess the noise is, "low" or "high"; "" where it is none."""
    name = str(document["noise"]["name"])
    return name if name in GUESSES else ""


def headline(document: Document) -> str:
    """The verdict as one sentence: the cause where one was found."""
    if document["question"]:
        return plain(document["question"])
    verdict = document["verdict"]
    cause = str((best_explanation(document) or {}).get("finding") or "")
    if cause and verdict in ("identified", "described"):
        said = " (described, not confirmed)" if verdict == "described" else ""
        return plain(cause[0].upper() + cause[1:] + said)
    standing = explanations(document)
    if verdict == "ambiguous" and len(standing) == 1:
        return plain(f"{standing[0]} is likeliest, but something else is not ruled out")
    if verdict == "ambiguous" and len({judged["verdict"] for judged in document["by_noise"].values()}) > 1:
        return "It depends on how much the readings scatter, which these data do not tell"
    return HEADLINES[verdict]


def path_text(document: Document) -> str:
    """How far apart the plausible explanations are on a tool path, in one sentence; "" where it was not tried."""
    path = document["path"] or {}
    program = plain(str(path.get("program") or "the program"))
    program += plain(f" in set-up {path['setup']}") if path.get("setup") else ""
    if path.get("reason"):
        return plain(f"not tried on {program}: {path['reason']}")
    means = {name: figure_of(one, "mean_N_per_mm") for name, one in (path.get("explanations") or {}).items()}
    known = sorted((mean, name) for name, mean in means.items() if mean is not None)
    if len(known) < 2:
        return ""
    (low, softest), (high, stiffest) = known[0], known[-1]
    apart = figure_of(path, "mean_spread_percent")
    text = f"mean stiffness from {number(low)} ({softest}) to {number(high)} N/mm ({stiffest}) on {program}"
    return plain(text + (f": {percent(apart)} apart" if apart is not None else ""))


def plausible_text(names: Sequence[str]) -> str:
    """The plausible set in words."""
    if not names:
        return "no effect of the catalogue"
    return ", ".join("none (nothing is missing)" if name == NONE else plain(str(name)) for name in names)


LABEL = 12  # columns of the left-hand words
FEW_REASONS = 3  # of the poses proposed, on the terminal
MOST_CANDIDATES = 5  # in the table; all are in diagnose.json
MOST_PAIRS = 2
MOST_SIZES = 6
LONGEST_NAME = 45


def text(document: Document) -> str:
    """The diagnosis in some 25 lines.

    Parameters
    ----------
    document
        As in `diagnose.json`.
    """
    portrait = document["portrait"]
    lines = [
        *_entry("data", _data(document)),
        *_entry("verdict", f"{document['verdict'].upper()}. {document['text']}"),
        *_listed("why", document["why"]),
        *_listed("portrait", [portrait["text"]] if portrait else []),
        *_entry("error", _error(document)),
        "",
        *_table(document),
        "",
        *_entry("plausible", plausible_text(explanations(document))),
        *_listed("beside it", [document["not_excluded_text"]]),
        *_by_noise(document),
        *_listed("beside the tip", [loop["text"] for loop in document["loops"]["by_loop"]]),
        *_listed("cannot test", ["; ".join(missing_text(e) for e in document["cannot_test"])]),
        *_listed("would show", [_detectable(document)]),
        *_listed("path", [path_text(document)]),
        *_hints("next", [*document["next"], *_next_readings(document)]),
        *_entry("assumptions", f"{len(document['assumptions'])}, listed in diagnose.json"),
        *_listed("warning", document["warnings"]),
    ]
    return "\n".join(lines)


def _entry(label: str, text: str) -> list[str]:
    return labelled(label, text, LABEL)


def _listed(label: str, sentences: Sequence[object]) -> list[str]:
    """One entry a sentence, the label before the first."""
    said = [str(sentence) for sentence in sentences if sentence]
    return [line for place, text in enumerate(said) for line in _entry("" if place else label, text)]


def _hints(label: str, hints: Sequence[object]) -> list[str]:
    """As `_listed`; a command stands on a line of its own, never wrapped, so that it can be pasted."""
    lines: list[str] = []
    for text in filter(None, map(str, hints)):
        sentence, line = parted(text)
        lines += _entry("" if lines else label, sentence)
        lines += [" " * (LABEL + 2) + plain(line)] if line else []
    return lines


def _data(document: Document) -> str:
    return (
        f"{counted(document['readings'], 'reading')} of {', '.join(document['data'])}, machine {machine_text(document)}"
    )


def _error(document: Document) -> str:
    """The fall of the error in one sentence: in sample, at left-out points, against the noise floor."""
    base = document["baseline"]
    as_given = percent(base["as_given"]["mean_abs_error_percent"], 2)
    parts = [f"{as_given} as given", f"{_pair_of_errors(base)} with the strut law refitted"]
    best = best_explanation(document)
    if best is not None and document["verdict"] != "adequate":
        parts.append(_pair_of_errors(best) + f" with {name_text(best)}")
    floor, error = noise_floor_percent(document), figure_of(base, "mean_abs_error_percent")
    tail = "" if floor is None else f"; {scatter_text(floor, error or 0.0, _guess(document))}"
    return "mean " + ", ".join(parts) + tail


def _pair_of_errors(entry: Document) -> str:
    inside, outside = (figure_of(entry, f"{key}_error_percent") for key in ("mean_abs", "held_out"))
    return f"{percent(inside, 2)} ({percent(outside, 2)} at points left out)"


def _table(document: Document) -> list[str]:
    """As given, strut law refitted, pairs and the best candidates; an asterisk marks what is left standing."""
    models = model_rows(document)
    candidates, pairs = document["candidates"], document["pairs"]
    shown = [*models, *pairs[:MOST_PAIRS], *candidates[:MOST_CANDIDATES]]
    shown += [entry for entry in candidates[MOST_CANDIDATES:] if is_plausible(entry, document)]
    rows = [["", "probab.", "error %", "left out %", "gain/SE", "", ""], *(_row(entry, document) for entry in shown)]
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    lines = [line for row in rows for line in _row_lines(row, widths)]
    more = len(candidates) + len(pairs) + len(models) - len(shown)
    return [*lines, f"  and {more} less likely, in diagnose.json"] if more > 0 else lines


def _row(entry: Document, document: Document) -> list[str]:
    """Name, four figures, words, and what stands on a line of its own below: sizes and a remark."""
    mark = "* " if is_plausible(entry, document) else "  "
    figures = [figure_of(entry, f"{key}_error_percent") for key in ("mean_abs", "held_out")]
    gain = figure_of(entry, "held_out_gain_in_se")
    remark = str(entry.get("remark") or "") or ("" if is_offered(entry, document) else "not offered")
    sizes = ", ".join(parameter_texts(entry, intervals=False))
    return [
        shortened(mark + row_name(entry), LONGEST_NAME),
        probability_text(figure_of(entry, "probability")),
        *("-" if value is None else f"{value:.2f}" for value in figures),
        "-" if gain is None else f"{gain:.1f}",
        plain(str(entry.get("words") or "")),
        "; ".join(part for part in (sizes, plain(remark)) if part),
    ]


def _row_lines(row: Sequence[str], widths: Sequence[int]) -> list[str]:
    figures = "  ".join(f"{cell:>{width}}" for cell, width in zip(row[1:5], widths[1:], strict=True))
    left = f"{row[0]:<{widths[0]}}  {figures}  "
    first = (left + shortened(row[5], WIDTH - len(left))).rstrip()
    return [first, shortened("      " + row[6], WIDTH)] if row[6] else [first]


def _by_noise(document: Document) -> list[str]:
    """Verdicts under each guess of the noise, where there are several."""
    if len(document["by_noise"]) < 2:
        return []
    parts = [
        f"{name} ({percent(judged['noise_percent'])}): {judged['verdict']} ({plausible_text(judged['plausible'])})"
        for name, judged in document["by_noise"].items()
    ]
    return _entry("noise", "; ".join(parts))


def _detectable(document: Document) -> str:
    """Of an adequate model: the smallest sizes that these data would have shown, and what they never show."""
    if document["verdict"] != "adequate":
        return ""
    never = [hidden_name(e) for e in document["detectable"] if not e["detectable"]]
    seen = [e for e in document["detectable"] if e["detectable"] and e["size"] is not None]
    parts = [f"{hidden_name(e)} {size_text(e)}" for e in seen[:MOST_SIZES]]
    text = ", ".join(parts) + (f" and {len(seen) - MOST_SIZES} more in diagnose.json" if len(seen) > MOST_SIZES else "")
    return "; ".join(part for part in (text, f"at no size: {', '.join(never)}" if never else "") if part)


def _next_readings(document: Document) -> list[str]:
    """How many readings are proposed, and what they would settle."""
    readings = document["next_measurements"]
    if not readings:
        return []
    reasons = list(dict.fromkeys(reading["why"] for reading in readings))
    more = len(reasons) - FEW_REASONS
    said = "; ".join([*reasons[:FEW_REASONS], *([f"{more} more in the file"] if more > 0 else [])])
    return [f"{counted(len(readings), 'reading')} proposed in diagnose.json: {said}"]
