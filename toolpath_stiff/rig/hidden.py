"""The hidden machine: all differences between true and nominal machine, and the readings they lead to.

`HiddenMachine` holds the differences; all of them zero is the nominal machine. `true_stiffness` turns it and the
rows of a campaign into stiffnesses, `readings` adds what the instruments do to them. `Nuisances` are what every real
campaign adds, whether or not something is hidden.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.rig.closure import true_poses
from toolpath_stiff.rig.kinematics import commanded_lengths, platform_points, rotations
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import End, Links, Motions, PosedRows, solved
from toolpath_stiff.rig.unknown import Unknown
from toolpath_stiff.rig.unknowns import OUTSIDE
from toolpath_stiff.units import n_per_m_from_n_per_mm, n_per_mm_from_n_per_m

HERTZ_LOAD = 500.0  # N, load at which contact_nonlinearity's compliance is quoted (assumed; effects catalogue)
SLACK_LOAD = 0.1  # N, below which a joint's secant compliance is held: far below any load of a campaign
PRINTED_N_PER_MM = 1.0  # resolution of what is printed: whole N/mm, as in the paper's Table 1 (published)
AXES = np.eye(3)


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
    unknown
        Something outside the catalogue.
    """

    frame_errors: FloatArray = field(default_factory=lambda: np.zeros((6, 3)))
    platform_errors: FloatArray = field(default_factory=lambda: np.zeros((6, 3)))
    strut_factors: FloatArray = field(default_factory=lambda: np.ones(6))
    curvature: float = 0.0
    tip_error: float = 0.0
    radius_error: float = 0.0
    bars: float = np.inf
    spindle: Sequence[float] = (0.0, 0.0)
    overhang_exponent: float = 0.0
    joint: float = 0.0
    hertz: float = 0.0
    clearance: float = 0.0
    moment: float = 0.0
    vertices: FloatArray = field(default_factory=lambda: np.zeros((6, 2)))
    table: FloatArray = field(default_factory=lambda: np.zeros(3))
    rocking: float = 0.0
    setup: str = ""
    setup_compliance: FloatArray = field(default_factory=lambda: np.zeros(3))
    gauge_target: str = ""
    gauge_factor: float = 1.0
    drift: float = 0.0
    unknown: Unknown | None = None

    def stiffness(self, nominal: Nominal, rows: Rows) -> FloatArray:
        """(n,) N/m, secant stiffness between tool and workpiece along the load."""
        state = posed(nominal, self, rows)
        return np.asarray(1.0 / solved(state, _links(self, state, state.lengths))[0])

    def displacement(self, nominal: Nominal, rows: Rows) -> FloatArray:
        """(n,) m, reading of the indicator."""
        return np.asarray(rows.force / self.stiffness(nominal, rows) + self.drift * rows.time)

    def motions(self, nominal: Nominal, rows: Rows, lengths: FloatArray) -> Motions:
        """Motions under the rows' loads; `lengths` (n,) m of struts measured alone, nan: as in the pose."""
        n, corners, state = len(rows.force), nominal.corners, posed(nominal, self, rows)
        links = _links(self, state, np.where(lengths[:, None] > 0.0, lengths[:, None], state.lengths))
        compliance, moved, stretch = solved(state, links)
        first = moved.shape[1] - len(links.ends) - 2 * corners
        joints, vertices, sizes = np.split(moved[:, first - 6 :], [6, 6 + 2 * corners], axis=1)
        outward = np.stack([state.radial(vertex) for vertex in range(corners)], axis=1)
        give = vertices.reshape(n, -1, 2)
        along = {"spindle": np.zeros(n), "table": np.zeros(n), "": np.zeros(n)}
        for end, size in zip(links.ends, sizes.T, strict=True):
            along[end.link] += np.einsum("ni,ni->n", rows.direction, end.lever) * size
        return Motions(
            tip=compliance, spindle=along["spindle"], table=along["table"],
            struts=np.einsum("nki,ni->nk", stretch, moved), joints=joints,
            alone=1.0 / links.struts,
            vertices=give[..., :1] * outward + give[..., 1:] * AXES[2], outward=outward,
        )  # fmt: skip


