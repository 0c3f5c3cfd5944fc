"""Stiffness along a load, strut lengths and reach at many poses, block by block, by the fast way where it is safe."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.loads import Load, geometric_directions, load_directions
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.limits import Extremes, Reach, machine_limits, reach, solved
from toolpath_stiff.machine.model import Hexapod, MachineTool, as_hexapod
from toolpath_stiff.path.turning import room_to_wind, unwound
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import closed_form, core, element_sum
from toolpath_stiff.stiffness.model import StiffnessModel, path_of_stance
from toolpath_stiff.units import deg_from_rad, mm_from_m

BLOCK = 16_384  # poses at a time: the work arrays stay in the processor's cache
OF_THE_WORK = ("tangential", "axial", "normal", "radial")  # loads that turn with the work; others are of the machine
TURNING_BACK = 1e-6  # of a limit's span
MOST_TRIED = 60  # poses of a path at which every configuration is tried
FEW_CORNERS = 0.2  # share of the rows; with fewer, a second load at every pose costs more than these poses twice
Progress = Callable[[int, int], None]
OF_POSES, OF_REACH = ("stiffness", "substituted", "joints", "extrapolated"), ("margin", "limit", "value")
# Tool tips (n, 3), rotations (n, 3, 3) or None where all are upright, length of the tool (nan: the reference tool).
Poses = tuple[FloatArray, FloatArray | None, float]
# Tool tips (n, 3), rotations (n, 3, 3) or None where all are upright, tangents (n, 3), all in work axes.
WorkPoses = tuple[FloatArray, FloatArray | None, FloatArray]


@dataclass(frozen=True)
class Evaluation:
    """Figures of the machine at n poses. SI.

    Attributes
    ----------
    stiffness
        (n,) N/m along the load, displacement measured along it; nan where the pose is out of reach.
    substituted
        (n,) the asked load direction does not exist there, the softest one stands in.
    joints
        (n, j) m or rad, what the control moves: strut lengths of a hexapod.
    extrapolated
        (n,) a strut is longer or shorter than the strut law was given for.
    reach
        Margins and limits.
    configuration
        That is kept over a path, "" where there is no choice.
    """

    stiffness: FloatArray
    substituted: BoolArray
    joints: FloatArray
    extrapolated: BoolArray
    reach: Reach
    configuration: str = ""

    @property
    def reachable(self) -> BoolArray:
        """(n,) True where every limit is kept."""
        return self.reach.reachable

    @classmethod
    def joined(cls, parts: "Sequence[Evaluation]") -> "Evaluation":
        """Evaluation of a whole path from its consecutive parts."""
        if len(parts) == 1:
            return parts[0]

        def whole(names: Sequence[str], of: Sequence[object]) -> dict[str, AnyArray]:
            return {name: np.concatenate([getattr(part, name) for part in of]) for name in names}

        stand = Reach(**whole(OF_REACH, [part.reach for part in parts]), limits=parts[0].reach.limits)
        configuration = ", then ".join(part.configuration for part in parts)
        return cls(**whole(OF_POSES, parts), reach=stand, configuration=configuration)

    def put(self, rows: IntArray | slice, part: "Evaluation") -> None:
        """Enter the figures of some rows."""
        for name in OF_POSES:
            getattr(self, name)[rows] = getattr(part, name)
        for name in OF_REACH:
            getattr(self.reach, name)[rows] = getattr(part.reach, name)


def evaluate(
    model: StiffnessModel,
    position: FloatArray,
    abc: FloatArray,
    tangent: FloatArray,
    tool_length: FloatArray | float = np.nan,
    load: Load | None = None,
    force: float = defaults.FORCE,
    progress: Progress | None = None,
) -> Evaluation:
    """Evaluate n poses.

    Parameters
    ----------
    model
        Machine and effects.
    position, abc
        (n, 3) m and (n, 3) rad: tool tip; roll, pitch, yaw.
    tangent
        (n, 3) unit vectors of the motion (0 where there is none); only some loads ask for it.
    tool_length
        m, scalar or (n,); nan: the reference tool.
    load
        Direction of the load, tangential unless given.
    force
        N; only load-dependent effects ask for it.
    progress
        Called with (poses done, poses in all).

    Examples
    --------
    >>> from toolpath_stiff.analysis.loads import parse_load
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> position, zeros = np.array([[0.0, 0.0, 0.8], [0.2, 0.0, 0.8]]), np.zeros((2, 3))
    >>> found = evaluate(build_model(load_machine("nist")), position, zeros, zeros, load=parse_load("x"))
    >>> (found.stiffness / 1e3).round()  # N/mm
    array([54823., 49735.])
    """
    n, load = len(position), load or Load()
    if not isinstance(model.machine, Hexapod):
        return _by_elements(model, (position, abc, tangent), tool_length, load, force, progress)
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (n,))
    corner = corners(position, abc, lengths)
    many = n - int(np.count_nonzero(corner)) >= core.CLOSED_FORM_FROM
    directed = many and load.kind != "softest" and core.is_closed_form(model)
    result = _to_fill(model.machine, n)
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        block = np.arange(start, stop)
        for tool, some in core.rows_of_tools(lengths[start:stop]):
            rows = block[some]
            if directed:
                last = corner[rows] & (rows < stop - 1)
                ends: tuple[IntArray | slice, ...] = (rows if len(rows) < len(block) else slice(start, stop),)
                if last.any():
                    first = rows[~np.append(False, last[:-1])]
                    ends = first, first + corner[first] * (first < stop - 1)
                loads, left = [tangent[part] for part in ends], []
                fast = _by_closed_form(model, load, loads, _poses(position, abc, tool, ends[0]))
                for part, (evaluated, sure) in zip(ends, fast, strict=True):
                    result.put(part, evaluated)
                    left.append((block if isinstance(part, slice) else part)[~sure])
                rows = np.unique(np.concatenate(left))
            if len(rows):
                result.put(rows, _by_solution(model, load, tangent[rows], _poses(position, abc, tool, rows), force))
        if progress:
            progress(stop, n)
    return result


def _to_fill(machine: MachineTool, n: int, configuration: str = "") -> Evaluation:
    """Evaluation of n poses, into which the figures of some rows after the others are put."""
    stand = Reach(np.empty(n), np.zeros(n, dtype=np.int8), np.empty(n), machine_limits(machine))
    joints, (substituted, extrapolated) = np.empty((n, len(machine.joint_names))), np.zeros((2, n), dtype=bool)
    return Evaluation(np.empty(n), substituted, joints, extrapolated, stand, configuration)


def _poses(position: FloatArray, abc: FloatArray, tool: float, rows: IntArray | slice) -> Poses:
    angles = abc[rows]
    return position[rows], rotation_matrices(angles) if angles.any() else None, tool


def corners(position: FloatArray, abc: FloatArray, lengths: FloatArray) -> BoolArray:
    """(n,) True where a move ends and the next starts in the next row: one pose, two tangents. All False if few."""
    corner = np.arange(len(position)) < len(position) - 1
    for values in (*position.T, *abc.T, np.nan_to_num(lengths, nan=-1.0)):
        corner[:-1] &= values[1:] == values[:-1]
        if np.count_nonzero(corner) <= FEW_CORNERS * len(corner):
            return np.zeros_like(corner)
    corner[1:] &= ~corner[:-1]  # of more than two equal rows, only the first two are a corner
    return corner


def _by_closed_form(
    model: StiffnessModel, load: Load, tangents: list[FloatArray], poses: Poses
) -> Iterator[tuple[Evaluation, BoolArray]]:
    """Struts on a rigid platform under loads directed by geometry, for each of the tangents (n, 3) at the poses.

    With each (n,) where the figures hold: not for other directions, at poses near singular ones, and where an angle
    near zero decides.
    """
    machine, (tip, rotation, tool) = as_hexapod(model.machine, "the closed form"), poses
    directed = [geometric_directions(load, tip, rotation, tangent) for tangent in tangents]
    position, towards = np.ascontiguousarray(tip.T), np.stack([direction.T for direction, _ in directed])
    turns = None if rotation is None else np.ascontiguousarray(rotation.reshape(-1, 9).T)
    kernel = closed_form.prepare(machine, tool)
    compliance, determinant, lengths, good = closed_form.compliance_along_columns(kernel, position, towards, turns)
    extremes = Extremes(machine, position, lengths, determinant, turns, tool)
    stand, certain = extremes.reach()
    extrapolated = machine.strut_law.room_of(extremes.shortest, extremes.longest) < 0.0
    for (_, known), along in zip(directed, compliance, strict=True):
        sure = certain & good & known & (along > 0.0) & (along < np.inf)
        along[~(stand.reachable & known)] = np.nan
        yield Evaluation(1.0 / along, np.zeros(len(tip), dtype=bool), lengths.T, extrapolated, stand), sure


def _by_solution(model: StiffnessModel, load: Load, tangent: FloatArray, poses: Poses, force: float) -> Evaluation:
    """Evaluation of any poses under any load."""
    tip, rotation, _ = poses
    lengths, extrapolated, stand, compliance = tip_compliances(model, poses, force)
    direction, substituted = load_directions(load, compliance, tip, rotation, tangent)
    stiffness = 1.0 / compliance_along(model, direction, compliance, poses, force)
    _refuse_no_number(model, tip, stand.reachable & ~((stiffness > 0.0) & (stiffness < np.inf)))
    return Evaluation(stiffness, substituted, lengths, extrapolated, stand)


def tip_compliances(
    model: StiffnessModel, poses: Poses, force: float
) -> tuple[FloatArray, BoolArray, Reach, FloatArray]:
    """Joints (n, j) m or rad, (n,) True if the strut law is extrapolated, reach, compliance (n, 3, 3) m/N.

    The compliance is nan out of reach, and leaves load-dependent effects out.
    """
    tip, rotation, _ = poses
    stance = solved(model.machine, *poses)
    stand = reach(model.machine, tip, stance, rotation)
    compliance = np.full((len(tip), 3, 3), np.nan)
    compliance[stand.reachable] = core.tip_compliance(model, *taken(poses, stand.reachable), force)
    _refuse_no_number(model, tip, stand.reachable & np.isnan(compliance[:, 0, 0]))
    extrapolated = np.zeros(len(tip), dtype=bool)
    if isinstance(model.machine, Hexapod):
        extrapolated |= (model.machine.strut_law.room(stance.joints) < 0.0).any(axis=1)
    return stance.joints, extrapolated, stand, compliance


def compliance_along(
    model: StiffnessModel, direction: FloatArray, compliance: FloatArray, poses: Poses, force: float
) -> FloatArray:
    """(n,) m/N along unit vectors (n, 3), load-dependent effects included; `compliance` as of `tip_compliances`."""
    if not model.load_dependent:
        return np.asarray(np.einsum("ni,nij,nj->n", direction, compliance, direction))
    along, within = np.full(len(direction), np.nan), ~np.isnan(compliance[:, 0, 0])
    along[within] = core.compliance_along(model, direction[within], *taken(poses, within), force)
    return along


def taken(poses: Poses, rows: BoolArray) -> Poses:
    """Some of the poses."""
    tip, rotation, tool = poses
    return tip[rows], None if rotation is None else rotation[rows], tool


def _refuse_no_number(model: StiffnessModel, tip: FloatArray, bad: BoolArray) -> None:
    """Raise `InputError` if poses within the limits (n,) have no stiffness."""
    if bad.any():
        x, y, z = (mm_from_m(float(v)) + 0.0 for v in tip[int(np.argmax(bad))])
        raise InputError(
            f"machine {model.machine.name} is singular at X{x:g} Y{y:g} Z{z:g} mm: the tip has no stiffness there",
            hint="keep such poses out of reach: min_index of [limits.singularity] in the machine file, such as 0.05",
        )


def joint_columns(machine: MachineTool, joints: FloatArray) -> dict[str, FloatArray]:
    """Column -> values of joints (n, j) m or rad in the shop's units: "strut1_mm", "joint_X_mm", "joint_5_deg"."""
    columns = {}
    for name, kind, values in zip(machine.joint_names, machine.joint_kinds, joints.T, strict=True):
        word = name.replace(" ", "_")
        word = word if word.startswith(("joint", "strut", "carriage")) else f"joint_{word}"
        linear = kind == "linear"
        columns[f"{word}_{'mm' if linear else 'deg'}"] = mm_from_m(values) if linear else deg_from_rad(values)
    return columns


