"""Pulls on a machine of elements in the form that `fits` and `votes` take: no logarithms, no strut law.

A reading is y = sum_r c_r (s_r w)(s_r t) + noise, s_r the loads of the elements per wrench, w the pull, t what is read
(unit dummy load; Castigliano). Components pass zero, so that a residual is measured less modelled over the size of its
pull's displacement. What is left is chi-square where nothing is missing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from toolpath_stiff.arrays import FloatArray, TextArray
from toolpath_stiff.inference.candidates import Candidate, Component, candidates_of
from toolpath_stiff.inference.covariances import Covariance, Groups
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import add_effect, base_fit, fit_effects, settled
from toolpath_stiff.inference.least_squares import bounded_step
from toolpath_stiff.inference.noise import CONTRADICTED, GUESSES, STATED_FREEDOM, Noise, Scatter
from toolpath_stiff.inference.prequential import votes
from toolpath_stiff.inference.repeats import OUTLIER_WIDTH, OUTLIERS
from toolpath_stiff.inference.votes import outvoted
from toolpath_stiff.machine.elements import turns
from toolpath_stiff.readings.pulls import FRAMES, MOVED_AXES, Pulls
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects
from toolpath_stiff.stiffness.contract import ELEMENT, Effect, LoadPath
from toolpath_stiff.stiffness.element_sum import added_by, stance_of
from toolpath_stiff.stiffness.model import StiffnessModel, path_of_stance

FEWEST = 6  # fewest degrees of freedom that tell anything about the noise
NONE, JOINTS = "none", "joints refitted"
ALIKE = 10.0  # chi-square: an explanation that leaves no more than this beside the best cannot be told from it
GAIN = 16.0  # chi-square that a name must gain over no effect, with some thirty candidates: under 1 in 500 by chance
PRICE = 4.0  # chi-square that a further parameter must gain (one degree of freedom: 5 % by chance)
COARSE = 0.04  # scatter relative to the displacements from which nothing is named unless the scatter was stated
COMMON = 0.01  # probability of so much in common among residuals of alike pulls, below which it is not scatter
WRONG = 1e-3  # probability of so large a misfit, below which something else is missing
REWEIGHTED = 8  # times that scatter is estimated
OFF = 3.0  # standard deviations at which a reading is capped in that estimate
LEAST = 1e-4  # smallest relative sd of a reading: no measurement is better
CLOSELY = 0.9  # the same correlation, from which no question is raised
FOLLOWS = 0.5  # correlation of measured with modelled components, joints refitted, below which it is another machine's
OTHER_UNIT = 100.0  # measured over modelled, or the inverse, from which the unit is asked for
INVISIBLE = 1e-6  # share of the readings' size, rms, that a candidate at its largest usual size must change
VISIBLE = 5e-3  # the same for effects of geometry, which pulls hardly show
ALIKE_FREEDOM = 20  # degrees of freedom within alike pulls from which scatter can be told from a misfit
SAME_PULL = 0.02  # largest difference of direction components and of relative force between repeats
NO_LAW = np.zeros(2)


class PullProblem(Problem):
    """Model predictions for m pulls, and the scatter of the readings."""

    linear = True

    def __init__(self, model: StiffnessModel, pulls: Pulls, files: Sequence[str] = ()) -> None:
        self.model, self.pulls, self.machine, self.files = model, pulls, model.machine, tuple(files)
        self.path, self.products, self.by_element = self._standing(model.effects)
        self.predicted = self.with_effects((*model.effects, *model.instruments), self.by_element.sum(axis=1))
        self.observed = (pulls.value - self.predicted) / pulls.size
        self.freedom, self.together = np.inf, 0  # of an estimated scatter, and of all candidates together
        self.noise_of(np.full(len(pulls), LEAST))

    @property
    def point(self) -> TextArray:
        """(m,) the pose of each reading."""
        return self.pulls.point

    def _standing(self, effects: Sequence[ActiveEffect]) -> tuple[LoadPath, FloatArray, FloatArray]:
        """Load paths; (m, r) products of element loads under pull and unit load; (m, e) m, give of each element."""
        model, pulls = self.model, self.pulls
        seen = {"direction": pulls.along[:, :3], **model.conditions.columns(len(pulls))}
        force = np.linalg.norm(pulls.wrench[:, :3], axis=1)
        path = path_of_stance(replace(model, effects=tuple(effects)), pulls.stance, force=force, **seen)
        stance = stance_of(path)
        rows = [load.rows(stance.position) for load in stance.loads]
        loads, read = (
            [np.einsum("nri,ni->nr", part, wrench) for part in rows] for wrench in (pulls.wrench, pulls.along)
        )
        products = [load * other for load, other in zip(loads, read, strict=True)]
        given = [(part * load.compliance).sum(axis=1) for part, load in zip(products, stance.loads, strict=True)]
        path = replace(path, element_loads=np.concatenate(loads, axis=1))
        return path, np.concatenate(products, axis=1), np.stack(given, axis=1)

    def with_effects(self, effects: Sequence[ActiveEffect], moved: FloatArray) -> FloatArray:
        """(m,) m shown by the readings: element displacements `moved`, plus effects, as instruments show them."""
        path, products = self.path, self.products
        if moving := [a for a in effects if "stands" in a.effect.hooks and a not in self.model.effects]:
            path, products, given = self._standing([*self.model.effects, *moving])
            moved = moved + (given - self.by_element).sum(axis=1)
        at_tip, more = added_by((active for active in effects if not active.effect.is_instrument), path)
        if at_tip is not None:
            moved = moved + np.einsum("ni,nij,nj->n", self.pulls.along, at_tip, self.pulls.wrench)
        if more is not None:
            moved = moved + (more * products).sum(axis=1)
        for active in (active for active in effects if active.effect.is_instrument):  # they act on what all others make
            stiffness = self.path.force / np.maximum(np.abs(moved), 1e-15)
            moved = moved * stiffness / active.reading(stiffness, self.path)
        return moved

    def residual(self, law: FloatArray, effects: Sequence[ActiveEffect]) -> FloatArray:
        """(m,) measured less modelled, relative to the size of each pull's displacement."""
        return np.asarray((self.pulls.value - self.with_effects(effects, self.predicted)) / self.pulls.size)

    def law_columns(self, residual: FloatArray, law: FloatArray, effects: object) -> list[FloatArray]:
        """Zero columns: there is no strut law."""
        return [np.zeros(len(residual))] * 2

    def noise_of(self, relative: FloatArray, spread: float = 0.0, origin: str = "") -> None:
        """Set the scatter of readings, (m,) relative to their sizes, and a relative `spread` of each element's give."""
        sd, every = np.maximum(relative, LEAST), np.arange(len(relative))
        self.noise = Noise("stated", sd, 0.0, spread, 0.0, OUTLIERS, OUTLIER_WIDTH, STATED_FREEDOM, origin, rest=0.0)
        shared = spread * self.by_element / self.pulls.size[:, None]
        self.scatter = Scatter.of(self.noise, Covariance(sd**2, Groups(every), 0.0, np.ascontiguousarray(shared.T)))

    @cached_property
    def none(self) -> Fit:
        """Fit of the model as it stands, without effects."""
        return base_fit(self, law_free=False)

    @cached_property
    def torsions(self) -> dict[str, tuple[Candidate, float]]:
        """Turning joint -> its torsion as a candidate in place of the file's, and the file's rad/(N m)."""
        effect, torsions = find_effect("joint_torsion"), {}
        for element, load in zip(self.machine.elements, self.pulls.stance.loads, strict=True):
            if turns(element):
                stated = float(np.atleast_2d(load.compliance)[0, 5])
                (parameter,) = (p for p in effect.parameters if not p.discrete)
                component = Component(parameter, False, (-stated, np.inf))
                torsions[element.name] = Candidate(effect, ((ELEMENT, element.name),), (component,)), stated
        return torsions

    @cached_property
    def joints_fitted(self) -> Fit:
        """Fit of the torsions of all turning joints, in place of the file's."""
        candidates = [candidate for candidate, _ in self.torsions.values()]
        start, every = [np.zeros(1)] * len(candidates), range(len(candidates))
        return settled(self, fit_effects(self, candidates, start, every, NO_LAW, self.scatter, law_free=False))

    def candidates(self) -> list[Candidate]:
        """All effects, with their elements, that change these readings; of turning joints, only effects of joints."""
        known = known_effects(self.files, self.machine.kind).values()
        cannot = self.pulls.cannot_test(known)
        every = [c for effect in known if effect.name not in cannot for c in self.candidates_of(effect)]
        return [candidate for candidate in every if self._seen(candidate)]

    def candidates_of(self, effect: Effect) -> list[Candidate]:
        """An effect with each element it may act on, or with each other choice."""
        elements = [e.name for e in self.machine.elements if turns(e) == (effect.link == "joints")]
        carried = {active.values.get(ELEMENT) for active in self.model.effects if active.effect.name == effect.name}
        if carried & {None}:
            return []  # a machine has such an effect only once
        return candidates_of(effect, self.pulls, [name for name in elements if name not in carried])

    def _seen(self, candidate: Candidate) -> bool:
        usual = np.array([component.signs[-1] * min(component.typical()[1], component.reach(component.signs[-1]))
                          for component in candidate.components])  # fmt: skip
        change = self.residual(NO_LAW, [candidate.active(usual)]) - self.observed
        least = VISIBLE if "stands" in candidate.effect.hooks else INVISIBLE
        return bool(np.linalg.norm(change) > least * np.sqrt(len(change)))

    @property
    def typical(self) -> float:
        """Ratio of scatter to size of the readings, root mean squares."""
        return float(np.linalg.norm(self.noise.repeat * self.pulls.size) / np.linalg.norm(self.pulls.size))

    def error_percent(self, residual: FloatArray, wild: Sequence[int] = ()) -> float:
        """Root mean square of (m,) residuals in per cent of that of the readings, all components, without wild ones."""
        error, value = (np.delete(part, wild) for part in (residual * self.pulls.size, self.pulls.value))
        return float(100.0 * np.linalg.norm(error) / np.linalg.norm(value))


