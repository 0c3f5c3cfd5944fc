"""Actions that a page may request of a session, and files dropped on it."""

import re
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import cast

import toolpath_stiff as tps
from toolpath_stiff.case.state import TABLES
from toolpath_stiff.cutting.setup import SECTIONS
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.nc.controller import KEYS
from toolpath_stiff.nc.program import Reading
from toolpath_stiff.studio.session import Session

MOST_POSES = 60
LEAST_READINGS = 8
SUFFIXES = {".csv": "data", ".xlsx": "data", ".py": "effects", ".toml": "machine", ".tbl": "tools", ".var": "offsets"}
NOT_OURS = (TypeError, ValueError, KeyError, OverflowError, AttributeError)  # of arguments that no page of ours sends
LONGEST_NAME = 200  # bytes: what a file system takes, and what is put before it


def do(session: Session, question: Document) -> Document:
    """Carry out the action that a page requests. Raises `InputError` if it is impossible."""
    name = str(question.get("do"))
    if name not in ACTIONS:
        raise InputError(f"unknown action {name!r}")
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


def _by_hand(session: Session, on: Mapping[str, Document]) -> Document:
    # Outliers are looked for only when the slider is released.
    errors = session.case.preview.at(on, strut_law=bool(on), near=session.case.state.on or None)
    rounded = {"deviation_percent": 3, "modelled_N_per_mm": 0}
    return {**errors, **{name: [round(value, n) for value in errors[name]] for name, n in rounded.items()}}


def _aside(session: Session, file: str, line: int) -> None:
    aside = session.case.state.aside
    back = f"{file}:{line}" in aside
    if not back and len(aside) + LEAST_READINGS > len(session.readings()["line"]):
        raise InputError("too few readings would be left", expected=f"more than {LEAST_READINGS} in use")
    session.case.set_aside(file, int(line), back=back)


def _fit(session: Session) -> None:
    on = session.case.state.on
    if not on:
        raise InputError("no effect is switched on", hint="switch one on, then fit")
    session.queue("update", add=[_word(session.catalogue()[name], keys) for name, keys in on.items()])


def _word(effect: tps.Effect, keys: Document) -> str:
    """An effect as --add takes it, with the elements that it acts on."""
    discrete = [parameter for parameter in effect.parameters if parameter.discrete]
    chosen = [f"{part.name}={keys[part.key]}" for part in discrete if keys.get(part.key) not in ("", None)]
    return f"{effect.name}:{','.join(chosen)}" if chosen else effect.name


def _accept(session: Session) -> None:
    fit = session.reply("update")
    if not fit or not fit.accepted:
        raise InputError("there is no fit that the data support", hint="switch an effect on and press Fit")
    session.case.accept(session.case.folder / fit.result / "machine.toml")


def _queue(kind: str) -> Callable[..., None]:
    return lambda session: session.queue(kind)


def _measure(session: Session) -> None:
    plan = session.case.latest("plan")
    if not plan:
        raise InputError("there is no plan yet", hint="press Make a plan")
    session.case.measure(str(session.case.folder / plan / "plan.csv"))


@contextmanager
def _sent(session: Session, name: str, content: bytes) -> Iterator[Path]:
    """Content sent by a page, as a temporary file; errors do not mention its folder."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_bytes(content)
        try:
            yield file
        except TpsError as error:
            raise InputError(str(error).replace(f"{folder}/", "").replace(f"{session.case.folder}/", "")) from None


def take_file(session: Session, name: str, content: bytes, run: bool) -> Document:
    """Take in a dropped file: measurements, a machine, effects, the setup of a cut, otherwise a program."""
    plain = Path(name.replace("\\", "/")).name or "file"
    if "\0" in plain or len(plain.encode()) > LONGEST_NAME:
        raise InputError(f"a file called {plain[:40]!r}", expected=f"{LONGEST_NAME} bytes at most, none of them zero")
    kind = _kind(Path(plain).suffix.lower(), content)
    if kind == "effects" and not run:
        return {"confirm": f"{plain} is code. It is run when it is loaded. Load it?"}
    with session.lock, _sent(session, plain, content) as file:
        case = session.case
        # A copy that took another's place has a number at its end.
        again = next((name for name in case.state.effects if plain in (Path(name).name, _unnumbered(name))), "")
        if kind in TABLES:
            case.add_program(**cast("Reading", {kind: file}))
        else:
            takers: dict[str, Callable[[Path], None]] = {
                "data": case.add_data,
                "effects": partial(case.add_effects, instead_of=again),
                "machine": case.set_machine,
                "cut": case.set_cut,
            }
            takers.get(kind, case.add_program)(file)
        session.message = ""
        session.follow_up()
        session.tell()
        done = case.history[-1].text
    return {"message": done}


def _unnumbered(name: str) -> str:
    return re.sub(r"-\d+(?=\.\w+$)", "", Path(name).name)


def _kind(suffix: str, content: bytes) -> str:
    """Kind of a dropped file; tool tables and controller files are recognised by their headings and keys."""
    heading = content[:4096].decode("utf-8-sig", "replace").partition("\n")[0]
    if suffix == ".csv" and {"tool", "length_mm"} <= {cell.strip() for cell in heading.split(",")}:
        return "tools"
    if suffix == ".toml":
        try:
            keys = set(tomllib.loads(content.decode("utf-8-sig")))
        except ValueError:
            keys = set()
        if keys and keys <= set(SECTIONS):
            return "cut"
        return "controller" if keys and keys <= set(KEYS) else "machine"
    return SUFFIXES.get(suffix, "program")


ACTIONS: dict[str, Callable[..., Document | None]] = {
    "hand": _by_hand,
    "at": lambda session, origin: session.trial().at(origin),
    "switch": lambda session, effect, values: session.case.switch(str(effect), values),
    "aside": _aside,
    "fit": _fit,
    "accept": _accept,
    "plan": lambda session, n=6: session.queue("plan", n=max(1, min(MOST_POSES, int(n)))),
    **{kind: _queue(kind) for kind in ("diagnose", "analyze", "compensate", "compare", "draft", "set_up", "place")},
    "measure": _measure,
    "exercise": lambda session, seed, layout="tilted": session.case.start_exercise(seed, layout=layout),
    "claim": lambda session, effects: session.case.claim(str(effects)),
    "place_at": lambda session, origin: session.case.place_at(origin),
    "require": lambda session, value: session.case.require(float(value)),
    "undo": lambda session: None if session.case.undo() else {"message": "nothing to undo"},
    "cancel": lambda session: session.cancel(),
}
LOOKS = ("hand", "at")  # these change nothing
