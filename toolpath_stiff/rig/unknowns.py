"""The unknowns that the rig can hide: what no effect of the catalogue and none of the oddities describes.

They are there to judge descriptions of what is missing. Each is invented from its physics, with the shape that worn,
damaged or badly set machines show; no source gives figures for them. The sizes that are drawn change the stiffness by
4 to 15 % rms. Some act on what carries the platform (struts, joints, platform and frame), others are in series with
the whole load (work, table, floor, the frame as one piece, spindle, tool, instruments).

What an unknown is: physics of a link that no effect of the catalogue describes.

Each kind acts on the rig's own elements. What a description of it may name is settled from its physics, before any
diagnosis sees it: `links`, the links of the load path whose give has this signature at the tool tip, and `variables`,
what it varies with first of all. Several are right where they cannot differ in principle: a spring between tool and
work in base axes may sit in the frame as well as under the table; the temperature of a campaign that follows its clock
is a function of the order of the readings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.structure import BARS, Geometry, Links, Nominal, Rows, rotations, strut_directions

__all__ = [
    "END_KINDS",
    "REACH",
    "SOFT",
    "STRUT_KINDS",
    "UNKNOWNS",
    "Kind",
    "State",
    "Unknown",
    "beyond",
    "kind",
    "one_strut",
    "opened",
    "signed",
]


# Words of a description.
LINKS = ("instrument", "tool", "platform", "joints", "one strut", "struts", "frame", "table")
VARIABLES = (
    *("constant", "x", "y", "z", "radius", "tilt", "strut length", "strut force", "force sign"),
    *("load", "time", "order", "setup", "temperature", "direction"),
)
SOFT = 60e-9  # m/N, largest compliance that is tried: far beyond 30 % of a tip that gives 8 to 31 nm/N
REACH = 0.3  # m, half the width of the workspace that the paper measured
SIGN_WIDTH = 30.0  # N over which a seat opens: no contact lets go at a stroke (assumed)
HALF_SPAN = 0.4  # m, half the distance of a bed's feet (assumed)
FLOOR = -0.3  # m, height about which a bed rocks that stands on a weak floor (assumed)
KNEE = 1.6  # m, height of a portal's knee, above all poses (assumed)
SUPPORTS = 0.35  # m, radius of the circle of a table's three bearings (assumed)
SOFTENING = 1.5  # K over which a damping plate takes up its softness (assumed; the rig's shop warms by as much)
HOSE_LOAD = 500.0  # N, load at which a hose's pull is quoted
X, Y, Z = np.eye(3)
SWING = np.sin(np.radians(20.0)) ** 2  # squared sine of the swing at which compliances are quoted
LEAST_FORCE = 0.1  # N, below which a secant compliance is held
SOUND_BAR = 3e9  # N/m, the bars of a platform one of which is cracked: 1.4 % at the tip (assumed)
SLIP_LOAD = 300.0  # N, load at which a sticking joint carries half of what it does at rest (assumed)
PRELOAD_GROWS = 0.3  # of the campaign, time constant of a machine that warms up (assumed)


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
    shape: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class State:
    """n rows as the machine meets them: commanded strut lengths (n, 6) m and true places."""

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
        """(n, 6) how far out the struts are: 0 shortest, 1 longest."""
        low, high = self.nominal.strut_range
        return np.asarray((self.lengths - low) / (high - low))


def no_shape(rng: Generator) -> dict[str, Any]:
    """Nothing is drawn beside the size."""
    return {}


@dataclass(frozen=True)
class Kind:
    """A kind of unknown.

    Attributes
    ----------
    words
        What it is.
    links, variables
        What a description may name.
    limit
        Largest size that is tried.
    act
        What it does to the links; None: nothing.
    read
        (n,) factor on the stiffness that is read; None: 1.
    move
        (6, 3) m by which the frame joints stand elsewhere; None: not at all.
    shape
        Draws what is not size; `sign` in it goes to the size.
    varies
        Columns of `Rows` on which the mechanics depends beside pose, direction, tool and set-up.
    columns
        Columns that a measurement file needs to show it.
    """

    words: str
    links: frozenset[str]
    variables: frozenset[str]
    limit: float
    act: Callable[[Links, State, Unknown], Links] | None = None
    read: Callable[[Rows, Unknown], FloatArray] | None = None
    move: Callable[[Unknown], FloatArray] | None = None
    shape: Callable[[Generator], dict[str, Any]] = no_shape
    varies: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()


def kind(words: str, links: str, variables: str, limit: float, **more: Any) -> Kind:
    """A kind whose links and variables are given as words between commas."""
    return Kind(words, frozenset(links.split(",")), frozenset(variables.split(",")), limit, **more)


def opened(pull: FloatArray) -> FloatArray:
    """0 where a seat is pressed, 1 where it is pulled by `pull` N, and in between over some newtons."""
    return np.asarray(0.5 * (1.0 + np.tanh(pull / SIGN_WIDTH)))


def beyond(force: FloatArray, threshold: float) -> FloatArray:
    """Secant compliance, over that of the open state, of a link that is rigid up to a force: (|f| - f0) / |f|."""
    return np.asarray(np.maximum(0.0, 1.0 - threshold / np.maximum(np.abs(force), 1e-9)))


def one_strut(rng: Generator) -> dict[str, Any]:
    """Which strut, from 0."""
    return {"strut": int(rng.integers(6))}


def signed(rng: Generator) -> dict[str, Any]:
    """Which sign."""
    return {"sign": float(rng.choice([-1.0, 1.0]))}


def _with_ends(links: Links, *ends: tuple[FloatArray, FloatArray]) -> Links:
    return dataclasses.replace(links, ends=(*links.ends, *ends))


def _fixed(lever: FloatArray, at: State) -> FloatArray:
    """(n, 3) the same lever in every row."""
    return np.broadcast_to(lever, (len(at.rows.force), 3))


def _constant(size: float, at: State) -> FloatArray:
    return np.full(len(at.rows.force), size)


def _tip(at: State) -> FloatArray:
    return at.place.work_point


def bed_sag(links: Links, at: State, u: Unknown) -> Links:
    """A bed on two feet sags under the work: c = c0 (1 - (x / a)^2)^2 (simply supported beam, load at x: a^2 b^2)."""
    across = np.clip(_tip(at)[:, 0] / HALF_SPAN, -1.0, 1.0)
    return _with_ends(links, (_fixed(Z, at), u.size * (1.0 - across**2) ** 2))


def pallet_overhang(links: Links, at: State, u: Unknown) -> Links:
    """A pallet held in its middle bends like a cantilever: c = c0 (r / R)^3 vertically."""
    radius = np.linalg.norm(_tip(at)[:, :2], axis=1)
    return _with_ends(links, (_fixed(Z, at), u.size * (radius / REACH) ** 3))


def floor_rocking(links: Links, at: State, u: Unknown) -> Links:
    """The floor lets the bed rock about one horizontal axis far below the table."""
    axis = np.array([np.cos(u.shape["azimuth"]), np.sin(u.shape["azimuth"]), 0.0])
    return _with_ends(links, (np.cross(axis, _tip(at) - FLOOR * Z), _constant(u.size, at)))


def worn_table_bearing(links: Links, at: State, u: Unknown) -> Links:
    """One of the three bearings under the table is worn: it gives by its share of load and tilting moment.

    A load d at r puts on the bearing at angle p: -d_z (1/3 + 2 e.r / 3R) + (e.d) 2 z / 3R, with e towards the bearing.
    """
    toward = np.array([np.cos(u.shape["azimuth"]), np.sin(u.shape["azimuth"]), 0.0])
    tip = _tip(at)
    share = 1.0 / 3.0 + 2.0 / (3.0 * SUPPORTS) * tip @ toward
    lever = (2.0 / (3.0 * SUPPORTS) * tip[:, 2])[:, None] * toward - share[:, None] * Z
    return _with_ends(links, (lever, _constant(u.size, at)))


def fixture_slip(links: Links, at: State, u: Unknown) -> Links:
    """The fixture of one set-up holds by friction: beyond it the work gives sideways."""
    sideways = at.rows.force * np.linalg.norm(at.rows.direction[:, :2], axis=1)
    give = u.size * beyond(sideways, u.shape["holds"]) * (at.rows.setup == u.shape["setup"])
    return _with_ends(links, (_fixed(X, at), give), (_fixed(Y, at), give))


def damping_plate(links: Links, at: State, u: Unknown) -> Links:
    """A polymer plate under the table softens in shear as the shop warms up."""
    give = u.size * np.maximum(at.rows.warmth, 0.0) / SOFTENING
    return _with_ends(links, (_fixed(X, at), give), (_fixed(Y, at), give))


def clamp_loosened(links: Links, at: State, u: Unknown) -> Links:
    """A clamp of the table came loose in the middle of the campaign: from then on it gives sideways."""
    give = np.where(at.rows.elapsed > u.shape["after"], u.size, 0.0)
    return _with_ends(links, (_fixed(X, at), give), (_fixed(Y, at), give))


def portal_bending(links: Links, at: State, u: Unknown) -> Links:
    """The portal that carries the frame bends about a horizontal axis at its knee: the lower the tip, the more."""
    arm = _tip(at) - KNEE * Z
    return _with_ends(links, (np.cross(np.eye(3)[u.shape["axis"]], arm), _constant(u.size, at)))


def frame_twist(links: Links, at: State, u: Unknown) -> Links:
    """The frame twists about the machine's axis: a load along the tangent at radius r gives c r^2."""
    return _with_ends(links, (np.cross(Z, _tip(at)), _constant(u.size, at)))


