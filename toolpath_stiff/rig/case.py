"""A case: a campaign on a machine with something hidden, drawn from a seed, with the truth beside it.

Each purpose has its own stream of random numbers, so that a case and its control (`hidden="none"`) differ by the
effect alone.
"""

import zlib
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.campaigns import AXES, DEFAULT_SETUP, POSE, Table, campaign
from toolpath_stiff.rig.effects import BEYOND, CATALOGUE, HIDEABLE, with_effect
from toolpath_stiff.rig.fem import FemMachine, sound_machine
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.fem_path import path_truth
from toolpath_stiff.rig.hidden import HiddenMachine, Nuisances, disturb_machine, disturb_readings, readings
from toolpath_stiff.rig.loops import with_loops
from toolpath_stiff.rig.nominal import Nominal, load_nominal
from toolpath_stiff.rig.rows import ROOM_TEMPERATURE, Rows
from toolpath_stiff.rig.sizes import Scale
from toolpath_stiff.rig.unknowns import ODDITIES, OUTSIDE, UNKNOWNS
from toolpath_stiff.units import m_from_mm, n_per_mm_from_n_per_m, rad_from_deg, s_from_min

BUILT = ("springs", "fem")  # ways to build a machine, the first by default
# Shares of blind draws that hide each kind, unless one is requested (assumed).
BLIND = {"none": 0.2, "one": 0.45, "two": 0.15, "outside": 0.2}

DESCRIBED = ("links", "names", "variables")

# One stream of random numbers for each purpose, so that a change in one leaves the others as they were.
_STREAMS = ("kind", "campaign", "machine", "noise")


def rows_of(table: Table, elapsed: FloatArray | None = None) -> Rows:
    """SI rows of a table; absent columns take their defaults: no tilt, 1000 N, the reference tool, time 0, `table`."""
    n = len(table["x_mm"])

    def column(name: str, default: float) -> FloatArray:
        return np.asarray(table[name], dtype=float) if name in table else np.full(n, default)

    if "dx" in table:
        direction = np.stack([column(name, 0.0) for name in ("dx", "dy", "dz")], axis=1)
        with np.errstate(invalid="ignore"):  # a direction of no length gives nan
            direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    else:
        direction = np.array([AXES[name] for name in table["direction"]])
    return Rows(
        position=m_from_mm(np.stack([column(name, 0.0) for name in POSE[:3]], axis=1)),
        angles=rad_from_deg(np.stack([column(name, 0.0) for name in POSE[3:]], axis=1)),
        direction=direction,
        force=column("force_N", defaults.FORCE),
        extension=m_from_mm(column("tool_extension_mm", 0.0)),
        time=s_from_min(column("time_min", 0.0)),
        elapsed=np.linspace(0.0, 1.0, n) if elapsed is None else elapsed,
        setup=np.array(table["setup"] if "setup" in table else [DEFAULT_SETUP] * n, dtype=np.str_),
        temperature=column("temperature_C", ROOM_TEMPERATURE),
    )


def clamp_of(table: Table) -> IntArray:
    """(n,) clamping group of each row: its clamp or, without that column, its pose and set-up."""
    columns = ["clamp"] if "clamp" in table else [name for name in (*POSE, "setup") if name in table]
    keys = list(zip(*(np.asarray(table[name]).tolist() for name in columns), strict=True))
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    return np.array([numbers[key] for key in keys])


