"""Long work beside the page: one process at a time, which reports how far it is and can be stopped at any moment.

Effects of one's own, edited beside the page: working copies, loaded whenever they are saved.

A working copy stands in the case's folder `edit/`, outside the case: it becomes a file of the case, and a step that can
be undone, each time it is saved without a fault. Code is run of those files alone that the user has loaded before.
"""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from toolpath_stiff.api.case import Case
from toolpath_stiff.api.case_results import first_name, free_name, sha256, write_files
from toolpath_stiff.errors import InputError, TpsError

COARSE_SAMPLES = 6000  # of a path in the page; the statistics are those of all samples
FOLDER = "edit"
LOOKS_EVERY = 0.5  # s between two looks at the working copies


class Job:
    """A task in a process of its own.

    Attributes
    ----------
    kind, options, key
        What is done; the state of the case that it is done for.
    progress
        (what is being done, how much of it, how much there is; 0: not known).
    """

    def __init__(self, folder: Path, kind: str, options: Mapping[str, Any], key: object) -> None:
        self.kind, self.options, self.key = kind, dict(options), key
        self.progress: tuple[str, int, int] = (kind, 0, 0)
        context = _context()
        self._pipe, theirs = context.Pipe()
        arguments = (str(folder), kind, self.options, theirs)
        self._process = context.Process(target=work, args=arguments, daemon=True)
        self._process.start()
        theirs.close()

    def follow(self, told: Callable[[], None], done: Callable[[Job, Any, str], None]) -> None:
        """In a thread: `told` after every report, `done` with the answer, or None and what went wrong."""
        threading.Thread(target=self._listen, args=(told, done), daemon=True).start()

    def _listen(self, told: Callable[[], None], done: Callable[[Job, Any, str], None]) -> None:
        answer, error = None, "stopped"
        try:
            while True:
                word, content = self._pipe.recv()
                if word != "progress":
                    answer, error = (content, "") if word == "done" else (None, content)
                    break
                self.progress = content
                told()
        except (EOFError, OSError):
            pass
        self._process.join()
        done(self, answer, error)

    def stop(self) -> None:
        """End it at once; nothing of it is kept."""
        self._process.kill()


PRELOADED = ("toolpath_stiff.studio.work", "toolpath_stiff.api.case", "toolpath_stiff.updating.correction", "pandas")


