"""Terms of a portrait: one link of the load path that gives way, along some directions, as one variable says.

A term is an ordinary effect with one size and constants that are read off the readings. Its compliance is

    c(v) = size * s(v),        s >= 0,

in series with the rest: a quadratic form h h^T in the strut forces and the tip force [f; w] (Castigliano, as in
`stiffness.exact`) for each generalised force h of the link. Compliances are symmetric by construction and not negative
where the link can only give; a strut's stiffness may change to both sides, within bounds that leave it a stiffness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import joint_angles
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Parameter
from toolpath_stiff.stiffness.effects.frame_compliance import frame_vertices
from toolpath_stiff.stiffness.effects.joint_moment_stiffness import end_rotations

LINKS = ("instrument", "tool", "platform", "joints", "one strut", "struts", "frame", "table")


VARIABLES = (
    "constant", "x", "y", "z", "radius", "tilt", "strut length", "strut force", "force sign", "load", "time", "order",
    "setup", "temperature", "direction",
)  # fmt: skip


SHAPES = ("offset", "slope", "square", "bump", "threshold", "periodic", "sign")


DIRECTIONS = ("X", "Y", "Z", "horizontal", "radial", "axial", "along the struts", "tangential", "all", "reading")


# How a term acts:
#   give            the tip's force moves the link along its directions; m/N
#   rocking         the moment of the tip's force about the origin of the base axes turns it; rad per N m
#   tilting         the moment of the tip's force about the middle of the platform joints turns it; rad per N m
#   vertex          the forces of the two struts that share a vertex move that vertex; m/N
#   strut           in series with each strut; m/N
#   frame pin,      a joint gives along one pin of its cross, which stands radially or tangentially about the machine's
#   platform pin    axis, or about the platform's; in series with its strut; m/N
#   turning         joints resist turning, at both ends of the strut; N m/rad, parallel to the struts
#   strut factor    a share of the strut's own compliance by the strut law
#   coupling        the force of one strut stretches another, by a share of the mean of both struts' compliances
#   joint offset    a joint stands off its place, and the control does not know; m
#   reading factor  the deflection is read too large by a share
#   reading shift   the deflection is read too large by a displacement; m
Action = Literal[
    "give", "rocking", "tilting", "vertex", "strut", "frame pin", "platform pin", "turning", "strut factor", "coupling",
    "joint offset", "reading factor", "reading shift",
]  # fmt: skip


# Action -> unit, its SI value, bounds and usual sizes in that unit; assumed: what a machine that still mills can have.
UNITS: dict[str, tuple[str, float, tuple[float, float], tuple[float, float]]] = {
    "give": ("nm/N", 1e-9, (0.0, 500.0), (1.0, 20.0)),
    "rocking": ("nrad/N/m", 1e-9, (0.0, 500.0), (0.5, 10.0)),
    "tilting": ("nrad/N/m", 1e-9, (0.0, 5000.0), (1.0, 300.0)),
    "vertex": ("nm/N", 1e-9, (0.0, 500.0), (1.0, 20.0)),
    "strut": ("nm/N", 1e-9, (0.0, 500.0), (1.0, 20.0)),
    "frame pin": ("nm/N", 1e-9, (0.0, 500.0), (1.0, 20.0)),
    "platform pin": ("nm/N", 1e-9, (0.0, 500.0), (1.0, 20.0)),
    "turning": ("kN m/rad", 1e3, (0.0, 5000.0), (5.0, 550.0)),
    "strut factor": ("%", 0.01, (-50.0, 400.0), (-20.0, 40.0)),
    "coupling": ("%", 0.01, (-50.0, 50.0), (-20.0, 20.0)),
    "joint offset": ("mm", 1e-3, (-30.0, 30.0), (-3.0, 3.0)),
    "reading factor": ("%", 0.01, (-50.0, 100.0), (-10.0, 10.0)),
    "reading shift": ("um", 1e-6, (-200.0, 200.0), (-10.0, 10.0)),
}


ASSUMED = "described from readings; usual sizes are engineering experience, no source"


PLACE = ("x", "y", "z", "radius")
PINS: tuple[Action, ...] = ("frame pin", "platform pin")


IN_SERIES = ("strut", "strut factor", *PINS)  # actions that add to the compliance of each strut by itself


SWINGS = ("frame joint", "platform joint")


AXES = {"X": 0, "Y": 1, "Z": 2}


Constants = tuple[tuple[str, float], ...]


IDLE = 1e-3  # N in a strut: below, a power of the force would diverge, and the strut adds nothing that shows


@dataclass(frozen=True)
class Factor:
    """A further variable that a term depends on, times the first: shape and so on as of `Term`."""

    variable: str
    shape: str
    at: Constants = ()
    column: str = ""


@dataclass(frozen=True)
class Term:
    """One term of a description.

    Attributes
    ----------
    link, direction, variable, shape
        Of `LINKS`, `DIRECTIONS`, `VARIABLES` (or the name of a further column), `SHAPES`.
    action
        How it acts, see `Action`.
    where
        Strut (1 to 6) or vertex (1 to 3), numbered from 1; None: all of them, or the link has none.
    at
        Constants in SI, by name. Of the shape: `slope` has `start` (where it is 0) and `end` (where it is 1), or
        `power` and `reference`; `square` has `centre` and `reach`; `bump` has `centre` and `width`; `threshold` has
        `edge` and `side` (1: above it, -1: below), or `from` (where it begins) and `end` (where it is 1), or
        `beyond`, a force that friction holds, or `within`, a force beyond which play is used up; `periodic` has
        `period` and `crest`; `sign` has `side`. Of a `coupling`: `first` and `second`, numbers of struts.
    column
        Name of the set-up; of `tilt`, "" for the angle from Z, "X" or "Y" for the lean towards that axis, one of
        `SWINGS` for how far each of these joints has swung from its place at the neutral pose; of a `joint offset`,
        "frame" or "platform".
    size
        In SI.
    times
        A second variable with its shape: c(v, w) = size * s(v) * t(w).
    """

    link: str
    direction: str
    variable: str
    shape: str
    action: Action
    where: int | None = None
    at: Constants = ()
    column: str = ""
    size: float = field(default=0.0, compare=False)
    times: Factor | None = None

    @property
    def unit(self) -> str:
        """Unit of the size in documents."""
        return UNITS[self.action][0]

    @property
    def si(self) -> float:
        """SI value of one `unit`."""
        return UNITS[self.action][1]

    @property
    def bounds(self) -> tuple[float, float]:
        """What the size may be, in `unit`."""
        return UNITS[self.action][2]

    @property
    def signs(self) -> tuple[float, ...]:
        """To which sides the size may go."""
        return (1.0,) if self.bounds[0] >= 0.0 else (-1.0, 1.0)

    @property
    def acts(self) -> bool:
        """Whether an effect can see its variables."""
        return not self.unseen

    @property
    def unseen(self) -> tuple[str, ...]:
        """Variables that no effect sees: the order of readings and further columns."""
        return tuple(one for one in self.variables if one not in VARIABLES or one == "order")

    @property
    def variables(self) -> tuple[str, ...]:
        """One or two."""
        return (self.variable,) if self.times is None else (self.variable, self.times.variable)

    @property
    def second(self) -> Term | None:
        """The same with its second variable as the only one."""
        if self.times is None:
            return None
        one = self.times
        return replace(self, variable=one.variable, shape=one.shape, at=one.at, column=one.column, times=None)

    @property
    def constants(self) -> dict[str, float]:
        """`at` by name."""
        return dict(self.at)

    @property
    def key(self) -> str:
        """A name that no other term has: its words, and its constants to six digits."""
        numbers = [f"{name}={value:.6g}" for name, value in self.at]
        named = [self.link, str(self.where or ""), self.action, self.direction, self.variable, self.column, self.shape]
        own = " ".join(part for part in (*named, *numbers) if part)
        if self.second is None:
            return own
        return f"{own} times {self.second.key.removeprefix(f'{self.link} ')}"

    def sized(self, size: float) -> Term:
        """The same with a size (SI)."""
        return replace(self, size=float(size))


def variable_values(variable: str, path: LoadPath, column: str = "") -> FloatArray:
    """What a variable is at n poses, SI: (n,), or (n, 6) for those of each strut.

    Strut force and its sign are those under the load, `path.strut_forces`.
    """
    position = path.position
    if variable in ("constant", "direction"):
        return np.ones(len(path))
    if variable in ("x", "y", "z"):
        return np.asarray(position[:, "xyz".index(variable)])
    if variable == "radius":
        return np.hypot(position[:, 0], position[:, 1])
    if variable == "tilt":
        axis = path.rotation[:, :, 2]
        if column in SWINGS:
            return joint_angles(path.machine, path.struts, path.rotation)[SWINGS.index(column)]
        if column:
            return np.arcsin(np.clip(axis[:, AXES[column]], -1.0, 1.0))
        return np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2])
    if variable == "strut length":
        return path.struts.lengths
    if variable == "load":
        return path.force
    if variable == "setup":
        return np.zeros(len(path)) if path.setup is None else (path.setup == column).astype(float)
    found = {
        "time": path.time,
        "temperature": path.temperature,
        "strut force": None if path.strut_forces is None else np.abs(path.strut_forces),
        "force sign": None if path.strut_forces is None else np.sign(path.strut_forces),
    }[variable]
    return np.zeros(len(path)) if found is None else found


def shape_values(shape: str, values: FloatArray, at: Mapping[str, float], signed: bool) -> FloatArray:
    """s(v) at values of any shape; `at` as of `Term.at`. Not below 0, but for slopes of what may change to both sides.

    `at` holds numbers, or arrays that broadcast with the values.
    """
    if shape == "offset":
        return values
    if shape == "slope":
        if "power" in at:
            return np.asarray((np.maximum(values, IDLE) / at["reference"]) ** at["power"])
        line = (values - at["start"]) / (at["end"] - at["start"])
        return np.asarray(line if signed else np.maximum(line, 0.0))
    if shape == "square":
        return np.asarray(((values - at["centre"]) / at["reach"]) ** 2)
    if shape == "bump":
        return np.asarray(np.exp(-0.5 * ((values - at["centre"]) / at["width"]) ** 2))
    if shape == "threshold" and "beyond" in at:  # Coulomb friction holds up to the edge: (v - edge) / v of a force v
        return np.maximum(1.0 - at["beyond"] / np.maximum(values, IDLE), 0.0)
    if shape == "threshold" and "within" in at:  # play that a force uses up gives no more: min(v, edge) / v
        return np.minimum(at["within"] / np.maximum(values, IDLE), 1.0)
    if shape == "threshold" and "from" in at:  # nothing up to there, then a straight line
        return np.asarray(np.maximum((values - at["from"]) / (at["end"] - at["from"]), 0.0))
    if shape == "threshold":
        return np.asarray(at["side"] * (values - at["edge"]) > 0.0, dtype=float)
    if shape == "periodic":
        return np.asarray(0.5 * (1.0 + np.cos(2.0 * np.pi * (values - at["crest"]) / at["period"])))
    return np.asarray(at["side"] * values > 0.0, dtype=float)  # sign


def shaped(term: Term, path: LoadPath) -> FloatArray:
    """s(v) of a term at n poses: (n,), or (n, 6) where it is each strut's own.

    What varies from strut to strut belongs to a single strut where the term has one.
    """
    values = variable_values(term.variable, path, term.column)
    first = shape_values(term.shape, values, term.constants, len(term.signs) > 1)
    if term.times is None:
        return first
    return multiplied(first, factor_values(term.times, variable_values(term.times.variable, path, term.times.column)))


def factor_values(factor: Factor, values: FloatArray) -> FloatArray:
    """t(w) of a second variable, not below 0."""
    return shape_values(factor.shape, values, dict(factor.at), False)


def multiplied(first: FloatArray, second: FloatArray) -> FloatArray:
    """The product of two shapes, (n,) or of each strut (n, 6)."""
    if first.ndim == second.ndim:
        return np.asarray(first * second)
    wide, narrow = (first, second) if first.ndim == 2 else (second, first)
    return np.asarray(wide * narrow[:, None])


def carriers(link: str, action: str, direction: str, where: int | None, path: LoadPath) -> FloatArray:
    """(n, k, 12) h of the link's generalised forces h . [f; w] under strut forces f and the tip's wrench w.

    The compliance along a load is the sum of their squares times that of the link.
    """
    if action == "vertex":
        return _vertex_carriers(link, direction, where, path)
    axes = _axes(link, action, direction, path)
    found = np.zeros((len(path), axes.shape[1], 12))
    found[:, :, 6:9] = axes
    return found


def _axes(link: str, action: str, direction: str, path: LoadPath) -> FloatArray:
    """(n, k, 3) a: the link's generalised forces are a . F of the tip's force F."""
    n = len(path)
    if link in ("tool", "platform"):
        own = {"X": [0], "Y": [1], "Z": [2], "axial": [2], "radial": [0, 1], "all": [0, 1, 2]}[direction]
        axes = np.swapaxes(path.rotation, 1, 2)[:, own]  # rows R e
        if action == "tilting":  # (lever x F) . (R e_z x R e) = F . ((R e_z x R e) x lever)
            lever = -path.struts.arms.mean(axis=1)
            about = np.cross(path.rotation[:, None, :, 2], axes)
            return np.cross(about, lever[:, None])
        return axes
    x, y, z = path.position.T
    none = np.zeros(n)
    if action == "rocking":  # moments of F at p about Y, X and Z
        of = {"X": (z, none, -x), "Y": (none, z, -y), "tangential": (-y, x, none)}
        chosen = ("X", "Y") if direction == "all" else (direction,)
        return np.stack([np.stack(of[one], axis=1) for one in chosen], axis=1)
    if direction in ("radial", "tangential"):
        reach = np.maximum(np.hypot(x, y), 1e-9)
        ends = (x, y, none) if direction == "radial" else (-y, x, none)
        return np.asarray((np.stack(ends, axis=1) / reach[:, None])[:, None])
    own = {"all": [0, 1, 2], "horizontal": [0, 1]}.get(direction) or [AXES[direction]]
    return np.broadcast_to(np.eye(3)[own], (n, len(own), 3))


def _vertex_carriers(link: str, direction: str, where: int | None, path: LoadPath) -> FloatArray:
    """(n, k, 12) of the vertices of frame or platform: the force of two struts along the vertex's own axes."""
    joints = path.machine.frame_joints if link == "frame" else path.machine.platform_joints
    found = []
    for number, (pair, outward) in enumerate(frame_vertices(joints), start=1):
        if where not in (None, number):
            continue
        one = np.zeros((len(path), 12))
        if direction == "along the struts":  # what both carry together
            one[:, pair] = 1.0
        else:
            across = np.array([-outward[1], outward[0], 0.0])
            upright = np.array([0.0, 0.0, 1.0])
            own = {"radial": outward, "tangential": across, "Z": upright, "axial": upright}[direction]
            axis = np.broadcast_to(own, (len(path), 3)) if link == "frame" else path.rotation @ own
            one[:, pair] = np.einsum("nij,nj->ni", path.struts.directions[:, pair], axis)
        found.append(one)
    return np.stack(found, axis=1)


