"""The steps from readings to a verdict, all on this page, a function and a type for each.

| step | function | gives |
| --- | --- | --- |
| read | `measurements.read_measurements` | `Readings`: as columns |
| noise | `noise.noise_models` | `Noise`: how far readings scatter for reasons that no model explains |
| | `evidence.Problem.of` | `Problem`: readings, model and scatter together |
| candidates | `find_candidates` | `Candidates`: every effect fitted as far as a table of its compliance goes |
| fits | `fits.refine` | `Fit`: the likely ones once more with the model itself |
| gates | `apply_gates` | `Gates`: which explanations leave no more than noise would |
| probabilities | `weigh` | of those that pass |
| verdict | `decide` | `Judgement`: the verdict, the explanations that hold the truth, all of the above |

`judge` takes the steps from the candidates on, under one noise model; `diagnosis.diagnose` all of them, under each
noise model that the data allow.

Two gates. Absolute: a hypothesis must leave residuals that its own noise explains. Relative: among those that do, the
posterior probabilities decide; only a name far ahead of all others is given as the answer.

adequate      nothing is missing that these data could show
identified    one effect (or pair) explains the data, far likelier than any other
described     the same, but its form was read off these very readings, and no others have confirmed it (`drawn`)
ambiguous     several explain them, and none is far likelier than the others
unexplained   something is missing, and nothing in the catalogue accounts for it; or the readings do not look as if
              they were of this machine at all (`question`)
"""

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import comb

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.adequacy import LEFT, instead_of_law, is_small, may_leave
from toolpath_stiff.inference.discrepancies import discrepancy_forms
from toolpath_stiff.inference.doubts import noise_doubt, question
from toolpath_stiff.inference.drawn import Drawn, drawn
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fair_forms import fair_rivals
from toolpath_stiff.inference.fits import refine
from toolpath_stiff.inference.gates import Forms, Gate, absolute_gate, simulate
from toolpath_stiff.inference.hypotheses import Family, discrepancy_evidence, probabilities, score_families, signatures
from toolpath_stiff.inference.left_out import HeldOut, held_out
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.nuisances import TAKEN_UP, not_told
from toolpath_stiff.inference.prequential import carried, votes
from toolpath_stiff.inference.rivals import entries, lowers_error, rivals_of
from toolpath_stiff.inference.several import search_pairs
from toolpath_stiff.inference.unexcluded import Unexcluded, not_excluded
from toolpath_stiff.inference.votes import Votes, closest, outvoted
from toolpath_stiff.stiffness.contract import Effect

NONE = "none"
OUTSIDE = "outside the catalogue"
# What is expected before anything is measured; assumed. Whoever measures has a reason, but most machines are sound.
PRIOR_NONE, PRIOR_SINGLES, PRIOR_PAIRS, PRIOR_OUTSIDE = 0.30, 0.50, 0.10, 0.10
FALSE_ALARM = 0.05  # false alarms of the base model's gate
ADEQUATE = 0.005  # below this probability an explanation does not explain the data
MOST_OPEN = 3  # most entries that an ambiguous verdict lists; the document has all votes
NAMED = 0.90  # probability from which a single name is the answer
HELD = 0.95  # probability that the plausible set adds up to where it is not a single name
STANDS = 0.05  # probability from which something outside the catalogue, or another pair, is not ruled out
TESTED = 4  # candidates, besides all those that matter, that go through the absolute gate
FAR = 8.0  # log evidence behind the best adequate candidate at which the others cannot matter
SURVIVES = 3.0  # log evidence by which a pair must beat each of its members alone
# Odds below which a second effect is not considered where one suffices: "positive" evidence begins at 3 (Kass and
# Raftery 1995, Bayes factors).
POSITIVE = 3.0


