"""A task: what is to be placed and how; whether an earlier search had the same task."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields
from typing import Any

from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.placement.climb import Bounds
from toolpath_stiff.placement.paths import Read
from toolpath_stiff.placement.search import SearchRules
from toolpath_stiff.rewriting.program import check_decimals, check_rewritable
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import Pose, mm_from_m


@dataclass(frozen=True)
class Rewriting:
    """How the program itself is to be written: its file's name, decimals, chords (m), and what it was read with."""

    file: str
    decimals: int | None
    linearise: float | None
    reading: dict[str, Any]


@dataclass(frozen=True)
class Task:
    """What is to be placed, and how. SI.

    Attributes
    ----------
    model, program
        Machine and effects; the program as read where its zero sits now.
    present
        Where that is.
    read
        Reads the program for another zero: moves to machine coordinates depend on it.
    bounds, rules
        What may vary; what a placement must keep and be good at.
    load, step, force
        As `analyze` takes them.
    rewriting
        How the program itself is written; None: not.
    """

    model: StiffnessModel
    program: ReadProgram
    present: Pose
    read: Read
    bounds: Bounds
    rules: SearchRules
    load: Load
    step: float
    force: float
    rewriting: Rewriting | None = None

    def check(self) -> None:
        """Raise `InputError` for what can be told before a search."""
        if self.rewriting is None:
            return
        check_decimals(self.rewriting.decimals)
        check_rewritable(self.program)
        if self.program.interpreter != "builtin":
            raise InputError(
                f"--write {self.rewriting.file}: {self.program.name} was read by LinuxCNC's interpreter; its blocks "
                "cannot be rewritten",
                hint="leave --write out and set the work offset",
            )

    def fingerprint(self) -> dict[str, Any]:
        """Hashes of program and machine, and the options that a search depends on, under their names."""
        program, rules, bounds = self.program, self.rules, self.bounds
        moves = [getattr(program.moves, f.name).tobytes() for f in fields(program.moves)]
        acting = [(active.effect.name, sorted(active.values.items())) for active in self.model.effects]
        acting_in = f"{acting!r} {self.model.conditions!r}"
        low, high = bounds.low.tolist(), bounds.high.tolist()
        names = ("x", "y", "z", "tilt-a", "tilt-b", "rotate")
        return {
            "program_sha256": _hash("\n".join(program.source).encode("utf-8", "replace"), *moves),
            "machine_sha256": _hash(machine_toml(self.model.machine).encode(), acting_in.encode()),
            "options": {
                **{f"--{name}": [low[i], high[i]] for i, name in enumerate(names)},
                "--z-values": list(bounds.heights),
                "--keep-out": [[box.name, *box.low, *box.high] for box in rules.keepouts],
                "--objective": rules.objective,
                "--margin": rules.margin,
                "--allow-extrapolation": rules.allow_extrapolation,
                "--points": rules.points,
                "--seed": rules.seed,
                "--origin": list(self.present),
                "--load": str(self.load),
                "--step": mm_from_m(self.step),
                "--force": self.force,
            },
        }

    def refuse_other_search(self, earlier: dict[str, Any]) -> None:
        """Raise `InputError` where an earlier `placement.json` had another program, machine or option; names it."""
        now, then = self.fingerprint(), earlier.get("search")
        if not isinstance(then, dict) or "front" not in earlier:
            raise InputError("--pick: placement.json is of an older version", hint="search again, without --pick")
        differ = [name for name in ("program", "machine") if now[f"{name}_sha256"] != then.get(f"{name}_sha256")]
        options = then.get("options", {})
        differ += [name for name, value in now["options"].items() if options.get(name) != value]
        if differ:
            raise InputError(
                f"--pick: the earlier search differs in {', '.join(differ)}",
                expected="the same program, machine and options as in the search",
                hint="repeat the search's own command with --pick added, or search again without it",
            )


def _hash(*parts: bytes) -> str:
    return hashlib.sha256(b"".join(parts)).hexdigest()
