"""What to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import COMMON, Data, NoisePercent, Question, Seed, StrutSpread
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import Option, checked, distinct_numbers, finite_number, names, words_of
from toolpath_stiff.planning.menu import COSTS, Menu
from toolpath_stiff.planning.result import Plan
from toolpath_stiff.planning.result import plan as plan_visits
from toolpath_stiff.results import one_of
from toolpath_stiff.units import m_from_mm, rad_from_deg


@checked
def plan(
    data: Data | None = None,
    machine: Machine | str | Path = "nist",
    *,
    between: Annotated[Sequence[str], Option("--between", "A,B", read=names)] = (),
    n: Annotated[int | None, Option("--n")] = None,
    radius_mm: Annotated[float | None, Option("--radius", "mm", above=0, at_most=1e5)] = None,
    heights_mm: Annotated[Sequence[float] | None, Option("--heights", "Z,Z,...", read=distinct_numbers)] = None,
    max_tilt_deg: Annotated[float | None, Option("--max-tilt", "deg", at_least=0, below=90)] = None,
    loads_N: Annotated[Sequence[float] | None, Option("--loads", "N,N,...", read=distinct_numbers)] = None,
    tool_extensions_mm: Annotated[Sequence[float] | None, Option("--tools", "MM,MM,...", read=distinct_numbers)] = None,
    setups: Annotated[Sequence[str] | None, Option("--setups", "NAME,...", read=names)] = None,
    indicators: Annotated[bool, Option("--indicators")] = False,
    minutes: Annotated[Mapping[str, float] | None, Option("--cost", "WHAT=MINUTES", read=_cost, count="append")] = None,
    columns: Mapped = None,
    noise_percent: NoisePercent = None,
    strut_spread_percent: StrutSpread = 1.0,
    seed: Seed = 0,
    diagnosis: Diagnosis | None = None,
) -> Plan:
    """What to measure next to tell explanations apart; without data, what to measure first.

    Parameters
    ----------
    data, machine
        The machine; measurements, or the files that hold them; None before the first campaign.
    between
        Effects to tell apart, or "none"; unless given, what a diagnosis of the data leaves standing.
    n
        Poses; unless given 6, or 24 of a first campaign.
    radius_mm
        How far poses may lie from the axis; unless given, 300 mm.
    heights_mm
        Of the tool tip; unless given, five levels.
    max_tilt_deg
        Of the spindle; unless given, 25 degrees.
    loads_N
        Unless given, 500, 1000, 4000 and those of the data.
    tool_extensions_mm
        Tools, longer than the reference tool by; the first is in the spindle. Unless given, as last, and 150.
    setups
        The first is on the table; unless given, those of the data.
    indicators
        Take a second indicator across a link of the load path where that tells more.
    minutes
        What work costs: of a "reading" (1), a "pose" (15), another "tool" (10), another "setup" (45), a second
        "indicator" (10).
    columns
        As of `compare`.
    noise_percent, strut_spread_percent, seed
        As of `compare`.
    diagnosis
        A diagnosis of the same data; it is not made again then.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read; an unknown effect, no reachable pose, a number that cannot be.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.plan(machine="nist", between=("spindle_compliance", "none"), n=2)
    >>> found
    <Plan: rivals, 2 clampings>
    >>> len(found.to_dict()["visits"]), found.to_frame().columns.tolist()[:6]
    (2, ['x_mm', 'y_mm', 'z_mm', 'a_deg', 'b_deg', 'c_deg'])
    >>> list(found.files(plots=False)), len(found.rows) == len(found.to_frame())
    (['plan.csv', 'plan.json'], True)
    """
    line = words_of(plan, {name: value for name, value in locals().items() if name not in COMMON})
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    minutes = {name: float(value) for name, value in (minutes or {}).items()}
    for name, value in minutes.items():
        one_of("minutes", name, tuple(COSTS))
        if not value >= 0.0:
            raise InputError(f"{name}={value:g}", expected="minutes, 0 or more")
    readings = None if question.data is None else question.readings
    menu = Menu.of(readings).with_options(
        radius=None if radius_mm is None else m_from_mm(radius_mm),
        heights=_in_metres(heights_mm),
        max_tilt=None if max_tilt_deg is None else rad_from_deg(max_tilt_deg),
        loads=loads_N,
        tool_extensions=_in_metres(tool_extensions_mm),
        setups=setups,
        indicators=indicators,
        costs={**COSTS, **minutes},
    )
    judgement = None if diagnosis is None else diagnosis.main
    proposal = plan_visits(
        question.model, readings, menu, between=tuple(between), n=n, judgement=judgement, **question.common
    )
    return replace(proposal, names=question.files, line=question.request.command("plan", *line), inputs=question.inputs)


def _cost(text: str) -> tuple[str, float]:
    """`pose=15`."""
    name, _, value = text.partition("=")
    return name, finite_number(value)


def _in_metres(values_mm: Sequence[float] | None) -> tuple[float, ...] | None:
    return None if values_mm is None else tuple(m_from_mm(float(value)) for value in values_mm)
