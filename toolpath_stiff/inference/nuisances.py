"""Nuisances taken up by a fit: struts unlike the others, displaced joints.

Strut spread and joint errors are counted as scatter that all readings share, so a joint that is far off its place can
leave a model that passes. Given the readings, their values are the best linear predictions b = S P r (Henderson 1975),
with S one standard deviation of each, P the inverse covariance of what a fit leaves and r its residuals. Where the
nuisance is what it is taken for, b is normal with covariance S P S^T: that says how far one stands out.
"""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import BoolArray
from toolpath_stiff.defaults import MEAN_OVER_SD
from toolpath_stiff.documents import Document, json_number
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.units import mm_from_m

FINDING = 3.0  # standard deviations from which a nuisance is a finding
TAKEN_UP = {"joint_offset": "joint", "weak_strut": "strut"}  # effects that nuisances take up, of which kind
STRUTS = 6
ENDS = ("frame", "platform")


def fitted_nuisances(fit: Fit, noise: Noise) -> list[Document]:
    """Each strut and joint with its fitted deviation, the most conspicuous first.

    `sigma` is the normal deviate of the chance that the most deviant of all of them would deviate as much (Bonferroni);
    `times_assumed` the largest fitted deviation in assumed standard deviations.
    """
    from scipy.special import gammaincc, ndtri

    shared = fit.scatter.covariance.shared
    weighted = fit.projected.times(shared)
    fitted, spread = weighted @ fit.residual, weighted @ shared.T
    blocks = [np.array([strut]) for strut in range(STRUTS)]
    blocks += [STRUTS + 3 * joint + np.arange(3) for joint in range(2 * STRUTS)]
    entries: list[Document] = []
    for k, rows in enumerate(blocks):
        own, values = spread[np.ix_(rows, rows)], fitted[rows]
        squares = float(values @ np.linalg.pinv(own, hermitian=True) @ values)
        chance = min(1.0, len(blocks) * float(gammaincc(0.5 * len(rows), 0.5 * squares)))
        sigma = round(-float(ndtri(0.5 * max(chance, 1e-300))), 3) + 0.0
        entries.append(
            {
                "nuisance": "joint" if k >= STRUTS else "strut",
                "strut": k % STRUTS + 1,
                "end": ENDS[k // STRUTS - 1] if k >= STRUTS else "",
                "offset_mm": [json_number(x, 3) for x in mm_from_m(noise.joint_error * values).tolist() if k >= STRUTS],
                "stiffness_percent": None if k >= STRUTS else json_number(100.0 * noise.strut_spread * values[0], 3),
                "times_assumed": json_number(float(np.abs(values).max()), 3),
                "sigma": json_number(sigma, 3),
            }
        )
    return sorted(entries, key=lambda entry: -entry["sigma"])


def mean_left_by_nuisances(fit: Fit, rows: BoolArray) -> float:
    """Mean relative error at some readings due to struts, joints and links that differ from the model's.

    As they are known from the readings: fitted ones, and what stays open of each.
    """
    shared = fit.scatter.covariance.shared
    weighted = fit.projected.times(shared)
    open_of_each = np.eye(len(shared)) - weighted @ shared.T
    squares = (weighted @ fit.residual @ shared) ** 2 + np.einsum("qn,qr,rn->n", shared, open_of_each, shared)
    return float(MEAN_OVER_SD * np.sqrt(squares[rows]).mean())


def findings(entries: Sequence[Document]) -> list[Document]:
    """Entries that deviate further than chance and than is assumed."""
    return [entry for entry in entries if entry["sigma"] > FINDING and entry["times_assumed"] > 1.0]


def not_told(fit: Fit, noise: Noise) -> tuple[str, ...]:
    """Effects of which there is no more beside a fit than the nuisances assume."""
    told = {entry["nuisance"] for entry in findings(fitted_nuisances(fit, noise))}
    return tuple(name for name, nuisance in TAKEN_UP.items() if nuisance not in told)


def nuisance_words(entry: Document) -> str:
    """A nuisance as a clause."""
    where, sigma = f"strut {entry['strut']}", f"{entry['sigma']:.2g} standard deviations of chance"
    if entry["nuisance"] == "strut":
        percent = entry["stiffness_percent"]
        return f"{where} is fitted {abs(percent):.2g} % too {'stiff' if percent > 0.0 else 'soft'} ({sigma})"
    off = float(np.linalg.norm(entry["offset_mm"]))
    return f"the joint of {where} on the {entry['end']} is fitted {off:.2g} mm off its place ({sigma})"
