"""A stiffness model: a machine with the physical effects that it carries, ready to be evaluated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.forward import forward_kinematics
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.model import EffectEntry, Machine
from toolpath_stiff.machine.uncertainty import STRUT_LAW, with_parameter
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.stiffness.effects import guard
from toolpath_stiff.stiffness.effects.contract import DEFAULT_FORCE, Conditions, Effect, LoadPath, read_parameters
from toolpath_stiff.stiffness.effects.platform_flexibility import PlatformFlexibility
from toolpath_stiff.stiffness.effects.registry import find_effect, known_effects

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ActiveEffect:
    """An effect with its parameters, name -> SI value."""

    effect: Effect
    values: Mapping[str, float]

    def adds(self, hook: str, path: LoadPath) -> FloatArray | None:
        """What `strut_compliance`, `load_compliance` or `parallel_stiffness` returns; None where it does not act.

        Raises `EffectFault`.
        """
        if not self.effect.acts_on(path, self.values):
            return None
        return guard.added(self.effect, hook, path, self.values)

    def geometry(self, machine: Machine) -> Machine:
        """The machine with the effect's geometry. Raises `EffectFault`."""
        return guard.changed_geometry(self.effect, machine, self.values)

    def reading(self, stiffness: FloatArray, path: LoadPath) -> FloatArray:
        """What an instrument shows, (n,) N/m, for a true stiffness; the same where it does not act.

        Raises `EffectFault`.
        """
        if not self.effect.acts_on(path, self.values):
            return stiffness
        return guard.read_off(self.effect, stiffness, path, self.values)


@dataclass(frozen=True)
class StiffnessModel:
    """What the stiffness is computed from.

    Attributes
    ----------
    machine
        The machine with its geometry effects applied; kinematics and stiffness use this one.
    effects
        Effects that act on the machine, platform bars included.
    instruments
        Effects that act on readings; only comparisons with measurements use them.
    control
        The machine that the control computes with, where effects make the true one differ unknown to it; else None.
    given
        The machine as it was loaded, before geometry effects; None for a model that `build_model` did not make.
    conditions
        Under what programs run; measurements bring their own. `acting` says which effects that leaves.
    """

    machine: Machine
    effects: tuple[ActiveEffect, ...] = ()
    instruments: tuple[ActiveEffect, ...] = ()
    control: Machine | None = None
    given: Machine | None = None
    conditions: Conditions = field(default_factory=Conditions)

    @property
    def load_dependent(self) -> bool:
        """Whether the stiffness depends on the size of the load (it is then the secant one)."""
        return any(active.effect.load_dependent for active in self.effects)

    @property
    def platform_bars(self) -> float:
        """Stiffness of the platform bars in N/m, inf if rigid; only meaningful if `is_plain`."""
        for active in self.effects:
            if isinstance(active.effect, PlatformFlexibility):
                return active.values["bar_stiffness"]
        return float(np.inf)

    @property
    def is_plain(self) -> bool:
        """Whether linear struts and platform bars are all there is, so that the fast kernels apply."""
        return all(type(active.effect) is PlatformFlexibility for active in self.effects)


def build_model(
    machine: Machine,
    effect_files: Iterable[str | Path] = (),
    extra: Iterable[ActiveEffect] = (),
    conditions: Conditions | None = None,
) -> StiffnessModel:
    """The model of a machine with the effects of its file and any extra ones.

    Parameters
    ----------
    machine
        As loaded.
    effect_files
        Python files with a user's own effects, which the machine's entries may name.
    extra
        Further effects, after those of the machine.
    conditions
        Under what programs run; unless given, what the machine file says.

    Raises
    ------
    InputError
        An entry names an unknown effect or has wrong parameters, or an effect appears twice.
    """
    files = tuple(effect_files)
    if files:
        known_effects(files)  # a file that cannot be loaded is an error even if the machine names none of its effects
    acting = [_activate(machine, entry, files, instrument=False) for entry in machine.effects]
    reading = [_activate(machine, entry, files, instrument=True) for entry in machine.instruments]
    if np.isfinite(machine.platform_bar_stiffness):
        bars = ActiveEffect(PlatformFlexibility(), {"bar_stiffness": machine.platform_bar_stiffness})
        acting.insert(0, bars)
    for active in extra:
        (reading if active.effect.is_instrument else acting).append(active)
    names = [active.effect.name for active in (*acting, *reading)]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"machine {machine.name}: effect {name} is given twice",
                hint="keep one of them (finite platform bars count as platform_flexibility)",
            )
    return _assembled(machine, acting, reading, conditions or Conditions(machine.setup, machine.temperature))


def _assembled(
    given: Machine, acting: Sequence[ActiveEffect], reading: Sequence[ActiveEffect], conditions: Conditions
) -> StiffnessModel:
    """Geometry effects applied one after the other, to the true machine and to what the control takes it for."""
    machine = control = given
    for active in acting:
        machine = active.geometry(machine)
        if not active.effect.unknown_to_control:
            control = active.geometry(control)
    deceived = any(active.effect.unknown_to_control for active in acting)
    return StiffnessModel(machine, tuple(acting), tuple(reading), control if deceived else None, given, conditions)