@dataclass(frozen=True)
class Judgement:
    """Verdict of the data under one noise model, with its grounds.

    Attributes
    ----------
    verdict
        See above.
    explanations
        Hypotheses, the most likely first, that hold the truth with 95 % probability: effects, `none`, "a + b".
    problem, noise
        Data and scatter.
    base, base_gate
        The model with its strut law refitted, and its absolute test.
    families
        All effects, most likely first.
    gates, fits
        Effect (or "a + b") -> its absolute test and final fit, where they were made.
    pairs
        Pairs tried, most likely first.
    probability
        Hypothesis -> posterior probability: effects, `none`, "a + b", `OUTSIDE`. Hypotheses that fail the absolute gate
        have none unless nothing passes.
    form
        The form of discrepancy that stands out, in words; "" if none was looked for.
    question
        Whether these are readings of this machine, and why it is asked; "" where nothing says that they are not.
    doubt, noise_factor
        That the noise is not what was stated; "" where nothing says so. And how many times as large a stated one would
        have to be for the model alone to leave what it leaves; 1 where it may be right, or repeats tell.
    drawn
        How the answer stands if its form was read off these readings; None otherwise.
    votes
        Of the first explanation with an effect against each rival of another part, the closest first (`votes`).
    """

    verdict: str
    explanations: tuple[str, ...]
    problem: Problem
    noise: Noise
    base: Fit
    base_gate: Gate
    families: tuple[Family, ...]
    gates: dict[str, Gate]
    fits: dict[str, Fit]
    pairs: tuple[Fit, ...]
    probability: dict[str, float]
    form: str
    question: str = ""
    doubt: str = ""
    noise_factor: float = 1.0
    drawn: Drawn | None = None
    votes: Votes = field(default_factory=dict)

    @property
    def plausible(self) -> tuple[str, ...]:
        """Names of the effects in `explanations`, each once."""
        return tuple(dict.fromkeys(name for explanation in self.explanations for name in explanation.split(" + ")))

    @property
    def likely(self) -> list[tuple[str, float]]:
        """Hypotheses with their probabilities, the most likely first."""
        return sorted(self.probability.items(), key=lambda item: (-item[1], item[0]))

    @property
    def likeliest(self) -> Fit:
        """Fit of the likeliest hypothesis left standing; if none is, of the closest."""
        for name in self.explanations:
            if name == NONE or name in self.fits:
                return self.fits.get(name, self.base)
        return max(self.fits.values(), key=lambda fit: fit.log_posterior, default=self.base)


def judge(problem: Problem, noise: Noise, effects: Sequence[Effect], seed: int) -> Judgement:
    """Search all candidates, test them, and come to a verdict under one noise model.

    Parameters
    ----------
    problem, noise
        Readings, model and scatter; the noise model behind the scatter.
    effects
        What may be missing.
    seed
        Of the simulated readings.
    """
    candidates = find_candidates(problem, noise, effects)
    gates = apply_gates(problem, noise, candidates, seed)
    probability, form = weigh(problem, noise, candidates, gates)
    doubtful = question(problem.predictor)
    voted = ("unexplained", (), {}) if doubtful else put_to_vote(problem, noise, candidates, gates, probability)
    verdict, explanations, ballots = voted
    doubt, factor = ("", 1.0) if doubtful else noise_doubt(problem, noise, gates.base, verdict, seed)
    described = None
    if verdict == "identified":
        described = drawn(gates.fits[explanations[0]], {NONE: candidates.base, **gates.fits}, problem.predictor.data)
        verdict = verdict if described is None or described.confirmed else "described"
    return Judgement(
        verdict, explanations, problem, noise, candidates.base, gates.base, candidates.families, gates.by_name,
        gates.fits, gates.tried, probability, form, doubtful, noise.remark or doubt, factor, described, ballots,
    )  # fmt: skip


@dataclass(frozen=True)
class Candidates:
    """All effects searched, on tables of added compliance.

    Attributes
    ----------
    base
        The model with its strut law refitted, without a further effect.
    families
        All effects that do something to these data, the most likely first.
    forms
        Forms that a discrepancy may take which no effect describes.
    within
        Effects of which there is no more than the nuisances assume of every joint and strut: no explanations.
    """

    base: Fit
    families: tuple[Family, ...]
    forms: Forms
    within: tuple[str, ...] = ()

    @property
    def hidden(self) -> list[Family]:
        """Effects that may be there unseen, beside what the nuisances assume."""
        return [family for family in self.families if family.name not in self.within]

    @property
    def offered(self) -> list[tuple[Family, Fit]]:
        """Effects that fit best when they are there, with that fit."""
        return [(family, family.best) for family in self.hidden if family.best is not None]


