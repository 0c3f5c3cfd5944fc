"""A task: what is to be placed and how; a search that was made, and what it rests on."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields

from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.placement.goals import Bounds, SearchRules
from toolpath_stiff.placement.paths import Read
from toolpath_stiff.poses import Pose
from toolpath_stiff.rewriting.program import check_rewritable
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import mm_from_m

VARIED = ("--x", "--y", "--z", "--tilt-a", "--tilt-b", "--rotate")  # options of the columns of a placement


@dataclass(frozen=True)
class Rewriting:
    """Options of writing the program itself: its file's name, decimals, chords (m), and what it was read with."""

    file: str
    decimals: int | None
    linearise: float | None
    control: Controller


@dataclass(frozen=True)
class SearchRecord:
    """A search as `placement.json` has it.

    Attributes
    ----------
    options
        What it depends on, by the name of the option; of program and machine their hashes.
    recommended
        Number of the recommended placement.
    rapids_left_out
        Lines of the rapids that no placement within the bounds keeps within reach.
    pose_evaluations, searches
        Poses evaluated, in how many searches from the beginning.
    nothing_better
        Whether nothing but the present placement was found, in spite of all of them.
    """

    options: Mapping[str, object]
    recommended: int
    rapids_left_out: tuple[int, ...]
    pose_evaluations: int
    searches: int
    nothing_better: bool


@dataclass(frozen=True)
class PlacementTask:
    """A program to be placed: the machine, the bounds and rules, the load. SI.

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
        check_rewritable(self.program)
        if self.program.interpreter != "builtin":
            raise InputError(
                f"--write: {self.program.name} was read by LinuxCNC's interpreter; its blocks cannot be rewritten",
                hint="leave --write out and set the work offset",
            )

    def options(self) -> dict[str, object]:
        """What a search of this task depends on, by the name of the option; of program and machine their hashes."""
        program, rules, bounds = self.program, self.rules, self.bounds
        moves = [getattr(program.moves, f.name).tobytes() for f in fields(program.moves)]
        acting = [(active.effect.name, sorted(active.values.items())) for active in self.model.effects]
        ranges = zip(bounds.low.tolist(), bounds.high.tolist(), strict=True)
        return {
            "program": _hash("\n".join(program.source).encode("utf-8", "replace"), *moves),
            "machine": _hash(
                machine_toml(self.model.machine).encode(), f"{acting!r} {self.model.conditions!r}".encode()
            ),
            **{name: list(ends) for name, ends in zip(VARIED, ranges, strict=True)},
            "--z-values": list(bounds.heights),
            "--keep-out": [[box.name, *box.corners.ravel().tolist()] for box in rules.keepouts],
            "--objective": rules.objective,
            "--margin": rules.margin,
            "--allow-extrapolation": rules.allow_extrapolation,
            "--points": rules.points,
            "--seed": rules.seed,
            "--origin": list(self.present),
            "--load": str(self.load),
            "--step": mm_from_m(self.step),
            "--force": self.force,
        }


def _hash(*parts: bytes) -> str:
    return hashlib.sha256(b"".join(parts)).hexdigest()
