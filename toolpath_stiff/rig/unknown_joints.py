"""Unknowns of the joints at the ends of the struts."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.nominal import neutral_directions
from toolpath_stiff.rig.structure import Links
from toolpath_stiff.rig.unknown import ALL, SOFT, kind, with_joints

if TYPE_CHECKING:
    from toolpath_stiff.rig.unknown import CommandedRows, Kind, Unknown

JOINT_KINDS: dict[str, Kind] = {}
act = partial(kind, JOINT_KINDS, "act")
SWING = np.sin(np.radians(20.0)) ** 2  # squared sine of the swing at which compliances are quoted
SLIP_LOAD = 300.0  # N, load at which a sticking joint carries half of what it does at rest (assumed)


def _swing(state: CommandedRows) -> FloatArray:
    """(n, 6) squared sine of the platform joints' swing from the neutral pose."""
    rest = neutral_directions(state.nominal)[1]
    now = state.units @ state.place.rotation
    return np.asarray(1.0 - np.minimum(np.einsum("nki,nki->nk", np.broadcast_to(rest, now.shape), now) ** 2, 1.0))


@act(ALL, "tilt,radius,strut length,z", SOFT)
def joint_swing(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The forks of the platform joints bend the more, the further they swing out: c = c0 sin^2."""
    compliance = u.size * _swing(state) / SWING
    return with_joints(links, lambda forces: compliance)


@act(ALL, "constant,tilt,radius,strut length", SOFT)
def cardan_fork(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """A cross whose inner pin, radial on the platform, is worn: c = c0 (share of the strut's force along the pin)^2."""
    joints = state.place.platform_joints - state.place.work_point[:, None, :]
    axis = state.place.rotation[:, :, 2]
    radial = joints - np.einsum("nki,ni->nk", joints, axis)[:, :, None] * axis[:, None, :]
    pin = radial / np.linalg.norm(radial, axis=2, keepdims=True)
    compliance = u.size * np.einsum("nki,nki->nk", state.units, pin) ** 2
    return with_joints(links, lambda forces: compliance)


@act("joints,struts,platform", "tilt,radius,strut length,z", 3e6)
def joint_binding(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Joints that bind near the end of their swing: rotational stiffness m0 sin^2."""
    return dataclasses.replace(links, moment=links.moment + u.size * _swing(state) / SWING)


@act("joints,struts,platform", "load", 6e6, columns="force_N")
def joint_slip(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Sticking joints that slip: rotational secant stiffness m0 F0 / (F0 + F), Masing's element smeared out."""
    held = SLIP_LOAD / (SLIP_LOAD + state.rows.force)
    return dataclasses.replace(links, moment=links.moment + u.size * held[:, None] * np.ones(6))
