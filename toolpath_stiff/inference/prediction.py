"""Readings that the model predicts, and their dependence on strut law, struts and joints.

Everything is on the logarithm of stiffness: effects are factors of a few to thirty per cent, and so is the noise. The
strut law enters as the logarithms of the factors on its two stiffnesses, `law`, which are dimensionless: a
least-squares fit of constants in N/m would stop at once, its gradient being tiny. Of a constant law the second does
nothing, and its prior holds it at 0.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Hexapod, MachineTool, StrutLaw, as_hexapod
from toolpath_stiff.readings.measurements import Readings, measured_path, mechanical_stiffness, shown_by
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.contract import Effect, LoadPath
from toolpath_stiff.stiffness.loop_response import law_products
from toolpath_stiff.stiffness.model import StiffnessModel, build_model, idle_on_readings
from toolpath_stiff.stiffness.trial import failures, own_effects

NO_CHANGE = (0.0, 0.0)  # of the strut law
ANSWERS_KEPT = 64
JOINT_STEP = 0.5e-3  # m, step of differences: about the size of the joint errors for which the columns are used


def scaled_law(law: StrutLaw, logs: ArrayLike) -> StrutLaw:
    """The strut law with its two stiffnesses multiplied by exp(logs)."""
    first, second = np.exp(np.asarray(logs, dtype=float)).tolist()
    return replace(law, stiffness_1=law.stiffness_1 * first, stiffness_2=law.stiffness_2 * second)


@dataclass(frozen=True)
class _Prepared:
    """Mechanically distinct rows, the load path that effects see, and strut forces per unit load.

    `products` (m, 6): what each strut's own compliance counts in a reading, at the tip the squared force.
    """

    data: Readings
    which: NDArray[np.int64]
    path: LoadPath
    forces: FloatArray
    products: FloatArray


class Predictor:
    """Model predictions for a set of measurements, for any strut law and any effects.

    Parameters
    ----------
    machine
        The machine with the effects of its file.
    data
        n readings.
    effect_files
        A user's own effects.

    Raises
    ------
    InputError
        The machine's effects are wrong, or the strut law leaves a strut no stiffness at a measured pose.

    Attributes
    ----------
    data
        The readings, with a warning for each effect of the machine file that adds nothing to them.
    tables
        What `candidates.table_of` has worked out for these readings: every noise model asks for the same.
    """

    def __init__(self, machine: Hexapod, data: Readings, effect_files: Sequence[str | Path] = ()) -> None:
        self.stated: MachineTool = machine
        self.machine = machine
        self.effect_files = tuple(effect_files)
        self.base = build_model(machine, self.effect_files)
        failed = failures(own_effects(self.base, self.effect_files), machine)
        warnings = [*failed, *data.warnings, *idle_on(self.base, data).values()]
        self.data = replace(data, warnings=tuple(dict.fromkeys(warnings)))
        self._timeless = _prepare(self.base, data, timed=False)
        self._timed = _prepare(self.base, data, timed=True)
        self.tables: dict[tuple[Any, ...], Any] = {}
        self._answers: dict[tuple[Any, ...], FloatArray] = {}

    @property
    def distinct(self) -> NDArray[np.int64]:
        """(n,) number of each reading's mechanically distinct row; repeats share it."""
        return self._timeless.which

    @property
    def effects_that_act(self) -> list[str]:
        """Effects and instruments of the machine file that change these readings, for headings."""
        every, idle = (*self.base.effects, *self.base.instruments), idle_on(self.base, self.data)
        return [active.effect.name for active in every if active.effect.name not in idle]

    def log_stiffness(self, law: ArrayLike = NO_CHANGE, effects: Sequence[ActiveEffect] = ()) -> FloatArray:
        """(n,) ln(N/m) that the readings should show; nan where the model has no stiffness.

        `effects` come on top of those of the machine file; instruments among them change the readings only. The last
        answers are kept: a fit begins where the one before it ended, and asks for the same again.
        """
        chosen = tuple((active.effect.name, *active.values.items()) for active in effects)
        key = (*np.asarray(law, dtype=float).tolist(), chosen)
        if key not in self._answers:
            while len(self._answers) >= ANSWERS_KEPT:
                self._answers.pop(next(iter(self._answers)))
            self._answers[key] = self._solved(law, effects)
        return self._answers[key].copy()

    def _solved(self, law: ArrayLike, effects: Sequence[ActiveEffect]) -> FloatArray:
        machine = self.machine.with_changes(strut_law=scaled_law(self.machine.strut_law, law))
        own = [active for active in effects if active.effect.is_instrument]
        if own and not self.base.instruments:  # instruments read the same mechanics whatever their sizes
            logs = self.log_stiffness(law, [active for active in effects if not active.effect.is_instrument])
            return self._read(np.exp(logs), own, build_model(machine, self.effect_files, effects).machine)
        model = build_model(machine, self.effect_files, effects)
        prepared = self._timed if any("time_min" in a.effect.needs for a in model.effects) else self._timeless
        try:
            stiffness = self._mechanics(model, prepared)[prepared.which]
        except InputError:  # unreachable pose or no stiffness: a fit turns away from there
            return np.full(len(self.data), np.nan)
        return self._read(stiffness, model.instruments, model.machine)

    def _read(self, stiffness: FloatArray, instruments: Sequence[ActiveEffect], machine: MachineTool) -> FloatArray:
        """(n,) ln of the stiffnesses that the instruments show for true ones (n,)."""
        if instruments:
            path = replace(self.full_path, machine_tool=machine)
            for active in instruments:
                stiffness = shown_by(active, stiffness, path, self.data)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.where(stiffness > 0.0, np.log(stiffness), np.nan))

    def _mechanics(self, model: StiffnessModel, prepared: _Prepared) -> FloatArray:
        """(m,) N/m at the distinct rows."""
        given, now = (as_hexapod(machine, "a prediction") for machine in (self.base.machine, model.machine))
        if now.platform_joints is given.platform_joints and now.frame_joints is given.frame_joints:
            path = replace(prepared.path, machine_tool=model.machine)
            return mechanical_stiffness(model, path, prepared.data, prepared.forces)
        return mechanical_stiffness(model, measured_path(model, prepared.data), prepared.data)

    @cached_property
    def full_path(self) -> LoadPath:
        """Load path with a row per reading, as instruments see it."""
        data, missing = self.data, self.data.missing
        return replace(
            self._timeless.path.take(self._timeless.which),
            time=None if "time_min" in missing else data.time,
            temperature=None if "temperature_C" in missing else data.temperature,
        )

    def strut_lengths(self) -> FloatArray:
        """(n, 6) m."""
        return np.asarray(self._timeless.path.struts.lengths[self._timeless.which])

    def strut_forces(self) -> FloatArray:
        """(n, 6) force in each strut per unit load, tension positive."""
        return np.asarray(self._timeless.forces[self._timeless.which])

    def strut_columns(self) -> FloatArray:
        """(n, 6) d ln k / d ln(stiffness of strut i) at the machine file's strut law: its share of the compliance."""
        prepared, law = self._timeless, self.machine.strut_law
        softness = 1.0 / law.stiffness(prepared.path.struts.lengths)
        return np.asarray((prepared.products * softness * np.exp(self._base_log)[:, None])[prepared.which])

    def struts_carry_all(self, effects: Iterable[Effect]) -> bool:
        """True if neither these effects nor the machine file's change geometry, equilibrium or readings."""
        every = (*effects, *(active.effect for active in (*self.base.effects, *self.base.instruments)))
        hooks = ("geometry", "parallel_stiffness", "reading")
        return not any(hook in effect.hooks for effect in every for hook in hooks)

    def law_columns(self, log_stiffness: FloatArray, law: ArrayLike = NO_CHANGE) -> FloatArray:
        """(n, 2) d ln k / d law where the model predicts `log_stiffness` (n,).

        The struts' forces are those of equilibrium, so this is exact unless a stiffness parallel to the struts
        shares the load or the geometry differs; good enough there for a Gauss-Newton step.
        """
        return np.asarray((-self.strut_part_and_slopes(law)[1] * np.exp(log_stiffness)).T)

    def strut_part(self, law: ArrayLike = NO_CHANGE) -> FloatArray:
        """(..., n) m/N that the struts contribute to the compliance along each reading, for laws (..., 2)."""
        return self.strut_part_and_slopes(law)[0]

    def strut_part_and_slopes(self, law: ArrayLike = NO_CHANGE) -> tuple[FloatArray, FloatArray]:
        """`strut_part`, and its derivatives (..., 2, n) to the law's logarithms: they add up to minus the part."""
        logs, rule = np.asarray(law, dtype=float), self.machine.strut_law
        first, second = (  # (..., 6, m) N/m: contributions of the law's two constants to each strut
            constant * np.exp(logs[..., k, None, None]) * self._law_shares[k]
            for k, constant in enumerate((rule.stiffness_1, rule.stiffness_2))
        )
        stiffness = first + second
        energy = np.ascontiguousarray(self._timeless.products.T) / stiffness
        part = energy.sum(axis=-2)
        by_first = (energy * (first / stiffness)).sum(axis=-2)
        which = self._timeless.which
        return part[..., which], -np.stack([by_first, part - by_first], axis=-2)[..., which]

    @cached_property
    def _law_shares(self) -> tuple[FloatArray, FloatArray]:
        """(6, m) shares of the law's two constants in each strut's stiffness, by its length."""
        return self.machine.strut_law.weights(np.ascontiguousarray(self._timeless.path.struts.lengths.T))

    @cached_property
    def joint_columns(self) -> FloatArray:
        """(n, 36) d ln k / d (coordinate of a frame or platform joint), 1/m; the control is unaware of the error.

        The platform stands where struts of the commanded lengths put the true joints.
        """
        columns, prepared, given = [], self._timeless, self.base.machine
        for name in ("frame_joints", "platform_joints"):
            for strut, axis in np.ndindex(6, 3):
                joints = np.array(getattr(given, name))
                joints[strut, axis] += JOINT_STEP
                moved = given.with_changes(**{name: joints})
                model = replace(self.base, machine=moved, control=self.base.control or given)
                stiffness = mechanical_stiffness(model, measured_path(model, prepared.data), prepared.data)
                columns.append((np.log(stiffness) - self._base_log)[prepared.which] / JOINT_STEP)
        return np.stack(columns, axis=1)

    def rest_columns(self) -> FloatArray:
        """(n, 7) changes of ln k, each of rms 1, by a little give of the links that the model takes to be rigid.

        Of work and frame along X, Y, Z and in rocking, of platform and tool along their own three axes. Readings of
        loops beside the tip are left out.
        """
        data, path = self.data, self.full_path
        moment = np.cross(data.position, data.direction)
        along = np.einsum("nij,ni->nj", path.rotation, data.direction)
        added = np.column_stack([data.direction**2, (moment[:, :2] ** 2).sum(axis=1), along**2])
        columns = -added * np.exp(self._base_log[self.distinct])[:, None] * data.tip[:, None]
        return np.asarray(columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300))

    @cached_property
    def _base_log(self) -> FloatArray:
        """(m,) ln k of the machine file's model at the distinct rows, before instruments."""
        return np.asarray(np.log(self._mechanics(self.base, self._timeless)))


