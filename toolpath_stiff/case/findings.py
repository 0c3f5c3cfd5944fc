"""The results of a case: each as its public function gives it, kept in a folder, and the command that gives it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import toolpath_stiff as tps
from toolpath_stiff.case.contents import Contents
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.hints import options
from toolpath_stiff.options import words_of
from toolpath_stiff.results import Progress

PLACE = ("x_mm", "y_mm", "z_mm", "tilt_a_deg", "tilt_b_deg", "rotate_deg")  # as of an origin
DRAFT = "missing"


def find(case: Contents, kind: str, result: str, progress: Progress | None = None, **given: Any) -> tuple[Any, str]:
    """A result of this kind, kept in a folder of the case without a step; and the command that gives it."""
    if kind in FINDERS:
        return FINDERS[kind](case, result, progress, **given)
    watched: Document = {} if kind == "plan" else {"progress": progress}
    named: Document = {"machine_file": case.path(f"{result}/machine.toml")} if kind == "update" else {}
    data = case.data if case.state.data or kind != "plan" else None
    kept = getattr(tps, kind)(data, case.machine, **watched, **named, **given)
    kept.save(case.folder / result, plots=case.plots)
    return kept, case.state.question(kind, "", *words_of(getattr(tps, kind), given))


def _analyze(case: Contents, result: str, progress: Progress | None, machine: str = "") -> tuple[tps.Analysis, str]:
    state = case.state
    on = case.machine_of(machine) if machine else case.machine_with(state.on)
    stated: Document = {"origin_mm_deg": state.origin or None, "require_N_per_mm": state.require or None}
    analysis = tps.analyze(case.program, on, partial=True, progress=progress, **stated)
    analysis.save(case.folder / result, plots=case.plots)
    if not machine and state.on:
        machine = f"{result}/machine.toml"
        on.save(case.folder / machine)
    return analysis, state.program_line(machine=machine)


def _place(case: Contents, result: str, progress: Progress | None, **bounds: Any) -> tuple[tps.Placement, str]:
    origin = case.state.origin or None
    placement = tps.place(case.program, case.machine, origin_mm_deg=origin, progress=progress, **bounds)
    placement.save(case.folder / result, plots=case.plots)
    return placement, case.state.program_line("place", **bounds)


def _set_up(case: Contents, result: str, progress: Progress | None) -> tuple[tps.Placement, str]:
    state = case.state
    if len(state.origin) < 3:
        raise InputError("the program sits where it always did", hint="put it somewhere with place_at first")
    place: Document = dict(zip(PLACE, (*state.origin, 0.0, 0.0, 0.0), strict=False))
    name, written = Path(state.program).name, {}
    try:
        placement = tps.place(case.program, case.machine, write=name, progress=progress, **place)
        content, written = placement.program_bytes, {"write": f"{result}/{name}"}
    except InputError as error:
        placement = tps.place(case.program, case.machine, progress=progress, **place)
        name, content = "not_written.txt", f"{error}\n".encode()
    placement.save(case.folder / result)
    write_atomically(case.folder / result / name, content)
    line = state.program_line("place", origin_mm_deg=None, **place, **written)
    return placement, " ".join([line, *options(out=result)])


def _draft(case: Contents, result: str, progress: Progress | None) -> tuple[tps.EffectDraft, str]:
    number = 1 + sum(Path(file).stem.startswith(DRAFT) for file in case.state.effects)
    file = f"{result}/{DRAFT}{f'_{number}' if number > 1 else ''}.toml"
    draft = tps.draft_effect(case.data, case.machine, file, progress=progress)
    if draft.text:
        write_atomically(case.folder / file, draft.text)
    return draft, case.state.question("effects draft", "", *options(output=file))


FINDERS: dict[str, Callable[..., tuple[Any, str]]] = {
    "analyze": _analyze,
    "place": _place,
    "set_up": _set_up,
    "draft": _draft,
}
