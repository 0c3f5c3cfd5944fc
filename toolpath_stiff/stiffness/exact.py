"""The exact route: strut forces from equilibrium, compliance from energy, effects along the load path.

Six pin-jointed struts carry a wrench w at the tip in one way only: J^T f = w with the rows [u_i, r_i x u_i] of J.
Castigliano's second theorem then gives the tip's displacement from the stored energy, half of [f; w]^T Q [f; w],
where Q holds the struts' compliances on its diagonal and whatever the effects add.

With a stiffness K parallel to the struts the load divides, J^T f + K x = w, and minimal complementary energy gives

    Q_ff f + Q_fw w = J x,      (J^T Q_ff^-1 J + K) x = (1 + J^T Q_ff^-1 Q_fw) w,      y = x + Q_wf f + Q_ww w,

with x the motion of the platform and y that of the tip. Both are exact, no iteration, no assembly.

Under a load of given size joints that resist turning take a part of the load, and how large that part
is depends on how far each strut gives, which for gaps and contacts depends on its force. With e_i(F_i) = s_i(F_i) F_i
the stretch of strut i, s_i the secant compliance that the effects state, the forces minimise the complementary energy
(Crotti-Engesser: the sum of int e_i dF_i, plus that of the parallel stiffness), whose gradient is the incompatibility

    g(F) = e(F) + Q_ff F + Q_fw w - J x,      K x = w - J^T F.

It is convex, because a strut gives more under more force, and its gradient has kinks (a strut at the edge of its gap).
Whole steps of Newton's method settle most poses; where they cycle between the kinks, parts of them settle the others.
"""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import EffectError, InputError
from toolpath_stiff.stiffness.contract import Effect, LoadPath
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.stiffness.possible import at_pose, possible, refuse_struts_without_stiffness
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m

SHARES = (1.0, 0.5, 0.25, 0.1, 1.0)  # of a step: where whole ones cycle between the kinks, parts of them do not
WHOLE_STEPS, PART_STEPS = 25, 200


LEAST_STIFFNESS = 1e-6  # N/m; what a strut law gives below is no stiffness, and its inverse may be no number


SETTLED = 1e-8  # of the load: the tip's compliance is then certain to some 1e-8 of itself


DIFFERENCE = 1e-9  # of the load, for the tangent: well below what settles, or the edge of a gap would be straddled


LEAST_TANGENT = 1e-3  # of the secant: a strut whose stretch does not grow with its force would be infinitely stiff


def _newton_steps(
    model: StiffnessModel, path: LoadPath, parallel: FloatArray, wrench: FloatArray, rows: IntArray, share: float
) -> IntArray:
    """Newton's method for the strut forces of some poses, in place, by a share of each step; the rows left unsettled.

    With e_i = t_i F_i + o_i, t the tangent and o_i = (s_i - t_i) F_i from the last forces, the system is linear. Where
    its forces stay e_i = s_i F_i holds, whatever the tangent was.
    """
    forces, load = path.strut_forces, path.force
    assert forces is not None
    for _ in range(WHOLE_STEPS if share == 1.0 else PART_STEPS):
        if not len(rows):
            break
        before, jacobian, part = forces[rows], path.struts.jacobian[rows], path.take(rows)
        transposed = np.swapaxes(jacobian, 1, 2)
        here, form = _secant(model, part, before)
        beyond = before + np.where(before < 0.0, -DIFFERENCE, DIFFERENCE) * load[rows, None]
        slope = (_secant(model, part, beyond)[0] * beyond - here * before) / (beyond - before)
        tangent = np.maximum(slope, LEAST_TANGENT * here)
        longer = _times(form[..., 6:], wrench[rows]) + (here - tangent) * before
        struts = tangent[..., None] * np.eye(6) + form[..., :6]
        stiffened = np.linalg.solve(struts, np.concatenate([jacobian, longer[..., None]], axis=-1))
        system = transposed @ stiffened[..., :6] + parallel[rows]
        right = wrench[rows] + _times(transposed, stiffened[..., 6])
        motion = np.asarray(np.linalg.solve(system, right[..., None])[..., 0])
        settled = _times(stiffened[..., :6], motion) - stiffened[..., 6]
        moved = np.abs(settled - before).max(axis=1) / load[rows]
        # Between tension and compression of a strut lies its gap, where it is idle.
        crossing = (settled * before < 0.0) & (moved > SETTLED)[:, None]
        forces[rows] = before + share * (np.where(crossing, 0.0, settled) - before)
        rows = rows[moved > SETTLED]
    return rows