def along_pins(action: str, direction: str, path: LoadPath) -> FloatArray:
    """(n, 6) share of each strut's force that is along the pin of its joint."""
    joints = path.machine.frame_joints if action == "frame pin" else path.machine.platform_joints
    x, y = joints[:, :2].T / np.linalg.norm(joints[:, :2], axis=1)
    pins = np.stack([x, y, 0.0 * x] if direction == "radial" else [-y, x, 0.0 * x], axis=1)
    turned = pins if action == "frame pin" else pins @ np.swapaxes(path.rotation, 1, 2)
    return np.asarray((path.struts.directions * turned).sum(axis=-1))


def strut_share(term: Term, path: LoadPath) -> FloatArray:
    """(n, 6) of each strut per unit of a size: compliance of what is in series with it, stiffness of `turning`."""
    shape = shaped(term, path)
    each = np.array(np.broadcast_to(shape[:, None] if shape.ndim == 1 else shape, (len(path), 6)), dtype=float)
    if term.where is not None:
        each[:, np.arange(6) != term.where - 1] = 0.0
    if term.action == "strut factor":
        each = np.asarray(each / path.machine.strut_law.stiffness(path.struts.lengths))
    if term.action in PINS:
        each = np.asarray(each * along_pins(term.action, term.direction, path) ** 2)
    return each


