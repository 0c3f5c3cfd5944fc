"""Error of a fitted model at a pose, for bands that hold where nobody has measured.

The logarithm of the true stiffness differs from a fit's by three errors, whose sizes are read from the readings:

    scatter    of readings and clampings, which law and sizes have taken up: times `SCATTERS` of the noise model;
    geometry   struts that are not alike, joints off their places: times `GEOMETRIES` of what the noise model assumes.
               They belong to the machine: where law and sizes have taken them up they are no error, elsewhere they are;
    form       what neither describes (links that the model takes for rigid, too), smooth over poses and different by
               direction, of `FORMS` (relative sd). An effect that is added was chosen for fitting these readings, and
               its form is its part's only nearly: what it changes is off by some `SHARE` of it.

A quarter of the measured poses is left out at a time, a region each, for a reading whose neighbours were fitted tells
little of what is away from all of them. The sizes count by how likely they make the errors there: with four to eight
regions a quantile of their scores, as split conformal prediction takes it, does not exist (95 % take 19 of them; Vovk,
Gammerman and Shafer 2005, Algorithmic Learning in a Random World, 4.2), and it would hold for readings with their
scatter, not for the stiffness under it.
"""

from collections.abc import Iterator, Sequence
from math import erfc

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, TextArray
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.inference.evidence import Fit, law_prior
from toolpath_stiff.inference.least_squares import scaled_inverse
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.machine.error_model import GEOMETRY, ErrorModel, alike, coordinates
from toolpath_stiff.readings.measurements import Readings

# Grid of sizes and their priors; assumed. The scatter is known to the noise model's degrees of
# freedom (with Student's tails, for it may be wrong altogether); the geometry's tolerances are guesses, to a factor of
# 2 or 3; the form is right with even odds, else off by a quarter of a per cent to 8 %, all orders alike.
SCATTERS = np.geomspace(0.5, 3.0, 13)
GEOMETRIES = {0.0: 1.0, 0.35: 1.0, 0.7: 1.0, 1.0: 1.0, 1.4: 0.5, 2.0: 0.25}
FORMS = {0.0: 3.0, 0.0025: 0.5, 0.005: 0.5, 0.01: 0.5, 0.02: 0.5, 0.04: 0.5, 0.08: 0.5}
# Share of what effects change by which their forms are expected to be off, and the factor of one standard deviation of
# that; assumed: constants along axes stand for parts that are no springs.
SHARE, SHARE_FACTOR = 0.05, 3.0
FEWEST_PLACES, HALVINGS = 8, 2  # fewest distinct poses; number of times regions are halved
MOST_READINGS = 400  # spread over the campaign, from which the sizes are read
MOST_DIRECTIONS, FORM_IN_AXES = 12, 0.01  # most directions of a region's errors beyond scatter; form to rank them
TAILS = 4.0  # degrees of freedom of the scatter's prior
ROUNDING, BISECTIONS = 1e-12, 25


