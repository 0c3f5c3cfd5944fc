"""A portrait in an engineer's words, and as entries of diagnose.json in shop units."""

from collections.abc import Mapping, Sequence

import numpy as np

from toolpath_stiff.documents import Document, json_number
from toolpath_stiff.portrait.alike import Alike
from toolpath_stiff.portrait.portrait import MOST_READINGS, Portrait, Sized
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.stiffness.terms import PINS, SWINGS, Term
from toolpath_stiff.units import RAD_PER_DEG

# Variable -> its name in a sentence, SI value of the unit shown, that unit.
SAID: dict[str, tuple[str, float, str]] = {
    "x": ("x", 1e-3, "mm"),
    "y": ("y", 1e-3, "mm"),
    "z": ("z", 1e-3, "mm"),
    "radius": ("the distance from the machine's axis", 1e-3, "mm"),
    "tilt": ("the tilt", RAD_PER_DEG, "deg"),
    "strut length": ("the strut's length", 1e-3, "mm"),
    "tool length": ("the tool's length", 1e-3, "mm"),
    "strut force": ("the force in the strut", 1.0, "N"),
    "load": ("the load", 1.0, "N"),
    "time": ("the time since zeroing", 60.0, "min"),
    "order": ("the order of the readings", 0.01, "% of the campaign"),
    "temperature": ("the temperature", 1.0, "deg C"),
}
GIVES = {
    "X": "along X", "Y": "along Y", "Z": "along Z", "horizontal": "sideways, alike along X and Y",
    "all": "alike in all directions", "radial": "radially",
    "tangential": "tangentially", "axial": "along the tool axis", "along the struts": "along the struts",
}  # fmt: skip
ROCKS = {
    "X": "rocks about Y", "Y": "rocks about X", "all": "rocks about X and Y", "tangential": "turns about Z",
}  # fmt: skip
OF_HEAD = {"X": "along the platform's X", "Y": "along the platform's Y", "radial": "across the tool axis"}
TIPS = {"X": "tips about the platform's Y", "Y": "tips about the platform's X", "radial": "tips"}
# Way of acting -> what gives way.
CAUSES = {
    "reading factor": "deflections{along} are read too {large} by a share",
    "reading shift": "deflections{along} are read too {large} by a displacement",
    "joint offset": "the {column} joint of {strut} stands off its place along {axis}",
    "coupling": "struts {first:.0f} and {second:.0f} are coupled: force in one stretches the other",
    "strut factor": "{softer}",
    "strut": "the joints of {strut} give way",
    "turning": "the joints{of} resist turning",
    "spring": "something holds the platform {way}, as a hose or a cover does",
    **dict.fromkeys(PINS, "the {pin} way along a pin that stands {pinned}"),
    "vertex": "{vertex}",
    "rocking": "the {link} {rocks}",
    "tilting": "the {link} {tips} under the load's moment",
    "give": "the {link} gives way {way}",
}
# A constant that marks the shape (the first match counts), or "signed" for a straight line of either sign -> wording.
COURSES = {
    "power": "{power}, the size given at {reference})",
    "signed": " in a straight line with {name}, nothing at {from} and in full at {end}",
    "reach": ", with the square of {name} from {centre}, in full {reach} from there",
    "width": " where {name} is about {centre} (to some {width} either side)",
    "period": " in a wave over {name} with a period of {period}",
    "within": " until {name} reaches {within}, and no further",
    "beyond": " as far as {name} is above {beyond}, which friction holds",
    "edge": " where {name} is {side} {edge}",
    "end": " where {name} is {side} {from}, in full at {end}",
}
MOST_SAID = 3  # terms in a sentence on what else would look the same; a document has more


def term_words(term: Term) -> str:
    """Clause on what gives way and what it varies with, without its size."""
    return f"{_cause(term)}{_with(term)}"


