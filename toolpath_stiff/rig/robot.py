"""Invented milling robots that hide a fault, pulled at the tool: beams and joint springs, solved pose by pose.

Displacements come from the stiffness of the whole arm (nodes on both sides of every joint), not from a sum over its
joints; it stands where its Denavit-Hartenberg rows put it, computed here.
"""

import json
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.beams import NODE, add, bending, spread, springs
from toolpath_stiff.rig.campaigns import Table
from toolpath_stiff.rig.draws import Change, Hideable, whole
from toolpath_stiff.units import deg_from_rad, mm_from_m, um_from_m

RIGID = 1e12, 1e11  # N/m and N m/rad of what does not give way: a thousandth of a nm/N
LIMITS = np.deg2rad([[-170, 170], [-60, 80], [-150, 60], [-300, 300], [-120, 120], [-350, 350]])
POSES, LOADS = 24, (300.0, 600.0)  # pulled at, N along X, Y and Z
NOISE_FLOOR = 1e-6  # m, of an indicator, beside its relative noise
# kg of upper arm, forearm and spindle with what hangs on them, at their middles (assumed), and how well one knows them.
MASSES, KNOWN = (160.0, 120.0, 45.0), 0.05
HANGING = ((1, 2), (2, 3), (5, 6))  # joints, and the tip, between which these hang
GRAVITY = 9.81
SHARES = 0.08, 0.25  # by which a fault moves the readings, root mean square
TOOL = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # its x along the flange's z, its z against x
TAKEN_UP = 60.0  # N m at which three quarters of a gear's gap are taken up


@dataclass(frozen=True)
class Robot:
    """An arm of six joints with modified Denavit-Hartenberg rows (6, 4) of alpha, a, offset, d; SI.

    Attributes
    ----------
    mount
        (6,) compliance of its foot.
    torsion, bending
        (6,) rad/(N m) of the joints about and across their axes.
    arms
        (2, 3) EA (N), EI, GJ (N m2) of upper arm and forearm.
    spindle
        (3,) m/N in the axes of the tool.
    gap
        (6,) rad of lost turn in the joints' gears, either way.
    masses
        (3,) kg.
    balancer
        N m/rad of a spring beside joint 2.
    crosstalk
        What the indicator of x takes of z.
    creep
        Share by which displacements grow over the campaign.
    """

    rows: FloatArray
    tip: FloatArray
    mount: FloatArray
    torsion: FloatArray
    bending: FloatArray
    arms: FloatArray
    spindle: FloatArray
    gap: FloatArray
    masses: FloatArray
    balancer: float = 0.0
    crosstalk: float = 0.0
    creep: float = 0.0


def _fault(names: str, change: Change, parts: int = 1, largest: float = 30.0) -> Hideable:
    """A fault: right names in the catalogue, its change for a drawn part and a size, parts where it may sit."""
    return Hideable(change, largest, whole("part", 0, parts), names=frozenset(names.split()))


def _softened(field: str, count: int = 1) -> Change:
    """Multiply the compliances of a field, of one of `count` elements, by 1 + size."""
    return lambda r, p: {field: getattr(r, field) * (1.0 + p["size"] * (np.arange(count) == p["part"]))}


FAULTS: dict[str, Hideable] = {
    "joint_torsion": _fault("joint_torsion weak_element", _softened("torsion", 6), 6),
    "joint_bending": _fault("joint_bending weak_element", _softened("bending", 6), 3),
    "soft_link": _fault(
        "weak_element", lambda r, p: {"arms": r.arms / (1.0 + p["size"] * (np.arange(2) == p["part"]))[:, None]}, 2
    ),
    "loose_foot": _fault("weak_element", _softened("mount")),
    "soft_spindle": _fault("spindle_compliance weak_element", _softened("spindle"), largest=100.0),
    "backlash": _fault(
        "gear_backlash", lambda r, p: {"gap": r.gap + 1e-4 * p["size"] * (np.arange(6) == p["part"])}, 6
    ),
    "balancer": _fault("", lambda r, p: {"balancer": 1e6 * p["size"]}),
    "crosstalk": _fault("", lambda r, p: {"crosstalk": p["size"]}, largest=0.5),
    "creep": _fault("", lambda r, p: {"creep": p["size"]}, largest=0.5),
}
ELEMENTS = {**dict.fromkeys(("joint_torsion", "joint_bending", "backlash"), "joint {}"), "soft_link": "link {}"}


