"""What one finds out on a case: each result as its function gives it, kept in a folder of its own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from toolpath_stiff.api.effects import effects
from toolpath_stiff.case.contents import Contents, reading_words
from toolpath_stiff.case.files import write_files
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.results import FolderResult, Progress

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis
    from toolpath_stiff.api.correction import Update
    from toolpath_stiff.api.effects import EffectDraft
    from toolpath_stiff.case.steps import Step
    from toolpath_stiff.comparison.compare import Comparison
    from toolpath_stiff.diagnosis.result import Diagnosis
    from toolpath_stiff.placement.result import Placement
    from toolpath_stiff.planning.result import Plan


Found = TypeVar("Found", bound=FolderResult)


class Findings(Contents):
    """The results of a case.

    Attributes
    ----------
    plots
        Whether results are kept with pictures and pages, which take their time.
    """

    def __init__(self, folder: Path, steps: Sequence[Step], done: int, text: str) -> None:
        super().__init__(folder, steps, done, text)
        self.plots = False

    def compare(self, progress: Progress | None = None) -> Comparison:
        """Where the model fails, as `tps.compare`; kept in results/."""
        from toolpath_stiff.api.diagnosis import compare

        return self._kept("compare", compare(self.data, self.machine, progress=progress))

    def diagnose(self, progress: Progress | None = None) -> Diagnosis:
        """Which effect is missing, as `tps.diagnose`; kept in results/."""
        from toolpath_stiff.api.diagnosis import diagnose

        return self._kept("diagnose", diagnose(self.data, self.machine, progress=progress))

    def draft_in(self, result: str, progress: Progress | None = None) -> tuple[EffectDraft, str]:
        """What `draft` finds, kept in a folder of the case without a step; and its command."""
        from toolpath_stiff.api.effects import draft_effect

        file = f"{result}/{self._free_effect('missing')}.toml"
        found = draft_effect(self.data, self.machine, file, progress=progress)
        (self.folder / result).mkdir(parents=True, exist_ok=True)
        if found.text:
            found.save(self.folder / file)
        state = self.state
        asked = options(machine=state.machine, effects=list(state.effects), out=file)
        return found, command_line("effects", "draft", *self.data_files, *asked)

    def _free_effect(self, name: str) -> str:
        taken, number = {one.name for one in effects([self.path(one) for one in self.state.effects]).effects}, 1
        free = name
        while free in taken:
            number += 1
            free = f"{name}_{number}"
        return free

    def update(self, add: str | Iterable[str], progress: Progress | None = None) -> Update:
        """Fit effects, as `tps.update`; kept in results/, where `accept` takes machine.toml from."""
        from toolpath_stiff.api.correction import update

        names = [add] if isinstance(add, str) else list(add)
        return self._kept(
            "update", update(self.data, self.machine, add=names, progress=progress), repr(names), add=names
        )

    def plan(self, n: int = 6) -> Plan:
        """What to measure next, as `tps.plan`; kept in results/, plan.csv among it."""
        from toolpath_stiff.api.correction import plan

        return self._kept("plan", plan(self.data if self.state.data else None, self.machine, n=n), f"n={n}", n=n)

    def analyze(self, machine: str = "", progress: Progress | None = None) -> Analysis:
        """The program on the machine with the effects that are switched on, as `tps.analyze`; kept in results/.

        `machine`: a file of the case in place of that, such as an update's.
        """
        result = self.next_result("analyze")
        found, command = self.analyze_in(result, machine, progress)
        words = repr(machine) if machine else ""
        self.record("analyze", found._short(), command=command, python=f"case.analyze({words})", result=result)
        return found

    def analyze_in(self, result: str, machine: str = "", progress: Progress | None = None) -> tuple[Analysis, str]:
        """What `analyze` finds, kept in a folder of the case without a step, with a machine of its own; its command."""
        from toolpath_stiff.api.programs import analyze

        state, name = self.state, machine or self.state.machine
        on = self.machine_of(machine) if machine else self.machine_with(state.on)
        found = analyze(
            self.program,
            on,
            origin_mm_deg=state.origin or None,
            partial=True,
            require_N_per_mm=state.require or None,
            progress=progress,
        )
        found.save(self.folder / result, plots=self.plots)
        if state.on and not machine:
            name = f"{result}/machine.toml"
            on.save(self.folder / name)
        return found, self._analyze_line(state.program, state.origin, machine=name)

    def place(self, progress: Progress | None = None, **bounds: Any) -> Placement:
        """Where the work should sit, as `tps.place`; kept in results/."""
        from toolpath_stiff.api.placements import place

        found = place(self.program, self.machine, origin_mm_deg=self.state.origin or None, progress=progress, **bounds)
        words = ", ".join(f"{name}={value!r}" for name, value in bounds.items())
        return self._kept("place", found, words, program=self.state.program)

    def set_up(self, progress: Progress | None = None) -> Placement:
        """The program where it sits now, for the shop floor: offsets, set-up sheet and the program written for it.

        As `tps.place` with every bound fixed there; figures and warnings are against where the program sat at first.
        Kept in results/ with its pictures. A program that cannot be written for the place is not; not_written.txt says
        why.
        """
        result = self.next_result("set_up")
        found, command = self.set_up_in(result, progress)
        self.record("set_up", found._short(), command=command, python="case.set_up()", result=result)
        return found

    def set_up_in(self, result: str, progress: Progress | None = None) -> tuple[Placement, str]:
        """What `set_up` finds, kept in a folder of the case without a step; and its command."""
        from toolpath_stiff.api.placements import place

        state = self.state
        if len(state.origin) < 3:
            raise InputError("the program sits where it always did", hint="put it somewhere with place_at first")
        names = ("x_mm", "y_mm", "z_mm", "tilt_a_deg", "tilt_b_deg", "rotate_deg")
        at: dict[str, Any] = dict(zip(names, (*state.origin, 0.0, 0.0, 0.0), strict=False))
        name, reason = Path(state.program).name, ""
        try:
            found = place(self.program, self.machine, write=name, progress=progress, **at)
            content = found.program_bytes
        except InputError as error:
            found, reason = place(self.program, self.machine, progress=progress, **at), str(error)
        found.save(self.folder / result)
        beside = {"not_written.txt": f"{reason}\n"} if reason else {name: content}
        write_files(self.folder / result, beside)
        bounds = {key.rpartition("_")[0].replace("_", "-"): f"{value:.10g}" for key, value in at.items()}
        written = None if reason else f"{result}/{name}"
        asked = options(machine=state.machine, effects=list(state.effects), **bounds, out=result, write=written)
        return found, command_line("place", state.program, *asked, *reading_words(state.reading))

    def _kept(self, kind: str, found: Found, words: str = "", **own: Any) -> Found:
        result = self.next_result(kind)
        found.save(self.folder / result, plots=self.plots)
        program = own.pop("program", "")
        line = self._analyze_line(program, self.state.origin, kind) if program else self.question(kind, **own)
        self.record(kind, found._short(), command=line, python=f"case.{kind}({words})", result=result)
        return found