def _says_more(fit: Fit, other: Fit, behind: Mapping[str, float]) -> bool:
    """True if an explanation has more parameters than another of the same element but gains too little by them."""
    element, same = (dict(each.candidates[-1].choice).get(ELEMENT) for each in (fit, other))
    more = len(fit.parts) - len(other.parts)
    gained = behind[label_of(other)] - behind[label_of(fit)]
    return element is not None and element == same and more > 0 and gained < PRICE * more


def question(problem: PullProblem) -> str:
    """Reason to doubt that these are pulls of this machine as described; "" if there is none."""
    from scipy.spatial.transform import Rotation

    pulls, best = problem.pulls, problem.joints_fitted if problem.torsions else problem.none
    modelled = pulls.value - best.residual * pulls.size
    alike = float((pulls.value @ modelled) / np.maximum(np.linalg.norm(pulls.value) * np.linalg.norm(modelled), 1e-300))
    if alike < CLOSELY and (told := _in_tip_axes(pulls)):
        return told
    if alike >= FOLLOWS:
        share = float(np.linalg.norm(pulls.value)) / max(float(np.linalg.norm(problem.predicted)), 1e-300)
        if 1.0 / OTHER_UNIT < share < OTHER_UNIT:
            return ""
        return f"Are the units right? What moved is {share:.2g} of what the model says (mm read as um: ux=ux_um:mm)."
    if alike <= -FOLLOWS:
        return "Is this the force on the tool? What moved goes against it: reversed the two would fit."
    text = f"Are these pulls of this machine? Measured and modelled components correlate by {alike:.2f} only."
    # If the sensor's axes were turned: the rotation that brings readings closest to the model (Kabsch 1976, Acta
    # Crystallographica A32, 922).
    read, modelled = pulls.vectors(pulls.value), pulls.vectors(problem.predicted)
    turn = Rotation.align_vectors(modelled, read)[0]
    turned = float((turn.apply(read) * modelled).sum() / max(np.linalg.norm(read) * np.linalg.norm(modelled), 1e-300))
    if turned < FOLLOWS:
        return text
    a, b, c = turn.as_euler("xyz", degrees=True).round(0) + 0.0
    return (
        f"{text} Turned they would by {turned:.2f}: is the sensor in other axes? Roll, pitch, yaw of about {a:g}, "
        f"{b:g}, {c:g} degrees (columns {', '.join(MOVED_AXES)})."
    )