def readings(nominal: Nominal, hidden: HiddenMachine, rows: Rows) -> FloatArray:
    """(n,) N/m as gauge and indicator show it, before noise: k = factor F / (F / k_true + drift t)."""
    shown = rows.force / hidden.displacement(nominal, rows) * gauge(hidden, rows)
    if hidden.unknown is not None and (read := OUTSIDE[hidden.unknown.kind].read) is not None:
        shown = shown * read(rows, hidden.unknown)
    return np.asarray(shown)


def _links(hidden: HiddenMachine, state: PosedRows, lengths: FloatArray) -> Links:
    """Compliant links, struts of `lengths` (n, 6) m."""
    links = Links(
        struts=strut_stiffness(state.nominal, hidden, lengths),
        joints=partial(_joint_give, hidden),
        moment=hidden.moment,
        bars=hidden.bars,
        vertices=hidden.vertices[: state.nominal.corners],
        ends=_ends(hidden, state),
    )
    act = None if hidden.unknown is None else OUTSIDE[hidden.unknown.kind].act
    return links if act is None else act(links, state, hidden.unknown)


def posed(nominal: Nominal, hidden: HiddenMachine, rows: Rows) -> PosedRows:
    """Places of joints and tip when struts of the commanded lengths carry the true platform on the true frame."""
    turned = rotations(rows.angles)
    lengths = commanded_lengths(nominal, rows.position, turned, rows.extension)
    frame = nominal.frame_joints + hidden.frame_errors
    platform = nominal.platform_joints + hidden.platform_errors
    radius = np.linalg.norm(nominal.platform_joints[:, :2], axis=1, keepdims=True)
    platform[:, :2] *= 1.0 + hidden.radius_error / radius
    # The pose is that of the nominal tip of the reference tool, a point fixed to the platform.
    start = rows.position + rows.extension[:, None] * turned[:, :, 2]
    origin, rotation = true_poses(lengths, frame, platform, start, turned)
    below = rows.extension + hidden.tip_error
    return PosedRows(
        nominal=nominal,
        rows=rows,
        lengths=lengths,
        work_point=origin - below[:, None] * rotation[:, :, 2],
        rotation=rotation,
        platform_joints=platform_points(platform, origin, rotation, np.zeros(len(origin))),
        frame_joints=np.broadcast_to(frame, (len(origin), 6, 3)),
    )


def strut_stiffness(nominal: Nominal, hidden: HiddenMachine, lengths: FloatArray) -> FloatArray:
    """(n, 6) N/m: the paper's law, linear in length (its equation 5), with curvature and spread."""
    first, last = nominal.law_ends
    share = (lengths - first) / (last - first)
    points, stiffness = nominal.law_lengths, nominal.law_stiffnesses
    law = np.full_like(lengths, stiffness[0])
    if len(points) > 1:  # beyond its ends the law goes on along its end pieces
        piece = np.clip(np.searchsorted(points, lengths, side="right") - 1, 0, len(points) - 2)
        within = (lengths - points[piece]) / (points[piece + 1] - points[piece])
        law = stiffness[piece] + (stiffness[piece + 1] - stiffness[piece]) * within
    # The exponential keeps strongly curved laws positive beyond the two lengths.
    law = law * np.exp(hidden.curvature * 4.0 * share * (1.0 - share))
    return np.asarray(law * hidden.strut_factors)


def _joint_give(hidden: HiddenMachine, forces: FloatArray) -> FloatArray:
    """Secant compliance along the struts: constant, Hertzian (elongation as F^(2/3)), clearance (g at any load)."""
    size = np.maximum(np.abs(forces), SLACK_LOAD)
    return np.asarray(hidden.joint + hidden.hertz * np.cbrt(HERTZ_LOAD / size) + hidden.clearance / size)