def find_candidates(problem: Problem, noise: Noise, effects: Sequence[Effect]) -> Candidates:
    """Fit every effect with each of its choices beside the strut law."""
    base = problem.score_base()
    forms = Forms(discrepancy_forms(problem.predictor), problem.scatter.precision)
    return Candidates(base, tuple(score_families(problem, effects, base)), forms, not_told(base, noise))


@dataclass
class Gates:
    """Explanations that leave no more than noise would.

    Attributes
    ----------
    base
        The absolute test of the model without a further effect.
    none_stands
        Whether that model stays in the running.
    singles, pairs
        Effects that pass, the most likely first; pairs that pass and beat each of their members.
    tried
        All pairs that were fitted, the most likely first.
    by_name, fits
        Effect (or "a + b") -> its absolute test; its fit with the model itself. Made for those that need it.
    """

    base: Gate
    none_stands: bool = True
    singles: tuple[str, ...] = ()
    pairs: tuple[Fit, ...] = ()
    tried: tuple[Fit, ...] = ()
    by_name: dict[str, Gate] = field(default_factory=dict)
    fits: dict[str, Fit] = field(default_factory=dict)

    @property
    def enough(self) -> bool:
        """True if the model explains the data without a further effect."""
        return self.base.probability > FALSE_ALARM


def apply_gates(problem: Problem, noise: Noise, candidates: Candidates, seed: int) -> Gates:
    """Test the model alone, then single effects, then pairs; of likely pairs, those that beat both members and pass."""
    draws = simulate(noise, problem.scatter.covariance, seed)
    base, families, forms = candidates.base, candidates.families, candidates.forms
    signs = signatures(problem, (table for family in families for table in family.tables))
    # With the law's prior, as in the simulations: a law dragged far off by a missing effect is no fit.
    gain = max((2.0 * (f.best.log_posterior - base.log_posterior) for f in families if f.best), default=0.0)
    gates = Gates(absolute_gate(problem, base.residual, base.jacobian, draws, forms, signs, gain))
    if gates.enough:
        return gates

    def passes(name: str, fit: Fit) -> bool:
        fit = gates.fits[name] = refine(problem, fit)
        gates.by_name[name] = absolute_gate(problem, fit.residual, fit.jacobian, draws, forms)
        return gates.by_name[name].probability > ADEQUATE

    singles: list[Family] = []
    for count, (family, best) in enumerate(candidates.offered):
        if count >= TESTED and (not singles or family.log_evidence < singles[0].log_evidence - FAR):
            break
        if passes(family.name, best):
            singles.append(family)
    gates.singles = tuple(family.name for family in singles)
    evidence, tried = {family.name: family.log_evidence for family in families}, []
    # What stands out beside no effect may do so beside one.
    within = {*candidates.within}.intersection(*(not_told(fit, noise) for fit in gates.fits.values()))
    found = search_pairs(problem, [f for f in families if f.name not in within], base)
    for k, fit in enumerate(found):
        pair = fit
        matters = k < TESTED or fit.log_evidence > found[0].log_evidence - FAR
        if matters and fit.log_evidence > max(evidence[name] for name in fit.names) + SURVIVES:
            passed = passes(fit.name, fit)
            # Tables omit the interaction of two effects; the final fit gives its gain in likelihood.
            more = gates.fits[fit.name].log_posterior - fit.log_posterior
            pair = replace(fit, log_evidence=fit.log_evidence + more)
            gates.pairs += (pair,) if passed else ()
        tried.append(pair)
    gates.tried = tuple(sorted(tried, key=lambda fit: (-fit.log_evidence, fit.name)))
    # The base model stays in the running if only the best candidate's gain speaks against it, not its residuals.
    gates.none_stands = gates.base.own_probability > ADEQUATE
    return gates