def _in_tip_axes(pulls: Pulls) -> str:
    """Question whether components are in the tip's axes at each pose, if that would halve the error; otherwise ""."""
    turn, length = pulls.stance.rotation, np.linalg.norm(pulls.value)
    if turn is None:
        return ""
    force, read = (
        np.stack([part, np.einsum("nij,nj->ni", turn, part)]) for part in (pulls.wrench[:, :3], pulls.direction)
    )
    modelled = np.einsum("ani,nij,bnj->abn", read, pulls.stance.tip_compliance()[:, :3, :3], force)
    alike = modelled @ pulls.value / np.maximum(length * np.linalg.norm(modelled, axis=-1), 1e-300)
    sensor, pull = np.unravel_index(int(alike.argmax()), alike.shape)
    if 4.0 * (1.0 - alike.max() ** 2) > 1.0 - alike[0, 0] ** 2 or alike.max() < FOLLOWS:
        return ""
    said = ", ".join(f"{name}==tip" for name, turned in zip(FRAMES, (pull, sensor), strict=True) if turned)
    return (
        f"Are components in the tool's axes? In those measured and modelled ones correlate by {alike.max():.2f}, in "
        f'the base\'s by {alike[0, 0]:.2f}: --columns "{said}".'
    )


def label_of(fit: Fit) -> str:
    """Effects and elements: "joint_torsion, joint 3"; "none"."""
    labels = [", ".join(map(str, (c.name, *(v for _, v in c.choice if v not in ("", 0))))) for c in fit.candidates]
    return " + ".join(labels) or NONE