def coupled(term: Term) -> tuple[int, int]:
    """Indices from 0 of the struts of a `coupling`."""
    return int(term.constants["first"]) - 1, int(term.constants["second"]) - 1


def coupling_share(term: Term, path: LoadPath) -> FloatArray:
    """(n,) m/N that a `coupling` puts between its struts per unit of its size."""
    stiffness = path.machine.strut_law.stiffness(path.struts.lengths[:, coupled(term)])
    return np.asarray(shaped(term, path) / np.sqrt(stiffness.prod(axis=1)))


def reading_share(term: Term, path: LoadPath) -> FloatArray:
    """(n,) by how much a `reading` is off per unit of the term's size: a share, or a displacement in m."""
    shape = shaped(term, path)
    if term.direction in AXES:
        assert path.direction is not None
        shape = shape * path.direction[:, AXES[term.direction]] ** 2
    return np.asarray(shape)


class TermEffect(Effect):
    """A term as an effect; `effect_of` makes one."""

    term: ClassVar[Term]


class _Form(TermEffect):
    def load_compliance(self, path: LoadPath, p: Mapping[str, float]) -> FloatArray | None:
        """Quadratic form of strut forces and tip wrench."""
        term = self.term
        if not _seen(term, path):
            return None
        rows = carriers(term.link, term.action, term.direction, term.where, path)
        weight = p["size"] * shaped(term, path)
        return np.asarray(weight[:, None, None] * np.einsum("nki,nkj->nij", rows, rows))


