"""The machine as assembled elements: a displacement method, solved row by row of a measuring campaign.

Unknowns are the movements of the platform (a rigid body, or the eight nodes of its truss) and the give of every link
that can give way: joints along their struts, frame vertices, spindle, table, set-up. Each element adds k b b^T, with b
the row that turns unknowns into its deformation (Zienkiewicz, Taylor, The Finite Element Method, direct stiffness
assembly). A link that does not give way has its unknown held, so nothing is stiff enough to spoil the solution.

Joints whose stiffness depends on their load are solved by secant iteration: assemble with the secant stiffnesses of
the last loads, solve, repeat. Newton's method would meet the infinite slope of a clearance at no load.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.beams import arm
from toolpath_stiff.rig.kinematics import neutral_directions
from toolpath_stiff.rig.nominal import Nominal
from toolpath_stiff.rig.rows import Rows

HUB, TIP = 6, 7  # nodes of the platform truss (the paper's Figure 2b) after its six joints
SECANT_STEPS = 60
SECANT_TOLERANCE = 1e-11  # relative change of the tip's compliance between two steps


@dataclass(frozen=True)
class PosedRows:
    """n rows as the machine meets them: commanded strut lengths (n, 6) m and true positions, base axes, m.

    Attributes
    ----------
    work_point
        (n, 3) the tool tip, where the load acts.
    rotation
        (n, 3, 3) platform to base.
    platform_joints, frame_joints
        (n, 6, 3).
    """

    nominal: Nominal
    rows: Rows
    lengths: FloatArray
    work_point: FloatArray
    rotation: FloatArray
    platform_joints: FloatArray
    frame_joints: FloatArray

    @cached_property
    def distances(self) -> FloatArray:
        """(n, 6) m between the joints of each strut."""
        return np.asarray(np.linalg.norm(self.platform_joints - self.frame_joints, axis=2))

    @cached_property
    def units(self) -> FloatArray:
        """(n, 6, 3) along the struts, from frame to platform."""
        return np.asarray((self.platform_joints - self.frame_joints) / self.distances[:, :, None])

    @property
    def swing(self) -> FloatArray:
        """(n, 6) squared sine of the platform joints' swing from the neutral pose."""
        rest, now = neutral_directions(self.nominal)[1], self.units @ self.rotation
        along = np.einsum("nki,nki->nk", np.broadcast_to(rest, now.shape), now)
        return np.asarray(1.0 - np.minimum(along**2, 1.0))

    def radial(self, vertex: int) -> FloatArray:
        """(n, 3) horizontal unit vector from the machine's axis to a vertex of the frame."""
        outward = self.frame_joints[:, self.nominal.vertices == vertex].mean(axis=1) * np.array([1.0, 1.0, 0.0])
        return np.asarray(outward / np.linalg.norm(outward, axis=1, keepdims=True))


class End(NamedTuple):
    """A link between tool and work that carries the whole load, in n rows.

    A unit load along d puts d . lever on it (a force, or a torque where the lever is in m), and the tip moves along d
    by that times the compliance times d . lever.

    Attributes
    ----------
    link
        `spindle` or `table`, beside which an indicator may stand; "" for others.
    lever, compliance
        (n, 3) and (n,).
    """

    link: str
    lever: FloatArray
    compliance: FloatArray


class Motions(NamedTuple):
    """Displacements under n loads, m per N of the load.

    Attributes
    ----------
    tip, spindle, table
        (n,) tool against work, tool against platform, the work, along the load.
    struts, joints, alone
        (n, 6) elongation of the struts, give of the joints of each; of a strut measured alone, m per N in it.
    vertices, outward
        (n, v, 3) displacement of the frame's vertices, and horizontal unit vectors out to them.
    """

    tip: FloatArray
    spindle: FloatArray
    table: FloatArray
    struts: FloatArray
    joints: FloatArray
    alone: FloatArray
    vertices: FloatArray
    outward: FloatArray