def _by_elements(
    model: StiffnessModel,
    samples: tuple[FloatArray, FloatArray, FloatArray],
    tool_length: FloatArray | float,
    load: Load,
    force: float,
    progress: Progress | None,
) -> Evaluation:
    """Evaluation of a machine of elements at n samples (position, abc, tangent); those with a tangent are a path.

    Along a path the machine keeps one configuration, that with the largest smallest margin.
    """
    position, abc, tangent = samples
    machine, n = model.machine, len(position)
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (n,))
    follows = bool(tangent.any())
    kept = None
    if follows and n and len(machine.configurations) > 1:
        few = tried_rows(n)
        kept = int(kept_configurations(machine, position[few], rotation_matrices(abc[few]), lengths[few])[0])
    result, before = _to_fill(machine, n, machine.configurations[kept or 0] if follows else ""), None
    if follows and n:
        before = machine.solve(position[:1], rotation_matrices(abc[:1]), lengths[:1], kept).joints[0]
    for start in range(0, n, BLOCK):
        rows = np.arange(start, min(start + BLOCK, n))
        turn = rotation_matrices(abc[rows]) if abc[rows].any() else None
        stance = machine.solve(position[rows], turn, lengths[rows], kept, before)
        result.put(rows, evaluate_stance(model, stance, (position[rows], turn, tangent[rows]), load, force))
        if before is not None and np.isfinite(stance.joints[-1]).all():
            before = stance.joints[-1]
        if progress:
            progress(int(rows[-1]) + 1, n)
    return result


