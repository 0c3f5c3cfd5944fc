"""The state of a session as the page draws it: one JSON document, in the shop's units."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

import toolpath_stiff as tps
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import TpsError

if TYPE_CHECKING:
    from toolpath_stiff.case.steps import Step
    from toolpath_stiff.studio.session import Session

Picture = dict[str, Any]  # a part of the document


MERIDIANS, PARALLELS = 36, 9  # of the reach boundary
MOST_LINES = 400_000  # of a program's text in the page


def document(session: Session) -> Picture:
    """Everything that a page shows."""
    with session.lock:
        return _document(session) | session.news()


def _document(session: Session) -> Picture:
    case, state = session.case, session.case.state
    has_data = bool(state.data)
    now = session.errors() if has_data else None
    return {
        "case": session.name,
        "machine": machine(session),
        "readings": readings(session, now) if has_data else None,
        "gauge": gauge(session, now) if now else None,
        "verdict": verdict(session),
        "effects": effects(session),
        "own_effects": session.editing.state(),
        "fit": fit(session),
        "plan": plan(session),
        "compare": compare(session),
        "program": program(session),
        "placement": placement(session),
        "exercise": {"folder": state.exercise, "reveal": session.reveal(), "measured": bool(case.latest("plan"))},
        "history": list(map(_step, case.history)),
        "undone": list(map(_step, case.undone)),
    }


def _step(step: Step) -> dict[str, str]:
    return {name: getattr(step, name) for name in ("kind", "text", "command", "python", "result")}


def machine(session: Session) -> Picture:
    """What the drawing of the machine needs, and the boundary of its reach with the tool as it stands at rest."""
    on = session.machine
    return {
        "name": on.name,
        "title": on.model.machine.title,
        "effects": on.effects,
        "joints": on.joints_mm,
        "origin": list(on.origin_mm_deg),
        "reach": session.once("reach", session.data_key[:2], lambda: _boundary(on)),
    }


def _boundary(on: tps.Machine) -> list[list[list[float]]]:
    """(parallels, meridians, 3) mm: how far the tip goes from the default origin along rays."""
    centre = on.origin_mm_deg[:3]
    heights = np.radians(np.linspace(-90.0, 90.0, PARALLELS))[:, None]
    azimuths = 2.0 * np.pi * np.arange(MERIDIANS) / MERIDIANS
    level = np.cos(heights)
    parts = np.broadcast_arrays(level * np.cos(azimuths), level * np.sin(azimuths), np.sin(heights))
    rays = np.stack(parts, axis=-1).reshape(-1, 3)
    lengths = on.reach_mm(centre, rays.tolist())
    points = np.round(np.array(centre) + np.asarray(lengths)[:, None] * rays, 1)
    boundary: list[list[list[float]]] = points.reshape(PARALLELS, MERIDIANS, 3).tolist()
    return boundary


def _of(document: Document, *names: str) -> Picture:
    """Some entries of a document, None for what it has not."""
    return {name: document.get(name) for name in names}


def readings(session: Session, now: Picture | None) -> Picture:
    """All readings; deviation and model are None for those that are set aside."""
    columns, aside = session.readings(), set(session.case.state.aside)
    out = [f"{file}:{line}" in aside for file, line in zip(columns["file"], columns["line"], strict=True)]
    deviation, modelled = iter(now["deviation_percent"] if now else ()), iter(now["modelled_N_per_mm"] if now else ())
    return {
        **columns,
        "aside": out,
        "deviation": [None if gone else round(next(deviation), 3) for gone in out],
        "modelled": [None if gone else round(next(modelled)) for gone in out],
    }


def gauge(session: Session, now: Picture) -> Picture:
    """Mean errors in per cent: as the file stands, refitted, now, at left-out points; the noise floor."""
    hand, on = session.case.preview, session.case.state.on
    key = session.data_key
    base = session.once(
        "base", key, lambda: [hand.at(strut_law=law)["mean_abs_error_percent"] for law in (False, True)]
    )
    diagnosed, fitted = session.document("diagnose"), session.document("update") if session.is_fitted else None
    floor = diagnosed["baseline"]["noise_floor_percent"] if diagnosed else None
    left_out = None
    if fitted:
        left_out, floor = fitted["steps"][-1]["held_out_error_percent"], fitted["noise_floor_percent"]
    elif diagnosed and not on:
        left_out = diagnosed["baseline"]["as_given"]["held_out_error_percent"]
    elif diagnosed and len(on) == 1:
        ((name, keys),) = on.items()
        same = [row for row in diagnosed["candidates"] if row["effect"] == name and _values(row) == dict(keys)]
        left_out = same[0]["held_out_error_percent"] if same else None
    as_given, refitted = base
    error = now["mean_abs_error_percent"]
    return {"as_given": as_given, "refitted": refitted, "now": error, "left_out": left_out, "floor": floor}


def _values(candidate: Document) -> Picture:
    return {**candidate["choice"], **{key: size["value"] for key, size in candidate["parameters"].items()}}


def verdict(session: Session) -> Picture | None:
    """What the diagnosis says; None while there is none for these readings."""
    diagnosis = session.document("diagnose")
    if not diagnosis:
        return None
    kept = _of(
        diagnosis, "verdict", "text", "why", "plausible", "best", "gates", "detectable", "confounding", "assumptions",
        "warnings", "notes", "noise", "cannot_test", "readings", "portrait",
    )  # fmt: skip
    kept["gates"] = {name: value for name, value in kept["gates"].items() if name != "simulated_squares"}
    return {"sentence": kept["text"].split(". ")[0].rstrip("."), **kept}


def effects(session: Session) -> list[Picture]:
    """The catalogue with what a diagnosis says of each, the likeliest first."""
    diagnosis, on = session.document("diagnose"), session.case.state.on
    rank = {row["effect"]: (n, row) for n, row in enumerate(diagnosis["candidates"] if diagnosis else [])}
    last = len(rank), None
    there = set(session.machine.effects)
    rows = [
        _effect(effect, rank.get(effect.name, last)[1], on.get(effect.name), session)
        for effect in session.catalogue().effects
        if effect.name not in there
    ]
    return sorted(rows, key=lambda row: rank.get(row["name"], last)[0])


def _effect(effect: tps.Effect, candidate: Document | None, on: Any, session: Session) -> Picture:
    row = {name: getattr(effect, name) for name in ("name", "title", "link", "equation", "source")}
    sliders = [_slider(parameter, candidate or {}, session) for parameter in effect.parameters]
    judged = _of(
        candidate or {}, "probability", "mean_abs_error_percent", "held_out_error_percent", "finding", "words",
        "remark", "eligible",
    )  # fmt: skip
    return {**row, "sliders": sliders, "on": on, **judged}


def _slider(parameter: tps.Parameter, candidate: Document, session: Session) -> Picture:
    """A parameter: its key, what it is, the ends of its slider, where it begins."""
    fitted = _values(candidate) if candidate else {}
    key, neutral, value = parameter.key, parameter.neutral, fitted.get(parameter.key)
    row = {"key": key, "name": parameter.name.replace("_", " "), "unit": parameter.unit}
    row |= {"meaning": parameter.meaning, "kind": parameter.kind}
    if parameter.kind == "text":
        names = _setups(session)
        return row | {"choices": names, "start": value or (names[0] if names else "")}
    if parameter.kind == "integer":
        first, final = (int(end) for end in parameter.bounds)
        return row | {"choices": list(range(first, final + 1)), "start": fitted.get(key, first)}
    usual = [end for end in (*parameter.typical, value) if end is not None and math.isfinite(end)]
    if math.isfinite(neutral):
        far = 1.5 * max(abs(end - neutral) for end in usual)
        low, high = neutral - far, neutral + far
    else:
        low, high = 0.2 * min(usual), 5.0 * max(usual)
    low, high = max(low, parameter.bounds[0]), min(high, parameter.bounds[1])
    middle = 0.5 * sum(parameter.typical) if math.isfinite(sum(parameter.typical)) else low
    start = value if value is not None and math.isfinite(value) else min(max(middle, low), high)
    interval = candidate.get("parameters", {}).get(key, {}).get("interval")
    return row | {"low": low, "high": high, "start": start, "fitted": value, "interval": interval}


def _setups(session: Session) -> list[str]:
    """Names of set-ups in the readings, in their order."""

    def make() -> list[str]:
        frame = session.case.data.to_frame(session.machine)
        return sorted(set(frame["setup"]) - {""}) if "setup" in frame else []

    return session.once("setups", session.data_key, make) if session.case.state.data else []


def fit(session: Session) -> Picture | None:
    """The last fit, if it is of these readings."""
    latest = session.found("update")
    if not latest:
        return None
    parts = _of(latest.document, "verdict", "text", "steps", "support", "warnings")
    return {**parts, "accepted": latest.accepted, "holds": session.is_fitted, "result": latest.result}


def plan(session: Session) -> Picture | None:
    """What to measure next."""
    latest = session.found("plan")
    if not latest:
        return None
    names = ("text", "visits", "poses", "readings", "minutes", "notes")
    return {**_of(latest.document, *names), "file": f"{latest.result}/plan.csv"}


def compare(session: Session) -> Picture | None:
    """Where the model fails: planes by direction, findings; the folder with its page."""
    latest = session.found("compare")
    if not latest:
        return None
    names = ("text", "by_plane_and_direction", "by_direction", "findings", "outliers", "warnings")
    return {**_of(latest.document, *names), "result": latest.result}


def program(session: Session) -> Picture | None:
    """The program's text and, once it is analyzed, its path."""
    state = session.case.state
    if not state.program:
        return None
    lines = session.once("lines", session.program_key, lambda: list(session.case.program.lines))
    analysis, error = session.found("analyze"), session.failed("analyze")
    shown = {
        "name": state.program.rpartition("/")[2],
        "lines": lines[:MOST_LINES],
        "origin": origin(session),
        "require": state.require,
        "placed": bool(state.origin),
    }
    if not analysis:
        return {**shown, "path": None, "error": error}
    summary = _of(
        analysis.document, "mean_N_per_mm", "min_N_per_mm", "max_N_per_mm", "range_N_per_mm", "weakest", "plunges",
        "warnings", "out_of_reach_samples", "required",
    )  # fmt: skip
    return {**shown, "path": analysis.path, "summary": summary, "result": analysis.result, "error": ""}


