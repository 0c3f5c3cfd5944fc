"""A portrait as part of diagnose.json, in shop units."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

import numpy as np

from toolpath_stiff.portrait.alike import Alike
from toolpath_stiff.portrait.words import SizedTermEntry, _of_term, alike_text, portrait_text, term_words
from toolpath_stiff.units import json_number

if TYPE_CHECKING:
    from toolpath_stiff.portrait.portrait import Portrait, Sized


class LinkEntry(TypedDict):
    """A link of the load path and its probability."""

    link: str
    probability: float | None


class VariableEntry(TypedDict):
    """What the missing thing varies with, and its probability."""

    variable: str
    probability: float | None


class TermEntry(SizedTermEntry):
    """A term of a description; `interval` holds 95 %."""

    interval: list[float | None]
    rms_percent: float | None
    words: str


class AlikeEntry(TermEntry):
    """Another leading term that fits as well."""

    probability: float | None


class SameTermEntry(SizedTermEntry):
    """A term that fits as well as a named effect, with its share among those that do."""

    share: float | None
    words: str


class SameEntry(TypedDict):
    """The content of `looks_the_same`."""

    text: str
    links: list[LinkEntry]
    variables: list[VariableEntry]
    terms: list[SameTermEntry]


class PortraitEntry(TypedDict):
    """The content of `portrait`."""

    text: str
    links: list[LinkEntry]
    variables: list[VariableEntry]
    terms: list[TermEntry]
    indistinguishable: list[AlikeEntry]
    explained_percent: float | None
    error_percent: float | None
    held_out_rms_percent: float | None
    noise_floor_percent: float | None
    smooth_rms_percent: float | None
    look_elsewhere: float | None


def portrait_entry(portrait: Portrait) -> PortraitEntry:
    """A portrait as diagnose.json has it."""
    return {
        "text": portrait_text(portrait),
        "links": [{"link": name, "probability": json_number(weight, 3)} for name, weight in portrait.links],
        "variables": [{"variable": name, "probability": json_number(weight, 3)} for name, weight in portrait.variables],
        "terms": [_term(one) for one in portrait.terms],
        "indistinguishable": [
            {**_term(one), "probability": json_number(one.probability or 0.0, 3)} for one in portrait.alike
        ],
        "explained_percent": json_number(100.0 * portrait.explained, 4),
        "error_percent": json_number(100.0 * portrait.error, 4),
        "held_out_rms_percent": json_number(100.0 * portrait.held_out_rms, 4),
        "noise_floor_percent": json_number(100.0 * portrait.noise_floor, 4),
        "smooth_rms_percent": json_number(100.0 * portrait.smooth_rms, 4),
        "look_elsewhere": json_number(portrait.look_elsewhere, 3),
    }


def alike_entry(name: str, alike: Alike) -> SameEntry:
    """What else would look the same as a named effect, as diagnose.json has it."""
    return {
        "text": alike_text(name, alike),
        "links": [{"link": link, "probability": json_number(share, 3)} for link, share in alike.links],
        "variables": [{"variable": one, "probability": json_number(share, 3)} for one, share in alike.variables],
        "terms": [
            {
                **_of_term(term),
                "share": json_number(share, 3),
                "words": term_words(term),
            }
            for term, share in alike.terms
        ],
    }


def _term(sized: Sized) -> TermEntry:
    term = sized.term
    return {
        **_of_term(term),
        "interval": [json_number(float(end)) for end in np.array(sized.interval) / term.si],
        "rms_percent": json_number(100.0 * sized.rms, 3),
        "words": term_words(term),
    }
