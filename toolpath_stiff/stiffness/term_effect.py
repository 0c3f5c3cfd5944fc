"""Effects made of terms, each with its own size: for the portrait's computations and for effect files.

What terms do per unit of their sizes: loads of links, compliances of struts, errors of readings.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter, Values
from toolpath_stiff.stiffness.effects.frame_compliance import frame_vertices
from toolpath_stiff.stiffness.effects.joint_moment_stiffness import end_rotations
from toolpath_stiff.stiffness.terms import (
    ASSUMED,
    AXES,
    IN_SERIES,
    OF_FORCES,
    PINS,
    SEEN,
    SIZES,
    Term,
    formula,
    shaped,
    variable_values,
)

LEAST_STRUT = 0.8  # largest share of its own compliance that a strut may lose
MOST_COUPLED = 0.9  # of the mean of both compliances: at 1 the pair would have none left
LEAST_READ = 0.05  # of the deflection: less is never read
NEEDS = {
    "load": "force_N",
    "strut force": "force_N",
    "time": "time_min",
    "temperature": "temperature_C",
    "setup": "setup",
}
CATALOGUE_LINKS = {"one strut": "struts"}
# Terms of geometry and of readings form effects separate from those of parts that give way or resist: action
# -> what is added to the name; that -> hooks.
ENDINGS = {"joint offset": "_geometry", "reading factor": "_reading", "reading shift": "_reading"}
HOOKS_OF = {
    "": ("strut_compliance", "load_compliance", "parallel_stiffness"),
    "_geometry": ("geometry",),
    "_reading": ("reading",),
}


def size_parameter(action: str, size: str, meaning: str) -> Parameter:
    """Parameter for a term's size, with bounds and usual sizes of its action."""
    return replace(SIZES[action], name=size, meaning=meaning)


