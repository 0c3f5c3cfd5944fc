"""Pulls on a machine of elements, as the fits of `fits` and the votes of `votes` take readings: no logarithms, no law.

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
from toolpath_stiff.inference.foretold import votes
from toolpath_stiff.inference.least_squares import bounded_step
from toolpath_stiff.inference.noise import STATED_FREEDOM, Noise, Scatter
from toolpath_stiff.inference.repeats import OUTLIER_WIDTH, OUTLIERS
from toolpath_stiff.inference.votes import outvoted
from toolpath_stiff.machine.elements import turns
from toolpath_stiff.readings.pulls import MOVED_AXES, Pulls
from toolpath_stiff.rotations import roll_pitch_yaw
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects
from toolpath_stiff.stiffness.contract import ELEMENT, Effect
from toolpath_stiff.stiffness.model import StiffnessModel, path_of_stance
from toolpath_stiff.units import deg_from_rad

NONE, JOINTS = "none", "joints refitted"
ALIKE = 10.0  # chi-square: an explanation that leaves no more than this beside the best cannot be told from it
GAIN = 16.0  # chi-square that a name must gain over no effect, with some thirty candidates: under 1 in 500 by chance
PRICE = 4.0  # chi-square that a further parameter must gain (one degree of freedom: 5 % by chance)
WRONG = 1e-3  # probability of so large a misfit, below which something else is missing
LEAST = 1e-4  # relative sd of a reading: nobody measures better
FOLLOWS = 0.5  # correlation of measured with modelled components, joints refitted, below which it is another machine's
INVISIBLE = 1e-6  # of the readings' size: what a candidate of its largest usual size must change at least
NO_LAW = np.zeros(2)


class PullProblem(Problem):
    """What a model says to m pulls, and how they scatter."""

    def __init__(self, model: StiffnessModel, pulls: Pulls, files: Sequence[str] = ()) -> None:
        self.model, self.pulls, self.machine, self.files = model, pulls, model.machine, tuple(files)
        seen = model.conditions.columns(len(pulls))
        force = np.linalg.norm(pulls.wrench[:, :3], axis=1)
        path = path_of_stance(model, pulls.stance, force=force, direction=pulls.along[:, :3], **seen)
        rows = [load.rows(pulls.stance.position) for load in pulls.stance.loads]
        loads, read = (
            [np.einsum("nri,ni->nr", part, wrench) for part in rows] for wrench in (pulls.wrench, pulls.along)
        )
        self.path = replace(path, element_loads=np.concatenate(loads, axis=1))
        self.products = [load * other for load, other in zip(loads, read, strict=True)]
        stated = zip(self.products, pulls.stance.loads, strict=True)
        self.by_element = np.stack([(part * load.compliance).sum(axis=1) for part, load in stated], axis=1)
        self.predicted = self.with_effects((*model.effects, *model.instruments), self.by_element.sum(axis=1))
        self.observed = (pulls.value - self.predicted) / pulls.size
        self.noise_of(np.full(len(pulls), LEAST))

    @property
    def point(self) -> TextArray:
        """(m,) the pose of each reading."""
        return self.pulls.point

    def with_effects(self, effects: Sequence[ActiveEffect], moved: FloatArray) -> FloatArray:
        """(m,) m that the readings show: what moved, what effects add, and what instruments make of it."""
        for active in effects:
            if active.effect.is_instrument:
                stiffness = self.path.force / np.maximum(np.abs(moved), 1e-15)
                moved = moved * stiffness / active.reading(stiffness, self.path)
                continue
            form, more = active.adds("load_compliance", self.path), active.adds("element_compliance", self.path)
            if form is not None:
                moved = moved + np.einsum("ni,nij,nj->n", self.pulls.along, form[:, 6:, 6:], self.pulls.wrench)
            if more is not None:
                moved = moved + (more * np.concatenate(self.products, axis=1)).sum(axis=1)
        return moved

    def residual(self, law: FloatArray, effects: Sequence[ActiveEffect]) -> FloatArray:
        """(m,) measured less modelled, of the size of each pull's displacement."""
        machine = sorted(effects, key=lambda active: active.effect.is_instrument)  # which show what all others make
        return np.asarray((self.pulls.value - self.with_effects(machine, self.predicted)) / self.pulls.size)

    def law_columns(self, residual: FloatArray, law: FloatArray, effects: object) -> list[FloatArray]:
        """Nothing: there is no strut law."""
        return [np.zeros(len(residual))] * 2

    def noise_of(self, relative: FloatArray, spread: float = 0.0, origin: str = "") -> None:
        """Scatter of readings by (m,) of their sizes, of elements by a relative `spread` of what each gives."""
        own, every = np.maximum(relative, LEAST), np.arange(len(relative))
        self.noise = Noise("stated", own, 0.0, spread, 0.0, OUTLIERS, OUTLIER_WIDTH, STATED_FREEDOM, origin, rest=0.0)
        shared = spread * self.by_element / self.pulls.size[:, None]
        self.scatter = Scatter.of(self.noise, Covariance(own**2, Groups(every), 0.0, np.ascontiguousarray(shared.T)))

    @cached_property
    def none(self) -> Fit:
        """The model as it stands."""
        return base_fit(self, law_free=False)

    @cached_property
    def torsions(self) -> dict[str, tuple[Candidate, float]]:
        """Joint that turns -> its torsion in place of the file's, and rad/(N m) of that."""
        effect, found = find_effect("joint_torsion"), {}
        for element, load in zip(self.machine.elements, self.pulls.stance.loads, strict=True):
            if turns(element):
                stated = float(np.atleast_2d(load.compliance)[0, 5])
                (parameter,) = (p for p in effect.parameters if not p.discrete)
                component = Component(parameter, False, (-stated, np.inf))
                found[element.name] = Candidate(effect, ((ELEMENT, element.name),), (component,)), stated
        return found

    @cached_property
    def joints_fitted(self) -> Fit:
        """The torsions of all joints that turn fitted in place of the file's."""
        candidates = [candidate for candidate, _ in self.torsions.values()]
        start, every = [np.zeros(1)] * len(candidates), range(len(candidates))
        return settled(self, fit_effects(self, candidates, start, every, NO_LAW, self.scatter, law_free=False))

    def candidates(self) -> list[Candidate]:
        """Every effect with what it may act on that changes these readings: of joints that turn, what joints do."""
        known = known_effects(self.files, self.machine.kind).values()
        cannot = self.pulls.cannot_test(known)
        every = [c for effect in known if effect.name not in cannot for c in self.candidates_of(effect)]
        return [candidate for candidate in every if self._seen(candidate)]

    def candidates_of(self, effect: Effect) -> list[Candidate]:
        """An effect with each element that it may act on, or with each other choice."""
        elements = [e.name for e in self.machine.elements if turns(e) == (effect.link == "joints")]
        carried = {active.values.get(ELEMENT) for active in self.model.effects if active.effect.name == effect.name}
        if carried & {None}:
            return []  # a machine carries it once
        return candidates_of(effect, self.pulls, [name for name in elements if name not in carried])

    def _seen(self, candidate: Candidate) -> bool:
        usual = np.array([component.signs[-1] * min(component.typical()[1], component.reach(component.signs[-1]))
                          for component in candidate.components])  # fmt: skip
        change = self.residual(NO_LAW, [candidate.active(usual)]) - self.observed
        return bool(np.abs(change).max() > INVISIBLE)

    def error_percent(self, residual: FloatArray) -> float:
        """Root mean square of (m,) residuals in m, of that of the readings, all components together."""
        return float(100.0 * np.sqrt(((residual * self.pulls.size) ** 2).sum() / (self.pulls.value**2).sum()))


