"""What all tabs of a studio share: the case, what was found, the work under way; what a page may ask to be done."""

from __future__ import annotations

import threading
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import toolpath_stiff as tps
from toolpath_stiff.case.case import Case
from toolpath_stiff.case.contents import reading_words
from toolpath_stiff.case.steps import Step
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.results import one_of
from toolpath_stiff.studio.editing import Editing
from toolpath_stiff.studio.work import Job

MOST_POSES, MOST_SEED = 60, 2**31 - 1
SUFFIXES = {".csv": "data", ".xlsx": "data", ".py": "effects", ".toml": "machine", ".tbl": "tools", ".var": "offsets"}
NOT_OURS = (TypeError, ValueError, KeyError, OverflowError, AttributeError)  # of arguments that no page of ours sends
LONGEST_NAME = 200  # bytes: what a file system takes, and what is put before it


class Session:
    """One case, open in any number of tabs.

    Attributes
    ----------
    case
        The case; changed by `do` alone.
    lock
        Held by whoever reads or changes the state.
    """

    def __init__(self, case: Case) -> None:
        self.case, self.name = case, case.folder.resolve().name
        self.lock, self._changed = threading.RLock(), threading.Condition()
        self._version = self._beat = 0
        self._jobs: list[tuple[str, dict[str, Any]]] = []
        self._running: Job | None = None
        self._found: dict[tuple[str, Any], dict[str, Any]] = {}  # kind and what it was found for -> what was found
        self._failed: dict[str, tuple[Any, str]] = {}
        self._message = ""
        self._revealed: dict[str, Any] | None = None
        self._kept: dict[str, tuple[Any, Any]] = {}  # name -> key, value: what is worked out once for a state
        self.editing = Editing(case)
        self._resume()
        self._follow_up()
        self.editing.follow(self._look)

    # -- for the server ------------------------------------------------------------------------------------------------

    def wait(self, seen: tuple[int, int], seconds: float) -> tuple[int, int]:
        """The version and the beat of the work, as soon as one of them is another."""
        with self._changed:
            self._changed.wait_for(lambda: (self._version, self._beat) != seen, seconds)
            return self._version, self._beat

    def news(self) -> dict[str, Any]:
        """What tabs are told at once: the version of the state, the work under way, the last message."""
        return {"version": self._version, "job": self._job(), "message": self._message}

    def close(self) -> None:
        """End the work under way."""
        self.editing.close()
        with self.lock:
            self._jobs = []
            if self._running:
                self._running.stop()

    def _tell(self, state: bool = True) -> None:
        with self._changed:
            self._version += state
            self._beat += 1
            self._changed.notify_all()

    # -- what is worked out once for a state ---------------------------------------------------------------------------

    @property
    def data_key(self) -> tuple[Any, ...]:
        """What a diagnosis hangs on."""
        state = self.case.state
        return (state.machine, state.effects, state.data, state.aside)

    @property
    def path_key(self) -> tuple[Any, ...]:
        """What the analysis of the program hangs on."""
        state = self.case.state
        own = tuple((name, tuple(keys.items())) for name, keys in state.on.items())
        fitted = bool(own) and self.is_fitted  # a fit knows how well it knows: its machine has a band
        on = self.data_key if own else (state.machine, state.effects)
        return (on, own, fitted, self.program_key, state.origin, state.require)

    @property
    def program_key(self) -> tuple[Any, ...]:
        """The program and how it is read."""
        state = self.case.state
        return (state.program, tuple(state.reading.items()))

    def once(self, name: str, key: Any, make: Callable[[], Any]) -> Any:
        """What `make` gives, worked out once for a key."""
        if name not in self._kept or self._kept[name][0] != key:
            self._kept[name] = (key, make())
        return self._kept[name][1]

    @property
    def machine(self) -> tps.Machine:
        """The machine of the case."""
        state = self.case.state
        found: tps.Machine = self.once("machine", (state.machine, state.effects), lambda: self.case.machine)
        return found

    def errors(self) -> dict[str, Any]:
        """The error of every reading in use as the switches stand."""
        on = self.case.state.on
        found: dict[str, Any] = self.once(
            "errors", (self.data_key, on), lambda: self.case.preview.at(on, strut_law=bool(on))
        )
        return found

    def found(self, kind: str) -> dict[str, Any] | None:
        """What was found last, if it still holds."""
        return self._found.get((kind, self.key(kind)))

    def catalogue(self) -> tps.EffectCatalogue:
        """The effects that can be switched on."""
        files = self.case.state.effects
        found: tps.EffectCatalogue = self.once(
            "catalogue", files, lambda: tps.effects([self.case.path(name) for name in files])
        )
        return found

    def trial(self) -> tps.PlacementTrial:
        """The program that can be put anywhere."""
        state = self.case.state
        found: tps.PlacementTrial = self.once(
            "trial", (state.machine, state.effects, self.program_key),
            lambda: tps.try_placement(self.case.program, self.machine),
        )  # fmt: skip
        return found

    # -- what can be done ----------------------------------------------------------------------------------------------

    def do(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Do what a page asks. Raises `InputError` for what cannot be done."""
        name = str(asked.get("do"))
        if name not in ACTIONS:
            raise InputError(f"nothing called {name!r} can be done")
        given = {key: value for key, value in asked.items() if key != "do"}
        with self.lock:
            self._message = ""
            try:
                answer = ACTIONS[name](self, **given)
            except NOT_OURS as error:
                raise InputError(f"{name}: {error}") from None
            if name not in LOOKS:
                self._follow_up()
                self._tell()
        return answer or {}

    def _by_hand(self, on: Mapping[str, Any]) -> dict[str, Any]:
        # Which readings are wild is found out when the slider is let go.
        found = self.case.preview.at(on, strut_law=bool(on), near=self.case.state.on or None)
        return {**found, "deviation_percent": [round(one, 3) for one in found["deviation_percent"]],
                "modelled_N_per_mm": [round(one) for one in found["modelled_N_per_mm"]]}  # fmt: skip

    def _aside(self, file: str, line: int) -> None:
        back = f"{file}:{line}" in self.case.state.aside
        if not back and len(self.case.state.aside) + 8 > len(self.readings()["line"]):
            raise InputError("too few readings would be left", expected="more than 8 in use")
        self.case.set_aside(file, int(line), back=back)

    def _fit(self) -> None:
        on = self.case.state.on
        if not on:
            raise InputError("no effect is switched on", hint="switch one on, then fit")
        self._queue("update", add=[_word(self.catalogue()[name], keys) for name, keys in on.items()])

    def _accept(self) -> None:
        entry = self.found("update")
        if not entry or not entry.get("accepted"):
            raise InputError("there is no fit that the data support", hint="switch an effect on and press Fit")
        self.case.accept(self.case.folder / entry["result"] / "machine.toml")

    def _measure(self) -> None:
        plan = self.case.latest("plan")
        if not plan:
            raise InputError("there is no plan yet", hint="press Make a plan")
        self.case.measure(str(self.case.folder / plan / "plan.csv"))

    def _claim(self, effects: str) -> None:
        self._revealed = self.case.claim(str(effects))

    def _exercise(self, seed: int, layout: str = "tilted") -> None:
        if not isinstance(seed, int) or not 0 <= seed <= MOST_SEED:
            raise InputError(f"seed {seed}", expected="a whole number, 0 or more")
        self.case.start_exercise(seed, layout=one_of("layout", layout, ("tilted", "paper")))
        self._revealed = None

    def _place(self, **bounds: Any) -> None:
        allowed = ("x_mm", "y_mm", "z_mm", "rotate_deg")
        if set(bounds) - set(allowed):
            raise InputError(f"bounds {', '.join(bounds)}", expected=", ".join(allowed))
        self._queue("place", **bounds)

    def _save_effect(self, file: str, text: str) -> None:
        self.editing.save(str(file), str(text))
        self.editing.look()

    def _look(self) -> None:
        """Load own effects that were saved in an editor."""
        with self.lock:
            if not self.editing.look():
                return
            self._follow_up()
        self._tell()

    def _cancel(self) -> None:
        self._jobs = []
        if self._running:
            self._failed[self._running.kind] = (self._running.key, "stopped")
            self._running.stop()

    def take_file(self, name: str, content: bytes, run: bool) -> dict[str, Any]:
        """A file that was dropped: measurements, a machine, effects, else a program."""
        import tempfile

        plain = Path(name.replace("\\", "/")).name or "file"
        if "\0" in plain or len(plain.encode()) > LONGEST_NAME:
            raise InputError(
                f"a file called {plain[:40]!r}", expected=f"{LONGEST_NAME} bytes at most, none of them zero"
            )
        kind = _kind(Path(plain).suffix.lower(), content)
        if kind == "effects" and not run:
            return {"confirm": f"{plain} is code. It is run when it is loaded. Load it?"}
        with tempfile.TemporaryDirectory() as folder, self.lock:
            file = Path(folder) / plain
            file.write_bytes(content)
            self.case.sent_to = f"{folder}/"
            try:
                add: dict[str, Callable[[Path], None]] = {
                    "data": self.case.add_data,
                    "effects": self.case.add_effects,
                    "machine": self.case.set_machine,
                    "tools": lambda file: self.case.read_programs(tools=file),
                    "offsets": lambda file: self.case.read_programs(offsets=file),
                    "controller": lambda file: self.case.read_programs(controller=file),
                }
                add.get(kind, self.case.add_program)(file)
            except TpsError as error:
                raise InputError(
                    str(error).replace(folder + "/", "").replace(str(self.case.folder) + "/", "")
                ) from None
            self._message = f"{plain}: {self.case.history[-1].text}"
            self._follow_up()
            self._tell()
        return {"message": self._message}

    # -- long work -----------------------------------------------------------------------------------------------------

    def _queue(self, kind: str, **given: Any) -> None:
        self._failed.pop(kind, None)
        self._jobs.insert(0, (kind, given))

    def _follow_up(self) -> None:
        """Stop what has lost its reason; ask for what the state wants; start the next."""
        state = self.case.state
        running = self._running
        if running and running.key != self.key(running.kind):
            running.stop()
        wanted = []
        if state.data:
            wanted.append("diagnose")
        if state.program:
            wanted.append("analyze")
        for kind in wanted:
            busy = running and running.kind == kind and running.key == self.key(kind)
            tried = self._failed.get(kind, (None, ""))[0] == self.key(kind)
            if self.found(kind) is None and not busy and not tried and kind not in [k for k, _ in self._jobs]:
                self._jobs.append((kind, {}))
        self._start()

    def key(self, kind: str) -> Any:
        """What the state holds of that on which this kind of result hangs."""
        state = self.case.state
        if kind == "place":
            return (state.machine, state.effects, self.program_key)
        if kind == "set_up":
            return (state.machine, state.effects, self.program_key, state.origin)
        return self.path_key if kind == "analyze" else self.data_key

    def _start(self) -> None:
        if self._running or not self._jobs:
            return
        kind, given = self._jobs.pop(0)
        own = dict(given)
        if kind == "analyze":
            fit = self.found("update")
            fitted = fit["result"] + "/machine.toml" if fit and fit.get("accepted") and self.is_fitted else ""
            own = {"machine": fitted, "first": self.first_machine}
        job = Job(self.case.folder, kind, {"result": self.case.next_result(kind), **own}, self.key(kind))
        self._running = job
        job.follow(lambda: self._tell(state=False), self._done)

    def _done(self, job: Job, answer: dict[str, Any] | None, error: str) -> None:
        with self.lock:
            self._running = None
            if answer is not None and job.key == self.key(job.kind):
                result = job.options["result"]
                self._found[job.kind, job.key] = {**answer, "result": result}
                command = answer.get("command") or self._command(job)
                if not self._said_already(job.kind, command):
                    line, text = f"case.{job.kind}({_python(job)})", answer["text"].strip("<>")
                    self.case.record(job.kind, text, command=command, python=line, result=result)
                if job.kind == "update":
                    self._take_sizes(answer["document"])
                if job.kind == "draft":
                    self._take_draft(answer["document"])
            elif error and job.key == self.key(job.kind):
                self._failed[job.kind] = (job.key, error)
                self._message = "" if error == "stopped" else f"{job.kind}: {error}"
            self._follow_up()
        self._tell()

    def _said_already(self, kind: str, command: str) -> bool:
        """Whether the history has this since the last change: a studio that resumes works some things out again."""
        for step in reversed(self.case.history):
            if step.change:
                return False
            if (step.kind, step.command) == (kind, command):
                return True
        return False

    def _take_draft(self, document: Mapping[str, Any]) -> None:
        """What was drafted competes from now on; the file was written by the tool itself."""
        if document["file"]:
            self.case.add_effects(self.case.folder / document["file"])
        self._message = document["reason"]

    def _take_sizes(self, document: Mapping[str, Any]) -> None:
        """The switches take what was fitted; the fit holds for them."""
        for name, values in document["steps"][-1]["parameters"].items():
            if name in self.case.state.on:
                sizes = {key: one["value"] if isinstance(one, dict) else one for key, one in values.items()}
                self.case.switch(name, {**self.case.state.on[name], **sizes})

    @property
    def is_fitted(self) -> bool:
        """Whether the switches stand as the last fit has them."""
        fit = self.found("update")
        steps = fit["document"]["steps"] if fit else []
        values = steps[-1]["parameters"] if steps else {}
        same = {
            name: {k: v["value"] if isinstance(v, dict) else v for k, v in keys.items()}
            for name, keys in values.items()
        }
        return bool(steps) and {n: dict(k) for n, k in self.case.state.on.items()} == same

    @property
    def first_machine(self) -> str:
        """The machine as it was given: before anything was fitted."""
        given = [step.change["machine"] for step in self.case.history if step.kind in ("machine", "exercise")]
        return str(given[-1])

    def _command(self, job: Job) -> str:
        state = self.case.state
        if job.kind == "place":
            origin = ",".join(f"{one:.10g}" for one in state.origin) or None
            bounds = {
                name.partition("_")[0]: f"{v[0]:g}:{v[1]:g}" for name, v in job.options.items() if isinstance(v, list)
            }
            words = options(machine=state.machine, origin=origin, **bounds, effects=list(state.effects))
            return command_line(job.kind, state.program, *words, *reading_words(state.reading))
        own = {"add": job.options.get("add"), "n": job.options.get("n")}
        return self.case.question(job.kind, **{name: value for name, value in own.items() if value})

    def _job(self) -> dict[str, Any] | None:
        job = self._running
        if not job:
            return None
        text, done, total = job.progress
        return {"kind": job.kind, "text": text, "done": done, "total": total, "waiting": len(self._jobs)}

    def _resume(self) -> None:
        """Take up what an earlier studio has found, where it still holds."""
        import json

        for kind, file in (
            ("diagnose", "diagnose.json"),
            ("update", "update.json"),
            ("plan", "plan.json"),
            ("reveal", "reveal.json"),
        ):
            steps = [n for n, step in enumerate(self.case.history) if step.kind == kind and step.result]
            if not steps or (
                kind != "reveal" and any(_moves_data(step) for step in self.case.history[steps[-1] + 1 :])
            ):
                continue
            step = self.case.history[steps[-1]]
            try:
                document = json.loads((self.case.folder / step.result / file).read_text("utf-8"))
            except (OSError, ValueError):
                continue
            if kind == "reveal":
                self._revealed = document
                continue
            accepted = (self.case.folder / step.result / "machine.toml").is_file()
            rows = _plan_rows(self.case.folder / step.result) if kind == "plan" else []
            entry = {"text": step.text, "document": document, "result": step.result, "accepted": accepted, "rows": rows}
            self._found[kind, self.data_key] = entry

    def failed(self, kind: str) -> str:
        """Why the last attempt for this state failed; "" where it did not."""
        key, text = self._failed.get(kind, (None, ""))
        return text if key == self.key(kind) else ""

    def reveal(self) -> dict[str, Any] | None:
        """What the opened seal has shown."""
        opened = any(step.kind == "reveal" for step in self.case.history)
        return self._revealed if opened else None

    def readings(self) -> dict[str, list[Any]]:
        """All readings of the case, those set aside too, as columns."""
        state = self.case.state

        def make() -> dict[str, list[Any]]:
            files = [self.case.path(name) for name in state.data]
            frame = tps.Measurements(files).to_frame(self.machine)
            names = dict(zip(files, state.data, strict=True))
            frame["file"] = [names[one] for one in frame["file"]]
            columns = (
                "x_mm",
                "y_mm",
                "z_mm",
                "a_deg",
                "b_deg",
                "c_deg",
                "dx",
                "dy",
                "dz",
                "stiffness_N_per_mm",
                "force_N",
            )
            return {"file": frame["file"].tolist(), "line": frame["line"].tolist(), "point": frame["point"].tolist(),
                    **{name: frame[name].round(4).tolist() for name in columns}}  # fmt: skip

        found: dict[str, list[Any]] = self.once("readings", (state.machine, state.data), make)
        return found


def _kind(suffix: str, content: bytes) -> str:
    """What a file is that was dropped; tables of tools and controller files are known by their headings and keys."""
    from toolpath_stiff.nc.controller import KEYS

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


def _moves_data(step: Step) -> bool:
    return bool({"machine", "effects", "data", "aside"} & set(step.change))


def _plan_rows(folder: Path) -> list[dict[str, Any]]:
    import csv

    try:
        with (folder / "plan.csv").open(encoding="utf-8", newline="") as stream:
            return list(csv.DictReader(stream))
    except OSError:
        return []


def _word(effect: tps.Effect, keys: Mapping[str, Any]) -> str:
    """An effect as --add takes it: with what it acts on."""
    chosen = [
        f"{one.name}={keys[one.key]}"
        for one in effect.parameters
        if one.discrete and keys.get(one.key) not in ("", None)
    ]
    return f"{effect.name}:{','.join(chosen)}" if chosen else effect.name


def _python(job: Job) -> str:
    own = {name: value for name, value in job.options.items() if name in ("add", "n") or isinstance(value, list)}
    machine = [repr(job.options["machine"])] if job.options.get("machine") else []
    return ", ".join([*machine, *(f"{name}={value!r}" for name, value in own.items())])


ACTIONS: dict[str, Callable[..., dict[str, Any] | None]] = {
    "hand": Session._by_hand,
    "at": lambda self, origin: self.trial().at(origin),
    "switch": lambda self, effect, values: self.case.switch(str(effect), values),
    "trust": lambda self, file: self.case.trust(str(file)),
    "aside": Session._aside,
    "fit": Session._fit,
    "accept": Session._accept,
    "plan": lambda self, n=6: self._queue("plan", n=max(1, min(MOST_POSES, int(n)))),
    "compare": lambda self: self._queue("compare"),
    "draft": lambda self: self._queue("draft"),
    "edit": lambda self, file: self.editing.open(str(file)),
    "save_effect": Session._save_effect,
    "set_up": lambda self: self._queue("set_up"),
    "measure": Session._measure,
    "exercise": Session._exercise,
    "claim": Session._claim,
    "place": Session._place,
    "place_at": lambda self, origin: self.case.place_at(origin),
    "require": lambda self, value: self.case.require(float(value)),
    "undo": lambda self: None if self.case.undo() else {"message": "nothing to undo"},
    "redo": lambda self: None if self.case.redo() else {"message": "nothing to redo"},
    "cancel": Session._cancel,
}
LOOKS = ("hand", "at")  # these change nothing
