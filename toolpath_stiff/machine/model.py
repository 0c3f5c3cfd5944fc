"""Machine models: any machine, and the hexapod with joints, tool, strut law, platform bars, limits. SI units.

Every quantity carries its origin: "published", "recovered" (from published figures), "assumed", or "fitted" (to
measurements, by `tps update`). How well fitted parameters are known is `Uncertainty`: standard deviations in the units
of the machine file's own keys, and correlations, because strut law and effects share the blame for what a reading
shows, so that the one is known better once the other is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import EffectError, InputError
from toolpath_stiff.machine.elements import Element, Stance
from toolpath_stiff.machine.error_model import ErrorModel
from toolpath_stiff.poses import Pose
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.units import n_per_m_from_n_per_um

Derived = TypeVar("Derived")
ORIGINS = ("published", "recovered", "assumed", "fitted")

STRUT_LAW = ("strut_law.stiffness_1_N_per_um", "strut_law.stiffness_2_N_per_um")
CONSTANT_LAW = ("strut_law.stiffness_N_per_um",)
NO_END = 1e3  # m, room of a law valid at every length: finite, as a search takes differences of it


@dataclass(frozen=True)
class StrutLaw:
    """Strut stiffness as a function of length: linear (the paper's equation 5), a table, or constant.

    Linear: k(L) = k1 + (k2 - k1) (L - L1) / (L2 - L1). A table is that straight line between its first and its last
    point times a shape, so that moving k1 or k2 scales the table and keeps its shape. Between L1 and L2 the law is
    what its source gives; outside it is extrapolated, a table along its first and its last segment.

    Attributes
    ----------
    length_1, length_2
        m, where the law begins and ends; of a constant law the ends of the travel.
    stiffness_1, stiffness_2
        N/m there; of a constant law `stiffness_1` is both.
    shape
        Of a table: (length in m, stiffness over that of the straight line) of each point, lengths rising, both ends
        with 1.
    constant
        Whether the stiffness is the same at every length, inside and outside the travel.
    """

    length_1: float
    stiffness_1: float
    length_2: float
    stiffness_2: float
    shape: tuple[tuple[float, float], ...] = ()
    constant: bool = False

    def __post_init__(self) -> None:
        """Set one stiffness at both ends of a constant law, also after `dataclasses.replace`."""
        if self.constant:
            object.__setattr__(self, "stiffness_2", self.stiffness_1)

    @classmethod
    def table(cls, lengths: FloatArray, stiffnesses: FloatArray) -> StrutLaw:
        """Law through three or more points: (p,) m, rising, and (p,) N/m, more than 0."""
        ends = cls(float(lengths[0]), float(stiffnesses[0]), float(lengths[-1]), float(stiffnesses[-1]))
        factors = stiffnesses / ends.stiffness(lengths)
        factors[[0, -1]] = 1.0
        return replace(ends, shape=tuple(zip(lengths.tolist(), factors.tolist(), strict=True)))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its free constants, as `[uncertainty]` of a machine file has them."""
        return CONSTANT_LAW if self.constant else STRUT_LAW

    def moved(self, name: str, change: float) -> StrutLaw:
        """The law with `change`, in the unit of the key, added to one of its `parameters`."""
        key = "stiffness_2" if name == STRUT_LAW[1] else "stiffness_1"
        return replace(self, **{key: getattr(self, key) + n_per_m_from_n_per_um(change)})

    @property
    def points(self) -> list[tuple[float, float]]:
        """Length in m and stiffness in N/m of each point of the law; one point for a constant law."""
        if self.constant:
            return [(self.length_1, self.stiffness_1)]
        if not self.shape:
            return [(self.length_1, self.stiffness_1), (self.length_2, self.stiffness_2)]
        lengths, factors = np.array(self.shape).T
        inner = (factors * self._straight(lengths)).tolist()[1:-1]
        # Not by the straight line, which may miss its second end by the last digit.
        return list(zip(lengths.tolist(), [self.stiffness_1, *inner, self.stiffness_2], strict=True))

    @property
    def slope(self) -> float:
        """dk/dL in N/m per m of the straight line between both ends."""
        return (self.stiffness_2 - self.stiffness_1) / (self.length_2 - self.length_1)

    @property
    def intercept(self) -> float:
        """Stiffness of that line at L = 0 in N/m; unless the law is a table, k(L) = intercept + slope L."""
        return self.stiffness_1 - self.slope * self.length_1

    def stiffness(self, length: FloatArray) -> FloatArray:
        """Stiffness k(L) in N/m, of any shape. At or below 0, extrapolation has gone too far."""
        if not self.shape:
            return self._straight(length)
        lengths, stiffnesses = np.array(self.points).T
        return _piecewise(length, lengths, stiffnesses)

    def _straight(self, length: FloatArray) -> FloatArray:
        return self.intercept + self.slope * length

    def line_at(self, length: float) -> tuple[float, float]:
        """Stiffness at L = 0 in N/m and slope in N/m per m of the straight piece of the law at that length."""
        if not self.shape:
            return self.intercept, self.slope
        lengths, stiffnesses = np.array(self.points).T
        i = _segment(np.array(length), lengths)
        slope = float((stiffnesses[i + 1] - stiffnesses[i]) / (lengths[i + 1] - lengths[i]))
        return float(stiffnesses[i]) - slope * float(lengths[i]), slope

    def weights(self, length: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Weights of the two constants in the stiffness: k(L) = k1 first + k2 second.

        Of a table both share a point as on the straight line between the ends, times the shape: they do not change
        when the ends do. Of a constant law the first is all.
        """
        if self.constant:
            return np.ones_like(length), np.zeros_like(length)
        if not self.shape:
            second = (length - self.length_1) / (self.length_2 - self.length_1)
            return 1.0 - second, second
        lengths, factors = np.array(self.shape).T
        second = (lengths - self.length_1) / (self.length_2 - self.length_1)
        return _piecewise(length, lengths, factors * (1.0 - second)), _piecewise(length, lengths, factors * second)

    def room(self, length: FloatArray) -> FloatArray:
        """Distance of lengths inside the range of the law, m; negative outside; `NO_END` without a range."""
        return self.room_of(length, length)

    def room_of(self, shortest: FloatArray, longest: FloatArray) -> FloatArray:
        """Distance of the shortest and longest of some lengths inside the range of the law, m."""
        if self.constant:
            return np.asarray(NO_END + 0.0 * (shortest + longest))  # nan stays nan
        # Half a micrometre, so that a pose on an end of the range by construction is not outside it.
        slack = 5e-7
        low, high = sorted((self.length_1, self.length_2))
        return np.asarray(np.minimum(shortest - (low - slack), (high + slack) - longest))


def _piecewise(position: FloatArray, knots: FloatArray, values: FloatArray) -> FloatArray:
    """Linear interpolation of values (p,) at rising knots (p,), at positions of any shape; end pieces go on outside."""
    i = _segment(position, knots)
    slope = (values[1:] - values[:-1]) / (knots[1:] - knots[:-1])
    return np.asarray(values[i] + slope[i] * (position - knots[i]))


def _segment(position: FloatArray, knots: FloatArray) -> IntArray:
    return np.asarray(np.clip(np.searchsorted(knots, position, side="right") - 1, 0, len(knots) - 2))


@dataclass(frozen=True)
class Limits:
    """Limits of the machine's reach. Lengths in m, angles in rad; inf or -inf: no limit.

    Attributes
    ----------
    strut_length
        (min, max) strut length between the joint centres.
    frame_joint_angle, platform_joint_angle
        Largest swing of a joint from its neutral axis.
    workspace
        (2, 3) lower and upper corner of the box that the tool tip may not leave.
    singularity
        Smallest admissible singularity index, see `kinematics.singularity_index` (1 at the neutral pose,
        0 where the machine is singular).
    neutral_pose
        The pose at which the joints' neutral axes lie along the struts and the singularity index is 1.
    """

    strut_length: tuple[float, float] = (0.0, np.inf)
    frame_joint_angle: float = np.inf
    platform_joint_angle: float = np.inf
    workspace: FloatArray = field(default_factory=lambda: np.array([[-np.inf] * 3, [np.inf] * 3]))
    singularity: float = 0.0
    neutral_pose: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class EffectEntry:
    """One `[[effect]]` or `[[instrument]]` of a machine file: name, parameters in their own units, provenance.

    `file` and `lines` (key -> line, "" for the heading) say where it stands; they do not make entries differ.
    """

    name: str
    parameters: Document
    provenance: Document = field(default_factory=dict)
    file: str = field(default="", compare=False)
    lines: Mapping[str, int] = field(default_factory=dict, compare=False)

    def error(self, mistake: str, key: str = "", expected: str = "", hint: str = "", where: str = "") -> InputError:
        """Error at one of its keys, or at its heading; `where` names an entry that is in no file."""
        line = self.lines.get(key, self.lines.get(""))
        text = mistake if self.file or not where else f"{where}: {mistake}"
        return EffectError(text, expected=expected, hint=hint, file=self.file or None, line=line)


@dataclass(frozen=True, kw_only=True)
class MachineTool:
    """Base of all kinds of machines, SI units.

    A kind is a subclass: `Hexapod`, or one whose file describes what of its load path gives way (`elements`).

    Attributes
    ----------
    name, title, source
        Short name, title for headings, where the figures come from.
    reference_tool_length
        m, from the spindle nose to the tip that the geometry refers to; nan where nobody says: tools of a program then
        do not move the machine.
    limits
        Reach.
    default_origin
        Where program zero sits unless the user or the program says otherwise: m and rad.
    rapid_feed
        m/s, for the time of rapid moves.
    setup, temperature
        Clamping arrangement that is on the machine and degrees C, unless the user says so; None: nobody says.
    setups
        Clamping arrangements that are known by name.
    origins
        Quantity -> one of `ORIGINS`.
    remarks
        Quantity -> a sentence about its source.
    effects, instruments
        Physical effects that the machine file carries; instruments act on readings only.
    uncertainty
        Of parameters that were fitted to measurements; None if none were.
    text
        The machine file; "" where there is none.
    """

    kind: ClassVar[str]

    name: str
    title: str
    source: str
    reference_tool_length: float = np.nan
    limits: Limits = field(default_factory=Limits)
    default_origin: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rapid_feed: float = defaults.RAPID_FEED
    setup: str | None = None
    temperature: float | None = None
    setups: tuple[str, ...] = ()
    origins: Mapping[str, str] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)
    effects: tuple[EffectEntry, ...] = ()
    instruments: tuple[EffectEntry, ...] = ()
    uncertainty: Uncertainty | None = None
    text: str = field(default="", repr=False)

    def once(self, key: object, make: Callable[[], Derived]) -> Derived:
        """Result of `make` for this machine, computed once: machines never change, `with_changes` makes another."""
        known: dict[object, Any] = self.__dict__.setdefault("_derived", {})
        if key not in known:
            known[key] = make()
        derived: Derived = known[key]
        return derived

    def with_changes(self, **changes: Any) -> Self:
        """Copy with some attributes replaced."""
        return replace(self, **changes)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the j joints that the control moves."""
        raise NotImplementedError

    @property
    def joint_kinds(self) -> tuple[str, ...]:
        """Kind of each joint, "linear" or "rotary"."""
        return ("linear",) * len(self.joint_names)

    @property
    def joint_limits(self) -> FloatArray:
        """(j, 2) m or rad, low and high; -inf and inf: none, or a joint that stands."""
        return np.tile([-np.inf, np.inf], (len(self.joint_names), 1))

    @property
    def standing_joints(self) -> dict[str, float]:
        """Joint that no pose takes, such as a rail -> m or rad where it stands."""
        return {}

    @property
    def joint_speeds(self) -> FloatArray:
        """(j,) m/s or rad/s, largest speed of the joints; inf if not stated."""
        return np.full(len(self.joint_names), np.inf)

    @property
    def configurations(self) -> tuple[str, ...]:
        """Names of the ways to reach the same pose; a single one if there is no choice."""
        return ("",)

    @property
    def singularity_names(self) -> tuple[str, ...]:
        """Names of the s measures that vanish where the machine is singular."""
        return ()

    @property
    def singularity_margins(self) -> tuple[float, ...]:
        """Smallest admissible value of each measure, which is 1 at most."""
        return ()

    def singularities(self, stance: Stance) -> FloatArray:
        """(n, s) measures at n poses."""
        return np.empty((len(stance.joints), 0))

    @property
    def elements(self) -> tuple[Element, ...]:
        """Compliant elements, in the order of `Stance.loads`."""
        raise NotImplementedError

    def rotation_of(self, abc: FloatArray) -> FloatArray:
        """(n, 3, 3) orientation of the tool in work axes for programmed angles (n, 3) rad: roll, pitch, yaw."""
        return rotation_matrices(abc)

    def angles_of(self, abc: FloatArray) -> FloatArray:
        """(n, 3) rad, roll, pitch, yaw of the tool in work axes for programmed angles (n, 3) rad."""
        plain = type(self).rotation_of is MachineTool.rotation_of or not abc.any()
        return abc if plain else roll_pitch_yaw(self.rotation_of(abc))

    def solve(
        self,
        position: FloatArray,
        rotation: FloatArray | None = None,
        tool_length: ArrayLike = np.nan,
        configuration: int | None = None,
        start: FloatArray | None = None,
    ) -> Stance:
        """Stance at n poses, by inverse kinematics.

        Parameters
        ----------
        position, rotation
            (n, 3) m, the tip, and (n, 3, 3), the tool's axes, in work axes; None: upright.
        tool_length
            m, scalar or (n,); nan: the reference tool.
        configuration
            Index into `configurations`, kept at all poses; None: at each pose that furthest from the joints' limits.
        start
            (j,) joints before the first pose of a path, from which turns are counted on; None: nearest the middle.
        """
        raise NotImplementedError

    def stances(
        self, position: FloatArray, rotation: FloatArray | None = None, tool_length: ArrayLike = np.nan
    ) -> Iterable[Stance]:
        """Stance in each configuration in turn; the loads of elements may be left out."""
        return (self.solve(position, rotation, tool_length, i) for i in range(len(self.configurations)))

    def forward(self, joints: FloatArray, tool_length: ArrayLike = np.nan) -> tuple[FloatArray, FloatArray]:
        """(n, 3) m, the tip, and (n, 3, 3), the tool's axes, in work axes, for joints (n, j) m or rad."""
        raise NotImplementedError

    def weight_loads(self, stance: Stance) -> FloatArray:
        """(n, r) N and N m, loads of all elements, one after the other, under the machine's own weight."""
        return np.zeros((len(stance), sum(load.compliance.shape[-1] for load in stance.loads)))

    def standing(self, joints: FloatArray, tool_length: ArrayLike = np.nan) -> Stance:
        """Stance at joint values (n, j) m or rad, with tools of a length, m."""
        return self.solve(*self.forward(joints, tool_length), tool_length)

    def joint_of(self, element: str) -> int:
        """Number of the joint that an element is. Raises `InputError` if it is none."""
        raise InputError(f"machine {self.name}: element {element!r} is no joint that turns")

    def with_longer_link(self, joint: int, by: float) -> Self:
        """Machine with a joint moved further from the previous one, m."""
        return self

    def lines(self, stance: Stance) -> list[tuple[str, FloatArray]]:
        """Bodies of a drawing by name, (n, p, 3) m in base axes."""
        raise NotImplementedError

    def extension(self, tool_length: ArrayLike) -> FloatArray:
        """Length in m of tools beyond the reference tool; 0 if either length is nan."""
        return np.nan_to_num(np.asarray(tool_length, dtype=float) - self.reference_tool_length)


@dataclass(frozen=True, kw_only=True)
class Hexapod(MachineTool):
    """A six-strut platform machine, SI units.

    Attributes
    ----------
    frame_joints
        (6, 3) m, base frame; row i belongs to strut i + 1.
    platform_joints
        (6, 3) m, platform frame, relative to the tip of the reference tool.
    strut_law
        Stiffness of a strut over its length.
    platform_bar_stiffness
        N/m of each bar of the platform truss; inf: rigid.
    as_built
        (42,) by how much it is off all this, unknown to the control: ln of each strut's stiffness over the law's, then
        m of the frame joints' coordinates and of the platform joints'; None: not at all.
    """

    kind: ClassVar[str] = "hexapod"

    reference_tool_length: float
    frame_joints: FloatArray
    platform_joints: FloatArray
    strut_law: StrutLaw
    platform_bar_stiffness: float = np.inf
    as_built: FloatArray | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the struts."""
        return tuple(f"strut{i}" for i in range(1, 7))

    def platform_joints_for(self, tool_length: ArrayLike) -> FloatArray:
        """(6, 3) m, or (n, 6, 3) for n lengths: platform joints relative to a tool's tip; nan: the reference tool.

        A longer tool puts the joints further above the tip, along the spindle axis.
        """
        length = np.asarray(tool_length, dtype=float)
        if length.size and (np.isnan(length).all() or np.ptp(length) == 0.0):
            length = length.flat[0]  # the same for all poses: kinematics are then cheaper
        if np.ndim(length) == 0 and np.isnan(length):
            return self.platform_joints
        extension = np.where(np.isnan(length), 0.0, length - self.reference_tool_length)
        return np.asarray(self.platform_joints + extension[..., None, None] * np.array([0.0, 0.0, 1.0]))


def as_hexapod(machine: MachineTool, asking: str) -> Hexapod:
    """The machine as a hexapod. Raises `InputError` for another kind; `asking` begins the sentence."""
    if isinstance(machine, Hexapod):
        return machine
    mistake = f"{asking} works for machines with six struts only: {machine.name} is of kind {machine.kind}"
    raise InputError(mistake, expected="a hexapod")


@dataclass(frozen=True)
class Uncertainty:
    """Joint uncertainty of p fitted parameters.

    Attributes
    ----------
    names
        `StrutLaw.parameters`, or an effect's name and the key of its parameter: `spindle_compliance.radial_nm_per_N`.
    sd
        (p,) standard deviations in the units of the keys.
    correlation
        (p, p).
    errors
        How far the stiffness may be off at a pose, for bands; None unless stated.
    """

    names: tuple[str, ...]
    sd: FloatArray
    correlation: FloatArray
    errors: ErrorModel | None = None

    @classmethod
    def of(cls, names: Sequence[str], covariance: FloatArray) -> Uncertainty:
        """Uncertainty from a covariance (p, p) in the units of the keys."""
        sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        scale = np.where(sd > 0.0, sd, 1.0)
        correlation = np.clip(covariance / np.outer(scale, scale), -1.0, 1.0)
        np.fill_diagonal(correlation, 1.0)
        return cls(tuple(names), sd, correlation)

    @property
    def covariance(self) -> FloatArray:
        """(p, p) covariance in the units of the keys."""
        return np.asarray(np.outer(self.sd, self.sd) * self.correlation)

    def without(self, names: Sequence[str]) -> Uncertainty:
        """Uncertainty without some parameters."""
        kept = [i for i, name in enumerate(self.names) if name not in names]
        errors = None if self.errors is None else self.errors.of(kept)
        correlation = self.correlation[np.ix_(kept, kept)]
        return Uncertainty(tuple(self.names[i] for i in kept), self.sd[kept], correlation, errors)

    def beside(self, other: Uncertainty) -> Uncertainty:
        """Uncertainty of both, independent of each other; errors are kept if both state them."""
        count = len(self.names)
        correlation = np.eye(count + len(other.names))
        correlation[:count, :count] = self.correlation
        correlation[count:, count:] = other.correlation
        errors = self.errors.beside(other.errors) if self.errors and other.errors else None
        return Uncertainty(self.names + other.names, np.concatenate([self.sd, other.sd]), correlation, errors)
