"""The state of a session as the page draws it: one JSON document, in the shop's units."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from toolpath_stiff.errors import TpsError

if TYPE_CHECKING:
    import toolpath_stiff as tps
    from toolpath_stiff.studio.session import Session

MERIDIANS, PARALLELS = 36, 9  # of the reach boundary
MOST_LINES = 400_000  # of a program's text in the page


def document(session: Session) -> dict[str, Any]:
    """Everything that a page shows."""
    with session.lock:
        return _document(session) | session.news()


def _document(session: Session) -> dict[str, Any]:
    case, state = session.case, session.case.state
    has_data = bool(state.data)
    now = session.errors() if has_data else None
    return {
        "case": session.name,
        "machine": machine(session.machine),
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
        "history": [_step(step) for step in case.history],
        "undone": [_step(step) for step in case.undone],
    }


def _step(step: Any) -> dict[str, str]:
    return {name: getattr(step, name) for name in ("kind", "text", "command", "python", "result")}


def machine(on: tps.Machine) -> dict[str, Any]:
    """What the drawing of the machine needs, and the boundary of its reach with the tool as it stands at rest."""
    return {
        "name": on.name,
        "title": on.title,
        "effects": on.effects,
        "joints": on.joints_mm,
        "origin": list(on.origin_mm_deg),
        "reach": _reach(on),
    }


_KEPT: dict[int, Any] = {}


def _reach(on: tps.Machine) -> list[list[list[float]]]:
    if id(on.model) not in _KEPT:
        _KEPT.clear()
        _KEPT[id(on.model)] = (on.model, _boundary(on))
    found: list[list[list[float]]] = _KEPT[id(on.model)][1]
    return found


def _boundary(on: tps.Machine) -> list[list[list[float]]]:
    """(parallels, meridians, 3) mm: how far the tip goes from the default origin along rays."""
    centre = on.origin_mm_deg[:3]
    heights = [-90.0 + 180.0 * i / (PARALLELS - 1) for i in range(PARALLELS)]
    rays = [_ray(height, 360.0 * k / MERIDIANS) for height in heights for k in range(MERIDIANS)]
    lengths = on.reach_mm(centre, rays)
    points = [
        [round(c + d * float(length), 1) for c, d in zip(centre, ray, strict=True)]
        for ray, length in zip(rays, lengths, strict=True)
    ]
    return [points[i * MERIDIANS : (i + 1) * MERIDIANS] for i in range(PARALLELS)]


@lru_cache(maxsize=1024)
def _ray(height: float, azimuth: float) -> tuple[float, float, float]:
    h, a = math.radians(height), math.radians(azimuth)
    return (math.cos(h) * math.cos(a), math.cos(h) * math.sin(a), math.sin(h))


def readings(session: Session, now: dict[str, Any] | None) -> dict[str, Any]:
    """All readings; deviation and model are None for those that are set aside."""
    found, aside = session.readings(), set(session.case.state.aside)
    out = [f"{file}:{line}" in aside for file, line in zip(found["file"], found["line"], strict=True)]
    deviation, modelled = iter(now["deviation_percent"] if now else ()), iter(now["modelled_N_per_mm"] if now else ())
    return {
        **found,
        "aside": out,
        "deviation": [None if gone else round(next(deviation), 3) for gone in out],
        "modelled": [None if gone else round(next(modelled)) for gone in out],
    }


def gauge(session: Session, now: dict[str, Any]) -> dict[str, Any]:
    """Mean errors in per cent: as the file stands, refitted, now, at left-out points; the noise floor."""
    hand, on = session.case.preview, session.case.state.on
    key = session.data_key
    base = session.once(
        "base", key, lambda: [hand.at(strut_law=law)["mean_abs_error_percent"] for law in (False, True)]
    )
    found = session.found("diagnose")
    diagnosed = found["document"] if found else None
    fitted = session.found("update") if session.is_fitted else None
    floor = diagnosed["baseline"]["noise_floor_percent"] if diagnosed else None
    left_out = None
    if fitted:
        last = fitted["document"]["steps"][-1]
        left_out, floor = last["held_out_error_percent"], fitted["document"]["noise_floor_percent"]
    elif diagnosed and not on:
        left_out = diagnosed["baseline"]["as_given"]["held_out_error_percent"]
    elif diagnosed and len(on) == 1:
        ((name, keys),) = on.items()
        same = [one for one in diagnosed["candidates"] if one["effect"] == name and _values(one) == dict(keys)]
        left_out = same[0]["held_out_error_percent"] if same else None
    return {
        "as_given": base[0],
        "refitted": base[1],
        "now": now["mean_abs_error_percent"],
        "left_out": left_out,
        "floor": floor,
    }


def _values(candidate: dict[str, Any]) -> dict[str, Any]:
    return {**candidate["choice"], **{key: one["value"] for key, one in candidate["parameters"].items()}}


SENTENCES = {
    "adequate": "Nothing is missing that these data could show",
    "unexplained": "Something is missing that no effect describes",
}


ENDS = {"identified": "nothing else fits", "described": "described, not confirmed: new readings must tell"}


def verdict(session: Session) -> dict[str, Any] | None:
    """What the diagnosis says; None while there is none for these readings."""
    found = session.found("diagnose")
    if not found:
        return None
    said = found["document"]
    best = next((one for one in said["candidates"] if one["effect"] == said["best"]), None)
    names = said["plausible"]
    if said["verdict"] in ENDS and best and best["finding"]:
        sentence = f"{best['finding'][0].upper()}{best['finding'][1:]}; {ENDS[said['verdict']]}"
    elif said["verdict"] in SENTENCES:
        sentence = SENTENCES[said["verdict"]]
    else:
        sentence = f"Several explain it: {', '.join(names)}" if len(names) > 1 else said["text"].split(". ")[0]
    keys = (
        "verdict",
        "text",
        "why",
        "plausible",
        "best",
        "gates",
        "detectable",
        "confounding",
        "assumptions",
        "warnings",
        "notes",
        "noise",
        "cannot_test",
        "readings",
        "portrait",
    )
    kept = {key: said[key] for key in keys}
    kept["gates"] = {name: value for name, value in kept["gates"].items() if name != "simulated_squares"}
    return {"sentence": sentence, **kept}


def effects(session: Session) -> list[dict[str, Any]]:
    """The catalogue with what a diagnosis says of each, the likeliest first."""
    found, on = session.found("diagnose"), session.case.state.on
    candidates = found["document"]["candidates"] if found else []
    rank = {one["effect"]: (n, one) for n, one in enumerate(candidates)}
    there = set(session.machine.effects)
    rows = [
        _effect(effect, rank.get(effect.name, (len(rank), None))[1], on.get(effect.name), session)
        for effect in session.catalogue().effects
        if effect.name not in there
    ]
    return sorted(rows, key=lambda row: rank.get(row["name"], (len(rank), None))[0])


def _effect(effect: Any, candidate: dict[str, Any] | None, on: Any, session: Session) -> dict[str, Any]:
    fitted = _values(candidate) if candidate else {}
    sliders = [_slider(one, candidate, fitted, session) for one in effect.parameters]
    row = {
        "name": effect.name,
        "title": effect.title,
        "link": effect.link,
        "equation": effect.equation,
        "source": effect.source,
        "sliders": sliders,
        "on": on,
    }
    names = (
        "probability",
        "mean_abs_error_percent",
        "held_out_error_percent",
        "finding",
        "words",
        "remark",
        "eligible",
    )
    return row | {name: candidate[name] if candidate else None for name in names}


def _slider(one: Any, candidate: dict[str, Any] | None, fitted: dict[str, Any], session: Session) -> dict[str, Any]:
    """A parameter: its key, what it is, the ends of its slider, where it begins."""
    row = {
        "key": one.key,
        "name": one.name.replace("_", " "),
        "unit": one.unit,
        "meaning": one.meaning,
        "kind": one.kind,
    }
    if one.kind == "text":
        names = sorted(set(_setups(session)))
        return row | {"choices": names, "start": fitted.get(one.key) or (names[0] if names else "")}
    if one.kind == "integer":
        low, high = (int(end) for end in one.bounds)
        return row | {"choices": list(range(low, high + 1)), "start": fitted.get(one.key, low)}
    known = (candidate or {}).get("parameters", {}).get(one.key, {})
    value = fitted.get(one.key)
    low, high = one.typical
    usual = [end for end in (low, high, value) if end is not None and math.isfinite(end)]
    if math.isfinite(one.neutral):
        far = 1.5 * max(abs(end - one.neutral) for end in usual)
        ends = [
            one.neutral - far if one.bounds[0] < one.neutral else one.neutral,
            one.neutral + far if one.bounds[1] > one.neutral else one.neutral,
        ]
    else:
        ends = [0.2 * min(usual), 5.0 * max(usual)]
    ends = [max(ends[0], one.bounds[0]), min(ends[1], one.bounds[1])]
    middle = 0.5 * (low + high) if math.isfinite(low + high) else ends[0]
    start = value if value is not None and math.isfinite(value) else min(max(middle, ends[0]), ends[1])
    return row | {"low": ends[0], "high": ends[1], "start": start, "fitted": value, "interval": known.get("interval")}


def _setups(session: Session) -> list[str]:
    """Names of set-ups in the readings."""

    def make() -> list[str]:
        frame = session.case.data.to_frame(session.machine)
        return [name for name in frame["setup"].unique().tolist() if name] if "setup" in frame else []

    found: list[str] = session.once("setups", session.data_key, make) if session.case.state.data else []
    return found


def fit(session: Session) -> dict[str, Any] | None:
    """The last fit, if it is of these readings."""
    found = session.found("update")
    if not found:
        return None
    said = found["document"]
    return {
        "verdict": said["verdict"],
        "text": said["text"],
        "steps": said["steps"],
        "support": said["support"],
        "warnings": said["warnings"],
        "accepted": found["accepted"],
        "holds": session.is_fitted,
        "result": found["result"],
    }


def plan(session: Session) -> dict[str, Any] | None:
    """What to measure next."""
    found = session.found("plan")
    if not found:
        return None
    said = found["document"]
    names = ("text", "visits", "poses", "readings", "minutes", "notes")
    return {**{name: said[name] for name in names}, "file": f"{found['result']}/plan.csv"}


def compare(session: Session) -> dict[str, Any] | None:
    """Where the model fails: planes by direction, findings; the folder with its page."""
    found = session.found("compare")
    if not found:
        return None
    said = found["document"]
    names = ("text", "by_plane_and_direction", "by_direction", "findings", "outliers", "warnings")
    return {**{name: said[name] for name in names}, "result": found["result"]}


def program(session: Session) -> dict[str, Any] | None:
    """The program's text and, once it is analyzed, its path."""
    state = session.case.state
    if not state.program:
        return None
    lines = session.once("lines", session.program_key, lambda: list(session.case.program.lines))
    found, error = session.found("analyze"), session.failed("analyze")
    shown = {
        "name": state.program.rpartition("/")[2],
        "lines": lines[:MOST_LINES],
        "origin": origin(session),
        "require": state.require,
        "placed": bool(state.origin),
    }
    if not found:
        return {**shown, "path": None, "error": error}
    said = found["document"]
    names = (
        "mean_N_per_mm",
        "min_N_per_mm",
        "max_N_per_mm",
        "range_N_per_mm",
        "weakest",
        "plunges",
        "warnings",
        "out_of_reach_samples",
        "per_operation",
        "required",
    )
    return {
        **shown,
        "path": found["path"],
        "summary": {name: said.get(name) for name in names},
        "result": found["result"],
        "error": "",
    }