def chi_square(fit: Fit) -> float:
    """Weighted squares of a fit's residuals."""
    return float(fit.scatter.precision.squares(fit.residual))


def chance(problem: PullProblem, fit: Fit) -> float:
    """Probability that scatter makes so large a misfit: as stated, of repeats, or what all candidates together leave.

    What these take away more is held against what they leave (Fisher's F of nested models), a misfit against repeats
    (F, too).
    """
    from scipy.special import chdtrc, fdtrc

    squares, left = chi_square(fit), max(len(fit.residual) - len(fit.free), 1)
    if np.isinf(problem.freedom):
        return float(chdtrc(left, squares))
    if not problem.together:
        return float(fdtrc(left, problem.freedom, squares / left))
    more = max(problem.together - len(fit.free), 1)
    return float(fdtrc(more, problem.freedom, max(squares - problem.freedom, 0.0) / more))


def lack_of_fit(problem: PullProblem, fit: Fit) -> float:
    """Probability of so much in common among a fit's residuals of alike pulls; nan if there are too few.

    Of pulls at one pose along one direction, of whatever size, scatter differs and a misfit does not (Fisher's test:
    Draper and Smith 1998, Applied Regression Analysis, 2.1). What elements scatter by is taken off before.
    """
    from scipy.special import fdtrc

    covariance, groups = fit.scatter.covariance, _alike(problem.pulls)
    own = np.clip(np.sqrt(covariance.own_variance) * fit.scatter.precision.times(fit.residual), -OFF, OFF)
    counts = np.bincount(groups.of)
    mean, several = groups.sums(own) / counts, counts > 1
    freedom, within = int(several.sum()) - len(fit.free), len(own) - len(counts)
    if within < ALIKE_FREEDOM or freedom < 1:
        return np.nan
    apart = float(((own - groups.spread(mean)) ** 2).sum())
    ratio = (counts * mean**2)[several].sum() / freedom * within / max(apart, 1e-300)
    return float(fdtrc(freedom, within, ratio))


