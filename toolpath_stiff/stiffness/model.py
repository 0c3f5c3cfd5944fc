"""A stiffness model: a machine with its physical effects, and the effects that act on a program.

Measurements bring set-up, time and temperature reading by reading. A program does not: what it runs under are the
model's `Conditions`. An effect without a condition that it waits for adds nothing, which must not pass unnoticed:
every result says so in the same words.
"""

import shlex
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import EffectError, InputError
from toolpath_stiff.machine.elements import TORSION, Stance
from toolpath_stiff.machine.kinematics import Struts, forward_kinematics, solve_struts
from toolpath_stiff.machine.limits import solved
from toolpath_stiff.machine.model import EffectEntry, Hexapod, MachineTool, as_hexapod
from toolpath_stiff.rotations import roll_pitch_yaw, rotation_matrices
from toolpath_stiff.stiffness.active import ActiveEffect, read_parameters
from toolpath_stiff.stiffness.as_built import as_built
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects
from toolpath_stiff.stiffness.contract import ELEMENT, SETUP, Conditions, LoadPath
from toolpath_stiff.stiffness.effects.platform_flexibility import PlatformFlexibility
from toolpath_stiff.units import m_from_nm

NO_SETUP = "none"  # a user's word for a set-up to which no effect belongs
STEP = 0.01  # of a standard deviation, step of differences: stiffness is linear over it, and rounding far smaller
WORDS = {
    "temperature_C": "the temperature, which is not given (--temperature)",
    "time_min": "the time since an indicator was zeroed, which no program has",
    "direction": "the direction of a reading, which no program has",
}


@dataclass(frozen=True)
class StiffnessModel:
    """Everything from which the stiffness is computed.

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
        Under what programs run; measurements bring their own. `acting_effects` says which effects that leaves.
    unchecked
        What every result says of effects that fail `effects check` and were allowed all the same.
    """

    machine: MachineTool
    effects: tuple[ActiveEffect, ...] = ()
    instruments: tuple[ActiveEffect, ...] = ()
    control: MachineTool | None = None
    given: MachineTool | None = None
    conditions: Conditions = field(default_factory=Conditions)
    unchecked: tuple[str, ...] = ()

    @property
    def load_dependent(self) -> bool:
        """True if the stiffness depends on the size of the load (it is then the secant one)."""
        return any(active.effect.load_dependent for active in self.effects)


def build_model(
    machine: MachineTool,
    effect_files: Iterable[str | Path] = (),
    extra: Iterable[ActiveEffect] = (),
    conditions: Conditions | None = None,
) -> StiffnessModel:
    """Model of a machine with the effects of its file and any extra ones.

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

    Examples
    --------
    How far the tip gives way in its softest direction; then with one strut at 70 % of its stiffness:

    >>> import numpy as np
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.stiffness import core
    >>> from toolpath_stiff.stiffness.active import ActiveEffect, read_parameters
    >>> from toolpath_stiff.stiffness.catalogue import find_effect
    >>> machine = load_machine("nist")
    >>> weak = ActiveEffect(find_effect("weak_strut"), {"strut": 1, "factor": 0.7})
    >>> for model in (build_model(machine), build_model(machine, extra=[weak])):
    ...     compliance = core.tip_compliance(model, np.array([[0.0, 0.0, 0.8]]))
    ...     print(f"{1e9 * np.linalg.eigvalsh(compliance[0])[-1]:.2f} nm/N")
    18.24 nm/N
    21.14 nm/N
    """
    files = tuple(effect_files)
    if files:
        known_effects(files)  # a file that cannot be loaded is an error even if the machine names none of its effects
    kinds = (("effect", machine.effects), ("instrument", machine.instruments))
    actives = [_activate(machine, kind, entry, files) for kind, entries in kinds for entry in entries]
    if isinstance(machine, Hexapod) and np.isfinite(machine.platform_bar_stiffness):
        actives.insert(0, ActiveEffect(PlatformFlexibility(), {"bar_stiffness": machine.platform_bar_stiffness}))
    actives += [as_built(machine.as_built)] if isinstance(machine, Hexapod) and machine.as_built is not None else []
    actives += extra
    keys = [(active.effect.name, active.values.get(ELEMENT)) for active in actives]  # each once, or once an element
    beside = "elements" if isinstance(machine, Hexapod) else "hexapods"
    for active in actives:
        if active.effect.holds_for == beside:
            only = "hexapods" if beside == "hexapods" else "machines of elements"
            mistake = f"effect {active.effect.name} holds on {only} only, {machine.name} is of kind {machine.kind}"
            raise EffectError(mistake, hint="leave it out")
    for name, element in keys:
        if keys.count((name, element)) > 1:
            hint = "keep one of them (finite platform bars count as platform_flexibility)"
            raise EffectError(f"machine {machine.name}: effect {name} is given twice", hint=hint)
    return _assembled(machine, actives, conditions or Conditions(machine.setup, machine.temperature))