def _secant(model: StiffnessModel, path: LoadPath, forces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n, 6) m/N of the struts under forces in them, and (n, 6, 12) what couples these and the wrench, [Q_ff, Q_fw]."""
    links = assemble_links(model, replace(path, strut_forces=forces))
    return links.strut, np.zeros((len(path), 6, 12)) if links.loads is None else links.loads[:, :6]


def _times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nij,nj->ni", matrix, vector))


@dataclass(frozen=True)
class AssembledLinks:
    """What the load path is made of at n poses.

    Attributes
    ----------
    strut
        (n, 6) m/N, compliance of each strut.
    loads
        (n, 12, 12) quadratic form in the strut forces and the tip wrench, or None.
    parallel
        (n, 6, 6) stiffness parallel to the struts, or None.
    """

    strut: FloatArray
    loads: FloatArray | None
    parallel: FloatArray | None


def assemble_links(model: StiffnessModel, path: LoadPath) -> AssembledLinks:
    """Add up what the strut law and the effects contribute at n poses.

    Raises
    ------
    InputError
        The strut law was extrapolated to no stiffness or less, or the effects take more from a strut than it has.
    """
    with np.errstate(invalid="ignore"):  # a law of absurd slope; refused with what it gives
        stiffness = path.machine.strut_law.stiffness(path.struts.lengths)
    refuse_law_beyond_zero(path, stiffness)
    strut = 1.0 / stiffness
    loads: FloatArray | None = None
    parallel: FloatArray | None = None
    for active in model.effects:
        if active.effect.load_dependent and path.strut_forces is None:
            continue
        series = active.adds("strut_compliance", path)
        form = active.adds("load_compliance", path)
        beside = active.adds("parallel_stiffness", path)
        strut = strut if series is None else strut + series
        loads = form if loads is None else loads if form is None else loads + form
        parallel = beside if parallel is None else parallel if beside is None else parallel + beside
    refuse_struts_without_stiffness(_acting(model), path, strut)
    return AssembledLinks(strut, loads, parallel)


def refuse_law_beyond_zero(path: LoadPath, stiffness: FloatArray) -> None:
    """Raise `InputError` where the strut law gives (n, 6) struts no stiffness or less, or no number."""
    holds = (stiffness >= LEAST_STIFFNESS) & (stiffness < np.inf)
    lengths = path.struts.lengths
    holds |= np.isnan(lengths)  # a pose that is no number, which stays nan
    if holds.all():
        return
    worst = np.unravel_index(np.argmin(np.where(holds, np.inf, stiffness)), stiffness.shape)
    raise InputError(
        f"strut {worst[1] + 1} would be {mm_from_m(float(lengths[worst])):.1f} mm long, where the machine's strut law "
        f"gives {n_per_um_from_n_per_m(float(stiffness[worst])):.4g} N/um{at_pose(path, int(worst[0]))}",
        expected="a finite stiffness above 0",
        hint="bound the strut length in the machine file so that the law stays positive",
    )


def respond(path: LoadPath, links: AssembledLinks, wrenches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tip twists and strut forces under wrenches at the tip.

    Parameters
    ----------
    path, links
        n poses and what they are made of.
    wrenches
        (n, 6, m) N and N m about the tip, base axes.

    Returns
    -------
    twists, forces
        (n, 6, m) m and rad; (n, 6, m) N. nan where a pivot is exactly 0; near a singular pose they are just huge
        (`machine.limits` refuses such poses).
    """
    jacobian = path.struts.jacobian
    transposed = np.swapaxes(jacobian, 1, 2)
    if links.parallel is None:
        forces = _solve(transposed, wrenches)
        stretch = links.strut[..., None] * forces
        if links.loads is None:
            return _solve(jacobian, stretch), forces
        form = links.loads
        stretch = stretch + form[:, :6, :6] @ forces + form[:, :6, 6:] @ wrenches
        twists = _solve(jacobian, stretch)
        return twists + form[:, 6:, :6] @ forces + form[:, 6:, 6:] @ wrenches, forces
    form = np.zeros((len(path), 12, 12)) if links.loads is None else links.loads
    struts = form[:, :6, :6] + links.strut[..., None] * np.eye(6)
    stiffened = _solve(struts, np.concatenate([jacobian, form[:, :6, 6:] @ wrenches], axis=-1))
    system = transposed @ stiffened[..., :6] + links.parallel
    motion = _solve(system, wrenches + transposed @ stiffened[..., 6:])
    forces = stiffened[..., :6] @ motion - stiffened[..., 6:]
    return motion + form[:, 6:, :6] @ forces + form[:, 6:, 6:] @ wrenches, forces


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve per pose with pivoting; nan where a matrix is singular instead of giving up on all of them."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        solution = np.full(np.broadcast_shapes(matrix.shape[:-2], right.shape[:-2]) + right.shape[-2:], np.nan)
        for i, (left, side) in enumerate(zip(matrix, right, strict=True)):
            # The same test as for a batch without singular poses: a pose's result does not hang on its neighbours.
            with suppress(np.linalg.LinAlgError):
                solution[i] = np.linalg.solve(left, side)
        return solution