def spindle_thrust(links: Links, at: State, u: Unknown) -> Links:
    """The spindle's bearings lose their preload when the tool is pulled, or pushed: it then gives, radially first."""
    tool = at.place.rotation[:, :, 2]
    thrust = at.rows.force * np.einsum("ni,ni->n", at.rows.direction, tool) * u.shape["side"]
    give = u.size * opened(thrust)
    return _with_ends(
        links,
        (at.place.rotation[:, :, 0], give),
        (at.place.rotation[:, :, 1], give),
        (tool, 0.5 * give),
    )


def spindle_flange(links: Links, at: State, u: Unknown) -> Links:
    """A screw of the spindle's flange is loose: the spindle rocks in the platform about one oblique axis of it."""
    across = np.cos(u.shape["azimuth"]) * at.place.rotation[:, :, 0]
    across = across + np.sin(u.shape["azimuth"]) * at.place.rotation[:, :, 1]
    longer = 1.0 + at.rows.extension / max(at.nominal.tool_length, 1e-3)
    return _with_ends(links, (longer[:, None] * across, _constant(u.size, at)))


def taper_opening(links: Links, at: State, u: Unknown) -> Links:
    """The tool holder's taper opens beyond a bending moment, with a longer tool sooner; then the tool tilts in it."""
    tool = at.place.rotation[:, :, 2]
    across = np.linalg.norm(np.cross(at.rows.direction, tool), axis=1)
    longer = 1.0 + at.rows.extension / max(at.nominal.tool_length, 1e-3)
    give = u.size * longer**2 * beyond(at.rows.force * across * longer, u.shape["opens"])
    return _with_ends(links, (at.place.rotation[:, :, 0], give), (at.place.rotation[:, :, 1], give))


