"""A case: a campaign on a machine that hides something, drawn from a seed, with the truth beside it.

Each purpose has its own stream of random numbers, so that a case and its control (`hidden="none"`) differ by the
effect alone.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.campaign import LAYOUTS, Table, clamp_of, paper_campaign, rows_of, tilted_campaign
from toolpath_stiff.rig.effects import CATALOGUE, with_effect
from toolpath_stiff.rig.hidden import HiddenMachine, Rows, readings
from toolpath_stiff.rig.noise import Nuisances, disturb_machine, disturb_readings, reading_sd
from toolpath_stiff.rig.nominal import Nominal, load_nominal
from toolpath_stiff.rig.outside import ODDITIES, OUTSIDE
from toolpath_stiff.rig.size import Scale
from toolpath_stiff.units import n_per_mm_from_n_per_m

FloatArray = NDArray[np.float64]

# How often a blind draw hides what, where nothing is said (assumed).
BLIND = {"none": 0.2, "one": 0.45, "two": 0.15, "outside": 0.2}

# One stream of random numbers for each purpose, so that a change in one leaves the others as they were.
_STREAMS = ("kind", "campaign", "machine", "noise")


@dataclass(frozen=True)
class Case:
    """A campaign and its truth.

    Attributes
    ----------
    rows
        Measurement table in shop units, in measuring order.
    truth
        What was hidden: `hidden` (names; empty if nothing), `kind`, `effects` with parameters in shop units,
        their `size` (rms change of ln stiffness) and `detectability` (see `size.DETECTABLE`).
    nominal, machine, nuisances
        To measure the same machine again.
    """

    rows: Table
    truth: dict[str, Any]
    nominal: Nominal
    machine: HiddenMachine
    nuisances: Nuisances


def effects_of_layout(layout: str) -> tuple[str, ...]:
    """Effects of the catalogue that a layout has the columns for: the paper's has neither `force_N` nor `time_min`."""
    lacking = ("joint_clearance", "contact_nonlinearity", "thermal_drift") if layout == "paper" else ()
    return tuple(name for name in CATALOGUE if name not in lacking)


def make_case(
    seed: int,
    layout: str = "tilted",
    hidden: str | Sequence[str] | None = None,
    noise: float = 0.02,
    machine: str | Nominal = "nist",
    plan: Mapping[str, Any] | None = None,
    size: float | None = None,
    nuisances: Nuisances | None = None,
) -> tuple[Table, dict[str, Any]]:
    """Rows of a blind campaign and their truth; the same arguments give the same rows.

    Parameters
    ----------
    seed
        0 or more.
    layout
        `paper` (42 rows), `tilted` (288 rows) or `campaign` (the rows of `plan`).
    hidden
        None: drawn blindly; `none`, `one`, `two`, `outside`; or names of effects (oddities included).
    noise
        Relative repeat noise of one reading.
    machine
        Nominal machine: name, file, or as loaded.
    plan
        Table of poses in shop units without stiffness.
    size
        Rms change of ln stiffness that each effect makes, instead of a draw; less where its bound is reached.
    nuisances
        Instead of the standard ones; `noise` is then not used.

    Raises
    ------
    InputError
        Unknown layout, effect or machine; an effect that the layout cannot show.
    """
    case = draw_case(seed, layout, hidden, noise, machine, plan, size, nuisances)
    return case.rows, case.truth


def draw_case(
    seed: int,
    layout: str = "tilted",
    hidden: str | Sequence[str] | None = None,
    noise: float = 0.02,
    machine: str | Nominal = "nist",
    plan: Mapping[str, Any] | None = None,
    size: float | None = None,
    nuisances: Nuisances | None = None,
) -> Case:
    """As `make_case`, with the machine itself."""
    if seed < 0:
        raise InputError(f"seed {seed}", expected="0 or more")
    if nuisances is None:
        if not 0.0 <= noise <= 0.5:
            raise InputError(f"repeat noise of {100.0 * noise:g} %", expected="0 to 50 %")
        nuisances = Nuisances(repeat=noise)
    nominal = load_nominal(machine) if isinstance(machine, str) else machine
    streams = {name: np.random.default_rng([seed, i]) for i, name in enumerate(_STREAMS)}
    table = _campaign(layout, nominal, plan, streams["campaign"])
    names = _names(hidden, layout, table, streams["kind"])
    rows = rows_of(table)
    true, effects = HiddenMachine(), []
    if names:
        scale = Scale(nominal, rows, clamp_of(table), nuisances)
        for name in names:
            # A stream of its own for each effect: sizes of different effects of one seed have nothing in common.
            rng = np.random.default_rng([seed, len(_STREAMS), zlib.crc32(name.encode())])
            parameters, found = scale.draw(name, size, rng)
            true = with_effect(true, name, parameters)
            effects.append({"effect": name, "parameters": parameters, **found})
    true = disturb_machine(true, nuisances, streams["machine"])
    measured = measure(nominal, true, table, rows, nuisances, streams["noise"], stated_sd=layout == "paper")
    outside = any(name in OUTSIDE for name in names)
    truth = {
        "hidden": list(names),
        "kind": "outside" if outside else ("none", "one", "two")[min(len(names), 2)],
        "effects": effects,
    }
    return Case(measured, truth, nominal, true, nuisances)


