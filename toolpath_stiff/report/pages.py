"""Pages: a head and a list of sections, put into the templates of `assets/`.

A page is one file that loads nothing. Whatever is put into a template is escaped and cleared of control characters
unless it is `Markup`; a content security policy lets nothing run but the page's own script.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from toolpath_stiff.defaults import VERSION
from toolpath_stiff.documents import Document
from toolpath_stiff.hints import parted
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import counted, machine_text, plain

if TYPE_CHECKING:
    from jinja2 import Environment

DATA = Markup("<data>")  # placeholder of a page's data; text that is not `Markup` is escaped and cannot contain it
LONG_LIST = 20_000  # entries
FINER = 1.5  # pixels of a picture per pixel of the page
# Part of a section: a table, a list of sentences, a remark, or HTML.
Part = ShownTable | Sequence[object] | str | Markup
Section = tuple[str, *tuple[Part, ...]] | str  # its title and its parts; or a picture's file name


@dataclass(frozen=True)
class Head:
    """Content above the sections; `figures`: the few key figures, each with its label."""

    title: str
    verdict: str
    headline: str
    text: str
    about: Sequence[str]
    figures: Sequence[tuple[str, str]]
    warnings: Sequence[str]
    footer: str
    verdict_class: str = ""


def page_of(
    head: Head,
    sections: Iterable[Section],
    drawn: Mapping[str, bytes],
    questions: Mapping[str, tuple[str, str]],
) -> str:
    """A page of sections one below the other; parts with nothing to show are left out.

    Parameters
    ----------
    head
        What stands above them.
    sections
        In their order.
    drawn
        The pictures by file name.
    questions
        Picture -> the question that it answers, and how it is read.
    """
    shown = (
        _picture(part, drawn, questions) if isinstance(part, str) else _section(part[0], part[1:]) for part in sections
    )
    values = {**vars(head), "about": "   ·   ".join(filter(None, head.about))}
    values |= {"styles": ["sections.css"], "scripts": ["pictures.js"] if drawn else []}
    return "".join(render("sections.html", sections=[*filter(None, shown)], **values))


def readings_head(
    command: str, document: Document, verdict: str, headline: str, figures: Sequence[tuple[str, str]]
) -> Head:
    """Head of a page on readings: text, data, machine, warnings and seed come from its document."""
    files = ", ".join(document["data"])
    return Head(
        title=f"{command.capitalize()}: {files}",
        verdict=verdict,
        headline=headline,
        text=document["text"],
        about=[counted(document["readings"], "reading"), files, f"machine {machine_text(document)}"],
        figures=figures,
        warnings=document["warnings"],
        footer=f"tps {command}, seed {document['seed']}",
    )


def _section(title: str, parts: Iterable[Part]) -> Markup:
    body = Markup().join(map(part, parts))
    return _macro("section", title, body) if body else Markup()


def part(content: Part) -> Markup:
    """A part of a section as HTML; empty if it has nothing to show."""
    if isinstance(content, ShownTable):
        rows = [*zip(content.kinds or [""] * len(content.rows), content.rows, strict=True)]
        return _macro("table", content.titles, rows, content.right) if rows else Markup()
    if isinstance(content, Markup):
        return content
    if isinstance(content, str):
        return markup('<p class="muted">{}</p>', content) if content else Markup()
    return _macro("bullets", content) if content else Markup()


def hints(texts: Sequence[str]) -> Markup:
    """Sentences followed by their commands, each marked as one that can be copied."""
    return _macro("hints", [parted(text) for text in texts]) if texts else Markup()


def _picture(name: str, drawn: Mapping[str, bytes], questions: Mapping[str, tuple[str, str]]) -> Markup:
    """A picture under the question that it answers, with how to read it; empty if it was not drawn."""
    if not (picture := drawn.get(name)):
        return Markup()
    (width,) = struct.unpack(">I", picture[16:20])  # width from the PNG's header, pixels
    return _macro("picture", name, *questions[name], base64.b64encode(picture).decode("ascii"), round(width / FINER))


def render(
    template: str, *, styles: Sequence[str] = (), scripts: Sequence[str] = (), data: Any = None, **values: Any
) -> Iterator[str]:
    """A page in pieces: a long program's data are most of it, and are held in memory once only.

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
        What the template names; `connect`: what the policy says of servers that scripts may ask, where they may.
    """
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
    """A value as a template shows it: text without control characters, HTML unchanged."""
    return value if isinstance(value, Markup) else plain(str(value))


def _macro(name: str, *values: object) -> Markup:
    html: Markup = getattr(_templates().get_template("parts.html").module, name)(*values)
    return html


def asset(name: str) -> str:
    """Text of a file in `assets/`, or, as "studio/NAME", in those of another room."""
    room, _, file = name.rpartition("/")
    return Path(__file__).parents[1].joinpath(room or "report", "assets", file).read_text(encoding="utf-8")


def script_hash(script: str) -> str:
    """Source expression of a script by Content Security Policy Level 3, section 2.3.1."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


def json_pieces(value: Any) -> Iterator[str]:
    """JSON that is safe inside a script element: nothing in it ends the element or a JavaScript line.

    In pieces: the values of an object and the entries of a long list one by one.
    """
    if isinstance(value, dict) and value:
        before = "{"
        for key, entry in value.items():
            yield f"{before}{_json(str(key))}:"
            yield from json_pieces(entry)
            before = ","
        yield "}"
    elif isinstance(value, Sequence) and not isinstance(value, str | tuple):
        before = "["
        for start in range(0, max(len(value), 1), LONG_LIST):
            yield before + _json(value[start : start + LONG_LIST])[1:-1]
            before = ","
        yield "]"
    else:
        yield _json(value)


def _json(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    if text.isascii() and not any(character in text for character in "<>&"):  # searches, without a copy
        return text
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    # A lone surrogate (a byte that was no text) cannot be written as UTF-8, and browsers stumble over it.
    return re.sub("[\ud800-\udfff]", "\N{REPLACEMENT CHARACTER}", text)


def markup(template: str, *values: object) -> Markup:
    """A piece of HTML with values in the places of {}, for pieces too small for a template."""
    return Markup(template).format(*map(_shown, values))
