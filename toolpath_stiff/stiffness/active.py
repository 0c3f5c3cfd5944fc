"""An effect with parameter values, at work: the returns of a user's own effect are checked against the contract.

Each fault is one `EffectFault` with file and line of the effect's code. The packaged effects are held against the
contract by the tests and go through unchecked.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.errors import EffectFault
from toolpath_stiff.machine.model import EffectEntry, Hexapod, MachineTool
from toolpath_stiff.stiffness.contract import SETUP, Effect, LoadPath, Parameter, Values, at_pose
from toolpath_stiff.stiffness.effect_source import file_of, is_foreign, line_in, line_of

# Hook that adds to the compliance -> shape of its return for n poses, without the n.
ADDING: dict[str, tuple[int, ...]] = {
    "strut_compliance": (6,),
    "load_compliance": (12, 12),
    "parallel_stiffness": (6, 6),
}
ASYMMETRY = 1e-9  # of the largest entry at the pose
LARGEST = 1e18  # SI: a metre cube of diamond has 1e12 N/m; far larger values overflow in sums of squares


@dataclass(frozen=True)
class ActiveEffect:
    """An effect with its parameters, name -> SI value. Methods raise `EffectFault`."""

    effect: Effect
    values: Values

    @property
    def waits_for(self) -> tuple[str, ...]:
        """Conditions without which it adds nothing."""
        return self.effect.conditions(self.values)

    @property
    def setup(self) -> str:
        """Set-up to which it belongs; "" if it names none."""
        named = any(p.name == SETUP and p.kind == "text" for p in self.effect.parameters)
        return str(self.values[SETUP]) if named else ""

    def adds(self, hook: str, path: LoadPath) -> FloatArray | None:
        """Contribution of a hook of `ADDING` at n poses; None if it adds nothing or does not act there."""
        if not self.effect.acts_on(path, self.values):
            return None
        added: FloatArray | None = self._called(hook, path)
        if added is not None and is_foreign(self.effect):
            shape = path.element_zeros().shape[1:] if hook == "element_compliance" else ADDING[hook]
            self._check_shape(hook, added, (len(path), *shape))
            unsound = ~(np.abs(added) <= LARGEST)
            if path.strut_forces is not None:  # nan at a singular pose, where the effect cannot be judged
                unsound[~np.isfinite(path.strut_forces).all(axis=1)] = False
            self._refuse(hook, path, added, unsound, f"finite numbers within +-{LARGEST:g}")
            if added.ndim == 3:
                gap = np.abs(added - np.swapaxes(added, 1, 2))
                uneven = gap > ASYMMETRY * np.abs(added).max(axis=(1, 2), keepdims=True)
                self._refuse(hook, path, added, uneven, "a symmetric matrix")
        return added

    def geometry(self, machine: Hexapod) -> Hexapod:
        """The machine with the effect's geometry."""
        changed: Hexapod = self._called("geometry", machine)
        if is_foreign(self.effect):
            if not isinstance(changed, Hexapod):
                raise self._fault("geometry", f"returns {_kind(changed)}", "a Machine (machine.with_changes(...))")
            for joints in (changed.frame_joints, changed.platform_joints):
                if np.shape(joints) != (6, 3) or not np.isfinite(joints).all():
                    raise self._fault("geometry", "gives joints that are not finite", "(6, 3) m")
        return changed

    def stands(self, machine: MachineTool, joints: FloatArray) -> tuple[MachineTool, FloatArray]:
        """Machine and joint values (n, j) at which it truly stands, from those that the control believes."""
        true, turned = self._called("stands", machine, joints)
        if is_foreign(self.effect):
            self._check_shape("stands", turned, joints.shape)
        return true, turned

    def reading(self, stiffness: FloatArray, path: LoadPath) -> FloatArray:
        """(n,) N/m that an instrument shows for a true stiffness; unchanged where it does not act."""
        if not self.effect.acts_on(path, self.values):
            return stiffness
        shown: FloatArray = self._called("reading", stiffness.copy(), path)
        if is_foreign(self.effect):
            self._check_shape("reading", shown, stiffness.shape)
            unsound = np.isfinite(stiffness) & ~(np.isfinite(shown) & (shown > 0.0))
            self._refuse("reading", path, shown, unsound, "finite numbers above 0, N/m")
        return shown

    def _called(self, hook: str, *arguments: Any) -> Any:
        """Return value of a hook. Errors in the hook become faults; its arguments are write-protected."""
        method = getattr(self.effect, hook)
        if not is_foreign(self.effect):
            return method(*arguments, self.values)
        for path in (argument for argument in arguments if isinstance(argument, LoadPath)):
            for array in (*vars(path).values(), *vars(path.stance).values()):
                if isinstance(array, np.ndarray):
                    array.flags.writeable = False  # an effect that writes to it would falsify the others
        try:
            with np.errstate(all="ignore"):  # a division by zero shows in the result
                return method(*arguments, self.values)
        except (Exception, SystemExit) as error:  # a user's code may raise anything
            what = f"{type(error).__name__}: {error}".rstrip(": ")
            raise self._fault(hook, f"ends in {what}", line=line_in(error, file_of(self.effect))) from None

    def _check_shape(self, hook: str, returned: object, shape: tuple[int, ...]) -> None:
        if not isinstance(returned, np.ndarray) or returned.dtype.kind not in "fiu" or returned.shape != shape:
            raise self._fault(hook, f"returns {_kind(returned)}", f"an array of {shape} numbers")

    def _refuse(self, hook: str, path: LoadPath, returned: FloatArray, wrong: BoolArray, expected: str) -> None:
        if wrong.any():
            first = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
            raise self._fault(hook, f"returns {returned[first]:g}{at_pose(path, int(first[0]))}", expected)

    def _fault(self, hook: str, mistake: str, expected: str = "", line: int | None = None) -> EffectFault:
        text = f"effect {self.effect.name}: {hook} {mistake}"
        if line is None and not self.effect.file:
            line = line_of(type(self.effect), hook)
        return EffectFault(text, expected=expected, file=file_of(self.effect), line=line)


def _kind(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of {value.shape} {value.dtype}"
    return f"{type(value).__name__} ({value!r:.40})"


def read_parameters(effect: Effect, entry: EffectEntry, where: str) -> Values:
    """SI values of an effect's parameters from a machine file's keys; choices stay as they are.

    Raises
    ------
    InputError
        A key is unknown or missing, a value is not a number or out of bounds; at its line of the machine file, or with
        `where` for an entry that stands in none.
    """
    by_key = {parameter.key: parameter for parameter in effect.parameters}
    for key in (*entry.parameters, *by_key):
        mistake = expected = ""
        if key not in by_key:
            mistake = f"unknown key {key}"
            expected = f"one of {', '.join(by_key)}" if by_key else "no keys besides name and provenance"
        elif key not in entry.parameters:
            mistake, expected = f"{key} is missing", by_key[key].expected
        elif not _is_valid(by_key[key], entry.parameters[key]):
            mistake, expected = f"{key} = {entry.parameters[key]!r}", by_key[key].expected
        if mistake:
            raise entry.error(f"effect {effect.name}: {mistake}", key, expected=expected, where=where)
    given = {p: entry.parameters[p.key] for p in effect.parameters}
    return {p.name: float(value) * p.si if p.kind == "real" else value for p, value in given.items()}


def _is_valid(parameter: Parameter, value: object) -> bool:
    if parameter.kind == "text":
        return isinstance(value, str)
    numbers = int if parameter.kind == "integer" else int | float
    low, high = parameter.bounds
    return isinstance(value, numbers) and not isinstance(value, bool) and low <= value <= high