def invented(rng: Generator) -> Robot:
    """A robot of 100 to 300 kg payload, with sizes and compliances typical of such arms (assumed)."""

    def about(*values: float) -> FloatArray:
        return np.array(values) * np.exp(rng.normal(0.0, 0.2, len(values)))

    d1, a1, a2, a3, d4, d6 = np.round(np.array([0.75, 0.34, 1.1, 0.19, 1.2, 0.23]) * rng.uniform(0.85, 1.15, 6), 3)
    square = np.pi / 2.0
    rows = [(0.0, 0.0, 0.0, d1), (-square, a1, -square, 0.0), (0.0, a2, 0.0, 0.0)]
    rows += [(-square, a3, 0.0, d4), (square, 0.0, 0.0, 0.0), (-square, 0.0, 0.0, d6)]
    return Robot(
        rows=np.array(rows),
        tip=np.round(rng.uniform((0.15, 0.0, 0.1), (0.3, 0.0, 0.2)), 3),
        mount=about(6.0, 6.0, 2.5, 60.0, 60.0, 45.0) * 1e-9,
        torsion=about(620.0, 340.0, 460.0, 1900.0, 2300.0, 4800.0) * 1e-9,
        bending=about(150.0, 180.0, 220.0, 620.0, 830.0, 1100.0) * 1e-9,
        arms=np.stack([about(1900.0, 11.0, 6.5), about(1200.0, 5.0, 3.8)]) * 1e6,
        spindle=about(14.0, 14.0, 5.0) * 1e-9,
        gap=np.zeros(6),
        masses=np.array(MASSES) * np.exp(rng.normal(0.0, KNOWN, 3)),
    )


def machine_text(robot: Robot, name: str) -> str:
    """Machine file of the arm as it is believed to be."""
    tables: list[tuple[str, Document]] = [
        ("", {"name": name, "kind": "serial", "source": "invented by tps rig new --built serial"})
    ]
    for i, (alpha, a, offset, d) in enumerate(robot.rows):
        low, high = np.round(deg_from_rad(LIMITS[i]), 6)
        angles = {"alpha_deg": np.round(deg_from_rad(alpha), 9), "offset_deg": np.round(deg_from_rad(offset), 9)}
        lengths = {"a_mm": np.round(mm_from_m(a), 9), "d_mm": np.round(mm_from_m(d), 9)}
        axis = {"name": f"J{i + 1}", "type": "R", **angles, **lengths, "min_deg": low, "max_deg": high}
        tables.append(("[[axis]]", axis))
    tip = np.round(mm_from_m(robot.tip), 9)
    tables.append(("[tool]", {"tip_mm": tip, "x_axis": TOOL[:, 0], "z_axis": TOOL[:, 2]}))
    ends = mm_from_m(np.array([[robot.rows[2, 1], 0.0, 0.0], [robot.rows[3, 1], robot.rows[3, 3], 0.0]]))

    def spring(at: str, moves: FloatArray, turns: FloatArray) -> Document:
        give = {"translation_nm_per_N": 1e9 * moves, "rotation_nrad_per_Nm": 1e9 * turns}
        return {"name": {"base": "foot", "tip": "spindle"}[at], "type": "spring", "at": at, **give}

    give = {"torsion_nrad_per_Nm": 1e9 * robot.torsion, "bending_nrad_per_Nm": 1e9 * robot.bending}
    elements = [spring("base", robot.mount[:3], robot.mount[3:]), {"name": "joints", "type": "joint", **give}]
    arms = zip(("upper arm", "forearm"), ("J2", "J3"), ends, 1e-6 * robot.arms, strict=True)
    for arm, frame, end, (ea, ei, gj) in arms:
        where = {"frame": frame, "from_mm": np.zeros(3), "to_mm": np.round(end, 9), "z_axis": [0.0, 0.0, 1.0]}
        stiff = {"EA_MN": ea, "EIy_MNm2": ei, "EIz_MNm2": ei, "GJ_MNm2": gj}
        elements.append({"name": arm, "type": "beam", **where, **stiff})
    elements.append(spring("tip", robot.spindle, np.zeros(3)))
    tables += [("[[element]]", element) for element in elements]
    middles = [*(0.5 * ends), 0.5 * mm_from_m(robot.tip)]
    hanging = zip(("upper arm", "forearm", "spindle"), ("J2", "J3", "J6"), MASSES, middles, strict=True)
    for what, frame, mass, centre in hanging:
        tables.append(("[[mass]]", {"name": what, "kg": mass, "frame": frame, "centre_mm": np.round(centre, 9)}))
    written = (
        [heading, *(f"{key} = {json.dumps(to_dict(value))}" for key, value in of.items())] for heading, of in tables
    )
    return "\n\n".join("\n".join(lines).lstrip() for lines in written) + "\n"


