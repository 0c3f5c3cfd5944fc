"""Terms: one link of the load path that gives way, in some directions, as a function of one variable.

A term has a size and constants that are read off readings; `term_effect` makes effects of terms. Its compliance is

    c(v) = size * s(v),        s >= 0,

in series with the rest: a quadratic form h h^T in the strut forces and the tip force [f; w] (Castigliano, as in
`stiffness.exact`) for each generalised force h of the link. Compliances are symmetric by construction and not negative
where the link can only give; a strut's stiffness may change to both sides, within bounds that leave it a stiffness.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.kinematics import joint_angles
from toolpath_stiff.stiffness.contract import IDLE, LoadPath, Parameter

LINKS = ("instrument", "tool", "platform", "joints", "one strut", "struts", "frame", "table")
AXES = {"X": 0, "Y": 1, "Z": 2}
SWINGS = ("frame joint", "platform joint")
ASSUMED = "described from readings; usual sizes are engineering experience, no source"

Action = str
Constants = tuple[tuple[str, float], ...]

# How a term acts:
#   give            the tip's force moves the link along its directions; m/N
#   rocking         the moment of the tip's force about the origin of the base axes turns it; rad per N m
#   tilting         the moment of the tip's force about the middle of the platform joints turns it; rad per N m
#   vertex          the forces of the two struts that share a vertex move that vertex; m/N
#   strut           in series with each strut; m/N
#   frame pin,      a joint gives along one pin of its cross, which stands radially or tangentially about the machine's
#   platform pin    axis, or about the platform's; in series with its strut; m/N
#   turning         joints resist turning, at both ends of the strut; N m/rad, parallel to the struts
#   spring          a spring from the middle of the platform joints to the ground; N/m, parallel to the struts
#   strut factor    a share of the strut's own compliance by the strut law
#   coupling        the force of one strut stretches another, by a share of the mean of both struts' compliances
#   joint offset    a joint stands off its place, and the control does not know; m
#   reading factor  the deflection is read too large by a share
#   reading shift   the deflection is read too large by a displacement; m
NM_PER_N = Parameter("size", "nm/N", 1e-9, (0.0, 500.0), (1.0, 20.0), ASSUMED)
SIZES: dict[Action, Parameter] = {  # sizes possible on a machine that can still mill
    **dict.fromkeys(("give", "vertex", "strut", "frame pin", "platform pin"), NM_PER_N),
    "rocking": Parameter("size", "nrad/N/m", 1e-9, (0.0, 500.0), (0.5, 10.0), ASSUMED),
    "tilting": Parameter("size", "nrad/N/m", 1e-9, (0.0, 5000.0), (1.0, 300.0), ASSUMED),
    "turning": Parameter("size", "kN m/rad", 1e3, (0.0, 5000.0), (5.0, 550.0), ASSUMED),
    "spring": Parameter("size", "N/um", 1e6, (0.0, 100.0), (0.1, 10.0), ASSUMED),
    "strut factor": Parameter("size", "%", 0.01, (-50.0, 400.0), (-20.0, 40.0), ASSUMED),
    "coupling": Parameter("size", "%", 0.01, (-50.0, 50.0), (-20.0, 20.0), ASSUMED),
    "joint offset": Parameter("size", "mm", 1e-3, (-30.0, 30.0), (-3.0, 3.0), ASSUMED),
    "reading factor": Parameter("size", "%", 0.01, (-50.0, 100.0), (-10.0, 10.0), ASSUMED),
    "reading shift": Parameter("size", "um", 1e-6, (-200.0, 200.0), (-10.0, 10.0), ASSUMED),
}
EQUATIONS: dict[Action, str] = {  # {} is the size, s its share, h a load
    "give": "c += {} s h^2, h = tip force",
    "rocking": "c += {} s h^2, h = moment of the tip force about the origin",
    "tilting": "c += {} s h^2, h = moment of the tip force about the platform's middle",
    "vertex": "c += {} s h^2, h = force in the vertex",
    "strut": "c_i += {} s",
    **dict.fromkeys(("frame pin", "platform pin"), "c_i += {} s (u_i . pin)^2"),
    "turning": "K += sum over i of {} s B_i^T B_i",
    "spring": "K += {} s h h^T, h = motion of the platform's middle",
    "strut factor": "c_i += {} s / k_i",
    "coupling": "c_ij += {} s / sqrt(k_i k_j)",
    "joint offset": "joint += {}",
    "reading factor": "k_read = k / (1 + {} s)",
    "reading shift": "F / k_read = F / k + {} s",
}
PINS = ("frame pin", "platform pin")
IN_SERIES = ("strut", "strut factor", *PINS)  # actions that add to the compliance of single struts
PARALLEL = ("turning", "spring")  # actions that share the load with the struts; not linear in their size
PAIR = ("first", "second")  # constants of a coupling
# (action, link) -> directions along which it may act there.
HEAD, BASE, STRUTS = ("tool", "platform"), ("frame", "table"), ("along the struts",)
ALONG: dict[tuple[str, str], tuple[str, ...]] = {
    **{("give", link): ("X", "Y", "Z", "radial", "axial", "all") for link in HEAD},
    **{("give", link): ("X", "Y", "Z", "horizontal", "radial", "tangential", "all") for link in BASE},
    **{("rocking", link): ("X", "Y", "tangential", "all") for link in BASE},
    **{("tilting", link): ("X", "Y", "radial") for link in HEAD},
    **{("vertex", link): ("radial", "tangential", "Z", "axial", *STRUTS) for link in ("frame", "platform")},
    **{("strut", link): STRUTS for link in ("joints", "struts", "one strut")},
    **{("strut factor", link): STRUTS for link in ("struts", "one strut")},
    **{("coupling", link): STRUTS for link in ("struts", "frame")},
    **{(pin, "joints"): ("radial", "tangential") for pin in ("frame pin", "platform pin")},
    ("turning", "joints"): ("all",),
    ("spring", "platform"): ("X", "Y", "Z", "horizontal", "all"),
    ("joint offset", "joints"): ("X", "Y", "Z"),
    ("reading factor", "instrument"): ("reading", "X", "Y", "Z", "all"),
    ("reading shift", "instrument"): ("reading", "X", "Y", "Z", "all"),
}


def _tilt(path: LoadPath, column: str) -> FloatArray:
    axis = path.rotation[:, :, 2]
    if column in SWINGS:
        return joint_angles(path.machine, path.struts, path.rotation)[SWINGS.index(column)]
    if column:
        return np.asarray(np.arcsin(np.clip(axis[:, AXES[column]], -1.0, 1.0)))
    return np.asarray(np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2]))


# Variable -> its values at n poses, SI: (n,), or (n, 6) for each strut; strut forces are those under the load.
SEEN: dict[str, Callable[[LoadPath, str], FloatArray | None]] = {
    "constant": lambda path, column: np.ones(len(path)),
    "x": lambda path, column: path.position[:, 0],
    "y": lambda path, column: path.position[:, 1],
    "z": lambda path, column: path.position[:, 2],
    "radius": lambda path, column: np.hypot(path.position[:, 0], path.position[:, 1]),
    "tilt": _tilt,
    "tool length": lambda path, column: path.machine.reference_tool_length + path.tool_extension,
    "strut length": lambda path, column: path.struts.lengths,
    "strut force": lambda path, column: None if path.strut_forces is None else np.abs(path.strut_forces),
    "force sign": lambda path, column: None if path.strut_forces is None else np.sign(path.strut_forces),
    "load": lambda path, column: path.force,
    "time": lambda path, column: path.time,
    "setup": lambda path, column: None if path.setup is None else (path.setup == column).astype(float),
    "temperature": lambda path, column: path.temperature,
    "direction": lambda path, column: np.ones(len(path)),
}
VARIABLES = (*SEEN, "order")  # "order" of the readings, which no effect sees
PLACE = ("x", "y", "z", "radius")
OF_FORCES = ("strut force", "force sign")


def _growing(v: FloatArray, power: FloatArray, reference: FloatArray) -> FloatArray:
    return np.asarray((np.maximum(v, IDLE) / reference) ** power)


# Shape and names of its constants -> share s of the variable v in words, and as a function. Coulomb friction holds up
# to a force `beyond`: share (v - beyond) / v; play is used up at a force `within`: share min(v, within) / v.
FORMULAS: dict[tuple[str, tuple[str, ...]], tuple[str, Callable[..., FloatArray]]] = {
    ("offset", ()): ("v", lambda v: v),
    ("slope", ("start", "end")): ("(v - start) / (end - start)", lambda v, start, end: (v - start) / (end - start)),
    ("slope", ("power", "reference")): ("(v / reference)^power", _growing),
    ("square", ("centre", "reach")): ("((v - centre) / reach)^2", lambda v, centre, reach: ((v - centre) / reach) ** 2),
    ("bump", ("centre", "width")): (
        "exp(-((v - centre) / width)^2 / 2)", lambda v, centre, width: np.exp(-0.5 * ((v - centre) / width) ** 2)
    ),
    ("threshold", ("edge", "side")): (
        "(1 where side (v - edge) > 0, else 0)", lambda v, edge, side: (side * (v - edge) > 0.0).astype(float)
    ),
    ("threshold", ("from", "end")): (
        "max(0, (v - from) / (end - from))",
        lambda v, end, **edges: np.maximum((v - edges["from"]) / (end - edges["from"]), 0.0),  # a Python keyword
    ),
    ("threshold", ("beyond",)): (
        "max(0, 1 - beyond / v)", lambda v, beyond: np.maximum(1.0 - beyond / np.maximum(v, IDLE), 0.0)
    ),
    ("threshold", ("within",)): (
        "min(1, within / v)", lambda v, within: np.minimum(within / np.maximum(v, IDLE), 1.0)
    ),
    ("periodic", ("period", "crest")): (
        "(1 + cos(2 pi (v - crest) / period)) / 2",
        lambda v, period, crest: 0.5 * (1.0 + np.cos(2.0 * np.pi * (v - crest) / period)),
    ),
    ("sign", ("side",)): ("(1 where side v > 0, else 0)", lambda v, side: (side * v > 0.0).astype(float)),
}  # fmt: skip
SHAPES = tuple(dict.fromkeys(shape for shape, _ in FORMULAS))


@dataclass(frozen=True)
class Term:
    """One term of a description.

    Attributes
    ----------
    link, direction, variable, shape
        Of `LINKS`, `ALONG`, `VARIABLES` (or the name of a further column), `SHAPES`.
    action
        How it acts, one of `SIZES`.
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
        The same term of a second variable with its shape: c(v, w) = size * s(v) * t(w).
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
    times: Term | None = None

    @property
    def unit(self) -> str:
        """Unit of the size in documents."""
        return SIZES[self.action].unit

    @property
    def si(self) -> float:
        """SI value of one `unit`."""
        return SIZES[self.action].si

    @property
    def bounds(self) -> tuple[float, float]:
        """Range of the size, in `unit`."""
        return SIZES[self.action].bounds

    @property
    def signed(self) -> bool:
        """True if the size may be negative."""
        return self.bounds[0] < 0.0

    @property
    def unseen(self) -> tuple[str, ...]:
        """Variables that no effect sees: order of readings and further columns."""
        return tuple(name for name in self.variables if name not in SEEN)

    @property
    def acts(self) -> bool:
        """True if an effect can see its variables."""
        return not self.unseen

    @property
    def variables(self) -> tuple[str, ...]:
        """The variable, or both variables."""
        return (self.variable,) if self.times is None else (self.variable, self.times.variable)

    @property
    def constants(self) -> dict[str, float]:
        """`at` by name."""
        return dict(self.at)

    @property
    def key(self) -> str:
        """Unique name: the term's words, and its constants to six digits."""
        numbers = [f"{name}={value:.6g}" for name, value in self.at]
        named = [self.link, str(self.where or ""), self.action, self.direction, self.variable, self.column, self.shape]
        words = " ".join(part for part in (*named, *numbers) if part)
        return words if self.times is None else f"{words} times {self.times.key.removeprefix(f'{self.link} ')}"

    def with_second(self, variable: str, shape: str, at: Constants = (), column: str = "") -> Term:
        """Term multiplied by the share of a second variable, which is not negative."""
        return replace(self, times=replace(self, variable=variable, shape=shape, at=at, column=column, times=None))

    def sized(self, size: float) -> Term:
        """Term with a size (SI)."""
        return replace(self, size=float(size))


