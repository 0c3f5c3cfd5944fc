"""A machine of finite elements: frame of beams on feet, struts with joints, platform, spindle, tool, table on mounts.

Its second purpose beside `structure`: nothing in it is built as the catalogue's effects are. Frame, platform with
spindle, and table are condensed to where something acts on them; the struts join the first two, pose by pose. Struts
lengthen by what their forces make joints give, so a nonlinear joint is an initial strain: the forces follow from
equilibrium almost alone, and a few steps settle them. Loads are +F and -F beside the platform's weight; what is read is
half the difference, the secant. The weight's geometric stiffness (5e-5 of a strut's) is left out.

Every size is assumed, in proportion to the frame's and the platform's radius; `calibration` sets the struts so that
the nominal machine describes the sound one.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig import beams
from toolpath_stiff.rig.beams import NODE, add, arm
from toolpath_stiff.rig.hidden import HERTZ_LOAD
from toolpath_stiff.rig.nominal import (
    Nominal,
    commanded_lengths,
    neutral_directions,
    platform_points,
    rotations,
    true_poses,
)  # fmt: skip
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.unknown import opened

JOINT_SHARE = 0.02  # of a strut's nominal compliance that sits in each of its two joints
SEAT_WIDTH = 20.0  # N over which a loose joint goes from one seat to the other
GRAVITY = 9.81  # m/s^2
DENSITY = 7850.0  # kg/m^3, steel
FEET = 2e10  # N/m, a foot of the frame in each direction
BEARINGS = (1.5e10, 1.5e10, 2e10, 1.5e9, 1.5e9, 1.5e9)  # N/m and N m/rad of the spindle in the platform
MOUNTS = 2e10  # N/m, each of four mounts of the table in each direction
SLAB = (1e11, 1e11)  # N/m and N m/rad, the floor under the table
GRID = 5  # nodes along each side of the table's grillage
JOINT_TURNING = 2e3  # N m/rad, what a sound joint resists
STIFFENED = 2.0  # on `nist`: a sound machine is then as the nominal one describes it, within half a per cent
HUB, NOSE, SHAFT, TIP = 6, 7, 8, 9  # nodes of the platform after its six joints


@dataclass(frozen=True)
class FemMachine:
    """What the elements are; SI. The defaults are the sound machine without spread.

    Attributes
    ----------
    law
        Factors on the struts' nominal compliance at the two ends of the law (`calibration`).
    frame_errors, platform_errors, tip_error, radius_error
        m, as in `HiddenMachine`.
    strut_factors, curvature, worn
        Stiffness of each strut; its curve over the length; strut, from and to which length (m), m/N: a worn stretch.
    beams, feet, brackets
        Factors on the frame's beams (upper ring, lower ring, diagonals) and feet; m/N radial and vertical at vertices.
    rim, spokes, bearings, flange
        Factors on the platform's beams; m/N at the spindle in platform axes; rotation vector, root of rad/(N m).
    tool
        Factor on the tool's diameter.
    mounts, plate, floor
        Factors on the table's mounts and plate; rotation vector of the floor, root of rad/(N m).
    riser, riser_setup
        N m^2, bending stiffness of the column under the work in one set-up.
    joints, seat, seat_strut, swing, opening, clearance, contact, turning
        m/N along each strut; directed at one strut's platform joint (platform axes, root of m/N); m/N per squared sine
        of swing; m/N in tension; m; m/N at 500 N, Hertz; N m/rad.
    hose
        N/m and the place (m) of the far end of a spring that pulls at the platform's hub.
    gauge, gauge_setup, drift, touches_above, cell_curve, stand, clamping
        Factors on readings along X, Y, Z, where a set-up is named in this alone; m/s; m above the tip; of a load of
        4000 N; m/N per m^3; on the scatter of clamping along X, Y, Z.
    """

    law: FloatArray = field(default_factory=lambda: np.ones(2))
    frame_errors: FloatArray = field(default_factory=lambda: np.zeros((6, 3)))
    platform_errors: FloatArray = field(default_factory=lambda: np.zeros((6, 3)))
    tip_error: float = 0.0
    radius_error: float = 0.0
    strut_factors: FloatArray = field(default_factory=lambda: np.ones(6))
    curvature: float = 0.0
    worn: FloatArray = field(default_factory=lambda: np.zeros(4))
    beams: FloatArray = field(default_factory=lambda: np.ones(24))
    feet: FloatArray = field(default_factory=lambda: np.ones(6))
    brackets: FloatArray = field(default_factory=lambda: np.zeros((6, 2)))
    rim: FloatArray = field(default_factory=lambda: np.ones(6))
    spokes: FloatArray = field(default_factory=lambda: np.ones(6))
    bearings: FloatArray = field(default_factory=lambda: np.zeros(3))
    flange: FloatArray = field(default_factory=lambda: np.zeros(3))
    tool: float = 1.0
    mounts: FloatArray = field(default_factory=lambda: np.ones(4))
    plate: float = 1.0
    floor: FloatArray = field(default_factory=lambda: np.zeros(3))
    riser: float = np.inf
    riser_setup: str = ""
    joints: float = 0.0
    seat: FloatArray = field(default_factory=lambda: np.zeros(3))
    seat_strut: int = 0
    swing: float = 0.0
    opening: float = 0.0
    clearance: float = 0.0
    contact: float = 0.0
    turning: FloatArray = field(default_factory=lambda: np.full(6, JOINT_TURNING))
    hose: FloatArray = field(default_factory=lambda: np.zeros(4))
    gauge: FloatArray = field(default_factory=lambda: np.ones(3))
    gauge_setup: str = ""
    drift: float = 0.0
    touches_above: float = 0.0
    cell_curve: float = 0.0
    stand: float = 0.0
    clamping: FloatArray = field(default_factory=lambda: np.ones(3))


class Places(NamedTuple):
    """Where n poses put things, base axes, m: (n, 3), (n, 3, 3), ends of the struts (n, 6, 3), their lengths (n, 6)."""

    tip: FloatArray
    rotation: FloatArray
    frame: FloatArray
    platform: FloatArray
    lengths: FloatArray


def places(nominal: Nominal, machine: FemMachine, rows: Rows) -> Places:
    """Where everything stands when the control commands the rows' poses."""
    turned = rotations(rows.angles)
    lengths = commanded_lengths(nominal, rows.position, turned, rows.extension)
    start = rows.position + rows.extension[:, None] * turned[:, :, 2]
    frame, platform = nominal.frame_joints + machine.frame_errors, platform_joints(nominal, machine)
    origin, rotation = true_poses(lengths, frame, platform, start, turned)
    tip = origin - (rows.extension + machine.tip_error)[:, None] * rotation[:, :, 2]
    ends = platform_points(platform, origin, rotation, np.zeros(len(origin)))
    return Places(tip, rotation, np.broadcast_to(frame, ends.shape), ends, lengths)


