"""A portrait as JSON: parts of diagnose.json, in shop units."""

from __future__ import annotations

from collections.abc import Sequence

from toolpath_stiff.documents import Document
from toolpath_stiff.portrait.alike import Alike
from toolpath_stiff.portrait.portrait import Portrait, Sized
from toolpath_stiff.portrait.words import alike_text, portrait_text, term_words
from toolpath_stiff.stiffness.terms import Term
from toolpath_stiff.units import json_number

SHARES = ("explained", "error", "held_out_rms", "noise_floor")  # of a portrait


def portrait_entry(portrait: Portrait) -> Document:
    """A portrait as diagnose.json has it."""
    return {
        "text": portrait_text(portrait),
        "links": _shares("link", portrait.links),
        "variables": _shares("variable", portrait.variables),
        "terms": [_sized(sized) for sized in portrait.terms],
        "indistinguishable": [
            {**_sized(sized), "probability": json_number(sized.probability or 0.0, 3)} for sized in portrait.alike
        ],
        **{f"{name}_percent": json_number(100.0 * getattr(portrait, name), 4) for name in SHARES},
        "look_elsewhere": json_number(portrait.look_elsewhere, 3),
    }


def alike_entry(name: str, alike: Alike) -> Document:
    """What else would look the same as a named effect, as diagnose.json has it."""
    return {
        "text": alike_text(name, alike),
        "links": _shares("link", alike.links),
        "variables": _shares("variable", alike.variables),
        "terms": [
            {**_term(term), "share": json_number(share, 3), "words": term_words(term)} for term, share in alike.terms
        ],
    }


def _shares(key: str, shares: Sequence[tuple[str, float]]) -> list[Document]:
    """Names with their probabilities."""
    return [{key: name, "probability": json_number(share, 3)} for name, share in shares]


def _sized(sized: Sized) -> Document:
    """A term with its interval, and the change of stiffness that it makes."""
    return {
        **_term(sized.term),
        "interval": [json_number(end / sized.term.si) for end in sized.interval],
        "rms_percent": json_number(100.0 * sized.rms, 3),
        "words": term_words(sized.term),
    }


def _term(term: Term) -> Document:
    """A term of the dictionary with its size; `where` is a strut or a vertex, `second_variable` null without one."""
    return {
        "link": term.link,
        "where": term.where,
        "direction": term.direction,
        "variable": term.variable,
        "second_variable": None if term.times is None else term.times.variable,
        "shape": term.shape,
        "size": json_number(term.size / term.si),
        "unit": term.unit,
    }
