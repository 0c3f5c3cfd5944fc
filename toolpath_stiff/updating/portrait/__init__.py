"""A portrait of what is missing: which link of the load path, along what, with what it varies, how large.

Where no effect of the catalogue explains the readings, or where the best explanation leaves something, one to three
terms of a dictionary of machine mechanics (`dictionary`, `terms`) are chosen (`selection`) and put in words.
What else would look the same is said by probabilities over the whole dictionary, summed by link and by variable.

The yardstick of a description is what a smooth unknown one reaches at points that it has not seen: the discrepancy as a
Gaussian process with one of the forms of covariance of `inference.gates` (Kennedy and O'Hagan 2001, Bayesian
calibration of computer models), its amplitude the likeliest; left-out points in closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.effects.contract import joined
from toolpath_stiff.units import RAD_PER_DEG, json_number
from toolpath_stiff.updating.inference.covariances import Groups
from toolpath_stiff.updating.inference.evidence import Fit, Problem
from toolpath_stiff.updating.inference.fits import held_out
from toolpath_stiff.updating.inference.gates import POINT_TO_POINT, Simulator, discrepancy_forms
from toolpath_stiff.updating.inference.hypotheses import AMPLITUDES
from toolpath_stiff.updating.inference.noise import Noise
from toolpath_stiff.updating.inference.prediction import Predictor
from toolpath_stiff.updating.portrait.choice import Alike, Chosen, choose
from toolpath_stiff.updating.portrait.dictionary import Ground
from toolpath_stiff.updating.portrait.selection import Description, Selection, law_prior
from toolpath_stiff.updating.portrait.terms import PINS, SWINGS, Term

HELD = 0.90  # probability that a set of links or variables adds up to
MOST_LINKS, MOST_VARIABLES, MOST_ALIKE = 4, 3, 4
SHOWN = 0.03  # probability from which another term is told
FLOOR_DRAWS = 40
MOST_SEARCHED = 1000  # readings on which the dictionary is searched: more tell no more of which term to fit
GENERAL = ("smooth over the workspace, different by direction", "linear over the workspace, different by direction")

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


@dataclass(frozen=True)
class Sized:
    """A term with its size (SI), its 95 % interval, the rms change of stiffness that it makes, and its probability."""

    term: Term
    interval: tuple[float, float]
    rms: float
    probability: float | None = None


@dataclass(frozen=True)
class Portrait:
    """What the readings say of what is missing.

    Attributes
    ----------
    terms
        One to three, the leading one first; none where nothing stands out from chance.
    links, variables
        Name -> probability, the likeliest first, the fewest that hold 90 %; empty where more than four links would be
        needed.
    alike
        Other leading terms that fit as well.
    explained
        Share of the weighted squares above noise that the terms take.
    error, held_out_rms, noise_floor, smooth_rms
        Mean error with the terms; rms error at left-out points; what noise alone leaves there; what a smooth
        description reaches.
    look_elsewhere
        How often the best of the whole dictionary gains as much by chance.
    before, after, signature
        (n,) residuals of the base and with the terms; change of ln stiffness by the leading term.
    values
        (n,) of the leading term's variable, SI; None where each strut has its own, or it is constant.
    """

    terms: tuple[Sized, ...] = ()
    links: tuple[tuple[str, float], ...] = ()
    variables: tuple[tuple[str, float], ...] = ()
    alike: tuple[Sized, ...] = ()
    explained: float = 0.0
    error: float = np.nan
    held_out_rms: float = np.nan
    noise_floor: float = np.nan
    smooth_rms: float = np.nan
    look_elsewhere: float = 1.0
    before: FloatArray | None = None
    after: FloatArray | None = None
    signature: FloatArray | None = None
    values: FloatArray | None = None


def draw_portrait(problem: Problem, base: Fit, noise: Noise, seed: int, form: str = "") -> Portrait:
    """Describe what a fit leaves.

    Parameters
    ----------
    problem, noise
        Readings, model and scatter; the noise model behind the scatter.
    base
        The fit that leaves something: the model with its strut law refitted, or the best explanation.
    seed
        Of the simulated campaigns.
    form
        The form of discrepancy that stands out most, in words, for the yardstick.
    """
    selection = Selection(problem, base, noise, seed)
    start = selection.start
    if len(base.residual) > MOST_SEARCHED:
        chosen, chance = _chosen_from_fewer(selection)
    else:
        chosen, chance = choose(selection)
    points = problem.predictor.data.point
    smooth = smooth_rms(problem, start.fit, form)
    if chosen is None:
        return Portrait(
            look_elsewhere=chance, smooth_rms=smooth, error=float(start.fit.errors.mean()),
            held_out_rms=held_out(start.fit, points).rms, noise_floor=noise_floor(selection, start),
            before=base.residual, after=start.fit.residual,
        )  # fmt: skip
    found = chosen.description
    leading = found.terms[0]
    values = selection.ground.values(leading.variable, leading.column)
    return Portrait(
        terms=tuple(_sized(selection.ground, found, k) for k in range(len(found.terms))),
        links=_honest(chosen.weighed.summed(lambda term: term.link), MOST_LINKS),
        variables=_honest(chosen.weighed.summed(lambda term: term.variable), MOST_VARIABLES, cut=True),
        alike=_alike(selection, chosen),
        explained=_explained(selection, start, found),
        error=float(found.fit.errors.mean()),
        held_out_rms=chosen.held.rms,
        noise_floor=noise_floor(selection, found),
        smooth_rms=smooth,
        look_elsewhere=chosen.chance,
        before=start.fit.residual,
        after=found.fit.residual,
        signature=-np.log1p(np.maximum(leading.size * selection.ground.column(leading) / selection.compliance, -0.9)),
        values=None if values.ndim == 2 or leading.variable in ("constant", "direction") else values,
    )


def _chosen_from_fewer(whole: Selection) -> tuple[Chosen | None, float]:
    """The search on readings spread over the campaign, what it has chosen fitted to all."""
    base, noise = whole.base, whole.noise
    rows = np.unique(np.linspace(0, len(base.residual) - 1, MOST_SEARCHED).round().astype(np.int64))
    full = whole.problem.predictor
    predictor = Predictor(full.machine, full.data.select(rows), full.effect_files)
    problem = Problem.of(predictor, noise.select(rows))
    residual = base.residual[rows]
    scatter = problem.scatter.with_wild(residual)
    fewer = replace(base, residual=residual, jacobian=base.jacobian[rows], scatter=scatter)
    chosen, chance = choose(Selection(problem, fewer, noise.select(rows), whole.seed))
    if chosen is None:
        return None, chance
    found = whole.start
    for term in chosen.description.terms:
        found = whole.extended(found, term)
    return replace(chosen, description=found, held=held_out(found.fit, full.data.point)), chance


def _sized(ground: Ground, description: Description, k: int, probability: float | None = None) -> Sized:
    term, deviation = description.terms[k], float(description.deviations[k])
    low, high = (bound * term.si for bound in term.bounds)
    reach = defaults.NORMAL_95 * deviation
    interval = max(term.size - reach, low), min(term.size + reach, high)
    return Sized(term, interval, abs(term.size) * float(description.scale[k]), probability)


def _honest(summed: Sequence[tuple[str, float]], most: int, cut: bool = False) -> tuple[tuple[str, float], ...]:
    """The fewest that hold `HELD`; where that takes more than `most`, none, or the first ones if `cut`."""
    found: list[tuple[str, float]] = []
    for name, weight in summed:
        found.append((name, weight))
        if sum(w for _, w in found) >= HELD:
            break
    if len(found) > most:
        return tuple(found[:most]) if cut else ()
    return tuple(found)


def _alike(selection: Selection, chosen: Chosen) -> tuple[Sized, ...]:
    """Other terms in the place of the leading one, the best of each link, place, direction and variable."""
    found = chosen.description
    others = selection.scattered(selection.without(found, 0), found)
    seen = {_kind(found.terms[0])}
    alike: list[Sized] = []
    weighed = chosen.weighed
    for term, weight, here in zip(weighed.terms, weighed.weights.tolist(), weighed.chosen.tolist(), strict=True):
        if weight < SHOWN or len(alike) == MOST_ALIKE:
            break
        if not here or _kind(term) in seen:
            continue
        seen.add(_kind(term))
        fitted = selection.extended(others, term)
        if fitted.terms[-1].size:
            alike.append(_sized(selection.ground, fitted, len(fitted.terms) - 1, weight))
    return tuple(alike)


def _kind(term: Term) -> tuple[object, ...]:
    return term.link, term.where, term.direction, term.variable


def _explained(selection: Selection, start: Description, found: Description) -> float:
    """Under the scatter of the description, so that wild readings count alike."""
    precision, free = found.fit.scatter.precision, len(selection.compliance) - 2
    fixed = selection.described((), start.columns, start.scale, start.fit.law, found.fit.scatter)
    before, after = (float(precision.squares(one.fit.residual)) for one in (fixed, found))
    return float(np.clip((before - after) / max(before - free, 1e-9), 0.0, 1.0)) if before > after else 0.0


def noise_floor(selection: Selection, description: Description) -> float:
    """Rms at left-out points that noise alone leaves: simulated campaigns through the same fit."""
    draws = Simulator.of(selection.noise, selection.problem.scatter.covariance, selection.seed, FLOOR_DRAWS).draws
    jacobian, precision = description.fit.jacobian, description.fit.scatter.precision
    weighted = precision.times(jacobian.T)
    inverse = np.linalg.pinv(weighted @ jacobian + law_prior(description.fit), hermitian=True)
    points = selection.problem.predictor.data.point
    squares = []
    for draw in draws:
        moved = inverse @ (weighted @ draw)
        fit = replace(description.fit, residual=draw - jacobian @ moved, law=moved[:2])
        squares.append(float(np.mean(held_out(fit, points).residual ** 2)))
    return float(np.sqrt(np.mean(squares)))


def smooth_rms(problem: Problem, fit: Fit, form: str) -> float:
    """Rms of (modelled - measured) / measured at left-out points; nan with too few points.

    Of the likeliest form: `form`, the one that stands out most, in words, or what is smooth over the workspace.
    """
    points = Groups.by(problem.predictor.data.point)
    if points.count < 3:
        return float("nan")
    precision = fit.scatter.precision.beside(fit.jacobian.T, law_prior(fit))
    best: tuple[float, FloatArray, float] | None = None
    pull = precision.times(fit.residual)
    forms = discrepancy_forms(problem.predictor)
    for words in dict.fromkeys((form, *GENERAL)):
        if words not in forms or words == POINT_TO_POINT:  # of which nothing is known from another point
            continue
        features = forms[words]
        inner = precision.times(features.T) @ features
        own, turn = np.linalg.eigh(inner)
        turned = (turn.T @ (features.T @ pull)) ** 2
        squared = AMPLITUDES[:, None] ** 2 * np.maximum(own, 0.0)
        gains = 0.5 * (AMPLITUDES[:, None] ** 2 * turned / (1.0 + squared) - np.log1p(squared)).sum(axis=1)
        at = int(np.argmax(gains))
        if best is None or gains[at] > best[0]:
            best = float(gains[at]), features, float(AMPLITUDES[at])
    if best is None:
        return float("nan")
    _, features, amplitude = best
    whole = precision.beside(amplitude * features.T, np.eye(features.shape[1]))
    pulls, residual = whole.times(fit.residual), np.zeros(len(fit.residual))
    for out in points.members():
        residual[out] = np.linalg.solve(whole.block(out), pulls[out])
    return float(np.sqrt(np.mean(np.expm1(-residual) ** 2)))


def term_words(term: Term) -> str:
    """What gives way and what it varies with: a clause, without its size."""
    said = f"{_cause(term)}{_with(term, len(term.signs) > 1)}"
    if term.second is None:
        return said
    return f"{said}, and this {_with(term.second, signed=False).removeprefix(',').strip()}"


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
        own = {"X": "along the platform's X", "Y": "along the platform's Y", "radial": "across the tool axis"}
        along = own.get(term.direction, along)
    return f"the {term.link} gives way {along}"


def _with(term: Term, signed: bool) -> str:
    """What it varies with and how, after its cause; `signed`: to both sides."""
    if term.variable in ("constant", "direction"):
        return ""
    if term.variable == "setup":
        return f" in set-up {term.column}"
    if term.variable == "force sign":
        return " in tension" if term.constants["side"] > 0.0 else " in compression"
    at = term.constants
    name, si, unit = SAID.get(term.variable, (term.variable, 1.0, ""))
    if term.variable == "tilt" and term.column:
        name = f"the swing of the {term.column}s" if term.column in SWINGS else f"the lean towards {term.column}"

    def shown(value: float) -> str:
        return f"{float(f'{value / si:.3g}'):g} {unit}".rstrip()

    if term.shape == "slope":
        return _slope_words(term, name, shown, signed)
    if term.shape == "square":
        return f", with the square of {name} from {shown(at['centre'])}, in full {shown(at['reach'])} from there"
    if term.shape == "bump":
        return f" where {name} is about {shown(at['centre'])} (to some {shown(2.0 * at['width'])} either side)"
    if term.shape == "periodic":
        return f" in a wave over {name} with a period of {shown(at['period'])}"
    return _threshold_words(term, name, shown)


def _slope_words(term: Term, name: str, shown: Callable[[float], str], signed: bool) -> str:
    """A straight line or a power of a variable, in words."""
    at = term.constants
    if "power" in at:
        fading = "less" if at["power"] < 0.0 else "more"
        return f", {fading} with {name} (power {at['power']:.2g}, the size given at {shown(at['reference'])})"
    if signed:
        return f" in a straight line with {name}, nothing at {shown(at['start'])} and in full at {shown(at['end'])}"
    side = "above" if at["end"] > at["start"] else "below"
    return f" where {name} is {side} {shown(at['start'])}, in full at {shown(at['end'])}"


def _threshold_words(term: Term, name: str, shown: Callable[[float], str]) -> str:
    """A step, a line from a value on, or what friction holds, in words."""
    at = term.constants
    if "from" in at:
        side = "above" if at["end"] > at["from"] else "below"
        return f" where {name} is {side} {shown(at['from'])}, in full at {shown(at['end'])}"
    if "within" in at:
        return f" until {name} reaches {shown(at['within'])}, and no further"
    if "beyond" in at:
        return f" as far as {name} is above {shown(at['beyond'])}, which friction holds"
    return f" where {name} is {'above' if at['side'] > 0.0 else 'below'} {shown(at['edge'])}"


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
        parts.append(f"Beside it: {'; '.join(f'{term_words(one.term)}, {size_words(one)}' for one in others)}.")
    parts.append(
        f"This takes {100.0 * portrait.explained:.0f} % of the misfit; rms error at points left out "
        f"{100.0 * portrait.held_out_rms:.2f} % (noise alone {100.0 * portrait.noise_floor:.2f} %, a smooth unknown "
        f"{100.0 * portrait.smooth_rms:.2f} %)."
    )
    parts.append(_sets(portrait))
    if portrait.alike:
        alike = [f"{term_words(one.term)} ({100.0 * (one.probability or 0.0):.0f} %)" for one in portrait.alike]
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
    told = "; or if ".join(term_words(term) for term, _ in alike.terms[:MOST_SAID])
    links = joined([link for link, _ in alike.links]).replace(" and ", " or ")
    return f"These readings fit as well, without {name}, if {told}. By link: {links}."


def variable_label(term: Term) -> tuple[str, float]:
    """Of an axis: what a term varies with and its unit, and the SI value of that unit."""
    name, si, unit = SAID.get(term.variable, (term.variable, 1.0, ""))
    return (f"{name}, {unit}" if unit else name), si


class LinkEntry(TypedDict):
    """A link of the load path and its probability."""

    link: str
    probability: float | None


class VariableEntry(TypedDict):
    """What the missing thing varies with, and its probability."""

    variable: str
    probability: float | None


class SizedTermEntry(TypedDict):
    """A term of the dictionary with its size; `where` is a strut or a vertex, `second_variable` null without one."""

    link: str
    where: int | None
    direction: str
    variable: str
    second_variable: str | None
    shape: str
    size: float | None
    unit: str


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


def _of_term(term: Term) -> SizedTermEntry:
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


def _term(sized: Sized) -> TermEntry:
    term = sized.term
    return {
        **_of_term(term),
        "interval": [json_number(float(end)) for end in np.array(sized.interval) / term.si],
        "rms_percent": json_number(100.0 * sized.rms, 3),
        "words": term_words(term),
    }