def frames(robot: Robot, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Axes (n, 7, 3, 3) and origins (n, 7, 3) m of the joints' frames and of the tip, by products of 4x4 matrices."""
    total, axes, origins = np.broadcast_to(np.eye(4), (len(joints), 4, 4)), [], []
    for (alpha, a, offset, d), value in zip(robot.rows, joints.T, strict=True):
        ca, sa, c, s = np.cos(alpha), np.sin(alpha), np.cos(value + offset), np.sin(value + offset)
        zero, unit = np.zeros_like(c), np.ones_like(c)
        rows = [[c, -s, zero, a * unit], [s * ca, c * ca, -sa * unit, -d * sa * unit]]
        rows += [[s * sa, c * sa, ca * unit, d * ca * unit], [zero, zero, zero, unit]]
        total = total @ np.moveaxis(np.array(rows), -1, 0)
        axes.append(total[:, :3, :3])
        origins.append(total[:, :3, 3])
    axes.append(axes[-1] @ TOOL)
    origins.append(origins[-1] + axes[5] @ robot.tip)
    return np.stack(axes, axis=1), np.stack(origins, axis=1)


def pulled(robot: Robot, joints: FloatArray, force: FloatArray) -> FloatArray:
    """(n, 3) m, motion of the tool under forces (n, 3) N at joint values (n, 6) rad."""
    axes, origins = frames(robot, joints)
    _, places, number = np.unique(joints, axis=0, return_index=True, return_inverse=True)
    compliance = np.array([_compliance(robot, axes[i], origins[i]) for i in places])[number.ravel()]
    moved = np.einsum("nij,nj->ni", compliance, force)
    z, arms = axes[:, :6, :, 2], origins[:, 6:7] - origins[:, :6]
    torque = (z * np.cross(arms, force[:, None])).sum(axis=-1)
    weight = np.zeros_like(torque)
    for (first, last), mass in zip(HANGING, robot.masses, strict=True):
        centre = 0.5 * (origins[:, first] + origins[:, last])
        pull = np.cross(centre[:, None] - origins[:, : first + 1], [0.0, 0.0, -mass * GRAVITY])
        weight[:, : first + 1] += (z[:, : first + 1] * pull).sum(axis=-1)
    lost = robot.gap * (np.tanh((weight + torque) / TAKEN_UP) - np.tanh(weight / TAKEN_UP))
    moved = moved + (lost[..., None] * np.cross(z, arms)).sum(axis=1)
    moved[:, 0] += robot.crosstalk * moved[:, 2]
    return np.asarray(moved * (1.0 + robot.creep * np.linspace(0.0, 1.0, len(moved)))[:, None])


def _compliance(robot: Robot, axes: FloatArray, origins: FloatArray) -> FloatArray:
    """(3, 3) m/N at the tool; nodes: the foot, the far side of joints 1 to 6, the ends of both arms, the tool."""
    total = np.zeros((10 * NODE, 10 * NODE))
    add(total, [0], np.diag(1.0 / robot.mount))
    near = [0, 1, 7, 8, 4, 5]  # nodes that carry the joints
    places = [np.zeros(3), origins[0], origins[2], origins[3], origins[3], origins[4]]
    for i in range(6):
        about = 1.0 / np.array([robot.bending[i], robot.bending[i], robot.torsion[i]])
        if i == 1:
            about[2] += robot.balancer
        spring = np.zeros((6, 6))
        spring[:3, :3] = RIGID[0] * np.eye(3)
        spring[3:, 3:] = axes[i] @ np.diag(about) @ axes[i].T
        add(total, [near[i], i + 1], springs(spring, origins[i] - places[i]))
    for k, (first, last) in enumerate(((1, 2), (2, 3))):
        vector, (ea, ei, gj) = origins[last] - origins[first], robot.arms[k]
        length = np.linalg.norm(vector)
        bent = bending(np.array(ei), np.array(length), np.array(0.0))
        add(total, [first + 1, 7 + k], spread(vector / length, np.array(ea / length), np.array(gj / length), bent))
    tool = np.zeros((6, 6))
    tool[:3, :3] = axes[6] @ np.diag(1.0 / robot.spindle) @ axes[6].T
    tool[3:, 3:] = RIGID[1] * np.eye(3)
    add(total, [6, 9], springs(tool, origins[6] - origins[5]))
    tip = slice(9 * NODE, 9 * NODE + 3)
    return np.asarray(np.linalg.solve(total, np.eye(10 * NODE)[:, tip])[tip])


def robot_case(seed: int, hidden: str | None, noise: float) -> tuple[str, Table, Document]:
    """Machine file, pulls in shop units and truth of an exercise; `hidden` as for `draw_case`, or names of `FAULTS`."""
    streams = [np.random.default_rng([seed, 77, i]) for i in range(4)]
    robot = invented(streams[0])
    inside = [name for name, fault in FAULTS.items() if fault.names]
    groups = {"one": inside, "outside": [name for name in FAULTS if name not in inside], "none": []}
    drawn = str(streams[1].choice(["none", "one", "outside"], p=[0.25, 0.55, 0.2])) if hidden is None else hidden
    if drawn not in (*groups, *FAULTS):
        raise InputError(
            f"nothing called {drawn!r} to hide", expected=f"none, one, outside, or one of {', '.join(FAULTS)}"
        )
    names = groups.get(drawn, [drawn])
    joints, force = _campaign(robot, streams[2])
    sound, true, effects = pulled(robot, joints, force), robot, []
    if names:
        name = str(streams[1].choice(names))
        fault = FAULTS[name]
        part, share = fault.shape(streams[1]), float(np.exp(streams[1].uniform(*np.log(SHARES))))
        low, high = 1e-4, fault.limit
        for _ in range(18):  # size at which the readings change by that share, rms; at most the largest size
            size = float(np.sqrt(low * high))
            true = replace(robot, **fault.change(robot, part | {"size": size}))
            moved = np.linalg.norm(pulled(true, joints, force) - sound) / np.linalg.norm(sound)
            low, high = (size, high) if moved < share else (low, size)
        where = {"element": ELEMENTS[name].format(part["part"] + 1)} if name in ELEMENTS else {}
        fault_keys = {"effect": name, "names": sorted(fault.names or ()), "parameters": {**where, "by": size}}
        effects = [fault_keys | {"size": float(moved)}]
    moved_by = pulled(true, joints, force)
    sd = np.maximum(noise * np.linalg.norm(moved_by, axis=1), NOISE_FLOOR)
    for effect in effects:  # whitened length of the change of readings: small where weight holds a gap closed
        effect["detectability"] = float(np.linalg.norm((moved_by - sound) / sd[:, None]))
    read = moved_by + sd[:, None] * streams[3].standard_normal(moved_by.shape)
    table: Table = {f"joint_{i + 1}_deg": np.round(deg_from_rad(joints[:, i]), 9) for i in range(6)}
    table |= {f"f{axis}_N": force[:, i] for i, axis in enumerate("xyz")}
    table |= {f"u{axis}_um": um_from_m(read[:, i]) for i, axis in enumerate("xyz")}
    table["sd_um"] = um_from_m(sd)
    kind = "none" if not effects else "one" if effects[0]["names"] else "outside"
    truth = {"hidden": [e["effect"] for e in effects], "kind": kind, "effects": effects, "machine": to_dict(true)}
    return machine_text(robot, f"robot{seed}"), table, truth


def _campaign(robot: Robot, rng: Generator) -> tuple[FloatArray, FloatArray]:
    """Joint values (m, 6) rad, away from limits and singular poses, before the robot; forces (m, 3) N, base axes."""
    poses: list[FloatArray] = []
    while len(poses) < POSES:
        values = LIMITS[:, 0] + (0.1 + 0.8 * rng.random(6)) * (LIMITS[:, 1] - LIMITS[:, 0])
        values[0] *= 0.35
        values = np.round(values, 4)
        x, _, z = frames(robot, values[None])[1][0, 6]
        if abs(np.sin(values[4])) > 0.3 and x > 0.6 and 0.1 < z < 1.6:
            poses.append(values)
    forces = np.concatenate([load * np.eye(3) for load in LOADS])
    return np.repeat(np.array(poses), len(forces), axis=0), np.tile(forces, (POSES, 1))