@dataclass(frozen=True)
class Links:
    """Compliances of the links in n rows; SI. A compliance of zero is rigid.

    Attributes
    ----------
    struts
        (n, 6) N/m.
    joints
        Secant compliance (n, 6) m/N along the struts from strut forces (n, 6) N (tension positive).
    moment
        N m/rad, rotational spring at both ends of every strut.
    bars
        N/m, bars of the platform truss; inf is rigid.
    vertices
        (vertices, 2) m/N, radial and vertical.
    ends
        Whatever carries the whole load.
    """

    struts: FloatArray
    joints: Callable[[FloatArray], FloatArray]
    moment: float
    bars: float
    vertices: FloatArray
    ends: tuple[End, ...]

    def with_ends(self, *ends: tuple[FloatArray, FloatArray | float]) -> Self:
        """Add links that carry the whole load: levers (n, 3) or (3,), compliances (n,) or one for all rows."""
        n = len(self.struts)
        more = (End("", np.broadcast_to(lever, (n, 3)), np.broadcast_to(give, (n,))) for lever, give in ends)
        return replace(self, ends=(*self.ends, *more))

    def with_joints(self, extra: Callable[[FloatArray], FloatArray] | FloatArray) -> Self:
        """Add secant compliance (n, 6) along the struts: constant, or a function of the strut forces (n, 6)."""
        give = extra if callable(extra) else lambda forces: extra
        return replace(self, joints=lambda forces: self.joints(forces) + give(forces))


def solved(state: PosedRows, links: Links) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Solve the machine under the loads of the rows; results per unit load.

    Returns
    -------
    compliance
        (n,) m/N between tool and workpiece.
    moved
        (n, N) the unknowns: the platform's own, then six joints, two a vertex, the ends.
    stretch
        (n, 6, N) what turns them into the elongation of each strut, its joints left out.
    """
    stretch, platform_springs, first = _struts(state, links)
    n, size, ends = len(stretch), stretch.shape[2], first + 6 + 2 * state.nominal.corners
    load = np.zeros((n, size))  # what each unknown adds to the motion of tool against workpiece along the load
    # Tip of a rigid platform: the first three unknowns; node TIP of a truss: three of its last ones.
    tip = 0 if first == 6 else 3 * TIP
    load[:, tip : tip + 3] = state.rows.direction
    # The workpiece is pushed back: the load on it is -direction, so its give counts with the same sign.
    load[:, ends:] = np.stack([np.einsum("ni,ni->n", state.rows.direction, end.lever) for end in links.ends], axis=1)
    vertices = np.broadcast_to(links.vertices.ravel(), (n, links.vertices.size))
    others = np.column_stack([vertices, *(end.compliance for end in links.ends)])
    per_stretch = links.struts[:, :, None] * stretch  # (n, 6, N) N/m
    fixed = platform_springs + np.swapaxes(stretch, 1, 2) @ per_stretch
    forces, compliance = np.zeros((n, 6)), np.zeros(n)
    for _ in range(SECANT_STEPS):
        give = np.concatenate([links.joints(forces), others], axis=1)
        # A link's unknown counts in units of the root of its compliance: its spring is 1, and rigid it does not move.
        unit = np.ones((n, size))
        unit[:, first:] = np.sqrt(give)
        free = np.flatnonzero(unit.any(axis=0))  # an unknown held in every row does not move
        stiffness = fixed[:, free[:, None], free] * unit[:, free, None] * unit[:, None, free]
        stiffness[:, range(len(free)), range(len(free))] += free >= first
        moved = np.zeros((n, size))
        moved[:, free] = np.linalg.solve(stiffness, (load * unit)[:, free, None])[:, :, 0]
        moved *= unit
        before, compliance = compliance, np.einsum("ni,ni->n", load, moved)
        forces = state.rows.force[:, None] * (per_stretch @ moved[:, :, None])[:, :, 0]
        if np.abs(compliance - before).max() <= SECANT_TOLERANCE * compliance.max():
            return compliance, moved, stretch
    raise RuntimeError("the secant stiffnesses of the joints did not settle")


def _struts(state: PosedRows, links: Links) -> tuple[FloatArray, FloatArray, int]:
    """Rows that turn unknowns into strut elongations, springs on the platform's own unknowns, and their number."""
    n, nodes = len(state.lengths), _nodes(state)
    rigid = arm(nodes - state.work_point[:, None, :])[..., :3, :].reshape(n, -1, 6)  # (n, 24, 6)
    flexible = np.isfinite(links.bars)
    motion = np.broadcast_to(np.eye(24), (n, 24, 24)) if flexible else rigid
    dofs = motion.shape[2]
    size = dofs + 6 + 2 * state.nominal.corners + len(links.ends)
    # Displacement of the platform end minus that of the frame end, base axes, per unknown.
    relative = np.zeros((n, 6, 3, size))
    relative[..., :dofs] = motion[:, :18].reshape(n, 6, 3, dofs)
    for i, vertex in enumerate(state.nominal.vertices.tolist()):
        column = dofs + 6 + 2 * vertex
        relative[:, i, :, column] = -state.radial(vertex)
        relative[:, i, 2, column + 1] = -1.0
    stretch = np.einsum("nki,nkij->nkj", state.units, relative)
    stretch[:, range(6), range(dofs, dofs + 6)] = -1.0  # elongation taken up by the joints is not the strut's
    springs = np.zeros((n, size, size))
    if flexible:
        springs[:, :dofs, :dofs] = links.bars * _truss(nodes)
    if links.moment > 0.0:
        # Rotation of the platform: the rigid motion that follows its joints best; exact when it is rigid.
        turn = np.zeros((n, 3, size))
        turn[..., :dofs] = np.linalg.pinv(rigid[:, :18])[:, 3:] @ motion[:, :18]
        springs += links.moment * _end_rotations(state, relative, turn)
    return stretch, springs, dofs