def variable_values(variable: str, path: LoadPath, column: str = "") -> FloatArray:
    """Values of a variable at n poses, SI: (n,), or (n, 6) for each strut; 0 where not given."""
    values = SEEN[variable](path, column)
    return np.zeros(len(path)) if values is None else values


def shape_values(shape: str, values: FloatArray, constants: Mapping[str, float], signed: bool) -> FloatArray:
    """s(v) of any shape at given values; `constants` as in `Term.at`. Not negative, except slopes if `signed`.

    `at` holds numbers, or arrays that broadcast with the values.
    """
    names = tuple(name for name in constants if name not in PAIR)
    share = FORMULAS[shape, names][1](values, **{name: constants[name] for name in names})
    return np.maximum(share, 0.0) if names == ("start", "end") and not signed else np.asarray(share)


def shaped(term: Term, values: Callable[[str, str], FloatArray]) -> FloatArray:
    """s(v) of a term, times t(w) for a second variable: (n,), or (n, 6) if each strut has its own.

    `values` gives those of a variable and column. What varies from strut to strut belongs to a single strut where the
    term has one.
    """
    first = shape_values(term.shape, values(term.variable, term.column), term.constants, term.signed)
    if (other := term.times) is None:
        return first
    second = shape_values(other.shape, values(other.variable, other.column), other.constants, signed=False)
    if first.ndim == second.ndim:
        return np.asarray(first * second)
    wide, narrow = (first, second) if first.ndim == 2 else (second, first)
    return np.asarray(wide * narrow[:, None])


def formula(term: Term, size: str) -> str:
    """Formula of a term's contribution, with its size and its constants by name."""
    along = f" along {term.direction}" if term.link == "instrument" and term.direction in AXES else ""
    return f"{EQUATIONS[term.action].format(size)}{along}, s = {_share_formula(term, term.signed)}"


def _share_formula(term: Term, signed: bool) -> str:
    """Formula of the share s, in the variable's name."""
    if term.variable in ("constant", "direction"):
        share = "1"
    elif term.variable == "setup":
        share = f"(1 in set-up {term.column}, else 0)"
    else:
        names = tuple(name for name, _ in term.at if name not in PAIR)
        share = re.sub(r"\bv\b", " ".join((term.variable, term.column)).strip(), FORMULAS[term.shape, names][0])
        share = f"max(0, {share})" if names == ("start", "end") and not signed else share
    return share if term.times is None else f"{share} {_share_formula(term.times, signed=False)}"