def measure(
    nominal: Nominal,
    machine: HiddenMachine,
    table: Mapping[str, Any],
    rows: Rows,
    nuisances: Nuisances,
    rng: Generator,
    stated_sd: bool = False,
) -> Table:
    """The table with the column `stiffness_N_per_mm`, and `sd_N_per_mm` if it is to be stated."""
    shown = readings(nominal, machine, rows)
    if not (np.isfinite(shown) & (shown > 0.0)).all():
        bad = int(np.argmin(np.isfinite(shown) & (shown > 0.0))) + 1
        raise InputError(
            f"row {bad}: the indicator would run backwards on the hidden machine",
            hint="use a larger load or zero the indicator later (time_min)",
        )
    stiffness = disturb_readings(shown, clamp_of(table), nuisances, rng)
    measured: Table = {}
    for name, values in table.items():
        measured[name] = values
        if name in ("direction", "dz") and "stiffness_N_per_mm" not in measured:
            measured["stiffness_N_per_mm"] = n_per_mm_from_n_per_m(stiffness)
            if stated_sd and max(nuisances.repeat, nuisances.clamping) > 0.0:
                measured["sd_N_per_mm"] = np.round(n_per_mm_from_n_per_m(reading_sd(stiffness, nuisances)))
    return measured


def again(
    nominal: Nominal,
    machine: HiddenMachine,
    nuisances: Nuisances,
    plan: Mapping[str, Any],
    rng: Generator,
    stated_sd: bool = False,
) -> Table:
    """The same hidden machine measured at a plan: new clamps, new noise; the campaign's clock stands at its end."""
    rows = rows_of(plan, elapsed=np.ones(len(plan["x_mm"])))
    return measure(nominal, machine, plan, rows, nuisances, rng, stated_sd)


def _campaign(layout: str, nominal: Nominal, plan: Mapping[str, Any] | None, rng: Generator) -> Table:
    if layout not in LAYOUTS:
        raise InputError(f"layout {layout!r}", expected=", ".join(LAYOUTS))
    if (layout == "campaign") != (plan is not None):
        raise InputError("layout campaign and a file of poses go together", expected="both, or neither")
    if plan is not None:
        return dict(plan)
    if layout == "paper":
        return paper_campaign()
    try:
        return tilted_campaign(nominal, rng)
    except LookupError as error:
        raise InputError(
            f"machine {nominal.name}: {error}", hint="use layout campaign with poses of your own for this machine"
        ) from None


def _names(hidden: str | Sequence[str] | None, layout: str, table: Table, rng: Generator) -> tuple[str, ...]:
    """Names of what is hidden."""
    if hidden is None:
        hidden = str(rng.choice(list(BLIND), p=list(BLIND.values())))
    known = effects_of_layout(layout)
    if hidden == "none":
        return ()
    if hidden == "one":
        return (str(rng.choice(known)),)
    if hidden == "two":
        first, second = rng.choice(len(known), size=2, replace=False)
        return (known[first], known[second])
    if hidden == "outside":
        return (str(rng.choice(list(ODDITIES) if layout == "paper" else list(OUTSIDE))),)
    names = tuple(hidden.split(",")) if isinstance(hidden, str) else tuple(hidden)
    for name in names:
        if name not in (*CATALOGUE, *OUTSIDE):
            raise InputError(
                f"nothing called {name!r} to hide",
                expected=f"none, one, two, outside, or of {', '.join((*CATALOGUE, *OUTSIDE))}",
            )
    if len(set(names)) < len(names) or sum(name in OUTSIDE for name in names) > 1:
        raise InputError(
            f"hidden effects {', '.join(names)}", expected="each once, and at most one outside the catalogue"
        )
    if "thermal_drift" in names and "time_min" not in table:
        raise InputError(
            "thermal_drift needs the column time_min", expected="layout tilted, or a plan with that column"
        )
    return names
