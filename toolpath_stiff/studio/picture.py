"""The state of a session as the page draws it: one JSON document, in the shop's units.

A result stands in it as its command writes it, with what the page needs beside.
"""

import math
from contextlib import suppress

import numpy as np

import toolpath_stiff as tps
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import TpsError
from toolpath_stiff.machine.elements import turns
from toolpath_stiff.poses import pose_in_mm, pose_in_si
from toolpath_stiff.report.scene import machine_scene, reach_boundary
from toolpath_stiff.stiffness.contract import ELEMENT
from toolpath_stiff.studio.session import Session

POSE = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
MOST_LINES = 400_000  # of a program's text in the page


def document(session: Session) -> Document:
    """Everything that a page shows."""
    with session.lock:
        case, state = session.case, session.case.state
        fit = result(session, "update")
        return {
            "case": session.name,
            "machine": machine(session),
            "readings": readings(session) if state.data else None,
            "gauge": gauge(session) if state.data else None,
            "verdict": verdict(session),
            "unjudged": session.failed("diagnose"),
            "effects": effects(session),
            "fit": {**fit, "holds": session.is_fitted} if fit else None,
            "plan": result(session, "plan"),
            "compare": result(session, "compare"),
            "program": program(session) if state.program else None,
            "placement": placement(session) if state.program else None,
            "exercise": {"folder": state.exercise, "reveal": session.revealed()},
            "history": [{**vars(step), "state": None} for step in case.history],
            **session.news(),
        }


def result(session: Session, kind: str) -> Document | None:
    """A result as its command writes it, with the folder that keeps it and the files made from it."""
    latest = session.reply(kind)
    if latest is None:
        return None
    return {**latest.document, "result": latest.result, "accepted": latest.accepted, "written": latest.file}


def machine(session: Session) -> Document:
    """Data for the drawing of the machine, and the boundary of its reach with the tool as it is at rest."""
    on, state = session.machine, session.case.state
    model, key, analysis = on.model.machine, (state.machine, state.effects), session.reply("analyze")
    tables = [*([session.readings()] if state.data else []), *([analysis.path] if analysis else [])]

    def poses() -> FloatArray:
        """Poses at the origin, at each reading and along the path, for drawing a machine that is not a hexapod."""
        rows = [np.array([table[name] for name in POSE]).T for table in tables]
        return np.array([pose_in_si(row) for row in np.concatenate([[on.origin_mm_deg], *rows]).tolist()])

    return {
        "title": model.title,
        "effects": on.effects,
        "scene": {
            **session.once("scene", (key, state.data, id(analysis)), lambda: machine_scene(model, poses())),
            "reach": session.once("reach", key, lambda: reach_boundary(model)),
        },
        "origin": list(on.origin_mm_deg),
    }


def readings(session: Session) -> Document:
    """All readings; deviation and model are None for those set aside."""
    columns, aside, now = session.readings(), session.case.state.aside, session.errors()
    out = [f"{file}:{line}" in aside for file, line in zip(columns["file"], columns["line"], strict=True)]
    deviation, modelled = iter(now["deviation_percent"]), iter(now["modelled_N_per_mm"])
    return {
        **columns,
        "aside": out,
        "deviation": [None if gone else round(next(deviation), 3) for gone in out],
        "modelled": [None if gone else round(next(modelled)) for gone in out],
    }


def gauge(session: Session) -> Document:
    """Mean errors in per cent: as filed, refitted, now, at left-out points; and the noise floor."""
    state, preview = session.case.state, session.case.preview
    as_given, refitted = session.once(
        "base", state.judged, lambda: [preview.at(strut_law=law)["mean_abs_error_percent"] for law in (False, True)]
    )
    diagnosed, fitted = session.document("diagnose"), session.document("update") if session.is_fitted else None
    floor = left_out = None
    error = session.errors()["mean_abs_error_percent"]
    if diagnosed:
        refitted = diagnosed["baseline"]["mean_abs_error_percent"]
        rows = [{"effect": row["effect"], **_sizes(row)} for row in diagnosed["candidates"]]
        on = [{"effect": name, **keys} for name, keys in state.on.items()]
        floor = diagnosed["baseline"]["noise_floor_percent"]
        if not on:
            left_out = diagnosed["baseline"]["as_given"]["held_out_error_percent"]
        elif len(on) == 1 and on[0] in rows:
            left_out = diagnosed["candidates"][rows.index(on[0])]["held_out_error_percent"]
    if fitted:  # the figures of the fit itself, made with its own form of the machine
        last, floor = fitted["steps"][-1], fitted["noise_floor_percent"]
        error, left_out = last["mean_abs_error_percent"], last["held_out_error_percent"]
    return {"as_given": as_given, "refitted": refitted, "now": error, "left_out": left_out, "floor": floor}


