"""Results of a case: what the public functions give for its machine, readings and program, kept in a folder of it."""

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

Found = tuple[Any, str]  # a result, and the command line that gives it
PLACE = ("x_mm", "y_mm", "z_mm", "tilt_a_deg", "tilt_b_deg", "rotate_deg")  # as of an origin
DRAFT = "missing"


def find(case: Contents, kind: str, result: str, progress: Progress | None = None, **given: Any) -> Found:
    """A result of a kind, kept in a folder of the case without a step, and the command that gives it."""
    if kind in FINDERS:
        return FINDERS[kind](case, result, progress, **given)
    watched: Document = {} if kind == "plan" else {"progress": progress}
    named: Document = {"machine_file": case.path(f"{result}/machine.toml")} if kind == "update" else {}
    data = case.data if case.state.data or kind != "plan" else None
    kept = getattr(tps, kind)(data, case.machine, **watched, **named, **given)
    kept.save(case.folder / result, plots=case.plots)
    return kept, case.state.question(kind, "", *words_of(getattr(tps, kind), given))


def _analyze(case: Contents, result: str, progress: Progress | None, machine: str = "") -> Found:
    state = case.state
    on, machine = (case.machine_of(machine), machine) if machine else _switched(case, result)
    stated: Document = {"origin_mm_deg": state.origin or None, "require_N_per_mm": state.require or None}
    analysis = tps.analyze(case.program, on, cut=case.cut, partial=True, progress=progress, **stated)
    analysis.save(case.folder / result, plots=case.plots)
    return analysis, state.program_line(machine=machine)


def _switched(case: Contents, result: str) -> tuple[tps.Machine, str]:
    """The machine with the effects that are switched on, and its file among the results; "" if none is on."""
    on, name = case.machine_with(case.state.on), f"{result}/machine.toml"
    if not case.state.on:
        return on, ""
    on.save(case.folder / name)
    return on, name


def _compensate(case: Contents, result: str, progress: Progress | None) -> Found:
    state, origin, (on, machine) = case.state, case.state.origin or None, _switched(case, result)
    kept = tps.compensate(case.program, on, cut=case.cut, origin_mm_deg=origin, progress=progress)
    file = Path(state.program)
    kept.save(case.folder / result / f"{file.stem}_comp{file.suffix}")
    return kept, state.program_line("compensate", machine)


def _place(case: Contents, result: str, progress: Progress | None, **bounds: Any) -> Found:
    on, machine = _switched(case, result)
    kept = tps.place(case.program, on, origin_mm_deg=case.state.origin or None, progress=progress, **bounds)
    kept.save(case.folder / result, plots=case.plots)
    return kept, case.state.program_line("place", machine, **bounds)


def _set_up(case: Contents, result: str, progress: Progress | None) -> Found:
    state = case.state
    if len(state.origin) < 3:
        raise InputError("the program is still at its initial placement", hint="put it somewhere with place_at first")
    place: Document = dict(zip(PLACE, (*state.origin, 0.0, 0.0, 0.0), strict=False))
    (on, machine), name, written = _switched(case, result), Path(state.program).name, {}
    try:
        placement = tps.place(case.program, on, write=name, progress=progress, **place)
        content, written = placement.program_bytes, {"write": f"{result}/{name}"}
    except InputError as error:
        placement = tps.place(case.program, on, progress=progress, **place)
        name, content = "not_written.txt", f"{error}\n".encode()
    placement.save(case.folder / result)
    write_atomically(case.folder / result / name, content)
    return placement, f"{state.program_line('place', machine, origin_mm_deg=None, **place, **written)} --out {result}"


def _draft(case: Contents, result: str, progress: Progress | None) -> Found:
    number = 1 + sum(Path(file).stem.startswith(DRAFT) for file in case.state.effects)
    file = f"{result}/{DRAFT}{f'_{number}' if number > 1 else ''}.toml"
    draft = tps.draft_effect(case.data, case.machine, file, progress=progress)
    if draft.text:
        write_atomically(case.folder / file, draft.text)
    return draft, case.state.question("effects draft", "", *options(output=file))


FINDERS: dict[str, Callable[..., Found]] = {
    "analyze": _analyze,
    "compensate": _compensate,
    "place": _place,
    "set_up": _set_up,
    "draft": _draft,
}
