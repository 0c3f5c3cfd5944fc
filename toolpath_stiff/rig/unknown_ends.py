"""Unknowns in series with the whole load: work, table, floor, the frame as one piece, spindle, tool; instruments."""

from functools import partial

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import Hideable, drawn, side, signed, uniform
from toolpath_stiff.rig.kinematics import rotations
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Links, PosedRows
from toolpath_stiff.rig.unknown import REACH, SOFT, Unknown, X, Y, Z, beyond, kind, opened

END_KINDS: dict[str, Hideable] = {}
act = partial(kind, END_KINDS, "act")
read = partial(kind, END_KINDS, "read")

HALF_SPAN = 0.4  # m, half the distance of a bed's feet (assumed)
FLOOR = -0.3  # m, height about which a bed rocks that stands on a weak floor (assumed)
SUPPORTS = 0.35  # m, radius of the circle of a table's three bearings (assumed)
SOFTENING = 1.5  # K over which a damping plate takes up its softness (assumed; the rig's shop warms by as much)

# A spring between tool and work in base axes may sit in the frame as well as under the table: `BASE`. Temperature
# follows the clock of the campaign, so order and time may stand for it. What turns about an axis has one constant
# rotational compliance, and shows as a translation that grows with the arm: both are right. A load along the
# tangent of a circle about the axis is described by x and y as well as by the radius.
BASE = "table,frame"
AZIMUTH = uniform("azimuth", 0.0, 2.0 * np.pi)
HOLDS = drawn(uniform("holds", 800.0, 2500.0), lambda *_: {"setup": "riser"})


