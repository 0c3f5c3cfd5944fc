"""An update as a page: what was added, how the error fell, why something was turned down. No network.

Everything from a file is escaped, and a content security policy lets the page load nothing and run nothing.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from typing import Any

from toolpath_stiff.report.wording import number, plain

VERDICTS = {
    "updated": "The machine is updated",
    "refused": "Refused: the data do not bear it",
    "forced": "Added by force",
    "nothing added": "Nothing to add",
}
# Picture -> the question that it answers, and how it is read.
QUESTIONS = {
    "ladder.png": (
        "What does each step do to the error?",
        "The error at left-out points counts: in sample every effect makes it fall. Bars: standard error of the step. "
        "Below the noise floor lies only luck.",
    ),
    "before_after.png": (
        "Did the error fall, and what remains?",
        "Both halves on one colour scale. A pattern that remains is something else that the model lacks.",
    ),
    "figure3.png": (
        "How stiff must the platform be taken?",
        "The paper: above 1e10 N/m a stiffer platform changes nothing. With the strut law refitted for each, "
        "the curve is all but flat: these readings cannot tell a soft platform from soft struts.",
    ),
}


def update_html(document: Mapping[str, Any], pictures: Mapping[str, bytes | str]) -> str:
    """The page's text.

    Parameters
    ----------
    document
        Content of update.json.
    pictures
        File name -> PNG; they are put into the page.
    """
    files = ", ".join(document["data"])
    provenance = document["provenance"]
    record = [
        f"command: {provenance['command']}",
        f"SHA-256 of the data: {provenance['data_sha256']}",
        f"machine file: {document['machine_file'] or 'none written'}",
    ]
    sections = [
        *(_picture(name, pictures) for name in QUESTIONS if name in pictures),
        _section("Errors by direction", _by_direction(document)),
        _section("What was fitted", _fitted(document)),
        _section("Does the data bear it?", _support(document)),
        _section("Where it comes from", _bullets(record)),
        _section("Assumptions", _bullets([*document["assumptions"], *document["notes"]])),
    ]
    parts = {
        "title": _text(files),
        "verdict": _text(VERDICTS[document["verdict"]]),
        "headline": _text(_headline(document)),
        "text": _text(document["text"]),
        "about": _text(f"{document['readings']} readings   ·   {files}   ·   machine {document['machine']}"),
        "figures": _figures(document),
        "warnings": "\n".join(f'<p class="warning">{_text(warning)}</p>' for warning in document["warnings"]),
        "sections": "\n".join(section for section in sections if section),
        "footer": f"tps update, seed {document['seed']}",
    }
    template = resources.files("toolpath_stiff.report").joinpath("assets", "update.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)


def _headline(document: Mapping[str, Any]) -> str:
    first, last = document["steps"][0], document["steps"][-1]
    if len(document["steps"]) == 1:
        return f"{first['mean_abs_error_percent']:.2g} % mean error, and nothing to add"
    return f"Mean error {first['mean_abs_error_percent']:.3g} % before, {last['mean_abs_error_percent']:.3g} % after"


def _figures(document: Mapping[str, Any]) -> str:
    last = document["steps"][-1]
    found = [
        (_percent(document["steps"][0]["mean_abs_error_percent"]), "mean error as given"),
        (_percent(last["mean_abs_error_percent"]), "after"),
        (_percent(last["held_out_error_percent"]), "after, at left-out points"),
        (_percent(document["noise_floor_percent"]), "noise floor"),
    ]
    return "".join(f"<li><b>{_text(value)}</b><span>{_text(name)}</span></li>" for value, name in found)


def _by_direction(document: Mapping[str, Any]) -> str:
    first, last = document["steps"][0]["by_direction"], document["steps"][-1]["by_direction"]
    rows = [
        (
            name,
            str(before["readings"]),
            _percent(before["mean_abs_error_percent"]),
            _percent(last[name]["mean_abs_error_percent"]),
            _percent(last[name]["held_out_error_percent"]),
            f"{before['bias_percent']:+.1f} %",
            f"{last[name]['bias_percent']:+.1f} %",
        )
        for name, before in first.items()
    ]
    head = ("direction", "readings", "before", "after", "after, left out", "bias before", "bias after")
    return _table(head, rows, range(1, len(head)))


def _fitted(document: Mapping[str, Any]) -> str:
    last = document["steps"][-1]
    rows = [
        ("strut law", f"at {end['length_mm']:.1f} mm", f"{end['stiffness']:.2f} N/um", f"sd {end['sd']:.2g} N/um")
        for end in last["strut_law_N_per_um"]
        if end["sd"] is not None
    ]
    for effect, entry in last["parameters"].items():
        for key, value in entry.items():
            if isinstance(value, Mapping):
                low, high = (_value(end) for end in value["interval"])
                rows.append((effect, key, f"{_value(value['value'])} {value['unit']}", f"{low} to {high}"))
            else:
                rows.append((effect, key, str(value), "chosen"))
    return _table(("effect", "parameter", "value", "95 % interval, or sd"), rows, (2, 3))


def _support(document: Mapping[str, Any]) -> str:
    rows = []
    for one in (*document["support"], *document["turned_down"]):
        gain = one["held_out_gain_in_se"]
        rows.append(
            (
                one["effect"],
                "yes" if one["supported"] else "no",
                "-" if gain is None else f"{gain:+.1f} se",
                f"{number(one['likelihood_gain'], 1)} (chance: {number(one['threshold'], 1)})",
                "; ".join(one["reasons"]),
            )
        )
    head = ("effect", "borne", "fall at left-out points", "gain in twice the log likelihood", "what speaks against it")
    return _table(head, rows, (2, 3))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} %"


def _value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


def _text(value: object) -> str:
    return html.escape(plain(str(value)))


def _section(title: str, body: str) -> str:
    return f"<section><h2>{_text(title)}</h2>{body}</section>" if body else ""


def _bullets(sentences: Sequence[object]) -> str:
    return "<ul>" + "".join(f"<li>{_text(sentence)}</li>" for sentence in sentences) + "</ul>" if sentences else ""


def _picture(name: str, pictures: Mapping[str, bytes | str]) -> str:
    picture = pictures[name]
    assert isinstance(picture, bytes)
    question, reading = QUESTIONS[name]
    source = base64.b64encode(picture).decode("ascii")
    image = f'<img alt="{_text(question)}" src="data:image/png;base64,{source}">'
    # The picture shows its question itself, for whoever opens it alone.
    return f'<section><h2 class="unseen">{_text(question)}</h2>{image}<p class="muted">{_text(reading)}</p></section>'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], numeric: Iterable[int] = ()) -> str:
    """A table; the columns `numeric` are aligned to the right. Empty without rows."""
    right = set(numeric)

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{' class=num' if i in right else ''}>{_text(cell)}</{tag}>" for i, cell in enumerate(row)
        )

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table><thead><tr>{cells('th', head)}</tr></thead><tbody>{body}</tbody></table>" if rows else ""
