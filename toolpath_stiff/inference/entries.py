"""Entries of a list of explanations: what sits at one place, or is the same to every reading of the tip, is one."""

from collections.abc import Mapping, Sequence
from itertools import combinations

from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import fit_effects, without_zeros
from toolpath_stiff.inference.rivals import INSTRUMENT, part_of
from toolpath_stiff.inference.votes import SMALL
from toolpath_stiff.stiffness.contract import Effect

MOST_OPEN = 3  # most entries that an ambiguous verdict lists; the document has all votes
# Effects that carry the tip's whole force to the floor as one body on springs (`contract.body_on_springs`), and effects
# that move the point which is loaded and read along the tool.
ONE_BODY = ("table_compliance", "frame_sway", "stand_compliance")
SAME_AT_TIP = (ONE_BODY, ("tool_length_error", "indicator_off_tip"))
SERIES = "joint_compliance"  # the effect that a wrong strut law may stand for, in series with every strut
TWINS = 0.05  # votes below which two explanations are the same to these readings


def place_of(effect: Effect) -> str:
    """Place where a user would look for an effect: its link; of instruments and geometry, the effect itself."""
    if any(effect.name in same for same in SAME_AT_TIP):
        return at_tip(effect.name)[0]
    return effect.name if effect.link in (INSTRUMENT, "geometry") else part_of(effect)


def entries(problem: Problem, fits: Mapping[str, Fit], names: Sequence[str]) -> list[tuple[str, ...]]:
    """Explanations grouped where they sit at the same places and votes on these readings could not tell them apart.

    In the order of `names`. One of several of a group at once belongs to it; one that is in no `fits` stands alone, but
    for one of a group with an effect exchanged (`exchanged`). The votes between two that differ by d in whitened
    residuals come to d^2 / 2 where one of them is true. A refitted law sits where `SERIES` does beside the file's.
    """
    groups: list[tuple[str, ...]] = []

    def belongs(name: str, group: Sequence[str]) -> bool:
        if {*name.split(" + ")} <= {*group}:
            return True
        if name in fits:
            return group[0] in fits and alike(problem, fits[name], fits[group[0]])
        return at_tip(name) in map(at_tip, group)

    for name in names:
        k = next((k for k, group in enumerate(groups) if belongs(name, group)), len(groups))
        groups[k : k + 1] = [(*(groups[k] if k < len(groups) else ()), name)]
    return groups


def _at_once(group: Sequence[str], fits: Mapping[str, Fit]) -> list[str]:
    """Pairs of single effects of an entry: of springs in series that read alike, the readings tell only the sum."""
    single = sorted(name for name in group if name in fits and len(fits[name].names) == 1)
    return [" + ".join(pair) for pair in combinations(single, 2)]


def at_tip(name: str) -> tuple[str, ...]:
    """Effects of an explanation, for those of `SAME_AT_TIP` the first of them."""
    return tuple(sorted(next((same[0] for same in SAME_AT_TIP if part in same), part) for part in name.split(" + ")))


def exchanged(
    problem: Problem, fits: Mapping[str, Fit], singles: Sequence[str], groups: Sequence[Sequence[str]]
) -> list[str]:
    """Explanations of entries with one effect exchanged for another of `SAME_AT_TIP`, if readings tell no difference.

    Which of these a search comes upon is chance: its evidence prefers the one with the fewest parameters, and it does
    not look at a pair that holds the likeliest effect as it looks at others.
    """
    found = dict[str, bool]()
    for first, fit in ((group[0], fits[name]) for group in groups for name in group if name in fits):
        for k, member in enumerate(fit.names):
            same = next((names for names in SAME_AT_TIP if member in names), ())
            for single in (fits[name] for name in singles if name in {*same} - {*fit.names}):
                name = " + ".join(sorted([*fit.names[:k], *fit.names[k + 1 :], *single.names]))
                if not found.get(name):
                    other = fits.get(name) or _exchanged(problem, fit, k, single)
                    found[name] = alike(problem, other, fits[first])
    return [name for name, reads_alike in found.items() if reads_alike]


def _exchanged(problem: Problem, fit: Fit, k: int, single: Fit) -> Fit:
    """Fit with its effect k exchanged for that of a single fit."""
    candidates = (*fit.candidates[:k], *single.candidates, *fit.candidates[k + 1 :])
    sizes = (*fit.sizes[:k], *single.sizes, *fit.sizes[k + 1 :])
    free = tuple(range(sum(len(size) for size in sizes)))
    return without_zeros(fit_effects(problem, candidates, sizes, free, fit.law, fit.scatter, fit.law_free))


def alike(problem: Problem, fit: Fit, other: Fit) -> bool:
    """True if two explanations sit at the same places and read alike, or are the same to these readings."""

    def places(fit: Fit) -> list[str]:
        return sorted(place_of(c.effect) for c in fit.candidates if fit.law_free or c.name != SERIES)

    apart = float(problem.scatter.precision.squares(fit.residual - other.residual))
    twins = TWINS if fit.candidates and other.candidates else 0.0
    return 0.5 * apart <= (SMALL if places(fit) == places(other) else twins)


def shortened(problem: Problem, fits: Mapping[str, Fit], names: Sequence[str], always: str) -> tuple[str, ...]:
    """Explanations in the first `MOST_OPEN` entries, and the one that stays in any case. Last, several of an entry."""
    groups = entries(problem, fits, tuple(dict.fromkeys(names)))
    kept = groups[:MOST_OPEN]
    kept[-1:] = [group for group in groups[MOST_OPEN:] if always in group] or kept[-1:]
    together = [pair for group in kept for pair in _at_once(group, fits)]
    return tuple(dict.fromkeys([name for group in kept for name in group] + together))
