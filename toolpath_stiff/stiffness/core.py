"""Which route computes the tip compliance: the exact LAPACK route, the closed form, or the compiled loops.

For struts on a rigid platform all three give the same to rounding; the choice is made by the number of poses.
Physical effects take the exact route. Poses at which the closed form is ill-conditioned go to the exact route, which
pivots, by themselves.

The softest and the stiffest direction of the tip are eigenvectors of the compliance tensor, unless the compliance
depends on the load. With gaps and contacts there is no tensor: the compliance along a direction is the secant one
under the load in that direction, and its extremes are searched on the half sphere. Gaps give it kinks, where
derivatives say nothing, so the search compares values alone. Where a strut's force changes its sign its gap costs
least: the stiffest direction tends to lie in such a plane, or where two of them meet, and that valley is too narrow for
steps in any direction. So the stiffest one is looked for in the planes as well, by steps that stay in them. The softest
one never lies there: the planes part its basins, and climbs begin in different ones.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness import closed_form, compiled, exact
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.model import StiffnessModel, acting_effects, load_path
from toolpath_stiff.stiffness.possible import is_compliance

BLOCK = 8192  # poses at a time on the exact route: bounds memory, keeps LAPACK's call overhead small
CLOSED_FORM_FROM = 150  # poses; below, the closed form's fixed cost of some 0.2 ms a call is not earned back
# Poses; numba takes about 0.5 s to import and load from its cache, which the closed form spends on 1.5 million.
COMPILED_FROM = 1_500_000
ROUTES = ("exact", "closed_form", "compiled")

Tools = FloatArray | float  # m, length of the tool: of all poses, or (n,)
Along = Callable[[FloatArray, IntArray], FloatArray]

DIRECTIONS = 60  # over half a sphere: neighbours some 15 degrees apart
CLIMBS = 6  # from so many of the best; kinks make more basins
FIRST_STEP, LAST_STEP = 0.13, 1e-4  # rad; half the distance of neighbours; the compliance is then certain to 1e-6
AROUND = 6  # directions tried about the best one at each step
IN_PLANE = 12  # over half a circle of the directions in which one strut is idle


def is_closed_form(model: StiffnessModel) -> bool:
    """Whether struts on a rigid platform are all that acts, so that the closed form holds."""
    acting = replace(model, effects=acting_effects(model))
    return acting.is_plain and all(np.isinf(active.values["bar_stiffness"]) for active in acting.effects)


def choose_route(model: StiffnessModel, poses: int) -> str:
    """One of `ROUTES` for so many poses."""
    if poses < CLOSED_FORM_FROM or not is_closed_form(model):
        return "exact"
    straight = not model.machine.strut_law.shape  # the compiled loops know no other law
    return "compiled" if poses >= COMPILED_FROM and straight and compiled.available() else "closed_form"


def tip_compliance(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: Tools = np.nan,
    force: float = defaults.FORCE,
    route: str | None = None,
) -> FloatArray:
    """Compliance of the tool tip at n poses, load-dependent effects left out.

    Parameters
    ----------
    model
        Machine and effects.
    position
        (n, 3) m.
    rotation
        (n, 3, 3); None: vertical spindle.
    tool_length
        m, scalar or (n,); nan: the reference tool.
    force
        N, the size of the load.
    route
        One of `ROUTES`, of which all but "exact" are the closed form; chosen by the number of poses unless given.

    Returns
    -------
    (n, 3, 3) m/N; nan where the machine is singular.
    """
    compliance, doubtful = np.empty((len(position), 3, 3)), np.ones(len(position), dtype=bool)
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(position),))
    if (route or choose_route(model, len(position))) != "exact":
        for length, rows in rows_of_tools(lengths):
            turn, kernel = None if rotation is None else rotation[rows], closed_form.prepare(model.machine, length)
            compliance[rows], good = closed_form.tip_compliance(kernel, position[rows], turn)
            doubtful[rows] = ~(good & is_compliance(compliance[rows]))  # the exact route says what is wrong
    if doubtful.any():
        rows = slice(None) if doubtful.all() else doubtful
        turn = None if rotation is None else rotation[rows]
        blocks = _paths(model, position[rows], turn, lengths[rows], force)
        compliance[rows] = np.concatenate([exact.tip_compliance(model, path) for _, path in blocks])
    return compliance


def rows_of_tools(tool_length: FloatArray) -> list[tuple[float, IntArray | slice]]:
    """Each tool length, nan counts as one, and the rows that have it."""
    if len(tool_length) and (np.isnan(tool_length).all() or np.ptp(tool_length) == 0.0):
        return [(float(tool_length[0]), slice(None))]
    lengths, number = np.unique(tool_length, return_inverse=True)
    return [(float(length), np.flatnonzero(number == i)) for i, length in enumerate(lengths)]


def compliance_along_columns(
    machine: Hexapod,
    position: FloatArray,
    direction: FloatArray,
    rotation: FloatArray | None,
    tool_length: float,
    route: str,
) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
    """Compliance of struts on a rigid platform along one direction a pose, with what the limits ask for.

    Arguments and results as of `closed_form.compliance_along_columns`, of a machine with a tool of that length (m), by
    one of the fast routes. Where a pose is not good the exact route must be asked.
    """
    kernel = closed_form.prepare(machine, tool_length)
    if route == "compiled":
        return compiled.compliance_along_columns(kernel, position, direction, rotation)
    return closed_form.compliance_along_columns(kernel, position, direction, rotation)


def compliance_with_effects(
    model: StiffnessModel,
    position: FloatArray,
    direction: FloatArray,
    rotation: FloatArray | None,
    tool_length: float,
    force: float,
) -> FloatArray:
    """Compliance along one direction a pose of one tool, effects included, without a pivoted solve.

    The struts are statically determinate: their forces are the closed form's, whatever gives way. Where the control
    knows the geometry less well, the closed form also says where the platform goes.

    Returns
    -------
    (n,) m/N; nan where the exact route must be asked. Columns as of `compliance_along_columns`.
    """
    n = position.shape[1]
    compliance, sure = np.full(n, np.nan), np.ones(n, dtype=bool)
    kernel = closed_form.prepare(model.machine, tool_length)
    if model.control is not None:
        control = closed_form.prepare(model.control, tool_length, split_of=model.machine)
        position, rotation, sure = closed_form.followed_columns(kernel, control, position, rotation)
        model = replace(model, control=None)
    turns = None if rotation is None else rotation.T.reshape(-1, 3, 3)
    for rows, path in _paths(model, position.T, turns, np.full(n, tool_length), force):
        turn = None if rotation is None else rotation[:, rows]
        forces, good = closed_form.strut_forces_columns(kernel, position[:, rows], direction[:, rows], turn)
        some = np.flatnonzero(good & sure[rows])
        known = path if len(some) == len(good) else path.take(some)
        compliance[rows.start + some] = exact.compliance_along(model, known, direction[:, rows].T[some], forces[some])
    return compliance


def _paths(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None,
    tool_length: Tools,
    force: float,
    at_a_time: int = BLOCK,
) -> Iterator[tuple[slice, LoadPath]]:
    """Rows of some poses of a program, and what the effects see there, the model's conditions included."""
    lengths = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(position),))
    for start in range(0, len(position), at_a_time):
        rows = slice(start, start + at_a_time)
        some, turn = position[rows], None if rotation is None else rotation[rows]
        yield rows, load_path(model, some, turn, lengths[rows], force, **model.conditions.columns(len(some)))


