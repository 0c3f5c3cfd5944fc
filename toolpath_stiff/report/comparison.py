"""Two machines on the same program, in figures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

FIGURES = ("mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "mean_deflection_um")


def compare_summaries(summary: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """The entry `compare` of `summary.json`.

    The other machine's figures, and `difference_percent`: how much higher each is than the first machine's
    (None where a figure is missing, or the first machine's is zero); the same for the mean of the plunges.
    """
    difference = {
        name.partition("_N_per")[0].removesuffix("_um"): _higher(summary.get(name), other.get(name)) for name in FIGURES
    }
    plunges = [(one.get("plunges") or {}).get("mean_N_per_mm") for one in (summary, other)]
    return {
        "machine": other["machine"],
        "effects": list(other.get("effects") or ()),
        **{name: other.get(name) for name in FIGURES},
        "weakest": other.get("weakest"),
        "out_of_reach_samples": other.get("out_of_reach_samples"),
        "extrapolated_share": other.get("extrapolated_share"),
        "difference_percent": difference,
        "headline": other.get("headline"),
        "plunges": other.get("plunges"),
        "plunges_difference_percent": _higher(*plunges),
    }


def _higher(first: float | None, second: float | None) -> float | None:
    """By how much the second is higher, in percent of the first; None where that cannot be said."""
    return None if first is None or second is None or not first else (second - first) / first * 100.0
