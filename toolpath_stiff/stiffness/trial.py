"""Trial of an effect against the contract on a machine: the results of `tps effects check`."""

import pickle
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import to_dict
from toolpath_stiff.errors import EffectError, EffectFault, InputError
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.machine.elements import turns
from toolpath_stiff.machine.kinematics import solve_struts
from toolpath_stiff.machine.limits import reach, solved
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import effects_from_file
from toolpath_stiff.stiffness.contract import ELEMENT, Effect, LoadPath, Parameter, Values
from toolpath_stiff.stiffness.core import solver_of
from toolpath_stiff.stiffness.effect_source import file_of, is_foreign
from toolpath_stiff.stiffness.model import StiffnessModel, build_model, load_path
from toolpath_stiff.units import RAD_PER_DEG, rad_from_deg

POSES, DRAWN = 24, 600
AROUND = 0.3  # m around the default origin of a machine of elements
LEANING = rad_from_deg(10.0)  # largest roll, pitch and yaw of the poses
SETUPS = ("riser", "table")
ALLOW = "--allow-unchecked-effects"
SAME = 1e-9  # relative: of results that must agree

# SI values of parameters' units.
PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}
UNITS = {prefix + unit: factor for prefix, factor in PREFIXES.items() for unit in ("m", "N", "rad", "s")}
UNITS |= {"": 1.0, "m": 1.0, "N": 1.0, "rad": 1.0, "s": 1.0, "K": 1.0, "C": 1.0, "deg": RAD_PER_DEG}
UNITS |= {"%": 1e-2, "percent": 1e-2, "1": 1.0, "min": 60.0, "h": 3600.0}


@dataclass(frozen=True)
class TrialOutcome:
    """One check: its name, its result (None: for information), what was found."""

    name: str
    passed: bool | None
    found: str


def own_effects(model: StiffnessModel, effect_files: Iterable[str | Path]) -> list[Effect]:
    """Effects from outside the package that act in a model or compete from a file; each once."""
    acting = [active.effect for active in (*model.effects, *model.instruments) if is_foreign(active.effect)]
    in_files = (effect for file in effect_files for effect in effects_from_file(file).values())
    return list(dict.fromkeys([*acting, *in_files]))


def refuse_failing(effects: Iterable[Effect], machine: MachineTool, machine_name: str) -> None:
    """Raise `InputError` for the first effect from outside the package that fails on the named machine."""
    for effect, reason in _failing(effects, machine):
        check = command_line("effects", "check", file_of(effect), *options(machine=machine_name))
        hint = f"`{check}` says more; with {ALLOW} (allow_unchecked_effects=True) it is used all the same"
        raise EffectError(f"effect {effect.name} {reason}", file=file_of(effect), hint=hint)


def failures(effects: Iterable[Effect], machine: MachineTool) -> list[str]:
    """Sentences in results on effects that were used although they fail."""
    return [f"UNCHECKED effect {effect.name} ({ALLOW}): it {reason}" for effect, reason in _failing(effects, machine)]


def _failing(effects: Iterable[Effect], machine: MachineTool) -> Iterator[tuple[Effect, str]]:
    """Effects that fail `effects check`, each with the end of a sentence."""
    plain = pickle.dumps(machine.with_changes(effects=(), instruments=()))
    return ((effect, reason) for effect in effects if (reason := _failure(effect, plain)))


@lru_cache(maxsize=256)
def _failure(effect: Effect, machine: bytes) -> str:
    try:
        outcomes = try_effect(effect, pickle.loads(machine))
    except InputError as error:
        return f"cannot be tried: {error}"
    return "; ".join(f"fails the check of its {row.name}: {row.found}" for row in outcomes if row.passed is False)


def try_effect(effect: Effect, machine: MachineTool, seed: int = 0) -> list[TrialOutcome]:
    """Try an effect on a machine, by itself: at its neutral value and typical values.

    Parameters
    ----------
    effect
        Loaded, so that its declarations are sound.
    machine
        Its own effects are left out.
    seed
        Of the poses, which lie within the machine's reach, tilted up to 10 degrees.
    """
    outcomes = [_unit(parameter) for parameter in effect.parameters if parameter.kind == "real"]
    try:
        outcomes += _behaviour(effect, machine.with_changes(effects=(), instruments=()), seed)
    except (EffectFault, InputError) as error:
        outcomes.append(TrialOutcome("shapes" if isinstance(error, EffectFault) else "stiffness", False, str(error)))
    return outcomes