# -- instruments: factors on the stiffness that is read ---------------------------------------------------------------


def indicator_stand(rows: Rows, u: Unknown) -> FloatArray:
    """A tall indicator stand gives way: sideways deflections are read too large, by the square of the height."""
    sideways = np.linalg.norm(rows.direction[:, :2], axis=1)
    return np.asarray(1.0 / (1.0 + u.size * sideways * rows.position[:, 2] ** 2))


def load_cell_hysteresis(rows: Rows, u: Unknown) -> FloatArray:
    """A load cell remembers a larger load of the same clamping just before: too high by a share of the drop."""
    before = np.concatenate([[0.0], rows.force[:-1]])
    anew = np.concatenate([[True], rows.time[1:] <= rows.time[:-1]])
    drop = np.where(anew, 0.0, np.maximum(before - rows.force, 0.0))
    return np.asarray(1.0 + u.size * drop / max(float(rows.force.max()), 1.0))


def load_cell_curve(rows: Rows, u: Unknown) -> FloatArray:
    """A load cell that is not linear: its error grows with the load."""
    return np.asarray(1.0 + u.size * (rows.force - 500.0) / 4000.0)


def hose_pull(rows: Rows, u: Unknown) -> FloatArray:
    """A hose pulls along Y the more, the further it is drawn out in y: it counts most where the load is small."""
    return np.asarray(
        1.0 + u.size * rows.position[:, 1] / REACH * HOSE_LOAD / rows.force * np.abs(rows.direction[:, 1])
    )