def platform_joints(nominal: Nominal, machine: FemMachine) -> FloatArray:
    """(6, 3) m where they are."""
    joints = nominal.platform_joints + machine.platform_errors
    radius = np.linalg.norm(nominal.platform_joints[:, :2], axis=1, keepdims=True)
    joints[:, :2] *= 1.0 + machine.radius_error / radius
    return np.asarray(joints)


def vertex_nodes(nominal: Nominal) -> FloatArray:
    """(v, 3) m, corners of the frame's upper ring: amid the joints that each holds."""
    count = int(nominal.vertices.max()) + 1
    return np.array([nominal.frame_joints[nominal.vertices == k].mean(axis=0) for k in range(count)])


def table_top(nominal: Nominal) -> float:
    """m, height of the table: an assumed third of the frame's radius below the neutral pose."""
    return float(nominal.neutral_pose[2] - 0.355 * _radius(nominal.frame_joints))


def scale(nominal: Nominal) -> float:
    """Factor on the stiffness of all but the struts, which are the only ones to give in the nominal machine."""
    return STIFFENED * float(nominal.law_stiffnesses.mean()) / 39.5e6 * 2.25 / _radius(nominal.frame_joints)


def _radius(points: FloatArray) -> float:
    return float(np.linalg.norm(points[:, :2], axis=1).mean())


