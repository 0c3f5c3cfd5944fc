"""What a six-strut machine is: joints, tool, strut law, platform bars, limits. SI units.

Every quantity carries its origin: "published", "recovered" (from published figures), "assumed", or "fitted" (to
measurements, by `tps update`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.units import Pose

if TYPE_CHECKING:
    from toolpath_stiff.machine.uncertainty import Uncertainty

FloatArray = NDArray[np.float64]

ORIGINS = ("published", "recovered", "assumed", "fitted")


@dataclass(frozen=True)
class StrutLaw:
    """Strut stiffness as a linear function of length, the paper's equation 5.

    k(L) = k1 + (k2 - k1) (L - L1) / (L2 - L1). Lengths in m, stiffnesses in N/m. Between L1 and L2 the law
    is what its source gives; outside it is extrapolated.
    """

    length_1: float
    stiffness_1: float
    length_2: float
    stiffness_2: float

    @property
    def slope(self) -> float:
        """dk/dL in N/m per m."""
        return (self.stiffness_2 - self.stiffness_1) / (self.length_2 - self.length_1)

    @property
    def intercept(self) -> float:
        """Stiffness at L = 0 in N/m, so that k(L) = intercept + slope L."""
        return self.stiffness_1 - self.slope * self.length_1

    def stiffness(self, length: FloatArray) -> FloatArray:
        """Stiffness k(L) in N/m, of any shape. At or below 0 the law has been carried too far."""
        return self.intercept + self.slope * length

    def room(self, length: FloatArray) -> FloatArray:
        """How far lengths lie inside the range that the law was given for, m; negative outside."""
        # Half a micrometre: a pose that lands on an end of the range by construction is not outside it.
        slack = 5e-7
        low, high = sorted((self.length_1, self.length_2))
        return np.asarray(np.minimum(length - (low - slack), (high + slack) - length))

    def extrapolates(self, length: FloatArray) -> NDArray[np.bool_]:
        """Whether a length lies outside the range that the law was given for."""
        return np.asarray(self.room(length) < 0.0)


@dataclass(frozen=True)
class Limits:
    """What the machine can reach. Lengths in m, angles in rad; inf or -inf: no limit.

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
    """One `[[effect]]` or `[[instrument]]` of a machine file: its name, parameters in their own units, provenance.

    `file` and `lines` (key -> line, "" for the heading) say where it stands; they do not make entries differ.
    """

    name: str
    parameters: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    file: str = field(default="", compare=False)
    lines: Mapping[str, int] = field(default_factory=dict, compare=False)

    def error(self, found: str, key: str = "", expected: str = "", hint: str = "", where: str = "") -> InputError:
        """An error at one of its keys, or at its heading; `where` names an entry that no file holds."""
        line = self.lines.get(key, self.lines.get(""))
        text = found if self.file or not where else f"{where}: {found}"
        return InputError(text, expected=expected, hint=hint, file=self.file or None, line=line)


@dataclass(frozen=True)
class Machine:
    """A six-strut platform machine, SI units.

    Attributes
    ----------
    name, title, source
        Short name, title for headings, where the figures come from.
    frame_joints
        (6, 3) m, base frame; row i belongs to strut i + 1.
    platform_joints
        (6, 3) m, platform frame, relative to the tip of the reference tool.
    reference_tool_length
        m, from the spindle nose to the tip that `platform_joints` refers to.
    strut_law
        Stiffness of a strut over its length.
    platform_bar_stiffness
        N/m of each bar of the platform truss; inf: rigid.
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
    """

    name: str
    title: str
    source: str
    frame_joints: FloatArray
    platform_joints: FloatArray
    reference_tool_length: float
    strut_law: StrutLaw
    platform_bar_stiffness: float = np.inf
    limits: Limits = field(default_factory=Limits)
    default_origin: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rapid_feed: float = 10.0 / 60.0
    setup: str | None = None
    temperature: float | None = None
    setups: tuple[str, ...] = ()
    origins: Mapping[str, str] = field(default_factory=dict)
    remarks: Mapping[str, str] = field(default_factory=dict)
    effects: tuple[EffectEntry, ...] = ()
    instruments: tuple[EffectEntry, ...] = ()
    uncertainty: Uncertainty | None = None

    def platform_joints_for(self, tool_length: float) -> FloatArray:
        """(6, 3) m, platform joints relative to the tip of a tool of that length; nan: the reference tool.

        A longer tool puts the joints further above the tip, along the spindle axis.
        """
        if np.isnan(tool_length):
            return self.platform_joints
        shift = np.array([0.0, 0.0, tool_length - self.reference_tool_length])
        return np.asarray(self.platform_joints + shift)

    def with_changes(self, **changes: Any) -> Machine:
        """A copy with some attributes replaced."""
        return replace(self, **changes)