def cosine_error(rows: Rows, u: Unknown) -> FloatArray:
    """An indicator that tilts with the tool reads too little: cosine of the tilt, to a power for its lever."""
    return np.asarray(rotations(rows.angles)[:, 2, 2] ** -u.size)


def warm_indicator(rows: Rows, u: Unknown) -> FloatArray:
    """An indicator whose amplification drifts with the temperature."""
    return np.asarray(np.maximum(1.0 + u.size * rows.warmth / SOFTENING, 0.1))


def _azimuth(rng: Generator) -> dict[str, Any]:
    return {"azimuth": float(rng.uniform(0.0, 2.0 * np.pi))}


def _oblique(rng: Generator) -> dict[str, Any]:
    """Within 25 degrees of a diagonal of X and Y, in any quadrant."""
    quadrant = 0.5 * np.pi * float(rng.integers(4))
    return {"azimuth": quadrant + float(rng.uniform(np.radians(20.0), np.radians(70.0)))}


def _horizontal(rng: Generator) -> dict[str, Any]:
    return {"axis": int(rng.integers(2))}


# A spring between tool and work in base axes may sit in the frame as well as under the table: `BASE`. Temperature
# follows the clock of the campaign, so order and time may stand for it. What turns about an axis has one constant
# rotational compliance, and shows as a translation that grows with the arm: both are right. A load along the
# tangent of a circle about the axis is described by x and y as well as by the radius.
BASE = "table,frame"
END_KINDS: dict[str, Kind] = {
    "bed_sag": kind("the bed sags between its feet", BASE, "x", SOFT, act=bed_sag),
    "pallet_overhang": kind("the work gives vertically, far out", BASE, "radius", SOFT, act=pallet_overhang),
    "floor_rocking": kind(
        "the bed rocks about an axis in the floor", BASE, "z,constant", SOFT, act=floor_rocking, shape=_azimuth
    ),
    "worn_table_bearing": kind(
        "one of three bearings under the table is worn", BASE, "x,y,z,constant", SOFT,
        act=worn_table_bearing, shape=_azimuth,
    ),
    "fixture_slip": kind(
        "the fixture on the riser slips under large loads", "table", "setup,load", SOFT, act=fixture_slip,
        shape=lambda rng: {"holds": float(rng.uniform(800.0, 2500.0)), "setup": "riser"}, varies=("force",),
        columns=("force_N", "setup"),
    ),
    "damping_plate": kind(
        "a plate under the table softens with temperature", BASE, "temperature,order", SOFT, act=damping_plate,
        varies=("temperature",), columns=("temperature_C",),
    ),
    "clamp_loosened": kind(
        "a clamp of the table came loose on the way", BASE, "order", SOFT, act=clamp_loosened,
        shape=lambda rng: {"after": float(rng.uniform(0.3, 0.7))}, varies=("elapsed",),
    ),
    "portal_bending": kind(
        "the portal bends about an axis at its knee", BASE, "z,constant", 4 * SOFT, act=portal_bending,
        shape=_horizontal,
    ),
    "frame_twist": kind(
        "the frame twists about the machine's axis", BASE, "radius,x,y,constant", 30 * SOFT, act=frame_twist
    ),
    "spindle_thrust": kind(
        "the spindle loses its preload under thrust of one sign", "tool", "force sign,direction,tilt", SOFT,
        act=spindle_thrust, shape=lambda rng: {"side": float(rng.choice([-1.0, 1.0]))}, varies=("force",),
    ),
    "spindle_flange": kind(
        "the spindle rocks in the platform about one oblique axis", "platform,tool", "constant", SOFT,
        act=spindle_flange, shape=_oblique,
    ),
    "taper_opening": kind(
        "the tool holder's taper opens beyond a load", "tool", "load", SOFT, act=taper_opening,
        shape=lambda rng: {"opens": float(rng.uniform(800.0, 2500.0))}, varies=("force",), columns=("force_N",),
    ),
    "indicator_stand": kind(
        "the indicator's stand gives way, the higher the more", "instrument", "z", 1.0, read=indicator_stand
    ),
    "load_cell_hysteresis": kind(
        "the load cell reads too high after a larger load", "instrument", "order,load", 1.0, read=load_cell_hysteresis,
        columns=("force_N", "time_min"),
    ),
    "load_cell_curve": kind(
        "the load cell's error grows with the load", "instrument", "load", 0.6, read=load_cell_curve, shape=signed,
        columns=("force_N",),
    ),
    "hose_pull": kind(
        "a hose pulls along Y, in proportion to y", "instrument", "y,load", 0.6, read=hose_pull, shape=signed,
        columns=("force_N",),
    ),
    "cosine_error": kind(
        "the indicator tilts with the tool and reads too little", "instrument", "tilt", 12.0, read=cosine_error
    ),
    "warm_indicator": kind(
        "the indicator's amplification drifts with the temperature", "instrument", "temperature,order", 0.6,
        read=warm_indicator, shape=signed, columns=("temperature_C",),
    ),
}  # fmt: skip