def _cause(term: Term) -> str:
    """Words on link, place and direction."""
    single, link, direction, more = term.where is not None, term.link, term.direction, term.size >= 0.0
    strut, joint, give = (f"strut {term.where}", "joint", "gives") if single else ("the struts", "joints", "give")
    ways = {**GIVES, **OF_HEAD} if link in ("tool", "platform") and term.action != "spring" else GIVES
    vertex = f"{link} vertex {term.where}" if single else f"the vertices of the {link}"
    words = {
        "link": link,
        "strut": strut,
        "column": term.column,
        "axis": direction,
        "large": "large" if more else "small",
        "along": f" along {direction}" if direction in ("X", "Y", "Z") else "",
        "way": ways.get(direction, ""),
        "of": f" of {strut}" if single else "",
        "rocks": ROCKS.get(direction, ""),
        "tips": TIPS.get(direction, ""),
        "softer": f"{strut} {'is' if single else 'are'} {'softer' if more else 'stiffer'}",
        "pin": f"{term.action.removesuffix(' pin')} {joint} of {strut} {give}",
        "pinned": GIVES.get(direction, ""),
        "vertex": f"{vertex} {give} way {GIVES.get(direction, '')}",
    }
    return CAUSES[term.action].format(**words, **term.constants)


def _with(term: Term) -> str:
    """Words on the variable and the shape, to follow the cause."""
    if term.variable in ("constant", "direction"):
        return ""
    if term.variable == "setup":
        return f" in set-up {term.column}"
    constants = term.constants
    if term.variable == "force sign":
        return " in tension" if constants["side"] > 0.0 else " in compression"
    name, si, unit = SAID.get(term.variable, (term.variable, 1.0, ""))
    if term.variable == "tilt" and term.column:
        name = f"the swing of the {term.column}s" if term.column in SWINGS else f"the lean towards {term.column}"
    begins, scaled = constants.get("from", constants.get("start", 0.0)), {"width": 2.0 * constants.get("width", 0.0)}
    numbers = constants | scaled | {"from": begins}
    values = {key: f"{float(f'{value / si:.3g}'):g} {unit}".rstrip() for key, value in numbers.items()}
    values["side"] = "above" if constants.get("side", constants.get("end", 0.0) - begins) > 0.0 else "below"
    if "power" in constants:
        trend = "less" if constants["power"] < 0.0 else "more"
        values["power"] = f", {trend} with {name} (power {constants['power']:.2g}"
    straight = term.signed and term.shape == "slope"
    kind = next(key for key in COURSES if key in constants or (key == "signed" and straight))
    return COURSES[kind].format(name=name, **values)


def size_words(sized: Sized) -> str:
    """Size with its interval and the change it makes: "9.1 nm/N (8 to 10), 6 % of stiffness in the mean"."""
    si = sized.term.si
    low, high = (f"{float(f'{end / si:.3g}'):g}" for end in sized.interval)
    return (
        f"{float(f'{sized.term.size / si:.3g}'):g} {sized.term.unit} ({low} to {high}), "
        f"{100.0 * sized.rms:.2g} % of stiffness (rms)"
    )


def portrait_text(portrait: Portrait) -> str:
    """Paragraph on what is missing, as far as the data support it, and on what else would look the same."""
    if not portrait.terms and np.isnan(portrait.look_elsewhere):
        return f"No description: it is made of {MOST_READINGS} readings at most."
    if not portrait.terms:
        return (
            "No description: no single link and variable stands out from what chance would do among all that were "
            f"searched (p = {portrait.look_elsewhere:.2g})."
        )
    first, *others = portrait.terms
    stands = "What is missing looks like this"
    if portrait.lacking:
        stands = (
            "The dictionary lacks what is missing: the terms stand for it, the error at points left out stays at "
            f"{portrait.held_out_rms / portrait.noise_floor:.2g} times the noise, and link and variable may be wrong. "
            "Nearest to it"
        )
    parts = [f"{stands}: {term_words(first.term)}; {size_words(first)}."]
    if others:
        parts.append(f"Beside it: {'; '.join(f'{term_words(sized.term)}, {size_words(sized)}' for sized in others)}.")
    parts.append(
        f"This takes {100.0 * portrait.explained:.0f} % of the misfit; rms error at points left out "
        f"{100.0 * portrait.held_out_rms:.2f} % (noise alone {100.0 * portrait.noise_floor:.2f} %)."
    )
    links, variables = _named(portrait.links), _named(portrait.variables)
    unknown = f"Which link it is cannot be told; it varies with {variables}."
    parts.append(f"Link: {links}; varies with: {variables}." if portrait.links else unknown)
    if portrait.alike:
        alike = [f"{term_words(sized.term)} ({100.0 * (sized.probability or 0.0):.0f} %)" for sized in portrait.alike]
        parts.append(f"The same would be seen if {'; or if '.join(alike)}.")
    return " ".join(parts)