def _says_more(fit: Fit, other: Fit, behind: Mapping[str, float]) -> bool:
    """Whether an explanation has more parameters than another one of the same element, and gains too little by them."""
    element, same = (dict(each.candidates[-1].choice).get(ELEMENT) for each in (fit, other))
    more = len(fit.parts) - len(other.parts)
    return element is not None and element == same and behind[label_of(other)] - behind[label_of(fit)] < PRICE * more


def question(problem: PullProblem) -> str:
    """Whether these are pulls of this machine, as it is described, with the reason to ask; "" where there is none."""
    pulls, best = problem.pulls, problem.joints_fitted if problem.torsions else problem.none
    modelled = pulls.value - best.residual * pulls.size
    alike = float((pulls.value @ modelled) / np.maximum(np.linalg.norm(pulls.value) * np.linalg.norm(modelled), 1e-300))
    if alike >= FOLLOWS:
        return ""
    text = f"Are these pulls of this machine? Measured and modelled components correlate by {alike:.2f} only."
    # Were the sensor's axes turned: the turn that brings it nearest to the model as given (Kabsch 1976, Acta
    # Crystallographica A32, 922).
    rows = np.unique(np.char.add(pulls.file, pulls.line.astype(str)), return_inverse=True)[1].reshape(-1)
    read, said = np.zeros((2, rows.max() + 1, 3))
    np.add.at(read, rows, pulls.value[:, None] * pulls.direction)
    np.add.at(said, rows, problem.predicted[:, None] * pulls.direction)
    left, _, right = np.linalg.svd(read.T @ said)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    turned = float((read @ turn * said).sum() / max(np.linalg.norm(read) * np.linalg.norm(said), 1e-300))
    if turned < FOLLOWS:
        return text
    a, b, c = deg_from_rad(roll_pitch_yaw(turn.T[None])[0]).round(0) + 0.0
    return (
        f"{text} Turned they would by {turned:.2f}: is the sensor in other axes? Roll, pitch, yaw of about {a:g}, "
        f"{b:g}, {c:g} degrees (columns {', '.join(MOVED_AXES)})."
    )