def weigh(problem: Problem, noise: Noise, candidates: Candidates, gates: Gates) -> tuple[dict[str, float], str]:
    """Probabilities of the explanations that pass, 0 for those kept out; a further effect only at odds of 3 to 1.

    Where no single effect passes, something outside the catalogue is weighed, too: then with the form of discrepancy
    that stands out, in words, else "".
    """
    if gates.enough:
        return _posterior(problem, noise, candidates, True, [f.name for f in candidates.hidden]), ""
    outside, form = (-np.inf, "") if gates.singles else _outside(problem, candidates)

    def posterior(standing: Sequence[Fit]) -> dict[str, float]:
        if gates.singles:
            return _posterior(problem, noise, candidates, gates.none_stands, gates.singles, standing)
        evidences = {OUTSIDE: outside} | {several.name: several.log_evidence for several in standing}
        prior = {several.name: _prior(candidates.families, len(several.names)) for several in standing}
        return probabilities(evidences, {OUTSIDE: PRIOR_OUTSIDE} | prior)

    posteriors = _sparing(gates, posterior)
    if gates.pairs and posteriors.get(OUTSIDE, 1.0) < STANDS:  # ruled out
        del posteriors[OUTSIDE]
    return posteriors, form


def _sparing(gates: Gates, posterior: Callable[[Sequence[Fit]], dict[str, float]]) -> dict[str, float]:
    """Probabilities without pairs that contain the best effect, unless pairs are likely enough; other pairs stay."""
    weights = posterior(gates.pairs)
    best = max(gates.singles, key=lambda name: weights[name], default="")
    if not best or sum(weights[pair.name] for pair in gates.pairs) >= POSITIVE * weights[best]:
        return weights
    return posterior([pair for pair in gates.pairs if best not in pair.names])


def _outside(problem: Problem, candidates: Candidates) -> tuple[float, str]:
    """Log evidence for something missing that is outside the catalogue, and its likeliest form.

    Alone, or beside one of the two best effects. That a further one is missing beside an effect is as rare as of two
    effects, and it may be any of them: who picks the best of fifteen without that price makes the unknown too likely.
    """
    price = float(np.log(PRIOR_PAIRS / PRIOR_SINGLES / max(len(candidates.families), 1)))
    outside = [discrepancy_evidence(problem, candidates.base, candidates.forms)]
    for _, best in candidates.offered[:2]:
        evidence, form = discrepancy_evidence(problem, best, candidates.forms)
        outside.append((evidence + price, form))
    return float(np.logaddexp.reduce([evidence for evidence, _ in outside])), max(outside, key=lambda pair: pair[0])[1]


def _posterior(
    problem: Problem,
    noise: Noise,
    candidates: Candidates,
    none: bool,
    names: Sequence[str],
    pairs: Sequence[Fit] = (),
) -> dict[str, float]:
    """Probabilities of the base model (if it stands), of single effects and of pairs; 0 for all others."""
    hypotheses = {NONE: (candidates.base.log_evidence, candidates.base)}
    hypotheses |= {family.name: (family.log_evidence, family.best or candidates.base) for family in candidates.families}
    hypotheses |= {pair.name: (pair.log_evidence, pair) for pair in pairs}
    prior = {NONE: PRIOR_NONE} if none else {}
    prior |= {name: _prior(candidates.families, 1) for name in names}
    prior |= {pair.name: _prior(candidates.families, len(pair.names)) for pair in pairs}
    return probabilities({name: _with_unknown_noise(problem, noise, *of) for name, of in hypotheses.items()}, prior)


def _prior(families: Sequence[Family], count: int) -> float:
    """Prior probability of one effect, or of one pair."""
    return {1: PRIOR_SINGLES, 2: PRIOR_PAIRS}[count] / max(comb(len(families), count), 1)


def _with_unknown_noise(problem: Problem, noise: Noise, log_evidence: float, fit: Fit) -> float:
    """Log evidence if the size of the noise is itself known only to `noise.freedom` degrees of freedom.

    Integrated over it, the normal likelihood exp(-q / 2) of the weighted squares q of n readings becomes Student's,
    (1 + q / freedom)^(-(freedom + n) / 2): many readings that fit badly say as much of the noise as of the model.
    """
    if not np.isfinite(noise.freedom):
        return log_evidence
    squares = -2.0 * fit.log_likelihood - problem.scatter.covariance.log_determinant
    student = (noise.freedom + len(fit.residual)) * float(np.log1p(max(squares, 0.0) / noise.freedom))
    return log_evidence + 0.5 * squares - 0.5 * student


