"""Pages that are a headline, a few figures and sections below each other: comparison, diagnosis, update. No network.

Everything from a file is escaped, and a content security policy lets the page load nothing and run nothing but a
script of its own, where it has one.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from typing import TYPE_CHECKING, Any

from toolpath_stiff.hints import parted
from toolpath_stiff.report.figure import Drawing
from toolpath_stiff.report.words import plain

if TYPE_CHECKING:
    pass

Row = tuple[str, Sequence[str]]  # class of the row, its cells


def escaped(value: object) -> str:
    """Text as HTML."""
    return html.escape(plain(str(value)))


def section(title: str, body: str) -> str:
    """A titled section; nothing where there is no body."""
    return f"<section><h2>{escaped(title)}</h2>{body}</section>" if body else ""


def bullets(sentences: Sequence[object]) -> str:
    """A list; nothing without sentences."""
    return "<ul>" + "".join(f"<li>{escaped(sentence)}</li>" for sentence in sentences) + "</ul>" if sentences else ""


def hint_list(hints: Sequence[object]) -> str:
    """As `bullets`, a hint's command set as one, to be copied."""
    rows = []
    for sentence, line in (parted(str(text)) for text in hints):
        rows.append(f"<li>{escaped(sentence)}" + (f"<pre><code>{escaped(line)}</code></pre>" if line else "") + "</li>")
    return f"<ul>{''.join(rows)}</ul>" if rows else ""


def picture(name: str, pictures: Mapping[str, bytes | str], questions: Mapping[str, tuple[str, str]]) -> str:
    """A picture under the question that it answers, with how it is read; nothing where it was not drawn."""
    content = pictures.get(name)
    if not isinstance(content, bytes):
        return ""
    question, reading = questions[name]
    if isinstance(content, Drawing):
        image = content.svg
    else:
        image = f'<img alt="" src="data:image/png;base64,{base64.b64encode(content).decode("ascii")}">'
    # The picture shows its question itself, for whoever opens it alone. A tabindex lets the keyboard scroll it.
    return (
        f'<section><h2 class="unseen">{escaped(question)}</h2>'
        f'<div class="picture" role="img" aria-label="{escaped(question)}" tabindex="0">{image}</div>'
        f'<p class="muted">{escaped(reading)}</p></section>'
    )


def table(head: Sequence[str], rows: Sequence[Row], numeric: Iterable[int] = ()) -> str:
    """A table of cells that are HTML already; the columns `numeric` are aligned to the right. Nothing without rows."""
    right = set(numeric)

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(f"<{tag}{' class=num' if i in right else ''}>{cell}</{tag}>" for i, cell in enumerate(row))

    body = "".join(
        f'<tr class="{kind}">{cells("td", row)}</tr>' if kind else f"<tr>{cells('td', row)}</tr>" for kind, row in rows
    )
    return f"<table><thead><tr>{cells('th', head)}</tr></thead><tbody>{body}</tbody></table>" if rows else ""


def text_table(head: Sequence[str], rows: Sequence[Row], numeric: Iterable[int] = ()) -> str:
    """A table of plain texts."""
    return table([*map(escaped, head)], [(kind, [*map(escaped, row)]) for kind, row in rows], numeric)


def figures(found: Iterable[tuple[str, str]]) -> str:
    """The few figures that say it all: (figure, what it is)."""
    return "".join(f"<li><b>{escaped(value)}</b><span>{escaped(name)}</span></li>" for value, name in found)


def page(
    title: str, verdict: str, headline: str, text: str, about: Sequence[str], figures: str, warnings: Sequence[str],
    sections: Iterable[str], footer: str, verdict_class: str = "", styles: Sequence[str] = (), script: str = "",
) -> str:  # fmt: skip
    """The whole page. `figures`, `sections` and `footer` are HTML, the others text.

    `styles`: style sheets in `assets/` beyond those of all such pages. `script` is the only one that may run; most
    pages have none.
    """
    parts = {
        "title": escaped(title),
        "verdict": escaped(verdict),
        "verdict_class": verdict_class,
        "headline": escaped(headline),
        "text": escaped(text),
        "about": escaped("   ·   ".join(part for part in about if part)),
        "figures": figures,
        "warnings": "\n".join(f'<p class="warning">{escaped(warning)}</p>' for warning in warnings),
        "sections": "\n".join(part for part in sections if part),
        "footer": footer,
        "style": style("sections.css", *styles),
        "script": f"<script>{script}</script>\n" if script else "",
        "script_policy": f"; script-src '{script_hash(script)}'" if script else "",
    }
    return filled(asset("sections.html"), parts)


def asset(name: str) -> str:
    """Text of a file in `assets/`."""
    return resources.files("toolpath_stiff.report").joinpath("assets", name).read_text(encoding="utf-8")


def style(*names: str) -> str:
    """The style sheet of all pages, and further ones after it."""
    return "".join(map(asset, ("page.css", *names)))


def filled(template: str, parts: Mapping[str, str]) -> str:
    """The template with its {{names}} replaced in one pass, so that nothing inserted is looked at again."""
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)


def script_hash(script: str) -> str:
    """The source expression of Content Security Policy Level 3, section 2.3.1."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def json_for_script(value: Any) -> str:
    """JSON that can stand inside a script element: nothing in it ends the element, or a line of JavaScript."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    # A lone surrogate (a byte that was no text) cannot be written as UTF-8, and browsers stumble over it.
    return re.sub("[\ud800-\udfff]", "\N{REPLACEMENT CHARACTER}", text)