def _context() -> Any:
    """Processes that begin with the libraries loaded where the system can do that, from scratch elsewhere."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*PRELOADED, "toolpath_stiff.updating.diagnosis", "toolpath_stiff.analysis"])
    return context


def work(folder: str, kind: str, options: Mapping[str, Any], pipe: Connection) -> None:
    """The process: one task, reports, one answer."""
    import time

    last = 0.0

    def tell(text: str, done: int, total: int) -> None:
        nonlocal last
        if not total or done == total or time.monotonic() - last > 0.2:
            last = time.monotonic()
            pipe.send(("progress", (text, done, total)))

    try:
        from toolpath_stiff.api.case import Case

        pipe.send(("done", TASKS[kind](Case.open(folder), tell, **options)))
    except TpsError as error:
        pipe.send(("error", str(error)))
    except Exception as error:  # a fault of ours, or of an effect of the user's own: the page says so and goes on
        pipe.send(("error", f"{type(error).__name__}: {error}"))


Tell = Callable[[str, int, int], None]


def diagnose(case: Any, tell: Tell, result: str) -> dict[str, Any]:
    """Which effect is missing."""
    import toolpath_stiff as tps

    found = tps.diagnose(case.machine, case.data, progress=tell)
    found.save(case.folder / result, plots=False)
    return {"text": repr(found), "document": found.to_dict()}


def compare(case: Any, tell: Tell, result: str) -> dict[str, Any]:
    """Where the model fails, with its pictures and its page."""
    import toolpath_stiff as tps

    found = tps.compare(case.machine, case.data, progress=tell)
    tell("drawing", 0, 0)
    found.save(case.folder / result)
    return {"text": repr(found), "document": found.to_dict()}


def update(case: Any, tell: Tell, result: str, add: list[str]) -> dict[str, Any]:
    """Effects fitted and judged; the machine file is kept where the data support them."""
    import toolpath_stiff as tps

    found = tps.update(case.machine, case.data, add=add, machine_file=f"{result}/machine.toml", progress=tell)
    found.save(case.folder / result, plots=False, machine=False)
    if found.accepted:
        found.save_machine(case.folder / result / "machine.toml")
    return {"text": repr(found), "document": found.to_dict(), "accepted": found.accepted}


def plan(case: Any, tell: Tell, result: str, n: int) -> dict[str, Any]:
    """What to measure next."""
    import toolpath_stiff as tps

    tell("choosing poses", 0, 0)
    found = tps.plan(case.machine, case.data if case.state.data else None, n=n)
    found.save(case.folder / result, plots=False)
    return {"text": repr(found), "document": found.to_dict(), "rows": found.to_frame().to_dict("records")}


def analyze(case: Any, tell: Tell, result: str, machine: str, first: str) -> dict[str, Any]:
    """The program on the present machine with the effects that are on, or an update's, and on the case's first one."""
    import toolpath_stiff as tps

    found, command = case.analyze_in(result, machine, tell)
    origin = case.state.origin or None
    before = tps.analyze(case.machine_of(first), case.program, origin_mm_deg=origin, partial=True, progress=tell)
    return {"text": repr(found), "document": found.to_dict(), "command": command, "path": _columns(found, before)}


def _columns(found: Any, before: Any) -> dict[str, Any]:
    """What the page draws of a path: at most so many samples, the lowest and the highest of every stretch."""
    import numpy as np

    frame, given = found.to_frame(), before.to_frame()["stiffness_N_per_mm"].to_numpy()
    stiffness = frame["stiffness_N_per_mm"].to_numpy()
    rows = _thinned(stiffness, np.flatnonzero(np.diff(frame["line"], prepend=-1, append=-1)[:-1]))
    band = found.deviation_N_per_mm
    columns = {
        name: _plain(frame[name].to_numpy()[rows], 4)
        for name in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "s_mm", "t_s", "margin")
    }
    return {
        **columns,
        "line": frame["line"].to_numpy()[rows].tolist(),
        "cut": (frame["motion"] != "rapid").to_numpy()[rows].tolist(),
        "plunge": (frame["cut"] == "plunge").to_numpy()[rows].tolist(),
        "operation": frame["operation"].to_numpy()[rows].tolist(),
        "now": _plain(stiffness[rows], 1),
        "given": _plain(given[rows], 1) if len(given) == len(stiffness) else None,
        "sd": None if band is None else _plain(band[rows], 1),
        "samples": len(frame),
    }


def _thinned(values: Any, starts: Any) -> Any:
    """Rows of a drawing: all, or the lowest and highest of each of many stretches, and starts of lines."""
    from itertools import pairwise

    import numpy as np

    if len(values) <= COARSE_SAMPLES:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), COARSE_SAMPLES // 3 + 1).astype(int)
    filled = np.nan_to_num(values, nan=np.inf)
    low = [a + int(np.argmin(filled[a:b])) for a, b in pairwise(edges)]
    high = [a + int(np.argmax(np.where(np.isfinite(filled[a:b]), filled[a:b], -1))) for a, b in pairwise(edges)]
    some = starts[:: max(1, len(starts) // (COARSE_SAMPLES // 3))]
    return np.unique(np.concatenate([low, high, edges[:-1], some, [len(values) - 1]]))


def _plain(values: Any, digits: int) -> list[float | None]:
    """Rounded numbers as JSON has them."""
    import numpy as np

    return [float(one) if np.isfinite(one) else None for one in np.round(values, digits)]


def place(case: Any, tell: Tell, result: str, **bounds: Any) -> dict[str, Any]:
    """Where the work should sit."""
    import toolpath_stiff as tps

    wanted: dict[str, Any] = {name: tuple(one) if isinstance(one, list) else one for name, one in bounds.items()}
    found = tps.place(
        case.machine, case.program, origin_mm_deg=case.state.origin or None, progress=tell,
        **wanted,
    )  # fmt: skip
    found.save(case.folder / result, plots=False)
    return {"text": repr(found), "document": found.to_dict()}


def set_up(case: Any, tell: Tell, result: str) -> dict[str, Any]:
    """Offsets, set-up sheet and program of the present placement."""
    found, command = case.set_up_in(result, tell)
    written = [name for name in (case.program.name, "not_written.txt") if (case.folder / result / name).is_file()]
    return {"text": repr(found), "document": found.to_dict(), "command": command, "written": written[0]}


def draft(case: Any, tell: Tell, result: str) -> dict[str, Any]:
    """What is left unexplained, as an effect file."""
    found, command = case.draft_in(result, tell)
    document = {"reason": found.reason, "file": f"{result}/{found.name}.py" if found.text else ""}
    return {"text": repr(found), "document": document, "command": command}


TASKS: dict[str, Callable[..., dict[str, Any]]] = {
    task.__name__: task for task in (diagnose, compare, update, plan, analyze, place, set_up, draft)
}


class Editing:
    """The working copies of a case's own effects.

    Attributes
    ----------
    faults
        File of the case -> what is wrong with its working copy, with its line; "" where nothing is.
    """

    def __init__(self, case: Case) -> None:
        self.case, self.faults = case, dict[str, str]()
        self._open: dict[str, tuple[Path, str]] = {}  # file of the case -> its working copy, and that one's sum
        self._closing = threading.Event()

    def open(self, name: str) -> None:
        """Write the working copy of a file of the case and follow it from now on."""
        if name not in self.case.state.effects:
            raise InputError(f"{name} is no file of own effects of this case")
        content, copy = (
            (self.case.folder / name).read_bytes(),
            free_name(self.case.folder, f"{FOLDER}/{first_name(name)}"),
        )
        write_files(self.case.folder, {copy: content})
        self._open[name], self.faults[name] = (self.case.folder / copy, sha256(content)), ""

    def save(self, name: str, text: str) -> None:
        """Write the working copy as the page has it; `look` loads it."""
        if name not in self._open:
            self.open(name)
        write_files(self.case.folder, {f"{FOLDER}/{self._open[name][0].name}": text})

    def look(self) -> bool:
        """Load every working copy that was saved since the last look; whether there was one."""
        changed = False
        for name in [one for one in self._open if one in self.case.state.effects]:
            file, known = self._open[name]
            try:
                now = sha256(file.read_bytes())
            except OSError:  # an editor that replaces the file is between two steps
                continue
            if now != known:
                self._open[name], changed = (file, now), True
                self._load(name, file)
        return changed

    def _load(self, name: str, file: Path) -> None:
        try:
            self.case.change_effects(name, file)
        except TpsError as error:
            self.faults[name] = str(error).replace(f"{self.case.folder}/", "")
            return
        new = self.case.state.effects[-1]
        self._open[new], self.faults[new] = self._open[name], ""

    def state(self) -> list[dict[str, str | bool]]:
        """The own effects of the case with their text, as the page shows them; `copy`: "" where none is open.

        `off`: its code is not run, as this user has not agreed to it.
        """
        found, off = list[dict[str, str | bool]](), self.case.not_agreed
        for name in self.case.recorded.effects:
            copy = None if name in off else self._open.get(name, (None, ""))[0]
            text = (copy or self.case.folder / name).read_text("utf-8", "replace")
            fault, path = self.faults.get(name, ""), str(copy.resolve()) if copy else ""
            found.append({"file": name, "text": text, "copy": path, "fault": fault, "off": name in off})
        return found

    def follow(self, looked: Callable[[], None]) -> None:
        """Call `looked` every half second in a thread until `close`."""

        def run() -> None:
            while not self._closing.wait(LOOKS_EVERY):
                if self._open:
                    looked()

        threading.Thread(target=run, daemon=True).start()

    def close(self) -> None:
        """Stop following."""
        self._closing.set()
