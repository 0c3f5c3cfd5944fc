"""An effect file drafted from a portrait: what is missing, as source text that an engineer reads and edits.

The file says what the portrait says, no more: terms that were read off the readings, at most three sizes, formulas and
constants in the open. It records the readings that it was drawn from, so that no diagnosis takes it for confirmed by
them (`inference.drawn`). The same readings and options give the same bytes.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from toolpath_stiff.correction.machines import data_hash
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.drafting.source import GEOMETRY, HOOKS, INSTRUMENT, STRUCTURE, pieces_of
from toolpath_stiff.hints import Asked, command_line, options
from toolpath_stiff.portrait.terms import Term
from toolpath_stiff.portrait.words import portrait_text, size_words, term_words
from toolpath_stiff.readings.measurements import reading_marks
from toolpath_stiff.stiffness.contract import joined

if TYPE_CHECKING:
    from jinja2 import Template

    from toolpath_stiff.drafting.source import Piece


WIDTH = 116  # columns of running text in the file


LONGEST_TEXT, LONGEST_KEY = 108, 12  # of a string on a line of its own; of what stands before it on the same line


MARKS_A_LINE = 10


REPEATED = "stiffness = path."  # what several statements use, and one line says


HOOK_NAMES = ("strut_compliance", "load_compliance", "parallel_stiffness", "geometry", "reading")


KINDS = {STRUCTURE: "", GEOMETRY: "_geometry", INSTRUMENT: "_reading"}  # what an effect's name ends with


HOOKS |= {"reading factor": "reading", "reading shift": "reading"}


@dataclass(frozen=True)
class Draft:
    """An effect file, or why there is none.

    Attributes
    ----------
    text
        The file; "" where there is nothing to be described.
    effects
        Names of its effects.
    reason
        Why there is none, a sentence; "" where there is one.
    """

    text: str = ""
    effects: tuple[str, ...] = ()
    reason: str = ""


@dataclass(frozen=True)
class Origin:
    """What a draft was drawn from.

    Attributes
    ----------
    files, sha256, readings
        Measurement files, the hash of their bytes, how many readings they hold.
    machine
        Its name.
    marks
        Of the readings, `measurements.reading_marks`.
    command
        What drew it.
    next
        Commands that check it, try it, and plan readings that it has not seen.
    """

    files: tuple[str, ...]
    sha256: str
    readings: int
    machine: str
    marks: tuple[str, ...]
    command: str
    next: tuple[str, str, str]


@dataclass(frozen=True)
class Description:
    """What a portrait says of what is missing: in a paragraph, term by term with its size, and what else is alike."""

    text: str
    terms: tuple[Term, ...]
    words: tuple[str, ...]
    sizes: tuple[str, ...]
    alike: tuple[str, ...] = ()


def draft(diagnosis: Diagnosis, file: str) -> Draft:
    """What a diagnosis leaves unexplained, as an effect file.

    Parameters
    ----------
    diagnosis
        With what it was asked.
    file
        Where it is to be written: the effect is named after it, and the commands in the file read it there.
    """
    reason = _nothing_to_describe(diagnosis)
    if reason:
        return Draft(reason=reason)
    asked = diagnosis.asked or Asked(diagnosis.names, diagnosis.machine.name)
    origin = Origin(
        files=diagnosis.names,
        sha256=data_hash(diagnosis.names),
        readings=len(diagnosis.data),
        machine=diagnosis.machine.name,
        marks=tuple(sorted(set(reading_marks(diagnosis.data).tolist()))),
        command=asked.command("effects draft", "-o", file, *options(seed=diagnosis.seed or None)),
        next=(
            command_line("effects", "check", file),
            asked.command("diagnose", effects=[file]),
            asked.command("plan", effects=[file]),
        ),
    )
    name, description = PurePath(file).stem, description_of(diagnosis)
    return Draft(draft_source(name, description, origin), tuple(effect_names(name, description.terms)))


def description_of(diagnosis: Diagnosis) -> Description:
    """The part of a portrait that an effect can say: terms of variables that effects see."""
    portrait = diagnosis.portrait
    assert portrait is not None
    seen = [one for one in portrait.terms if one.term.acts]
    return Description(
        portrait_text(portrait),
        tuple(one.term for one in seen),
        tuple(term_words(one.term) for one in seen),
        tuple(size_words(one) for one in seen),
        tuple(f"{term_words(one.term)} ({100.0 * (one.probability or 0.0):.0f} %)" for one in portrait.alike),
    )


def _nothing_to_describe(diagnosis: Diagnosis) -> str:
    """Why there is nothing that an effect could describe, a sentence; "" where there is something."""
    names = joined(list(diagnosis.explanations))
    if diagnosis.main.question:
        return f"{diagnosis.main.question} Nothing is drafted from readings that may be of another machine."
    if diagnosis.verdict == "adequate":
        return "Nothing is missing that these data could show: there is nothing to describe."
    if diagnosis.verdict == "described":
        return f"{names} describes these readings already: measure others, and see whether it foretells them."
    if diagnosis.verdict == "unexplained" and (diagnosis.portrait is None or not diagnosis.portrait.terms):
        return "Something is missing, but no simple form of it stands out from chance: there is nothing to write down."
    if diagnosis.portrait is None:
        word = "explains" if diagnosis.verdict == "identified" else "may explain"
        return f"{names} {word} these readings and leaves nothing that stands out: there is nothing to describe."
    terms = [one.term for one in diagnosis.portrait.terms]
    if not any(term.acts for term in terms):
        with_what = joined(list(dict.fromkeys(name for term in terms for name in term.unseen)))
        return f"What is missing varies with {with_what}, which no effect of a machine sees: nothing is drafted."
    return ""


def draft_source(name: str, description: Description, origin: Origin) -> str:
    """The text of an effect file.

    Parameters
    ----------
    name
        Of the effect; one of readings or of the geometry has a name with an ending if it is not alone in the file.
    description, origin
        What the portrait says, and what it was read off.
    """
    pieces = pieces_of(description.terms, [_plain(words) for words in description.words])
    effects = _effects(name, pieces)
    files = joined(list(origin.files))
    read = f"{origin.readings} readings of {files} (SHA-256 {origin.sha256[:16]}), machine {origin.machine}"
    values = {
        "heading": f"What the model of {_plain(origin.machine)} lacks, by its readings: a description, no finding.",
        "text": _filled(description.text),
        "pieces": [
            {
                "bullet": _filled(f"{piece.parameter}: {piece.words}; {size}", "- ", "  "),
                "formula": _filled(piece.formula, "    ", "    "),
                "functions": piece.functions,
            }
            for piece, size in zip(pieces, description.sizes, strict=True)
        ],
        "alike": [_filled(one, "- ", "  ") for one in description.alike],
        "origin": _filled(f"Drawn by `{origin.command}` from {read}."),
        "check": _plain(origin.next[0]),
        "diagnose": _plain(origin.next[1]),
        "plan": _plain(origin.next[2]),
        "vertices": any("frame_vertices(" in piece.functions for piece in pieces),
        "swings": any("joint_angles(" in piece.functions for piece in pieces),
        "turning": any("end_rotations(" in line for piece in pieces for line in piece.statements),
        "springs": any("springs(" in line for piece in pieces for line in piece.statements),
        "source": _long_text(f"described from {read}; not confirmed", indent=""),
        "effects": effects,
        "marks": [
            " ".join(origin.marks[k : k + MARKS_A_LINE]) for k in range(0, len(origin.marks), MARKS_A_LINE)
        ],
    }  # fmt: skip
    return _template().render(values).rstrip() + "\n"


def effect_names(name: str, terms: Sequence[Term]) -> list[str]:
    """Names of the effects in a file of these terms."""
    return [effect["plain_name"] for effect in _effects(name, pieces_of(terms, [""] * len(terms)))]


def _effects(name: str, pieces: Sequence[Piece]) -> list[dict[str, Any]]:
    """The classes of the file: one for the machine's parts, one for its geometry, one for readings, where needed."""
    kinds = [kind for kind in KINDS if any(piece.kind == kind for piece in pieces)]
    called = {kind: name if len(kinds) == 1 else f"{name}{KINDS[kind]}" for kind in kinds}
    return [_effect(called[kind], [piece for piece in pieces if piece.kind == kind]) for kind in kinds]


