"""Pages: templates, style sheets and scripts from `assets/`, and the parts that several pages have.

A page is one file that loads nothing. Whatever is put into a template is escaped and cleared of control characters
unless it is `Markup`; a content security policy lets nothing run but the page's own script.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from toolpath_stiff.defaults import VERSION
from toolpath_stiff.hints import parted
from toolpath_stiff.report.figure import Drawing
from toolpath_stiff.report.words import counted, machine_text, plain

if TYPE_CHECKING:
    from jinja2 import Environment


DATA = Markup("<data>")  # where the data of a page go; what is not `Markup` has no such letters in a page


LONG_LIST = 20_000  # entries


Row = tuple[str, Sequence[str]]  # class of the row, its cells: text, or `Markup`


def render(
    template: str, *, styles: Sequence[str] = (), scripts: Sequence[str] = (), data: Any = None, **values: Any
) -> str:
    """A page.

    Parameters
    ----------
    template
        File in `assets/` that extends `page.html`.
    styles
        Style sheets beyond the one of all pages.
    scripts
        Scripts, which share one scope and are the only ones that may run.
    data
        What they read, as JSON.
    values
        What the template names.
    """
    return "".join(render_pieces(template, styles=styles, scripts=scripts, data=data, **values))


def render_pieces(
    template: str, *, styles: Sequence[str] = (), scripts: Sequence[str] = (), data: Any = None, **values: Any
) -> Iterator[str]:
    """The same in pieces: the data of a long program are most of a page, and stand in memory once."""
    script = '\n"use strict";\n(() => {\n' + "".join(asset(file) for file in scripts) + "})();\n" if scripts else ""
    text = _templates().get_template(template).render(
        style=Markup("".join(asset(file) for file in ("page.css", *styles))),
        script=Markup(script),
        script_hash=script_hash(script),
        data=None if data is None else DATA,
        version=VERSION,
        **values,
    )  # fmt: skip
    before, mark, after = text.partition(DATA)
    yield before
    if mark:
        yield from json_pieces(data)
        yield after


@cache
def _templates() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    return Environment(
        loader=FunctionLoader(asset), autoescape=True, undefined=StrictUndefined, finalize=_shown,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip


def _shown(value: object) -> object:
    """What a template shows of a value: text without control characters, HTML as it is."""
    return value if isinstance(value, Markup) else plain(str(value))


def asset(name: str) -> str:
    """Text of a file in `assets/`."""
    return Path(__file__).with_name("assets").joinpath(name).read_text(encoding="utf-8")


def script_hash(script: str) -> str:
    """The source expression of Content Security Policy Level 3, section 2.3.1."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def json_for_script(value: Any) -> str:
    """JSON that can stand inside a script element: nothing in it ends the element, or a line of JavaScript."""
    return "".join(json_pieces(value))


def json_pieces(value: Any) -> Iterator[str]:
    """The text of `json_for_script` in pieces: the values of an object and the entries of a long list one by one."""
    if isinstance(value, dict) and value:
        before = "{"
        for key, entry in value.items():
            yield f"{before}{_json(str(key))}:"
            yield from json_pieces(entry)
            before = ","
        yield "}"
    elif isinstance(value, list) and len(value) > LONG_LIST:
        before = "["
        for start in range(0, len(value), LONG_LIST):
            yield before + _json(value[start : start + LONG_LIST])[1:-1]
            before = ","
        yield "]"
    else:
        yield _json(value)


def _json(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    if text.isascii() and not any(character in text for character in "<>&"):  # a long text is searched, not copied
        return text
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    # A lone surrogate (a byte that was no text) cannot be written as UTF-8, and browsers stumble over it.
    return re.sub("[\ud800-\udfff]", "\N{REPLACEMENT CHARACTER}", text)


def markup(template: str, *values: object) -> Markup:
    """A bit of HTML with values in the place of {}: as a template, for what is smaller than one."""
    return Markup(template).format(*(_shown(value) for value in values))


def _part(name: str, *values: object) -> Markup:
    """What a macro of `parts.html` makes."""
    html: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return html


def section(title: str, body: Markup) -> Markup:
    """A titled section; nothing where there is no body."""
    return _part("section", title, body) if body else Markup()


def bullets(sentences: Sequence[object]) -> Markup:
    """A list; nothing without sentences."""
    return _part("bullets", sentences) if sentences else Markup()


def hint_list(hints: Sequence[object]) -> Markup:
    """As `bullets`, a hint's command set as one, to be copied."""
    return _part("hints", [parted(str(text)) for text in hints]) if hints else Markup()


def picture(name: str, pictures: Mapping[str, bytes | str], questions: Mapping[str, tuple[str, str]]) -> Markup:
    """A picture under the question that it answers, with how it is read; nothing where it was not drawn."""
    content = pictures.get(name)
    if not isinstance(content, bytes):
        return Markup()
    drawn = isinstance(content, Drawing)
    shown = Markup(content.svg) if isinstance(content, Drawing) else base64.b64encode(content).decode("ascii")
    return _part("picture", *questions[name], shown, drawn)


def table(head: Sequence[str], rows: Sequence[Row], numeric: Iterable[int] = ()) -> Markup:
    """A table; the columns `numeric` are aligned to the right. Nothing without rows."""
    return _part("table", head, rows, list(numeric)) if rows else Markup()


def readings_page(
    title: str, command: str, document: Mapping[str, Any], verdict: str, headline: str,
    figures: Iterable[tuple[str, str]], sections: Iterable[Markup],
) -> str:  # fmt: skip
    """The page of a result on readings: text, data, machine, warnings and seed are those of its document."""
    files = ", ".join(document["data"])
    return page(
        title=f"{title}: {files}",
        verdict=verdict,
        headline=headline,
        text=document["text"],
        about=[counted(document["readings"], "reading"), files, f"machine {machine_text(document)}"],
        figures=figures,
        warnings=document["warnings"],
        sections=sections,
        footer=f"tps {command}, seed {document['seed']}",
    )


def page(
    title: str, verdict: str, headline: str, text: str, about: Sequence[str], figures: Iterable[tuple[str, str]],
    warnings: Sequence[str], sections: Iterable[Markup], footer: str, verdict_class: str = "",
) -> str:  # fmt: skip
    """A page of sections below each other; `sections` are HTML, the others text.

    `figures`: the few that say it all, each with what it is.
    """
    return render(
        "sections.html", styles=["sections.css"], title=title, verdict=verdict, headline=headline, text=text,
        about="   ·   ".join(part for part in about if part), figures=list(figures), warnings=warnings,
        sections=[part for part in sections if part], footer=footer, verdict_class=verdict_class,
    )  # fmt: skip