def _with_joints(links: Links, extra: Callable[[FloatArray], FloatArray]) -> Links:
    """Further secant compliance (n, 6) along the struts from their forces (n, 6)."""
    return dataclasses.replace(links, joints=lambda forces: links.joints(forces) + extra(forces))


def _coupled(links: Links, shares: FloatArray, compliance: float) -> Links:
    """A spring that carries shares (n, 6) of the strut forces and lengthens each strut by its share: c a a^T."""
    flexibility = np.linalg.inv(links.struts) + compliance * shares[:, :, None] * shares[:, None, :]
    return dataclasses.replace(links, struts=np.asarray(np.linalg.inv(flexibility), dtype=np.float64))


def _only(strut: int) -> FloatArray:
    return np.where(np.arange(6) == strut, 1.0, 0.0)


def _swing(at: State) -> FloatArray:
    """(n, 6) squared sine of the platform joints' swing from the neutral pose."""
    pose = at.nominal.neutral_pose
    rest = strut_directions(at.nominal, pose[None, :3], rotations(pose[None, 3:]), np.zeros(1))[1]
    now = at.units @ at.place.rotation
    return np.asarray(1.0 - np.minimum(np.einsum("nki,nki->nk", np.broadcast_to(rest, now.shape), now) ** 2, 1.0))


def joint_swing(links: Links, at: State, u: Unknown) -> Links:
    """The forks of the platform joints bend the more, the further they swing out: c = c0 sin^2."""
    compliance = u.size * _swing(at) / SWING
    return _with_joints(links, lambda forces: compliance)


