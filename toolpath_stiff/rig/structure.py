"""Rows of a measuring campaign, and the machine as assembled elements: a displacement method, solved row by row.

Unknowns are the movements of the platform (a rigid body, or the eight nodes of its truss) and the give of every link
that can give way: joints along their struts, frame vertices, spindle, table, set-up. Each element adds k b b^T, with b
the row that turns unknowns into its deformation (Zienkiewicz, Taylor, The Finite Element Method, direct stiffness
assembly). A link that does not give way has its unknown held, so nothing is stiff enough to spoil the solution.

Joints whose stiffness depends on their load are solved by secant iteration: assemble with the secant stiffnesses of
the last loads, solve, repeat. Newton's method would meet the infinite slope of a clearance at no load.

The nominal machine, read from its TOML file by the rig's own reader, and its kinematics.

The rig must not trust the reader of the model that it judges, so it has this one. It takes what it needs (joints,
tool, strut law, limits of strut length and swing) and refuses machine files that carry effects: what the machine
hides is the rig's to choose. `true_poses` says where the platform really stands when the control, with the nominal
geometry, commands a pose.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, fields
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_text
from toolpath_stiff.toml_reader import TomlReader
from toolpath_stiff.units import m_from_mm, n_per_m_from_n_per_um, rad_from_deg

BARS = 19  # of the platform truss (the paper's Figure 2b)
HUB, TIP = 6, 7  # nodes of the platform truss after its six joints
SECANT_STEPS = 60
SECANT_TOLERANCE = 1e-11  # relative change of the tip's compliance between two steps
ROOM_TEMPERATURE = 20.0  # degrees C, reference temperature of length measurements (ISO 1)
SECTIONS = ("platform", "limits", "reference_tool", "strut_law", "frame_joints", "platform_joints")  # read here

# Joints of one vertex of the frame lie within this angle about the machine's axis; vertices are far more apart.
VERTEX_WIDTH = rad_from_deg(15.0)


@dataclass(frozen=True)
class Geometry:
    """True places of n rows, base axes, m.

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


@dataclass(frozen=True)
class Links:
    """How the links of n rows give way; SI. A compliance of zero is rigid.

    Attributes
    ----------
    struts
        (n, 6, 6) N/m; diagonal unless struts are coupled.
    joints
        Secant compliance (n, 6) m/N along the struts from strut forces (n, 6) N (tension positive).
    moment
        N m/rad, rotational spring at both ends of every strut; (n, 6) where struts and rows differ.
    bars
        N/m, bars of the platform truss; inf is rigid; (19,) where they differ, in the order of `truss_bars`.
    spindle
        (n, 3) m/N in platform axes.
    vertices
        (vertices, 2) m/N, radial and vertical.
    table
        (n, 3) m/N along base axes.
    rocking
        rad/(N m), of the table about the base frame's x and y axes through its origin.
    setup
        (n, 3) m/N along base axes.
    loose
        What the vertices give beside `vertices`, (n, vertices, 2) m/N, from strut forces (n, 6) N.
    ends
        Further links between tool and work that carry the whole load: lever (n, 3) and compliance (n,) each. A unit
        load along d puts d . lever on such a link (a force, or a torque where the lever is in m), and the tip moves
        along d by that times the compliance times d . lever.
    """

    struts: FloatArray
    joints: Callable[[FloatArray], FloatArray]
    moment: float | FloatArray
    bars: float | FloatArray
    spindle: FloatArray
    vertices: FloatArray
    table: FloatArray
    rocking: float
    setup: FloatArray
    loose: Callable[[FloatArray], FloatArray] | None = None
    ends: tuple[tuple[FloatArray, FloatArray], ...] = ()


@dataclass(frozen=True)
class Solved:
    """The machine under its loads, per unit load.

    Attributes
    ----------
    compliance
        (n,) m/N between tool and workpiece.
    moved
        (n, N) the unknowns: the platform's own, then six joints, the vertices, spindle, table, set-up (`_give`).
    stretch
        (n, 6, N) what turns them into the elongation of each strut, its joints left out.
    platform_dofs
        How many unknowns are the platform's.
    """

    compliance: FloatArray
    moved: FloatArray
    stretch: FloatArray
    platform_dofs: int


