"""An update for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

from toolpath_stiff.report.wording import machine_text, plain

WIDTH = 110


def terminal_text(document: Mapping[str, Any]) -> str:
    """Ladder, errors by direction before and after, parameters, what was turned down."""
    lines = [
        f"data     {document['readings']} readings of {', '.join(plain(name) for name in document['data'])}, "
        f"machine {machine_text(document)}",
        fill(f"result   {document['verdict'].upper()}. {plain(document['text'])}", WIDTH, subsequent_indent=" " * 9),
        "",
        *_ladder(document),
        "",
        *_by_direction(document),
    ]
    parameters = _parameters(document)
    if parameters:
        lines += ["", *parameters]
    if document["turned_down"]:
        lines += ["", "tried and not added"]
        for one in document["turned_down"]:
            lines.append(fill(f"  {one['effect']}: {'; '.join(one['reasons'])}", WIDTH, subsequent_indent=" " * 4))
    lines += [""] + [f"warning: {plain(text)}" for text in document["warnings"]]
    lines += [f"note: {plain(text)}" for text in document["notes"]]
    return "\n".join(lines).rstrip()


def _ladder(document: Mapping[str, Any]) -> list[str]:
    steps = document["steps"]
    width = max(len(step["name"]) for step in steps)
    found = [f"{'':<{width}}  error %  left out %  gain/SE"]
    for step in steps:
        gain = step.get("held_out_gain_in_se")
        found.append(
            f"{plain(step['name']):<{width}}  {step['mean_abs_error_percent']:>7.2f}  "
            f"{_figure(step['held_out_error_percent'], 10)}  {_figure(gain, 7, 1)}"
        )
    found.append(
        f"{'noise floor':<{width}}  {document['noise_floor_percent']:>7.2f}  ({plain(document['noise']['origin'])})"
    )
    return found


def result_step(document: Mapping[str, Any]) -> Mapping[str, Any]:
    """The model that comes out: the last step, the machine file as given where nothing is added."""
    found: Mapping[str, Any] = document["steps"][0 if document["verdict"] == "nothing added" else -1]
    return found


def _by_direction(document: Mapping[str, Any]) -> list[str]:
    first, last = document["steps"][0]["by_direction"], result_step(document)["by_direction"]
    found = ["direction  readings  as given %  after %  left out %"]
    for name, before in first.items():
        after = last[name]
        found.append(
            f"{name:<9}  {before['readings']:>8}  {before['mean_abs_error_percent']:>10.2f}  "
            f"{after['mean_abs_error_percent']:>7.2f}  {_figure(after['held_out_error_percent'], 10)}"
        )
    return found


def _parameters(document: Mapping[str, Any]) -> list[str]:
    last = result_step(document)
    found = []
    if last["strut_law_N_per_um"][0]["sd"] is not None:
        ends = " and ".join(
            f"{end['stiffness']:.1f} +- {end['sd']:.1f} N/um at {end['length_mm']:.1f} mm"
            for end in last["strut_law_N_per_um"]
        )
        found.append(f"strut law  {ends}")
    for effect, entry in last["parameters"].items():
        for key, value in entry.items():
            if isinstance(value, Mapping):  # what it acts on stands in the ladder
                low, high = (_value(end) for end in value["interval"])
                found.append(f"{effect}  {key} = {_value(value['value'])}   95 %: {low} to {high}")
    return found


def _value(value: float | None) -> str:
    return "inf" if value is None else f"{value:.4g}"


def _figure(value: float | None, width: int, digits: int = 2) -> str:
    return f"{'-':>{width}}" if value is None else f"{value:>{width}.{digits}f}"