def with_parameter_moved(model: StiffnessModel, name: str, change: float) -> StiffnessModel:
    """The model with one of the machine's fitted parameters changed.

    Parameters
    ----------
    model
        As `build_model` made it.
    name, change
        A name as in `Uncertainty.names`; what is added to it, in the unit of the machine file's key.

    Raises
    ------
    InputError
        The model has no such parameter, or it leaves its bounds.
    """
    if model.given is None:
        raise InputError(f"a model without its machine has no parameter {name!r}")
    if name in STRUT_LAW:
        moved = with_parameter(model.given, name, change)
        return _assembled(moved, model.effects, model.instruments, model.conditions)
    owner, _, key = name.partition(".")
    effects = {"effects": list(model.effects), "instruments": list(model.instruments)}
    for kind in effects.values():
        for i, active in enumerate(kind):
            parameter = next((p for p in active.effect.parameters if p.key == key), None)
            if active.effect.name == owner and parameter is not None and not parameter.discrete:
                value = active.values[parameter.name] + change * parameter.si
                low, high = (bound * parameter.si for bound in parameter.bounds)
                if not low <= value <= high:
                    raise InputError(f"{name} = {value / parameter.si:g}", expected=parameter.expected)
                kind[i] = ActiveEffect(active.effect, {**active.values, parameter.name: value})
                return _assembled(model.given, effects["effects"], effects["instruments"], model.conditions)
    raise InputError(f"machine {model.given.name} has no parameter {name!r}")


def _activate(machine: Machine, entry: EffectEntry, files: tuple[str | Path, ...], instrument: bool) -> ActiveEffect:
    kind = "instrument" if instrument else "effect"
    where = f"machine {machine.name}, [[{kind}]]"
    try:
        effect = find_effect(entry.name, files)
    except InputError as error:
        if error.file:  # one of the files with effects
            raise
        raise entry.error(error.found, "name", error.expected, error.hint) from None
    if effect.is_instrument != instrument:
        acts = f"[[{kind}]] {entry.name} acts on {'readings' if effect.is_instrument else 'the machine'}"
        hint = f"write it as [[{'effect' if instrument else 'instrument'}]]"
        raise entry.error(acts, hint=hint, where=f"machine {machine.name}")
    return ActiveEffect(effect, read_parameters(effect, entry, where))


def load_path(
    model: StiffnessModel,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    tool_length: ArrayLike = np.nan,
    force: ArrayLike = DEFAULT_FORCE,
    setup: NDArray[np.str_] | None = None,
    time: FloatArray | None = None,
    temperature: FloatArray | None = None,
    direction: FloatArray | None = None,
) -> LoadPath:
    """What the effects see at n poses; see `LoadPath` for shapes and units.

    `rotation` None is a vertical spindle; `tool_length` nan the reference tool (m, scalar or (n,)).
    """
    tip = np.atleast_2d(np.asarray(position, dtype=float))
    n = len(tip)
    length = np.broadcast_to(np.asarray(tool_length, dtype=float), (n,))
    one_length = length[0] if n and (np.isnan(length).all() or np.ptp(length) == 0.0) else length
    if model.control is not None and n:
        tip, rotation = _where_control_goes(model, tip, rotation, length)
    struts = solve_struts(model.machine, tip, rotation, one_length)
    turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    return LoadPath(
        machine=model.machine,
        position=tip,
        rotation=np.broadcast_to(turn, (n, 3, 3)),
        struts=struts,
        tool_extension=np.where(np.isnan(length), 0.0, length - model.machine.reference_tool_length),
        force=np.broadcast_to(np.asarray(force, dtype=float), (n,)),
        direction=direction,
        setup=setup,
        time=time,
        temperature=temperature,
    )


def _where_control_goes(
    model: StiffnessModel, position: FloatArray, rotation: ArrayLike | None, tool_length: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """True tips and orientations: the struts get the lengths that the control computes for the programmed poses.

    Raises `InputError` where the true machine has no pose with these lengths near the programmed one.
    """
    assert model.control is not None
    turn = np.broadcast_to(np.eye(3) if rotation is None else np.asarray(rotation, dtype=float), (len(position), 3, 3))
    lengths = solve_struts(model.control, position, turn, tool_length).lengths
    poses = np.concatenate([position, roll_pitch_yaw(turn)], axis=1)
    for tool in np.unique(tool_length):  # nan, the reference tool, counts as one value
        rows = np.isnan(tool_length) if np.isnan(tool) else tool_length == tool
        poses[rows] = forward_kinematics(model.machine, lengths[rows], poses[rows], float(tool))
    return poses[:, :3], rotation_matrices(poses[:, 3:])
