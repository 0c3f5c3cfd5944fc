"""A move recorded: its ends in the set-up frame, its feed, its tool; and what the present height hangs on. mm."""

from __future__ import annotations

import math
from collections.abc import Collection

from toolpath_stiff.nc.blocks import CurrentBlock
from toolpath_stiff.nc.codes.feeds import feed_of_move
from toolpath_stiff.nc.codes.turning import XY, know_place
from toolpath_stiff.nc.moves import RAPID, ToolUse
from toolpath_stiff.nc.recorder import Arc
from toolpath_stiff.nc.state import Segment, State
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import Word
from toolpath_stiff.units import m_from_mm

STILL = 1e-12  # of a coordinate, or of 1 mm if that is more: what frames' sums leave of an axis that stands


def record(
    state: State,
    block: CurrentBlock,
    motion: int,
    control: list[float],
    work: Collection[int] = (),
    machine: Collection[int] = (),
    arc: Arc | None = None,
) -> None:
    """Move to a point in control coordinates; `work`, `machine`: axes that were given in each."""
    frames = state.frames
    state.length_changed = state.rotation_changed = False
    if state.height_lost:
        find_height(state, block, motion, (2 in work and state.absolute) or 2 in machine)
    start, was = frames.to_setup(frames.position), frames.bound
    for axis in work:
        frames.from_machine[axis] = False
    for axis in machine:
        frames.from_machine[axis] = True
    end = frames.to_setup(control)
    # An axis that was not asked to move keeps its number to the last digit, whatever the frames' sums say.
    for axis in range(6):
        if abs(end[axis] - start[axis]) < STILL * max(1.0, abs(start[axis])):
            end[axis] = start[axis]
    feed = math.nan if motion == RAPID else feed_of_move(state, block, start, end, arc)
    bound = (was, frames.bound)
    added = state.recorder.add(block.line, motion, start, end, feed, state.tool, state.tool_length, bound, arc)
    if state.trace is not None:
        state.trace.append(Segment(motion, list(frames.position), list(control), arc))
    frames.position = control
    if added:
        note_tool(state)


def note_tool(state: State) -> None:
    """Keep the tool in the spindle among those that moved."""
    if state.tool in state.used_tools:
        return
    entry = (state.tools or {}).get(state.tool, ToolEntry(state.tool))
    state.used_tools[state.tool] = ToolUse(
        state.tool,
        m_from_mm(entry.length),
        m_from_mm(entry.diameter),
        entry.remark,
        m_from_mm(entry.stick_out),
        entry.material,
    )


def find_height(state: State, block: CurrentBlock, motion: int, named: bool) -> None:
    """A move where the present height is lost: a cut is refused, a Z finds it again."""
    if motion != RAPID:
        know_height(state, block, None)
    state.height_lost = not named


def know_height(state: State, block: CurrentBlock, word: Word | None) -> None:
    """Refuse what hangs on the present height, if that is lost."""
    if state.height_lost:
        raise block.fail(
            word,
            "a cut before any Z" if word is None else "takes the present height",
            "G0 with Z before it: the tool length changed between the last move and M6, and LinuxCNC's interpreter "
            "forgets that",
        )


def know_position(state: State, block: CurrentBlock, word: Word, axes: Collection[int]) -> None:
    """Refuse a code that takes the present numbers of axes that LinuxCNC's interpreter may have otherwise."""
    if 2 in axes:
        know_height(state, block, word)
    if XY & set(axes):
        know_place(state, block, word)
