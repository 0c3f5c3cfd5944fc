"""A blind exercise within a case: a simulated machine that hides something, measured and guessed at."""

from pathlib import Path
from typing import Any

from toolpath_stiff.case.files import free_name, write_files
from toolpath_stiff.case.findings import Findings
from toolpath_stiff.case.history import recorded
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.report.words import counted
from toolpath_stiff.results import json_text
from toolpath_stiff.rig.exercise import blind_case, measured_again, new_exercise, reveal


class BlindExercise(Findings):
    """A case whose machine may be a simulated one."""

    @recorded
    def start_exercise(self, seed: int, hidden: str | None = None, layout: str = "tilted") -> None:
        """Begin a blind exercise: a simulated machine that hides something, and what was measured on it.

        `hidden` and `layout` as of `tps rig new`.
        """
        folder = free_name(self.folder, "exercise")
        new_exercise(self.folder / folder, blind_case(seed, layout, hidden))
        copies = {
            free_name(self.folder, f"{room}/{name}"): (self.folder / folder / name).read_bytes()
            for room, name in (("machines", "machine.toml"), ("data", "measurements.csv"))
        }
        write_files(self.folder, copies)
        machine, data = copies
        drawn = options(seed=seed, out=folder, hidden=hidden, layout=layout if layout != "tilted" else None)
        self.record(
            "exercise",
            f"blind exercise, seed {seed}",
            command_line("rig", "new", *drawn),
            change={"machine": machine, "data": (data,), "aside": (), "on": {}, "exercise": folder},
            files=[machine, data],
        )

    @recorded
    def measure(self, plan_file: str | Path) -> None:
        """Measure the exercise's machine at the poses of a plan; the readings are added."""
        name = free_name(self.folder, "data/measured.csv")
        visit = 1 + sum(step.kind == "measure" for step in self.history)
        text, count = measured_again(self.folder / self._exercise(), str(plan_file), visit)
        write_files(self.folder, {name: text})
        line = command_line("rig", "measure", self._exercise(), *options(at=plan_file, out=name, visit=visit))
        change = {"data": (*self.state.data, name)}
        self.record("measure", f"{counted(count, 'reading')} measured", line, change=change, files=[name])

    @recorded
    def claim(self, effects: str) -> dict[str, Any]:
        """Open the seal of the exercise and score a claim: names of effects with commas, "none" or "outside"."""
        score = reveal(self.folder / self._exercise(), effects)
        result = self.next_result("reveal")
        write_files(self.folder, {f"{result}/reveal.json": json_text(score)})
        line = command_line("rig", "reveal", self._exercise(), *options(claim=effects))
        self.record("reveal", f"claimed {effects}: {score['verdict']}", line, result=result)
        return score

    def _exercise(self) -> str:
        if not self.state.exercise:
            raise InputError("no exercise was started in this case", hint="start one with start_exercise(seed)")
        return self.state.exercise