def _assembled(given: MachineTool, actives: Sequence[ActiveEffect], conditions: Conditions) -> StiffnessModel:
    """Model with geometry effects applied one by one, to the true machine and to that which the control assumes."""
    effects = tuple(active for active in actives if not active.effect.is_instrument)
    machine = control = given
    for active in effects if isinstance(given, Hexapod) else ():
        machine = active.geometry(as_hexapod(machine, "a geometry"))
        if not active.effect.unknown_to_control:
            control = active.geometry(as_hexapod(control, "a geometry"))
    return StiffnessModel(
        machine,
        effects,
        instruments=tuple(active for active in actives if active.effect.is_instrument),
        control=control if any(active.effect.unknown_to_control for active in effects) else None,
        given=given,
        conditions=conditions,
    )


def with_parameter_moved(model: StiffnessModel, name: str, change: float) -> StiffnessModel:
    """Model with one of the machine's fitted parameters changed.

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
        raise EffectError(f"a model without its machine has no parameter {name!r}")
    given, actives = model.given, [*model.effects, *model.instruments]
    if isinstance(given, Hexapod) and name in given.strut_law.parameters:
        return _assembled(given.with_changes(strut_law=given.strut_law.moved(name, change)), actives, model.conditions)
    if (joint := name.removesuffix(TORSION)) != name:
        softer = {ELEMENT: joint, "compliance": m_from_nm(change)}
        return _assembled(given, [*actives, ActiveEffect(find_effect("joint_torsion"), softer)], model.conditions)
    for i, active in enumerate(actives):
        for parameter in active.effect.parameters:
            if name == f"{active.effect.name}.{parameter.key}" and not parameter.discrete:
                value = active.values[parameter.name] + change * parameter.si
                low, high = (bound * parameter.si for bound in parameter.bounds)
                if not low <= value <= high:
                    raise EffectError(f"{name} = {value / parameter.si:g}", expected=parameter.expected)
                actives[i] = replace(active, values={**active.values, parameter.name: value})
                return _assembled(given, actives, model.conditions)
    raise EffectError(f"machine {given.name} has no parameter {name!r}")


def _activate(machine: MachineTool, kind: str, entry: EffectEntry, files: tuple[str | Path, ...]) -> ActiveEffect:
    try:
        effect = find_effect(entry.name, files)
    except InputError as error:
        if error.file:  # one of the files with effects
            raise
        raise entry.error(error.found, "name", error.expected, error.hint) from None
    if effect.is_instrument != (kind == "instrument"):
        right, acts_on = ("instrument", "readings") if effect.is_instrument else ("effect", "the machine")
        acts = f"[[{kind}]] {entry.name} acts on {acts_on}"
        raise entry.error(acts, hint=f"write it as [[{right}]]", where=f"machine {machine.name}")
    return ActiveEffect(effect, read_parameters(effect, entry, f"machine {machine.name}, [[{kind}]]"))


def load_path(
    model: StiffnessModel,
    position: ArrayLike,
    rotation: FloatArray | None = None,
    tool_length: ArrayLike = np.nan,
    force: ArrayLike = defaults.FORCE,
    **seen: Any,
) -> LoadPath:
    """Load path at n poses, as the effects see it; see `LoadPath` for shapes and units.

    `rotation` None is a vertical spindle; `tool_length` nan the reference tool (m, scalar or (n,)). `seen` are
    `setup`, `time`, `temperature`, `direction` where they are known.

    Raises
    ------
    InputError
        The control computes strut lengths with which the true machine has no pose near the programmed one.
    """
    tip = np.atleast_2d(np.asarray(position, dtype=float))
    n = len(tip)
    length = np.broadcast_to(np.asarray(tool_length, dtype=float), (n,))
    if isinstance(model.control, Hexapod) and n:  # the struts get the lengths that the control computes
        hexapod = as_hexapod(model.machine, "a control")
        turn = np.broadcast_to(np.eye(3) if rotation is None else np.asarray(rotation, dtype=float), (n, 3, 3))
        lengths = solve_struts(model.control, tip, turn, length).lengths
        poses = forward_kinematics(hexapod, lengths, np.hstack([tip, roll_pitch_yaw(turn)]), length)
        tip, rotation = poses[:, :3], rotation_matrices(poses[:, 3:])
    stance = solved(model.machine, tip, rotation, length)
    if isinstance(stance, Stance):
        return path_of_stance(model, stance, length, force, **seen)
    return _path(model, stance, tip, rotation, length, force, seen)


def path_of_stance(
    model: StiffnessModel,
    stance: Stance,
    tool_length: ArrayLike = np.nan,
    force: ArrayLike = defaults.FORCE,
    **seen: Any,
) -> LoadPath:
    """Load path of a machine of elements whose control believes this stance; arguments as for `load_path`."""
    true, joints = model.machine, stance.joints
    for active in model.effects:
        true, joints = active.stands(true, joints)
    if joints is not stance.joints or true is not model.machine:
        stance = true.standing(joints, tool_length)
    return _path(model, stance, stance.position, stance.rotation, tool_length, force, seen)


def _path(
    model: StiffnessModel,
    stance: Struts | Stance,
    position: FloatArray,
    rotation: FloatArray | None,
    tool_length: ArrayLike,
    force: ArrayLike,
    seen: Document,
) -> LoadPath:
    n = len(position)
    return LoadPath(
        machine_tool=model.machine,
        position=position,
        rotation=np.broadcast_to(np.eye(3) if rotation is None else np.asarray(rotation, dtype=float), (n, 3, 3)),
        stance=stance,
        tool_extension=np.broadcast_to(model.machine.extension(tool_length), (n,)),
        force=np.broadcast_to(np.asarray(force, dtype=float), (n,)),
        **seen,
    )


def waiting_effects(model: StiffnessModel) -> dict[str, str]:
    """Effects that add nothing to a program because a condition is not given -> what they need; never instruments."""
    waiting = {}
    for active in model.effects:
        options = f"(--setup {shlex.quote(active.setup or 'NAME')}, or --setup {NO_SETUP})"
        which = f"the set-up {active.setup!r}" if active.setup else "the set-up"
        words = WORDS | {SETUP: f"{which}, and it is not known which one this is {options}"}
        if missing := [words[condition] for condition in active.waits_for if condition not in model.conditions.known]:
            waiting[active.effect.name] = f"it needs {'; '.join(missing)}"
    return waiting


def effects_elsewhere(model: StiffnessModel) -> dict[str, str]:
    """Effects that belong to another set-up than the program's -> that set-up."""
    setup, waiting = model.conditions.setup, waiting_effects(model)
    here = f"this is {setup!r}" if setup else "that is not there"
    return {
        active.effect.name: f"it belongs to set-up {active.setup!r}, and {here}"
        for active in model.effects
        if SETUP in active.waits_for and active.setup not in ("", setup) and active.effect.name not in waiting
    }