def tried_rows(count: int) -> IntArray:
    """Poses, of a path of `count`, at which all configurations are tried."""
    return np.unique(np.linspace(0, count - 1, MOST_TRIED).round().astype(np.int64))


def kept_configurations(
    machine: MachineTool, position: FloatArray, rotation: FloatArray | None, lengths: FloatArray, paths: int = 1
) -> IntArray:
    """(paths,) configuration with the largest smallest margin on each path; poses of paths one after the other.

    Poses that no configuration reaches do not count; one in which a joint has to turn back on the way comes after all
    that keep the limits.
    """
    limits, winds = machine.joint_limits, np.array(machine.joint_kinds) == "rotary"
    stances = list(machine.stances(position, rotation, lengths))
    margins = np.array([reach(machine, position, stance).margin.reshape(paths, -1) for stance in stances])
    counts: BoolArray = np.asarray((margins >= 0.0).any(axis=0))
    counts |= ~np.asarray(counts.any(axis=1, keepdims=True))
    least = np.where(counts, margins, np.inf).min(axis=2)
    for i, stance in enumerate(stances):
        joints = stance.joints.reshape(paths, -1, len(limits)).swapaxes(0, 1)
        number = np.where(counts.T, np.arange(len(joints))[:, None], counts.T.argmax(axis=0))
        there = np.take_along_axis(joints, np.maximum.accumulate(number)[:, :, None], axis=0)
        goes_on = room_to_wind(unwound(there, winds), limits, winds)
        least[i] -= np.where(goes_on, 0.0, np.maximum(least[i], 0.0) + TURNING_BACK)
    return np.asarray(np.argmax(least, axis=0))


