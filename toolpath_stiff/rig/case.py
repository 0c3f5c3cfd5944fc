"""A case: a campaign on a machine that hides something, drawn from a seed, with the truth beside it.

A campaign says which poses, loads, tools and set-ups are measured in which order. A `Table` maps column names of
measurement files to arrays or lists of one length, in shop units.

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

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.effects import CATALOGUE, scale_of, with_effect
from toolpath_stiff.rig.hidden import (
    ODDITIES,
    OUTSIDE,
    HiddenMachine,
    Nuisances,
    disturb_machine,
    disturb_readings,
    reading_sd,
    readings,
)
from toolpath_stiff.rig.loops import with_loops
from toolpath_stiff.rig.nominal import Nominal, load_nominal, reachable
from toolpath_stiff.rig.rows import ROOM_TEMPERATURE, Rows
from toolpath_stiff.rig.unknowns import UNKNOWNS
from toolpath_stiff.units import m_from_mm, n_per_mm_from_n_per_m, rad_from_deg, s_from_min

Table = dict[str, Any]

LAYOUTS = ("paper", "tilted", "campaign")
POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
DEFAULT_SETUP = "table"

# Clinton, Zhang, Wavering (1997), Table 1: x, y in mm, measured at both heights; published.
PAPER_POINTS = ((0, 0), (-150, 0), (-300, 0), (-130, 75), (-260, 150), (-75, 130), (-150, 260))
PAPER_HEIGHTS = ((1268.225, "riser"), (353.225, "table"))  # the upper plane stood on a riser (Figure 6)

# The tilted campaign; every figure is a choice (assumed), with the machine's limits respected.
TILTED_POSES = 24
TILTED_LOADS = (500.0, 4000.0)  # N
TILTED_REPEATS = 2
TILTED_HEIGHTS = (400.0, 600.0, 800.0, 1000.0, 1200.0)  # mm
TILTED_RADIUS = 300.0  # mm
LONG_TOOL = 150.0  # mm longer, at four poses
RISER_EVERY = 3  # each third pose is taken on a riser

# How often a blind draw hides what, where nothing is said (assumed).
BLIND = {"none": 0.2, "one": 0.45, "two": 0.15, "outside": 0.2}

# One stream of random numbers for each purpose, so that a change in one leaves the others as they were.
_STREAMS = ("kind", "campaign", "machine", "noise")


def paper_campaign() -> Table:
    """The paper's 14 points along X, Y, Z: 42 rows in the order of its Table 1."""
    poses = [(x, y, z, setup) for z, setup in PAPER_HEIGHTS for x, y in PAPER_POINTS]
    rows = [(*pose, number, axis) for number, pose in enumerate(poses, 1) for axis in AXES]
    x, y, z, setup, point, direction = zip(*rows, strict=True)
    zeros = np.zeros(len(rows))
    return {
        "x_mm": np.array(x, dtype=float),
        "y_mm": np.array(y, dtype=float),
        "z_mm": np.array(z),
        "a_deg": zeros,
        "b_deg": zeros,
        "c_deg": zeros,
        "direction": list(direction),
        "setup": list(setup),
        "point": np.array(point),
    }


def tilted_campaign(nominal: Nominal, rng: Generator) -> Table:
    """24 tilted poses, X, Y, Z, two loads, two repeats: 288 rows; poses in random order, each repeat clamped anew."""
    poses = _tilted_poses(nominal, rng)
    visits = [(pose, repeat) for repeat in range(1, TILTED_REPEATS + 1) for pose in rng.permutation(TILTED_POSES)]
    columns: dict[str, list[Any]] = {name: [] for name in (*POSE, *_TILTED_COLUMNS)}
    for clamp, (pose, repeat) in enumerate(visits, 1):
        jobs = [(axis, load) for axis in AXES for load in TILTED_LOADS]
        minutes = 0.0
        for job in rng.permutation(len(jobs)):
            # A reading takes half a minute to a minute and a half after the indicator was zeroed.
            minutes = round(minutes + float(rng.uniform(0.5, 1.5)), 1)
            axis, load = jobs[job]
            for name, value in zip(POSE, poses[pose], strict=True):
                columns[name].append(value)
            own = (
                axis,
                load,
                "riser" if pose % RISER_EVERY == 0 else DEFAULT_SETUP,
                clamp,
                repeat,
                int(pose) + 1,
                minutes,
                _extension(int(pose)),
                round(20.0 + 1.5 * np.sin(np.pi * clamp / len(visits)), 1),  # a shop that warms up over the day
            )
            for name, value in zip(_TILTED_COLUMNS, own, strict=True):
                columns[name].append(value)
    return {name: values if name in ("direction", "setup") else np.array(values) for name, values in columns.items()}


