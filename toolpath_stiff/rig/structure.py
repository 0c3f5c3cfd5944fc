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
from typing import NamedTuple, Self

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.rig.beams import arm

HUB, TIP = 6, 7  # nodes of the platform truss (the paper's Figure 2b) after its six joints
SECANT_STEPS = 60
SECANT_TOLERANCE = 1e-11  # relative change of the tip's compliance between two steps


@dataclass(frozen=True)
class Geometry:
    """True positions in n rows, base axes, m.

    Attributes
    ----------
    work_point
        (n, 3) the tool tip, where the load acts.
    rotation
        (n, 3, 3) platform to base.
    platform_joints, frame_joints
        (n, 6, 3).
    vertices
        (6,) vertex of the frame that holds each strut.
    """

    work_point: FloatArray
    rotation: FloatArray
    platform_joints: FloatArray
    frame_joints: FloatArray
    vertices: IntArray


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
        (n, 6, 6) N/m; diagonal unless struts are coupled.
    joints
        Secant compliance (n, 6) m/N along the struts from strut forces (n, 6) N (tension positive).
    moment
        N m/rad, rotational spring at both ends of every strut; (n, 6) where struts and rows differ.
    bars
        N/m, bars of the platform truss; inf is rigid.
    vertices
        (vertices, 2) m/N, radial and vertical.
    ends
        Whatever carries the whole load.
    """

    struts: FloatArray
    joints: Callable[[FloatArray], FloatArray]
    moment: float | FloatArray
    bars: float
    vertices: FloatArray
    ends: tuple[End, ...]

    @property
    def count(self) -> int:
        """Unknowns beside the platform's: six joints, two a vertex, the ends."""
        return 6 + self.vertices.size + len(self.ends)

    def with_ends(self, *ends: tuple[FloatArray, FloatArray | float]) -> Self:
        """Add links that carry the whole load: levers (n, 3) or (3,), compliances (n,) or one for all rows."""
        n = len(self.struts)
        more = (End("", np.broadcast_to(lever, (n, 3)), np.broadcast_to(give, (n,))) for lever, give in ends)
        return replace(self, ends=(*self.ends, *more))

    def with_joints(self, extra: Callable[[FloatArray], FloatArray] | FloatArray) -> Self:
        """Add secant compliance (n, 6) along the struts: constant, or a function of the strut forces (n, 6)."""
        give = extra if callable(extra) else lambda forces: extra
        return replace(self, joints=lambda forces: self.joints(forces) + give(forces))

    def with_factors(self, factor: FloatArray) -> Self:
        """Multiply the stiffnesses of the struts by factors (n, 6)."""
        root = np.sqrt(factor)
        return replace(self, struts=self.struts * root[:, :, None] * root[:, None, :])


