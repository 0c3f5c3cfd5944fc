"""Unknowns in series with the whole load: work, table, floor, the frame as one piece, spindle, tool; instruments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.nominal import rotations
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Links
from toolpath_stiff.rig.unknown import REACH, SOFT, _with_ends, beyond, kind, opened, signed

if TYPE_CHECKING:
    from toolpath_stiff.rig.unknown import CommandedRows, Kind, Unknown


HALF_SPAN = 0.4  # m, half the distance of a bed's feet (assumed)


FLOOR = -0.3  # m, height about which a bed rocks that stands on a weak floor (assumed)


KNEE = 1.6  # m, height of a portal's knee, above all poses (assumed)


SUPPORTS = 0.35  # m, radius of the circle of a table's three bearings (assumed)


SOFTENING = 1.5  # K over which a damping plate takes up its softness (assumed; the rig's shop warms by as much)


HOSE_LOAD = 500.0  # N, load at which a hose's pull is quoted


X, Y, Z = np.eye(3)


def _fixed(lever: FloatArray, state: CommandedRows) -> FloatArray:
    """(n, 3) the same lever in every row."""
    return np.broadcast_to(lever, (len(state.rows.force), 3))


def _constant(size: float, state: CommandedRows) -> FloatArray:
    return np.full(len(state.rows.force), size)


def _tip(state: CommandedRows) -> FloatArray:
    return state.place.work_point


def bed_sag(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """A bed on two feet sags under the work: c = c0 (1 - (x / a)^2)^2 (simply supported beam, load at x: a^2 b^2)."""
    across = np.clip(_tip(state)[:, 0] / HALF_SPAN, -1.0, 1.0)
    return _with_ends(links, (_fixed(Z, state), u.size * (1.0 - across**2) ** 2))


def pallet_overhang(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """A pallet held in its middle bends like a cantilever: c = c0 (r / R)^3 vertically."""
    radius = np.linalg.norm(_tip(state)[:, :2], axis=1)
    return _with_ends(links, (_fixed(Z, state), u.size * (radius / REACH) ** 3))


def floor_rocking(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The floor lets the bed rock about one horizontal axis far below the table."""
    axis = np.array([np.cos(u.shape["azimuth"]), np.sin(u.shape["azimuth"]), 0.0])
    return _with_ends(links, (np.cross(axis, _tip(state) - FLOOR * Z), _constant(u.size, state)))


def worn_table_bearing(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """One of the three bearings under the table is worn: it gives by its share of load and tilting moment.

    A load d at r puts on the bearing at angle p: -d_z (1/3 + 2 e.r / 3R) + (e.d) 2 z / 3R, with e towards the bearing.
    """
    toward = np.array([np.cos(u.shape["azimuth"]), np.sin(u.shape["azimuth"]), 0.0])
    tip = _tip(state)
    share = 1.0 / 3.0 + 2.0 / (3.0 * SUPPORTS) * tip @ toward
    lever = (2.0 / (3.0 * SUPPORTS) * tip[:, 2])[:, None] * toward - share[:, None] * Z
    return _with_ends(links, (lever, _constant(u.size, state)))


def fixture_slip(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The fixture of one set-up holds by friction: beyond it the work gives sideways."""
    sideways = state.rows.force * np.linalg.norm(state.rows.direction[:, :2], axis=1)
    give = u.size * beyond(sideways, u.shape["holds"]) * (state.rows.setup == u.shape["setup"])
    return _with_ends(links, (_fixed(X, state), give), (_fixed(Y, state), give))


def damping_plate(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """A polymer plate under the table softens in shear as the shop warms up."""
    give = u.size * np.maximum(state.rows.warmth, 0.0) / SOFTENING
    return _with_ends(links, (_fixed(X, state), give), (_fixed(Y, state), give))


def clamp_loosened(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """A clamp of the table came loose in the middle of the campaign: from then on it gives sideways."""
    give = np.where(state.rows.elapsed > u.shape["after"], u.size, 0.0)
    return _with_ends(links, (_fixed(X, state), give), (_fixed(Y, state), give))


def portal_bending(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The portal that carries the frame bends about a horizontal axis at its knee: the lower the tip, the more."""
    arm = _tip(state) - KNEE * Z
    return _with_ends(links, (np.cross(np.eye(3)[u.shape["axis"]], arm), _constant(u.size, state)))


def frame_twist(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The frame twists about the machine's axis: a load along the tangent at radius r gives c r^2."""
    return _with_ends(links, (np.cross(Z, _tip(state)), _constant(u.size, state)))


def spindle_thrust(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The spindle's bearings lose their preload when the tool is pulled, or pushed: it then gives, radially first."""
    tool = state.place.rotation[:, :, 2]
    thrust = state.rows.force * np.einsum("ni,ni->n", state.rows.direction, tool) * u.shape["side"]
    give = u.size * opened(thrust)
    return _with_ends(
        links, (state.place.rotation[:, :, 0], give), (state.place.rotation[:, :, 1], give), (tool, 0.5 * give)
    )


def spindle_flange(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """A screw of the spindle's flange is loose: the spindle rocks in the platform about one oblique axis of it."""
    across = np.cos(u.shape["azimuth"]) * state.place.rotation[:, :, 0]
    across = across + np.sin(u.shape["azimuth"]) * state.place.rotation[:, :, 1]
    longer = 1.0 + state.rows.extension / max(state.nominal.tool_length, 1e-3)
    return _with_ends(links, (longer[:, None] * across, _constant(u.size, state)))


def taper_opening(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The tool holder's taper opens beyond a bending moment, with a longer tool sooner; then the tool tilts in it."""
    tool = state.place.rotation[:, :, 2]
    across = np.linalg.norm(np.cross(state.rows.direction, tool), axis=1)
    longer = 1.0 + state.rows.extension / max(state.nominal.tool_length, 1e-3)
    give = u.size * longer**2 * beyond(state.rows.force * across * longer, u.shape["opens"])
    return _with_ends(links, (state.place.rotation[:, :, 0], give), (state.place.rotation[:, :, 1], give))


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