_TILTED_COLUMNS = (
    "direction",
    "force_N",
    "setup",
    "clamp",
    "repeat",
    "point",
    "time_min",
    "tool_extension_mm",
    "temperature_C",
)


def _extension(pose: int) -> float:
    """Mm by which the tool at a pose is longer: poses 0, 7, 14, 21, two of them on the riser."""
    return LONG_TOOL if pose % 6 == pose // 6 else 0.0


def _tilted_poses(nominal: Nominal, rng: Generator) -> FloatArray:
    """(24, 6) mm and degrees, reachable, drawn until each height has its share; tilts of 5 to 25 degrees."""
    found: list[FloatArray] = []
    for _ in range(20_000):
        pose = len(found)
        if pose == TILTED_POSES:
            return np.array(found)
        radius, azimuth = TILTED_RADIUS * np.sqrt(rng.random()), rng.uniform(0.0, 2.0 * np.pi)
        tilt, about = rng.uniform(5.0, 25.0), rng.uniform(0.0, 2.0 * np.pi)
        height = TILTED_HEIGHTS[pose % len(TILTED_HEIGHTS)]
        trial = np.round(
            [
                radius * np.cos(azimuth),
                radius * np.sin(azimuth),
                height,
                tilt * np.cos(about),
                tilt * np.sin(about),
                rng.uniform(-10.0, 10.0),
            ],
            1,
        )
        extension = np.array([m_from_mm(_extension(pose))])
        if reachable(nominal, m_from_mm(trial[None, :3]), rad_from_deg(trial[None, 3:]), extension)[0]:
            found.append(trial)
    raise LookupError("too few reachable tilted poses within 300 mm of the axis")


def rows_of(table: Mapping[str, Any], elapsed: FloatArray | None = None) -> Rows:
    """SI rows of a table; absent columns take their defaults: no tilt, 1000 N, the reference tool, time 0, `table`."""
    n = len(table["x_mm"])

    def column(name: str, default: float) -> FloatArray:
        return np.asarray(table[name], dtype=float) if name in table else np.full(n, default)

    if "dx" in table:
        direction = np.stack([column(name, 0.0) for name in ("dx", "dy", "dz")], axis=1)
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


def clamp_of(table: Mapping[str, Any]) -> IntArray:
    """(n,) group of each row: its clamp, or without that column its pose and set-up."""
    if "clamp" in table:
        keys = [(int(clamp),) for clamp in table["clamp"]]
    else:
        setups = table.get("setup", [DEFAULT_SETUP] * len(table["x_mm"]))
        poses = zip(*(table[name] for name in POSE if name in table), strict=True)
        keys = [(*(float(v) for v in pose), str(setup)) for pose, setup in zip(poses, setups, strict=True)]  # type: ignore[misc]
    numbers = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    return np.array([numbers[key] for key in keys])