def origin(session: Session) -> list[float]:
    """Where program zero sits."""
    state = session.case.state
    if state.origin:
        return [*state.origin, 0.0, 0.0, 0.0][:6]
    found = session.found("analyze")
    return list(found["document"]["origin_mm_deg"] if found else session.machine.origin_mm_deg)


def placement(session: Session) -> dict[str, Any] | None:
    """The front of the last search, if it is of this program where it sits."""
    state = session.case.state
    if not state.program:
        return None
    try:
        now = session.once(
            "placed",
            (session.data_key, session.program_key, tuple(origin(session))),
            lambda: session.trial().at(origin(session)),
        )
    except TpsError:
        now = None
    entry, sheet = session.found("place"), set_up(session)
    if not entry:
        return {"now": now, "front": None, "set_up": sheet}
    said = entry["document"]
    names = ("front", "chosen", "before", "worse", "warnings", "offset_blocks")
    return {"now": now, "set_up": sheet, "result": entry["result"], **{name: said.get(name) for name in names}}


def set_up(session: Session) -> dict[str, Any] | None:
    """Offsets, files and warnings for the shop floor, where they were made for the present placement."""
    entry = session.found("set_up")
    if not entry:
        return None
    said = entry["document"]
    files = {"sheet": "setup.pdf", "written": entry["written"], "page": "report.html"}
    return {
        **{name: said.get(name) for name in ("warnings", "offset_blocks", "chosen", "before", "worse")},
        **{name: f"{entry['result']}/{file}" for name, file in files.items()},
    }
