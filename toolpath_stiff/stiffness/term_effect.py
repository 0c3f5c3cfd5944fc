"""Effects made of terms, each with a size of its own: what the portrait computes with and what an effect file holds."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter
from toolpath_stiff.stiffness.effects.joint_moment_stiffness import end_rotations
from toolpath_stiff.stiffness.term_loads import carriers, coupled, pair_stiffness, reading_share, strut_share
from toolpath_stiff.stiffness.terms import ACTIONS, AXES, IN_SERIES, OF_FORCES, Term, formula, shaped

ASSUMED = "described from readings; usual sizes are engineering experience, no source"

LEAST_STRUT = 0.8  # share of its own compliance that a strut may lose at most, so that it keeps some

MOST_COUPLED = 0.9  # of the mean of both compliances: beyond 1 the pair has none left

LEAST_READ = 0.05  # of the deflection: less is never read

NEEDS = {
    "load": "force_N",
    "strut force": "force_N",
    "time": "time_min",
    "temperature": "temperature_C",
    "setup": "setup",
}

CATALOGUE_LINKS = {"one strut": "struts"}


def size_parameter(action: str, size: str, meaning: str) -> Parameter:
    """The parameter that a term's size is, with bounds and usual sizes of its action."""
    unit, si, bounds, typical, _ = ACTIONS[action]
    return Parameter(size, unit, si, bounds, typical, ASSUMED, meaning=meaning)


class TermEffect(Effect):
    """Terms that act together, by the name of the size of each; of one of the kinds below.

    Attributes
    ----------
    terms
        Name of a size -> term.
    file
        The file that says so; "" without one.
    """

    ending = ""  # of its name, beside effects of other kinds in one file

    def __init__(
        self,
        name: str,
        entries: Sequence[tuple[Term, Parameter]],
        source: str = ASSUMED,
        described_from: tuple[str, ...] = (),
        file: str = "",
    ) -> None:
        self.name, self.source, self.described_from, self.file = name, source, described_from, file
        terms = [term for term, _ in entries]
        self.parameters = tuple(parameter for _, parameter in entries)
        self.terms = {parameter.name: term for term, parameter in entries}
        self.title = "; ".join(parameter.meaning for parameter in self.parameters)
        link = terms[0].link
        self.link = "geometry" if terms[0].action == "joint offset" else CATALOGUE_LINKS.get(link, link)
        self.equation = "; ".join(formula(term, size) for size, term in self.terms.items())
        self.needs = tuple(dict.fromkeys(need for term in terms for need in _needs(term)))
        self.load_dependent = any(not set(OF_FORCES).isdisjoint(term.variables) for term in terms)

    def _shares(self, path: LoadPath, p: Mapping[str, float], *actions: str) -> Iterator[tuple[Term, float]]:
        """Terms of these actions that the poses say enough for, each with its size."""
        known = {"time": path.time, "temperature": path.temperature, "setup": path.setup}
        known |= dict.fromkeys(OF_FORCES, path.strut_forces)
        for size, term in self.terms.items():
            if term.action in actions and all(known.get(name, path) is not None for name in term.variables):
                yield term, p[size]


class TermsOfParts(TermEffect):
    """Terms of parts that give way, or resist."""

    def load_compliance(self, path: LoadPath, p: Mapping[str, float]) -> FloatArray | None:
        """Quadratic form of strut forces and tip wrench; a pair coupled by all that it has would have no stiffness."""
        forms = []
        for term, size in self._shares(path, p, "give", "rocking", "tilting", "vertex"):
            rows = carriers(term.link, term.action, term.direction, term.where, path)
            forms.append((size * shaped(term, path))[:, None, None] * np.einsum("nki,nkj->nij", rows, rows))
        for term, size in self._shares(path, p, "coupling"):
            first, second = coupled(term)
            form = np.zeros((len(path), 12, 12))
            share = np.clip(size * shaped(term, path), -MOST_COUPLED, MOST_COUPLED) / pair_stiffness(term, path)
            form[:, first, second] = form[:, second, first] = share
            forms.append(form)
        return np.asarray(sum(forms[1:], start=forms[0])) if forms else None

    def strut_compliance(self, path: LoadPath, p: Mapping[str, float]) -> FloatArray | None:
        """In series with each strut."""
        added = []
        for term, size in self._shares(path, p, *IN_SERIES):
            compliance = size * strut_share(term, path)
            if term.action == "strut factor":
                least = -LEAST_STRUT / path.machine.strut_law.stiffness(path.struts.lengths)
                compliance = np.maximum(compliance, least)
            added.append(compliance)
        return np.asarray(sum(added[1:], start=added[0])) if added else None

    def parallel_stiffness(self, path: LoadPath, p: Mapping[str, float]) -> FloatArray | None:
        """Rotational springs at both ends of each strut."""
        weights = [size * strut_share(term, path) for term, size in self._shares(path, p, "turning") if size]
        if not weights:
            return None
        rotations = end_rotations(path)
        flat = (len(path), 36, 6)
        weighted = sum(weights[1:], start=weights[0])[:, :, None, None] * rotations
        return np.asarray(np.swapaxes(rotations.reshape(flat), 1, 2) @ weighted.reshape(flat))


class TermsOfGeometry(TermEffect):
    """Joints off their places."""

    ending = "_geometry"
    unknown_to_control = True

    def geometry(self, machine: Hexapod, p: Mapping[str, float]) -> Hexapod:
        """With these joints off their places."""
        for size, term in self.terms.items():
            name = f"{term.column}_joints"
            joints = np.array(getattr(machine, name))
            assert term.where is not None
            joints[term.where - 1, AXES[term.direction]] += p[size]
            machine = machine.with_changes(**{name: joints})
        return machine


class TermsOfReadings(TermEffect):
    """Readings that are off."""

    ending = "_reading"

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Mapping[str, float]) -> FloatArray:
        """Force over the deflection as read."""
        for term, size in self._shares(path, p, "reading factor", "reading shift"):
            off = size * reading_share(term, path)
            factor = 1.0 + (off if term.action == "reading factor" else off * stiffness / path.force)
            stiffness = stiffness / np.maximum(factor, LEAST_READ)
        return stiffness


KINDS = {"joint offset": TermsOfGeometry, "reading factor": TermsOfReadings, "reading shift": TermsOfReadings}


def kind_of(term: Term) -> type[TermEffect]:
    """The class of effects to which a term belongs."""
    return KINDS.get(term.action, TermsOfParts)


def effect_of(term: Term) -> TermEffect:
    """A term as an effect of one parameter, `size`.

    Raises
    ------
    ValueError
        No effect can see the term's variable (`Term.acts`).

    Examples
    --------
    >>> tip = Term("table", "Y", "y", "slope", "give", at=(("start", -0.4), ("end", 0.4)))
    >>> effect_of(tip).parameters[0].key
    'size_nm_per_N'
    """
    if not term.acts:
        raise ValueError(f"no effect sees the variable {' times '.join(term.variables)!r}")
    entry = (term, size_parameter(term.action, "size", f"size of {term.key}"))
    return kind_of(term)(f"term: {term.key}", [entry])


def _needs(term: Term) -> list[str]:
    """Columns of the measurements without which a term cannot be tested."""
    needs = [NEEDS[name] for name in term.variables if name in NEEDS]
    if kind_of(term) is TermsOfReadings:
        needs += ["direction"] if term.direction in AXES else []
        needs += ["force_N"] if term.action == "reading shift" else []
    return needs