def decide(gates: Gates, posterior: Mapping[str, float]) -> tuple[str, tuple[str, ...]]:
    """Verdict, and hypotheses that hold the truth with 95 % probability, the most likely first."""
    if gates.enough:
        likely = _smallest_set(posterior)
        return "adequate", likely if NONE in likely else (*likely, NONE)
    if gates.singles:
        named = "identified" if max(posterior.values()) >= NAMED else "ambiguous"
        # Above one half, the evidence against the model is more likely chance than any effect.
        return "adequate" if posterior[NONE] > 0.5 else named, _smallest_set(posterior)
    if OUTSIDE in posterior:
        return "unexplained", ()
    if max(posterior.values()) >= NAMED and sum(weight > STANDS for weight in posterior.values()) == 1:
        return "identified", _smallest_set(posterior)
    return "ambiguous", _smallest_set(posterior, named=HELD)


def put_to_vote(
    problem: Problem, noise: Noise, candidates: Candidates, gates: Gates, probability: Mapping[str, float]
) -> tuple[str, tuple[str, ...], Votes]:
    """Verdict and explanations (`decide`) after the votes of the readings, and the votes for the first explanation.

    What lowers no error at left-out points is no answer, nor is a second effect that lowers none, or that the form of
    the first may stand for. A name that has not outvoted every rival of another part, or leaves more than the model
    alone may, is one of several: beside it stand those that are likely, the others and what a strut law that had to
    move may stand for, the closest votes first. A model that passes is not the only explanation where its nuisances
    have taken up more than they may, or where more may be left than an adequate one leaves; what the larger of two
    guessed noises would hide is told instead.
    """
    verdict, explanations = decide(gates, probability)
    base, ballots, lost, left_out = candidates.base, dict[str, FloatArray](), set[str](), dict[str, HeldOut]()
    fits = {NONE: base} | {family.name: best for family, best in candidates.offered}
    fits |= {pair.name: pair for pair in gates.tried if pair.possible} | gates.fits
    if verdict == "adequate":
        settled = noise.guess == "high" or may_leave(problem, noise, candidates.hidden, base) <= LEFT
        taken_up = [name for name in TAKEN_UP if name in fits]
        likely = standing = [*dict.fromkeys([NONE, *taken_up, *(() if settled else explanations)])]
    elif verdict in ("identified", "ambiguous"):
        left_out = {name: held_out(fits[name], problem.point) for name in {NONE, *explanations}}
        found = [n for n in explanations if n == NONE or lowers_error(left_out[NONE], left_out[n])]
        standing = [*dict.fromkeys(carried(problem, fits, gates.singles, name) for name in found)]
        verdict = "identified" if len(standing) == 1 < len(found) else verdict
        top = next((name for name in standing if name != NONE), NONE)
        if top == NONE and not gates.none_stands:
            return "unexplained", (), {}
        if top == NONE:
            verdict, standing = "ambiguous", [*dict.fromkeys([*explanations, NONE])]
            likely = standing
        else:
            rivals = {name: fit for name, fit in fits.items() if name != NONE or gates.none_stands}
            ballots = _votes_of_few(problem, candidates.families, fits[top], rivals_of(fits[top], rivals))
            ballots = closest(ballots, votes(problem, fits[top], fair_rivals(problem, fits[top], base)))
            lost = {name for name, differences in ballots.items() if outvoted(differences)}
            lacking = gates.by_name[top].probability <= FALSE_ALARM
            open_rivals = [name for name in ballots if name not in lost] or [*ballots][: int(lacking)]
            open_pairs = [pair for pair in gates.tried if pair.name in open_rivals and pair.name not in gates.fits]
            gates.fits |= {pair.name: refine(problem, pair) for pair in open_pairs}
            fits |= gates.fits
            likely = standing
            verdict, standing = "ambiguous" if open_rivals else verdict, [top, *standing, *open_rivals]
            if verdict == "ambiguous" and gates.none_stands and is_small(problem, base, [fits[n] for n in likely]):
                standing.append(NONE)
    else:
        return verdict, explanations, {}
    instead, of_law = instead_of_law(problem, fits[likely[0]])
    gates.fits |= instead
    if verdict == "adequate" and len(standing) == 1 and not instead:
        return verdict, explanations, {}
    ballots = closest(ballots, of_law)
    # What noise would hide is told where the law had to move, but for what its votes rule out.
    further = [name for name in explanations if instead and verdict == "adequate" and name not in of_law]
    if verdict == "ambiguous" or (instead and verdict == "identified"):  # no longer alone: what else is as likely
        likely_too = [n for n in _smallest_set(probability, named=HELD) if n not in (*explanations, *lost, NONE)]
        further = [n for n in likely_too if lowers_error(left_out[NONE], held_out(fits[n], problem.point))]
    order = dict.fromkeys([*standing, *instead, *further])
    return (
        "ambiguous" if instead or verdict == "adequate" else verdict,
        shortened(problem, fits | instead, _closest_first([*order], verdict, ballots, lost, probability)),
        ballots,
    )


