"""A case: a campaign on a machine that hides something, drawn from a seed, with the truth beside it.

The size of an effect is drawn log-uniform as the root mean square change of the readings' logarithm, from just
detectable on that campaign (see `DETECTABLE`) to 30 %, as far as the effect's bounds allow.
"""

from __future__ import annotations

import dataclasses
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.campaign import LAYOUTS, Table, clamp_of, paper_campaign, rows_of, tilted_campaign
from toolpath_stiff.rig.effects import CATALOGUE, at_strength, draw_shape, with_effect
from toolpath_stiff.rig.hidden import HiddenMachine, Rows, readings
from toolpath_stiff.rig.noise import Nuisances, disturb_machine, disturb_readings, reading_sd
from toolpath_stiff.rig.nominal import Nominal, load_nominal
from toolpath_stiff.rig.outside import ODDITIES, OUTSIDE
from toolpath_stiff.units import n_per_mm_from_n_per_m

FloatArray = NDArray[np.float64]

LARGEST = 0.30  # rms change of ln stiffness
# Whitened length of an effect's signature, beside strut law and nuisances, that is found with 80 % power at 5 %
# among some twenty candidates: z(1 - 0.0025/2) + z(0.8) = 3.02 + 0.84 (normal quantiles, Bonferroni).
DETECTABLE = 3.9
# How often a blind draw hides what, where nothing is said (assumed).
BLIND = {"none": 0.2, "one": 0.45, "two": 0.15, "outside": 0.2}
FREE_LAW = 1.0  # prior sd of the logarithms of the two strut stiffnesses: free, next to 2 % noise

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
        their `size` (rms change of ln stiffness) and `detectability` (whitened signature, `DETECTABLE` is 80 % power).
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
        scale = _Scale(nominal, rows, clamp_of(table), nuisances)
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


class _Scale:
    """How large an effect shows on one campaign, and its strength for a wanted size."""

    def __init__(self, nominal: Nominal, rows: Rows, clamps: NDArray[np.int64], nuisances: Nuisances) -> None:
        self.nominal, self.rows = nominal, rows
        self.vertices = int(nominal.vertices.max()) + 1
        self.setups = sorted(set(rows.setup.tolist()))
        self.base = np.log(readings(nominal, HiddenMachine(), rows))
        self.whiten = _whitener(self, clamps, nuisances)

    def change(self, machine: HiddenMachine) -> FloatArray:
        """(n,) change of ln stiffness; infinite where an indicator would run backwards."""
        shown = readings(self.nominal, machine, self.rows)
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log(shown)
        return np.where(np.isfinite(logs), logs - self.base, math.inf)

    def draw(self, name: str, size: float | None, rng: Generator) -> tuple[dict[str, Any], dict[str, float]]:
        """Parameters, and their size and detectability."""
        shape = draw_shape(name, rng, self.vertices, self.setups)
        fraction = rng.random()
        strength, change = self._reach(name, shape, 0.03)
        rms, seen = _rms(change), self._detectability(change)
        if size is None:
            # To first order both grow in proportion to the strength.
            smallest = min(max(rms * DETECTABLE / max(seen, 1e-12), 1e-4), LARGEST)
            size = smallest * (LARGEST / smallest) ** fraction
        strength, change = self._reach(name, shape, size, start=strength)
        parameters = {
            key: float(f"{value:.4g}") if isinstance(value, float) else value
            for key, value in at_strength(name, shape, strength).items()
        }
        return parameters, {"size": _rms(change), "detectability": self._detectability(change)}

    def _reach(self, name: str, shape: Mapping[str, Any], size: float, start: float = 0.02) -> tuple[float, FloatArray]:
        """Strength in (0, 1] at which the rms change is `size` within 2 %, and that change; 1 if no strength does.

        The change grows about in proportion to the strength, so scaling the strength by what is missing converges.
        """
        low, high, strength = 0.0, 1.0, start
        change = np.zeros(len(self.base))
        for _ in range(12):
            change = self.change(with_effect(HiddenMachine(), name, at_strength(name, shape, strength)))
            rms = _rms(change)
            if abs(rms - size) <= 0.02 * size or (rms < size and strength == 1.0):
                break
            low, high = (strength, high) if rms < size else (low, strength)
            wanted = strength * size / rms if 0.0 < rms < math.inf else 0.5 * strength
            # Where the last step overshot the bracket, halve it.
            strength = min(wanted, 1.0) if low < wanted < high or high == 1.0 else 0.5 * (low + high)
        return strength, change

    def _detectability(self, change: FloatArray) -> float:
        return float(np.linalg.norm(self.whiten @ change)) if np.isfinite(change).all() else math.inf


def _rms(change: FloatArray) -> float:
    return float(np.sqrt(np.mean(change**2)))


def _whitener(scale: _Scale, clamps: NDArray[np.int64], nuisances: Nuisances) -> FloatArray:
    """(n, n) W with W^T W the inverse covariance of ln readings: noise, clamping, strut spread, a free strut law."""
    nominal, n = scale.nominal, len(scale.base)
    step = 1e-4
    columns = []
    for strut in range(6):
        factors = np.where(np.arange(6) == strut, 1.0 + step, 1.0)
        columns.append(max(nuisances.strut_spread, 1e-6) * scale.change(HiddenMachine(strut_factors=factors)) / step)
    for which in range(2):
        stiffer = nominal.law_stiffnesses * np.where(np.arange(2) == which, 1.0 + step, 1.0)
        other = dataclasses.replace(nominal, law_stiffnesses=stiffer)
        columns.append(FREE_LAW * (np.log(readings(other, HiddenMachine(), scale.rows)) - scale.base) / step)
    same = clamps[:, None] == clamps[None, :]
    spread = np.column_stack(columns)
    covariance = max(nuisances.repeat, 1e-3) ** 2 * np.eye(n) + nuisances.clamping**2 * same + spread @ spread.T
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))