def joints_say_more(problem: PullProblem, fit: Fit) -> bool:
    """True if refitting all joints together predicts pose after pose better than an explanation, beyond chance."""
    return bool(problem.torsions) and outvoted(-votes(problem, fit, {JOINTS: problem.joints_fitted})[JOINTS])


def explanations(problem: PullProblem, before: Fit) -> list[Fit]:
    """Each candidate fitted on top of a fit, the likeliest first."""
    fits = [add_effect(problem, before, [candidate], law_free=False) for candidate in problem.candidates()]
    return sorted((fit for fit in fits if fit.sizes[-1].any()), key=lambda fit: -fit.log_posterior)


def _alike(pulls: Pulls, *further: FloatArray) -> Groups:
    """Groups of readings of one pose and component, with forces along one direction, and equal `further` (m, ...)."""
    along = pulls.wrench / np.linalg.norm(pulls.wrench[:, :3], axis=1, keepdims=True)
    labels = [pulls.pose, *(np.round(part / SAME_PULL) for part in (pulls.along, along, *further))]
    return Groups(np.unique(np.column_stack(labels), axis=0, return_inverse=True)[1].reshape(-1))


def between_repeats(problem: PullProblem) -> tuple[FloatArray, int]:
    """(m,) squared relative deviation of each reading from the mean of its repeats, and the number of differences.

    Repeats are alike, their forces too. The squares of n count n / (n - 1) times; nan without repeats, or of copies.
    """
    groups = _alike(problem.pulls, np.log(np.linalg.norm(problem.pulls.wrench[:, :3], axis=1)))
    count = groups.spread(np.bincount(groups.of).astype(float))
    off = problem.observed - groups.spread(groups.sums(problem.observed)) / count
    several = (count > 1) & bool(np.abs(off).max() > LEAST)
    return np.where(several, off**2 * count / np.maximum(count - 1, 1), np.nan), round((1 - 1 / count)[several].sum())


def contradicted(problem: PullProblem) -> bool:
    """True if repeats scatter by more than stated, beyond chance; less is no contradiction, as poses differ besides."""
    squares, differences = between_repeats(problem)
    ratio = np.nanmean(np.minimum(squares / problem.noise.repeat**2, OFF**2)) if differences else 0.0
    chance = CONTRADICTED * np.sqrt(0.5 / STATED_FREEDOM + 0.5 / max(differences, 1))
    return bool(differences >= ALIKE_FREEDOM and ratio > np.exp(2.0 * chance))