@act(BASE, "y", SOFT)
def cracked_bed(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The workpiece side gives way where y is positive only."""
    give = np.where(state.rows.position[:, 1] > 0.0, u.size, 0.0)
    return links.with_ends((X, give), (Y, give))


@act(BASE, "y", SOFT)
def saddle_overhang(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The workpiece side gives way along X, growing with the square of y."""
    return links.with_ends((X, u.size * (state.rows.position[:, 1] / REACH) ** 2))


@read("instrument", "x", 0.5, shape=signed)
def cable_drag(rows: Rows, u: Unknown) -> FloatArray:
    """A cable pulls along X in proportion to x, and the gauge reads it."""
    return np.asarray(1.0 + u.size * rows.position[:, 0] / REACH * np.abs(rows.direction[:, 0]))


@act(BASE, "x", SOFT)
def bed_sag(links: Links, state: PosedRows, u: Unknown) -> Links:
    """A bed on two feet sags under the work: c = c0 (1 - (x / a)^2)^2 (simply supported beam, load at x: a^2 b^2)."""
    across = np.clip(state.work_point[:, 0] / HALF_SPAN, -1.0, 1.0)
    return links.with_ends((Z, u.size * (1.0 - across**2) ** 2))


@act(BASE, "radius", SOFT)
def pallet_overhang(links: Links, state: PosedRows, u: Unknown) -> Links:
    """A pallet held in its middle bends like a cantilever: c = c0 (r / R)^3 vertically."""
    radius = np.linalg.norm(state.work_point[:, :2], axis=1)
    return links.with_ends((Z, u.size * (radius / REACH) ** 3))


@act(BASE, "z,constant", SOFT, shape=AZIMUTH)
def floor_rocking(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The floor lets the bed rock about one horizontal axis far below the table."""
    axis = np.array([np.cos(u.shape["azimuth"]), np.sin(u.shape["azimuth"]), 0.0])
    return links.with_ends((np.cross(axis, state.work_point - FLOOR * Z), u.size))


@act(BASE, "x,y,z,constant", SOFT, shape=AZIMUTH)
def worn_table_bearing(links: Links, state: PosedRows, u: Unknown) -> Links:
    """One of the three bearings under the table is worn: it gives by its share of load and tilting moment.

    A load d at r puts on the bearing at angle p: -d_z (1/3 + 2 e.r / 3R) + (e.d) 2 z / 3R, with e towards the bearing.
    """
    toward = np.array([np.cos(u.shape["azimuth"]), np.sin(u.shape["azimuth"]), 0.0])
    tip = state.work_point
    share = 1.0 / 3.0 + 2.0 / (3.0 * SUPPORTS) * tip @ toward
    lever = (2.0 / (3.0 * SUPPORTS) * tip[:, 2])[:, None] * toward - share[:, None] * Z
    return links.with_ends((lever, u.size))


@act("table", "setup,load", SOFT, shape=HOLDS, needs="force_N,setup")
def fixture_slip(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The fixture of one set-up holds by friction: beyond it the work gives sideways."""
    sideways = state.rows.force * np.linalg.norm(state.rows.direction[:, :2], axis=1)
    give = u.size * beyond(sideways, u.shape["holds"]) * (state.rows.setup == u.shape["setup"])
    return links.with_ends((X, give), (Y, give))


@act(BASE, "temperature,order", SOFT, needs="temperature_C")
def damping_plate(links: Links, state: PosedRows, u: Unknown) -> Links:
    """A polymer plate under the table softens in shear as the shop warms up."""
    give = u.size * np.maximum(state.rows.warmth, 0.0) / SOFTENING
    return links.with_ends((X, give), (Y, give))


@act(BASE, "order", SOFT, shape=uniform("after", 0.3, 0.7))
def clamp_loosened(links: Links, state: PosedRows, u: Unknown) -> Links:
    """A clamp of the table came loose in the middle of the campaign: from then on it gives sideways."""
    give = np.where(state.rows.elapsed > u.shape["after"], u.size, 0.0)
    return links.with_ends((X, give), (Y, give))


@act(BASE, "radius,x,y,constant", 30 * SOFT)
def frame_twist(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The frame twists about the machine's axis: a load along the tangent at radius r gives c r^2."""
    return links.with_ends((np.cross(Z, state.work_point), u.size))


@act("tool", "force sign,direction,tilt", SOFT, shape=side)
def spindle_thrust(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The spindle's bearings lose their preload when the tool is pulled, or pushed: it then gives, radially first."""
    tool = state.rotation[:, :, 2]
    thrust = state.rows.force * np.einsum("ni,ni->n", state.rows.direction, tool) * u.shape["side"]
    give = u.size * opened(thrust)
    return links.with_ends((state.rotation[:, :, 0], give), (state.rotation[:, :, 1], give), (tool, 0.5 * give))


@act("tool", "load", SOFT, shape=uniform("opens", 800.0, 2500.0), needs="force_N")
def taper_opening(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The tool holder's taper opens beyond a bending moment, with a longer tool sooner; then the tool tilts in it."""
    tool = state.rotation[:, :, 2]
    across = np.linalg.norm(np.cross(state.rows.direction, tool), axis=1)
    longer = 1.0 + state.rows.extension / max(state.nominal.tool_length, 1e-3)
    give = u.size * longer**2 * beyond(state.rows.force * across * longer, u.shape["opens"])
    return links.with_ends((state.rotation[:, :, 0], give), (state.rotation[:, :, 1], give))


@read("instrument", "order,load", 1.0, needs="force_N,time_min")
def load_cell_hysteresis(rows: Rows, u: Unknown) -> FloatArray:
    """A load cell remembers a larger load of the same clamping just before: too high by a share of the drop."""
    before = np.concatenate([[0.0], rows.force[:-1]])
    anew = np.concatenate([[True], rows.time[1:] <= rows.time[:-1]])
    drop = np.where(anew, 0.0, np.maximum(before - rows.force, 0.0))
    return np.asarray(1.0 + u.size * drop / max(float(rows.force.max()), 1.0))


@read("instrument", "tilt", 12.0)
def cosine_error(rows: Rows, u: Unknown) -> FloatArray:
    """An indicator that tilts with the tool reads too little: cosine of the tilt, to a power for its lever."""
    return np.asarray(rotations(rows.angles)[:, 2, 2] ** -u.size)


@read("instrument", "temperature,order", 0.6, shape=signed, needs="temperature_C")
def warm_indicator(rows: Rows, u: Unknown) -> FloatArray:
    """An indicator whose amplification drifts with the temperature."""
    return np.asarray(np.maximum(1.0 + u.size * rows.warmth / SOFTENING, 0.1))
