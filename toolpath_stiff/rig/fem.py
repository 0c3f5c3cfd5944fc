"""A machine of finite elements: frame of beams on feet, struts with joints, platform, spindle, tool, table on mounts.

Nothing in it is built as the catalogue's effects are. The parts (`fem_parts`) are condensed to where something acts;
the struts join frame and platform, pose by pose. Struts lengthen by what their forces make joints give, so a nonlinear
joint is an initial strain: the forces follow from equilibrium almost alone, and a few steps settle them. Loads are +F
and -F beside the platform's weight; half the difference is read, the secant. The weight's geometric stiffness (5e-5 of
a strut's) is left out. `sound_machine` sets the struts so that the nominal machine describes the sound one.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.optimize import least_squares

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.rig import beams, fem_parts
from toolpath_stiff.rig.beams import NODE, STEEL, arm
from toolpath_stiff.rig.fem_parts import frame_corners, mean_radius, table_top
from toolpath_stiff.rig.fem_path import reference_rows
from toolpath_stiff.rig.hidden import HERTZ_LOAD, HiddenMachine, posed, readings, strut_stiffness
from toolpath_stiff.rig.nominal import Nominal, parse_nominal
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.structure import Motions, PosedRows
from toolpath_stiff.rig.unknown import opened

JOINT_SHARE = 0.02  # of a strut's nominal compliance that sits in each of its two joints
JOINT_TURNING = 2e3  # N m/rad, what a sound joint resists
STRUT = 0.10  # m, diameter of a strut in bending
WORN = 0.3  # of the travel between the law's two lengths, a worn stretch
SEAT_WIDTH = 20.0  # N over which a loose joint goes from one seat to the other
WEIGHT = 9810.0  # N, platform with spindle and half the struts, of 0.305 m radius; others with its cube
CURVED_AT = 4000.0  # N, load at which the error of a load cell is quoted
# Standard deviations of ln stiffness from machine to machine, and of the scatter of clamping by direction; assumed.
SPREAD = {"members": 0.1, "feet": 0.15, "rim": 0.1, "spokes": 0.1, "mounts": 0.15, "plate": 0.15}
CLAMPING_SPREAD = 0.4
SETTLED, STEPS = 1e-10, 300  # of the largest strut force


@dataclass(frozen=True)
class FemMachine(HiddenMachine):
    """Elements of the machine; SI. The defaults are the sound machine without spread.

    Of `HiddenMachine` it has geometry, struts, `joint`, `hertz`, `clearance`, gauge and drift; nothing else acts.

    Attributes
    ----------
    law
        Factors on the struts' nominal compliance at the two ends of the law (`sound_machine`).
    members, feet, brackets, rim, spokes, tool, mounts, plate, floor
        As of `fem_parts`.
    bearings, flange
        m/N at the spindle in platform axes; rotation vector, root of rad/(N m).
    riser
        m/N sideways of the block under the work in the set-up `riser`, broader than high: in shear.
    seat, seat_strut
        Give of one strut's platform joint in one direction: platform axes, root of m/N.
    swing, opening, turning, worn
        m/N per squared sine of a joint's swing; m/N in tension; N m/rad of each strut's ends; strut, where its worn
        stretch begins (share between the law's lengths) and m/N there.
    hose
        N/m and azimuth of a spring that pulls the platform's hub towards the frame.
    touches_above, cell_curve, stand
        m above the tip; of a load of 4000 N; m/N per m^3 of height.
    clamping_axes
        Factors on the scatter of clamping along X, Y, Z.
    """

    law: FloatArray = field(default_factory=lambda: np.ones(2))
    members: FloatArray = field(default_factory=lambda: np.ones(24))
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
    riser: float = 0.0
    seat: FloatArray = field(default_factory=lambda: np.zeros(3))
    seat_strut: int = 0
    swing: float = 0.0
    opening: float = 0.0
    turning: FloatArray = field(default_factory=lambda: np.full(6, JOINT_TURNING))
    worn: FloatArray = field(default_factory=lambda: np.zeros(3))
    hose: FloatArray = field(default_factory=lambda: np.zeros(2))
    touches_above: float = 0.0
    cell_curve: float = 0.0
    stand: float = 0.0
    clamping_axes: FloatArray = field(default_factory=lambda: np.ones(3))

    def stiffness(self, nominal: Nominal, rows: Rows) -> FloatArray:
        """(n,) N/m, secant stiffness between tool and workpiece along the load."""
        return np.asarray(rows.force / between(nominal, self, rows, 0.0))

    def displacement(self, nominal: Nominal, rows: Rows) -> FloatArray:
        """(n,) m that the indicator shows while the load cell shows the load."""
        tall = np.maximum(rows.position[:, 2] - table_top(nominal), 0.0)
        stand = rows.force * self.stand * tall**3 * (1.0 - rows.direction[:, 2] ** 2)
        moved = between(nominal, self, rows, self.touches_above) + stand + self.drift * rows.time
        return np.asarray(moved / (1.0 + self.cell_curve * rows.force / CURVED_AT))

    def motions(self, nominal: Nominal, rows: Rows, lengths: FloatArray) -> Motions:
        """Motions under the loads of the rows, as of a machine of springs; a strut's joints are those at both ends."""
        state, pose, struts, give = solved(nominal, self, rows)
        columns, pull, extra = moved(self, rows, struts[pose], give[pose])
        down = (state.work_point - state.platform_joints.mean(axis=1))[pose]
        body = columns[:, 12:15] + np.cross(columns[:, 15:18], down)  # the platform carried on to the tip
        tip, platform = (np.einsum("ni,ni->n", rows.direction, ends) for ends in (columns[:, 6:9], body))
        work, corners, force = _work(self, rows, state, pose), frame_corners(nominal), rows.force[:, None]
        proper, joint = np.moveaxis(struts[pose], -1, 0)
        alone = np.where(lengths[:, None] > 0.0, lengths[:, None], state.lengths[pose])
        outward = corners * [1.0, 1.0, 0.0] / np.linalg.norm(corners[:, :2], axis=1, keepdims=True)
        return Motions(
            tip=(tip + work) / rows.force, spindle=(tip - platform) / rows.force, table=work / rows.force,
            struts=proper * pull / force, joints=(joint * pull + extra) / force,
            alone=1.0 / strut_stiffness(nominal, self, alone),
            vertices=columns[:, 19:].reshape(len(pose), len(corners), NODE)[..., :3] / force[..., None],
            outward=np.broadcast_to(outward, (len(pose), len(corners), 3)),
        )  # fmt: skip

    def scattered(self, rng: Generator) -> Self:
        """One machine of many: sections differ a little from the drawing, and clamping scatters by direction."""
        factors = {
            name: before * np.exp(width * (rng.standard_normal() + 0.3 * rng.standard_normal(np.shape(before))))
            for name, width in SPREAD.items()
            for before in [getattr(self, name)]
        }
        return replace(self, **factors, clamping_axes=np.exp(CLAMPING_SPREAD * rng.standard_normal(3)))


def strut_give(machine: FemMachine, state: PosedRows) -> tuple[FloatArray, FloatArray]:
    """(n, 6) m/N along the struts, and (n, 6) m/N of both joints of each: the linear parts."""
    nominal = state.nominal
    first, last = nominal.law_ends
    share = (state.lengths - first) / (last - first)
    joint = JOINT_SHARE / float(nominal.law_stiffnesses.mean())
    law = (1.0 - share) * machine.law[0] + share * machine.law[1]
    proper = law / strut_stiffness(nominal, machine, state.lengths) - 2.0 * joint
    number, start, worn = machine.worn
    proper = proper + worn * ((share >= start) & (share <= start + WORN) & (np.arange(6) == number))
    give = 2.0 * joint + machine.joint + machine.swing * state.swing
    held = state.units[:, machine.seat_strut, None] @ state.rotation
    give[:, machine.seat_strut] += (held[:, 0] @ machine.seat) ** 2
    return np.asarray(proper), np.asarray(give)


def extra_give(machine: FemMachine, forces: FloatArray) -> FloatArray:
    """(n, 6) m of nonlinear give in the joints at strut forces (n, 6) N, tension positive."""
    contact = machine.hertz * HERTZ_LOAD * np.sign(forces) * np.cbrt(np.abs(forces) / HERTZ_LOAD) ** 2
    loose = 0.5 * machine.clearance * np.tanh(forces / SEAT_WIDTH)
    return np.asarray(contact + loose + machine.opening * forces * opened(forces))


def solved(nominal: Nominal, machine: FemMachine, rows: Rows) -> tuple[PosedRows, IntArray, FloatArray, FloatArray]:
    """Assemble and condense every distinct pose of the rows.

    Returns
    -------
    state
        The p poses.
    pose
        (n,) which of them each row has.
    struts
        (p, 6, 2) m/N of struts and joints, linear.
    give
        (p, q, q) m/N between columns: elongations of 6 struts, tip (6), hub (6), weight (N), frame's corners (6 v).
    """
    key = np.column_stack([rows.position, rows.angles, rows.extension])
    _, first, pose = np.unique(key, axis=0, return_index=True, return_inverse=True)
    state = posed(nominal, machine, rows.take(first))
    struts = np.stack(strut_give(machine, state), axis=-1)
    stiffness, columns = assembled(machine, state, struts.sum(axis=-1))
    return state, pose.ravel(), struts, np.swapaxes(columns, 1, 2) @ np.linalg.solve(stiffness, columns)


def assembled(machine: FemMachine, state: PosedRows, strut: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stiffness (p, N, N) of frame, struts and platform, and the columns (p, N, q) of `solved`."""
    nominal, count = state.nominal, len(strut)
    frame = fem_parts.frame_stiffness(nominal, machine.members, machine.feet, machine.brackets)
    upper, corners = len(frame), frame_corners(nominal)
    hub = upper + 6 * NODE
    total = np.zeros((count, hub + 2 * NODE, hub + 2 * NODE))
    total[:, :upper, :upper] = frame
    turn = np.einsum("ab,nij->naibj", np.eye(16), state.rotation).reshape(count, 48, 48)
    total[:, upper:, upper:] = turn @ _platforms(machine, state) @ np.swapaxes(turn, 1, 2)
    if machine.hose[0] > 0.0:
        side, azimuth = mean_radius(nominal.frame_joints), machine.hose[1]
        far = [side * np.cos(azimuth), side * np.sin(azimuth), 0.5 * side + table_top(nominal)]
        away = far - state.platform_joints.mean(axis=1)
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
        total[:, hub : hub + 3, hub : hub + 3] += machine.hose[0] * away[:, :, None] * away[:, None, :]
    columns = np.zeros((count, hub + 2 * NODE, 19 + upper))
    columns[:, hub + NODE :, 6:12] = columns[:, hub : hub + NODE, 12:18] = np.eye(NODE)
    columns[:, upper + 2 : hub : NODE, 18] = -WEIGHT * (mean_radius(nominal.platform_joints) / 0.305) ** 3 / 6.0
    columns[:, :upper, 19:] = np.eye(upper)
    elements = beams.spread(state.units, 1.0 / strut, 0.0 * strut, _bending(state.distances, machine.turning))
    reach, pull = np.tile(np.eye(12), (count, 1, 1)), np.zeros((count, 12))
    for k, corner in enumerate(nominal.vertices):
        where = np.concatenate([NODE * corner + np.arange(NODE), upper + NODE * k + np.arange(NODE)])
        reach[:, :6, :6] = arm(state.frame_joints[:, k] - corners[corner])
        total[:, where[:, None], where] += np.swapaxes(reach, 1, 2) @ elements[:, k] @ reach
        pull[:, :3], pull[:, 6:9] = -state.units[:, k], state.units[:, k]
        columns[:, where, k] = np.einsum("nji,nj->ni", reach, pull)
    return total, columns


def _platforms(machine: FemMachine, state: PosedRows) -> FloatArray:
    """(p, 48, 48) platform with its tool, in platform axes."""
    nominal, extension = state.nominal, state.rows.extension
    joints = (state.platform_joints - state.work_point[:, None]) @ state.rotation
    give = np.diag([*machine.bearings, 0.0, 0.0, 0.0])
    give[3:, 3:] += np.outer(machine.flange, machine.flange)
    lengths, first, which = np.unique(extension + machine.tip_error, return_index=True, return_inverse=True)
    made = [
        fem_parts.platform_stiffness(
            nominal, joints[pose] - [0.0, 0.0, below], -below, machine.rim, machine.spokes, give, machine.tool
        )
        for below, pose in zip(lengths.tolist(), first, strict=True)
    ]
    return np.array(made)[which.ravel()]


def _bending(length: FloatArray, turning: FloatArray) -> FloatArray:
    """(n, 6, 4, 4) bending of struts with end springs `turning` (6,) N m/rad; the struts' end slopes condensed."""
    strut = beams.bending(np.full(length.shape, STEEL[0] * beams.bar(STRUT)[2]), length, np.zeros_like(length))
    spring = np.broadcast_to(turning, length.shape)[..., None, None] * np.eye(2)
    moves, slopes = np.ix_([0, 2], [0, 2]), np.ix_([1, 3], [1, 3])
    coupled = np.zeros((*length.shape, 4, 2))  # displacement and slope of both nodes, with the strut's own slopes
    coupled[..., 0::2, :] = strut[..., 0::2, 1::2]
    coupled[..., 1::2, :] = -spring
    total = np.zeros((*length.shape, 4, 4))
    total[..., moves[0], moves[1]], total[..., slopes[0], slopes[1]] = strut[..., 0::2, 0::2], spring
    return np.asarray(total - coupled @ np.linalg.solve(strut[..., 1::2, 1::2] + spring, np.swapaxes(coupled, -1, -2)))


def moved(
    machine: FemMachine, rows: Rows, struts: FloatArray, give: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The columns of `solved` (n, q) m, the struts' forces (n, 6) N and `extra_give` (n, 6) m: half of +F less -F.

    `struts` (n, 6, 2) and `give` (n, q, q) of the rows.
    """
    compliance = struts.sum(axis=-1)
    pushed = np.einsum("nij,nj->ni", give[:, :, 6:9], rows.force[:, None] * rows.direction)
    sides = []
    for side in (1.0, -1.0):
        free = side * pushed + give[:, :, 18]
        extra, pull = np.zeros_like(compliance), free[:, :6] / compliance
        for _ in range(STEPS):
            before, extra = extra, extra_give(machine, pull)
            if np.abs(extra - before).max() <= SETTLED * np.abs(free[:, :6]).max():
                break
            strained = free + np.einsum("nij,nj->ni", give[:, :, :6], extra / compliance)
            pull = (strained[:, :6] - extra) / compliance
        else:
            raise RuntimeError("the forces of the struts did not settle")
        sides.append((free + np.einsum("nij,nj->ni", give[:, :, :6], extra / compliance), pull, extra))
    halves = [0.5 * (plus - minus) for plus, minus in zip(*sides, strict=True)]
    return halves[0], halves[1], halves[2]


def between(nominal: Nominal, machine: FemMachine, rows: Rows, above: float) -> FloatArray:
    """(n,) m by which the work and a point `above` m over the tip move apart along the load."""
    state, pose, struts, give = solved(nominal, machine, rows)
    columns = moved(machine, rows, struts[pose], give[pose])[0]
    touched = columns[:, 6:9] + np.cross(columns[:, 9:12], above * state.rotation[pose, :, 2])
    return np.asarray(np.einsum("ni,ni->n", rows.direction, touched) + _work(machine, rows, state, pose))


def _work(machine: FemMachine, rows: Rows, state: PosedRows, pose: IntArray) -> FloatArray:
    """(n,) m of give of table and riser along the load."""
    tips = state.work_point
    table = fem_parts.table_give(state.nominal, tips, machine.mounts, machine.plate, machine.floor)[pose]
    along = np.einsum("ni,nij,nj->n", rows.direction, table, rows.direction)
    riser = machine.riser * (rows.setup == "riser") * (1.0 - rows.direction[:, 2] ** 2)
    return np.asarray(rows.force * (along + riser))


def sound_machine(nominal: Nominal) -> FemMachine:
    """The machine without fault or spread; its struts make up for the give of the other parts (least squares)."""
    return FemMachine(law=np.array(_calibrated(nominal.text, nominal.name)))


@lru_cache(maxsize=4)
def _calibrated(text: str, name: str) -> tuple[float, ...]:
    nominal = parse_nominal(text, name)
    rows = reference_rows(nominal)
    wanted = np.log(readings(nominal, HiddenMachine(), rows))

    def missed(law: FloatArray) -> FloatArray:
        return np.asarray(np.log(readings(nominal, FemMachine(law=law), rows)) - wanted)

    return tuple(least_squares(missed, np.ones(2), xtol=1e-12, ftol=1e-12).x.round(8).tolist())
