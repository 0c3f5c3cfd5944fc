"""The hidden machine: everything in which the true machine differs from the nominal one, and what it then shows.

`HiddenMachine` holds the differences; all of them zero is the nominal machine. `true_stiffness` turns it and the
rows of a campaign into stiffnesses, `readings` adds what the instruments do to them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.rig.kinematics import commanded_lengths, platform_points, rotations, true_poses
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.outside import Oddity, extra_joint, extra_table, reading_factor, strut_block
from toolpath_stiff.rig.structure import Geometry, Links, secant_compliance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
StrArray = NDArray[np.str_]

HERTZ_LOAD = 500.0  # N, load at which contact_nonlinearity's compliance is quoted (assumed; effects catalogue)
SLACK_LOAD = 0.1  # N, below which a joint's secant compliance is held: far below any load of a campaign


@dataclass(frozen=True)
class Rows:
    """n rows of a campaign, SI.

    Attributes
    ----------
    position, angles
        (n, 3) m and rad: commanded tool tip; roll, pitch, yaw.
    direction
        (n, 3) unit vectors of the load.
    force
        (n,) N.
    extension
        (n,) m, tool longer than the reference tool.
    time
        (n,) s since the indicator was zeroed.
    elapsed
        (n,) 0 at the beginning of the campaign, 1 at its end.
    setup
        (n,) name of the clamping arrangement.
    """

    position: FloatArray
    angles: FloatArray
    direction: FloatArray
    force: FloatArray
    extension: FloatArray
    time: FloatArray
    elapsed: FloatArray
    setup: StrArray

    def take(self, index: IntArray) -> Rows:
        """Some of the rows."""
        return Rows(**{field.name: getattr(self, field.name)[index] for field in fields(self)})


def _zeros(*shape: int) -> FloatArray:
    return np.zeros(shape)


@dataclass(frozen=True)
class HiddenMachine:
    """Differences from the nominal machine, SI; the defaults are none.

    Attributes
    ----------
    frame_errors, platform_errors
        (6, 3) m, displacement of the joints.
    strut_factors
        (6,) on each strut's stiffness.
    curvature
        Logarithm of the factor on strut stiffness midway between the law's two lengths; a parabola, 0 at both.
    tip_error, radius_error
        m: the tool is longer, the circle of platform joints wider than the controller believes.
    bars
        N/m, bars of the platform truss.
    spindle
        Radial and axial compliance m/N at the tip with the reference tool.
    overhang_exponent
        Power of (tool length / reference length) with which the radial one grows; 3 for a cantilever, c = l^3 / 3 E I.
    joint, hertz, clearance
        m/N along each strut; m/N at 500 N, falling with the cube root of the load; m of lost motion along each strut.
    moment
        N m/rad at both ends of each strut.
    vertices
        (vertices, 2) m/N radial and vertical.
    table, rocking
        (3,) m/N and rad/(N m).
    setup, setup_compliance
        Name of the set-up that gives way, and (3,) m/N.
    gauge_target, gauge_factor
        `X`, `Y`, `Z` or the name of a set-up, whose readings are multiplied.
    drift
        m/s of the indicator.
    oddity
        Something outside the catalogue.
    """

    frame_errors: FloatArray = field(default_factory=lambda: _zeros(6, 3))
    platform_errors: FloatArray = field(default_factory=lambda: _zeros(6, 3))
    strut_factors: FloatArray = field(default_factory=lambda: np.ones(6))
    curvature: float = 0.0
    tip_error: float = 0.0
    radius_error: float = 0.0
    bars: float = np.inf
    spindle: tuple[float, float] = (0.0, 0.0)
    overhang_exponent: float = 0.0
    joint: float = 0.0
    hertz: float = 0.0
    clearance: float = 0.0
    moment: float = 0.0
    vertices: FloatArray = field(default_factory=lambda: _zeros(6, 2))
    table: FloatArray = field(default_factory=lambda: _zeros(3))
    rocking: float = 0.0
    setup: str = ""
    setup_compliance: FloatArray = field(default_factory=lambda: _zeros(3))
    gauge_target: str = ""
    gauge_factor: float = 1.0
    drift: float = 0.0
    oddity: Oddity | None = None


def readings(nominal: Nominal, hidden: HiddenMachine, rows: Rows) -> FloatArray:
    """(n,) N/m that the gauge and the indicator show, before noise: k = factor F / (F / k_true + drift t)."""
    stiffness = true_stiffness(nominal, hidden, rows)
    shown = rows.force / (rows.force / stiffness + hidden.drift * rows.time)
    return np.asarray(shown * _gauge(hidden, rows) * reading_factor(hidden.oddity, rows))


def true_stiffness(nominal: Nominal, hidden: HiddenMachine, rows: Rows) -> FloatArray:
    """(n,) N/m, secant stiffness between tool and workpiece along the load."""
    first, which = _distinct(hidden, rows)
    return np.asarray(_stiffness_row_by_row(nominal, hidden, rows.take(first))[which])


def _distinct(hidden: HiddenMachine, rows: Rows) -> tuple[IntArray, IntArray]:
    """First row of each mechanical state and the state of each row: repeats are solved once."""
    states = [rows.position, rows.angles, rows.direction, rows.extension[:, None]]
    states.append(np.unique(rows.setup, return_inverse=True)[1].reshape(-1, 1).astype(float))
    odd = hidden.oddity.kind if hidden.oddity else ""
    if hidden.hertz or hidden.clearance:
        states.append(rows.force[:, None])
    if odd == "warming_leg":
        states.append(rows.elapsed[:, None])
    _, first, which = np.unique(np.concatenate(states, axis=1), axis=0, return_index=True, return_inverse=True)
    return first, which.ravel()


def _stiffness_row_by_row(nominal: Nominal, hidden: HiddenMachine, rows: Rows) -> FloatArray:
    turned = rotations(rows.angles)
    lengths = commanded_lengths(nominal, rows.position, turned, rows.extension)
    place = _true_geometry(nominal, hidden, rows, turned, lengths)
    links = Links(
        struts=_struts(nominal, hidden, rows, lengths),
        joints=_joint_law(hidden),
        moment=hidden.moment,
        bars=hidden.bars,
        spindle=_spindle(nominal, hidden, rows),
        vertices=hidden.vertices[: nominal.vertices.max() + 1],
        table=hidden.table + extra_table(hidden.oddity, rows),
        rocking=hidden.rocking,
        setup=np.where((rows.setup == hidden.setup)[:, None] & bool(hidden.setup), hidden.setup_compliance, 0.0),
    )
    return np.asarray(1.0 / secant_compliance(place, links, rows.direction, rows.force))


def _true_geometry(
    nominal: Nominal, hidden: HiddenMachine, rows: Rows, turned: FloatArray, lengths: FloatArray
) -> Geometry:
    """Where joints and tip are when struts of the commanded lengths carry the true platform on the true frame."""
    frame = nominal.frame_joints + hidden.frame_errors
    platform = nominal.platform_joints + hidden.platform_errors
    radius = np.linalg.norm(nominal.platform_joints[:, :2], axis=1, keepdims=True)
    platform[:, :2] *= 1.0 + hidden.radius_error / radius
    # The pose is that of the nominal tip of the reference tool, a point fixed to the platform.
    start = rows.position + rows.extension[:, None] * turned[:, :, 2]
    origin, rotation = true_poses(lengths, frame, platform, start, turned)
    below = rows.extension + hidden.tip_error
    return Geometry(
        work_point=origin - below[:, None] * rotation[:, :, 2],
        rotation=rotation,
        platform_joints=platform_points(platform, origin, rotation, np.zeros(len(origin))),
        frame_joints=np.broadcast_to(frame, (len(origin), 6, 3)),
        vertices=nominal.vertices,
    )


def _struts(nominal: Nominal, hidden: HiddenMachine, rows: Rows, lengths: FloatArray) -> FloatArray:
    """(n, 6, 6) N/m: the paper's law, linear in length (its equation 5), with curvature, spread and oddities."""
    (l1, l2), (k1, k2) = nominal.law_lengths, nominal.law_stiffnesses
    s = (lengths - l1) / (l2 - l1)
    # The exponential keeps strongly curved laws positive beyond the two lengths.
    law = (k1 + (k2 - k1) * s) * np.exp(hidden.curvature * 4.0 * s * (1.0 - s))
    return strut_block(hidden.oddity, law * hidden.strut_factors, lengths, rows)


