"""What all tabs of a studio share: the case, what was found, the work under way."""

import json
import threading
from collections.abc import Callable
from contextlib import suppress
from itertools import takewhile
from typing import Any, TypeVar

import toolpath_stiff as tps
from toolpath_stiff.case.case import Case
from toolpath_stiff.case.history import python_line
from toolpath_stiff.case.steps import Step
from toolpath_stiff.documents import Document
from toolpath_stiff.studio.editing import Editing
from toolpath_stiff.studio.work import Job, Reply

READING = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx", "dy", "dz", "stiffness_N_per_mm", "force_N")


Made = TypeVar("Made")


def fitted_sizes(update: Document) -> dict[str, dict[str, Any]]:
    """Effect -> key -> value of the last model of an update's document."""
    last = update["steps"][-1]["parameters"]
    return {
        name: {key: size["value"] if isinstance(size, dict) else size for key, size in sizes.items()}
        for name, sizes in last.items()
    }


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
        self._found: dict[tuple[str, object], Reply] = {}  # kind and what it was found for -> what was found
        self._failed: dict[str, tuple[Any, str]] = {}
        self.message = ""
        self.revealed: dict[str, Any] | None = None
        self._kept: dict[str, tuple[Any, Any]] = {}  # name -> key, value: what is worked out once for a state
        self.editing = Editing(case)
        self._resume()
        self.follow_up()
        self.editing.follow(self.look)

    def wait(self, seen: tuple[int, int], seconds: float) -> tuple[int, int]:
        """The version and the beat of the work, as soon as one of them is another."""
        with self._changed:
            self._changed.wait_for(lambda: (self._version, self._beat) != seen, seconds)
            return self._version, self._beat

    def news(self) -> dict[str, Any]:
        """What tabs are told at once: the version of the state, the work under way, the last message."""
        return {"version": self._version, "job": self._job(), "message": self.message}

    def close(self) -> None:
        """End the work under way."""
        self.editing.close()
        with self.lock:
            self._jobs = []
            if self._running:
                self._running.stop()

    def tell(self, state: bool = True) -> None:
        """Wake all tabs; `state`: it is another than before."""
        with self._changed:
            self._version += state
            self._beat += 1
            self._changed.notify_all()

    @property
    def data_key(self) -> tuple[Any, ...]:
        """What a diagnosis hangs on."""
        state = self.case.state
        return (state.machine, state.effects, state.data, state.aside)

    @property
    def path_key(self) -> tuple[Any, ...]:
        """What the analysis of the program hangs on."""
        state = self.case.state
        switches = tuple((name, tuple(keys.items())) for name, keys in state.on.items())
        fitted = bool(switches) and self.is_fitted  # a fit knows how well it knows: its machine has a band
        on = self.data_key if switches else (state.machine, state.effects)
        return (on, switches, fitted, self.program_key, state.origin, state.require)

    @property
    def program_key(self) -> tuple[Any, ...]:
        """The program and how it is read."""
        state = self.case.state
        return (state.program, tuple(state.reading.items()))

    def once(self, name: str, key: Any, make: Callable[[], Made]) -> Made:
        """What `make` gives, worked out once for a key."""
        if name not in self._kept or self._kept[name][0] != key:
            self._kept[name] = (key, make())
        made: Made = self._kept[name][1]
        return made

    @property
    def machine(self) -> tps.Machine:
        """The machine of the case."""
        state = self.case.state
        return self.once("machine", (state.machine, state.effects), lambda: self.case.machine)

    def errors(self) -> dict[str, Any]:
        """The error of every reading in use as the switches stand."""
        on = self.case.state.on
        return self.once("errors", (self.data_key, on), lambda: self.case.preview.at(on, strut_law=bool(on)))

    def found(self, kind: str) -> Reply | None:
        """What was found last, if it still holds."""
        return self._found.get((kind, self.key(kind)))

    def document(self, kind: str) -> Document | None:
        """The document of what was found last, if it still holds."""
        latest = self.found(kind)
        return latest.document if latest else None

    def catalogue(self) -> tps.EffectCatalogue:
        """The effects that can be switched on."""
        files = self.case.effect_files
        return self.once("catalogue", files, lambda: tps.effects(files))

    def trial(self) -> tps.PlacementTrial:
        """The program that can be put anywhere."""
        state = self.case.state
        key = (state.machine, state.effects, self.program_key)
        return self.once("trial", key, lambda: tps.try_placement(self.case.program, self.machine))

    def queue(self, kind: str, **given: Any) -> None:
        """Ask for a result before all that waits."""
        self._failed.pop(kind, None)
        self._jobs.insert(0, (kind, given))

    def follow_up(self) -> None:
        """Stop what has lost its reason; ask for what the state wants; start the next."""
        state = self.case.state
        running = self._running
        if running and running.key != self.key(running.kind):
            running.stop()
        for kind in [*(["diagnose"] if state.data else []), *(["analyze"] if state.program else [])]:
            busy = running and running.kind == kind and running.key == self.key(kind)
            waiting = kind in [waiting for waiting, _ in self._jobs]
            if self.found(kind) is None and not busy and not self.failed(kind) and not waiting:
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
        first: dict[str, str] = {}
        if kind == "analyze":
            fit = self.found("update")
            fitted = fit.result if fit and fit.accepted and self.is_fitted else ""
            given = {"machine": f"{fitted}/machine.toml"} if fitted else {}
            first = {"first": self.first_machine}
        result = self.case.next_result(kind)
        self._running = Job(self.case.folder, kind, {"result": result, **first, **given}, given, self.key(kind))
        self._running.follow(lambda: self.tell(state=False), self._done)

    def _done(self, job: Job, answer: Reply | None, error: str) -> None:
        with self.lock:
            self._running = None
            if job.key == self.key(job.kind):
                if answer is not None:
                    self._take(job, answer)
                elif error:
                    self._failed[job.kind] = (job.key, error)
                    self.message = "" if error == "stopped" else f"{job.kind}: {error}"
            self.follow_up()
        self.tell()

    def _take(self, job: Job, answer: Reply) -> None:
        """An answer into the history; what was fitted or drafted acts from now on."""
        self._found[job.kind, job.key] = answer
        if not self._is_recorded(job.kind, answer.command):
            line = python_line(job.kind, (), job.given)
            self.case.record(job.kind, answer.text, answer.command, python=line, result=answer.result)
        if job.kind == "update":  # the fit holds for the sizes that the switches take over
            for name, sizes in fitted_sizes(answer.document).items():
                if name in self.case.state.on:
                    self.case.switch(name, {**self.case.state.on[name], **sizes})
        if job.kind == "draft":
            self.message = answer.document["reason"]
            if answer.file:  # written by the tool itself
                self.case.add_effects(self.case.folder / answer.file)

    def _is_recorded(self, kind: str, command: str) -> bool:
        """True where the history has it since the last change: a studio that resumes works some things out again."""
        since = takewhile(lambda step: not step.change, reversed(self.case.history))
        return any((step.kind, step.command) == (kind, command) for step in since)

    @property
    def is_fitted(self) -> bool:
        """True where the switches stand as the last fit has them."""
        fit = self.found("update")
        return fit is not None and {n: dict(k) for n, k in self.case.state.on.items()} == fitted_sizes(fit.document)

    @property
    def first_machine(self) -> str:
        """The machine as it was given: before anything was fitted."""
        given = [step.change["machine"] for step in self.case.history if step.kind in ("machine", "exercise")]
        return str(given[-1])

    def _job(self) -> dict[str, Any] | None:
        job = self._running
        if not job:
            return None
        text, done, total = job.progress
        return {"kind": job.kind, "text": text, "done": done, "total": total, "waiting": len(self._jobs)}

    def _resume(self) -> None:
        """Take up what an earlier studio has found, where it still holds."""
        latest: dict[str, Step] = {}
        for step in self.case.history:
            if {"machine", "effects", "data", "aside"} & set(step.change):
                latest = {kind: revealed for kind, revealed in latest.items() if kind == "reveal"}
            elif step.result and step.kind in ("diagnose", "update", "plan", "reveal"):
                latest[step.kind] = step
        for kind, step in latest.items():
            folder = self.case.folder / step.result
            with suppress(OSError, ValueError):
                document = json.loads((folder / f"{kind}.json").read_text("utf-8"))
                if kind == "reveal":
                    self.revealed = document
                    continue
                accepted = (folder / "machine.toml").is_file()
                self._found[kind, self.data_key] = Reply(step.text, step.command, document, step.result, accepted)

    def cancel(self) -> None:
        """End the work under way, and forget what waits."""
        self._jobs = []
        if self._running:
            self._failed[self._running.kind] = (self._running.key, "stopped")
            self._running.stop()

    def look(self) -> None:
        """Load own effects that were saved in an editor."""
        with self.lock:
            if not self.editing.look():
                return
            self.follow_up()
        self.tell()

    def failed(self, kind: str) -> str:
        """Why the last attempt for this state failed; "" where it did not."""
        key, text = self._failed.get(kind, (None, ""))
        return text if key == self.key(kind) else ""

    def reveal(self) -> dict[str, Any] | None:
        """What the opened seal has shown."""
        opened = any(step.kind == "reveal" for step in self.case.history)
        return self.revealed if opened else None

    def readings(self) -> dict[str, list[Any]]:
        """All readings of the case, those set aside too, as columns."""
        state = self.case.state

        def make() -> dict[str, list[Any]]:
            files = [self.case.path(name) for name in state.data]
            frame = tps.Measurements(files).to_frame(self.machine)
            names = dict(zip(files, state.data, strict=True))
            frame["file"] = [names[file] for file in frame["file"]]
            return {"file": frame["file"].tolist(), "line": frame["line"].tolist(), "point": frame["point"].tolist(),
                    **{name: frame[name].round(4).tolist() for name in READING}}  # fmt: skip

        return self.once("readings", (state.machine, state.data), make)