def secant_compliance(place: Geometry, links: Links, direction: FloatArray, force: FloatArray) -> FloatArray:
    """(n,) m/N between tool and workpiece along unit vectors `direction` (n, 3) under loads `force` (n,) N."""
    return solved(place, links, direction, force).compliance


def solved(place: Geometry, links: Links, direction: FloatArray, force: FloatArray) -> Solved:
    """The machine under loads `force` (n,) N along unit vectors `direction` (n, 3)."""
    stretch, platform_springs, platform_dofs = _struts(place, links)
    load = _load_vector(place, links, direction, platform_dofs)
    give = _give(place, links)
    n, size = load.shape
    per_stretch = links.struts @ stretch  # (n, 6, N) N/m
    fixed = platform_springs + np.swapaxes(stretch, 1, 2) @ per_stretch
    first = platform_dofs
    forces = np.zeros((n, 6))
    compliance = np.zeros(n)
    for _ in range(SECANT_STEPS):
        give[:, :6] = links.joints(forces)
        if links.loose is not None:
            extra = links.vertices + links.loose(forces)
            give[:, 6 : 6 + links.vertices.size] = extra.reshape(n, -1)
        held = np.ones((n, size))
        held[:, first:] = give > 0.0
        springs = np.zeros((n, size))
        np.divide(1.0, give, out=springs[:, first:], where=give > 0.0)
        springs[:, first:][give <= 0.0] = 1.0  # any number: the unknown is held
        free = np.flatnonzero(held.any(axis=0))  # what is held in every row does not move
        stiffness = fixed[:, free[:, None], free] * held[:, free, None] * held[:, None, free]
        stiffness[:, range(len(free)), range(len(free))] += springs[:, free]
        pull = (load * held)[:, free]
        moved = np.zeros((n, size))
        moved[:, free] = np.linalg.solve(stiffness, pull[:, :, None])[:, :, 0]
        moved *= held
        before, compliance = compliance, np.einsum("ni,ni->n", load, moved)
        forces = force[:, None] * (per_stretch @ moved[:, :, None])[:, :, 0]
        if np.abs(compliance - before).max() <= SECANT_TOLERANCE * compliance.max():
            return Solved(compliance, moved, stretch, platform_dofs)
    raise RuntimeError("the secant stiffnesses of the joints did not settle")


def _struts(place: Geometry, links: Links) -> tuple[FloatArray, FloatArray, int]:
    """Rows that turn unknowns into strut elongations, springs on the platform's own unknowns, and their number."""
    n = len(place.work_point)
    strut = place.platform_joints - place.frame_joints
    length = np.linalg.norm(strut, axis=2)
    unit = strut / length[:, :, None]
    nodes = _nodes(place)
    rigid = _rigid_motions(nodes - place.work_point[:, None, :])  # (n, 24, 6)
    flexible = bool(np.isfinite(links.bars).all())
    motion = np.broadcast_to(np.eye(24), (n, 24, 24)) if flexible else rigid
    dofs = motion.shape[2]
    vertex_count = len(links.vertices)
    size = dofs + _give_size(vertex_count, len(links.ends))
    # Displacement of the platform end minus that of the frame end, base axes, per unknown.
    relative = np.zeros((n, 6, 3, size))
    relative[..., :dofs] = motion[:, :18].reshape(n, 6, 3, dofs)
    for i, vertex in enumerate(place.vertices):
        column = dofs + 6 + 2 * int(vertex)
        relative[:, i, :, column] = -_radial(place, int(vertex))
        relative[:, i, 2, column + 1] = -1.0
    stretch = np.einsum("nki,nkij->nkj", unit, relative)
    stretch[:, range(6), range(dofs, dofs + 6)] = -1.0  # what the joints take is not left for the strut
    springs = np.zeros((n, size, size))
    if flexible:
        springs[:, :dofs, :dofs] = _truss(nodes, np.broadcast_to(links.bars, (BARS,)))
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
    """(n, N, N) for springs `moment` (n, 6): squares of the struts' rotations against frame and platform, without spin.

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


def _truss(nodes: FloatArray, stiffness: FloatArray) -> FloatArray:
    """(n, 24, 24) stiffness of the platform's bars, `stiffness` (19,) N/m."""
    total = np.zeros((len(nodes), 24, 24))
    for (i, j), spring in zip(truss_bars(nodes), stiffness, strict=True):
        bar = nodes[:, j] - nodes[:, i]
        unit = bar / np.linalg.norm(bar, axis=1, keepdims=True)
        row = np.zeros((len(nodes), 24))
        row[:, 3 * i : 3 * i + 3], row[:, 3 * j : 3 * j + 3] = -unit, unit
        total += spring * row[:, :, None] * row[:, None, :]
    return total


