"""Unknowns: physics of links that no effect of the catalogue describes.

Each kind acts on the rig's own elements. What a description of it may name is settled from its physics, before any
diagnosis sees it: `links`, the links of the load path whose give has this signature at the tool tip, and `variables`,
what it varies with first of all. Several are right where they cannot differ in principle: a spring between tool and
work in base axes may sit in the frame as well as under the table; the temperature of a campaign that follows its clock
is a function of the order of the readings.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import Draw, Shape, nothing
from toolpath_stiff.rig.kinematics import neutral_directions
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Geometry, Links

Physics = TypeVar("Physics", bound=Callable[..., Any])
X, Y, Z = np.eye(3)

# Words of a description.
LINKS = ("instrument", "tool", "platform", "joints", "one strut", "struts", "frame", "table")
VARIABLES = (
    *("constant", "x", "y", "z", "radius", "tilt", "strut length", "strut force", "force sign"),
    *("load", "time", "order", "setup", "temperature", "direction"),
)
# What can be told at the tip: joints and struts are in series, so an effect of all joints may be called either; so is
# that of one strut, its joints and its drive. A strut's length follows height, radius and tilt of the pose, so what
# varies with a swing may be called by any pose variable that swings the joints; what gives along a pin is constant
# there, and shows as the strut swings about it.
ONE, ALL = "one strut,joints", "joints,struts"
SOFT = 60e-9  # m/N, largest compliance that is tried: far beyond 30 % of a tip that gives 8 to 31 nm/N
REACH = 0.3  # m, half the width of the workspace that the paper measured
SIGN_WIDTH = 30.0  # N over which a seat opens: no contact lets go at a stroke (assumed)


@dataclass(frozen=True)
class Unknown:
    """One unknown in one machine.

    Attributes
    ----------
    kind
        Its name in `UNKNOWNS`.
    size
        In the kind's own SI unit, or a ratio.
    shape
        What else was drawn: which strut, which axis, where.
    """

    kind: str
    size: float
    shape: Shape = field(default_factory=dict)


@dataclass(frozen=True)
class CommandedRows:
    """n rows as the machine sees them: commanded strut lengths (n, 6) m and true positions."""

    nominal: Nominal
    rows: Rows
    lengths: FloatArray
    place: Geometry

    @property
    def units(self) -> FloatArray:
        """(n, 6, 3) along the struts, from frame to platform, base axes."""
        strut = self.place.platform_joints - self.place.frame_joints
        return np.asarray(strut / np.linalg.norm(strut, axis=2, keepdims=True))

    @property
    def stretched(self) -> FloatArray:
        """(n, 6) extension of the struts: 0 shortest, 1 longest."""
        low, high = self.nominal.strut_range
        return np.asarray((self.lengths - low) / (high - low))

    @property
    def swing(self) -> FloatArray:
        """(n, 6) squared sine of the platform joints' swing from the neutral pose."""
        rest, now = neutral_directions(self.nominal)[1], self.units @ self.place.rotation
        along = np.einsum("nki,nki->nk", np.broadcast_to(rest, now.shape), now)
        return np.asarray(1.0 - np.minimum(along**2, 1.0))


@dataclass(frozen=True)
class Kind:
    """A kind of unknown.

    Attributes
    ----------
    links, variables
        What a description may name.
    limit
        Largest size that is tried.
    act
        What it does to the links; None: nothing.
    read
        (n,) factor on the stiffness that is read; None: 1.
    shape
        Draws what is not size; `sign` in it goes to the size.
    columns
        Columns that a measurement file needs to show it.
    """

    links: frozenset[str]
    variables: frozenset[str]
    limit: float
    act: Callable[[Links, CommandedRows, Unknown], Links] | None = None
    read: Callable[[Rows, Unknown], FloatArray] | None = None
    shape: Draw = nothing
    columns: tuple[str, ...] = ()


def kind(
    kinds: dict[str, Kind], role: str, links: str, variables: str, limit: float, **more: Any
) -> Callable[[Physics], Physics]:
    """Register the decorated function as a kind under its name; links, variables, columns are separated by commas.

    `role`: `act` or `read`.
    """

    def registered(physics: Physics) -> Physics:
        more.update({role: physics, "columns": tuple(filter(None, more.get("columns", "").split(",")))})
        kinds[physics.__name__] = Kind(frozenset(links.split(",")), frozenset(variables.split(",")), limit, **more)
        return physics

    return registered


def opened(pull: FloatArray) -> FloatArray:
    """0 where a seat is pressed, 1 where it is pulled by `pull` N, with a smooth change over some newtons."""
    return np.asarray(0.5 * (1.0 + np.tanh(pull / SIGN_WIDTH)))


def beyond(force: FloatArray, threshold: float) -> FloatArray:
    """Secant compliance, relative to the open state, of a link that is rigid up to a force f0: (|f| - f0) / |f|."""
    return np.asarray(np.maximum(0.0, 1.0 - threshold / np.maximum(np.abs(force), 1e-9)))
