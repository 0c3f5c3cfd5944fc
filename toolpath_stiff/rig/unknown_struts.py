"""Unknowns of struts and their joints, platform and frame: they act on what carries the platform."""

import dataclasses
from functools import partial

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import Hideable, drawn, one_strut, side, uniform
from toolpath_stiff.rig.structure import Links, PosedRows
from toolpath_stiff.rig.unknown import ALL, ONE, SOFT, Unknown, beyond, kind, opened

STRUT_KINDS: dict[str, Hideable] = {}
act = partial(kind, STRUT_KINDS, "act")

SLIP_LOAD = 300.0  # N, load at which a sticking joint carries half of what it does at rest (assumed)
LEAST_FORCE = 0.1  # N, below which a secant compliance is held
PRELOAD_GROWS = 0.3  # of the campaign, time constant of a machine that warms up (assumed)


def _only(strut: int) -> FloatArray:
    return np.where(np.arange(6) == strut, 1.0, 0.0)


def _coupled(links: Links, shares: FloatArray, compliance: float) -> Links:
    """Add a spring that carries shares (n, 6) of the strut forces and lengthens each strut by its share: c a a^T."""
    flexibility = np.linalg.inv(links.struts) + compliance * shares[:, :, None] * shares[:, None, :]
    return dataclasses.replace(links, struts=np.asarray(np.linalg.inv(flexibility), dtype=np.float64))


@act("joints,struts,platform", "load", 6e6, needs="force_N")
def joint_slip(links: Links, state: PosedRows, u: Unknown) -> Links:
    """Sticking joints that slip: rotational secant stiffness m0 F0 / (F0 + F), Masing's element smeared out."""
    held = SLIP_LOAD / (SLIP_LOAD + state.rows.force)
    return dataclasses.replace(links, moment=links.moment + u.size * held[:, None] * np.ones(6))


@act(ALL, "constant,tilt,radius,strut length", SOFT)
def cardan_fork(links: Links, state: PosedRows, u: Unknown) -> Links:
    """A cross whose inner pin, radial on the platform, is worn: c = c0 (share of the strut's force along the pin)^2."""
    joints = state.platform_joints - state.work_point[:, None, :]
    axis = state.rotation[:, :, 2]
    radial = joints - np.einsum("nki,ni->nk", joints, axis)[:, :, None] * axis[:, None, :]
    pin = radial / np.linalg.norm(radial, axis=2, keepdims=True)
    return links.with_joints(u.size * np.einsum("nki,nki->nk", state.units, pin) ** 2)


@act(ONE, "strut force,load", 50e-6, shape=one_strut, needs="force_N")
def strut_backlash(links: Links, state: PosedRows, u: Unknown) -> Links:
    """Lost motion in one strut alone: c = g / |f|."""
    return links.with_joints(lambda f: u.size / np.maximum(np.abs(f), LEAST_FORCE) * _only(u.shape["strut"]))


@act(ALL, "strut force,load", SOFT, shape=uniform("preload", 150.0, 500.0), needs="force_N")
def nut_preload(links: Links, state: PosedRows, u: Unknown) -> Links:
    """Double nuts with too little preload: beyond it one of the two lets go and the struts are softer by c0."""
    return links.with_joints(lambda f: u.size * beyond(f, u.shape["preload"]))


@act(ONE, "force sign", SOFT, shape=drawn(one_strut, side))
def thrust_bearing(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The thrust bearing of one screw is worn on one side: softer in tension, or in compression."""
    return links.with_joints(lambda f: u.size * opened(f * u.shape["side"]) * _only(u.shape["strut"]))


@act(ALL, "force sign,strut length", SOFT)
def strut_bowing(links: Links, state: PosedRows, u: Unknown) -> Links:
    """Struts not quite straight bow under compression: c grows as length^4 (Timoshenko, an initially bent column)."""
    compliance = u.size * (state.lengths / state.nominal.strut_range[1]) ** 4
    return links.with_joints(lambda f: compliance * opened(-f))


@act(ONE, "strut length", SOFT, shape=one_strut)
def drive_spring(links: Links, state: PosedRows, u: Unknown) -> Links:
    """One drive loses stiffness in proportion to how far its strut is out, as a column of oil does."""
    return links.with_joints(u.size * np.maximum(state.stretched, 0.0) * _only(u.shape["strut"]))


@act(ONE, "strut length", 0.85, shape=drawn(one_strut, uniform("wavelength", 0.12, 0.3), uniform("phase", 0.0, 6.28)))
def screw_lead(links: Links, state: PosedRows, u: Unknown) -> Links:
    """One screw was ground with a wavy lead: its nut's stiffness varies periodically with the length."""
    wave = u.size * np.sin(2.0 * np.pi * state.lengths / u.shape["wavelength"] + u.shape["phase"])
    return dataclasses.replace(links, struts=links.struts * (1.0 + wave * _only(u.shape["strut"]))[:, :, None])


@act("struts,joints,platform", "constant", SOFT, shape=one_strut)
def motor_mount(links: Links, state: PosedRows, u: Unknown) -> Links:
    """Two neighbouring struts of different vertices hang on one soft bracket, which both load: c (f1 + f2)^2."""
    first, vertices = u.shape["strut"], state.nominal.vertices
    other = next(s % 6 for s in range(first + 1, first + 6) if vertices[s % 6] != vertices[first])
    return _coupled(links, np.broadcast_to(_only(first) + _only(other), state.lengths.shape), u.size)


@act(ONE, "time", SOFT, shape=one_strut, needs="time_min")
def strut_heating(links: Links, state: PosedRows, u: Unknown) -> Links:
    """The motor of one strut holds it and heats its nut while the readings of a clamping are taken."""
    return links.with_joints(u.size * (state.rows.time / 300.0)[:, None] * _only(u.shape["strut"]))


@act(ALL, "order,time,temperature", SOFT)
def warm_up_preload(links: Links, state: PosedRows, u: Unknown) -> Links:
    """Joints gain their preload as the machine warms up: c = c0 exp(-t / tau) over the campaign."""
    return links.with_joints(u.size * np.exp(-state.rows.elapsed / PRELOAD_GROWS)[:, None] * np.ones(6))
