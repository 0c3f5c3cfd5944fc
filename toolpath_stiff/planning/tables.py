"""Tables of a plan, kept beside it: all that the choice of the next visit needs, without the model.

A plan's rivals are linear about their fits: each expects ln k of every possible reading as a mean, with a factor of the
covariance that its parameters and the machine's unknowns leave open.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.planning.forecasts import Forecast
from toolpath_stiff.planning.gaps import ReadingNoise
from toolpath_stiff.planning.menu import Costs, Menu
from toolpath_stiff.planning.plan import RivalPlan
from toolpath_stiff.planning.visits import Visits, planned_readings

TABLES = "plan_tables.npz"  # in the plan's folder
OF_VISITS = ("pose", "extension", "wait", "setup", "label", "names", "rounds", "members", "starts", "loop")
# Digits of the largest value that are kept: coarse enough that the differences of processors, some 1e-12 in 1e5 values,
# hardly ever turn one; 0.02 % of a standard deviation, 1e-5 of a stiffness.
DIGITS_OF_FACTOR, DIGITS_OF_MEAN = 4, 7
INDEPENDENT = 1e-4  # of the largest row, by which a row has a direction of its own


def _canonical(columns: FloatArray) -> FloatArray:
    """(m, k) columns with the covariance of (m, q), the same on every processor.

    A factor of a covariance is one of many, turned as the processor's eigenvectors happen to be. This one is lower
    triangular over the first rows that are independent of those before them, with a positive diagonal.
    """
    least = INDEPENDENT * float(np.linalg.norm(columns, axis=1).max(initial=0.0))
    basis = np.zeros((0, columns.shape[1]))
    for row in columns:
        direction = row - (row @ basis.T) @ basis
        direction -= (direction @ basis.T) @ basis  # once more, against rounding
        length = float(np.linalg.norm(direction))
        if length > least:
            basis = np.concatenate([basis, direction[None] / length])
        if len(basis) == columns.shape[1]:
            break
    return np.asarray(columns @ basis.T)


def _certain(values: FloatArray, digits: int) -> FloatArray:
    """Values rounded to so many digits of the largest."""
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return np.round(values, digits - int(np.ceil(np.log10(largest)))) + 0.0 if largest > 0.0 else values


def tables_of(plan: RivalPlan) -> bytes:
    """Content of `TABLES`: everything that the choice of the next visit needs."""
    readings, beside, menu = plan.visits.readings, plan.visits.readings.beside, plan.visits.menu
    arrays: dict[str, Any] = {name: getattr(plan.visits, name) for name in OF_VISITS}
    arrays |= {
        "force": readings.force,
        "time": readings.time,
        "of_loop": readings.loop,
        "offset": np.zeros(len(readings)) if beside is None else beside.offset,
        "toward": np.ones(len(readings)) if beside is None else beside.toward,
        "usable": plan.usable,
        "machine": _certain(_canonical(plan.scatter.machine), DIGITS_OF_FACTOR),
    }
    for k, forecast in enumerate(plan.forecasts):
        arrays[f"mean_{k}"] = _certain(forecast.mean, DIGITS_OF_MEAN)
        arrays[f"factor_{k}"] = _certain(_canonical(forecast.factor), DIGITS_OF_FACTOR)
    heading = {
        "rivals": [[forecast.name, forecast.weight] for forecast in plan.forecasts],
        "noise": [plan.scatter.repeat, plan.scatter.clamping],
        "costs": vars(menu.costs),
        "setups": menu.setups,
        "tools": menu.tool_extensions,
        "waits": menu.waits,
    }
    file = io.BytesIO()
    np.savez(file, said=np.frombuffer(json.dumps(heading).encode(), dtype=np.uint8), **arrays)
    return file.getvalue()


@dataclass(frozen=True)
class Tables:
    """Tables of a plan: visits, forecasts of all their readings, noise; how indicators are compared."""

    visits: Visits
    usable: BoolArray
    forecasts: tuple[Forecast, ...]
    noise: ReadingNoise
    offset: FloatArray
    toward: FloatArray

    @classmethod
    def read(cls, folder: str | Path) -> Tables:
        """The tables in a plan's folder. Raises `InputError` where it holds none."""
        path = Path(folder) / TABLES
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            return cls._of(arrays, json.loads(arrays.pop("said").tobytes()))
        except (ValueError, KeyError, TypeError, OSError, EOFError, zipfile.BadZipFile):
            expected = "what tps plan wrote for a plan between rivals"
            raise InputError(f"{path} is no table of a plan", expected=expected, hint="plan again") from None

    @classmethod
    def _of(cls, arrays: Mapping[str, AnyArray], heading: Mapping[str, Any]) -> Tables:
        starts, members = arrays["starts"], arrays["members"]
        visit_of = np.empty(len(arrays["names"]), dtype=np.int64)
        visit_of[members] = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(members))))
        readings = planned_readings(
            arrays["pose"][visit_of], arrays["names"], arrays["force"], arrays["extension"][visit_of],
            arrays["setup"][visit_of], arrays["time"], arrays["of_loop"],
        )  # fmt: skip
        menu = Menu(
            setups=tuple(heading["setups"]),
            tool_extensions=tuple(heading["tools"]),
            waits=tuple(heading["waits"]),
            costs=Costs(**heading["costs"]),
        )
        rivals, (repeat, clamping) = enumerate(heading["rivals"]), heading["noise"]
        return cls(
            Visits(menu=menu, readings=readings, **{name: arrays[name] for name in OF_VISITS}),
            arrays["usable"],
            tuple(Forecast(name, float(p), arrays[f"mean_{k}"], arrays[f"factor_{k}"]) for k, (name, p) in rivals),
            ReadingNoise(repeat, clamping, arrays["machine"]),
            arrays["offset"],
            arrays["toward"],
        )
