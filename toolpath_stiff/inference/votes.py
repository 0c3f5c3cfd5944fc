"""Evaluation of votes of poses between two explanations (`prequential`): beyond chance or not, in words and as data.

A rival is outvoted where the sum of them is

- more than `SMALL`: below, two models predict so much alike that the spread of the differences says little of the
  error of their sum (Sivula, Magnusson, Matamoros and Vehtari 2020, Uncertainty in Bayesian leave-one-out
  cross-validation based model comparison, arXiv 2008.10296);
- above 0 in all but `CHANCE` of the draws of a Bayesian bootstrap over the poses (Rubin 1981), which unlike a standard
  error sees where one pose carries it all; or still more than `SMALL` without the pose that says most.
"""

from collections.abc import Mapping

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document, json_number

SMALL = 4.0
CHANCE = 0.05  # one-sided
DRAWS = 2000
CERTAIN = 4  # decimals of a vote on which all processors agree
FEWEST_POSES = 6  # below this, the spread over poses is unknown
Votes = Mapping[str, FloatArray]  # rival -> (poses,) log predictive density of the explanation above the rival's


def closest(*ballots: Votes) -> dict[str, FloatArray]:
    """Votes against each rival, the lowest of several ballots, the closest rival first."""
    names = {name for votes_for in ballots for name in votes_for}
    strongest = {
        name: min((votes_for[name] for votes_for in ballots if name in votes_for), key=np.sum) for name in sorted(names)
    }
    return dict(sorted(strongest.items(), key=lambda item: (round(float(item[1].sum()), CERTAIN - 1), item[0])))


def chance_of_losing(differences: FloatArray) -> float:
    """Share of draws of a Bayesian bootstrap over poses in which the sum of votes (poses,) is not above 0."""
    if len(differences) < FEWEST_POSES:
        return 1.0
    weights = np.random.default_rng(0).dirichlet(np.ones(len(differences)), DRAWS)
    return float((weights @ differences <= 0.0).mean())


def outvoted(differences: FloatArray) -> bool:
    """True if votes (poses,) are against the rival beyond chance."""
    gain, most = float(differences.sum()), float(differences.max(initial=0.0))
    even = len(differences) >= FEWEST_POSES and gain - most > SMALL
    return even or (gain > SMALL and chance_of_losing(differences) <= CHANCE)


def standard_error(differences: FloatArray) -> float:
    """Standard error of the sum of votes (poses,), paired by pose."""
    return float(np.sqrt(len(differences)) * differences.std(ddof=1)) if len(differences) > 1 else float("nan")


def vote_document(rival: str, differences: FloatArray) -> Document:
    """Votes against a rival as an entry of diagnose.json."""
    return {
        "rival": rival,
        "gain": json_number(float(differences.sum()), 3),
        "standard_error": json_number(standard_error(differences), 3),
        "chance": json_number(chance_of_losing(differences), 2),
        "outvoted": outvoted(differences),
    }


def vote_words(rival: str, differences: FloatArray) -> str:
    """Votes against a rival as a clause."""
    gain, error = float(differences.sum()), standard_error(differences)
    return f"{rival} predicts pose after pose {'worse' if gain > 0.0 else 'better'} by {abs(gain):.1f} +- {error:.1f}"
