"""A comparison for the terminal, and its residuals as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from toolpath_stiff.report.wording import DEVIATION, MINUS_IS_SOFTER, plain
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m
from toolpath_stiff.updating.comparison import Comparison
from toolpath_stiff.updating.comparison.residuals import directions, planes
from toolpath_stiff.updating.inference.fits import deviation_percent

MOST_NAMED = 5  # readings far off, on the terminal


def terminal_text(document: Mapping[str, Any]) -> str:
    """Errors, findings, checks, in lines."""
    lines = [document["text"], ""]
    lines += _table(document)
    base, refit = document["baseline"], document["baseline"]["strut_law_refitted"]
    if refit:
        gain = round(base["mean_abs_error_percent"] - refit["mean_abs_error_percent"], 2)
        first, second = refit["strut_law"]["N_per_um"]
        lines += [
            "",
            f"strut law refitted: {refit['mean_abs_error_percent']:.2f} % mean error, "
            f"{refit['bias_percent']:+.1f} % bias, rms {refit['rms_percent']:.1f} % "
            f"({first:.1f} / {second:.1f} N/um)" + ("" if gain > 0.0 else ": nothing gained"),
        ]
    lines += ["", "findings"]
    lines += [f"  {plain(one['text'])} (p = {one['p_adjusted']:.2g})" for one in document["findings"]]
    if not document["findings"]:
        lines.append("  none: no pattern stands out from scatter. The strongest hints:")
        lines += [f"  - {plain(one['text'])} (p = {one['p_adjusted']:.2g})" for one in document["hints"]]
    for one in document["findings"]:
        if one["not_told_from"]:
            others = ", ".join(one["not_told_from"])
            lines.append(f"  ({plain(one['pattern'])} looks the same here as: {plain(others)})")
    lines += ["", "checks without a model"]
    lines += [f"  {plain(one['text'])}" for one in document["model_free"]["checks"]]
    lines += [f"  {one['check']}: {one['reason']}" for one in document["model_free"]["cannot_check"]]
    if document["far_off"]:
        lines += ["", "readings far off"]
        lines += [
            f"  {plain(one['file'])}:{one['line']}: {one['direction']} at point {plain(one['point'])}, "
            f"{one['off_percent']:+.0f} % with the findings taken out "
            f"({one['standard_deviations']:+.1f} standard deviations)"
            for one in document["far_off"][:MOST_NAMED]
        ]
        if len(document["far_off"]) > MOST_NAMED:
            lines.append(f"  and {len(document['far_off']) - MOST_NAMED} more, in compare.json")
    lines += [""] + [f"warning: {plain(text)}" for text in document["warnings"]]
    lines += [f"note: {plain(text)}" for text in document["notes"]]
    return "\n".join(line for i, line in enumerate(lines) if line or lines[i - 1 : i] != [""]).rstrip() + "\n"


def _table(document: Mapping[str, Any]) -> list[str]:
    """Errors by direction, plane and set-up."""
    rows = [("all readings", document["baseline"])]
    for title, key in (("direction", "by_direction"), ("", "by_plane"), ("set-up", "by_setup")):
        levels = document[key]
        if len(levels) > 1:
            rows += [(f"{title} {plain(name) or '(none)'}".strip(), figures) for name, figures in levels.items()]
    noise = document["noise"][-1]["name"]
    width = max(len(name) for name, _ in rows)
    head = f"{'':<{width}}  readings  mean error   bias    rms  scatter alone"
    lines = ["machine file as given; bias: mean of " + f"{DEVIATION}, {MINUS_IS_SOFTER}", head]
    return lines + [
        f"{name:<{width}}  {one['readings']:>8}  {one['mean_abs_error_percent']:>8.2f} % {one['bias_percent']:>+6.1f} "
        f"{one['rms_percent']:>6.1f}  {one['scatter_rms_percent'][noise]:>9.1f} rms"
        for name, one in rows
    ]


def _with_unit(name: str, unit: str) -> str:
    """A heading: "tilt_deg", unless the name says the unit already."""
    suffix = unit.replace("/", "_per_").replace("%", "percent")
    return name if name.endswith(suffix) else f"{name}_{suffix}"


def residuals_csv(found: Comparison) -> str:
    """One row a reading: measured, modelled, deviation, scatter, every variable that residuals were held against."""
    data = found.data
    own = [one for one in found.numbers if one.name not in ("x", "y", "height", "order")]
    head = [
        "file", "line", "point", "setup", "clamp", "plane", "direction", "x_mm", "y_mm", "z_mm", "a_deg", "b_deg",
        "c_deg", "dx", "dy", "dz", "measured_N_per_mm", "modelled_N_per_mm", "deviation_percent", "scatter_percent",
        *(_with_unit(one.name, one.unit) for one in own),
    ]  # fmt: skip
    along, where = directions(data), planes(data)
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(head)
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        modelled = float(n_per_mm_from_n_per_m(np.exp(found.log_model[i])))
        table.writerow(
            [
                data.file[i], data.line[i], data.point[i], data.setup[i], data.clamp[i], where[i], along[i],
                *(f"{value + 0.0:.6g}" for value in pose),
                f"{measured:.1f}", f"{modelled:.1f}", f"{float(deviation_percent(found.residual[i])):.3f}",
                f"{100.0 * found.scatter[i]:.3f}",
                *("" if np.isnan(one.values[i]) else f"{one.values[i]:.6g}" for one in own),
            ]
        )  # fmt: skip
    return out.getvalue()
