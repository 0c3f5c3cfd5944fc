"""What an update writes: law and sizes for what goes along with them, struts and joints where they most likely are.

Every fit counts struts that are not alike, joints off their places and links that give a little though the model takes
them for rigid as scatter that all readings share (`noise`). That is right for a verdict. But a law that was fitted
beside offsets which nobody writes takes the blame off what is written: a sound machine of beams comes out too stiff. So
what is written is fitted anew, beside no offsets but those that are written with it.

What struts and joints scatter by on this machine the readings tell, as far as they can: of offsets u of prior
covariance 1 with columns S, in residuals r of covariance V, the likeliest are S^T V^-1 r (Rasmussen and Williams 2006,
Gaussian Processes for Machine Learning, 2.1). With law and sizes alone an effect of the true form itself leaves as
much along a path as unlike struts and joints make.
"""

from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.correction.steps import LadderStep
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.inference.covariances import Groups
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.fits import refine
from toolpath_stiff.inference.left_out import HeldOut, gain_in_standard_errors, held_out
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.error_model import GEOMETRY
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.portrait.portrait import LACKING

AS_BUILT = "struts and joints as read"
FURTHEST = 3.0  # standard deviations beyond which an offset is not a tolerance: the model lacks something else
CERTAIN = 2.0  # standard errors by which the error at left-out points must fall beside an instrument's error
DIGITS = 9  # decimals of ln and m on which all processors agree


def last_step(task: UpdateTask, before: LadderStep) -> tuple[Hexapod | None, LadderStep]:
    """The machine with the likeliest offsets, None where left-out points ask for none, and the last step."""
    geometry, noise = task.problem.scatter.covariance.shared[:GEOMETRY], task.noise_model
    plain = LadderStep.of(before.name, fitted_beside(task, before.fit, geometry[:0], before.fit.law_free), task.data)
    fit = fitted_beside(task, before.fit, geometry, before.fit.law_free)
    pull = fit.scatter.precision.times(geometry)
    likely = pull @ fit.residual
    held = _held_out(fit, geometry, pull, held_out(fit, task.data.point))
    falls = gain_in_standard_errors(plain.held, held.of_readings(task.data.tip))
    # What the form of an instrument's error leaves is none of the machine's.
    lacking = before.instruments and 100 * plain.held.mean_error > LACKING * noise.floor_percent
    if lacking or np.abs(likely).max() > FURTHEST or not falls > (CERTAIN if before.instruments else 0.0):
        return None, plain
    sd = np.repeat([noise.strut_spread, noise.joint_error], [6, GEOMETRY - 6])
    earlier = np.zeros(GEOMETRY) if task.machine.as_built is None else task.machine.as_built
    machine = task.machine.with_changes(
        as_built=np.round(earlier + sd * likely, DIGITS), origins={**task.machine.origins, "as_built": "fitted"}
    )
    modelled = Predictor(machine, task.data, task.effect_files).log_stiffness(fit.law, fit.effects)
    residual = task.problem.observed - modelled
    return machine, LadderStep.of(AS_BUILT, replace(fit, residual=residual), task.data, held)


def fitted_beside(task: UpdateTask, fit: Fit, shared: FloatArray, law_free: bool) -> Fit:
    """Law and sizes anew beside no other offsets of all readings than those (k, n), the first of the noise model's.

    How well they are known the others count for all the same.
    """
    covariance, others = replace(fit.scatter.covariance, shared=shared), task.problem.scatter.covariance.shared
    bare = replace(fit, scatter=replace(fit.scatter, covariance=covariance))
    refitted = refine(task.problem, bare, law_free)
    moved = refitted.covariance @ refitted.scatter.precision.times(refitted.jacobian.T) @ others[len(shared) :].T
    return replace(refitted, covariance=refitted.covariance + moved @ moved.T)


def _held_out(fit: Fit, known: FloatArray, pull: FloatArray, held: HeldOut) -> HeldOut:
    """Residuals at left-out points, with law, sizes and offsets from the others: `known` (42, n), `pull` known V^-1.

    With A = V^-1, V_ss^-1 r_s of the readings that stay is A r with r_o less A_oo^-1 (A r)_o (Schur's complement).
    """
    residual, precision = held.residual.copy(), fit.scatter.precision
    for move, out in zip(held.moves, Groups.by(held.point).members(), strict=True):
        left = fit.residual - fit.jacobian @ move
        predicted = np.linalg.solve(precision.block(out), precision.times(left)[out])
        residual[out] -= known[:, out].T @ (pull @ left - pull[:, out] @ predicted)
    return replace(held, residual=residual)