def cardan_fork(links: Links, at: State, u: Unknown) -> Links:
    """A cross whose inner pin, radial on the platform, is worn: c = c0 (share of the strut's force along the pin)^2."""
    joints = at.place.platform_joints - at.place.work_point[:, None, :]
    axis = at.place.rotation[:, :, 2]
    radial = joints - np.einsum("nki,ni->nk", joints, axis)[:, :, None] * axis[:, None, :]
    pin = radial / np.linalg.norm(radial, axis=2, keepdims=True)
    compliance = u.size * np.einsum("nki,nki->nk", at.units, pin) ** 2
    return _with_joints(links, lambda forces: compliance)


def joint_binding(links: Links, at: State, u: Unknown) -> Links:
    """Joints that bind near the end of their swing: rotational stiffness m0 sin^2."""
    return dataclasses.replace(links, moment=links.moment + u.size * _swing(at) / SWING)


def joint_slip(links: Links, at: State, u: Unknown) -> Links:
    """Sticking joints that slip: rotational secant stiffness m0 F0 / (F0 + F), Masing's element smeared out."""
    held = SLIP_LOAD / (SLIP_LOAD + at.rows.force)
    return dataclasses.replace(links, moment=links.moment + u.size * held[:, None] * np.ones(6))


def strut_backlash(links: Links, at: State, u: Unknown) -> Links:
    """Lost motion in one strut alone: c = g / |f|."""
    return _with_joints(links, lambda f: u.size / np.maximum(np.abs(f), LEAST_FORCE) * _only(u.shape["strut"]))


def nut_preload(links: Links, at: State, u: Unknown) -> Links:
    """Double nuts with too little preload: beyond it one of the two lets go and the struts are softer by c0."""
    return _with_joints(links, lambda f: u.size * beyond(f, u.shape["preload"]))


def thrust_bearing(links: Links, at: State, u: Unknown) -> Links:
    """The thrust bearing of one screw is worn on one side: softer in tension, or in compression."""
    return _with_joints(links, lambda f: u.size * opened(f * u.shape["side"]) * _only(u.shape["strut"]))


def strut_bowing(links: Links, at: State, u: Unknown) -> Links:
    """Struts not quite straight bow under compression: c grows as length^4 (Timoshenko, an initially bent column)."""
    compliance = u.size * (at.lengths / at.nominal.strut_range[1]) ** 4
    return _with_joints(links, lambda f: compliance * opened(-f))


def drive_spring(links: Links, at: State, u: Unknown) -> Links:
    """One drive loses stiffness in proportion to how far its strut is out, as a column of oil does."""
    compliance = u.size * np.maximum(at.stretched, 0.0) * _only(u.shape["strut"])
    return _with_joints(links, lambda forces: compliance)


def other_screw(links: Links, at: State, u: Unknown) -> Links:
    """One strut was replaced: its stiffness has another slope over the length, k exp(a (s - 1/2))."""
    factor = np.where(np.arange(6) == u.shape["strut"], np.exp(u.size * (at.stretched - 0.5)), 1.0)
    root = np.sqrt(factor)
    return dataclasses.replace(links, struts=links.struts * root[:, :, None] * root[:, None, :])


def screw_lead(links: Links, at: State, u: Unknown) -> Links:
    """One screw was ground with a wavy lead: its nut's stiffness varies periodically with the length."""
    wave = 1.0 + u.size * np.sin(2.0 * np.pi * at.lengths / u.shape["wavelength"] + u.shape["phase"])
    root = np.sqrt(np.where(np.arange(6) == u.shape["strut"], wave, 1.0))
    return dataclasses.replace(links, struts=links.struts * root[:, :, None] * root[:, None, :])