class _Coupling(TermEffect):
    def load_compliance(self, path: LoadPath, p: Mapping[str, float]) -> FloatArray | None:
        """What couples two struts."""
        term = self.term
        if not _seen(term, path):
            return None
        first, second = coupled(term)
        own = p["size"] * coupling_share(term, path)
        form = np.zeros((len(path), 12, 12))
        form[:, first, second] = form[:, second, first] = own
        return form


class _Strut(TermEffect):
    def strut_compliance(self, path: LoadPath, p: Mapping[str, float]) -> FloatArray | None:
        """In series with each strut."""
        if not _seen(self.term, path):
            return None
        return np.asarray(p["size"] * strut_share(self.term, path))


class _Turning(TermEffect):
    def parallel_stiffness(self, path: LoadPath, p: Mapping[str, float]) -> FloatArray | None:
        """Rotational springs at both ends of each strut."""
        if p["size"] == 0.0 or not _seen(self.term, path):
            return None
        rotations = end_rotations(path)
        weighted = (p["size"] * strut_share(self.term, path))[:, :, None, None] * rotations
        flat = (len(path), 36, 6)
        return np.asarray(np.swapaxes(rotations.reshape(flat), 1, 2) @ weighted.reshape(flat))


class _Offset(TermEffect):
    unknown_to_control = True

    def geometry(self, machine: Machine, p: Mapping[str, float]) -> Machine:
        """With one joint off its place."""
        name = f"{self.term.column}_joints"
        joints = np.array(getattr(machine, name))
        assert self.term.where is not None
        joints[self.term.where - 1, AXES[self.term.direction]] += p["size"]
        return machine.with_changes(**{name: joints})