def _ends(hidden: HiddenMachine, state: PosedRows) -> tuple[End, ...]:
    """Links that carry the whole load: spindle in platform axes; table; table rocking about base x and y; set-up."""
    n, tool, (radial, axial) = len(state.lengths), state.nominal.tool_length, hidden.spindle
    grown = (1.0 + state.rows.extension / tool) ** hidden.overhang_exponent if tool > 0.0 else 1.0
    here = (state.rows.setup == hidden.setup) & bool(hidden.setup)
    ends: list[tuple[str, FloatArray, FloatArray | float]]
    ends = [("spindle", state.rotation[:, :, j], c) for j, c in enumerate((radial * grown, radial * grown, axial))]
    ends += [("table", AXES[j], hidden.table[j]) for j in range(3)]
    ends += [("table", np.cross(AXES[j], state.work_point), hidden.rocking) for j in range(2)]
    ends += [("table", AXES[j], np.where(here, hidden.setup_compliance[j], 0.0)) for j in range(3)]
    return tuple(End(link, np.broadcast_to(lever, (n, 3)), np.broadcast_to(c, (n,))) for link, lever, c in ends)


def gauge(hidden: HiddenMachine, rows: Rows) -> FloatArray:
    """(n,) factor on the readings of one direction or one set-up."""
    if hidden.gauge_target in ("X", "Y", "Z"):
        # Only loads along the axis itself are read by that axis's gauge.
        hit = np.abs(rows.direction[:, "XYZ".index(hidden.gauge_target)]) > 1.0 - 1e-9
    else:
        hit = rows.setup == hidden.gauge_target
    return np.where(hit, hidden.gauge_factor, 1.0)


@dataclass(frozen=True)
class Nuisances:
    """Standard deviations of disturbances in any campaign. Sizes are the issue's; repeat noise is the caller's, or 2 %.

    Attributes
    ----------
    repeat
        Relative, of one reading.
    clamping
        Relative, common to the rows of one clamp.
    strut_spread
        Relative, of the struts' stiffnesses.
    joint_error
        m, of each coordinate of each joint.
    outliers
        Share of readings whose repeat noise is `outlier_width` times as wide.
    """

    repeat: float = 0.02
    clamping: float = 0.01
    strut_spread: float = 0.01
    joint_error: float = 0.5e-3
    outliers: float = 0.02
    outlier_width: float = 4.0
    rounded: bool = True

    @property
    def of_reading(self) -> float:
        """Relative standard deviation of one reading, re-clamping included."""
        return float(np.hypot(self.repeat, self.clamping))

    @classmethod
    def none(cls) -> Nuisances:
        """No nuisance at all, not even rounding."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, rounded=False)


def disturb_machine(hidden: HiddenMachine, nuisances: Nuisances, rng: Generator) -> HiddenMachine:
    """The machine with its struts spread and its joints displaced."""
    return dataclasses.replace(
        hidden,
        strut_factors=hidden.strut_factors * (1.0 + nuisances.strut_spread * rng.standard_normal(6)),
        frame_errors=hidden.frame_errors + nuisances.joint_error * rng.standard_normal((6, 3)),
        platform_errors=hidden.platform_errors + nuisances.joint_error * rng.standard_normal((6, 3)),
    )


def disturb_readings(
    stiffness: FloatArray,
    clamps: IntArray,
    nuisances: Nuisances,
    rng: Generator,
    apart: FloatArray | None = None,
) -> FloatArray:
    """(n,) N/m as printed, from readings of undisturbed instruments; `clamps` (n,) numbers clampings from 0.

    `apart` (n, 3): shares in which three clampings, each scattering for itself, count in a row; None: one does.
    """
    n = len(stiffness)
    wide = np.where(rng.random(n) < nuisances.outliers, nuisances.outlier_width, 1.0)
    repeat = nuisances.repeat * wide * rng.standard_normal(n)
    shares = np.ones((n, 1)) if apart is None else apart
    clamped = rng.standard_normal((int(clamps.max()) + 1, shares.shape[1]))[clamps]
    clamping = nuisances.clamping * np.einsum("ni,ni->n", clamped, shares)
    # On the logarithm, so that no reading can come out negative.
    shown = stiffness * np.exp(repeat + clamping)
    if not nuisances.rounded:
        return np.asarray(shown)
    printed = np.round(n_per_mm_from_n_per_m(shown) / PRINTED_N_PER_MM) * PRINTED_N_PER_MM
    return np.asarray(n_per_m_from_n_per_mm(printed))