def _rigid_motions(arms: FloatArray) -> FloatArray:
    """(n, 3 k, 6) displacements of k points at `arms` (n, k, 3) from unit translations and unit rotations."""
    n, k = arms.shape[:2]
    motion = np.zeros((n, k, 3, 6))
    motion[..., :3] = np.eye(3)
    for axis in range(3):
        motion[..., 3 + axis] = np.cross(np.eye(3)[axis], arms)
    return motion.reshape(n, 3 * k, 6)


def _radial(place: Geometry, vertex: int) -> FloatArray:
    """(n, 3) horizontal unit vector from the machine's axis to a vertex of the frame."""
    outward = place.frame_joints[:, place.vertices == vertex].mean(axis=1) * np.array([1.0, 1.0, 0.0])
    return np.asarray(outward / np.linalg.norm(outward, axis=1, keepdims=True))


def _give_size(vertex_count: int, further: int) -> int:
    """Unknowns beside the platform's: six joints, two a vertex, spindle 3, table 3 and rocking 2, set-up 3, others."""
    return 6 + 2 * vertex_count + 3 + 3 + 2 + 3 + further


def _give(place: Geometry, links: Links) -> FloatArray:
    """(n, .) compliances of those unknowns, in their order; the joints' are filled in during the iteration."""
    n = len(place.work_point)
    return np.concatenate(
        [
            np.zeros((n, 6)),
            np.broadcast_to(links.vertices.ravel(), (n, links.vertices.size)),
            links.spindle,
            links.table,
            np.full((n, 2), links.rocking),
            links.setup,
            *(compliance[:, None] for _, compliance in links.ends),
        ],
        axis=1,
    )