class _Reading(TermEffect):
    def reading(self, stiffness: FloatArray, path: LoadPath, p: Mapping[str, float]) -> FloatArray:
        """Force over the deflection as read; nan where nothing of the deflection is left."""
        off = p["size"] * reading_share(self.term, path)
        factor = 1.0 + (off if self.term.action == "reading factor" else off * stiffness / path.force)
        return np.where(factor > 0.0, stiffness / np.where(factor > 0.0, factor, 1.0), np.nan)


def _seen(term: Term, path: LoadPath) -> bool:
    """Whether these poses say what the term varies with."""
    needed = {"time": path.time, "temperature": path.temperature, "setup": path.setup}
    needed |= dict.fromkeys(OF_FORCES, path.strut_forces)
    return all(one not in needed or needed[one] is not None for one in term.variables)


NEEDS = {
    "load": "force_N",
    "strut force": "force_N",
    "time": "time_min",
    "temperature": "temperature_C",
    "setup": "setup",
}


OF_FORCES = ("strut force", "force sign")


CATALOGUE_LINKS = {"one strut": "struts"}


def effect_of(term: Term) -> Effect:
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
    unit, si, bounds, typical = UNITS[term.action]
    kinds: dict[str, type[TermEffect]] = {
        "coupling": _Coupling, **dict.fromkeys(IN_SERIES, _Strut), "turning": _Turning, "joint offset": _Offset,
        "reading factor": _Reading, "reading shift": _Reading,
    }  # fmt: skip
    needs = list(dict.fromkeys(NEEDS[one] for one in term.variables if one in NEEDS))
    if term.action in ("reading factor", "reading shift"):
        needs += ["direction"] if term.direction in AXES else []
        needs += ["force_N"] if term.action == "reading shift" and "force_N" not in needs else []
    link = "geometry" if term.action == "joint offset" else CATALOGUE_LINKS.get(term.link, term.link)
    attributes: dict[str, Any] = {
        "__doc__": "A term of a portrait.",
        "term": term,
        "name": f"term: {term.key}",
        "title": term.key,
        "link": link,
        "equation": "c += size s(v) sum_k (h_k . [f; w])^2; of turning: K += size s(v) sum_k B_k^T B_k",
        "source": ASSUMED,
        "parameters": (Parameter("size", unit, si, bounds, typical, ASSUMED, meaning=f"size of {term.key}"),),
        "needs": tuple(needs),
        "load_dependent": not set(OF_FORCES).isdisjoint(term.variables),
    }
    made = type("TermOfPortrait", (kinds.get(term.action, _Form),), attributes)
    found: Effect = made()
    return found
