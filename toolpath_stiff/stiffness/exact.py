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

Every result is held to what a compliance can be: finite, symmetric, positive definite.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import EffectError, InputError
from toolpath_stiff.hints import command_line
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.stiffness.contract import LoadPath, at_pose
from toolpath_stiff.stiffness.effect_source import file_of, is_foreign
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import mm_from_m, n_per_um_from_n_per_m

APART = 1e-6  # of the tip's compliance: largest asymmetry allowed
# Condition of the struts' screws, arms in units of their size, beyond which a pose with an impossible compliance counts
# as singular: rounding may have left only its largest eigenvalue right.
NEARLY_SINGULAR = 1e7
LEAST_STIFFNESS = 1e-6  # N/m; a strut law's value below it is no stiffness, and its inverse may overflow
SHARES = (1.0, 0.5, 0.25, 0.1, 1.0)  # shares of a step: where whole steps cycle between kinks, partial ones do not
WHOLE_STEPS, PART_STEPS = 25, 200
SETTLED = 1e-8  # of the load: the tip's compliance is then accurate to some 1e-8
DIFFERENCE = 1e-9  # of the load, step of the tangent: well below `SETTLED`, so as not to straddle the edge of a gap
LEAST_TANGENT = 1e-3  # of the secant: a strut whose stretch does not grow with force would be infinitely stiff


def assemble_links(model: StiffnessModel, path: LoadPath) -> tuple[FloatArray, FloatArray | None]:
    """Add up what the strut law and the effects contribute at n poses.

    Returns
    -------
    form, parallel
        (n, 12, 12) Q, quadratic form in the six strut forces and the tip wrench; (n, 6, 6) stiffness parallel to the
        struts, or None.

    Raises
    ------
    InputError
        The strut law was extrapolated to no stiffness or less, or the effects take more from a strut than it has.
    """
    with np.errstate(invalid="ignore"):  # a law of absurd slope is refused by its values
        stiffness = path.machine.strut_law.stiffness(path.struts.lengths)
    refuse_law_beyond_zero(path, stiffness)
    strut, form = 1.0 / stiffness, np.zeros((len(path), 12, 12))
    parallel: FloatArray | None = None
    for active in model.effects:
        if active.effect.load_dependent and path.strut_forces is None:
            continue
        series = active.adds("strut_compliance", path)
        loads = active.adds("load_compliance", path)
        beside = active.adds("parallel_stiffness", path)
        strut = strut if series is None else strut + series
        form = form if loads is None else form + loads
        parallel = beside if parallel is None else parallel if beside is None else parallel + beside
    if ((strut <= 0.0) | (strut == np.inf)).any():
        row, i = np.argwhere((strut <= 0.0) | (strut == np.inf))[0]
        raise _impossible(model, path, int(row), f"strut {i + 1}")
    form[:, np.arange(6), np.arange(6)] += strut
    return form, parallel


def refuse_law_beyond_zero(path: LoadPath, stiffness: FloatArray) -> None:
    """Raise `InputError` if the strut law gives (n, 6) struts zero, negative or non-numeric stiffness."""
    holds = (stiffness >= LEAST_STIFFNESS) & (stiffness < np.inf)
    lengths = path.struts.lengths
    holds |= np.isnan(lengths)  # a pose of nan stays nan
    if holds.all():
        return
    worst = np.unravel_index(np.argmin(np.where(holds, np.inf, stiffness)), stiffness.shape)
    raise InputError(
        f"strut {worst[1] + 1} would be {mm_from_m(float(lengths[worst])):.1f} mm long, where the machine's strut law "
        f"gives {n_per_um_from_n_per_m(float(stiffness[worst])):.4g} N/um{at_pose(path, int(worst[0]))}",
        expected="a finite stiffness above 0",
        hint="bound the strut length in the machine file so that the law stays positive",
    )