def motor_mount(links: Links, at: State, u: Unknown) -> Links:
    """Two neighbouring struts of different vertices hang on one soft bracket, which both load: c (f1 + f2)^2."""
    return _coupled(links, np.broadcast_to(_pair(at, u), at.lengths.shape), u.size)


def _pair(at: State, u: Unknown) -> FloatArray:
    first = u.shape["strut"]
    vertices = at.nominal.vertices
    other = next(s % 6 for s in range(first + 1, first + 6) if vertices[s % 6] != vertices[first])
    return _only(first) + _only(other)


def strut_heating(links: Links, at: State, u: Unknown) -> Links:
    """The motor of one strut holds it and heats its nut while the readings of a clamping are taken."""
    compliance = u.size * (at.rows.time / 300.0)[:, None] * _only(u.shape["strut"])
    return _with_joints(links, lambda forces: compliance)


def warm_up_preload(links: Links, at: State, u: Unknown) -> Links:
    """Joints gain their preload as the machine warms up: c = c0 exp(-t / tau) over the campaign."""
    compliance = u.size * np.exp(-at.rows.elapsed / PRELOAD_GROWS)[:, None] * np.ones(6)
    return _with_joints(links, lambda forces: compliance)


def cracked_bar(links: Links, at: State, u: Unknown) -> Links:
    """The bar from one joint of the platform to the spindle nose is cracked; the others are stiff, but not rigid."""
    stiffness = np.minimum(np.full(BARS, SOUND_BAR), links.bars)
    stiffness[12 + u.shape["strut"]] *= 1.0 - u.size  # after the rim and the spokes, six each
    return dataclasses.replace(links, bars=stiffness)


def frame_oval(links: Links, at: State, u: Unknown) -> Links:
    """The frame's ring goes oval: the radial loads of two posts act against each other, c (R1 - R2)^2."""
    vertices = at.nominal.vertices
    side = np.where(vertices == u.shape["vertex"], 1.0, np.where(vertices == (u.shape["vertex"] + 1) % 3, -1.0, 0.0))
    outward = at.place.frame_joints * np.array([1.0, 1.0, 0.0])
    outward /= np.linalg.norm(outward, axis=2, keepdims=True)
    return _coupled(links, np.einsum("nki,nki->nk", at.units, outward) * side, u.size)


def loose_vertex_bolt(links: Links, at: State, u: Unknown) -> Links:
    """A bolt of one post is loose: pulled down the post gives, a third as much outwards; pressed it sits."""
    vertex = u.shape["vertex"]
    mine = at.nominal.vertices == vertex
    down = at.units[:, :, 2] * mine

    def loose(forces: FloatArray) -> FloatArray:
        # A strut in tension pulls its vertex towards the platform, along the strut.
        pulled = opened(-np.einsum("nk,nk->n", forces, down))
        give = np.zeros((len(forces), *links.vertices.shape))
        give[:, vertex, 0], give[:, vertex, 1] = u.size * pulled / 3.0, u.size * pulled
        return give

    return dataclasses.replace(links, loose=loose)


def joint_seat(u: Unknown) -> FloatArray:
    """One frame joint stands elsewhere than the control believes."""
    moved = np.zeros((6, 3))
    moved[u.shape["strut"], u.shape["axis"]] = u.size
    return moved


def _vertex(rng: Generator) -> dict[str, Any]:
    return {"vertex": int(rng.integers(3))}


def _loose(rng: Generator) -> dict[str, Any]:
    """The second or third post: loads along +X, +Y and +Z never pull the first one of the paper's machine down."""
    return {"vertex": int(rng.integers(1, 3))}


def _wave(rng: Generator) -> dict[str, Any]:
    return one_strut(rng) | {"wavelength": float(rng.uniform(0.12, 0.3)), "phase": float(rng.uniform(0.0, 6.28))}