def _sizes(candidate: Document) -> Document:
    """Key -> value of a candidate's elements and sizes."""
    return {**candidate["choice"], **{key: size["value"] for key, size in candidate["parameters"].items()}}


def verdict(session: Session) -> Document | None:
    """Verdict of the diagnosis; None while there is none for these readings."""
    diagnosis = session.document("diagnose")
    return diagnosis and {"sentence": diagnosis["text"].split(". ")[0].rstrip("."), **diagnosis}


def effects(session: Session) -> list[Document]:
    """The catalogue with the diagnosis's finding on each effect, the most likely first."""
    candidates = (session.document("diagnose") or {"candidates": []})["candidates"]
    judged = {row["effect"]: row for row in reversed(candidates)}  # of several elements the likeliest
    order = [row["effect"] for row in candidates]
    rows = [
        {
            "probability": None,
            **judged.get(effect.name, {}),
            **{name: getattr(effect, name) for name in ("name", "title", "link")},
            "sliders": [
                _slider(part, judged.get(effect.name, {}), session, effect.link == "joints")
                for part in effect.parameters
            ],
            "on": session.case.state.on.get(effect.name),
        }
        for effect in session.catalogue().effects
        if effect.name not in session.machine.effects
    ]
    return sorted(rows, key=lambda row: order.index(row["name"]) if row["name"] in order else len(order))


def _slider(parameter: tps.Parameter, candidate: Document, session: Session, of_joints: bool) -> Document:
    """A parameter's slider: key, description, ends, start; elements are `of_joints` or others."""
    key, neutral, typical = parameter.key, parameter.neutral, parameter.typical
    value = _sizes(candidate).get(key) if candidate else None
    row = {"key": key, "name": parameter.name.replace("_", " "), "unit": parameter.unit}
    row |= {"meaning": parameter.meaning, "kind": parameter.kind}
    if parameter.kind == "text":
        machine = session.machine.model.machine
        names = [e.name for e in machine.elements if turns(e) == of_joints] if key == ELEMENT else _setups(session)
        return row | {"choices": names, "start": value or (names[0] if names else "")}
    if parameter.kind == "integer":
        first, final = (int(end) for end in parameter.bounds)
        return row | {"choices": list(range(first, final + 1)), "start": first if value is None else value}
    usual = [end for end in (*typical, value) if end is not None and math.isfinite(end)]
    far = 1.5 * max(abs(end - neutral) for end in usual)
    low, high = (neutral - far, neutral + far) if math.isfinite(neutral) else (0.2 * min(usual), 5.0 * max(usual))
    low, high = max(low, parameter.bounds[0]), min(high, parameter.bounds[1])
    middle = 0.5 * sum(typical) if math.isfinite(sum(typical)) else low
    start = value if value is not None and math.isfinite(value) else min(max(middle, low), high)
    interval = candidate.get("parameters", {}).get(key, {}).get("interval")
    return row | {"low": low, "high": high, "start": start, "interval": interval}


def _setups(session: Session) -> list[str]:
    """Names of the set-ups in the readings, in order."""
    return sorted({*session.readings()["setup"]} - {""}) if session.case.state.data else []


def program(session: Session) -> Document:
    """Text of the program and, once it has been analyzed, its path."""
    state, analysis = session.case.state, session.reply("analyze")
    lines = session.once("lines", session.program_key, lambda: list(session.case.program.lines))
    path, shifted = analysis.path if analysis else None, session.reply("compensate")
    if path and shifted:
        shift = np.interp(path["s_mm"], shifted.path["s_mm"], shifted.path["shift"])
        path = {**path, "shift": np.round(shift, 3).tolist()}
    return {
        "name": state.program.rpartition("/")[2],
        "lines": lines[:MOST_LINES],
        "origin": origin(session),
        "require": state.require,
        "placed": bool(state.origin),
        "path": path,
        "compensated": result(session, "compensate"),
        "summary": analysis.document if analysis else None,
        "result": analysis.result if analysis else "",
        "error": session.failed("compensate") if analysis else session.failed("analyze"),
    }


def origin(session: Session) -> list[float]:
    """Position of program zero, mm and degrees."""
    state = session.case.state
    if state.origin:
        return [*state.origin, 0.0, 0.0, 0.0][:6]
    analysis = session.document("analyze")
    return list(analysis["origin_mm_deg"] if analysis else session.machine.origin_mm_deg)


def placement(session: Session) -> Document:
    """Figures where the program sits now and where it sat before; front of the last search; set-up sheet."""
    now, before, place = None, None, origin(session)
    with suppress(TpsError):
        key, trial = session.key("place"), session.trial()
        now = session.once("placed", (key, tuple(place)), lambda: trial.at(place))
        before = session.once("unplaced", key, lambda: trial.at(pose_in_mm(trial.program.origin)))
    return {**(result(session, "place") or {}), "now": now, "before": before, "set_up": result(session, "set_up")}
