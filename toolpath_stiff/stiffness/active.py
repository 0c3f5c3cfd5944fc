"""An effect with its parameters, at work: one from outside the package is held against the contract as it returns.

Each fault is one `EffectFault` with file and line of the effect's code and the pose. The packaged effects are held
against the contract by the tests and go through unchecked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import EffectFault
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.stiffness.contract import Effect, LoadPath, Values
from toolpath_stiff.stiffness.effect_source import file_of, is_foreign, line_in, line_of_hook
from toolpath_stiff.stiffness.possible import at_pose

# What each hook that adds to the compliance returns for n poses: shape beyond n, and in words.
ADDING: dict[str, tuple[tuple[int, ...], str]] = {
    "strut_compliance": ((6,), "(n, 6) m/N"),
    "load_compliance": ((12, 12), "(n, 12, 12), symmetric"),
    "parallel_stiffness": ((6, 6), "(n, 6, 6), symmetric"),
}
ASYMMETRY = 1e-9  # of the largest entry at the pose
LARGEST = 1e18  # SI: a metre cube of diamond has 1e12 N/m; what is far beyond overflows in sums of squares
TRIED = 2000  # poses that are tried one by one for the one that fails


@dataclass(frozen=True)
class ActiveEffect:
    """An effect with its parameters, name -> SI value. Methods raise `EffectFault`."""

    effect: Effect
    values: Values

    def adds(self, hook: str, path: LoadPath) -> FloatArray | None:
        """What one of `ADDING` adds at n poses; None adds nothing, and so does an effect that does not act there."""
        effect, values = self.effect, self.values
        if not effect.acts_on(path, values):
            return None
        method: Callable[[LoadPath, Values], FloatArray | None] = getattr(effect, hook)
        if not is_foreign(effect):
            return method(path, values)
        _protect(path)
        raw = self._called(hook, path, lambda poses: method(poses, values))
        if raw is None:
            return None
        shape, words = ADDING[hook]
        added = self._array(hook, raw, (len(path), *shape), words)
        bad = ~(np.abs(added) <= LARGEST)
        if path.strut_forces is not None:  # nan at a singular pose, where nothing can be asked
            bad[~np.isfinite(path.strut_forces).all(axis=1)] = False
        if bad.any():
            first = np.unravel_index(int(np.argmax(bad)), added.shape)
            expected = f"numbers within +-{LARGEST:g}" if np.isfinite(added[first]) else "finite numbers"
            raise self._fault(hook, f"returns {added[first]:g}{at_pose(path, int(first[0]))}", expected)
        if len(shape) == 2 and len(path):
            gap = np.abs(added - np.swapaxes(added, 1, 2))
            gap[gap.max(axis=(1, 2)) <= ASYMMETRY * np.abs(added).max(axis=(1, 2))] = 0.0
            if gap.any():
                i, j, k = (int(v) for v in np.unravel_index(np.argmax(gap), added.shape))
                entries = f"entry ({j}, {k}) is {added[i, j, k]:g}, entry ({k}, {j}) is {added[i, k, j]:g}"
                raise self._fault(hook, f"is not symmetric{at_pose(path, i)}: {entries}", words)
        return added

    def geometry(self, machine: Hexapod) -> Hexapod:
        """The machine with the effect's geometry."""
        effect, hook = self.effect, "geometry"
        if not is_foreign(effect):
            return effect.geometry(machine, self.values)
        changed = self._called(hook, None, lambda _: effect.geometry(machine, self.values))
        if not isinstance(changed, Hexapod):
            raise self._fault(hook, f"returns {_kind(changed)}", "a Machine (machine.with_changes(...))")
        for name in ("frame_joints", "platform_joints"):
            joints = getattr(changed, name)
            if not isinstance(joints, np.ndarray) or joints.shape != (6, 3) or not np.isfinite(joints).all():
                raise self._fault(hook, f"gives {name} that are {_kind(joints)}", "(6, 3) finite numbers, m")
        if not np.isfinite(changed.reference_tool_length):
            raise self._fault(hook, "gives reference_tool_length that is not finite", "m")
        return changed

    def reading(self, stiffness: FloatArray, path: LoadPath) -> FloatArray:
        """What an instrument shows, (n,) N/m, for a true stiffness; the same where it does not act."""
        effect, values = self.effect, self.values
        if not effect.acts_on(path, values):
            return stiffness
        if not is_foreign(effect):
            return effect.reading(stiffness, path, values)
        _protect(path)
        true = stiffness.copy()
        raw = self._called("reading", None, lambda _: effect.reading(true, path, values))
        shown = self._array("reading", raw, stiffness.shape, "(n,) N/m")
        bad = np.isfinite(stiffness) & ~(np.isfinite(shown) & (shown > 0.0))
        if bad.any():
            i = int(np.argmax(bad))
            raise self._fault("reading", f"shows {shown[i]:g} N/m{at_pose(path, i)}", "a finite number above 0")
        return shown

    def _called(self, hook: str, path: LoadPath | None, call: Callable[[Any], object]) -> object:
        try:
            with np.errstate(all="ignore"):  # what it divides by zero shows in the result
                return call(path)
        except (Exception, SystemExit) as error:  # whatever a user's code does
            hint = ""
            if isinstance(error, KeyError):
                hint = f"its parameters are {', '.join(p.name for p in self.effect.parameters) or 'none'}"
            elif "read-only" in str(error):
                hint = "copy an array before you change it: the core and other effects use the same one"
            where = "" if path is None else _where_it_fails(path, call)
            what = f"{type(error).__name__}: {error}".rstrip(": ")
            line = line_in(error, file_of(self.effect))
            raise self._fault(hook, f"ends in {what}{where}", hint=hint, line=line) from None

    def _array(self, hook: str, raw: object, shape: tuple[int, ...], words: str) -> FloatArray:
        array = np.asarray(raw) if isinstance(raw, np.ndarray | np.generic | float | int | list | tuple) else None
        if array is None or array.dtype.kind not in "fiu":
            raise self._fault(hook, f"returns {_kind(raw)}", words)
        if array.shape != shape:
            poses = f"{shape[0]} pose{'s' if shape[0] != 1 else ''}"
            raise self._fault(hook, f"returns shape {array.shape} for {poses}", f"{shape}, that is {words}")
        return np.asarray(array, dtype=float)

    def _fault(
        self, hook: str, mistake: str, expected: str = "", hint: str = "", line: int | None = None
    ) -> EffectFault:
        text, line = f"effect {self.effect.name}: {hook} {mistake}", line or line_of_hook(self.effect, hook)
        return EffectFault(text, expected=expected, hint=hint, file=file_of(self.effect), line=line)


def _where_it_fails(path: LoadPath, call: Callable[[Any], object]) -> str:
    if len(path) < 2:
        return at_pose(path, 0) if len(path) else " without poses"
    for i in range(min(len(path), TRIED)):
        try:
            with np.errstate(all="ignore"):
                call(path.take(np.array([i])))
        except (Exception, SystemExit):
            return at_pose(path, i)
    return f" for {len(path)} poses together, though not for each alone"


def _protect(path: LoadPath) -> None:
    """An effect that writes into what it is shown would falsify the others."""
    for owner in (path, path.struts):
        for field in fields(owner):
            array = getattr(owner, field.name)
            if isinstance(array, np.ndarray):
                array.flags.writeable = False


def _kind(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} of {value.dtype}"
    return "nothing (None)" if value is None else f"{type(value).__name__} ({value!r:.40})"