def _effect(called: str, own: Sequence[Piece]) -> dict[str, Any]:
    """One class of the file: what the template fills in."""
    hooks: dict[str, list[str]] = {}
    for piece in own:
        mine = hooks.setdefault(piece.hook, [])
        mine += [line for line in piece.statements if line not in mine or not line.startswith(REPEATED)]
    effects = [piece.effect for piece in own]
    title = "; ".join(piece.words for piece in own)
    return {
        "plain_name": called,
        "class_name": "".join(part.capitalize() for part in called.split("_")) or "Missing",
        "name": _text(called),
        "title": _long_text(title),
        "summary": _first(title),
        "link": _text(effects[0].link),
        "equation": _long_text("; ".join(piece.formula for piece in own)),
        "needs": _tuple([need for effect in effects for need in effect.needs]),
        "load_dependent": any(effect.load_dependent for effect in effects),
        "hooks": {**dict.fromkeys(HOOK_NAMES), **hooks},
        "pieces": [_parameter(piece) for piece in own],
    }


def _parameter(piece: Piece) -> dict[str, str]:
    return {
        "name": _text(piece.parameter),
        "unit": _text(piece.term.unit),
        "si": repr(piece.term.si),
        "bounds": repr(piece.bounds),
        "typical": repr(piece.typical),
        "meaning": _long_text(piece.words, indent=" " * 12),
        "functions": piece.functions,
    }