class TermEffect(Effect):
    """Terms with the same ending that act together, by the name of each one's size.

    Attributes
    ----------
    terms
        Name of a size -> term.
    file
        The file that says so; "" without one.
    """

    def __init__(
        self,
        name: str,
        entries: Sequence[tuple[Term, Parameter]],
        source: str = ASSUMED,
        described_from: tuple[str, ...] = (),
        file: str = "",
    ) -> None:
        self.name, self.source, self.described_from, self.file = name, source, described_from, file
        self.parameters = tuple(parameter for _, parameter in entries)
        self.terms = {parameter.name: term for term, parameter in entries}
        self.title = "; ".join(parameter.meaning for parameter in self.parameters)
        self.equation = "; ".join(formula(term, size) for size, term in self.terms.items())
        first, *_ = terms = list(self.terms.values())
        self.ending = ENDINGS.get(first.action, "")
        self.unknown_to_control = self.ending == "_geometry"
        self.link = "geometry" if self.unknown_to_control else CATALOGUE_LINKS.get(first.link, first.link)
        self.needs = tuple(dict.fromkeys(need for term in terms for need in _needs(term)))
        self.load_dependent = any(not set(OF_FORCES).isdisjoint(term.variables) for term in terms)

    @property
    def hooks(self) -> list[str]:
        """Hooks of its ending."""
        return list(HOOKS_OF[self.ending])

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form in strut forces and tip wrench; full coupling would leave a pair without stiffness."""
        forms = []
        for term, size in self._sizes(path, p, "give", "rocking", "tilting", "vertex"):
            rows = carriers(term, path)
            forms.append((size * shaped_at(term, path))[:, None, None] * np.einsum("nki,nkj->nij", rows, rows))
        for term, size in self._sizes(path, p, "coupling"):
            first, second = coupled(term)
            form = np.zeros((len(path), 12, 12))
            share = np.clip(size * shaped_at(term, path), -MOST_COUPLED, MOST_COUPLED) / pair_stiffness(term, path)
            form[:, first, second] = form[:, second, first] = share
            forms.append(form)
        return np.sum(forms, axis=0) if forms else None

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Compliance in series with each strut."""
        added = []
        for term, size in self._sizes(path, p, *IN_SERIES):
            law = path.machine.strut_law.stiffness(path.struts.lengths)
            least = -LEAST_STRUT / law if term.action == "strut factor" else -np.inf
            added.append(np.maximum(size * strut_share(term, path), least))
        return np.sum(added, axis=0) if added else None

    def parallel_stiffness(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Rotational springs at both ends of each strut, and springs from the platform to the ground."""
        springs = [
            spring_stiffness(term, path, size * shaped_at(term, path))
            for term, size in self._sizes(path, p, "spring")
            if size
        ]
        weights = [size * strut_share(term, path) for term, size in self._sizes(path, p, "turning") if size]
        if not weights:
            return np.sum(springs, axis=0) if springs else None
        rotations, flat = end_rotations(path), (len(path), 36, 6)
        weighted = np.sum(weights, axis=0)[:, :, None, None] * rotations
        turning = np.swapaxes(rotations.reshape(flat), 1, 2) @ weighted.reshape(flat)
        return np.asarray(np.sum([turning, *springs], axis=0))

    def geometry(self, machine: Hexapod, p: Values) -> Hexapod:
        """The machine with joints displaced."""
        for size, term in self.terms.items():
            if term.action == "joint offset" and term.where is not None:
                name = f"{term.column}_joints"
                joints = np.array(getattr(machine, name))
                joints[term.where - 1, AXES[term.direction]] += p[size]
                machine = machine.with_changes(**{name: joints})
        return machine

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """Force over the deflection as read."""
        for term, size in self._sizes(path, p, "reading factor", "reading shift"):
            off = size * reading_share(term, path)
            factor = 1.0 + (off if term.action == "reading factor" else off * stiffness / path.force)
            stiffness = stiffness / np.maximum(factor, LEAST_READ)
        return stiffness

    def _sizes(self, path: LoadPath, p: Values, *actions: str) -> Iterator[tuple[Term, float]]:
        """Terms of these actions, each with its size, for which the poses state enough."""
        for size, term in self.terms.items():
            if term.action in actions and all(SEEN[name](path, "") is not None for name in term.variables):
                yield term, p[size]


def _needs(term: Term) -> list[str]:
    """Columns of the measurements without which a term cannot be tested."""
    needs = [NEEDS[name] for name in term.variables if name in NEEDS]
    needs += ["direction"] if term.link == "instrument" and term.direction in AXES else []
    return [*needs, "force_N"] if term.action == "reading shift" else needs


def shaped_at(term: Term, path: LoadPath) -> FloatArray:
    """s(v) of a term at n poses, (n,) or (n, 6)."""
    return shaped(term, lambda variable, column: variable_values(variable, path, column))


def carriers(term: Term, path: LoadPath) -> FloatArray:
    """(n, k, 12) vectors h: the link's generalised forces are h . [f; w] under strut forces f and the tip's wrench w.

    The compliance along a load is the sum of their squares times that of the link.
    """
    if term.action == "vertex":
        return _vertex_carriers(term, path)
    axes = _axes(term, path)
    rows = np.zeros((len(path), axes.shape[1], 12))
    rows[:, :, 6:9] = axes
    return rows


def _axes(term: Term, path: LoadPath) -> FloatArray:
    """(n, k, 3) vectors a: the link's generalised forces are a . F under the tip force F."""
    n, direction = len(path), term.direction
    if term.link in ("tool", "platform"):
        columns = {"axial": [2], "radial": [0, 1], "all": [0, 1, 2]}.get(direction) or [AXES[direction]]
        axes = np.swapaxes(path.rotation, 1, 2)[:, columns]  # rows R e
        if term.action == "tilting":  # (lever x F) . (R e_z x R e) = F . ((R e_z x R e) x lever)
            about = np.cross(path.rotation[:, None, :, 2], axes)
            return np.cross(about, -path.struts.arms.mean(axis=1)[:, None])
        return axes
    x, y, z = path.position.T
    none = np.zeros(n)
    if term.action == "rocking":  # moments of F at p about Y, X and Z
        of = {"X": (z, none, -x), "Y": (none, z, -y), "tangential": (-y, x, none)}
        chosen = ("X", "Y") if direction == "all" else (direction,)
        return np.stack([np.stack(of[axis], axis=1) for axis in chosen], axis=1)
    if direction in ("radial", "tangential"):
        ends = (x, y, none) if direction == "radial" else (-y, x, none)
        return np.asarray((np.stack(ends, axis=1) / np.maximum(np.hypot(x, y), 1e-9)[:, None])[:, None])
    columns = {"all": [0, 1, 2], "horizontal": [0, 1]}.get(direction) or [AXES[direction]]
    return np.broadcast_to(np.eye(3)[columns], (n, len(columns), 3))


def _vertex_carriers(term: Term, path: LoadPath) -> FloatArray:
    """(n, k, 12) vectors for vertices of frame or platform: the force of two struts along the vertex's own axes."""
    joints = path.machine.frame_joints if term.link == "frame" else path.machine.platform_joints
    carried = []
    for number, (pair, outward) in enumerate(frame_vertices(joints), start=1):
        if term.where not in (None, number):
            continue
        row = np.zeros((len(path), 12))
        if term.direction == "along the struts":  # the force that both carry together
            row[:, pair] = 1.0
        else:
            across, upright = np.array([-outward[1], outward[0], 0.0]), np.array([0.0, 0.0, 1.0])
            along = {"radial": outward, "tangential": across, "Z": upright, "axial": upright}[term.direction]
            axis = np.broadcast_to(along, (len(path), 3)) if term.link == "frame" else path.rotation @ along
            row[:, pair] = np.einsum("nij,nj->ni", path.struts.directions[:, pair], axis)
        carried.append(row)
    return np.stack(carried, axis=1)


def along_pins(term: Term, path: LoadPath) -> FloatArray:
    """(n, 6) share of each strut's force along the pin of its joint."""
    joints = path.machine.frame_joints if term.action == "frame pin" else path.machine.platform_joints
    x, y = joints[:, :2].T / np.linalg.norm(joints[:, :2], axis=1)
    pins = np.stack([x, y, 0.0 * x] if term.direction == "radial" else [-y, x, 0.0 * x], axis=1)
    turned = pins if term.action == "frame pin" else pins @ np.swapaxes(path.rotation, 1, 2)
    return np.asarray((path.struts.directions * turned).sum(axis=-1))


def strut_share(term: Term, path: LoadPath) -> FloatArray:
    """(n, 6) per unit of a size, for each strut: compliance in series with it, or stiffness for `turning`."""
    shape = shaped_at(term, path)
    each = np.array(np.broadcast_to(shape[:, None] if shape.ndim == 1 else shape, (len(path), 6)), dtype=float)
    if term.where is not None:
        each[:, np.arange(6) != term.where - 1] = 0.0
    if term.action == "strut factor":
        each = np.asarray(each / path.machine.strut_law.stiffness(path.struts.lengths))
    return np.asarray(each * along_pins(term, path) ** 2) if term.action in PINS else each


def spring_rows(term: Term, path: LoadPath) -> FloatArray:
    """(n, k, 6) motion of the middle of the platform joints along a `spring` for a twist of the tip."""
    axes = np.eye(3)[{"all": [0, 1, 2], "horizontal": [0, 1]}.get(term.direction) or [AXES[term.direction]]]
    lever = np.cross(path.struts.arms.mean(axis=1)[:, None], axes)
    return np.concatenate([np.broadcast_to(axes, lever.shape), lever], axis=2)


def spring_stiffness(term: Term, path: LoadPath, stiffness: FloatArray) -> FloatArray:
    """(n, 6, 6) stiffness about the tip of springs of stiffness (n,) N/m."""
    rows = spring_rows(term, path)
    return np.asarray(stiffness[:, None, None] * (np.swapaxes(rows, 1, 2) @ rows))


def coupled(term: Term) -> tuple[int, int]:
    """Indices (from 0) of the struts of a `coupling`."""
    return int(term.constants["first"]) - 1, int(term.constants["second"]) - 1


def pair_stiffness(term: Term, path: LoadPath) -> FloatArray:
    """(n,) N/m, geometric mean of the stiffnesses of the struts of a `coupling`."""
    pair = path.machine.strut_law.stiffness(path.struts.lengths[:, coupled(term)])
    return np.asarray(np.sqrt(pair.prod(axis=1)))


def reading_share(term: Term, path: LoadPath) -> FloatArray:
    """(n,) error of a `reading` per unit of the term's size: a share, or a displacement in m."""
    shape = shaped_at(term, path)
    if term.direction in AXES:
        assert path.direction is not None
        shape = shape * path.direction[:, AXES[term.direction]] ** 2
    return np.asarray(shape)
