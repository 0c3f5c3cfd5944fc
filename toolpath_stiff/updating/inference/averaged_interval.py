"""Intervals of sizes that do not take the choice of an effect's components for granted.

Which components of an effect are at zero is itself uncertain: a table that gives way along X, Y and Z may fit as well
as one along X and Z that rocks, with sizes far apart. An interval from the likeliest subset alone holds the truth in
eight cases of ten. Averaged over the subsets by their posterior probabilities (Hoeting, Madigan, Raftery and Volinsky
1999, Bayesian model averaging, Statistical Science 14, 382) it says what is known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.inference.ranking import Family

FloatArray = NDArray[np.float64]

SHARE = 0.95
HALVINGS = 60  # of the bracket about a quantile


def averaged_interval(family: Family, j: int) -> FloatArray | None:
    """(2,) 95 % interval of the size of component `j`, over the subsets of components of the best choice.

    Normal within the bounds where a subset holds the component, 0 where it does not. None where the effect has no
    subsets.
    """
    if family.best is None or len(family.subsets) < 2:
        return None
    logs = np.array([score.log_evidence + weight for score, weight in family.subsets])
    shares = np.exp(logs - logs.max())
    shares /= shares.sum()
    low, high = family.best.candidates[0].components[j].bounds
    parts, absent = [], 0.0
    for (score, _), share in zip(family.subsets, shares, strict=True):
        if j in score.free:
            at = 2 + score.free.index(j)
            sd = float(np.sqrt(max(score.covariance[at, at], 1e-300)))
            parts.append((float(share), float(score.sizes[0][j]), sd))
        else:
            absent += float(share)
    if not parts:
        return np.zeros(2)
    far = max(abs(size) + 8.0 * sd for _, size, sd in parts)
    bracket = (max(low, -far), min(high, far))
    tail = 0.5 * (1.0 - SHARE)
    return np.array([_quantile(parts, absent, bracket, share) for share in (tail, 1.0 - tail)])


def _quantile(
    parts: list[tuple[float, float, float]], absent: float, bracket: tuple[float, float], share: float
) -> float:
    """Size up to which the mixture of cut-off normals (share, mean, sd) and of zero holds `share`."""
    from scipy.special import ndtr

    def below(size: float) -> float:
        total = absent if size >= 0.0 else 0.0
        for part, mean, sd in parts:
            first, last, here = ((x - mean) / sd for x in (*bracket, size))
            total += part * float((ndtr(here) - ndtr(first)) / max(ndtr(last) - ndtr(first), 1e-300))
        return total

    low, high = bracket
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) < share else (low, middle)
    return 0.0 if abs(high) <= 1e-12 * (bracket[1] - bracket[0]) else high