def _closest_first(
    names: Sequence[str], verdict: str, ballots: Votes, lost: Container[str], probability: Mapping[str, float]
) -> list[str]:
    """Explanations with the first one first and the others as close to it as the readings have them."""
    first, *others = names

    def behind(name: str) -> tuple[bool, float]:
        """Sort key: votes; without votes (part of the first) the odds; beside a model that passes, chance alone."""
        if name in ballots:
            return name in lost, float(ballots[name].sum())
        if verdict == "adequate":
            return False, -np.inf if name in TAKEN_UP else np.inf
        return False, float(np.log(max(probability.get(first, 0.0), 1e-300) / max(probability.get(name, 0.0), 1e-300)))

    return [first, *sorted(others, key=behind)]


def _votes_of_few(
    problem: Problem, families: Sequence[Family], fit: Fit, rivals: Mapping[str, Fit]
) -> dict[str, FloatArray]:
    """Votes for an explanation; a rival of more effects is one of so many more, whose prior weight counts, too."""
    own = _prior(families, len(fit.names))
    return {
        name: gain + np.log(max(own / _prior(families, max(len(rivals[name].names), 1)), 1.0)) / len(gain)
        for name, gain in votes(problem, fit, rivals).items()
    }


def shortened(problem: Problem, fits: Mapping[str, Fit], names: Sequence[str]) -> tuple[str, ...]:
    """Explanations in the first `MOST_OPEN` entries; the model alone stays in any case."""
    groups = entries(problem, fits, tuple(dict.fromkeys(names)))
    kept = groups[:MOST_OPEN]
    kept[-1:] = [group for group in groups[MOST_OPEN:] if NONE in group] or kept[-1:]
    return tuple(name for group in kept for name in group)


def unexcluded(judgement: Judgement) -> tuple[Unexcluded, ...]:
    """Largest size of each further effect that may go unseen beside the likeliest explanation.

    A further effect is as likely beforehand as one effect is beside none, or a pair beside one of its effects. Where
    the readings say nothing of it, it keeps that probability: a few per cent. So it is in no set that holds the truth
    with 95 %, and a name stays a name.
    """
    name = next((name for name in judgement.explanations if name == NONE or name in judgement.fits), "")
    if not name:
        return ()
    one, two = (_prior(judgement.families, count) for count in (1, 2))
    odds = one / PRIOR_NONE if name == NONE else two / one
    return tuple(not_excluded(judgement.problem, judgement.families, judgement.fits.get(name, judgement.base), odds))


def _smallest_set(posterior: Mapping[str, float], named: float = NAMED) -> tuple[str, ...]:
    """The one hypothesis that holds `named` of the probability; otherwise the fewest that hold `HELD`."""
    ranked = sorted(posterior.items(), key=lambda item: (-item[1], item[0]))
    if ranked and ranked[0][1] >= named:
        return (ranked[0][0],)
    before = np.cumsum([0.0, *(weight for _, weight in ranked)]).tolist()
    return tuple(name for (name, weight), held in zip(ranked, before, strict=False) if held < HELD and weight > 0.0)