def evaluate_stance(
    model: StiffnessModel, stance: Stance, in_work: WorkPoses, load: Load, force: float = defaults.FORCE
) -> Evaluation:
    """Evaluation of a machine of elements at a stance; tip, tool axes and tangent in work axes."""
    n, stand = len(stance), reach(model.machine, in_work[0], stance)
    stiffness, substituted = np.full(n, np.nan), np.zeros(n, dtype=bool)
    if len(rows := np.flatnonzero(stand.reachable)):
        part, some = (stance, in_work) if len(rows) == n else (stance.take(rows), poses_taken(in_work, rows))
        stiffness[rows], substituted[rows] = stiffness_within(model, part, some, load, force)
    return Evaluation(stiffness, substituted, stance.joints, np.zeros(n, dtype=bool), stand)


def poses_taken(in_work: WorkPoses, rows: IntArray) -> WorkPoses:
    """Poses of some rows."""
    position, rotation, tangent = in_work
    return position[rows], None if rotation is None else rotation[rows], tangent[rows]


def stiffness_within(
    model: StiffnessModel, stance: Stance, in_work: WorkPoses, load: Load, force: float
) -> tuple[FloatArray, BoolArray]:
    """(n,) N/m along the load at poses within reach, and (n,) True where the softest direction stands in."""
    position, _, tangent = in_work
    n = len(stance)
    along, substituted = np.empty(n), np.zeros(n, dtype=bool)
    direction, known = geometric_directions(load, *in_work)
    if stance.work_axes is not None and load.kind in OF_THE_WORK:
        direction = np.einsum("nij,nj->ni", stance.work_axes, direction)
    for rows in (np.flatnonzero(known), np.flatnonzero(~known)):
        if not len(rows):
            continue
        part = stance if len(rows) == n else stance.take(rows)
        path, towards = path_of_stance(model, part, force=force, **model.conditions.columns(len(rows))), direction[rows]
        if not known[rows[0]]:  # the load's direction depends on the compliance
            compliance = element_sum.tip_compliance(model, path)
            some = (part.position, part.rotation, tangent[rows])
            towards, substituted[rows] = load_directions(load, compliance, *some)
        along[rows] = element_sum.compliance_along(model, path, towards)
    stiffness = 1.0 / along
    _refuse_no_number(model, position, ~((stiffness > 0.0) & (stiffness < np.inf)))
    return stiffness, substituted
