"""Long work beside the page: one process at a time, which reports its progress and can be stopped at any moment."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

import toolpath_stiff as tps
from toolpath_stiff.case.case import Case
from toolpath_stiff.case.results import find
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import TpsError
from toolpath_stiff.report.curves import extremes_by_column
from toolpath_stiff.studio.preloading import prepared
from toolpath_stiff.units import mm_from_m, um_from_m

COARSE_SAMPLES = 6000  # of a path drawn in the page; statistics use all samples
REPORTS_EVERY = 0.2  # s
DRAWN = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "s_mm", "t_s", "margin")


class Job:
    """A task in its own process.

    Attributes
    ----------
    kind, given, key
        What is done, with what was asked; the state of the case that it is done for.
    progress
        (what is being done, how much of it, how much there is; 0: not known).
    """

    def __init__(self, folder: Path, kind: str, result: str, given: Document, key: object, first: str) -> None:
        self.kind, self.given, self.key = kind, given, key
        self.progress: tuple[str, int, int] = (kind, 0, 0)
        context: Any = prepared()
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(folder, kind, result, given, first, theirs), daemon=True)
        self._process.start()
        theirs.close()

    def follow(self, reported: Callable[[], None], done: Callable[[Job, Reply | None, str], None]) -> None:
        """Watch in a thread: call `reported` on each report, `done` with the answer, or with None and the error."""

        def listen() -> None:
            answer, error = None, "stopped"
            try:
                while True:
                    word, content = self._pipe.recv()
                    if word != "progress":
                        answer, error = (content, "") if word == "done" else (None, content)
                        break
                    self.progress = content
                    reported()
            except (EOFError, OSError):
                pass
            self._process.join()
            done(self, answer, error)

        threading.Thread(target=listen, daemon=True).start()

    def stop(self) -> None:
        """End the job at once; nothing of it is kept."""
        self._process.kill()


def work(folder: Path, kind: str, result: str, given: Document, first: str, pipe: Connection) -> None:
    """Main function of the process: one task, its progress reports, one answer."""
    last = 0.0

    def tell(text: str, done: int, total: int) -> None:
        nonlocal last
        if not total or done == total or time.monotonic() - last > REPORTS_EVERY:
            last = time.monotonic()
            pipe.send(("progress", (text, done, total)))

    try:
        pipe.send(("done", answer(Case.open(folder), kind, result, given, first, tell)))
    except TpsError as error:
        pipe.send(("error", str(error)))
    except Exception as error:  # a fault of ours, or of an effect of the user's own: the page says so and goes on
        pipe.send(("error", f"{type(error).__name__}: {error}"))


@dataclass(frozen=True)
class Reply:
    """The part of a result that the page needs.

    Attributes
    ----------
    text, command, document
        In some words; the command that gives it; as plain data.
    result
        The folder of the case that it is kept in.
    accepted
        True for a fit that the data support.
    file
        What was drafted, or written for the shop floor, in that folder; "" where nothing was.
    path
        Of an analysis, column by column.
    """

    text: str
    command: str
    document: Document
    result: str
    accepted: bool = False
    file: str = ""
    path: Document = field(default_factory=dict)


def answer(
    case: Case, kind: str, result: str, given: Document, first: str, tell: Callable[[str, int, int], None]
) -> Reply:
    """The page's part of a result kept in the case; `first`: the machine with which to compare an analysis."""
    case.plots = kind == "compare"  # the only one whose page is opened from the studio
    tell(kind, 0, 0)
    kept, command = find(case, kind, result, tell, **given)
    files = {
        "draft": (f"{getattr(kept, 'name', '')}.toml",),
        "set_up": (Path(case.state.program).name, "not_written.txt"),
        "compensate": (f"{Path(case.state.program).stem}_comp{Path(case.state.program).suffix}",),
    }
    written = [f"{result}/{name}" for name in files.get(kind, ()) if (case.folder / result / name).is_file()]
    reply = Reply(repr(kept).strip("<>"), command, kept.to_dict(), result, file="".join(written[:1]))
    if kind == "analyze":
        given_machine, origin = case.machine_of(first), case.state.origin or None
        before = tps.analyze(case.program, given_machine, origin_mm_deg=origin, partial=True, progress=tell)
        return replace(reply, path=_columns(kept, before))
    if kind == "compensate":
        shift = {"s_mm": mm_from_m(kept.before.samples.s).tolist(), "shift": um_from_m(kept.shift).tolist()}
        return replace(reply, path=shift)
    return replace(reply, accepted=kind == "update" and kept.accepted)


def _columns(analysis: tps.Analysis, before: tps.Analysis) -> Document:
    """A path's columns for drawing: at most so many samples, the lowest and the highest of every stretch."""
    frame, given = analysis.to_frame(), before.to_frame()["stiffness_N_per_mm"].to_numpy()
    stiffness, band = frame["stiffness_N_per_mm"].to_numpy(), analysis.deviation_N_per_mm
    rows = _thinned(stiffness, np.flatnonzero(np.diff(frame["line"], prepend=-1, append=-1)[:-1]))
    drawn = frame.iloc[rows]
    return {
        **{name: _plain(drawn[name].to_numpy(), 4) for name in DRAWN},
        "line": drawn["line"].tolist(),
        "cut": (drawn["motion"] != "rapid").tolist(),
        "plunge": (drawn["cut"] == "plunge").tolist(),
        "now": _plain(stiffness[rows], 1),
        "given": _plain(given[rows], 1) if len(given) == len(stiffness) else None,
        "sd": None if band is None else _plain(band[rows], 1),
        **_cut_columns(analysis, rows),
        "samples": len(frame),
    }


def _cut_columns(analysis: tps.Analysis, rows: Any) -> Document:
    """Surface error (um), the largest at each sample, and width of cut (mm); empty without a cut."""
    cut = analysis.cut
    if cut is None:
        return {}
    sizes = np.nan_to_num(np.abs(cut.errors), nan=-1.0)
    error = np.take_along_axis(cut.errors, sizes.argmax(axis=1)[:, None], axis=1)[:, 0]
    width = np.where(cut.ap > 0.0, cut.ae, np.nan)
    return {"error": _plain(um_from_m(error[rows]), 2), "width": _plain(mm_from_m(width[rows]), 3)}


def _thinned(values: Any, starts: Any) -> Any:
    """Rows to draw: all, or the lowest and highest of each of many stretches, plus the starts of lines."""
    if len(values) <= COARSE_SAMPLES:
        return np.arange(len(values))
    some = starts[:: max(1, len(starts) // (COARSE_SAMPLES // 3))]
    extremes = extremes_by_column(np.arange(len(values), dtype=float), values, COARSE_SAMPLES // 5)
    return np.unique(np.concatenate([extremes, some]))


def _plain(values: Any, digits: int) -> list[float | None]:
    """Rounded numbers in the form that JSON takes."""
    return [float(value) if np.isfinite(value) else None for value in np.round(values, digits)]
