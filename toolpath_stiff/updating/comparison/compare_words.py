"""Findings of a comparison as sentences, and those that hold under every noise model."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.updating.comparison.residual_patterns import sentence
from toolpath_stiff.updating.comparison.residual_structure import SIGNIFICANT, Found, Pattern, Structure
from toolpath_stiff.updating.comparison.residual_variables import Variable
from toolpath_stiff.updating.inference.baseline import errors_text

FloatArray = NDArray[np.float64]

MOST_ALIKE = 6  # patterns named as not to be told apart


def as_finding(
    found: Found,
    step: int,
    structure: Structure,
    refitted: Structure | None,
    looked_for: list[Pattern],
    numbers: list[Variable],
    residual: FloatArray,
) -> dict[str, Any]:
    """A finding as compare.json has it."""
    pattern = looked_for[found.pattern]
    text, size = sentence(found, pattern, {one.name: one for one in numbers}, residual, step == 0)
    entry: dict[str, Any] = {
        "text": text,
        "statistic": found.statistic,
        "p_adjusted": found.p_adjusted,
        "pattern": pattern.name,
        "variable": pattern.variable,
        "direction": pattern.direction,
        "kind": pattern.kind,
        "readings": int(pattern.rows.sum()),
        "size_percent": size,
        "not_told_from": [*pattern.same, *(looked_for[j].name for j in found.alike)][:MOST_ALIKE],
    }
    if refitted is not None:
        test = next((t for t in refitted.tests if t.pattern == found.pattern), None)
        entry["after_strut_law_refit"] = (
            None if test is None else {"statistic": test.statistic, "p_adjusted": test.p_adjusted}
        )
    return entry


def merged_findings(
    by_noise: dict[str, list[dict[str, Any]]], tests: dict[str, dict[str, float]]
) -> list[dict[str, Any]]:
    """Findings that hold under every noise model, with the larger of their probabilities."""
    fewest = min(by_noise, key=lambda name: len(by_noise[name]))
    kept = []
    for one in by_noise[fewest]:
        others = [tests[name].get(one["pattern"], 1.0) for name in by_noise if name != fewest]
        worst = max([one["p_adjusted"], *others])
        if worst < SIGNIFICANT:
            kept.append({**one, "p_adjusted": worst})
    return kept


def overall_text(document: dict[str, Any]) -> str:
    """Error, bias and what scatter explains, in a few sentences."""
    figures = document["baseline"]
    bias, refit = figures["bias_percent"], figures["strut_law_refitted"]
    text = (
        f"Mean error {errors_text(figures['mean_abs_error_percent'], refit and refit['mean_abs_error_percent'])} "
        f"({document['readings']} reading{'' if document['readings'] == 1 else 's'}). As given, {_balance(bias)}, "
        f"rms {figures['rms_percent']:.1f} %."
    )
    parts = []
    for noise in document["noise"]:
        name = noise["name"]
        scatter, share = figures["scatter_rms_percent"][name], figures["explained_by_scatter_percent"][name]
        p = figures["probability"][name]
        guesses = {"low": "with the low guess of the noise", "high": "with the high guess"}
        known = guesses.get(name, f"with the noise as {name}")
        parts.append(
            f"{known}, scatter alone would leave {scatter:.1f} % rms, {share:.0f} % of the mean square (p = {p:.2g})"
        )
    text += " " + "; ".join(parts)[0].upper() + "; ".join(parts)[1:] + "."
    if not document["findings"]:
        text += " No pattern stands out from scatter."
    return text


def _balance(bias: float) -> str:
    """To which side the machine differs from its model, %."""
    if abs(bias) < 0.05:
        return "neither softer nor stiffer than modelled on balance"
    return f"{abs(bias):.1f} % {'softer' if bias < 0.0 else 'stiffer'} than modelled on balance"