def label_of(fit: Fit) -> str:
    """Effects and elements: "joint_torsion, joint 3"; "none"."""
    labels = [", ".join(map(str, (c.name, *(v for _, v in c.choice if v not in ("", 0))))) for c in fit.candidates]
    return " + ".join(labels) or NONE


def chi_square(fit: Fit) -> float:
    """Weighted squares of what a fit leaves."""
    return float(fit.scatter.precision.squares(fit.residual))


def explanations(problem: PullProblem, before: Fit) -> list[Fit]:
    """Each candidate fitted on top of a fit, the likeliest first."""
    fits = [add_effect(problem, before, [candidate], law_free=False) for candidate in problem.candidates()]
    return sorted((fit for fit in fits if fit.sizes[-1].any()), key=lambda fit: -fit.log_posterior)


def share_left(problem: PullProblem) -> float:
    """Relative sd of a reading by what all candidates together leave, each of at least its neutral size."""
    units = [
        candidate.active(np.eye(len(candidate.components))[j] * component.signs[-1] * component.typical()[1])
        for candidate in problem.candidates()
        for j, component in enumerate(candidate.components)
    ]
    columns = np.stack([problem.observed - problem.residual(NO_LAW, [active]) for active in units], axis=1)
    scale = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(scale > 0.0, scale, 1.0)
    none, all_of_it = np.zeros(columns.shape[1]), np.full(columns.shape[1], np.inf)
    left = problem.observed - columns @ bounded_step(columns.T @ columns, columns.T @ problem.observed, none, all_of_it)
    freedom = max(len(left) - int(np.linalg.matrix_rank(columns)), 1)
    return max(float(np.sqrt(left @ left / freedom)), LEAST)


def verdict_of(problem: PullProblem, base: Fit, fits: Sequence[Fit], known: bool) -> tuple[str, list[Fit]]:
    """The verdict as a diagnosis of a hexapod has it, and the explanations that it leaves.

    "adequate": nothing is missing that shows; "identified": one, which foretells pose after pose better than every
    other one beyond chance; "ambiguous": several; "unexplained": none. `known`: whether somebody states the noise; else
    nothing can be said to be missing from the candidates, which are what it was estimated by.
    """
    from scipy.stats import chi2

    if question(problem):
        return "unexplained", []
    count, best = len(base.residual), fits[0] if fits else base
    gain = 2.0 * (best.log_posterior - base.log_posterior)
    if gain < GAIN and chi2.sf(chi_square(base), count) > WRONG:
        return "adequate", []
    explained = chi2.sf(chi_square(best), max(count - len(best.free), 1)) >= WRONG and gain >= GAIN
    if explained and problem.torsions:  # no name where all joints together say far more
        explained = not outvoted(-votes(problem, best, {JOINTS: problem.joints_fitted})[JOINTS])
    if not explained and known:
        return "unexplained", []
    behind = {label_of(fit): 2.0 * (best.log_posterior - fit.log_posterior) for fit in fits}
    ballots = votes(problem, best, {label_of(fit): fit for fit in (base, *fits[1:])})
    alike = [fit for fit in fits if behind[label_of(fit)] < ALIKE]
    standing = [fit for fit in fits[1:] if fit not in alike and not outvoted(ballots[label_of(fit)])]
    more = [fit for fit in (*alike, *standing) if any(_says_more(fit, other, behind) for other in alike)]
    alike, standing = ([fit for fit in some if fit not in more] for some in (alike, standing))
    if not explained or len(alike) > 1 or standing or not outvoted(ballots[NONE]):
        return "ambiguous", [*alike, *standing]
    return "identified", alike
