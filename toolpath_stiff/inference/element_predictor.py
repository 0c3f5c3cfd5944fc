"""Readings that a machine of elements predicts, and their dependence on the give of each element."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.prediction import NO_CHANGE, Predictor, idle_on
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.readings.measurements import Readings, measured_path, mechanical_stiffness
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.element_sum import energies, stance_of
from toolpath_stiff.stiffness.model import build_model


def predictor_of(machine: MachineTool, data: Readings, effect_files: Sequence[str | Path] = ()) -> Predictor:
    """Predictor of n readings for a machine of any kind."""
    if isinstance(machine, Hexapod):
        return Predictor(machine, data, effect_files)
    return ElementPredictor(machine, data, effect_files)


class ElementPredictor(Predictor):
    """Predictor of n tip readings for a machine of elements; it has no strut law that could change."""

    def __init__(self, machine: MachineTool, data: Readings, effect_files: Sequence[str | Path] = ()) -> None:
        self.stated, self.effect_files = machine, tuple(effect_files)
        self.base = build_model(machine, effect_files)
        warnings = [*data.warnings, *idle_on(self.base, data).values()]
        self.data = replace(data, warnings=tuple(dict.fromkeys(warnings)))
        self.tables: dict[tuple[Any, ...], Any] = {}

    @property
    def distinct(self) -> NDArray[np.int64]:
        """(n,) numbers of the readings: each is computed separately."""
        return np.arange(len(self.data))

    @cached_property
    def full_path(self) -> LoadPath:
        """Load path with a row per reading, as instruments see it."""
        return measured_path(self.base, self.data)

    def log_stiffness(self, law: ArrayLike = NO_CHANGE, effects: Sequence[ActiveEffect] = ()) -> FloatArray:
        """(n,) ln(N/m) that the readings should show."""
        if not effects and not self.base.instruments:
            return self._base_log.copy()
        model = build_model(self.stated, self.effect_files, effects)
        stiffness = mechanical_stiffness(model, self.full_path, self.data)
        return self._read(stiffness, model.instruments, model.machine)

    def strut_columns(self) -> FloatArray:
        """(n, e) d ln k / d ln(stiffness of element i): its share of the compliance."""
        shares = energies(stance_of(self.full_path), self.data.direction)
        return np.asarray(np.stack(shares, axis=1) * np.exp(self._base_log)[:, None])

    def strut_part_and_slopes(self, law: ArrayLike = NO_CHANGE) -> tuple[FloatArray, FloatArray]:
        """Zeros: nothing depends on a strut law."""
        shape = (*np.shape(law)[:-1], len(self.data))
        return np.zeros(shape), np.zeros((*shape[:-1], 2, shape[-1]))

    @cached_property
    def joint_columns(self) -> FloatArray:
        """(n, 0): the joints' positions are taken to be those of the file."""
        return np.empty((len(self.data), 0))

    @cached_property
    def _base_log(self) -> FloatArray:
        """(n,) ln k before instruments."""
        return np.asarray(np.log(mechanical_stiffness(self.base, self.full_path, self.data)))
