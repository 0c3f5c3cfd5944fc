"""Pages that are a headline, a few figures and sections below each other: comparison, diagnosis, update. No network.

Everything from a file is escaped, and a content security policy lets the page load nothing and run nothing but a
script of its own, where it has one.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Mapping, Sequence

from toolpath_stiff.hints import parted
from toolpath_stiff.report.template import asset, filled, script_hash, style
from toolpath_stiff.report.vector import Drawing
from toolpath_stiff.report.wording import plain

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