@dataclass(frozen=True)
class DrawnCase:
    """A campaign and the truth behind it.

    Attributes
    ----------
    rows
        Measurement table in shop units, in measuring order.
    truth
        What was hidden: `hidden` (names; empty if nothing), `kind`, `effects` with parameters in shop units,
        their `size` (rms change of ln stiffness) and `detectability` (see `sizes.DETECTABLE`); of an unknown also
        `links` and `variables`, what a description may name. Of a machine of finite elements `links` and `names`, what
        the catalogue calls it, and `path`, the true stiffness at poses (`path_truth`).
    nominal, machine, nuisances
        To measure the same machine again.
    seed, layout
        As asked.
    """

    rows: Table
    truth: Document
    nominal: Nominal
    machine: HiddenMachine
    nuisances: Nuisances
    seed: int = 0
    layout: str = ""

    def measure(self, table: Table, rows: Rows, rng: Generator, stated_sd: bool = False) -> Table:
        """Measured table with column `stiffness_N_per_mm`, and `sd_N_per_mm` if it is to be stated; `rows` in SI."""
        shown, nuisances = readings(self.nominal, self.machine, rows), self.nuisances
        bad = np.flatnonzero(~(np.isfinite(shown) & (shown > 0.0)))
        if len(bad):
            raise InputError(
                f"row {bad[0] + 1}: the indicator would run backwards on the hidden machine",
                hint="use a larger load or zero the indicator later (time_min)",
            )
        apart = self.machine.clamping_axes * rows.direction**2 if isinstance(self.machine, FemMachine) else None
        stiffness = n_per_mm_from_n_per_m(disturb_readings(shown, clamp_of(table), nuisances, rng, apart))
        measured: Table = {}
        for name, values in table.items():
            measured[name] = values
            if name in ("direction", "dz") and "stiffness_N_per_mm" not in measured:
                measured["stiffness_N_per_mm"] = stiffness
                if stated_sd and nuisances.of_reading > 0.0:
                    measured["sd_N_per_mm"] = np.round(stiffness * nuisances.of_reading)
        return with_loops(self.nominal, self.machine, measured, rows, nuisances, rng)

    def again(self, plan: Table, rng: Generator, stated_sd: bool = False) -> Table:
        """The same hidden machine measured at a plan: new clamps, new noise; the campaign's clock stands at its end."""
        return self.measure(plan, rows_of(plan, elapsed=np.ones(len(plan["x_mm"]))), rng, stated_sd)


def make_case(seed: int, *args: Any, **named: Any) -> tuple[Table, Document]:
    """Rows and truth of `draw_case`."""
    case = draw_case(seed, *args, **named)
    return case.rows, case.truth


def draw_case(
    seed: int,
    layout: str = "tilted",
    hidden: str | Sequence[str] | None = None,
    noise: float | Nuisances = 0.02,
    machine: str | Nominal = defaults.MACHINE,
    plan: Table | None = None,
    size: float | Sequence[float] | None = None,
    built: str = BUILT[0],
) -> DrawnCase:
    """A blind campaign on a machine with something hidden; the same arguments give the same rows.

    Parameters
    ----------
    seed
        0 or more.
    layout
        `paper` (42 rows), `tilted` (288 rows) or `campaign` (the rows of `plan`).
    hidden
        None: drawn blindly; `none`, `one`, `two`, `three`, `outside`, `unknown`; or names of effects (oddities and
        unknowns included). An unknown is never drawn where nothing is said.
    noise
        Relative repeat noise of one reading, beside the standard nuisances; or others than these.
    machine
        Nominal machine: name, file, or as loaded.
    plan
        Table of poses in shop units without stiffness.
    size
        Rms change of ln stiffness that each effect makes, instead of a draw; less where its bound is reached. Several:
        one for each effect, in the order of `truth["hidden"]`.
    built
        Of `springs`, or of finite elements (`fem`), whose faults have names of their own (`fem_faults.FAULTS`).

    Raises
    ------
    InputError
        Unknown layout, effect or machine; an effect that the layout cannot show.
    """
    if seed < 0:
        raise InputError(f"seed {seed}", expected="0 or more")
    if built not in BUILT:
        raise InputError(f"a machine built {built!r}", expected=", ".join(BUILT))
    nuisances = noise if isinstance(noise, Nuisances) else Nuisances(repeat=noise)
    if not 0.0 <= nuisances.repeat <= 0.5:
        raise InputError(f"repeat noise of {100.0 * nuisances.repeat:g} %", expected="0 to 50 %")
    nominal = load_nominal(machine) if isinstance(machine, str) else machine
    streams = {name: np.random.default_rng([seed, i]) for i, name in enumerate(_STREAMS)}
    table = campaign(layout, nominal, plan, streams["campaign"])
    names = _names(hidden, table, streams["kind"], fem=built == "fem")
    rows = rows_of(table)
    true: HiddenMachine = sound_machine(nominal) if built == "fem" else HiddenMachine()
    effects = []
    if names:
        scale = Scale(nominal, rows, clamp_of(table), nuisances, true)
        for name, wanted in zip(names, _sizes(size, len(names)), strict=True):
            # A stream of its own for each effect: sizes of different effects of one seed have nothing in common.
            rng = np.random.default_rng([seed, len(_STREAMS), zlib.crc32(name.encode())])
            parameters, strength = scale.draw(name, wanted, rng)
            true = with_effect(true, name, parameters)
            # What a description may name; of an oddity none is asked for.
            words = {} if name in ODDITIES else {key: getattr(HIDEABLE[name], key) for key in DESCRIBED}
            right = {key: sorted(some) for key, some in words.items() if some is not None}
            effects.append({"effect": name, "parameters": parameters, **strength, **right})
    true = disturb_machine(true, nuisances, streams["machine"])
    truth: dict[str, object] = {
        "hidden": list(names),
        "kind": "outside" if {*names} & BEYOND else ("none", "one", "two", "three")[min(len(names), 3)],
        "effects": effects,
    }
    if isinstance(true, FemMachine):
        if nuisances.joint_error > 0.0:  # no machine matches its drawing exactly, unless joint errors are switched off
            true = true.scattered(streams["machine"])
        truth["path"] = path_truth(nominal, true, rows, np.random.default_rng([seed, len(_STREAMS)]))
    case = DrawnCase(table, truth, nominal, true, nuisances, seed, layout)
    return replace(case, rows=case.measure(table, rows, streams["noise"], stated_sd=layout == "paper"))


