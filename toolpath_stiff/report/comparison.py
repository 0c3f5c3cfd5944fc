"""Two machines on the same program, in figures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

FIGURES = ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "mean_deflection_um")


def compare_summaries(summary: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """The entry `compare` of `summary.json`.

    The other machine's figures, and `difference_percent`: how much higher each is than the first machine's
    (None where a figure is missing, or the first machine's is zero).
    """
    difference = {}
    for name in FIGURES:
        first, second = summary.get(name), other.get(name)
        difference[name.partition("_N_per")[0].removesuffix("_um")] = (
            None if first is None or second is None or not first else (second - first) / first * 100.0
        )
    return {
        "machine": other["machine"],
        **{name: other.get(name) for name in FIGURES},
        "weakest": other.get("weakest"),
        "out_of_reach_samples": other.get("out_of_reach_samples"),
        "extrapolated_share": other.get("extrapolated_share"),
        "difference_percent": difference,
    }