def _joint_law(hidden: HiddenMachine) -> Callable[[FloatArray], FloatArray]:
    """Secant compliance along the struts: constant, Hertz's (elongation as F^(2/3)) and clearance (g at any load)."""

    def secant(forces: FloatArray) -> FloatArray:
        size = np.maximum(np.abs(forces), SLACK_LOAD)
        contact = hidden.hertz * np.cbrt(HERTZ_LOAD / size)
        return np.asarray(hidden.joint + contact + hidden.clearance / size + extra_joint(hidden.oddity, forces))

    return secant


def _spindle(nominal: Nominal, hidden: HiddenMachine, rows: Rows) -> FloatArray:
    """(n, 3) m/N in platform axes."""
    radial, axial = hidden.spindle
    grown = np.ones(len(rows.force))
    if nominal.tool_length > 0.0:
        grown = (1.0 + rows.extension / nominal.tool_length) ** hidden.overhang_exponent
    return np.stack([radial * grown, radial * grown, np.full(len(grown), axial)], axis=1)


def _gauge(hidden: HiddenMachine, rows: Rows) -> FloatArray:
    """(n,) factor on the readings of one direction or one set-up."""
    if not hidden.gauge_target:
        return np.ones(len(rows.force))
    if hidden.gauge_target in ("X", "Y", "Z"):
        # Only loads along the axis itself are read by that axis's gauge.
        hit = np.abs(rows.direction[:, "XYZ".index(hidden.gauge_target)]) > 1.0 - 1e-9
    else:
        hit = rows.setup == hidden.gauge_target
    return np.where(hit, hidden.gauge_factor, 1.0)
