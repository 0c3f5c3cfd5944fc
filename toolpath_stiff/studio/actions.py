"""What a page may ask a session to do; files that are dropped on it."""

import tempfile
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import toolpath_stiff as tps
from toolpath_stiff.case.steps import TABLES
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.nc.controller import KEYS
from toolpath_stiff.nc.program import Reading
from toolpath_stiff.studio.session import Session

MOST_POSES = 60
SUFFIXES = {".csv": "data", ".xlsx": "data", ".py": "effects", ".toml": "machine", ".tbl": "tools", ".var": "offsets"}
NOT_OURS = (TypeError, ValueError, KeyError, OverflowError, AttributeError)  # of arguments that no page of ours sends
LONGEST_NAME = 200  # bytes: what a file system takes, and what is put before it


def do(session: Session, question: Mapping[str, Any]) -> dict[str, Any]:
    """Do what a page asks. Raises `InputError` for what cannot be done."""
    name = str(question.get("do"))
    if name not in ACTIONS:
        raise InputError(f"nothing called {name!r} can be done")
    given = {key: value for key, value in question.items() if key != "do"}
    with session.lock:
        session.message = ""
        try:
            answer = ACTIONS[name](session, **given)
        except NOT_OURS as error:
            raise InputError(f"{name}: {error}") from None
        if name not in LOOKS:
            session.follow_up()
            session.tell()
    return answer or {}


def _by_hand(session: Session, on: Mapping[str, Any]) -> dict[str, Any]:
    # Which readings are wild is found out when the slider is let go.
    errors = session.case.preview.at(on, strut_law=bool(on), near=session.case.state.on or None)
    return {**errors, "deviation_percent": [round(percent, 3) for percent in errors["deviation_percent"]],
            "modelled_N_per_mm": [round(stiffness) for stiffness in errors["modelled_N_per_mm"]]}  # fmt: skip


def _aside(session: Session, file: str, line: int) -> None:
    back = f"{file}:{line}" in session.case.state.aside
    if not back and len(session.case.state.aside) + 8 > len(session.readings()["line"]):
        raise InputError("too few readings would be left", expected="more than 8 in use")
    session.case.set_aside(file, int(line), back=back)


def _fit(session: Session) -> None:
    on = session.case.state.on
    if not on:
        raise InputError("no effect is switched on", hint="switch one on, then fit")
    session.queue("update", add=[_word(session.catalogue()[name], keys) for name, keys in on.items()])


def _accept(session: Session) -> None:
    fit = session.found("update")
    if not fit or not fit.accepted:
        raise InputError("there is no fit that the data support", hint="switch an effect on and press Fit")
    session.case.accept(session.case.folder / fit.result / "machine.toml")


def _measure(session: Session) -> None:
    plan = session.case.latest("plan")
    if not plan:
        raise InputError("there is no plan yet", hint="press Make a plan")
    session.case.measure(str(session.case.folder / plan / "plan.csv"))


def _claim(session: Session, effects: str) -> None:
    session.revealed = session.case.claim(str(effects))


def _exercise(session: Session, seed: int, layout: str = "tilted") -> None:
    session.case.start_exercise(seed, layout=layout)
    session.revealed = None


def _save_effect(session: Session, file: str, text: str) -> None:
    session.editing.save(str(file), str(text))
    session.editing.look()


def take_file(session: Session, name: str, content: bytes, run: bool) -> dict[str, Any]:
    """A file that was dropped: measurements, a machine, effects, else a program."""
    plain = Path(name.replace("\\", "/")).name or "file"
    if "\0" in plain or len(plain.encode()) > LONGEST_NAME:
        raise InputError(f"a file called {plain[:40]!r}", expected=f"{LONGEST_NAME} bytes at most, none of them zero")
    kind = _kind(Path(plain).suffix.lower(), content)
    if kind == "effects" and not run:
        return {"confirm": f"{plain} is code. It is run when it is loaded. Load it?"}
    with tempfile.TemporaryDirectory() as folder, session.lock:
        file = Path(folder) / plain
        file.write_bytes(content)
        session.case.sent_to = f"{folder}/"
        case = session.case
        add: dict[str, Callable[[Path], None]] = {
            "data": case.add_data,
            "effects": case.add_effects,
            "machine": case.set_machine,
        }
        try:
            if kind in TABLES:
                case.read_programs(**cast("Reading", {kind: file}))
            else:
                add.get(kind, case.add_program)(file)
        except TpsError as error:
            raise InputError(str(error).replace(f"{folder}/", "").replace(f"{case.folder}/", "")) from None
        session.message = f"{plain}: {session.case.history[-1].text}"
        session.follow_up()
        session.tell()
    return {"message": session.message}


def _kind(suffix: str, content: bytes) -> str:
    """What a file is that was dropped; tables of tools and controller files are known by their headings and keys."""
    heading = content[:4096].decode("utf-8-sig", "replace").partition("\n")[0]
    if suffix == ".csv" and {"tool", "length_mm"} <= {cell.strip() for cell in heading.split(",")}:
        return "tools"
    if suffix == ".toml":
        try:
            keys = set(tomllib.loads(content.decode("utf-8-sig")))
        except ValueError:
            keys = set()
        return "controller" if keys and keys <= set(KEYS) else "machine"
    return SUFFIXES.get(suffix, "program")


def _word(effect: tps.Effect, keys: Mapping[str, Any]) -> str:
    """An effect as --add takes it: with what it acts on."""
    chosen = [
        f"{parameter.name}={keys[parameter.key]}"
        for parameter in effect.parameters
        if parameter.discrete and keys.get(parameter.key) not in ("", None)
    ]
    return f"{effect.name}:{','.join(chosen)}" if chosen else effect.name


ACTIONS: dict[str, Callable[..., dict[str, Any] | None]] = {
    "hand": _by_hand,
    "at": lambda session, origin: session.trial().at(origin),
    "switch": lambda session, effect, values: session.case.switch(str(effect), values),
    "aside": _aside,
    "fit": _fit,
    "accept": _accept,
    "plan": lambda session, n=6: session.queue("plan", n=max(1, min(MOST_POSES, int(n)))),
    "compare": lambda session: session.queue("compare"),
    "draft": lambda session: session.queue("draft"),
    "edit": lambda session, file: session.editing.open(str(file)),
    "save_effect": _save_effect,
    "set_up": lambda session: session.queue("set_up"),
    "measure": _measure,
    "exercise": _exercise,
    "claim": _claim,
    "place": lambda session: session.queue("place"),
    "place_at": lambda session, origin: session.case.place_at(origin),
    "require": lambda session, value: session.case.require(float(value)),
    "undo": lambda session: None if session.case.undo() else {"message": "nothing to undo"},
    "redo": lambda session: None if session.case.redo() else {"message": "nothing to redo"},
    "cancel": lambda session: session.cancel(),
}
LOOKS = ("hand", "at")  # these change nothing