def frame_stiffness(nominal: Nominal, machine: FemMachine) -> FloatArray:
    """(6 v, 6 v) of an octahedron of square tubes on feet, seen at the vertices that hold the struts."""
    upper = vertex_nodes(nominal)
    order, count, size = np.argsort(np.arctan2(upper[:, 1], upper[:, 0])), len(upper), _radius(upper)
    upper = upper[order]
    between = upper + np.roll(upper, -1, axis=0)
    lower = between / np.linalg.norm(between[:, :2], axis=1, keepdims=True) * size
    lower[:, 2] = min(table_top(nominal), upper[:, 2].min()) - 0.3 * size
    after = [(k + 1) % count for k in range(count)]
    pairs = [(k, after[k]) for k in range(count)] + [(count + k, count + after[k]) for k in range(count)]
    pairs += [pair for k in range(count) for pair in ((k, count + k), (after[k], count + k))]
    total = beams.beams(np.concatenate([upper, lower]), pairs, beams.block(0.18 * size), machine.beams[: len(pairs)])
    for k in range(count):
        foot = NODE * (count + k) + np.arange(3)
        total[foot, foot] += FEET * machine.feet[k]
    give = np.linalg.inv(beams.condensed(scale(nominal) * total, range(count)))
    outward = upper[:, :2] / np.linalg.norm(upper[:, :2], axis=1, keepdims=True)
    for k, (radial, vertical) in enumerate(machine.brackets[order]):
        give[NODE * k : NODE * k + 2, NODE * k : NODE * k + 2] += radial * np.outer(outward[k], outward[k])
        give[NODE * k + 2, NODE * k + 2] += vertical
    back = (NODE * np.argsort(order)[:, None] + np.arange(NODE)).ravel()
    return np.asarray(np.linalg.inv(give)[np.ix_(back, back)])


def platform_stiffness(nominal: Nominal, machine: FemMachine, extension: float) -> FloatArray:
    """(48, 48) of rim, spokes, spindle and tool, seen at the joints, the hub and the tip; platform axes."""
    joints = platform_joints(nominal, machine)
    size, axis = _radius(joints), np.array([0.0, 0.0, 1.0])
    hub = max(float(joints[:, 2].mean()), 0.5 * size)
    nose = nominal.tool_length if 0.0 < nominal.tool_length < 0.9 * hub else 0.5 * hub
    tip = -(extension + machine.tip_error)
    nodes = np.concatenate([joints, np.array([hub, nose, nose, min(tip, 0.8 * nose)])[:, None] * axis])
    around = np.argsort(np.arctan2(joints[:, 1], joints[:, 0]))
    solid = beams.block(size)
    total = beams.beams(nodes, list(zip(around, np.roll(around, -1), strict=True)), solid, machine.rim)
    total += beams.beams(nodes, [(k, HUB) for k in range(6)], solid, machine.spokes)
    total += beams.beams(nodes, [(HUB, NOSE)], beams.bar(1.1 * size))
    total += beams.beams(nodes, [(SHAFT, TIP)], beams.bar(0.9 * size * machine.tool))
    give = np.diag(1.0 / np.array(BEARINGS)) / scale(nominal)
    give[range(3), range(3)] += machine.bearings
    give[3:, 3:] += np.outer(machine.flange, machine.flange)
    total *= scale(nominal)
    add(total, (NOSE, SHAFT), beams.springs(np.asarray(np.linalg.inv(give)), np.zeros(3)))
    return beams.condensed(total, (*range(6), HUB, TIP))


