"""State shared by all tabs of a studio: the case, the results so far, the work under way."""

import json
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np

import toolpath_stiff as tps
from toolpath_stiff.case.case import Case
from toolpath_stiff.case.state import Step, call
from toolpath_stiff.documents import Document
from toolpath_stiff.readings.measurements import reading_columns
from toolpath_stiff.studio.work import Job, Reply

READING = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "dx", "dy", "dz", "stiffness_N_per_mm", "force_N")
OF_PATH = ("analyze", "compensate")
OF_READINGS = ("diagnose", "update", "plan")  # results that a reopened studio reloads

Made = TypeVar("Made")


def fitted_sizes(update: Document) -> Mapping[str, Document]:
    """Effect -> key -> value of the last model in an update's document."""
    return {
        name: {key: size["value"] if isinstance(size, dict) else size for key, size in sizes.items()}
        for name, sizes in update["steps"][-1]["parameters"].items()
    }


class Session:
    """One case, open in any number of tabs.

    Attributes
    ----------
    case
        The case; changed by `do` alone.
    lock
        Held by whoever reads or changes the state.
    message
        What tabs are told.
    """

    def __init__(self, case: Case) -> None:
        self.case, self.name, self.message = case, case.folder.resolve().name, ""
        self.lock, self._changed = threading.RLock(), threading.Condition()
        self._version = self._beat = 0
        self._jobs: list[tuple[str, Document]] = []
        self._running: Job | None = None
        self._replies: dict[tuple[str, object], Reply] = {}  # by kind and the state that it is for
        self._failed: dict[str, tuple[object, str]] = {}
        self._kept: dict[str, tuple[object, Any]] = {}  # name -> key, value: what is worked out once for a state
        for step in case.history:
            if step.kind in OF_READINGS and (document := self._document_of(step)):
                accepted = (case.folder / step.result / "machine.toml").is_file()
                reply = Reply(step.text, step.command, document, step.result, accepted)
                self._replies[step.kind, step.state.judged] = reply
        self.follow_up()

    def _document_of(self, step: Step) -> Document | None:
        with suppress(OSError, ValueError):
            document: Document = json.loads((self.case.folder / step.result / f"{step.kind}.json").read_text("utf-8"))
            return document
        return None

    # News for the tabs.

    def wait(self, seen: tuple[int, int], seconds: float) -> tuple[int, int]:
        """Version of the state and beat of the work, as soon as either differs from `seen`."""
        with self._changed:
            self._changed.wait_for(lambda: (self._version, self._beat) != seen, seconds)
            return self._version, self._beat

    def news(self) -> Document:
        """Immediate news for the tabs: version of the state, work under way, last message."""
        job, shown = self._running, None
        if job:
            text, done, total = job.progress
            shown = {"kind": job.kind, "text": text, "done": done, "total": total}
        return {"version": self._version, "job": shown, "message": self.message}

    def tell(self, state: bool = True) -> None:
        """Wake all tabs; `state` says that the state has changed."""
        with self._changed:
            self._version += state
            self._beat += 1
            self._changed.notify_all()

    # The present state, each part worked out once.

    @property
    def path_key(self) -> tuple[object, ...]:
        """Everything that the analysis of the program depends on."""
        state = self.case.state
        fitted = bool(state.on) and self.is_fitted  # a fit knows its own uncertainty, so its machine has a band
        return (self.key("place"), fitted, state.origin, state.require, state.cut)

    @property
    def program_key(self) -> tuple[str, str]:
        """The program and its reading settings."""
        return (self.case.state.program, str(self.case.state.reading))

    def once(self, name: str, key: object, make: Callable[[], Made]) -> Made:
        """Result of `make`, computed once for a key."""
        if name not in self._kept or self._kept[name][0] != key:
            self._kept[name] = (key, make())
        made: Made = self._kept[name][1]
        return made

    @property
    def machine(self) -> tps.Machine:
        """The machine of the case."""
        state = self.case.state
        return self.once("machine", (state.machine, state.effects), lambda: self.case.machine)

    def errors(self) -> Document:
        """Error of every reading in use, with the effects as switched."""
        on = self.case.state.on
        return self.once("errors", (self.case.state.judged, on), lambda: self.case.preview.at(on, strut_law=bool(on)))

    def catalogue(self) -> tps.EffectCatalogue:
        """Effects that can be switched on."""
        files, kind = self.case.effect_files, self.machine.model.machine.kind
        return self.once("catalogue", (files, kind), lambda: tps.effects(files, kind=kind))

    def trial(self) -> tps.PlacementTrial:
        """The program, ready to be evaluated at any placement."""
        case = self.case
        return self.once(
            "trial", self.key("place"), lambda: tps.try_placement(case.program, case.machine_with(case.state.on))
        )

    def readings(self) -> Mapping[str, list[Any]]:
        """All readings of the case as columns, including those set aside."""
        state = self.case.state

        def make() -> Mapping[str, list[Any]]:
            names = {self.case.path(name): name for name in state.data}
            read = reading_columns(tps.Measurements(list(names)).on(self.machine))
            numbers = {name: np.round(read[name], 4).tolist() for name in ("line", *READING)}
            return {"file": [names[file] for file in read["file"]], "setup": list(read.get("setup", ())), **numbers}

        return self.once("readings", (state.machine, state.data), make)

    # Replies of finished work.

    def reply(self, kind: str) -> Reply | None:
        """Last result of a kind, if it still holds."""
        return self._replies.get((kind, self.key(kind)))

    def document(self, kind: str) -> Document | None:
        """Document of the last result of a kind, if it still holds."""
        latest = self.reply(kind)
        return latest.document if latest else None

    def failed(self, kind: str) -> str:
        """Reason why the last attempt for this state failed; "" if it did not."""
        key, text = self._failed.get(kind, (None, ""))
        return text if key == self.key(kind) else ""

    @property
    def is_fitted(self) -> bool:
        """True if the switches stand as the last fit set them."""
        fit = self.document("update")
        return fit is not None and self.case.state.on == fitted_sizes(fit)

    def revealed(self) -> Document | None:
        """Content of the opened seal of the present exercise."""
        exercise = self.case.state.exercise
        steps = [step for step in self.case.history if step.kind == "reveal" and step.state.exercise == exercise]
        return self._document_of(steps[-1]) if steps else None

    # The work.

    def key(self, kind: str) -> object:
        """The part of the state that a kind of result depends on."""
        state = self.case.state
        if kind in ("place", "set_up"):
            on = state.judged if state.on else (state.machine, state.effects)
            return (on, str(state.on), self.program_key, state.origin if kind == "set_up" else ())
        return self.path_key if kind in OF_PATH else state.judged

    def queue(self, kind: str, **given: Any) -> None:
        """Request a result, ahead of everything that waits."""
        self._failed.pop(kind, None)
        self._jobs.insert(0, (kind, given))

    def follow_up(self) -> None:
        """Stop work that is out of date, request what the state needs, start the next job."""
        state, running = self.case.state, self._running
        if running and running.key != self.key(running.kind):
            running.stop()
        of_path = OF_PATH[: 1 + bool(state.cut)] if state.program else ()
        for kind in [*(["diagnose"] if state.data else []), *of_path]:
            busy = running and running.kind == kind and running.key == self.key(kind)
            waiting = kind in [waiting for waiting, _ in self._jobs]
            if self.reply(kind) is None and not busy and not self.failed(kind) and not waiting:
                self._jobs.append((kind, {}))
        if not running and self._jobs:
            self._start(*self._jobs.pop(0))

    def _start(self, kind: str, given: Document) -> None:
        first = ""
        if kind == "analyze":
            fit = self.reply("update")
            given = {"machine": f"{fit.result}/machine.toml"} if fit and fit.accepted and self.is_fitted else {}
            first = [step.state.machine for step in self.case.history if step.kind in ("machine", "exercise")][-1]
        result = self.case.next_result(kind)
        self._running = Job(self.case.folder, kind, result, given, self.key(kind), first)
        self._running.follow(lambda: self.tell(state=False), self._done)

    def _done(self, job: Job, answer: Reply | None, error: str) -> None:
        with self.lock:
            self._running = None
            if job.key == self.key(job.kind):
                if answer is not None:
                    self._take(job, answer)
                else:
                    self._failed[job.kind] = (job.key, error)
                    self.message = "" if error == "stopped" else f"{job.kind}: {error}"
            self.follow_up()
        self.tell()

    def _take(self, job: Job, answer: Reply) -> None:
        """Enter a finished job's result into the history; a fit or a drafted effect takes effect from now on."""
        self._replies[job.kind, job.key] = answer
        case, state = self.case, self.case.state
        known = [(step.kind, step.command) for step in case.history if step.state == state]
        if (job.kind, answer.command) not in known:  # a studio that resumes works some things out again
            case.record(job.kind, answer.text, call("find", job.kind, **job.given), answer.command, answer.result)
        if job.kind == "update":  # the fit holds for the sizes that the switches take over
            for name, sizes in fitted_sizes(answer.document).items():
                if name in state.on:
                    case.switch(name, {**state.on[name], **sizes})
        if job.kind == "draft":
            self.message = answer.document["reason"]
            if answer.file:  # written by the tool itself
                case.add_effects(case.folder / answer.file)

    def cancel(self) -> None:
        """End the work under way, and drop what waits."""
        self._jobs = []
        if self._running:
            self._failed[self._running.kind] = (self._running.key, "stopped")
            self._running.stop()

    def close(self) -> None:
        """End the work under way."""
        with self.lock:
            self.cancel()
