"""Oddities: physics that no effect of the catalogue describes, for testing the verdict "something else is missing".

Each is one formula on struts, joints, table or readings; `size` scales it, a ratio unless said. They are invented for
the purpose, with the shapes that damaged or badly set machines show; no source gives figures for them.
"""

import dataclasses
from functools import partial

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import drawn, one_strut, signed, uniform
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Links
from toolpath_stiff.rig.unknown import REACH, SOFT, CommandedRows, Kind, Unknown, X, Y, kind

ODDITIES: dict[str, Kind] = {}
ODDITIES_IN_TIME: dict[str, Kind] = {}  # they need time or several loads, which only some campaigns have
act = partial(kind, ODDITIES, "act")
read = partial(kind, ODDITIES, "read")
act_in_time = partial(kind, ODDITIES_IN_TIME, "act")
read_in_time = partial(kind, ODDITIES_IN_TIME, "read")
REFERENCE_LOAD = 1000.0  # N


def _scaled(links: Links, factor: FloatArray) -> Links:
    """Stiffnesses of the struts times (n, 6) or (n, 1)."""
    return dataclasses.replace(links, struts=links.struts * factor[:, :, None])


@act("", "", SOFT)
def loose_preload(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Joints softer in tension than in compression; m/N."""
    return links.with_joints(lambda forces: np.where(forces > 0.0, u.size, 0.0))


@act("", "", 0.8, shape=drawn(uniform("wavelength", 0.08, 0.4), uniform("phase", 0.0, 2.0 * np.pi)))
def screw_pitch_error(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Strut stiffness varies periodically with length."""
    wave = np.sin(2.0 * np.pi * state.lengths / u.shape["wavelength"] + u.shape["phase"])
    return _scaled(links, 1.0 + u.size * wave)


@act("", "", SOFT)
def cracked_bed(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The workpiece side gives way where y is positive only; m/N."""
    give = np.where(state.rows.position[:, 1] > 0.0, u.size, 0.0)
    return links.with_ends((X, give), (Y, give))


@act("", "", 1.0)
def ball_screw_torsion(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Compliance greater by `size` at the right edge of the workspace, by less and less towards the left."""
    return _scaled(links, 1.0 / (1.0 + u.size * np.exp(state.rows.position[:, :1] / REACH - 1.0)))


@act("", "", 0.95, shape=signed)
def strut_crosstalk(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The load of strut 1 moves strut 4 and the other way round; below 1 the block stays positive definite."""
    flexibility = np.linalg.inv(links.struts)
    coupled = u.size * np.sqrt(flexibility[:, 0, 0] * flexibility[:, 3, 3])
    flexibility[:, 0, 3] = flexibility[:, 3, 0] = coupled
    return dataclasses.replace(links, struts=np.asarray(np.linalg.inv(flexibility)))


@act("", "", SOFT)
def saddle_overhang(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The workpiece side gives way along X, growing with the square of y; m/N."""
    return links.with_ends((X, u.size * (state.rows.position[:, 1] / REACH) ** 2))


@read("", "", 0.5, shape=signed)
def cable_drag(rows: Rows, u: Unknown) -> FloatArray:
    """A cable pulls along X in proportion to x, and the gauge reads it."""
    return np.asarray(1.0 + u.size * rows.position[:, 0] / REACH * np.abs(rows.direction[:, 0]))


@act_in_time("", "", 1.0, shape=one_strut)
def warming_leg(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """One strut softens in the course of the campaign."""
    factor = np.ones((len(state.rows.force), 6))
    factor[:, u.shape["strut"]] = 1.0 / (1.0 + u.size * state.rows.elapsed)
    return _scaled(links, factor)


@read_in_time("", "", 1.0)
def joint_friction(rows: Rows, u: Unknown) -> FloatArray:
    """Sticking joints are stiffer at small loads: friction carries a share that shrinks as the load grows."""
    return np.asarray(1.0 + u.size * REFERENCE_LOAD / (REFERENCE_LOAD + rows.force))
