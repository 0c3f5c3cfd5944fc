"""Oddities: physics that no effect of the catalogue describes, for testing the verdict "something else is missing".

Each is one formula on struts, joints, table or readings; the size scales it. They are invented for the purpose, with
the shapes that damaged or badly set machines show; no source gives figures for them.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Links
from toolpath_stiff.rig.unknown import (
    REACH,
    SOFT,
    CommandedRows,
    Kinds,
    Parameters,
    Unknown,
    one_strut,
    signed,
    with_joints,
)

REFERENCE_LOAD = 1000.0  # N
CROSSED = 0, 3  # struts 1 and 4
ODDITIES = Kinds()
IN_TIME = ("warming_leg", "joint_friction")  # need columns (time, several loads) that only some campaigns have


def _wave(rng: Generator) -> Parameters:
    return {"wavelength": float(rng.uniform(0.08, 0.4)), "phase": float(rng.uniform(0.0, 2.0 * np.pi))}


def _scaled(links: Links, factor: FloatArray) -> Links:
    """Struts stiffer by factors (n, 6) or (n, 1)."""
    return dataclasses.replace(links, struts=links.struts * factor[:, :, None])


@ODDITIES.add(SOFT)
def loose_preload(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Joints softer in tension than in compression."""
    return with_joints(links, lambda forces: np.where(forces > 0.0, u.size, 0.0))


@ODDITIES.add(0.8, shape=_wave)
def screw_pitch_error(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Strut stiffness varies periodically with length."""
    return _scaled(links, 1.0 + u.size * np.sin(2.0 * np.pi * state.lengths / u.shape["wavelength"] + u.shape["phase"]))


@ODDITIES.add(SOFT)
def cracked_bed(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The workpiece side gives way where y is positive only."""
    give = np.where(state.rows.position[:, 1] > 0.0, u.size, 0.0)[:, None] * np.array([1.0, 1.0, 0.0])
    return dataclasses.replace(links, table=links.table + give)


@ODDITIES.add(1.0)
def ball_screw_torsion(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """Struts softer towards positive x, as if their screws twisted with the carriage: by `size` at the right edge."""
    return _scaled(links, 1.0 / (1.0 + u.size * np.exp(state.rows.position[:, :1] / REACH - 1.0)))


@ODDITIES.add(0.95, shape=signed)
def strut_crosstalk(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The load of strut 1 moves strut 4 and the other way round: below 1 the block stays positive definite."""
    flexibility = np.linalg.inv(links.struts)
    first, second = CROSSED
    coupled = u.size * np.sqrt(flexibility[:, first, first] * flexibility[:, second, second])
    flexibility[:, first, second] = flexibility[:, second, first] = coupled
    return dataclasses.replace(links, struts=np.asarray(np.linalg.inv(flexibility)))


@ODDITIES.add(SOFT)
def saddle_overhang(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """The workpiece side gives way along X, growing with the square of y."""
    give = u.size * (state.rows.position[:, 1:2] / REACH) ** 2 * np.array([1.0, 0.0, 0.0])
    return dataclasses.replace(links, table=links.table + give)


@ODDITIES.add(0.5, role="read", shape=signed)
def cable_drag(rows: Rows, u: Unknown) -> FloatArray:
    """A cable pulls along X in proportion to x, and the gauge reads it."""
    return np.asarray(1.0 + u.size * rows.position[:, 0] / REACH * np.abs(rows.direction[:, 0]))


@ODDITIES.add(1.0, shape=one_strut, varies="elapsed")
def warming_leg(links: Links, state: CommandedRows, u: Unknown) -> Links:
    """One strut softens in the course of the campaign."""
    softer = 1.0 / (1.0 + u.size * state.rows.elapsed)
    return _scaled(links, np.where(np.arange(6) == u.shape["strut"], softer[:, None], 1.0))


@ODDITIES.add(1.0, role="read")
def joint_friction(rows: Rows, u: Unknown) -> FloatArray:
    """Sticking joints: stiffer at small loads, as friction carries a share that shrinks as the load grows."""
    return np.asarray(1.0 + u.size * REFERENCE_LOAD / (REFERENCE_LOAD + rows.force))