def _named(names: Sequence[tuple[str, float]]) -> str:
    return joined([f"{name} ({100.0 * weight:.0f} %)" for name, weight in names]).replace(" and ", " or ")


def alike_text(name: str, alike: Alike) -> str:
    """Sentence on what else would look the same as a named effect."""
    terms = "; or if ".join(term_words(term) for term, _ in alike.terms[:MOST_SAID])
    links = joined([link for link, _ in alike.links]).replace(" and ", " or ")
    return f"These readings fit as well, without {name}, if {terms}. By link: {links}."


def variable_label(term: Term) -> tuple[str, float]:
    """Axis label, a term's variable with its unit, and the SI value of that unit."""
    name, si, unit = SAID.get(term.variable, (term.variable, 1.0, ""))
    return (f"{name}, {unit}" if unit else name), si


SHARES = ("explained", "error", "held_out_rms", "noise_floor")  # of a portrait


def portrait_entry(portrait: Portrait) -> Document:
    """A portrait as an entry of diagnose.json."""
    return {
        "text": portrait_text(portrait),
        "links": _shares("link", portrait.links),
        "variables": _shares("variable", portrait.variables),
        "terms": [_sized(sized) for sized in portrait.terms],
        "indistinguishable": [
            {**_sized(sized), "probability": json_number(sized.probability or 0.0, 3)} for sized in portrait.alike
        ],
        "lacking": portrait.lacking,
        **{f"{name}_percent": json_number(100.0 * getattr(portrait, name), 4) for name in SHARES},
        "look_elsewhere": json_number(portrait.look_elsewhere, 3),
    }


def alike_entry(alike: Mapping[str, Alike]) -> Document | None:
    """Alternatives to the named effects as an entry of diagnose.json; None if there are none."""
    if not alike:
        return None
    each = alike.values()
    return {
        "text": " ".join(alike_text(name, same) for name, same in alike.items()),
        "links": _shares("link", [share for same in each for share in same.links]),
        "variables": _shares("variable", [share for same in each for share in same.variables]),
        "terms": [
            {**_term(term), "effect": name, "share": json_number(share, 3), "words": term_words(term)}
            for name, same in alike.items()
            for term, share in same.terms
        ],
    }


def _shares(key: str, shares: Sequence[tuple[str, float]]) -> list[Document]:
    """Names with their probabilities, as entries of a document."""
    return [{key: name, "probability": json_number(share, 3)} for name, share in shares]


def _sized(sized: Sized) -> Document:
    """A term with its interval and the change of stiffness that it makes, as an entry of a document."""
    return {
        **_term(sized.term),
        "interval": [json_number(end / sized.term.si) for end in sized.interval],
        "rms_percent": json_number(100.0 * sized.rms, 3),
        "words": term_words(sized.term),
    }


def _term(term: Term) -> Document:
    """A term of the dictionary with its size, as an entry of a document; `where` is a strut or a vertex."""
    return {
        "link": term.link,
        "where": term.where,
        "direction": term.direction,
        "variable": term.variable,
        "shape": term.shape,
        "size": json_number(term.size / term.si),
        "unit": term.unit,
    }
