"""What one finds out on a case: each result as its function gives it, kept in a folder of its own."""

from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import Any, TypeVar, cast

import toolpath_stiff as tps
from toolpath_stiff.case.contents import Contents
from toolpath_stiff.case.files import write_files
from toolpath_stiff.case.history import recorded
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import options
from toolpath_stiff.options import words_of
from toolpath_stiff.results import Progress

Made = TypeVar("Made")
PLACE = ("x_mm", "y_mm", "z_mm", "tilt_a_deg", "tilt_b_deg", "rotate_deg")  # as of an origin


class Findings(Contents):
    """The results of a case.

    Attributes
    ----------
    plots
        True to keep results with pictures and pages, which take their time.
    """

    plots = False

    def find(self, kind: str, result: str, progress: Progress | None = None, **given: Any) -> tuple[Any, str]:
        """A result of this kind, kept in a folder of the case without a step; and the command that gives it."""
        if kind in ("analyze", "draft", "set_up", "place"):
            kept, command = getattr(self, f"_{kind}")(result, progress, **given)
            return kept, command
        watched = {} if kind == "plan" else {"progress": progress}
        named = {"machine_file": self.path(f"{result}/machine.toml")} if kind == "update" else {}
        data = self.data if self.state.data or kind != "plan" else None
        kept = getattr(tps, kind)(data, self.machine, **watched, **named, **given)
        kept.save(self.folder / result, plots=self.plots)
        return kept, self.question(kind, "", *words_of(getattr(tps, kind), given))

    def _step(self, kind: str, of: type[Made], progress: Progress | None = None, **given: Any) -> Made:
        """A result of this class as a step."""
        result = self.next_result(kind)
        kept, command = self.find(kind, result, progress, **given)
        self.record(kind, kept._short(), command, result=result)
        return cast("Made", kept)

    @recorded
    def compare(self, progress: Progress | None = None) -> tps.Comparison:
        """Where the model fails, as `tps.compare`; kept in results/."""
        return self._step("compare", tps.Comparison, progress)

    @recorded
    def diagnose(self, progress: Progress | None = None) -> tps.Diagnosis:
        """Which effect is missing, as `tps.diagnose`; kept in results/."""
        return self._step("diagnose", tps.Diagnosis, progress)

    @recorded
    def update(self, add: str | Iterable[str], progress: Progress | None = None) -> tps.Update:
        """Fit effects, as `tps.update`; kept in results/, where `accept` takes machine.toml from."""
        return self._step("update", tps.Update, progress, add=[add] if isinstance(add, str) else list(add))

    @recorded
    def plan(self, n: int = 6) -> tps.Plan:
        """What to measure next, as `tps.plan`; kept in results/, plan.csv among it."""
        return self._step("plan", tps.Plan, n=n)

    @recorded
    def analyze(self, machine: str = "", progress: Progress | None = None) -> tps.Analysis:
        """The program on the machine with the effects that are switched on, as `tps.analyze`; kept in results/.

        `machine`: a file of the case in place of that, such as an update's.
        """
        return self._step("analyze", tps.Analysis, progress, machine=machine)

    @recorded
    def place(self, progress: Progress | None = None, **bounds: Any) -> tps.Placement:
        """Where the work should sit, as `tps.place`; kept in results/."""
        return self._step("place", tps.Placement, progress, **bounds)

    @recorded
    def set_up(self, progress: Progress | None = None) -> tps.Placement:
        """The program where it sits now, for the shop floor: offsets, set-up sheet and the program written for it.

        As `tps.place` with every bound fixed there; figures and warnings are against where the program sat at first.
        Kept in results/ with its pictures. A program that cannot be written for the place is not; not_written.txt says
        why.
        """
        return self._step("set_up", tps.Placement, progress)

    def _analyze(self, result: str, progress: Progress | None, machine: str = "") -> tuple[tps.Analysis, str]:
        state = self.state
        on = self.machine_of(machine) if machine else self.machine_with(state.on)
        analysis = tps.analyze(
            self.program, on, origin_mm_deg=state.origin or None, partial=True,
            require_N_per_mm=state.require or None, progress=progress,
        )  # fmt: skip
        analysis.save(self.folder / result, plots=self.plots)
        if not machine and state.on:
            machine = f"{result}/machine.toml"
            on.save(self.folder / machine)
        return analysis, self.program_line(machine=machine)

    def _place(self, result: str, progress: Progress | None, **bounds: Any) -> tuple[tps.Placement, str]:
        origin = self.state.origin or None
        placement = tps.place(self.program, self.machine, origin_mm_deg=origin, progress=progress, **bounds)
        placement.save(self.folder / result, plots=self.plots)
        return placement, self.program_line("place", **bounds)

    def _set_up(self, result: str, progress: Progress | None) -> tuple[tps.Placement, str]:
        state = self.state
        if len(state.origin) < 3:
            raise InputError("the program sits where it always did", hint="put it somewhere with place_at first")
        place: dict[str, Any] = dict(zip(PLACE, (*state.origin, 0.0, 0.0, 0.0), strict=False))
        name, written = Path(state.program).name, {}
        try:
            placement = tps.place(self.program, self.machine, write=name, progress=progress, **place)
            beside, written = {name: placement.program_bytes}, {"write": f"{result}/{name}"}
        except InputError as error:
            placement = tps.place(self.program, self.machine, progress=progress, **place)
            beside = {"not_written.txt": f"{error}\n".encode()}
        placement.save(self.folder / result)
        write_files(self.folder / result, beside)
        line = self.program_line("place", change={"origin": ()}, **place, **written)
        return placement, " ".join([line, *options(out=result)])

    def _draft(self, result: str, progress: Progress | None) -> tuple[tps.EffectDraft, str]:
        taken = {effect.name for effect in tps.effects(self.effect_files).effects}
        name = next(name for n in count(1) if (name := f"missing_{n}" if n > 1 else "missing") not in taken)
        file = f"{result}/{name}.toml"
        draft = tps.draft_effect(self.data, self.machine, file, progress=progress)
        if draft.text:
            write_files(self.folder, {file: draft.text})
        return draft, self.question("effects draft", "", *options(output=file))
