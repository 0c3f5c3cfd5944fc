"""Long work beside the page: one process at a time, which reports how far it is and can be stopped at any moment."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from toolpath_stiff.errors import TpsError

COARSE_SAMPLES = 6000  # of a path in the page; the statistics are those of all samples


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


PRELOADED = ("toolpath_stiff.studio.work", "toolpath_stiff.case.case", "toolpath_stiff.correction.strut_law", "pandas")


def _context() -> Any:
    """Processes that begin with the libraries loaded where the system can do that, from scratch elsewhere."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*PRELOADED, "toolpath_stiff.diagnosis.diagnose", "toolpath_stiff.analysis"])
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
        from toolpath_stiff.case.case import Case

        pipe.send(("done", TASKS[kind](Case.open(folder), tell, **options)))
    except TpsError as error:
        pipe.send(("error", str(error)))
    except Exception as error:  # a fault of ours, or of an effect of the user's own: the page says so and goes on
        pipe.send(("error", f"{type(error).__name__}: {error}"))


Tell = Callable[[str, int, int], None]


def diagnose(case: Any, tell: Tell, result: str) -> dict[str, Any]:
    """Which effect is missing."""
    import toolpath_stiff as tps

    found = tps.diagnose(case.data, case.machine, progress=tell)
    found.save(case.folder / result, plots=False)
    return {"text": repr(found), "document": found.to_dict()}


def compare(case: Any, tell: Tell, result: str) -> dict[str, Any]:
    """Where the model fails, with its pictures and its page."""
    import toolpath_stiff as tps

    found = tps.compare(case.data, case.machine, progress=tell)
    tell("drawing", 0, 0)
    found.save(case.folder / result)
    return {"text": repr(found), "document": found.to_dict()}


def update(case: Any, tell: Tell, result: str, add: list[str]) -> dict[str, Any]:
    """Effects fitted and judged; the machine file is kept where the data support them."""
    import toolpath_stiff as tps

    found = tps.update(case.data, case.machine, add=add, machine_file=f"{result}/machine.toml", progress=tell)
    found.save(case.folder / result, plots=False, machine=False)
    if found.accepted:
        found.save_machine(case.folder / result / "machine.toml")
    return {"text": repr(found), "document": found.to_dict(), "accepted": found.accepted}


def plan(case: Any, tell: Tell, result: str, n: int) -> dict[str, Any]:
    """What to measure next."""
    import toolpath_stiff as tps

    tell("choosing poses", 0, 0)
    found = tps.plan(case.data if case.state.data else None, case.machine, n=n)
    found.save(case.folder / result, plots=False)
    return {"text": repr(found), "document": found.to_dict(), "rows": found.to_frame().to_dict("records")}


def analyze(case: Any, tell: Tell, result: str, machine: str, first: str) -> dict[str, Any]:
    """The program on the present machine with the effects that are on, or an update's, and on the case's first one."""
    import toolpath_stiff as tps

    found, command = case.analyze_in(result, machine, tell)
    origin = case.state.origin or None
    before = tps.analyze(case.program, case.machine_of(first), origin_mm_deg=origin, partial=True, progress=tell)
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
        case.program, case.machine, origin_mm_deg=case.state.origin or None, progress=tell,
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
    document = {"reason": found.reason, "file": f"{result}/{found.name}.toml" if found.text else ""}
    return {"text": repr(found), "document": document, "command": command}


TASKS: dict[str, Callable[..., dict[str, Any]]] = {
    task.__name__: task for task in (diagnose, compare, update, plan, analyze, place, set_up, draft)
}