@dataclass(frozen=True)
class Case:
    """A campaign and its truth.

    Attributes
    ----------
    rows
        Measurement table in shop units, in measuring order.
    truth
        What was hidden: `hidden` (names; empty if nothing), `kind`, `effects` with parameters in shop units,
        their `size` (rms change of ln stiffness) and `detectability` (see `effects.DETECTABLE`); of an unknown also
        `links` and `variables`, what a description may name.
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
    machine: str | Nominal = defaults.MACHINE,
    plan: Mapping[str, Any] | None = None,
    size: float | Sequence[float] | None = None,
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
        None: drawn blindly; `none`, `one`, `two`, `three`, `outside`, `unknown`; or names of effects (oddities and
        unknowns included). An unknown is never drawn where nothing is said.
    noise
        Relative repeat noise of one reading.
    machine
        Nominal machine: name, file, or as loaded.
    plan
        Table of poses in shop units without stiffness.
    size
        Rms change of ln stiffness that each effect makes, instead of a draw; less where its bound is reached. Several:
        one for each effect, in the order of `truth["hidden"]`.
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
    machine: str | Nominal = defaults.MACHINE,
    plan: Mapping[str, Any] | None = None,
    size: float | Sequence[float] | None = None,
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
        scale = scale_of(nominal, rows, clamp_of(table), nuisances)
        for name, wanted in zip(names, _sizes(size, len(names)), strict=True):
            # A stream of its own for each effect: sizes of different effects of one seed have nothing in common.
            rng = np.random.default_rng([seed, len(_STREAMS), zlib.crc32(name.encode())])
            parameters, found = scale.draw(name, wanted, rng)
            true = with_effect(true, name, parameters)
            effects.append({"effect": name, "parameters": parameters, **found, **_looks(name)})
    true = disturb_machine(true, nuisances, streams["machine"])
    measured = measure(nominal, true, table, rows, nuisances, streams["noise"], stated_sd=layout == "paper")
    outside = any(name in (*OUTSIDE, *UNKNOWNS) for name in names)
    truth = {
        "hidden": list(names),
        "kind": "outside" if outside else ("none", "one", "two", "three")[min(len(names), 3)],
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
    return with_loops(nominal, machine, measured, rows, nuisances, rng) if "loop" in measured else measured


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


def _sizes(size: float | Sequence[float] | None, count: int) -> tuple[float | None, ...]:
    """The size wanted of each of `count` effects."""
    if size is None or isinstance(size, (int, float)):
        return (size,) * count
    if len(size) != count:
        raise InputError(f"{len(size)} sizes for {count} hidden effects", expected="one size, or one for each effect")
    return tuple(size)


def _names(hidden: str | Sequence[str] | None, layout: str, table: Table, rng: Generator) -> tuple[str, ...]:
    """Names of what is hidden."""
    if hidden is None:
        hidden = str(rng.choice(list(BLIND), p=list(BLIND.values())))
    known = effects_of_layout(layout)
    if hidden == "none":
        return ()
    if hidden == "one":
        return (str(rng.choice(known)),)
    if hidden in ("two", "three"):
        return tuple(known[i] for i in rng.choice(len(known), size=2 if hidden == "two" else 3, replace=False))
    if hidden == "unknown":
        return (str(rng.choice([name for name, kind in UNKNOWNS.items() if all(c in table for c in kind.columns)])),)
    if hidden == "outside":
        return (str(rng.choice(list(ODDITIES) if layout == "paper" else list(OUTSIDE))),)
    names = tuple(hidden.split(",")) if isinstance(hidden, str) else tuple(hidden)
    _check_named(names, table)
    return names


def _check_named(names: Sequence[str], table: Table) -> None:
    """Raise `InputError` for names that are unknown, cannot be together, or need a column that is missing."""
    all_names = (*CATALOGUE, *OUTSIDE, *UNKNOWNS)
    for name in names:
        if name not in all_names:
            raise InputError(
                f"nothing called {name!r} to hide",
                expected=f"none, one, two, three, outside, unknown, or of {', '.join(all_names)}",
            )
    if len(set(names)) < len(names) or sum(name in (*OUTSIDE, *UNKNOWNS) for name in names) > 1:
        raise InputError(
            f"hidden effects {', '.join(names)}", expected="each once, and at most one outside the catalogue"
        )
    if "thermal_drift" in names and "time_min" not in table:
        raise InputError(
            "thermal_drift needs the column time_min", expected="layout tilted, or a plan with that column"
        )
    for name in names:
        if lacking := [c for c in (UNKNOWNS[name].columns if name in UNKNOWNS else ()) if c not in table]:
            raise InputError(
                f"{name} needs the column {', '.join(lacking)}", expected="layout tilted, or a plan with that column"
            )


def _looks(name: str) -> dict[str, Any]:
    """What an unknown looks like from outside: the links that could do it and what it varies with."""
    if name not in UNKNOWNS:
        return {}
    return {"links": sorted(UNKNOWNS[name].links), "variables": sorted(UNKNOWNS[name].variables)}
