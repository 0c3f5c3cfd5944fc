"""Error of a fitted model at a pose, for bands that hold where nobody has measured.

The logarithm of the true stiffness differs from a fit's by three errors, whose sizes are read from the readings:

    scatter    of readings and clampings, which law and sizes have taken up: times `SCATTERS` of the noise model, with
               its clampings times `CLAMPINGS` beside that: all clampings tell of them, not only the repeated ones;
    geometry   struts that are not alike, joints off their places: times `GEOMETRIES` of what the noise model assumes.
               They belong to the machine: where law and sizes have taken them up they are no error, elsewhere they are.
               Of a machine that has them where they most likely are (`as_built`): what readings leave unknown of them,
               and the scatter that they have taken up;
    form       what neither describes (links that the model takes for rigid, too), smooth over poses and different by
               direction, of `FORMS` (relative sd). An effect that is added was chosen for fitting these readings: its
               form is its part's, or only nearly, and what it changes is off by some `SHARE` of it.

A quarter of the measured poses is left out at a time, a region each, for a reading whose neighbours were fitted tells
little of what is away from all of them. The sizes count by how likely they make the errors there: with four to eight
regions a quantile of their scores, as split conformal prediction takes it, does not exist (95 % take 19 of them; Vovk,
Gammerman and Shafer 2005, Algorithmic Learning in a Random World, 4.2), and it would hold for readings with their
scatter, not for the stiffness under it.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import erfc

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray, TextArray
from toolpath_stiff.defaults import NORMAL_95
from toolpath_stiff.inference.discrepancies import Kernel
from toolpath_stiff.inference.evidence import Fit, law_prior
from toolpath_stiff.inference.least_squares import scaled_inverse
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.machine.error_model import GEOMETRY, ErrorModel, alike, coordinates
from toolpath_stiff.readings.measurements import Readings

# Grid of sizes and their priors; assumed. The scatter is known to the noise model's degrees of
# freedom (with Student's tails, for it may be wrong altogether); clamping to a factor of 2, for it comes from the few
# clampings that were repeated, and rather too large (`repeats`); the geometry's tolerances are guesses, to a factor of
# 2 or 3; the form is right with even odds, else off by about what the noise model takes rigid links to give (`rest`),
# and by a share of what effects change beside it, to a factor of 3 (one standard deviation): constants along axes stand
# for parts that are no springs.
SCATTERS = np.geomspace(0.5, 3.0, 13)
CLAMPINGS, CLAMPING_FACTOR = (0.35, 0.6, 1.0, 1.7), 2.0
GEOMETRIES = {0.0: 1.0, 0.35: 1.0, 0.7: 1.0, 1.0: 1.0, 1.4: 0.5, 2.0: 0.25}
FORMS = (0.0, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08)
SHARE, FORM_FACTOR = 0.05, 3.0
FEWEST_PLACES, HALVINGS = 8, 2  # fewest distinct poses; number of times regions are halved
MOST_READINGS = 400  # spread over the campaign, from which the sizes are read
MOST_DIRECTIONS, FORM_IN_AXES = 12, 0.01  # along which a region's errors may be other than scatter; by what form
MOST_LEARNED = 20  # directions in which readings tell of struts and joints; what they tell of others is left out
TAILS = 4.0  # degrees of freedom of the expected scatter
ROUNDING, BISECTIONS = 1e-12, 25


def error_model(
    fit: Fit, data: Readings, noise: Noise, shared: FloatArray, given: Fit | None = None
) -> ErrorModel | None:
    """The errors of a fit to n readings under their scatter; None where too few poses were measured to tell.

    Its loadings are those of law and free sizes, in units of the fit. `shared` (42, n): what struts and joints, one
    standard deviation off, change of ln k; a fit whose scatter holds them goes with the machine that has them where
    they most likely are. `given`: the same effects beside the machine file's law, if that is what is written: either
    may be right.
    """
    place = coordinates(data.position, data.angles)
    places = np.unique(place, axis=0)
    if len(places) < FEWEST_PLACES or not data.tip.all():
        return None
    rows = np.unique(np.linspace(0, len(data) - 1, min(len(data), MOST_READINGS)).round().astype(np.int64))
    jacobian, residual, covariance = fit.jacobian[rows], fit.residual[rows], fit.scatter.covariance
    common = covariance.groups.spread(covariance.common)
    same = covariance.groups.of[rows, None] == covariance.groups.of[rows]
    single, clamped, moved = np.diag(covariance.own_variance[rows]), common[rows] * same, covariance.shared[:, rows]
    wrong = (shared[:, rows].T @ shared[:, rows], alike(place[rows], data.direction[rows]))
    assumed = single + clamped + moved.T @ moved
    sizes = np.stack([axis.ravel() for axis in np.meshgrid(SCATTERS, [*GEOMETRIES], FORMS, indexing="ij")], axis=1)
    beyond = np.log(SCATTERS) / np.sqrt(0.5 / noise.freedom)
    expected = (1.0 + beyond**2 / TAILS) ** (-0.5 * (TAILS + 1.0))
    prior = expected[:, None, None] * np.array([*GEOMETRIES.values()])[:, None] * _expected_forms(fit, noise.rest)
    of_clamping = -0.5 * (np.log(CLAMPINGS) / np.log(CLAMPING_FACTOR)) ** 2
    log_weights, away = of_clamping[:, None, None, None] + np.log(prior), list[FloatArray]()
    for out in regions(place[rows], data.point[rows]):
        left = _left_out(out, jacobian, assumed, fit.law_free, moved)
        of_single, of_clamps, *of_wrong = (left @ part @ left.T for part in (single, clamped, *wrong))
        log_weights += [_log_likelihoods(left @ residual, of_single + c**2 * of_clamps, *of_wrong) for c in CLAMPINGS]
        away.append(np.diag(of_wrong[1]))
    likely = np.exp(log_weights - log_weights.max())
    likely /= likely.sum()
    weights, clamping = likely.sum(axis=0).ravel(), likely.sum(axis=(1, 2, 3)) @ np.square(CLAMPINGS)

    precision = replace(covariance, shared=shared[:0], common=clamping * covariance.common).precision
    weighted = precision.times(fit.jacobian.T)
    certain = scaled_inverse(weighted @ fit.jacobian + law_prior(len(weighted), fit.law_free))
    own, geometry = _root(certain), certain @ (weighted @ shared.T)
    left = shared.T - fit.jacobian @ geometry
    values, vectors = np.linalg.eigh(precision.times(left.T) @ left if len(moved) else np.zeros((GEOMETRY, GEOMETRY)))
    # By how much offsets of which so much is known are off: by scatter that they have taken up, by what is not told.
    told = np.maximum(values, 0.0)
    by_scatter, untold = told / (1.0 + told) ** 2, 1.0 / (1.0 + told) ** 2
    offsets = ((left @ vectors) ** 2).mean(axis=0)
    every = _left_out(rows[:0], jacobian, assumed, fit.law_free, moved)
    near = float(np.diag(every @ wrong[1] @ every.T).mean())
    far = max(float(np.concatenate(away).mean()), near)
    of_parameters = float(((fit.jacobian @ own) ** 2).sum(axis=1).mean())
    factor = _coverage_factor(weights, sizes**2 @ [of_parameters + by_scatter @ offsets, untold @ offsets, near])
    scatter, of_geometry, form = (factor * np.sqrt(weights @ sizes**2)).tolist()
    learned = _learned(np.sqrt((scatter / of_geometry) ** 2 * by_scatter + untold), vectors)
    geometry = geometry - geometry @ learned.T @ learned
    either = np.zeros((len(own), 0)) if given is None else _apart(fit, given)[:, None] * np.sqrt(0.5)
    return ErrorModel(
        np.concatenate([either, scatter * own, of_geometry * geometry], axis=1),
        of_geometry * noise.strut_spread, of_geometry * noise.joint_error,
        form * float(np.sqrt(near)), form * float(np.sqrt(far)), places, learned,
    )  # fmt: skip


def _learned(left: FloatArray, vectors: FloatArray) -> FloatArray:
    """(r, 42) rows A: errors u become u - A^T A u, where of those along `vectors` (42, 42) shares `left` (42,) stay."""
    shrunk = (vectors * (1.0 - np.minimum(left, 1.0))) @ vectors.T
    kernel, mean = Kernel(lambda i: shrunk[i], np.diag(shrunk)), float(np.diag(shrunk).mean())
    return kernel.features(MOST_LEARNED).T * np.sqrt(mean) if mean > ROUNDING else np.zeros((1, len(left)))


def _expected_forms(fit: Fit, rest: float) -> FloatArray:
    """(forms,) prior weights of `FORMS`, by what rigid links give and what effects of the machine change."""
    owners = [candidate for candidate in fit.candidates for _ in candidate.components]
    sizes = [0.0 if owners[i].effect.is_instrument else fit.parts[i][1] for i in fit.free]
    change = float(np.sqrt(np.mean((fit.jacobian[:, 2:] @ np.array(sizes)) ** 2)))
    deviates = np.log(np.array(FORMS[1:]) / np.hypot(rest, SHARE * change)) / np.log(FORM_FACTOR)
    weights = np.exp(-0.5 * deviates**2)
    return np.concatenate([[weights.sum()], weights])


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
) -> FloatArray:
    """(m, n) matrix by which readings make the errors of m that are left out, of all if none is.

    `known` (k, n): by how much offsets, of which the readings that stay tell, change each reading.
    """
    kept, out = np.delete(np.arange(len(jacobian)), out), out if len(out) else np.arange(len(jacobian))
    left, covariance = np.eye(len(jacobian))[out], assumed[np.ix_(kept, kept)]
    estimator = _estimator(jacobian[kept], covariance, law_free)
    by_others = np.linalg.solve(covariance, known[:, kept].T).T
    left[:, kept] -= jacobian[out] @ estimator
    left[:, kept] -= known[:, out].T @ (by_others - by_others @ jacobian[kept] @ estimator)
    return left


def _log_likelihoods(error: FloatArray, scatter: FloatArray, geometry: FloatArray, form: FloatArray) -> FloatArray:
    """(scatters, geometries, forms) log likelihoods of errors (m,), whose covariance is the sum of three (m, m).

    Each is times a square of the grid of sizes.
    """
    lower = np.linalg.cholesky(scatter)

    def white(part: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.solve(lower, np.linalg.solve(lower, part).T))

    geometry, form, whitened = white(geometry), white(form), np.linalg.solve(lower, error)
    # Along all other directions scatter dominates.
    axes = np.linalg.eigh(geometry + FORM_IN_AXES**2 * form)[1][:, -MOST_DIRECTIONS:]
    along = axes.T @ whitened
    squares = np.square([*GEOMETRIES])[:, None, None, None], np.square(FORMS)[:, None, None]
    values, vectors = np.linalg.eigh(squares[0] * (axes.T @ geometry @ axes) + squares[1] * (axes.T @ form @ axes))
    scatters = np.square(SCATTERS)[:, None, None]
    widths = scatters[..., None] + values
    of_axes = (np.log(widths) + (along @ vectors) ** 2 / widths).sum(axis=-1)
    of_rest = float(whitened @ whitened - along @ along) / scatters + (len(error) - len(along)) * np.log(scatters)
    return np.asarray(-0.5 * (of_axes + of_rest) - np.log(np.diag(lower)).sum())


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
