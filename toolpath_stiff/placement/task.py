"""A task: what is to be placed and how; a search that was made, and whether it had the same task."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_text
from toolpath_stiff.hints import both_names
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.placement.goals import Bounds, SearchRules
from toolpath_stiff.placement.paths import Read
from toolpath_stiff.placement.rows import PlacementRow
from toolpath_stiff.placement.unreachable import LeftOutRapid
from toolpath_stiff.rewriting.program import check_decimals, check_rewritable
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import Pose, mm_from_m


@dataclass(frozen=True)
class Rewriting:
    """Options of writing the program itself: its file's name, decimals, chords (m), and what it was read with."""

    file: str
    decimals: int | None
    linearise: float | None
    reading: Mapping[str, Any]


@dataclass(frozen=True)
class Fingerprint:
    """Hashes of program and machine, and the options that a search depends on, under their names."""

    program_sha256: str
    machine_sha256: str
    options: Mapping[str, object]


@dataclass(frozen=True)
class SearchRecord(Fingerprint):
    """A search as `placement.json` has it.

    Attributes
    ----------
    recommended
        Number of the recommended placement.
    rapids_left_out
        Rapids that no placement within the bounds keeps within reach.
    pose_evaluations, searches
        Poses evaluated, in how many searches from the beginning.
    nothing_better
        Whether nothing but the present placement was found, in spite of all of them.
    """

    recommended: int
    rapids_left_out: tuple[LeftOutRapid, ...]
    pose_evaluations: int
    searches: int = 1
    nothing_better: bool = False


@dataclass(frozen=True)
class SearchedFront:
    """A front that was searched for, and the search."""

    front: list[PlacementRow]
    search: SearchRecord

    @classmethod
    def of(cls, earlier: SearchedFront | Mapping[str, Any] | str | Path | None) -> SearchedFront:
        """A search as it is, from the content of `placement.json`, or from that file. Raises `InputError`."""
        if isinstance(earlier, SearchedFront):
            return earlier
        if earlier is None:
            raise InputError("--pick without an earlier search", hint="search first, without --pick")
        again = "search again, without --pick"
        try:
            document = earlier if isinstance(earlier, Mapping) else json.loads(_text_of(Path(earlier)))
            record = dict(document["search"])
            record["rapids_left_out"] = tuple(LeftOutRapid(**rapid) for rapid in record["rapids_left_out"])
            return cls([PlacementRow(**row) for row in document["front"]], SearchRecord(**record))
        except (KeyError, TypeError):
            raise InputError("--pick: no result of a search of this version", hint=again) from None
        except ValueError as error:
            raise InputError(f"--pick: {earlier} is no JSON: {error}", hint=again) from None


def _text_of(file: Path) -> str:
    if not file.exists():
        raise InputError(
            f"--pick: there is no earlier search in {file.parent} (no {file.name})",
            hint=f"search first, without --pick, or name the search's folder with {both_names('--out')}",
        )
    return read_text(file, "the earlier search")


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
        check_decimals(self.rewriting.decimals)
        check_rewritable(self.program)
        if self.program.interpreter != "builtin":
            raise InputError(
                f"--write {self.rewriting.file}: {self.program.name} was read by LinuxCNC's interpreter; its blocks "
                "cannot be rewritten",
                hint="leave --write out and set the work offset",
            )

    def fingerprint(self) -> Fingerprint:
        """The hashes and options that a search of this task rests on."""
        program, rules, bounds = self.program, self.rules, self.bounds
        moves = [getattr(program.moves, f.name).tobytes() for f in fields(program.moves)]
        acting = [(active.effect.name, sorted(active.values.items())) for active in self.model.effects]
        ranges = zip(bounds.low.tolist(), bounds.high.tolist(), strict=True)
        names = ("--x", "--y", "--z", "--tilt-a", "--tilt-b", "--rotate")
        return Fingerprint(
            _hash("\n".join(program.source).encode("utf-8", "replace"), *moves),
            _hash(machine_toml(self.model.machine).encode(), f"{acting!r} {self.model.conditions!r}".encode()),
            {
                **{name: list(ends) for name, ends in zip(names, ranges, strict=True)},
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
            },
        )

    def refuse_other_search(self, earlier: SearchRecord) -> None:
        """Raise `InputError` where an earlier search had another program, machine or option; names it."""
        now = self.fingerprint()
        differ = ["program"] if now.program_sha256 != earlier.program_sha256 else []
        differ += ["machine"] if now.machine_sha256 != earlier.machine_sha256 else []
        differ += [name for name, value in now.options.items() if earlier.options.get(name) != value]
        if differ:
            raise InputError(
                f"--pick: the earlier search differs in {', '.join(differ)}",
                expected="the same program, machine and options as in the search",
                hint="repeat the search's own command with --pick added, or search again without it",
            )


def _hash(*parts: bytes) -> str:
    return hashlib.sha256(b"".join(parts)).hexdigest()