def idle_effects(model: StiffnessModel) -> dict[str, str]:
    """All effects that add nothing to a program under the model's conditions -> the reason, the end of a sentence."""
    return waiting_effects(model) | effects_elsewhere(model)


def parameter_slopes(
    model: StiffnessModel, quantity: Callable[[StiffnessModel], FloatArray], here: FloatArray
) -> dict[int, FloatArray]:
    """Row in the machine file's uncertainty -> slope of a quantity, for each fitted parameter that acts.

    A slope is the change from `here` for a standard deviation of the parameter, away from a bound that is near.
    """
    uncertainty, slopes = model.given.uncertainty if model.given is not None else None, dict[int, FloatArray]()
    idle = {active.effect.name for active in model.instruments} | idle_effects(model).keys()
    sds = zip(uncertainty.names, uncertainty.sd.tolist(), strict=True) if uncertainty is not None else ()
    for row, (name, sd) in enumerate(sds):
        if sd <= 0.0 or name.partition(".")[0] in idle:
            continue
        for step in (STEP, -STEP):
            with suppress(InputError):
                slopes[row] = (quantity(with_parameter_moved(model, name, step * sd)) - here) / step
                break
        if row not in slopes:
            room = f"no room between its bounds for a standard deviation of {sd:g}"
            raise InputError(f"[uncertainty]: {name} has {room}")
    return slopes