def solved(
    place: Geometry, links: Links, direction: FloatArray, force: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Solve the machine under loads `force` (n,) N along unit vectors `direction` (n, 3); results per unit load.

    Returns
    -------
    compliance
        (n,) m/N between tool and workpiece.
    moved
        (n, N) the unknowns: the platform's own, then six joints, the vertices, the ends (`Links.count` in all).
    stretch
        (n, 6, N) what turns them into the elongation of each strut, its joints left out.
    """
    stretch, platform_springs, platform_dofs = _struts(place, links)
    load = _load_vector(links, direction, platform_dofs)
    n, size = load.shape
    give = _give(links, n)
    per_stretch = links.struts @ stretch  # (n, 6, N) N/m
    fixed = platform_springs + np.swapaxes(stretch, 1, 2) @ per_stretch
    first = platform_dofs
    forces = np.zeros((n, 6))
    compliance = np.zeros(n)
    for _ in range(SECANT_STEPS):
        give[:, :6] = links.joints(forces)
        held = np.ones((n, size))
        held[:, first:] = give > 0.0
        springs = np.zeros((n, size))
        np.divide(1.0, give, out=springs[:, first:], where=give > 0.0)
        springs[:, first:][give <= 0.0] = 1.0  # any value will do: the unknown is held
        free = np.flatnonzero(held.any(axis=0))  # an unknown held in every row does not move
        stiffness = fixed[:, free[:, None], free] * held[:, free, None] * held[:, None, free]
        stiffness[:, range(len(free)), range(len(free))] += springs[:, free]
        pull = (load * held)[:, free]
        moved = np.zeros((n, size))
        moved[:, free] = np.linalg.solve(stiffness, pull[:, :, None])[:, :, 0]
        moved *= held
        before, compliance = compliance, np.einsum("ni,ni->n", load, moved)
        forces = force[:, None] * (per_stretch @ moved[:, :, None])[:, :, 0]
        if np.abs(compliance - before).max() <= SECANT_TOLERANCE * compliance.max():
            return compliance, moved, stretch
    raise RuntimeError("the secant stiffnesses of the joints did not settle")


def _struts(place: Geometry, links: Links) -> tuple[FloatArray, FloatArray, int]:
    """Rows that turn unknowns into strut elongations, springs on the platform's own unknowns, and their number."""
    n = len(place.work_point)
    strut = place.platform_joints - place.frame_joints
    length = np.linalg.norm(strut, axis=2)
    unit = strut / length[:, :, None]
    nodes = _nodes(place)
    rigid = _rigid_motions(nodes - place.work_point[:, None, :])  # (n, 24, 6)
    flexible = np.isfinite(links.bars)
    motion = np.broadcast_to(np.eye(24), (n, 24, 24)) if flexible else rigid
    dofs = motion.shape[2]
    size = dofs + links.count
    # Displacement of the platform end minus that of the frame end, base axes, per unknown.
    relative = np.zeros((n, 6, 3, size))
    relative[..., :dofs] = motion[:, :18].reshape(n, 6, 3, dofs)
    for i, vertex in enumerate(place.vertices):
        column = dofs + 6 + 2 * int(vertex)
        relative[:, i, :, column] = -radial(place, int(vertex))
        relative[:, i, 2, column + 1] = -1.0
    stretch = np.einsum("nki,nkij->nkj", unit, relative)
    stretch[:, range(6), range(dofs, dofs + 6)] = -1.0  # elongation taken up by the joints is not the strut's
    springs = np.zeros((n, size, size))
    if flexible:
        springs[:, :dofs, :dofs] = links.bars * _truss(nodes)
    if np.any(np.asarray(links.moment) > 0.0):
        # Rotation of the platform: the rigid motion that follows its joints best; exact when it is rigid.
        follow = np.linalg.pinv(rigid[:, :18])[:, 3:]  # (n, 3, 18)
        platform_turn = np.zeros((n, 3, size))
        platform_turn[..., :dofs] = follow @ motion[:, :18]
        moment = np.broadcast_to(links.moment, (n, 6))
        springs += _end_rotations(unit, length, relative, platform_turn, moment)
    return stretch, springs, dofs


def _end_rotations(
    unit: FloatArray, length: FloatArray, relative: FloatArray, platform_turn: FloatArray, moment: FloatArray
) -> FloatArray:
    """(n, N, N) stiffness of springs `moment` (n, 6) against the struts' rotations to frame and platform, without spin.

    A strut that stays straight turns by u x (displacement of its ends) / L; its spin about u meets no resistance.
    """
    strut_turn = np.cross(unit[..., None], relative, axis=2) / length[:, :, None, None]
    across = np.eye(3) - unit[..., :, None] * unit[..., None, :]
    at_platform = strut_turn - across @ platform_turn[:, None]
    return np.asarray(
        np.einsum("nk,nkci,nkcj->nij", moment, strut_turn, strut_turn, optimize=True)
        + np.einsum("nk,nkci,nkcj->nij", moment, at_platform, at_platform, optimize=True)
    )


def _nodes(place: Geometry) -> FloatArray:
    """(n, 8, 3) m: joints, hub (on the tool axis at the joints' mean height) and tip; the paper's Figure 2b."""
    axis = place.rotation[:, :, 2]
    height = np.einsum("nki,ni->nk", place.platform_joints - place.work_point[:, None, :], axis).mean(axis=1)
    hub = place.work_point + height[:, None] * axis
    return np.concatenate([place.platform_joints, hub[:, None], place.work_point[:, None]], axis=1)


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
    total = np.zeros((len(nodes), 24, 24))
    for i, j in truss_bars(nodes):
        bar = nodes[:, j] - nodes[:, i]
        unit = bar / np.linalg.norm(bar, axis=1, keepdims=True)
        row = np.zeros((len(nodes), 24))
        row[:, 3 * i : 3 * i + 3], row[:, 3 * j : 3 * j + 3] = -unit, unit
        total += row[:, :, None] * row[:, None, :]
    return total


def _rigid_motions(arms: FloatArray) -> FloatArray:
    """(n, 3 k, 6) displacements of k points at `arms` (n, k, 3) from unit translations and unit rotations."""
    return arm(arms)[..., :3, :].reshape(len(arms), -1, 6)


def radial(place: Geometry, vertex: int) -> FloatArray:
    """(n, 3) horizontal unit vector from the machine's axis to a vertex of the frame."""
    outward = place.frame_joints[:, place.vertices == vertex].mean(axis=1) * np.array([1.0, 1.0, 0.0])
    return np.asarray(outward / np.linalg.norm(outward, axis=1, keepdims=True))


def _give(links: Links, n: int) -> FloatArray:
    """(n, .) compliances of the links' unknowns, in their order; those of joints are filled in during the iteration."""
    vertices = np.broadcast_to(links.vertices.ravel(), (n, links.vertices.size))
    return np.column_stack([np.zeros((n, 6)), vertices, *(end.compliance for end in links.ends)])


def _load_vector(links: Links, direction: FloatArray, dofs: int) -> FloatArray:
    """(n, N) contribution of each unknown to the motion of tool against workpiece along `direction`.

    The workpiece is pushed back: the load on it is -direction, so its give counts with the same sign.
    """
    vector = np.zeros((len(direction), dofs + links.count))
    # Tip of a rigid platform: the first three unknowns; node TIP of a truss: three of its last ones.
    tip = 0 if dofs == 6 else 3 * TIP
    vector[:, tip : tip + 3] = direction
    for column, end in enumerate(links.ends, dofs + 6 + links.vertices.size):
        vector[:, column] = np.einsum("ni,ni->n", direction, end.lever)
    return vector
