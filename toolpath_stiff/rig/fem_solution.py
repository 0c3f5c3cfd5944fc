"""What instruments show on a machine of finite elements: poses solved once each, loads and nonlinear joints on top."""

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.rig import beams, fem
from toolpath_stiff.rig.beams import NODE, STEEL, arm
from toolpath_stiff.rig.fem import FemMachine, Places
from toolpath_stiff.rig.hidden import HiddenMachine
from toolpath_stiff.rig.hidden import true_stiffness as springs_stiffness
from toolpath_stiff.rig.nominal import Nominal, parse_nominal
from toolpath_stiff.rig.rows import Rows

STRUT = 0.10  # m, diameter of a strut in bending
MASS = 1000.0  # kg, platform with spindle and half the struts, of 0.305 m radius; others with its cube
CURVED_AT = 4000.0  # N, load at which the error of a load cell is quoted
SETTLED = 1e-10  # of the largest strut force
STEPS = 300
REFERENCE_POSES = 24  # of the calibration


class Solved(NamedTuple):
    """Poses (p,) solved.

    Attributes
    ----------
    give
        (p, q, q) m/N between columns: elongations of 6 struts, tip (6), hub (6), weight, vertices (6 v).
    strut
        (p, 6, 2) m/N of struts and joints, linear.
    place, pose
        Where they are, and which of them each of n rows has, (n,).
    """

    give: FloatArray
    strut: FloatArray
    place: Places
    pose: IntArray


def solved(nominal: Nominal, machine: FemMachine, rows: Rows) -> Solved:
    """Every different pose of the rows, assembled and condensed."""
    key = np.column_stack([rows.position, rows.angles, rows.extension])
    _, first, pose = np.unique(key, axis=0, return_index=True, return_inverse=True)
    at = rows.take(first)
    place = fem.places(nominal, machine, at)
    strut = np.stack(fem.strut_give(nominal, machine, place), axis=-1)
    stiffness, loads = _assembled(nominal, machine, at.extension, place, strut.sum(axis=-1))
    give = np.swapaxes(loads, 1, 2) @ np.linalg.solve(stiffness, loads)
    return Solved(give, strut, place, pose.ravel())