def acting_effects(model: StiffnessModel) -> tuple[ActiveEffect, ...]:
    """Effects that act on a program: those listed in headings."""
    idle = idle_effects(model)
    return tuple(active for active in model.effects if active.effect.name not in idle)


def acting_names(model: StiffnessModel) -> list[str]:
    """Names of the effects that act."""
    return [active.effect.name for active in acting_effects(model)]


def condition_warnings(model: StiffnessModel) -> list[str]:
    """Sentences on what in the model does not act on a program, lacking a condition or being an instrument."""
    warnings = list(model.unchecked)
    if model.instruments:
        names = ", ".join(active.effect.name for active in model.instruments)
        warnings.append(f"instrument effects ignored, since they act on readings and not on the machine: {names}")
    warnings += [f"{name} does not act: {reason}" for name, reason in waiting_effects(model).items()]
    if secant := ", ".join(active.effect.name for active in acting_effects(model) if active.effect.load_dependent):
        warnings.append(f"softest and stiffest directions are those without {secant}, the stiffness along them is with")
    setup, machine = model.conditions.setup, model.given or model.machine
    if setup and setup != machine.setup and not any(SETUP in active.waits_for for active in model.effects):
        warnings.append(f"set-up {setup!r} changes nothing: no effect of machine {machine.name} depends on it")
    return warnings


def conditions_stated(model: StiffnessModel) -> list[str]:
    """Sentences on the set-up and temperature that the results assume, and on effects that do not act then."""
    setup, temperature = model.conditions.setup, model.conditions.temperature
    return [
        *([] if setup is None else [f"set-up: {setup or NO_SETUP}"]),
        *([] if temperature is None else [f"temperature: {temperature:g} degrees C"]),
        *(f"{name} does not act: {reason}" for name, reason in effects_elsewhere(model).items()),
    ]


def effects_stated(model: StiffnessModel) -> Document:
    """Entries of a result's JSON: effects that act, effects that do not and why, set-up and temperature."""
    return {
        "effects": acting_names(model),
        "effects_idle": [{"effect": name, "reason": reason} for name, reason in idle_effects(model).items()],
        "setup": NO_SETUP if model.conditions.setup == "" else model.conditions.setup,
        "temperature_C": model.conditions.temperature,
    }


def machine_words(document: Document) -> str:
    """Machine of a result, its active effects, the set-up: "nist with setup_compliance, set-up riser"."""
    effects = document.get("effects") or []
    parts = [f"{document.get('machine') or '-'}" + (f" with {', '.join(map(str, effects))}" if effects else "")]
    return ", ".join(parts + ([f"set-up {document['setup']}"] if document.get("setup") else []))


def idle_on_readings(model: StiffnessModel, missing: Collection[str], setups: Collection[str]) -> dict[str, str]:
    """Effects and instruments of the model that add nothing to readings -> a sentence on the reason.

    `missing`: columns that the readings lack; `setups`: names that occur in them.
    """
    sentences = {}
    for active in (*model.effects, *model.instruments):
        lacking = ", ".join(condition for condition in active.waits_for if condition in missing)
        if lacking or (SETUP in active.waits_for and active.setup not in ("", *setups)):
            why = f"column {lacking} is missing" if lacking else f"none is of set-up {active.setup!r}"
            name = active.effect.name
            sentences[name] = f"{name} of the machine file does not act on these readings: {why}"
    return sentences


def check_setup(setup: str, said_by: str, *models: StiffnessModel) -> None:
    """Refuse a set-up that no machine file lists and no effect names; any is accepted if none is known.

    Raises `InputError`, which begins with `said_by`.
    """
    listed = [name for model in models for name in (model.given or model.machine).setups]
    effects = [active for model in models for active in (*model.effects, *model.instruments)]
    known = list(dict.fromkeys(filter(None, [*listed, *(active.setup for active in effects)])))
    takes_any = any(SETUP in active.effect.needs and not active.setup for active in effects)
    if setup in ("", NO_SETUP, *known) or takes_any or not known:
        return
    expected = f"one of {', '.join(known)}, or {NO_SETUP}; a machine file lists them as `names` of [setup]"
    raise EffectError(f"{said_by}: set-up {setup!r} is not known", expected=expected)