def _sizes(size: float | Sequence[float] | None, count: int) -> Sequence[float | None]:
    """Size wanted of each of `count` effects; None where it is drawn."""
    sizes = size if isinstance(size, Sequence) else (size,) * count
    if len(sizes) != count:
        raise InputError(f"{len(sizes)} sizes for {count} hidden effects", expected="one size, or one for each effect")
    return sizes


def hideable(columns: Container[str], *, fem: bool) -> tuple[list[str], ...]:
    """Names that a campaign with these columns can show: in the catalogue, outside it, and unknowns.

    `fem`: on a machine of finite elements, where what lies outside is unknown.
    """
    outside = {name: fault for name, fault in FAULTS.items() if not fault.names}
    inside = {name: fault for name, fault in FAULTS.items() if fault.names}
    kinds = (inside, outside, outside) if fem else (CATALOGUE, ODDITIES, UNKNOWNS)
    return tuple([name for name, kind in some.items() if all(c in columns for c in kind.columns)] for some in kinds)


def _names(hidden: str | Sequence[str] | None, table: Table, rng: Generator, *, fem: bool) -> tuple[str, ...]:
    """Names of the hidden effects, in a machine of finite elements or of springs."""
    if hidden is None:
        hidden = str(rng.choice(list(BLIND), p=list(BLIND.values())))
    known, outside, unknown = hideable(table, fem=fem)
    if hidden in ("two", "three"):
        return tuple(known[i] for i in rng.choice(len(known), size=2 if hidden == "two" else 3, replace=False))
    drawn = {"one": known, "unknown": unknown, "outside": outside}
    if isinstance(hidden, str) and hidden in drawn:
        return (str(rng.choice(drawn[hidden])),)
    if hidden == "none":
        return ()
    names = tuple(hidden.split(",")) if isinstance(hidden, str) else tuple(hidden)
    everything = FAULTS if fem else CATALOGUE | OUTSIDE
    if strange := [name for name in names if name not in everything]:
        expected = f"none, one, two, three, outside, unknown, or of {', '.join(everything)}"
        raise InputError(f"nothing called {strange[0]!r} to hide", expected=expected)
    if len(set(names)) < len(names) or sum(name in OUTSIDE for name in names) > 1:
        raise InputError(f"hidden effects {', '.join(names)}", expected="each once, at most one outside the catalogue")
    for name in names:
        if lacking := [column for column in everything[name].columns if column not in table]:
            raise InputError(f"{name} needs the column {lacking[0]}", expected="layout tilted, or a plan with it")
    return names