def compliance_along(
    model: StiffnessModel,
    direction: FloatArray,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: Tools = np.nan,
    force: float = defaults.FORCE,
) -> FloatArray:
    """Compliance of the tip along unit vectors (n, 3), load-dependent effects included: (n,) m/N."""
    result = np.empty(len(position))
    for rows, path in _paths(model, position, rotation, tool_length, force):
        result[rows] = exact.compliance_along(model, path, direction[rows])
    return result


def extreme_directions(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: Tools = np.nan,
    force: float = defaults.FORCE,
    softest: bool = True,
) -> FloatArray:
    """Directions (n, 3) in which the tip gives way most, or least, load-dependent effects included.

    Some 300 times the work of one direction: without load-dependent effects the eigenvectors of the compliance say the
    same.
    """
    result = np.empty((len(position), 3))
    for rows, path in _paths(model, position, rotation, tool_length, force, max(1, BLOCK // DIRECTIONS)):

        def along(directions: FloatArray, poses: IntArray, path: LoadPath = path) -> FloatArray:
            return exact.compliance_along(model, path.take(poses), directions)

        tensor, forces = exact.tip_compliance(model, path), exact.strut_forces(model, path)
        result[rows] = searched_directions(along, tensor, forces, softest)
    return result


def half_sphere(count: int) -> FloatArray:
    """(count, 3) unit vectors spread evenly over z >= 0: a spiral that turns by the golden angle."""
    height = (np.arange(count) + 0.5) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def searched_directions(along: Along, tensor: FloatArray, forces: FloatArray, softest: bool = True) -> FloatArray:
    """Directions in which the tip gives way most, or least.

    Parameters
    ----------
    along
        Unit vectors (k, 3) and the poses (k,) at which they are meant, to compliances (k,) m/N.
    tensor
        (n, 3, 3) m/N, the compliance without what depends on the load; its eigenvectors are tried as well.
    forces
        (n, 6, 3) N per N in the struts under loads along the axes: across its row a strut is idle. Kinks in these
        planes may hold the stiffest direction, and part the basins of the softest.
    softest
        The softest, else the stiffest direction.

    Returns
    -------
    (n, 3) unit vectors whose largest component is positive.
    """
    n, sign = len(tensor), 1.0 if softest else -1.0
    idle = None if softest else forces / np.linalg.norm(forces, axis=-1, keepdims=True)

    def value(directions: FloatArray) -> FloatArray:
        """(n, m) of directions (n, m, 3), to be made large."""
        rows = np.repeat(np.arange(n), directions.shape[1])
        return sign * along(directions.reshape(-1, 3), rows).reshape(n, -1)

    spread = np.broadcast_to(half_sphere(DIRECTIONS), (n, DIRECTIONS, 3))
    tried = np.concatenate([spread, np.swapaxes(np.linalg.eigh(tensor)[1], 1, 2)], axis=1)
    if idle is not None:
        tried = np.concatenate([tried, _in_planes(idle)], axis=1)
    values_of_tried = value(tried)
    best = np.argsort(-values_of_tried, axis=1, kind="stable")
    best = (_best_of_each_cell(best, tried, forces) if softest else best)[:, :CLIMBS]
    directions = np.take_along_axis(tried, best[..., None], axis=1)
    reached = np.take_along_axis(values_of_tried, best, axis=1)
    step = np.full(reached.shape, FIRST_STEP)
    while (step > LAST_STEP).any():
        around = _around(directions, step)
        around = around if idle is None else np.concatenate([around, _turned_about(directions, idle, step)], axis=2)
        values = value(around.reshape(n, -1, 3)).reshape(n, CLIMBS, -1)
        better = values.argmax(axis=-1)
        top = np.take_along_axis(values, better[..., None], axis=-1)[..., 0]
        risen = top > reached
        chosen = np.take_along_axis(around, better[..., None, None], axis=2)[..., 0, :]
        directions = np.where(risen[..., None], chosen, directions)
        reached = np.where(risen, top, reached)
        step = np.where(risen, step, 0.5 * step)
    last = reached.argmax(axis=1)
    return signed(directions[np.arange(n), last])


def _best_of_each_cell(best: IntArray, tried: FloatArray, forces: FloatArray) -> IntArray:
    """(n, m) directions, best first: of each set in which the same struts pull and push the best, then the others."""
    pulls = np.einsum("nij,nmj->nmi", forces, tried) > 0.0
    cell = (pulls ^ pulls[..., :1]) @ (1 << np.arange(6))  # a direction and its opposite are one
    ranked = np.take_along_axis(cell, best, axis=1)
    again = np.tril(ranked[:, :, None] == ranked[:, None, :], -1).any(axis=2)
    return np.take_along_axis(best, np.argsort(again, axis=1, kind="stable"), axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _beside(directions: FloatArray) -> FloatArray:
    """(..., 3) a unit vector across each direction."""
    return _unit(np.cross(directions, np.eye(3)[np.abs(directions).argmin(axis=-1)]))


def _around(directions: FloatArray, step: FloatArray) -> FloatArray:
    """(n, c, AROUND, 3) unit vectors at an angle of `step` (n, c) about each direction (n, c, 3)."""
    first = _beside(directions)
    second = np.cross(directions, first)
    angle = 2.0 * np.pi * np.arange(AROUND)[:, None] / AROUND
    side = first[..., None, :] * np.cos(angle) + second[..., None, :] * np.sin(angle)
    return _unit(directions[..., None, :] * np.cos(step)[..., None, None] + side * np.sin(step)[..., None, None])


def _in_planes(normal: FloatArray) -> FloatArray:
    """(n, m, 3) unit vectors spread over the planes across unit vectors (n, 6, 3), and where two planes meet."""
    first_strut, second_strut = np.triu_indices(6, 1)
    meeting = np.cross(normal[:, first_strut], normal[:, second_strut])
    length = np.linalg.norm(meeting, axis=-1, keepdims=True)
    meeting = np.where(length > 1e-6, meeting / np.maximum(length, 1e-6), normal[:, first_strut])
    first = _beside(normal)
    angle = np.pi * np.arange(IN_PLANE)[:, None] / IN_PLANE
    circle = first[..., None, :] * np.cos(angle) + np.cross(normal, first)[..., None, :] * np.sin(angle)
    return np.concatenate([meeting, circle.reshape(len(normal), -1, 3)], axis=1)


def _turned_about(directions: FloatArray, axis: FloatArray, step: FloatArray) -> FloatArray:
    """(n, c, 12, 3) directions (n, c, 3) turned to and fro about each axis (n, 6, 3) by `step` (n, c)."""
    axis = np.concatenate([axis, -axis], axis=1)[:, None]
    before, angle = directions[..., None, :], step[..., None, None]
    along = (axis * before).sum(axis=-1, keepdims=True) * axis
    return _unit(along + (before - along) * np.cos(angle) + np.cross(axis, before) * np.sin(angle))


def signed(directions: FloatArray) -> FloatArray:
    """(n, 3) the same lines with their largest component positive."""
    largest = directions[np.arange(len(directions)), np.abs(directions).argmax(axis=1)]
    return np.asarray(directions * np.where(largest < 0.0, -1.0, 1.0)[:, None])