def table_give(nominal: Nominal, machine: FemMachine, points: FloatArray) -> FloatArray:
    """(n, 3, 3) m/N of the table at points (n, 3) above it, where a stiff fixture leads load and indicator."""
    half, top = 0.3 * _radius(nominal.frame_joints), table_top(nominal)
    ticks = np.linspace(-half, half, GRID)
    nodes = np.array([(x, y, top) for x in ticks for y in ticks] + [(0.0, 0.0, top)])
    grid = np.arange(GRID**2).reshape(GRID, GRID)
    sides = ((grid[:-1], grid[1:]), (grid[:, :-1], grid[:, 1:]))
    pairs = np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in sides]).tolist()
    total = beams.beams(nodes, pairs, beams.block(half), machine.plate)
    slab = np.diag(1.0 / np.repeat(SLAB, 3)) / scale(nominal)
    slab[3:, 3:] += np.outer(machine.floor, machine.floor)
    for corner, factor in zip(grid[[0, 0, -1, -1], [0, -1, 0, -1]], machine.mounts, strict=True):
        mount = np.diag([MOUNTS * factor] * 3 + [0.0] * 3)
        add(total, (GRID**2, corner), beams.springs(mount, nodes[corner] - nodes[-1]))
    total *= scale(nominal)
    total[-NODE:, -NODE:] += np.linalg.inv(slab)
    reach = np.zeros((len(points), 3, len(total)))
    cell = np.clip((points[:, :2] + half) / (ticks[1] - ticks[0]), 0.0, GRID - 1.0)
    first = np.minimum(cell.astype(int), GRID - 2)
    share, every = cell - first, np.arange(len(points))
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        node = grid[first[:, 0] + i, first[:, 1] + j]
        weight = np.prod(np.where([i, j], share, 1.0 - share), axis=1)
        moved = weight[:, None, None] * arm(points - nodes[node])[:, :3]
        for k in range(NODE):
            reach[every, :, NODE * node + k] += moved[:, :, k]
    return np.asarray(reach @ np.linalg.inv(total) @ np.swapaxes(reach, 1, 2))


def strut_give(nominal: Nominal, machine: FemMachine, place: Places) -> tuple[FloatArray, FloatArray]:
    """(n, 6) m/N along the struts, and of both their joints, all that is linear."""
    first, last = nominal.law_ends
    share = (place.lengths - first) / (last - first)
    law = 1.0 / np.interp(place.lengths, nominal.law_lengths, nominal.law_stiffnesses)
    if len(nominal.law_lengths) > 1:  # along the first and the last two points outside
        slope = np.diff(nominal.law_stiffnesses)[[0, -1]] / np.diff(nominal.law_lengths)[[0, -1]]
        beyond = np.minimum(place.lengths - first, 0.0) * slope[0] + np.maximum(place.lengths - last, 0.0) * slope[1]
        law = 1.0 / (1.0 / law + beyond)
    law = law * (machine.law[0] * (1.0 - share) + machine.law[1] * share)
    joint = JOINT_SHARE / float(nominal.law_stiffnesses.mean())
    proper = (law - 2.0 * joint) * np.exp(-machine.curvature * 4.0 * share * (1.0 - share)) / machine.strut_factors
    strut = place.platform - place.frame
    unit = strut / np.linalg.norm(strut, axis=2, keepdims=True)
    held = unit @ place.rotation
    rest = np.broadcast_to(neutral_directions(nominal)[1], held.shape)
    swung = 1.0 - np.minimum(np.einsum("nki,nki->nk", rest, held) ** 2, 1.0)
    give = 2.0 * joint + machine.joints + machine.swing * swung
    give[:, machine.seat_strut] += (held[:, machine.seat_strut] @ machine.seat) ** 2
    number, start, end, worn = machine.worn
    inside = (place.lengths >= start) & (place.lengths <= end) & (np.arange(6) == number)
    return np.asarray(proper + np.where(inside, worn, 0.0)), np.asarray(give)


def extra_give(machine: FemMachine, forces: FloatArray) -> FloatArray:
    """(n, 6) m by which the joints give beside what is linear, at strut forces (n, 6) N, tension positive."""
    size = HERTZ_LOAD * np.cbrt(np.abs(forces) / HERTZ_LOAD) ** 2
    loose = 0.5 * machine.clearance * np.tanh(forces / SEAT_WIDTH)
    return np.asarray(machine.contact * np.sign(forces) * size + loose + machine.opening * forces * opened(forces))
