"""Draws of machines of finite elements: the fault and its size, what every machine scatters, the truth along a path."""

import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.random import Generator

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.campaigns import POSE, Table
from toolpath_stiff.rig.draws import Shape
from toolpath_stiff.rig.fem import FemMachine
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.fem_solution import pulled, readings, sound
from toolpath_stiff.rig.hidden import Nuisances
from toolpath_stiff.rig.nominal import Nominal, reachable
from toolpath_stiff.rig.rows import Rows
from toolpath_stiff.rig.sizes import LARGEST_SINGLE, Scale
from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m

SIZES = (0.04, 0.20)  # rms change of ln stiffness that a fault is drawn with, log-uniform, as far as its limit allows
INSIDE, BEYOND = 24, 12  # poses of the path amid those measured, and beyond them
MOST_DRAWS = 4000  # of poses, until so many can be reached
# Standard deviations of ln stiffness from machine to machine (assumed), and of the clamping scatter by direction.
SPREAD = {"beams": 0.1, "feet": 0.15, "rim": 0.1, "spokes": 0.1, "mounts": 0.15, "plate": 0.15}
CLAMPING_SPREAD = 0.4


def faults_of(table: Table, catalogue: bool | None = None) -> list[str]:
    """Names of the faults that a table has the columns for: those in the catalogue, those outside, or all."""
    return [
        name for name, fault in FAULTS.items()
        if catalogue in (None, bool(fault.names)) and all(column in table for column in fault.columns)
    ]  # fmt: skip


def fault_names(hidden: str | tuple[str, ...], table: Table, rng: Generator) -> tuple[str, ...]:
    """Names of what is hidden: `none`, `one`, `two`, `three`, `outside`, or faults. Raises `InputError`."""
    counts = {"none": 0, "one": 1, "two": 2, "three": 3, "outside": 1, "unknown": 1}
    if isinstance(hidden, str) and hidden in counts:
        known = faults_of(table, catalogue=hidden not in ("outside", "unknown"))
        return tuple(known[k] for k in rng.choice(len(known), size=counts[hidden], replace=False))
    names = tuple(hidden.split(",")) if isinstance(hidden, str) else tuple(hidden)
    for name in names:
        if name not in FAULTS or names.count(name) > 1:
            expected = f"none, one, two, three, outside, or once each of {', '.join(FAULTS)}"
            raise InputError(
                f"nothing called {name!r} to hide in a machine built of finite elements", expected=expected
            )
        for column in FAULTS[name].columns:
            if column not in table:
                raise InputError(f"{name} needs the column {column}", expected="layout tilted, or a plan with it")
    return names


def with_fault(machine: FemMachine, name: str, shape: Shape, size: float, nominal: Nominal) -> FemMachine:
    """The machine with a fault of a size in SI."""
    return replace(machine, **FAULTS[name].change(machine, size, shape, nominal))


def draw_machine(
    seed: int, names: tuple[str, ...], sizes: Any, nominal: Nominal, rows: Rows, clamps: IntArray, nuisances: Nuisances
) -> tuple[FemMachine, list[Document]]:
    """A machine with faults, without scatter, and what the truth says of each; `sizes`: rms changes, None is drawn."""
    machine = start = sound(nominal)[0]
    base = np.log(readings(nominal, start, rows))
    scale = Scale(nominal, rows, clamps, nuisances)
    effects: list[Document] = []
    for name, wanted in zip(names, sizes, strict=True):
        fault, rng = FAULTS[name], np.random.default_rng([seed, 9, zlib.crc32(name.encode())])
        shape = fault.shape(rng)
        drawn_size = SIZES[0] * (SIZES[1] / SIZES[0]) ** rng.random()
        sign = float(shape.pop("sign", 1.0))

        def change(strength: float) -> FloatArray:
            tried = with_fault(start, name, shape, sign * strength * fault.limit, nominal)  # noqa: B023
            with np.errstate(invalid="ignore", divide="ignore"):
                logs = np.log(readings(nominal, tried, rows)) - base
            return np.where(np.abs(logs) <= LARGEST_SINGLE, logs, np.inf)

        strength = _strength(change, drawn_size if wanted is None else wanted)
        size = float(f"{sign * strength * fault.limit:.4g}")
        shape = {key: float(f"{value:.4g}") if isinstance(value, float) else value for key, value in shape.items()}
        machine = with_fault(machine, name, shape, size, nominal)
        changed = change(strength)
        figures = {"size": np.sqrt(np.mean(changed**2)), "detectability": scale.whitened_length(changed)}
        effects.append({
            "effect": name, "parameters": {**shape, "size": size},
            **{key: float(f"{value:.6g}") for key, value in figures.items()},
            "links": sorted(fault.links), "names": sorted(fault.names),
        })  # fmt: skip
    return machine, effects


