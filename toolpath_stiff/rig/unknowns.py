"""Faults outside the catalogue that the rig can hide: oddities, and unknowns, judged by their description.

Each is invented from its physics, with the shape that worn, damaged or badly set machines show; no source gives figures
for them. The sizes that are drawn of unknowns change the stiffness by 4 to 15 % rms. Oddities are what a blind draw
hides: one formula each, which the columns of any campaign show.

They act in series with the whole load (work, table, spindle), on one strut, or on instruments. Joints in general,
platform and frame are the faults of finite elements (`fem_faults`).
"""

import dataclasses
from functools import partial

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import Hideable, drawn, one_strut, side, signed, uniform
from toolpath_stiff.rig.kinematics import rotations
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Links, PosedRows
from toolpath_stiff.rig.unknown import REACH, SOFT, Unknown, X, Y, Z, beyond, kind, opened

OUTSIDE: dict[str, Hideable] = {}
act = partial(kind, OUTSIDE, "act")
read = partial(kind, OUTSIDE, "read")

SOFTENING = 1.5  # K over which a damping plate takes up its softness (assumed; the rig's shop warms by as much)

# What can be told at the tip: a spring between tool and work in base axes may sit in the frame as well as under the
# table; an effect of one strut, its joints or its drive may be called any of these. Temperature follows the clock of
# the campaign, so order and time may stand for it.
BASE, ONE = "table,frame", "one strut,joints"
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


@act(BASE, "radius", SOFT)
def pallet_overhang(links: Links, state: PosedRows, u: Unknown) -> Links:
    """A pallet held in its middle bends like a cantilever: c = c0 (r / R)^3 vertically."""
    radius = np.linalg.norm(state.work_point[:, :2], axis=1)
    return links.with_ends((Z, u.size * (radius / REACH) ** 3))


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


@act("tool", "force sign,direction,tilt", SOFT, shape=side)
def spindle_thrust(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The spindle's bearings lose their preload when the tool is pulled, or pushed: it then gives, radially first."""
    tool = state.rotation[:, :, 2]
    thrust = state.rows.force * np.einsum("ni,ni->n", state.rows.direction, tool) * u.shape["side"]
    give = u.size * opened(thrust)
    return links.with_ends((state.rotation[:, :, 0], give), (state.rotation[:, :, 1], give), (tool, 0.5 * give))


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


def _only(strut: int) -> FloatArray:
    return np.where(np.arange(6) == strut, 1.0, 0.0)


@act(ONE, "force sign", SOFT, shape=drawn(one_strut, side))
def thrust_bearing(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The thrust bearing of one screw is worn on one side: softer in tension, or in compression."""
    return links.with_joints(lambda f: u.size * opened(f * u.shape["side"]) * _only(u.shape["strut"]))


@act(ONE, "strut length", 0.85, shape=drawn(one_strut, uniform("wavelength", 0.12, 0.3), uniform("phase", 0.0, 6.28)))
def screw_lead(links: Links, state: PosedRows, u: Unknown) -> Links:
    """One screw was ground with a wavy lead: its nut's stiffness varies periodically with the length."""
    wave = u.size * np.sin(2.0 * np.pi * state.lengths / u.shape["wavelength"] + u.shape["phase"])
    return dataclasses.replace(links, struts=links.struts * (1.0 + wave * _only(u.shape["strut"])))


@act(ONE, "time", SOFT, shape=one_strut, needs="time_min")
def strut_heating(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The motor of one strut holds it and heats its nut while the readings of a clamping are taken."""
    return links.with_joints(u.size * (state.rows.time / 300.0)[:, None] * _only(u.shape["strut"]))


ODDITIES = {name: OUTSIDE[name] for name in ("cracked_bed", "saddle_overhang", "cable_drag")}
UNKNOWNS = {name: kind for name, kind in OUTSIDE.items() if name not in ODDITIES}