def idle_on(model: StiffnessModel, data: Readings) -> dict[str, str]:
    """Effects of the model that add nothing to these readings -> a sentence."""
    return idle_on_readings(model, data.missing, set(data.setup.tolist()))


def _prepare(model: StiffnessModel, data: Readings, timed: bool) -> _Prepared:
    """Mechanically distinct rows, each solved once, so that repeats cost nothing."""
    setups = np.unique(data.setup, return_inverse=True)[1]
    columns = [data.angles, data.direction, data.force, data.tool_extension, setups]
    columns += [np.nan_to_num(data.temperature, nan=-1e3)]
    columns += [np.nan_to_num(data.time, nan=-1.0)] if timed else []
    if data.beside is not None:
        beside = data.beside
        columns += [beside.which, beside.offset, beside.toward, np.nan_to_num(beside.length)]
    keys = np.column_stack([data.position, *columns])
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    distinct = data.select(first)
    path = measured_path(model, distinct)
    wrenches = np.zeros((len(distinct), 6, 1))
    wrenches[:, :3, 0] = distinct.direction
    _, forces = exact.respond(path, *exact.assemble_links(model, path), wrenches)
    products, few = forces[..., 0] ** 2, distinct.beside
    if few is not None:
        products = law_products(forces[..., 0], few.loops, few.which) * few.toward[:, None]
    return _Prepared(distinct, which.reshape(-1).astype(np.int64), path, forces[..., 0], products)