def _load_vector(place: Geometry, links: Links, direction: FloatArray, dofs: int) -> FloatArray:
    """(n, N) what each unknown adds to the movement of tool against workpiece along `direction`."""
    n = len(direction)
    size = dofs + _give_size(len(links.vertices), len(links.ends))
    vector = np.zeros((n, size))
    # Tip of a rigid platform: the first three unknowns; node TIP of a truss: three of its last ones.
    tip = 0 if dofs == 6 else 3 * TIP
    vector[:, tip : tip + 3] = direction
    end = dofs + 6 + 2 * len(links.vertices)
    vector[:, end : end + 3] = np.einsum("ni,nij->nj", direction, place.rotation)  # spindle, platform axes
    # The workpiece is pushed back: the load on it is -direction, so its give counts with the same sign.
    vector[:, end + 3 : end + 6] = direction
    vector[:, end + 6 : end + 8] = np.cross(place.work_point, direction)[:, :2]
    vector[:, end + 8 : end + 11] = direction
    for column, (lever, _) in enumerate(links.ends, end + 11):
        vector[:, column] = np.einsum("ni,ni->n", direction, lever)
    return vector


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
    temperature
        (n,) degrees C; None: 20 throughout.
    """

    position: FloatArray
    angles: FloatArray
    direction: FloatArray
    force: FloatArray
    extension: FloatArray
    time: FloatArray
    elapsed: FloatArray
    setup: TextArray
    temperature: FloatArray | None = None

    def take(self, index: IntArray) -> Rows:
        """Some of the rows."""
        columns: dict[str, Any] = {
            field.name: None if (values := getattr(self, field.name)) is None else values[index]
            for field in fields(self)
        }
        return Rows(**columns)

    @property
    def warmth(self) -> FloatArray:
        """(n,) K above 20 degrees C."""
        return np.zeros(len(self.force)) if self.temperature is None else self.temperature - ROOM_TEMPERATURE


@dataclass(frozen=True)
class Nominal:
    """What the controller believes; SI.

    Attributes
    ----------
    text
        The machine file as it stands.
    frame_joints, platform_joints
        (6, 3) m; base frame, and platform frame with the reference tool's tip as the origin.
    tool_length
        m, length of the reference tool.
    law_lengths, law_stiffnesses
        (p,) m and N/m; the stiffness of a strut is linear in its length between two points, and along the first and the
        last two outside. One point: the same at every length.
    strut_range
        (2,) m, shortest and longest strut.
    swing
        Largest swing (rad) of a strut at its frame and its platform joint from the neutral pose; None: unlimited.
    neutral_pose
        x, y, z (m), roll, pitch, yaw (rad).
    """

    name: str
    text: str
    frame_joints: FloatArray
    platform_joints: FloatArray
    tool_length: float
    law_lengths: FloatArray
    law_stiffnesses: FloatArray
    strut_range: tuple[float, float]
    swing: tuple[float, float] | None
    neutral_pose: FloatArray

    @property
    def law_ends(self) -> tuple[float, float]:
        """Shortest and longest strut that the law is given for, m; of one point the travel."""
        if len(self.law_lengths) == 1:
            return self.strut_range
        return float(self.law_lengths[0]), float(self.law_lengths[-1])

    @property
    def vertices(self) -> IntArray:
        """(6,) number of the frame vertex that holds each strut, counted from 0 in the order of the struts."""
        azimuth = np.arctan2(self.frame_joints[:, 1], self.frame_joints[:, 0])
        found: list[float] = []
        numbers = np.empty(6, dtype=np.int64)
        for strut, angle in enumerate(azimuth):
            turns = [abs(math.remainder(angle - other, 2.0 * math.pi)) for other in found]
            if not turns or min(turns) > VERTEX_WIDTH:
                found.append(float(angle))
                turns.append(0.0)
            numbers[strut] = int(np.argmin(turns))
        return numbers


def load_nominal(machine: str = defaults.MACHINE) -> Nominal:
    """Nominal machine by the name of a packaged file or by path.

    Raises
    ------
    InputError
        There is no such file, or it lacks what the rig needs, or it carries effects.
    """
    if machine.endswith(".toml") or "/" in machine:
        return parse_nominal(read_text(machine, "the machine file"), machine)
    folder = resources.files("toolpath_stiff") / "data" / "machines"
    packaged = folder / f"{machine}.toml"
    if not packaged.is_file():
        names = sorted(Path(item.name).stem for item in folder.iterdir() if item.name.endswith(".toml"))
        raise InputError(f"no machine {machine!r}", expected=f"{', '.join(names)}, or a file ending in .toml")
    return deepcopy(_packaged(machine))  # its arrays are the caller's own


@cache
def _packaged(machine: str) -> Nominal:
    """A machine that ships with the package, read once."""
    file = f"{machine}.toml"
    return parse_nominal((resources.files("toolpath_stiff") / "data" / "machines" / file).read_text("utf-8"), file)


def parse_nominal(text: str, file: str) -> Nominal:
    """Nominal machine from the text of a machine file; `file` names it in messages. Raises `InputError`."""
    toml = TomlReader(text, file)
    table = toml.data
    for name in SECTIONS:
        _section(toml, name)
    for kind in ("effect", "instrument"):
        if table.get(kind):
            raise InputError(
                f"the machine carries [[{kind}]] already",
                expected="a nominal machine",
                hint="take the effects out; the rig adds its own hidden one",
                file=file,
                line=toml.line_of(kind),
            )
    bars = table.get("platform", {}).get("bar_stiffness_N_per_m", math.inf)
    if bars != math.inf:
        raise toml.error(
            f"[platform] bar_stiffness_N_per_m = {bars}",
            "inf",
            "the rig's nominal platform is rigid; a flexible one is the hidden effect platform_flexibility",
            where="platform.bar_stiffness_N_per_m",
        )
    angles = _section(toml, "limits.joint_angle")
    neutral = _numbers(toml, "limits.joint_angle", "neutral_pose_mm_deg", 6) if angles else np.zeros(6)
    lengths, stiffnesses = _law(toml)
    return Nominal(
        name=str(table.get("name", "machine")),
        text=text,
        frame_joints=_joints(toml, "frame_joints"),
        platform_joints=_joints(toml, "platform_joints"),
        tool_length=m_from_mm(float(_numbers(toml, "reference_tool", "length_mm", 1)[0])),
        law_lengths=lengths,
        law_stiffnesses=stiffnesses,
        strut_range=(
            m_from_mm(float(_numbers(toml, "limits.strut_length", "min_mm", 1)[0])),
            m_from_mm(float(_numbers(toml, "limits.strut_length", "max_mm", 1)[0])),
        ),
        swing=None
        if not angles
        else (
            rad_from_deg(float(_numbers(toml, "limits.joint_angle", "frame_max_deg", 1)[0])),
            rad_from_deg(float(_numbers(toml, "limits.joint_angle", "platform_max_deg", 1)[0])),
        ),
        neutral_pose=np.concatenate([m_from_mm(neutral[:3]), rad_from_deg(neutral[3:])]),
    )


def _section(toml: TomlReader, name: str) -> dict[str, Any]:
    """A table by its dotted name, empty where there is none. Raises `InputError`."""
    content = toml.data
    for part in name.split("."):
        content = toml.table(name, content.get(part, {}), f"a section [{name}]")
    return content


def _numbers(toml: TomlReader, section: str, key: str, count: int) -> FloatArray:
    """(count,) the numbers under a key."""
    given = _section(toml, section).get(key)
    try:
        values = np.atleast_1d(np.asarray(given, dtype=float))
    except (TypeError, ValueError):
        values = np.array([math.nan])
    if values.shape != (count,) or not np.isfinite(values).all():
        found = f"{key} = {'missing' if given is None else repr(given)}"
        raise toml.error(found, f"{count} number{'s' * (count > 1)}", where=f"{section}.{key}")
    return values


def _law(toml: TomlReader) -> tuple[FloatArray, FloatArray]:
    """(p,) m and (p,) N/m of the strut law: a stiffness for each of two or more lengths, or one without a length."""
    lengths, stiffnesses = (_section(toml, "strut_law").get(key) for key in ("length_mm", "stiffness_N_per_um"))
    if lengths is None and not isinstance(stiffnesses, list):
        one = n_per_m_from_n_per_um(_numbers(toml, "strut_law", "stiffness_N_per_um", 1))
        return np.zeros(1), one
    count = max(2, len(lengths) if isinstance(lengths, list) else 0)
    at = m_from_mm(_numbers(toml, "strut_law", "length_mm", count))
    if count > 2 and not (np.diff(at) > 0.0).all():
        raise toml.error(f"length_mm = {lengths!r}", "rising lengths", where="strut_law.length_mm")
    return at, n_per_m_from_n_per_um(_numbers(toml, "strut_law", "stiffness_N_per_um", count))


def _joints(toml: TomlReader, section: str) -> FloatArray:
    """(6, 3) m, joints given as x, y, z or as radius, angle, height."""
    content = _section(toml, section)
    rows = content.get("mm", content.get("cylindrical_mm_deg"))
    try:
        joints = np.asarray(rows, dtype=float)
    except (TypeError, ValueError):
        joints = np.empty(0)
    if joints.shape != (6, 3) or not np.isfinite(joints).all():
        raise toml.error(f"[{section}] has no six joints", "mm or cylindrical_mm_deg, 6 rows of 3", where=section)
    if "mm" in content:
        return m_from_mm(joints)
    radius, angle, height = m_from_mm(joints[:, 0]), rad_from_deg(joints[:, 1]), m_from_mm(joints[:, 2])
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def rotations(angles: FloatArray) -> FloatArray:
    """(n, 3, 3) R = Rz(yaw) Ry(pitch) Rx(roll) from (n, 3) roll, pitch, yaw in rad."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).T, np.sin(angles).T
    return np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=-1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=1,
    )


