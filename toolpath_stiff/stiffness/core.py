"""Choice of the route to the tip compliance: the exact LAPACK route or the closed form.

For struts on a rigid platform both give the same to rounding. Physical effects take the exact route, and so do whole
tensors and few poses. Poses at which the closed form is ill-conditioned are marked by it, and the caller asks the exact
route, which pivots.
"""

from collections.abc import Iterator
from types import ModuleType

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray, product
from toolpath_stiff.machine.model import Hexapod, MachineTool, as_hexapod
from toolpath_stiff.stiffness import closed_form, element_sum, exact
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.effects.platform_flexibility import PlatformFlexibility
from toolpath_stiff.stiffness.element_sum import stance_of
from toolpath_stiff.stiffness.model import StiffnessModel, acting_effects, load_path

BLOCK = 8192  # poses at a time on the exact route: bounds memory, keeps LAPACK's call overhead small
CLOSED_FORM_FROM = 150  # poses; below, the closed form's fixed cost of some 0.2 ms a call is not earned back
LEAST_LOAD = 1.0  # N

Tools = FloatArray | float  # m, length of the tool; N, size of the load: of all poses, or (n,)


def solver_of(machine: MachineTool) -> ModuleType:
    """Module that computes the compliance of a kind of machine."""
    return exact if isinstance(machine, Hexapod) else element_sum


def is_closed_form(model: StiffnessModel) -> bool:
    """True if only struts on a rigid platform act, so that the closed form is valid."""
    return isinstance(model.machine, Hexapod) and all(
        type(active.effect) is PlatformFlexibility and np.isinf(active.values["bar_stiffness"])
        for active in acting_effects(model)
    )


def tip_compliance(
    model: StiffnessModel,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: Tools = np.nan,
    force: float = defaults.FORCE,
    load: FloatArray | None = None,
    in_work: bool = False,
) -> FloatArray:
    """Compliance of the tool tip at n poses; load-dependent effects as under the load, left out without one.

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
    load
        (n, 3) N, the force on the tip that acts; less than `LEAST_LOAD` counts as that.
    in_work
        Along the axes of the work, which a machine may turn, not of its base.

    Returns
    -------
    (n, 3, 3) m/N; nan where the machine is singular.
    """
    compliance, size, towards = np.empty((len(position), 3, 3)), np.full(len(position), force), None
    if load is not None:
        size = np.maximum(np.linalg.norm(load, axis=1), LEAST_LOAD)
        towards = np.where((load == 0.0).all(axis=1)[:, None], (0.0, 0.0, 1.0), load)
        towards = towards / np.linalg.norm(towards, axis=1)[:, None]
    for rows, path in load_paths(model, position, rotation, tool_length, size):
        if not isinstance(model.machine, Hexapod):
            axes, compliance[rows] = stance_of(path).work_axes, element_sum.tip_compliance(model, path)
            if in_work and axes is not None:
                compliance[rows] = product(product(np.swapaxes(axes, 1, 2), compliance[rows]), axes)
            continue
        compliance[rows] = exact.tip_compliance(model, path, None if towards is None else towards[rows])
    return compliance


def compliance_along(
    model: StiffnessModel,
    direction: FloatArray,
    position: FloatArray,
    rotation: FloatArray | None = None,
    tool_length: Tools = np.nan,
    force: float = defaults.FORCE,
) -> FloatArray:
    """Compliance of the tip along unit vectors (n, 3), load-dependent effects included: (n,) m/N."""
    compliance = np.empty(len(position))
    for rows, path in load_paths(model, position, rotation, tool_length, force):
        compliance[rows] = solver_of(model.machine).compliance_along(model, path, direction[rows])
    return compliance


def rows_of_tools(tool_length: FloatArray) -> list[tuple[float, IntArray | slice]]:
    """Each tool length (nan counts as one) and the rows that have it."""
    if len(tool_length) and (np.isnan(tool_length).all() or np.ptp(tool_length) == 0.0):
        return [(float(tool_length[0]), slice(None))]
    lengths, number = np.unique(tool_length, return_inverse=True)
    return [(float(length), np.flatnonzero(number == i)) for i, length in enumerate(lengths)]


def compliance_with_effects(
    model: StiffnessModel,
    position: FloatArray,
    direction: FloatArray,
    rotation: FloatArray | None,
    tool_length: float,
    force: float,
) -> FloatArray:
    """Compliance along one direction a pose of one tool, effects included, without a pivoted solve.

    The struts are statically determinate: their forces are the closed form's, whatever gives way.

    Returns
    -------
    (n,) m/N; nan where the exact route must be asked. Columns as of `closed_form.compliance_along_columns`.
    """
    compliance = np.full(position.shape[1], np.nan)
    kernel = closed_form.prepare(as_hexapod(model.machine, "the closed form"), tool_length)
    turns = None if rotation is None else rotation.T.reshape(-1, 3, 3)
    upright = rotation is None and model.control is None  # else the platform may stand elsewhere
    for rows, path in load_paths(model, position.T, turns, tool_length, force):
        turn = None if upright else path.rotation.reshape(-1, 9).T
        forces, along = np.empty((len(path), 6)), direction[:, rows]
        good = closed_form.compliance_along_columns(kernel, path.position.T, along, turn, forces)[3]
        some = path if good.all() else path.take(good)  # copies, which take as long as the effects
        compliance[rows][good] = exact.compliance_along(model, some, along.T[good], forces[good])
    return compliance


def load_paths(
    model: StiffnessModel, position: FloatArray, rotation: FloatArray | None, tool_length: Tools, force: Tools
) -> Iterator[tuple[slice, LoadPath]]:
    """Rows of some poses of a program, and the load path that the effects see there, with the model's conditions."""
    lengths, size = (np.broadcast_to(np.asarray(of, dtype=float), (len(position),)) for of in (tool_length, force))
    for start in range(0, len(position), BLOCK):
        rows = slice(start, start + BLOCK)
        some, turn = position[rows], None if rotation is None else rotation[rows]
        yield rows, load_path(model, some, turn, lengths[rows], size[rows], **model.conditions.columns(len(some)))