def _tuple(texts: Sequence[str]) -> str:
    """A tuple literal, each text once; "" without any."""
    unique = list(dict.fromkeys(texts))
    return f"({', '.join(map(_text, unique))},)" if unique else ""


def _text(text: str) -> str:
    """A string literal in double quotes, on one line."""
    return json.dumps(text, ensure_ascii=False)


def _long_text(text: str, indent: str = "    ") -> str:
    """The same, in brackets over several lines where one does not hold it."""
    longest = LONGEST_TEXT - len(indent)
    if len(text) < longest - LONGEST_KEY:
        return _text(text)
    parts = textwrap.wrap(_plain(text), longest, break_long_words=False, break_on_hyphens=False)
    lines = [_text(part + " ") for part in parts[:-1]] + [_text(parts[-1])]
    return "\n".join(["(", *(f"{indent}    {line}" for line in lines), f"{indent})"])


def _plain(text: str) -> str:
    """One line for a docstring, which ends with three quotes and knows no backslash."""
    return " ".join(str(text).split()).replace("\\", "/").replace('"""', "'''")


def _first(text: str) -> str:
    """As the first sentence of a docstring."""
    said = textwrap.shorten(_plain(text), WIDTH - 8, placeholder=" ...")
    return f"{said[:1].upper()}{said[1:]}" + ("" if said.endswith(".") else ".")


def _filled(text: str, first: str = "", rest: str = "") -> str:
    return textwrap.fill(
        _plain(text),
        WIDTH,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )


@cache
def _template() -> Template:
    from jinja2 import Environment, StrictUndefined

    text = (resources.files("toolpath_stiff") / "data" / "templates" / "draft.py.txt").read_text("utf-8")
    # Python text, no page: nothing to be escaped for HTML.
    made = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, autoescape=False)
    return made.from_string(text)