def commanded_lengths(nominal: Nominal, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, 6) m, strut lengths for tool tips (n, 3), rotations (n, 3, 3) and tools longer by `extension` (n,)."""
    joints = platform_points(nominal.platform_joints, tips, turned, extension)
    return np.asarray(np.linalg.norm(joints - nominal.frame_joints, axis=2))


def platform_points(points: FloatArray, tips: FloatArray, turned: FloatArray, extension: FloatArray) -> FloatArray:
    """(n, k, 3) m in base axes: platform points (k, 3), given from the reference tool's tip."""
    raised = points + extension[:, None, None] * np.array([0.0, 0.0, 1.0])
    return np.asarray(tips[:, None, :] + np.einsum("nij,nkj->nki", turned, raised))


def true_poses(
    lengths: FloatArray, frame: FloatArray, platform: FloatArray, tips: FloatArray, turned: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Poses (n, 3), (n, 3, 3) of the platform at which the true joints have the commanded strut lengths (n, 6).

    Newton's method on the six closure equations, from the commanded pose; `platform` (6, 3) m counts from the origin
    of the platform frame. Joint errors are millimetres, so three or four steps reach rounding.

    Raises
    ------
    RuntimeError
        No convergence: the errors are beyond anything that the rig draws.
    """
    position, orientation = tips.copy(), turned.copy()
    for _ in range(20):
        arms = np.einsum("nij,kj->nki", orientation, platform)
        strut = position[:, None, :] + arms - frame
        found = np.linalg.norm(strut, axis=2)
        gap = lengths - found
        if np.abs(gap).max() < 1e-13:
            return position, orientation
        unit = strut / found[:, :, None]
        step = np.linalg.solve(np.concatenate([unit, np.cross(arms, unit)], axis=2), gap[:, :, None])[:, :, 0]
        position = position + step[:, :3]
        orientation = _turn(step[:, 3:]) @ orientation
        if np.abs(step).max() < 1e-12:
            return position, orientation
    raise RuntimeError("the closure equations of the platform did not converge")


def _turn(vector: FloatArray) -> FloatArray:
    """(n, 3, 3) rotation matrices of rotation vectors (n, 3) (Rodrigues)."""
    angle = np.linalg.norm(vector, axis=1)
    x, y, z = vector.T
    zero = np.zeros_like(x)
    skew = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], 1)
    # sin(t)/t and (1 - cos t)/t^2 through sinc, which is safe at 0.
    first = np.sinc(angle / np.pi)[:, None, None]
    second = 0.5 * np.sinc(angle / (2.0 * np.pi))[:, None, None] ** 2
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


def reachable(nominal: Nominal, tips: FloatArray, angles: FloatArray, extension: FloatArray) -> BoolArray:
    """(n,) whether strut lengths and joint swings stay within the nominal machine's limits."""
    turned = rotations(angles)
    lengths = commanded_lengths(nominal, tips, turned, extension)
    low, high = nominal.strut_range
    inside = ((lengths >= low) & (lengths <= high)).all(axis=1)
    if nominal.swing is None:
        return np.asarray(inside)
    rest, moved = (
        strut_directions(nominal, *pose)
        for pose in (
            (nominal.neutral_pose[None, :3], rotations(nominal.neutral_pose[None, 3:]), np.zeros(1)),
            (tips, turned, extension),
        )
    )
    for limit, before, after in zip(nominal.swing, rest, moved, strict=True):
        cosine = np.clip(np.einsum("nki,nki->nk", np.broadcast_to(before, after.shape), after), -1.0, 1.0)
        inside &= (np.arccos(cosine) <= limit).all(axis=1)
    return np.asarray(inside)


def strut_directions(
    nominal: Nominal, tips: FloatArray, turned: FloatArray, extension: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (n, 6, 3) along the struts in base axes and in platform axes."""
    strut = platform_points(nominal.platform_joints, tips, turned, extension) - nominal.frame_joints
    unit = strut / np.linalg.norm(strut, axis=2, keepdims=True)
    return unit, unit @ turned
