"""A portrait in an engineer's words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from toolpath_stiff.portrait.alike import Alike
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.stiffness.terms import PINS, SWINGS, Term
from toolpath_stiff.units import RAD_PER_DEG

if TYPE_CHECKING:
    from toolpath_stiff.portrait.portrait import Portrait, Sized


# Variable -> how it is said, SI value of the unit shown, that unit.
SAID: dict[str, tuple[str, float, str]] = {
    "x": ("x", 1e-3, "mm"),
    "y": ("y", 1e-3, "mm"),
    "z": ("z", 1e-3, "mm"),
    "radius": ("the distance from the machine's axis", 1e-3, "mm"),
    "tilt": ("the tilt", RAD_PER_DEG, "deg"),
    "strut length": ("the strut's length", 1e-3, "mm"),
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


PINNED = {"radial": "radially", "tangential": "tangentially"}


TIPS = {"X": "tips about the platform's Y", "Y": "tips about the platform's X", "radial": "tips"}


MOST_SAID = 3  # terms in a sentence on what else would look the same; a document has more


def term_words(term: Term) -> str:
    """What gives way and what it varies with: a clause, without its size."""
    clause = f"{_cause(term)}{_with(term, len(term.signs) > 1)}"
    if term.second is None:
        return clause
    return f"{clause}, and this {_with(term.second, signed=False).removeprefix(',').strip()}"


def _cause(term: Term) -> str:
    """Link, place and direction."""
    if term.action in ("reading factor", "reading shift"):
        along = f" along {term.direction}" if term.direction in ("X", "Y", "Z") else ""
        off = "by a share" if term.action == "reading factor" else "by a displacement"
        return f"deflections{along} are read too {'large' if term.size >= 0.0 else 'small'} {off}"
    if term.action == "joint offset":
        return f"the {term.column} joint of strut {term.where} stands off its place along {term.direction}"
    if term.action == "coupling":
        pair = f"{term.constants['first']:.0f} and {term.constants['second']:.0f}"
        return f"struts {pair} are coupled: force in one stretches the other"
    if term.action in ("strut factor", "strut", "turning", *PINS):
        return _cause_in_struts(term)
    return _cause_in_link(term)


def _cause_in_struts(term: Term) -> str:
    """The same of struts and their joints: all, or one."""
    if term.action == "strut factor":
        side = "softer" if term.size >= 0.0 else "stiffer"
        return f"strut {term.where} is {side}" if term.where else f"the struts are {side}"
    if term.action == "strut":
        return f"the joints of strut {term.where} give way" if term.where else "the joints of the struts give way"
    if term.action == "turning":
        return f"the joints of strut {term.where} resist turning" if term.where else "the joints resist turning"
    which = f"joint of strut {term.where} gives" if term.where else "joints of the struts give"
    return f"the {term.action.removesuffix(' pin')} {which} way along a pin that stands {PINNED[term.direction]}"


def _cause_in_link(term: Term) -> str:
    """The same of a link that gives way, or of its vertices."""
    if term.action == "vertex":
        which = f"{term.link} vertex {term.where} gives" if term.where else f"the vertices of the {term.link} give"
        return f"{which} way {GIVES[term.direction]}"
    if term.action == "rocking":
        return f"the {term.link} {ROCKS[term.direction]}"
    if term.action == "tilting":
        return f"the {term.link} {TIPS[term.direction]} under the load's moment"
    along = GIVES[term.direction]
    if term.link in ("tool", "platform"):
        axes = {"X": "along the platform's X", "Y": "along the platform's Y", "radial": "across the tool axis"}
        along = axes.get(term.direction, along)
    return f"the {term.link} gives way {along}"


def _with(term: Term, signed: bool) -> str:
    """What it varies with and how, after its cause; `signed`: to both sides."""
    if term.variable in ("constant", "direction"):
        return ""
    if term.variable == "setup":
        return f" in set-up {term.column}"
    if term.variable == "force sign":
        return " in tension" if term.constants["side"] > 0.0 else " in compression"
    constants = term.constants
    name, si, unit = SAID.get(term.variable, (term.variable, 1.0, ""))
    if term.variable == "tilt" and term.column:
        name = f"the swing of the {term.column}s" if term.column in SWINGS else f"the lean towards {term.column}"

    def shown(value: float) -> str:
        return f"{float(f'{value / si:.3g}'):g} {unit}".rstrip()

    if term.shape == "slope":
        return _slope_words(term, name, shown, signed)
    if term.shape == "square":
        centre, reach = shown(constants["centre"]), shown(constants["reach"])
        return f", with the square of {name} from {centre}, in full {reach} from there"
    if term.shape == "bump":
        centre, width = shown(constants["centre"]), shown(2.0 * constants["width"])
        return f" where {name} is about {centre} (to some {width} either side)"
    if term.shape == "periodic":
        return f" in a wave over {name} with a period of {shown(constants['period'])}"
    return _threshold_words(term, name, shown)


def _slope_words(term: Term, name: str, shown: Callable[[float], str], signed: bool) -> str:
    """A straight line or a power of a variable, in words."""
    constants = term.constants
    if "power" in constants:
        fading = "less" if constants["power"] < 0.0 else "more"
        reference = shown(constants["reference"])
        return f", {fading} with {name} (power {constants['power']:.2g}, the size given at {reference})"
    start, end = shown(constants["start"]), shown(constants["end"])
    if signed:
        return f" in a straight line with {name}, nothing at {start} and in full at {end}"
    side = "above" if constants["end"] > constants["start"] else "below"
    return f" where {name} is {side} {start}, in full at {end}"


def _threshold_words(term: Term, name: str, shown: Callable[[float], str]) -> str:
    """A step, a line from a value on, or what friction holds, in words."""
    constants = term.constants
    if "from" in constants:
        side = "above" if constants["end"] > constants["from"] else "below"
        return f" where {name} is {side} {shown(constants['from'])}, in full at {shown(constants['end'])}"
    if "within" in constants:
        return f" until {name} reaches {shown(constants['within'])}, and no further"
    if "beyond" in constants:
        return f" as far as {name} is above {shown(constants['beyond'])}, which friction holds"
    return f" where {name} is {'above' if constants['side'] > 0.0 else 'below'} {shown(constants['edge'])}"


def size_words(sized: Sized) -> str:
    """Size with its interval and the change that it makes: "9.1 nm/N (8 to 10), 6 % of stiffness in the mean"."""
    si = sized.term.si
    low, high = (f"{float(f'{end / si:.3g}'):g}" for end in sized.interval)
    return (
        f"{float(f'{sized.term.size / si:.3g}'):g} {sized.term.unit} ({low} to {high}), "
        f"{100.0 * sized.rms:.2g} % of stiffness (rms)"
    )


def portrait_text(portrait: Portrait) -> str:
    """One paragraph: what is missing as far as the data support it, and what else would look the same."""
    if not portrait.terms:
        return (
            "No description: no single link and variable stands out from what chance would do among all that were "
            f"searched (p = {portrait.look_elsewhere:.2g})."
        )
    first, *others = portrait.terms
    parts = [f"What is missing looks like this: {term_words(first.term)}; {size_words(first)}."]
    if others:
        parts.append(f"Beside it: {'; '.join(f'{term_words(sized.term)}, {size_words(sized)}' for sized in others)}.")
    parts.append(
        f"This takes {100.0 * portrait.explained:.0f} % of the misfit; rms error at points left out "
        f"{100.0 * portrait.held_out_rms:.2f} % (noise alone {100.0 * portrait.noise_floor:.2f} %, a smooth unknown "
        f"{100.0 * portrait.smooth_rms:.2f} %)."
    )
    parts.append(_sets(portrait))
    if portrait.alike:
        alike = [f"{term_words(sized.term)} ({100.0 * (sized.probability or 0.0):.0f} %)" for sized in portrait.alike]
        parts.append(f"The same would be seen if {'; or if '.join(alike)}.")
    return " ".join(parts)


def _sets(portrait: Portrait) -> str:
    """Which links and variables the data leave."""
    links = _named(portrait.links)
    variables = _named(portrait.variables)
    if not portrait.links:
        return f"Which link it is cannot be told; it varies with {variables}."
    return f"Link: {links}; varies with: {variables}."


def _named(names: Sequence[tuple[str, float]]) -> str:
    return joined([f"{name} ({100.0 * weight:.0f} %)" for name, weight in names]).replace(" and ", " or ")


def alike_text(name: str, alike: Alike) -> str:
    """What else would look the same as a named effect."""
    terms = "; or if ".join(term_words(term) for term, _ in alike.terms[:MOST_SAID])
    links = joined([link for link, _ in alike.links]).replace(" and ", " or ")
    return f"These readings fit as well, without {name}, if {terms}. By link: {links}."


def variable_label(term: Term) -> tuple[str, float]:
    """Of an axis: what a term varies with and its unit, and the SI value of that unit."""
    name, si, unit = SAID.get(term.variable, (term.variable, 1.0, ""))
    return (f"{name}, {unit}" if unit else name), si