def _assembled(
    nominal: Nominal, machine: FemMachine, extension: FloatArray, place: Places, strut: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Stiffness (p, N, N) of frame, struts and platform, and the columns (p, N, q) of `Solved`."""
    count, frame = len(place.tip), fem.frame_stiffness(nominal, machine)
    upper, corners = len(frame), fem.vertex_nodes(nominal)
    size = upper + 8 * NODE
    total = np.zeros((count, size, size))
    total[:, :upper, :upper] = frame
    turn = np.zeros((count, 8 * NODE, 8 * NODE))
    for k in range(0, 8 * NODE, 3):
        turn[:, k : k + 3, k : k + 3] = place.rotation
    tools, tool = np.unique(extension, return_inverse=True)
    bodies = np.array([fem.platform_stiffness(nominal, machine, float(length)) for length in tools])
    total[:, upper:, upper:] = turn @ bodies[tool.ravel()] @ np.swapaxes(turn, 1, 2)
    loads = np.zeros((count, size, 19 + upper))
    vector = place.platform - place.frame
    length = np.linalg.norm(vector, axis=2)
    unit = vector / length[:, :, None]
    elements = beams.spread(unit, 1.0 / strut, 0.0 * strut, _pinned(length, machine.turning))
    reach = np.broadcast_to(np.eye(12), (count, 12, 12)).copy()
    for k, vertex in enumerate(nominal.vertices):
        where = [NODE * int(vertex) + j for j in range(NODE)] + [upper + NODE * k + j for j in range(NODE)]
        reach[:, :6, :6] = arm(place.frame[:, k] - corners[vertex])
        total[:, np.array(where)[:, None], where] += np.swapaxes(reach, 1, 2) @ elements[:, k] @ reach
        pull = np.concatenate([-unit[:, k], np.zeros((count, 3)), unit[:, k], np.zeros((count, 3))], axis=1)
        loads[:, where, k] = np.einsum("nji,nj->ni", reach, pull)
    radius = float(np.linalg.norm(nominal.platform_joints[:, :2], axis=1).mean())
    loads[:, upper + 2 : upper + 6 * NODE : NODE, 18] = -fem.GRAVITY * MASS * (radius / 0.305) ** 3 / 6.0
    loads[:, upper + 7 * NODE + np.arange(NODE), 6 + np.arange(NODE)] = 1.0
    loads[:, upper + 6 * NODE + np.arange(NODE), 12 + np.arange(NODE)] = 1.0
    loads[:, range(upper), range(19, 19 + upper)] = 1.0
    hub = upper + 6 * NODE
    if machine.hose[0] > 0.0:
        away = machine.hose[1:] - place.platform.mean(axis=1)
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
        total[:, hub : hub + 3, hub : hub + 3] += machine.hose[0] * away[:, :, None] * away[:, None, :]
    return total, loads


def _pinned(length: FloatArray, turning: FloatArray) -> FloatArray:
    """(n, 6, 4, 4) bending of struts whose ends turn against springs (6,) N m/rad; the struts' slopes condensed."""
    stiff = np.full(length.shape, STEEL[0] * beams.bar(STRUT)[2])
    strut = beams.bending(stiff, length, np.zeros_like(length))
    spring = np.broadcast_to(turning, length.shape)[..., None, None] * np.eye(2)
    slopes, moves = [1, 3], [0, 2]
    inner = strut[..., slopes, :][..., slopes] + spring
    outer = np.zeros((*length.shape, 4, 2))  # of the nodes' displacements and slopes with the strut's own slopes
    outer[..., moves, :] = strut[..., moves, :][..., slopes]
    outer[..., slopes, :] = -spring
    total = np.zeros((*length.shape, 4, 4))
    total[..., 0::2, 0::2] = strut[..., moves, :][..., moves]
    total[..., 1::2, 1::2] = spring
    return np.asarray(total - outer @ np.linalg.solve(inner, np.swapaxes(outer, -1, -2)))


def moved(machine: FemMachine, rows: Rows, made: Solved) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n, q) m the columns of `Solved` under +F less those under -F, halved.

    So are the struts' forces (n, 6) N, and what their joints give beside what is linear, (n, 6) m.
    """
    give, compliance = made.give[made.pose], made.strut[made.pose].sum(axis=-1)
    force = rows.force[:, None] * rows.direction
    pushed = np.einsum("nij,nj->ni", give[:, :, 6:9], force)
    weight, struts = give[:, :, 18], give[:, :, :6] / compliance[:, None, :]
    states = []
    for side in (1.0, -1.0):
        free = side * pushed + weight
        elongated, own = free, np.zeros_like(compliance)
        for _ in range(STEPS):
            pull = (elongated[:, :6] - own) / compliance
            after = fem.extra_give(machine, pull)
            if np.abs(after - own).max() <= SETTLED * np.abs(free[:, :6]).max():
                break
            own = after
            elongated = free + np.einsum("nij,nj->ni", struts, own)
        else:
            raise RuntimeError("the forces of the struts did not settle")
        states.append((elongated, pull, own))
    up, down = states
    return 0.5 * (up[0] - down[0]), 0.5 * (up[1] - down[1]), 0.5 * (up[2] - down[2])


def true_stiffness(nominal: Nominal, machine: FemMachine, rows: Rows, above: float = 0.0) -> FloatArray:
    """(n,) N/m between tool and work along the load, secant of +F and -F; of a point `above` the tip, m."""
    made = solved(nominal, machine, rows)
    displaced = moved(machine, rows, made)[0][:, 6:12]
    arms = above * made.place.rotation[made.pose, :, 2]
    read = np.einsum("ni,ni->n", rows.direction, displaced[:, :3] + np.cross(displaced[:, 3:], arms))
    return np.asarray(rows.force / (read + rows.force * _work_give(nominal, machine, rows, made)))


def _work_give(nominal: Nominal, machine: FemMachine, rows: Rows, made: Solved) -> FloatArray:
    """(n,) m/N of table and riser along the load."""
    tips = made.place.tip
    table = fem.table_give(nominal, machine, tips)[made.pose]
    along = np.einsum("ni,nij,nj->n", rows.direction, table, rows.direction)
    tall = tips[made.pose, 2] - fem.table_top(nominal)
    column = np.where(rows.setup == machine.riser_setup, tall**3 / (3.0 * machine.riser), 0.0)
    return np.asarray(along + column * (1.0 - rows.direction[:, 2] ** 2))


def readings(nominal: Nominal, machine: FemMachine, rows: Rows) -> FloatArray:
    """(n,) N/m that load cell and indicator show, before noise."""
    moved = rows.force / true_stiffness(nominal, machine, rows, machine.touches_above) + machine.drift * rows.time
    tall = np.maximum(rows.position[:, 2] - fem.table_top(nominal), 0.0)
    moved = moved + rows.force * machine.stand * tall**3 * (1.0 - rows.direction[:, 2] ** 2)
    factor = 1.0 + (rows.direction**2) @ (machine.gauge - 1.0)
    if machine.gauge_setup:
        factor = np.where(rows.setup == machine.gauge_setup, factor, 1.0)
    return np.asarray(factor * (1.0 + machine.cell_curve * rows.force / CURVED_AT) * rows.force / moved)


def true_displacements(
    nominal: Nominal, machine: FemMachine, rows: Rows, loops: list[str], lengths: FloatArray
) -> FloatArray:
    """(n,) m per N at the tip that indicators beside it read, of a strut alone per N in it (`loops`)."""
    made = solved(nominal, machine, rows)
    columns, pull, own = moved(machine, rows, made)
    place, strut = Places(*(part[made.pose] for part in made.place)), made.strut[made.pose]
    at_tip, down = columns[:, 6:9], place.tip - place.platform.mean(axis=1)
    body = columns[:, 12:15] + np.cross(columns[:, 15:18], down)  # the platform carried on to the tip
    work = rows.force * _work_give(nominal, machine, rows, made)
    given = np.where(lengths > 0.0, lengths, place.lengths.T).T
    bench = fem.strut_give(nominal, machine, place._replace(lengths=given))[0]
    corners = fem.vertex_nodes(nominal)
    read = np.empty(len(loops))
    for k, loop in enumerate(loops):
        kind, *rest = loop.split()
        number = int(rest[0]) - 1 if rest else 0
        load = rows.direction[k]
        along = {
            "tip": load @ at_tip[k] + work[k], "spindle": load @ (at_tip[k] - body[k]),
            "platform": load @ body[k] + work[k], "table": work[k],
            "strut": strut[k, number, 0] * pull[k, number],
            "joint": (strut[k, number, 1] * pull[k, number] + own[k, number]) * (0.5 if rest[1:] else 1.0),
        }  # fmt: skip
        if kind == "frame":
            way = {"radial": corners[number] * [1.0, 1.0, 0.0], "vertical": np.eye(3)[2]}.get("".join(rest[1:]), load)
            corner = columns[k, 19 + NODE * number : 22 + NODE * number]
            along["frame"] = way @ corner / np.linalg.norm(way)
        read[k] = along[kind or "tip"] / rows.force[k]
        if kind == "strut" and rest[1:]:
            read[k] = bench[k, number]
    return read


def reference_rows(nominal: Nominal) -> Rows:
    """Poses of the calibration: two heights, around the axis, upright and tilted; loads along X, Y, Z."""
    size = float(np.linalg.norm(nominal.platform_joints[:, :2], axis=1).mean())
    turn = np.arange(REFERENCE_POSES) * 2.4  # rad, the golden angle: no pattern of the machine's
    radius = size * np.sqrt((np.arange(REFERENCE_POSES) + 0.5) / REFERENCE_POSES)
    height = nominal.neutral_pose[2] + 1.3 * size * np.tile([-1.0, 0.0, 1.0], REFERENCE_POSES // 3)
    tilt = np.radians(15.0) * (np.arange(REFERENCE_POSES) % 2)
    angles = np.column_stack([tilt * np.cos(3.0 * turn), tilt * np.sin(3.0 * turn), 0.0 * turn])
    poses = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    return pulled(poses, angles)


def pulled(position: FloatArray, angles: FloatArray) -> Rows:
    """Rows of 1000 N along X, Y and Z at each of n poses, with the reference tool on the table."""
    n = 3 * len(position)
    return Rows(
        position=np.repeat(position, 3, axis=0),
        angles=np.repeat(angles, 3, axis=0),
        direction=np.tile(np.eye(3), (len(position), 1)),
        force=np.full(n, 1000.0),
        extension=np.zeros(n),
        time=np.zeros(n),
        elapsed=np.ones(n),
        setup=np.array(["table"] * n),
    )


@lru_cache(maxsize=4)
def _calibrated(text: str, name: str) -> tuple[float, float, float]:
    nominal = parse_nominal(text, name)
    rows = reference_rows(nominal)
    wanted = np.log(springs_stiffness(nominal, HiddenMachine(), rows))
    law = np.ones(2)

    def missed(law: FloatArray) -> FloatArray:
        return np.asarray(np.log(true_stiffness(nominal, FemMachine(law=law), rows)) - wanted)

    for _ in range(4):
        now = missed(law)
        slopes = np.column_stack([(missed(law + 1e-4 * way) - now) / 1e-4 for way in np.eye(2)])
        law = law - np.linalg.lstsq(slopes, now, rcond=None)[0]
    return float(law[0]), float(law[1]), float(np.sqrt(np.mean(missed(law) ** 2)))


def sound(nominal: Nominal) -> tuple[FemMachine, float]:
    """The machine without fault or spread, and the rms difference of ln stiffness that the nominal one leaves there."""
    first, last, left = _calibrated(nominal.text, nominal.name)
    return replace(FemMachine(), law=np.array([first, last])), left