def _behaviour(effect: Effect, machine: MachineTool, seed: int) -> Iterator[TrialOutcome]:
    """Checks of the effect's results at some poses, for one set of parameters after the other."""
    plain, poses = build_model(machine), _poses(machine, seed)
    elements = () if isinstance(machine, Hexapod) else machine.elements
    names = [element.name for element in elements if turns(element) == (effect.link == "joints")]
    if effect.holds_for == "elements" and not names:
        raise InputError(f"machine {machine.name} has no such element", expected="one with it (--machine)")
    before, after = _shown(plain, _path(plain, poses)), {}
    for words, values in _parameter_sets(effect, names):
        model = build_model(machine, extra=[ActiveEffect(effect, values)])
        path = _path(model, poses)
        solver_of(machine).tip_compliance(model, path)  # raises if the compliance is impossible
        after[words] = _shown(model, path)
    alone = np.concatenate([_shown(model, path.take(slice(i, i + 1))) for i in range(len(path))])
    yield TrialOutcome("shapes", True, f"shapes, finite, symmetric, positive definite: {len(poses)} poses")
    change = float(np.abs(after["neutral"] / before - 1.0).max())
    mistake = f"there it changes the stiffness by up to {100.0 * change:.3g} %; it must not"
    yield TrialOutcome("neutral value", change <= SAME, "there the effect vanishes" if change <= SAME else mistake)
    changes = 100.0 * (after["typical, high"] / before - 1.0)
    if np.abs(changes).max() > 100.0 * SAME:
        span = f"{changes.min():+.3g} to {changes.max():+.3g} % (median {np.median(changes):+.3g} %)"
        yield TrialOutcome("size", None, f"at its upper typical value the stiffness changes by {span}")
    else:  # one drawn from readings may act only at a set-up, load or corner not among these poses
        passed = None if effect.described_from else False
        yield TrialOutcome("size", passed, "at its upper typical value it changes nothing at these poses")
    mixed = float(np.abs(alone / after["typical, high"] - 1.0).max())
    mistake = f"alone and together differ by up to {100.0 * mixed:.3g} %: the poses mix"
    yield TrialOutcome("poses", mixed <= SAME, "each alone gives what all together give" if mixed <= SAME else mistake)
    # Compliances can only soften the tip, parallel stiffnesses only stiffen it; other hooks may do both.
    softening = set(effect.hooks) <= {"strut_compliance", "load_compliance", "element_compliance"}
    side = 1.0 if softening else -1.0 if effect.hooks == ["parallel_stiffness"] else 0.0
    both_ways = any(p.kind == "real" and p.bounds[0] < p.neutral < p.bounds[1] for p in effect.parameters)
    if (side * changes > 100.0 * SAME).any() and not both_ways and not effect.described_from:
        mistake = f"{effect.hooks[0]} is negative; if both signs are meant, bound the parameter so"
        yield TrialOutcome("sign", False, mistake)


def _poses(machine: MachineTool, seed: int) -> FloatArray:
    """(n, 6) m and rad within reach, the default origin first; a machine of elements as upright as there."""
    origin = np.array(machine.default_origin)
    low, high = machine.limits.workspace
    of_struts = isinstance(machine, Hexapod)
    size = 0.25 * float(solve_struts(machine, origin[:3]).lengths.mean()) if isinstance(machine, Hexapod) else AROUND
    low, high = np.maximum(low, origin[:3] - size), np.minimum(high, origin[:3] + size)
    generator = np.random.default_rng(seed)
    place, lean = generator.uniform(low, high, (DRAWN, 3)), generator.uniform(-LEANING, LEANING, (DRAWN, 3))
    drawn = np.vstack([origin, np.column_stack([place, lean if of_struts else lean * 0.0 + origin[3:]])[1:]])
    turn = rotation_matrices(drawn[:, 3:])
    within = reach(machine, drawn[:, :3], solved(machine, drawn[:, :3], turn), turn).reachable
    return drawn[within][:POSES] if within.any() else drawn[:1]