def _strength(change: Callable[[float], FloatArray], wanted: float) -> float:
    """Strength in (0, 1] of a fault whose rms change is `wanted` within 2 %, or 1; bisection of its logarithm."""
    low, high = 1e-4, 1.0
    if np.sqrt(np.mean(change(high) ** 2)) <= wanted:
        return high
    for _ in range(30):
        middle = float(np.sqrt(low * high))
        rms = float(np.sqrt(np.mean(change(middle) ** 2)))
        low, high = (middle, high) if rms <= wanted else (low, middle)
        if abs(rms - wanted) <= 0.02 * wanted:
            return middle
    return low  # beyond it a single reading changes by more than `LARGEST_SINGLE`


def scattered(machine: FemMachine, nuisances: Nuisances, rng: Generator) -> FemMachine:
    """The machine as one of many: joints, struts, sections; and clamping that scatters otherwise in each direction."""
    if nuisances.joint_error == 0.0:
        return machine
    changed: Shape = {
        "strut_factors": machine.strut_factors * (1.0 + nuisances.strut_spread * rng.standard_normal(6)),
        "frame_errors": machine.frame_errors + nuisances.joint_error * rng.standard_normal((6, 3)),
        "platform_errors": machine.platform_errors + nuisances.joint_error * rng.standard_normal((6, 3)),
    }
    for name, width in SPREAD.items():
        before = getattr(machine, name)
        changed[name] = before * np.exp(width * (rng.standard_normal() + 0.3 * rng.standard_normal(np.shape(before))))
    return replace(machine, **changed, clamping=np.exp(CLAMPING_SPREAD * rng.standard_normal(3)))


def path_truth(nominal: Nominal, stiffness: Callable[[Rows], FloatArray], rows: Rows, rng: Generator) -> Document:
    """True stiffness along X, Y, Z at poses amid those of the rows, and beyond: columns in shop units.

    `stiffness` gives it of rows; `measured_near` is false of a pose beyond.
    """
    measured = np.unique(np.column_stack([rows.position, rows.angles]), axis=0)
    middle, poses = measured.mean(axis=0), list[FloatArray]()
    for _ in range(MOST_DRAWS):
        if len(poses) == INSIDE + BEYOND:
            break
        some = measured[rng.integers(len(measured), size=2)] - middle
        near = len(poses) < INSIDE
        pose = middle + (rng.uniform(0.3, 0.9) * some.mean(axis=0) if near else rng.uniform(1.2, 1.8) * some[0])
        pose = pose.round(6)
        if reachable(nominal, pose[None, :3], pose[None, 3:], np.zeros(1))[0]:
            poses.append(pose)
    drawn = np.array(poses).reshape(-1, len(POSE))
    true = n_per_mm_from_n_per_m(stiffness(pulled(drawn[:, :3], drawn[:, 3:]))).reshape(-1, 3).round(1)
    columns = np.column_stack([mm_from_m(drawn[:, :3]), deg_from_rad(drawn[:, 3:]).round(6), true])
    names = (*POSE, *(f"{axis}_N_per_mm" for axis in "xyz"))
    return {
        **{name: values.round(6).tolist() for name, values in zip(names, columns.T, strict=True)},
        "measured_near": [k < INSIDE for k in range(len(drawn))],
    }