def _end_rotations(state: PosedRows, relative: FloatArray, platform_turn: FloatArray) -> FloatArray:
    """(n, N, N) stiffness of springs of 1 N m/rad against the struts' rotations to frame and platform, without spin.

    A strut that stays straight turns by u x (displacement of its ends) / L; its spin about u meets no resistance.
    """
    strut_turn = np.cross(state.units[..., None], relative, axis=2) / state.distances[:, :, None, None]
    across = np.eye(3) - state.units[..., :, None] * state.units[..., None, :]
    at_platform = strut_turn - across @ platform_turn[:, None]
    turns = np.concatenate([strut_turn, at_platform], axis=1)
    return np.asarray(np.einsum("nkci,nkcj->nij", turns, turns, optimize=True))


def _nodes(state: PosedRows) -> FloatArray:
    """(n, 8, 3) m: joints, hub (on the tool axis at the joints' mean height) and tip; the paper's Figure 2b."""
    axis = state.rotation[:, :, 2]
    height = np.einsum("nki,ni->nk", state.platform_joints - state.work_point[:, None, :], axis).mean(axis=1)
    hub = state.work_point + height[:, None] * axis
    return np.concatenate([state.platform_joints, hub[:, None], state.work_point[:, None]], axis=1)


def truss_bars(nodes: FloatArray) -> list[tuple[int, int]]:
    """Nodes (0 to 5: joints) that each of the platform's 19 bars joins: rim, spokes, joints to tip, hub to tip."""
    spread = nodes[0, :6] - nodes[0, HUB]
    axis = nodes[0, TIP] - nodes[0, HUB]
    axis = axis / np.linalg.norm(axis)
    first = spread[0] - (spread[0] @ axis) * axis
    around = np.argsort(np.arctan2(spread @ np.cross(axis, first), spread @ first * np.linalg.norm(axis)))
    rim = [(int(around[i]), int(around[(i + 1) % 6])) for i in range(6)]
    return [*rim, *((i, HUB) for i in range(6)), *((i, TIP) for i in range(6)), (HUB, TIP)]


def _truss(nodes: FloatArray) -> FloatArray:
    """(n, 24, 24) stiffness of the platform's bars, of 1 N/m each."""
    ends = np.array(truss_bars(nodes))
    bar = nodes[:, ends[:, 1]] - nodes[:, ends[:, 0]]
    unit = bar / np.linalg.norm(bar, axis=2, keepdims=True)
    joins = np.eye(8)[ends[:, 1]] - np.eye(8)[ends[:, 0]]
    rows = np.einsum("bk,nbi->nbki", joins, unit).reshape(len(nodes), -1, 24)
    return np.asarray(np.swapaxes(rows, 1, 2) @ rows)