def estimate_noise(problem: PullProblem) -> None:
    """Estimate the scatter from repeats or, without enough of them, from what all candidates together leave.

    Each of these has at least its neutral size. A reading's variance is that of its component (an indicator's own) and
    a share of the squared size of its pull: both by weighted squares of what is left (iterated, Davidian and Carroll
    1987, J. Am. Stat. Assoc. 82, 1079).
    """
    from scipy.optimize import nnls

    repeated, differences = between_repeats(problem)
    by_repeats = differences >= ALIKE_FREEDOM
    rows = np.isfinite(repeated) | (not by_repeats)
    changes, least = (np.empty(0), np.empty(0)) if by_repeats else _changes(problem)
    size, names = problem.pulls.size, np.unique(problem.pulls.component)
    variances = np.stack([*(problem.pulls.component == name for name in names), size**2]).astype(float)
    variance, problem.freedom = (GUESSES["high"] * size) ** 2, float(differences)
    for _ in range(REWEIGHTED):
        weight, squares, more = size / np.sqrt(variance), repeated, 1.0
        if not by_repeats:
            columns, observed = changes * weight[:, None], problem.observed * weight
            columns = columns / np.linalg.norm(columns, axis=0).clip(min=1e-300)
            rank = int(np.linalg.matrix_rank(columns))
            if len(observed) - rank < FEWEST:
                break
            sizes = bounded_step(columns.T @ columns, columns.T @ observed, least, np.full(len(least), np.inf))
            squares, more = (problem.observed - columns @ sizes / weight) ** 2, len(observed) / (len(observed) - rank)
            problem.freedom, problem.together = float(len(observed) - rank), rank
        squares = np.minimum(squares * weight**2, OFF**2)[rows]  # in units of the variance so far
        shares = nnls((variances / variance)[:, rows].T, squares)[0] * more
        variance = np.maximum(shares @ variances, (LEAST * size) ** 2)
    share = float(np.sqrt(variance.sum() / (size**2).sum()))
    words = f"{100 * share:.2g} % of the size of the displacements"
    told = f"; {problem.noise.origin} is too little" if problem.noise.origin else ""
    of_repeats = f"estimated from {differences} differences between repeats, {words}{told}"
    words = of_repeats if by_repeats else f"estimated or guessed, {words} (say --noise)"
    problem.noise_of(np.sqrt(variance) / size, problem.noise.strut_spread, words)


def _changes(problem: PullProblem) -> tuple[FloatArray, FloatArray]:
    """(m, k) change of the readings by each candidate's parameters at usual size; (k,) their lower bounds."""
    parts = [(c, j, part) for c in problem.candidates() for j, part in enumerate(c.components)]
    units = [c.active(np.eye(len(c.components))[j] * part.signs[-1] * part.typical()[1]) for c, j, part in parts]
    changes = [problem.observed - problem.residual(NO_LAW, [active]) for active in units]
    return np.stack(changes, axis=1), np.array([-np.inf if len(part.signs) > 1 else 0.0 for *_, part in parts])


def verdict_of(problem: PullProblem, base: Fit, fits: Sequence[Fit], known: bool) -> tuple[str, list[Fit]]:
    """The verdict, in the terms of a hexapod's diagnosis, and the explanations that it leaves.

    "adequate": nothing is missing that shows; "identified": one, which predicts pose after pose better than every
    other one beyond chance; "ambiguous": several; "unexplained": none. `known`: whether somebody states the noise; else
    nothing can be said to be missing from the candidates together, which are what it was estimated by, and nothing is
    named where they leave more than good readings scatter by.
    """
    if question(problem):
        return "unexplained", []
    best = fits[0] if fits else base
    gain = 2.0 * (best.log_posterior - base.log_posterior)
    common = np.nan if known else lack_of_fit(problem, base if gain < GAIN else best)
    fits_alike = not common < COMMON
    if gain < GAIN and chance(problem, base) > WRONG and fits_alike:
        return "adequate", []
    explained = chance(problem, best) >= WRONG and gain >= GAIN and fits_alike
    if not explained or joints_say_more(problem, best):
        return "unexplained", []
    behind = {label_of(fit): 2.0 * (best.log_posterior - fit.log_posterior) for fit in fits}
    ballots = votes(problem, best, {label_of(fit): fit for fit in (base, *fits[1:])})
    alike = [fit for fit in fits if behind[label_of(fit)] < ALIKE]
    standing = [fit for fit in fits[1:] if fit not in alike and not outvoted(ballots[label_of(fit)])]
    more = [fit for fit in (*alike, *standing) if any(_says_more(fit, other, behind) for other in alike)]
    alike, standing = ([fit for fit in some if fit not in more] for some in (alike, standing))
    # Residuals exceed the scatter of good readings, which nothing shows to be scatter; or they hide nearly everything.
    guessed = not known and problem.typical > (GUESSES["low"] if np.isnan(common) else COARSE)
    if guessed or len(alike) > 1 or standing or not outvoted(ballots[NONE]):
        return "ambiguous", [*alike, *standing]
    return "identified", alike