def error_model(
    fit: Fit, data: Readings, noise: Noise, given: Fit | None = None, *, moved: bool = False
) -> ErrorModel | None:
    """Error model of a fit to n readings; None if too few poses were measured.

    Its loadings are those of law and free sizes, in units of the fit. `given`: the same effects beside the machine
    file's law, if that is what is written: either may be right. `moved`: struts and joints stand where the readings
    have them, and are off by what is left.
    """
    place = coordinates(data.position, data.angles)
    places = np.unique(place, axis=0)
    if len(places) < FEWEST_PLACES or not data.tip.all():
        return None
    rows = np.unique(np.linspace(0, len(data) - 1, min(len(data), MOST_READINGS)).round().astype(np.int64))
    jacobian, residual, covariance = fit.jacobian[rows], fit.residual[rows], fit.scatter.covariance
    shared, common = covariance.shared[:GEOMETRY], covariance.groups.spread(covariance.common)
    same = covariance.groups.of[rows, None] == covariance.groups.of[rows]
    parts = (
        np.diag(covariance.own_variance[rows]) + common[rows] * same,
        shared[:, rows].T @ shared[:, rows],
        alike(place[rows], data.direction[rows]),
    )
    assumed = parts[0] + covariance.shared[:, rows].T @ covariance.shared[:, rows]
    sizes = np.stack([axis.ravel() for axis in np.meshgrid(SCATTERS, [*GEOMETRIES], [*FORMS], indexing="ij")], axis=1)
    beyond = np.log(SCATTERS) / np.sqrt(0.5 / noise.freedom)
    expected = (1.0 + beyond**2 / TAILS) ** (-0.5 * (TAILS + 1.0))
    prior = expected[:, None, None] * np.array([*GEOMETRIES.values()])[:, None] * _expected_forms(fit)
    log_weights, away, taken = np.log(prior.ravel()), list[FloatArray](), np.zeros((2, 2))
    known = shared[:, rows] if moved else shared[:0, rows]
    for out in regions(place[rows], data.point[rows]):
        left, foretold = _left_out(out, jacobian, assumed, fit.law_free, known)
        log_weights += _log_likelihoods(left @ residual, [left @ part @ left.T for part in parts], sizes**2)
        away.append(np.diag(left @ parts[2] @ left.T))
        taken += _by_scatter_and_geometry(left, out, parts), _by_scatter_and_geometry(left + foretold, out, parts)
    weights = np.exp(log_weights - log_weights.max())
    weights /= weights.sum()

    by_reading = fit.covariance @ fit.scatter.precision.times(fit.jacobian.T)  # of each unknown
    taken_up = by_reading * covariance.own_variance
    taken_up += common * covariance.groups.sums(by_reading)[:, covariance.groups.of]
    own, geometry = _root(taken_up @ by_reading.T), by_reading @ shared.T
    every, law_alone = np.arange(len(rows)), np.eye(len(rows)) - jacobian @ _estimator(jacobian, assumed, fit.law_free)
    left = law_alone - known.T @ np.linalg.solve(assumed, known.T).T @ law_alone
    unknown = _unknown(*(_by_scatter_and_geometry(m, every, parts) for m in (left, law_alone)))
    further = max(_unknown(*taken) - unknown, 0.0)
    near = float(np.diag(left @ parts[2] @ left.T).mean())
    here = [fit.jacobian @ own, shared.T - fit.jacobian @ geometry]
    typical = np.array([*(float((part**2).sum(axis=1).mean()) for part in here), near]) * [1.0, unknown, 1.0]
    factor = _coverage_factor(weights, sizes**2 @ typical)
    scatter, of_geometry, form = (factor * np.sqrt(weights @ sizes**2)).tolist()
    apart = float((here[1] ** 2).sum(axis=1).mean())
    far = form**2 * max(float(np.concatenate(away).mean()), near) + of_geometry**2 * further * apart
    of_geometry *= float(np.sqrt(unknown))
    either = np.zeros((len(own), 0)) if given is None else _apart(fit, given)[:, None] * np.sqrt(0.5)
    return ErrorModel(
        np.concatenate([either, scatter * own, of_geometry * geometry], axis=1),
        of_geometry * noise.strut_spread, of_geometry * noise.joint_error,
        form * float(np.sqrt(near)), float(np.sqrt(far)), places,
    )  # fmt: skip


def _expected_forms(fit: Fit) -> FloatArray:
    """(forms,) prior weights of `FORMS`, by the change that effects of the machine make."""
    owners = [candidate for candidate in fit.candidates for _ in candidate.components]
    sizes = [0.0 if owners[i].effect.is_instrument else fit.parts[i][1] for i in fit.free]
    change = float(np.sqrt(np.mean((fit.jacobian[:, 2:] @ np.array(sizes)) ** 2)))
    if not change > 0.0:
        return np.array([*FORMS.values()])
    forms = np.array([*FORMS])
    deviates = np.log(np.maximum(forms, 1e-12) / (SHARE * change)) / np.log(SHARE_FACTOR)
    return np.asarray(np.exp(-0.5 * deviates**2) + np.finfo(float).tiny)


def _apart(fit: Fit, given: Fit) -> FloatArray:
    """(q,) difference of law and free sizes between two fits with the same effects."""
    both = [np.concatenate([each.law, *each.sizes])[[0, 1, *(2 + i for i in fit.free)]] for each in (fit, given)]
    return np.asarray(both[0] - both[1])