def respond(
    path: LoadPath, form: FloatArray, parallel: FloatArray | None, wrenches: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Tip twists and strut forces under wrenches at the tip.

    Parameters
    ----------
    path, form, parallel
        n poses and what they are made of, as of `assemble_links`.
    wrenches
        (n, 6, m) N and N m about the tip, base axes.

    Returns
    -------
    twists, forces
        (n, 6, m) m and rad; (n, 6, m) N. nan where a pivot is exactly 0; near a singular pose they are just huge
        (`machine.limits` refuses such poses).
    """
    jacobian = path.struts.jacobian
    transposed, by_wrench = np.swapaxes(jacobian, 1, 2), form[:, :6, 6:] @ wrenches
    if parallel is None:
        forces = _solve(transposed, wrenches)
        motion = _solve(jacobian, form[:, :6, :6] @ forces + by_wrench)
    else:
        stiffened = _solve(form[:, :6, :6], np.concatenate([jacobian, by_wrench], axis=-1))
        system = transposed @ stiffened[..., :6] + parallel
        motion = _solve(system, wrenches + transposed @ stiffened[..., 6:])
        forces = stiffened[..., :6] @ motion - stiffened[..., 6:]
    return motion + form[:, 6:, :6] @ forces + form[:, 6:, 6:] @ wrenches, forces


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve pose by pose with pivoting; nan where a matrix is singular, instead of failing for all."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        solution = np.full(np.broadcast_shapes(matrix.shape[:-2], right.shape[:-2]) + right.shape[-2:], np.nan)
        for i, (left, side) in enumerate(zip(matrix, right, strict=True)):
            # The same test as for a batch without singular poses: a pose's result must not depend on its neighbours.
            with suppress(np.linalg.LinAlgError):
                solution[i] = np.linalg.solve(left, side)
        return solution


def tip_compliance(model: StiffnessModel, path: LoadPath, direction: FloatArray | None = None) -> FloatArray:
    """(n, 3, 3) m/N, displacements of the tip under forces on it.

    Load-dependent effects are in it where the direction (n, 3) of the load that acts is given, as under that load: it
    is the secant compliance there.
    """
    if direction is not None and model.load_dependent:
        path = under_load(model, path, direction)[0]
    forces = np.broadcast_to(np.eye(6)[:, :3], (len(path), 6, 3))
    return possible(model, path, respond(path, *assemble_links(model, path), forces)[0][:, :3])


def under_load(
    model: StiffnessModel, path: LoadPath, direction: FloatArray
) -> tuple[LoadPath, FloatArray, FloatArray, FloatArray]:
    """State of the machine under a load of `path.force` along unit vectors (n, 3), with load-dependent effects.

    Those see the strut forces of the loaded machine: the ones of equilibrium or, where a stiffness parallel to the
    struts shares the load, the ones that agree with the compliances that they cause (`_settled`).

    Returns
    -------
    path, form, twists, forces
        With the strut forces of the loaded machine where effects depend on them; Q; (n, 6) m and rad of the tip,
        (n, 6) forces in the struts, both per newton of load.

    Raises
    ------
    InputError
        The strut forces do not settle.
    """
    wrenches = np.zeros((len(path), 6, 1))
    wrenches[:, :3, 0] = direction
    form, parallel = assemble_links(model, path)
    twists, forces = respond(path, form, parallel, wrenches)
    if model.load_dependent:
        path = replace(path, strut_forces=forces[..., 0] * path.force[:, None])
        if parallel is not None:
            _settle(model, path, parallel, wrenches[..., 0])
        form, parallel = assemble_links(model, path)
        twists, forces = respond(path, form, parallel, wrenches)
    return path, form, twists[..., 0], forces[..., 0]


def compliance_along(
    model: StiffnessModel, path: LoadPath, direction: FloatArray, equilibrium: FloatArray | None = None
) -> FloatArray:
    """(n,) m/N, displacement along unit vectors (n, 3) per force along them; see `under_load`.

    `equilibrium`: (n, 6) N, strut forces in equilibrium with the unit vectors, where they are known: unless a stiffness
    parallel to the struts shares the load, twice the energy that they store is the answer (Castigliano), and nothing is
    solved.
    """
    along: FloatArray | None = None
    if equilibrium is not None:
        loaded = replace(path, strut_forces=equilibrium * path.force[:, None]) if model.load_dependent else path
        form, parallel = assemble_links(model, loaded)
        if parallel is None:
            both = np.concatenate([equilibrium, direction], axis=1)  # no moment
            along = np.einsum("ni,ni->n", _times(form[:, :9, :9], both), both)
    if along is None:
        along = np.einsum("ni,ni->n", under_load(model, path, direction)[2][:, :3], direction)
    return possible(model, path, along[:, None, None])[:, 0, 0]


def _settle(model: StiffnessModel, loaded: LoadPath, parallel: FloatArray, wrenches: FloatArray) -> None:
    """Change the strut forces of the path, in place, to those consistent with the compliances that they cause."""
    assert loaded.strut_forces is not None
    regular = np.flatnonzero(np.isfinite(loaded.strut_forces).all(axis=1))  # nan marks a singular pose, which stays nan
    part = loaded.take(regular)
    rows, wrench = np.arange(len(part)), wrenches[regular] * part.force[:, None]
    for share in SHARES:
        rows = _newton_steps(model, part, parallel[regular], wrench, rows, share)
    if len(rows):
        names = ", ".join(active.effect.name for active in model.effects if active.effect.load_dependent)
        raise EffectError(
            f"the strut forces do not converge{at_pose(part, rows[0])} under {part.force[rows[0]]:g} N with {names}",
            expected="a strut deformation that grows with the force",
        )
    loaded.strut_forces[regular] = part.strut_forces


def _newton_steps(
    model: StiffnessModel, path: LoadPath, parallel: FloatArray, wrench: FloatArray, rows: IntArray, share: float
) -> IntArray:
    """Newton's method for strut forces of some poses, in place, by a share of each step; returns rows not settled.

    With e_i = t_i F_i + o_i, t the tangent and o_i = (s_i - t_i) F_i from the last forces, the system is linear. Where
    its forces stay e_i = s_i F_i holds, whatever the tangent was.
    """
    forces, load = path.strut_forces, path.force
    assert forces is not None
    each = np.arange(6)
    for _ in range(WHOLE_STEPS if share == 1.0 else PART_STEPS):
        if not len(rows):
            break
        before, jacobian, part = forces[rows], path.struts.jacobian[rows], path.take(rows)
        transposed = np.swapaxes(jacobian, 1, 2)
        beyond = before + np.where(before < 0.0, -DIFFERENCE, DIFFERENCE) * load[rows, None]
        form, further = (assemble_links(model, replace(part, strut_forces=f))[0] for f in (before, beyond))
        here = form[:, each, each]
        slope = (further[:, each, each] * beyond - here * before) / (beyond - before)
        tangent = np.maximum(slope, LEAST_TANGENT * here)
        longer = _times(form[:, :6, 6:], wrench[rows]) + (here - tangent) * before
        form[:, each, each] = tangent
        stiffened = np.linalg.solve(form[:, :6, :6], np.concatenate([jacobian, longer[..., None]], axis=-1))
        system = transposed @ stiffened[..., :6] + parallel[rows]
        right = wrench[rows] + _times(transposed, stiffened[..., 6])
        motion = np.asarray(np.linalg.solve(system, right[..., None])[..., 0])
        settled = _times(stiffened[..., :6], motion) - stiffened[..., 6]
        moved = np.abs(settled - before).max(axis=1) / load[rows]
        # Between tension and compression a strut has its gap, where it carries nothing.
        crossing = (settled * before < 0.0) & (moved > SETTLED)[:, None]
        forces[rows] = before + share * (np.where(crossing, 0.0, settled) - before)
        rows = rows[moved > SETTLED]
    return rows


def _times(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nij,nj->ni", matrix, vector))


def possible(model: StiffnessModel, path: LoadPath, compliance: FloatArray) -> FloatArray:
    """Symmetric part of a tip compliance (n, k, k) m/N, checked to be physically possible; nan at a singular pose.

    Raises
    ------
    InputError
        It is not finite, not symmetric or not positive definite at a pose that is not singular; with effects and pose.
        A fit walks away from there.
    """
    rows = np.flatnonzero(~is_compliance(compliance))
    with np.errstate(over="ignore", invalid="ignore"):
        symmetric = np.asarray(0.5 * (compliance + np.swapaxes(compliance, 1, 2)))
    if len(rows):
        regular = rows[~_is_singular(path.take(rows))]
        if len(regular):
            raise _impossible(model, path, int(regular[0]), "the tip")
        symmetric[rows] = np.nan
    return symmetric


def _is_singular(path: LoadPath) -> BoolArray:
    if isinstance(path.stance, Stance):
        return np.ones(len(path), dtype=bool)  # a machine of elements, each with its own compliance
    screws = path.struts.jacobian.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        screws[:, :, 3:] /= np.linalg.norm(path.struts.arms, axis=-1).mean(axis=-1)[:, None, None]
    regular = np.flatnonzero(np.isfinite(screws).all(axis=(1, 2)))
    singular = np.ones(len(path), dtype=bool)
    singular[regular] = ~(np.linalg.cond(screws[regular]) < NEARLY_SINGULAR)
    return singular


def is_compliance(tensor: FloatArray) -> BoolArray:
    """(n,) True where tensors (n, k, k) are finite, symmetric and positive definite."""
    scale = np.abs(tensor).max(axis=(1, 2))
    good = (scale > 0.0) & (scale < np.inf)
    unit = tensor[good] / scale[good, None, None]  # scaled, as sums of the largest numbers overflow
    turned = np.swapaxes(unit, 1, 2)
    even = np.abs(unit - turned).max(axis=(1, 2)) <= APART
    good[good] = even & (np.linalg.eigvalsh(0.5 * (unit + turned))[:, 0] > 0.0)
    return np.asarray(good)


def _impossible(model: StiffnessModel, path: LoadPath, row: int, part: str) -> EffectError:
    """Error that blames the effects from outside the package, otherwise all effects, otherwise the machine."""
    effects = [active.effect for active in model.effects]
    foreign = [effect for effect in effects if is_foreign(effect)]
    names = ", ".join(effect.name for effect in foreign or effects)
    cause, hint = f"machine {path.machine_tool.name}", "check the parameters of the effects, strut law and joints"
    if foreign:
        hint = f"`{command_line('effects', 'check', file_of(foreign[0]))}` tests an effect by itself"
    return EffectError(
        f"with {f'effect {names}' if names else cause} {part} has no positive stiffness{at_pose(path, row)}",
        expected="a compliance that is finite, symmetric and positive definite",
        hint=hint,
    )