def wrench_compliance(model: StiffnessModel, path: LoadPath) -> FloatArray:
    """(n, 6, 6) compliance of the tip for forces and moments; load-dependent effects are not in it."""
    wrenches = np.broadcast_to(np.eye(6), (len(path), 6, 6))
    twists, _ = respond(path, assemble_links(model, path), wrenches)
    return possible(_acting(model), path, twists)


def tip_compliance(model: StiffnessModel, path: LoadPath) -> FloatArray:
    """(n, 3, 3) m/N, displacements of the tip under forces at it; load-dependent effects are not in it."""
    twists, _ = respond(path, assemble_links(model, path), _unit_forces(len(path)))
    return possible(_acting(model), path, twists[:, :3])


def strut_forces(model: StiffnessModel, path: LoadPath) -> FloatArray:
    """(n, 6, 3) N per N, forces in the struts under forces at the tip; load-dependent effects are not in it."""
    return respond(path, assemble_links(model, path), _unit_forces(len(path)))[1]


def _unit_forces(n: int) -> FloatArray:
    wrenches = np.zeros((n, 6, 3))
    wrenches[:, :3] = np.eye(3)
    return wrenches


def _acting(model: StiffnessModel) -> list[Effect]:
    return [active.effect for active in model.effects]


def under_load(
    model: StiffnessModel, path: LoadPath, direction: FloatArray
) -> tuple[LoadPath, AssembledLinks, FloatArray, FloatArray]:
    """The machine under a load of `path.force` along unit vectors (n, 3), load-dependent effects included.

    Those see the strut forces of the loaded machine: the ones of equilibrium or, where a stiffness parallel to the
    struts shares the load, the ones that agree with the compliances that they cause (`_settled`).

    Returns
    -------
    path, links, twists, forces
        With the strut forces of the loaded machine where effects depend on them; what it is made of; (n, 6) m and rad
        of the tip, (n, 6) forces in the struts, both per newton of load.

    Raises
    ------
    InputError
        The strut forces do not settle.
    """
    wrenches = np.zeros((len(path), 6, 1))
    wrenches[:, :3, 0] = direction
    links = assemble_links(model, path)
    twists, forces = respond(path, links, wrenches)
    if model.load_dependent:
        path = replace(path, strut_forces=forces[..., 0] * path.force[:, None])
        if links.parallel is not None:
            path = _settled(model, path, links.parallel, wrenches[..., 0])
        links = assemble_links(model, path)
        twists, forces = respond(path, links, wrenches)
    return path, links, twists[..., 0], forces[..., 0]


def compliance_along(
    model: StiffnessModel, path: LoadPath, direction: FloatArray, equilibrium: FloatArray | None = None
) -> FloatArray:
    """(n,) m/N, displacement along unit vectors (n, 3) per force along them; see `under_load`.

    `equilibrium`: (n, 6) N, strut forces in equilibrium with the unit vectors, where they are known: unless a stiffness
    parallel to the struts shares the load, the energy that they store is the answer (Castigliano), and nothing is
    solved.
    """
    along = None if equilibrium is None else _stored_along(model, path, direction, equilibrium)
    if along is None:
        along = np.einsum("ni,ni->n", under_load(model, path, direction)[2][:, :3], direction)
    return possible(_acting(model), path, np.asarray(along)[:, None, None])[:, 0, 0]


def _stored_along(
    model: StiffnessModel, path: LoadPath, direction: FloatArray, forces: FloatArray
) -> FloatArray | None:
    """(n,) [f; w]^T Q [f; w], twice the energy stored under unit forces; None where the struts share the load."""
    if model.load_dependent:
        path = replace(path, strut_forces=forces * path.force[:, None])
    links = assemble_links(model, path)
    if links.parallel is not None:
        return None
    stored = np.einsum("ni,ni->n", links.strut, forces**2)
    if links.loads is not None:
        both = np.concatenate([forces, direction], axis=1)  # no moment
        stored += np.einsum("ni,nij,nj->n", both, links.loads[:, :9, :9], both)
    return np.asarray(stored)


def _settled(model: StiffnessModel, loaded: LoadPath, parallel: FloatArray, wrenches: FloatArray) -> LoadPath:
    """The path with strut forces that agree with the compliances that they cause."""
    assert loaded.strut_forces is not None
    forces = loaded.strut_forces
    regular = np.flatnonzero(np.isfinite(forces).all(axis=1))  # nan: a singular pose, which stays nan
    part = loaded.take(regular)
    rows, wrench = np.arange(len(part)), wrenches[regular] * part.force[:, None]
    for share in SHARES:
        rows = _newton_steps(model, part, parallel[regular], wrench, rows, share)
    if len(rows):
        names = ", ".join(effect.name for effect in _acting(model) if effect.load_dependent)
        raise EffectError(
            f"the strut forces do not settle{at_pose(part, rows[0])} under {part.force[rows[0]]:g} N with {names}",
            expected="a stretch of each strut that grows with its force",
        )
    forces[regular] = part.strut_forces
    return loaded
