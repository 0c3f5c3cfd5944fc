"""Holes of a drilling cycle, many at a time: lines of X and Y alone, each drilled as the line before them was.

The interpreter drills the first holes; where the last one went straight to its place at the height at which it ended,
and in and out along the tool, the next ones are the same moves elsewhere, digit for digit. mm, degrees.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.nc.moves import RAPID, Arcs, MovesInMm, Recorder
from toolpath_stiff.nc.state import State

LEAST = 1e-9  # mm; of a shorter way to the next hole the interpreter decides whether it is one


def suits(state: State) -> bool:
    """Whether holes can be drilled so: G17, G90, and no offset whose sums would round."""
    frames = state.frames
    offset = frames.offsets.at(frames.active)
    return (
        state.plane == "G17"
        and state.absolute
        and state.feed_mode == "G94"
        and not any(offset.axes)
        and not any(frames.g92)
        and not any(frames.fix_reference())
        and not frames.rotated
    )


def rows_of_hole(recorder: Recorder, line: int) -> slice | None:
    """The rows of the last line's hole in the recorder's lists, if it went there and in and out again; else None."""
    last = len(recorder.line)
    first = last
    while first and recorder.line[first - 1] == line:
        first -= 1
    if last - first < 3 or recorder.motion[first] != RAPID:
        return None
    begin, place = recorder.start[first], recorder.end[first]
    if begin[2:] != place[2:] or recorder.end[-1] != place:
        return None
    for row in range(first + 1, last):
        for point in (recorder.start[row], recorder.end[row]):
            if point[:2] != place[:2] or point[3:] != place[3:]:
                return None
    if any(any(flags) for flags in recorder.from_machine[first:last]):
        return None
    return slice(first, last)


def drill(state: State, hole: slice, line: int, places: FloatArray) -> None:
    """Add the moves of holes at `places` (m, 2), of the lines from `line` on, like the one in the rows `hole`."""
    recorder = state.recorder
    start, end = (np.array(column[hole]) for column in (recorder.start, recorder.end))
    count, rows = len(places), hole.stop - hole.start
    starts, ends = (np.tile(points, (count, 1, 1)) for points in (start, end))
    starts[:, 1:, :2] = ends[:, :, :2] = places[:, None, :]
    starts[0, 0, :2], starts[1:, 0, :2] = end[0, :2], places[:-1]

    def repeated(column: Sequence[float]) -> NDArray[np.float64]:
        return np.tile(np.array(column[hole]), count)

    recorder.add_many(
        MovesInMm(
            line=np.repeat(np.arange(line, line + count), rows),
            motion=np.tile(np.array(recorder.motion[hole], dtype=np.int64), count),
            start=starts.reshape(-1, 6),
            end=ends.reshape(-1, 6),
            arcs=Arcs.of({}),
            feed=repeated(recorder.feed),
            dwell=repeated(recorder.dwell),
            tool=np.full(count * rows, state.tool),
            tool_length=np.full(count * rows, state.tool_length),
            from_machine=np.zeros((count * rows, 2), dtype=bool),
        )
    )
    state.frames.position[:2] = places[-1].tolist()