def regions(place: FloatArray, point: TextArray) -> Iterator[IntArray]:
    """Rows of `coordinates` (n, 6) in regions of as many points each, halved along their longest side."""
    points, first, which = np.unique(point, return_index=True, return_inverse=True)
    parts = [np.arange(len(points))]
    for _ in range(HALVINGS):
        halves = []
        for part in parts:
            here = place[first[part]]
            order = part[np.argsort(here[:, int(np.ptp(here, axis=0).argmax())], kind="stable")]
            halves += [order[: len(order) // 2], order[len(order) // 2 :]]
        parts = halves
    return (np.flatnonzero(np.isin(which, part)) for part in parts)


def _estimator(jacobian: FloatArray, covariance: FloatArray, law_free: bool) -> FloatArray:
    """(q, n) change of a least-squares fit's unknowns by each reading."""
    weighted = np.linalg.solve(covariance, jacobian).T
    return np.asarray(scaled_inverse(weighted @ jacobian + law_prior(len(weighted), law_free)) @ weighted)


def _left_out(
    out: IntArray, jacobian: FloatArray, assumed: FloatArray, law_free: bool, known: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(m, n) each: matrix from readings to the errors of m left-out ones, and matrix of the part that `known` predicts.

    `known` (k, n): by how much offsets, of which the readings that stay tell, change each reading.
    """
    kept = np.delete(np.arange(len(jacobian)), out)
    left, foretold = np.eye(len(jacobian))[out], np.zeros((len(out), len(jacobian)))
    covariance = assumed[np.ix_(kept, kept)]
    estimator = _estimator(jacobian[kept], covariance, law_free)
    left[:, kept] = -jacobian[out] @ estimator
    if len(known):
        by_others = np.linalg.solve(covariance, known[:, kept].T).T
        foretold[:, kept] = known[:, out].T @ (by_others - by_others @ jacobian[kept] @ estimator)
    return left - foretold, foretold


def _by_scatter_and_geometry(left: FloatArray, out: IntArray, parts: Sequence[FloatArray]) -> FloatArray:
    """(2,) squares of errors of left-out stiffnesses, by scatter (not of their own readings) and by geometry."""
    pulled = left - np.eye(left.shape[1])[out]
    return np.array([float(((m @ part) * m).sum()) for m, part in ((pulled, parts[0]), (left, parts[1]))])


def _unknown(after: FloatArray, before: FloatArray) -> float:
    """Share of the squares by geometry that known offsets leave, with the scatter that these have taken up."""
    return float((after.sum() - before[0]) / before[1]) if before[1] > 0.0 else 1.0


def _log_likelihoods(error: FloatArray, parts: Sequence[FloatArray], squares: FloatArray) -> FloatArray:
    """(g,) log likelihoods of errors (m,) whose covariance is the sum of three parts (m, m) times `squares` (g, 3)."""
    lower = np.linalg.cholesky(parts[0])

    def white(part: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.solve(lower, np.linalg.solve(lower, part).T))

    geometry, form, whitened = white(parts[1]), white(parts[2]), np.linalg.solve(lower, error)
    # Along all other directions scatter dominates.
    axes = np.linalg.eigh(geometry + FORM_IN_AXES**2 * form)[1][:, -MOST_DIRECTIONS:]
    along = axes.T @ whitened
    whitened_parts = np.stack([np.eye(len(along)), axes.T @ geometry @ axes, axes.T @ form @ axes])
    covariance = np.tensordot(squares, whitened_parts, axes=1)
    weighted = np.linalg.solve(covariance, np.broadcast_to(along[:, None], (len(squares), len(along), 1)))[..., 0]
    scatter, rest = squares[:, 0], float(whitened @ whitened - along @ along)
    of_rest = rest / scatter + (len(error) - len(along)) * np.log(scatter)
    return np.asarray(-0.5 * (np.linalg.slogdet(covariance)[1] + weighted @ along + of_rest))


def _root(covariance: FloatArray) -> FloatArray:
    """(q, q) lower R with R R^T a covariance in very different units; 0 for unknowns that were not fitted."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(scale > 0.0, scale, 1.0)
    correlation = covariance / np.outer(safe, safe)
    return np.asarray(scale[:, None] * np.linalg.cholesky(correlation + ROUNDING * np.eye(len(scale))))


def _coverage_factor(weights: FloatArray, variances: FloatArray) -> float:
    """Factor on the root mean variance at which 95 % of a mixture of normal errors lie within 1.96 of it."""
    sd, mean = np.sqrt(variances), float(np.sqrt(weights @ variances))
    likely, low, high = weights > weights.max() * ROUNDING, 0.5, 3.0
    for _ in range(BISECTIONS):
        factor = 0.5 * (low + high)
        outside = [erfc(factor * NORMAL_95 * mean / (x * 2.0**0.5)) for x in sd[likely].tolist()]
        low, high = (factor, high) if weights[likely] @ outside > 0.05 else (low, factor)
    return factor
