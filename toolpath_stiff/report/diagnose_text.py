"""What `tps diagnose` prints: the verdict, why, the best candidates, what to do next; at most 100 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from toolpath_stiff.hints import parted
from toolpath_stiff.report.diagnose_words import (
    best_explanation,
    entries,
    explanations,
    figure_of,
    floor_text,
    hidden_name,
    is_offered,
    is_plausible,
    missing_text,
    model_rows,
    name_text,
    parameter_texts,
    path_text,
    percent,
    plausible_text,
    probability_text,
    row_name,
    size_text,
)
from toolpath_stiff.report.wording import machine_text, plain, shortened

WIDTH = 100
LABEL = 12  # columns of the left-hand words
FEW_REASONS = 3  # of the poses proposed, on the terminal
MOST_CANDIDATES = 5  # in the table; all are in diagnose.json
MOST_PAIRS = 2
MOST_SIZES = 6
LONGEST_NAME = 45


def terminal_text(document: Mapping[str, Any]) -> str:
    """The diagnosis in some 25 lines.

    Parameters
    ----------
    document
        As in `diagnose.json`.
    """
    verdict = str(document.get("verdict") or "-")
    lines = [
        *_entry("data", _data(document)),
        *_entry("verdict", f"{verdict.upper()}. {document.get('text') or ''}"),
        *_listed("why", entries(document, "why")),
        *_entry("error", _error(document)),
        "",
        *_table(document),
        "",
        *_entry("plausible", plausible_text(explanations(document))),
        *_by_noise(document),
        *_listed("cannot test", ["; ".join(missing_text(e) for e in entries(document, "cannot_test"))]),
        *_listed("would show", [_detectable(document)]),
        *_listed("path", [path_text(document)]),
        *_hints("next", [*entries(document, "next"), *_next_readings(document)]),
        *_entry("assumptions", f"{len(entries(document, 'assumptions'))}, listed in diagnose.json"),
        *_listed("warning", entries(document, "warnings")),
    ]
    return "\n".join(lines)


def _entry(label: str, text: str) -> list[str]:
    return textwrap.wrap(
        plain(text),
        WIDTH,
        initial_indent=f"{label:<{LABEL}}  ",
        subsequent_indent=" " * (LABEL + 2),
        break_on_hyphens=False,
    )


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


def _data(document: Mapping[str, Any]) -> str:
    files = ", ".join(str(name) for name in entries(document, "data")) or "-"
    readings = figure_of(document, "readings")
    count = f"{readings:.0f} readings of " if readings is not None else ""
    return f"{count}{files}, machine {machine_text(document)}"


def _error(document: Mapping[str, Any]) -> str:
    """The fall of the error in one sentence: in sample, at left-out points, against the noise floor."""
    base = document.get("baseline") or {}
    parts = []
    as_given = figure_of(base.get("as_given"), "mean_abs_error_percent")
    if as_given is not None:
        parts.append(f"{percent(as_given, 2)} as given")
    parts.append(_pair_of_errors(base) + " with the strut law refitted")
    best = best_explanation(document)
    if best is not None and document.get("verdict") != "adequate":
        parts.append(_pair_of_errors(best) + f" with {name_text(best)}")
    return "mean " + ", ".join(parts) + f"; scatter alone leaves {floor_text(document)}"


def _pair_of_errors(entry: Mapping[str, Any]) -> str:
    inside, outside = (figure_of(entry, f"{key}_error_percent") for key in ("mean_abs", "held_out"))
    return f"{percent(inside, 2)} ({percent(outside, 2)} at points left out)"


def _table(document: Mapping[str, Any]) -> list[str]:
    """As given, strut law refitted, pairs and the best candidates; an asterisk marks what is left standing."""
    models = model_rows(document)
    candidates, pairs = entries(document, "candidates"), entries(document, "pairs")
    shown = [*models, *pairs[:MOST_PAIRS], *candidates[:MOST_CANDIDATES]]
    shown += [entry for entry in candidates[MOST_CANDIDATES:] if is_plausible(entry, document)]
    rows = [["", "probab.", "error %", "left out %", "gain/SE", "", ""]]
    for entry in shown:
        mark = "* " if is_plausible(entry, document) else "  "
        figures = [figure_of(entry, f"{key}_error_percent") for key in ("mean_abs", "held_out")]
        gain = figure_of(entry, "held_out_gain_in_se")
        remark = str(entry.get("remark") or "") or ("" if is_offered(entry, document) else "not offered")
        rows.append(
            [
                shortened(mark + row_name(entry), LONGEST_NAME),
                probability_text(figure_of(entry, "probability")),
                *("-" if value is None else f"{value:.2f}" for value in figures),
                "-" if gain is None else f"{gain:.1f}",
                plain(str(entry.get("words") or "")),
                "; ".join(part for part in (", ".join(parameter_texts(entry, intervals=False)), plain(remark)) if part),
            ]
        )
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    lines = []
    for row in rows:
        figures_text = "  ".join(f"{cell:>{width}}" for cell, width in zip(row[1:5], widths[1:], strict=True))
        left = f"{row[0]:<{widths[0]}}  {figures_text}  "
        lines.append((left + shortened(row[5], WIDTH - len(left))).rstrip())
        if row[6]:
            lines.append(shortened("      " + row[6], WIDTH))
    more = len(candidates) + len(pairs) + len(models) - len(shown)
    if more > 0:
        lines.append(f"  and {more} less likely, in diagnose.json")
    return lines


def _by_noise(document: Mapping[str, Any]) -> list[str]:
    """Verdicts under each guess of the noise, where there are several."""
    found = document.get("by_noise") or {}
    if len(found) < 2:
        return []
    parts = [
        f"{name} ({percent(figure_of(one, 'noise_percent'))}): {one.get('verdict', '-')}"
        f" ({plausible_text(one.get('plausible') or [])})"
        for name, one in found.items()
    ]
    return _entry("noise", "; ".join(parts))


def _detectable(document: Mapping[str, Any]) -> str:
    """Of an adequate model: the smallest sizes that these data would have shown, and what they never show."""
    if document.get("verdict") != "adequate":
        return ""
    found = entries(document, "detectable")
    never = [hidden_name(e) for e in found if e.get("detectable") is False]
    seen = [e for e in found if e.get("detectable") is not False and figure_of(e, "size") is not None]
    parts = [f"{hidden_name(e)} {size_text(e)}" for e in seen[:MOST_SIZES]]
    text = ", ".join(parts) + (f" and {len(seen) - MOST_SIZES} more in diagnose.json" if len(seen) > MOST_SIZES else "")
    return "; ".join(part for part in (text, f"at no size: {', '.join(never)}" if never else "") if part)


def _next_readings(document: Mapping[str, Any]) -> list[str]:
    """How many readings are proposed, and what they would settle."""
    readings = [e for e in entries(document, "next_measurements") if isinstance(e, Mapping)]
    if not readings:
        return []
    reasons = list(dict.fromkeys(str(e["why"]) for e in readings if e.get("why")))
    more = len(reasons) - FEW_REASONS
    said = "; ".join([*reasons[:FEW_REASONS], *([f"{more} more in the file"] if more > 0 else [])])
    return [f"{len(readings)} readings are proposed in diagnose.json" + (f": {said}" if said else "")]