# What can be told at the tip: joints and struts are in series, so an effect of all joints may be called either; so is
# that of one strut, its joints and its drive. A strut's length follows height, radius and tilt of the pose, so what
# varies with a swing may be called by any pose variable that swings the joints; what gives along a pin is constant
# there, and shows as the strut swings about it.
ONE, ALL = "one strut,joints", "joints,struts"
STRUT_KINDS: dict[str, Kind] = {
    "joint_swing": kind(
        "joints softer the further they swing", ALL, "tilt,radius,strut length,z", SOFT, act=joint_swing
    ),
    "cardan_fork": kind(
        "joints softer along one pin of their cross", ALL, "constant,tilt,radius,strut length", SOFT, act=cardan_fork
    ),
    "joint_binding": kind(
        "joints that resist turning near the end of their swing", "joints,struts,platform",
        "tilt,radius,strut length,z", 3e6, act=joint_binding,
    ),
    "joint_slip": kind(
        "joints that resist turning under small loads and slip under large ones", "joints,struts,platform", "load",
        6e6, act=joint_slip, varies=("force",), columns=("force_N",),
    ),
    "strut_backlash": kind(
        "lost motion in one strut", ONE, "strut force,load", 50e-6, act=strut_backlash, shape=one_strut,
        varies=("force",), columns=("force_N",),
    ),
    "nut_preload": kind(
        "struts softer beyond the preload of their nuts", ALL, "strut force,load", SOFT, act=nut_preload,
        shape=lambda rng: {"preload": float(rng.uniform(150.0, 500.0))}, varies=("force",), columns=("force_N",),
    ),
    "thrust_bearing": kind(
        "one strut softer in tension or in compression", ONE, "force sign", SOFT, act=thrust_bearing,
        shape=lambda rng: one_strut(rng) | {"side": float(rng.choice([-1.0, 1.0]))}, varies=("force",),
    ),
    "strut_bowing": kind(
        "struts softer in compression, the longer the more", ALL, "force sign,strut length", SOFT, act=strut_bowing,
        varies=("force",),
    ),
    "drive_spring": kind(
        "one drive softer the further its strut is out", ONE, "strut length", SOFT, act=drive_spring, shape=one_strut
    ),
    "other_screw": kind(
        "one strut whose stiffness has another slope over its length", ONE, "strut length", 3.0, act=other_screw,
        shape=lambda rng: one_strut(rng) | signed(rng),
    ),
    "screw_lead": kind(
        "one strut's stiffness varies periodically with its length", ONE, "strut length", 0.85, act=screw_lead,
        shape=_wave,
    ),
    "motor_mount": kind(
        "two neighbouring struts on one soft bracket", "struts,joints,platform", "constant", SOFT,
        act=motor_mount, shape=one_strut,
    ),
    "strut_heating": kind(
        "one strut softens in the minutes of a clamping", ONE, "time", SOFT, act=strut_heating, shape=one_strut,
        varies=("time",), columns=("time_min",),
    ),
    "warm_up_preload": kind(
        "joints stiffen in the course of the campaign", ALL, "order,time,temperature", SOFT, act=warm_up_preload,
        varies=("elapsed",),
    ),
    "cracked_bar": kind(
        "one bar of the platform is cracked", "platform,joints,one strut", "constant", 0.9995, act=cracked_bar,
        shape=one_strut,
    ),
    "frame_oval": kind(
        "the frame's ring goes oval between two posts", "frame", "constant", SOFT, act=frame_oval, shape=_vertex
    ),
    "loose_vertex_bolt": kind(
        "one post of the frame gives when it is pulled down", "frame", "force sign,direction", SOFT,
        act=loose_vertex_bolt, shape=_loose, varies=("force",),
    ),
    "joint_seat": kind(
        "one frame joint stands elsewhere", "frame,joints,one strut", "constant", 0.3, move=joint_seat,
        shape=lambda rng: one_strut(rng) | {"axis": int(rng.integers(3))} | signed(rng),
    ),
}  # fmt: skip
UNKNOWNS: dict[str, Kind] = {**STRUT_KINDS, **END_KINDS}