def _parameter_sets(effect: Effect, elements: Sequence[str]) -> Iterator[tuple[str, Values]]:
    """Words -> SI values of the parameters."""
    for words, index in (("neutral", None), ("typical, low", 0), ("typical, high", 1)):
        values: dict[str, str | float] = {}
        for p in effect.parameters:
            if p.kind == "real":
                values[p.name] = p.si * (p.neutral if index is None else p.typical[index])
            elif p.name == ELEMENT:
                values[p.name] = elements[len(elements) // 2]
            else:
                values[p.name] = SETUPS[0] if p.kind == "text" else int(p.bounds[index or 0])
        yield words, values


def _path(model: StiffnessModel, poses: FloatArray) -> LoadPath:
    """Load path with everything that an effect may ask for: half of the poses on the riser, an hour of time, 5 K."""
    n = len(poses)
    ramp, turns = np.linspace(0.0, 1.0, n), rotation_matrices(poses[:, 3:])
    seen = {"setup": np.resize(SETUPS, n), "time": 3600.0 * ramp, "temperature": 20.0 + 5.0 * ramp}
    return load_path(model, poses[:, :3], turns, direction=np.resize(np.eye(3), (n, 3)), **seen)


def _shown(model: StiffnessModel, path: LoadPath) -> FloatArray:
    """(n,) N/m that a gauge shows, one direction a pose."""
    assert path.direction is not None
    stiffness = 1.0 / solver_of(model.machine).compliance_along(model, path, path.direction)
    for active in model.instruments:
        stiffness = active.reading(stiffness, path)
    return np.asarray(stiffness)


def _unit(parameter: Parameter) -> TrialOutcome:
    """Check that `si` agrees with the unit."""
    meant, name = unit_in_si(parameter.unit), f"unit of {parameter.name}"
    if meant is None:
        return TrialOutcome(name, None, f"{parameter.unit!r} is not known here; si = {parameter.si:g} is not checked")
    agrees, value = abs(parameter.si / meant - 1.0) <= SAME, f"one {parameter.unit or 'unit'} is {meant:g} in SI"
    return TrialOutcome(name, agrees, value if agrees else f"{value}, but si = {parameter.si:g}")


def unit_in_si(unit: str) -> float | None:
    """SI value of one `unit` such as `nm/N/m` or `N m/rad`; None if it is not known."""
    above, *below = ([UNITS.get(token, np.nan) for token in re.split(r"[ .*]+", part)] for part in unit.split("/"))
    value = float(np.prod(above) / np.prod([factor for part in below for factor in part]))
    return None if np.isnan(value) else value


def all_passed(outcomes: Iterable[TrialOutcome]) -> bool:
    """True if no check failed."""
    return all(outcome.passed is not False for outcome in outcomes)


@dataclass(frozen=True, repr=False, eq=False)
class EffectCheck(Result):
    """Effects of a file tried against the contract: shapes, symmetry, units, neutral value.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = tps.effect_template("my_screw").save(pathlib.Path(folder, "my_screw.py"))
    ...     found = tps.check_effects(file)
    >>> found.passed, found.to_dict()["effects"][0]["effect"]
    (True, 'my_screw')
    >>> found.to_frame()[["effect", "passed"]].values.tolist()[0]
    ['my_screw', True]
    """

    command: ClassVar[str] = "effects"
    shown_by: ClassVar[str] = "effects"

    file: str
    machine: str
    trials: Mapping[str, Sequence[TrialOutcome]]  # by the effect's name

    @property
    def passed(self) -> bool:
        """True if every effect keeps the contract."""
        return all(map(all_passed, self.trials.values()))

    def to_dict(self) -> dict[str, Any]:
        """All checks of all effects."""
        trials = self.trials.items()
        rows = [{"effect": name, "passed": all_passed(made), "checks": to_dict(made)} for name, made in trials]
        return {"file": self.file, "machine": self.machine, "passed": self.passed, "effects": rows}

    def to_frame(self) -> DataFrame:
        """One row per check."""
        trials = self.trials.items()
        return frame_of([{"effect": name, **check} for name, made in trials for check in to_dict(made)])

    def __str__(self) -> str:
        return str(self.view.trials_text(self))

    def _short(self) -> str:
        return f"{self.file}, {'good' if self.passed else 'FAILS'}"