def origin(session: Session) -> list[float]:
    """Where program zero sits."""
    state = session.case.state
    if state.origin:
        return [*state.origin, 0.0, 0.0, 0.0][:6]
    analysis = session.document("analyze")
    return list(analysis["origin_mm_deg"] if analysis else session.machine.origin_mm_deg)


def placement(session: Session) -> Picture | None:
    """The front of the last search, if it is of this program where it sits."""
    state = session.case.state
    if not state.program:
        return None
    now = None
    with suppress(TpsError):
        place = origin(session)
        key = (session.data_key, session.program_key, tuple(place))
        now = session.once("placed", key, lambda: session.trial().at(place))
    entry, sheet = session.found("place"), set_up(session)
    if not entry:
        return {"now": now, "front": None, "set_up": sheet}
    names = ("front", "chosen", "before", "worse", "warnings", "offset_blocks")
    return {"now": now, "set_up": sheet, "result": entry.result, **_of(entry.document, *names)}


def set_up(session: Session) -> Picture | None:
    """Offsets, files and warnings for the shop floor, where they were made for the present placement."""
    entry = session.found("set_up")
    if not entry:
        return None
    files = {"sheet": f"{entry.result}/setup.pdf", "written": entry.file, "page": f"{entry.result}/report.html"}
    return {**_of(entry.document, "warnings", "offset_blocks", "chosen", "before", "worse"), **files}
