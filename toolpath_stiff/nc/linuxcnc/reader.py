"""LinuxCNC's own interpreter (`rs274`) as a second reader of NC programs: fence, copy, run, moves."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.codes.registry import LISTED
from toolpath_stiff.nc.lathes import lathe_warning
from toolpath_stiff.nc.linuxcnc.canon import Follower
from toolpath_stiff.nc.linuxcnc.fence import Dropped, refuse_other_programs, unclosed, without_others
from toolpath_stiff.nc.linuxcnc.inputs import (
    Line,
    first_offset,
    needs_tags,
    numbered,
    parameter_file,
    split,
    tool_file,
    tool_numbers,
)
from toolpath_stiff.nc.linuxcnc.runner import StoppedError, find_rs274, message_and_line, run_rs274
from toolpath_stiff.nc.moves import ReadProgram, Unsupported
from toolpath_stiff.nc.request import ORIGIN_WINS, Request
from toolpath_stiff.nc.state import START
from toolpath_stiff.nc.tables import tool_of
from toolpath_stiff.units import ShopPose, pose_in_si

if TYPE_CHECKING:
    from toolpath_stiff.nc.linuxcnc.runner import Run, RunLimits

MACHINE_CODES = re.compile(r"G0*(?:53|28|30)(?!\d)")
OFFSET_CODES = re.compile(r"G0*10(?!\d)")
SETS_G54 = re.compile(r"L0*20?(?!\d).*P0*[01](?!\d)|P0*[01](?!\d).*L0*20?(?!\d)")
HARMLESS_WORD = re.compile(r"([GM])([0-9]+\.?[0-9]*)")
FILES = re.compile(r"\s*(logopen|logappend|probeopen)\b", re.IGNORECASE)
LOOPS = re.compile(r"O(?:<[^<>]*>|\d+|[#\[].*)(?:WHILE|REPEAT|DO)")
TURNING = re.compile(r"G0*(33|76|95|96)(?![\d.])")  # what lathes' programs have, seldom those of mills
WAITS = re.compile(r"M0*66(?!\d)")
MOST_NAMED = 5  # loops, in a message
NO_SHIFT = (0.0, 0.0, 0.0)


def read(request: Request, limits: RunLimits | None = None) -> ReadProgram:
    """A program as `rs274` reads it, within the limits of its run.

    Raises
    ------
    InputError
        The fence, or the interpreter, refuses the program, or a limit was exceeded.
    """
    lines, dropped = _checked(request.lines, request.name)
    return _Session(request, lines, find_rs274(request.rs274, request.unconfined), dropped, limits).read()


def _checked(source: Sequence[str], name: str) -> tuple[list[Line], list[Dropped]]:
    """The lines for rs274, which have passed the fence, and what was left out of them."""
    lines = split(source, name)
    refuse_other_programs(lines, name)
    lines, dropped = without_others(lines)
    if dropped:
        refuse_other_programs(lines, name)
    return lines, dropped


def refusal(source: Sequence[str], name: str) -> InputError | None:
    """The error with which the second interpreter is not started on a program; None if it may be."""
    try:
        _checked(source, name)
    except InputError as error:
        return error
    return None


class _Session:
    """A program being read, as often as it takes to know its zero."""

    def __init__(
        self, request: Request, lines: list[Line], rs274: str, dropped: Sequence[Dropped], limits: RunLimits | None
    ) -> None:
        self.request, self.lines, self.rs274, self.dropped, self.limits = request, lines, rs274, dropped, limits
        self.offsets = copy.deepcopy(request.work_offsets)
        self.tagged, self.tool_numbers = needs_tags(lines), tool_numbers(request.tool_table, lines)

    def read(self) -> ReadProgram:
        request = self.request
        origin, default_origin = request.zero
        shift = self._shift(origin, default_origin)
        run, follower = self._run(shift)
        # G54 as it stood at the first motion is the zero of the set-up frame.
        axes, given = self._first_g54(run, follower, shift)
        if any(axes[:3]):
            follower = self._follow(run, axes[:3])
        g54 = (axes[0], axes[1], axes[2], 0.0, 0.0, 0.0)
        place, source = (g54, "program") if given else (default_origin, "default")
        if origin is not None:
            place, source = origin, "option"
        if shift == NO_SHIFT and self._uses(MACHINE_CODES) and place != g54:
            raise self._machine_error()
        if not follower.recorder.cuts:
            raise ProgramError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=request.name)
        moves = follower.recorder.moves()
        return ReadProgram(
            name=request.name,
            path=request.path,
            source=request.lines,
            moves=moves,
            origin=pose_in_si(place),
            origin_source=source,
            unsupported=tuple(self._unsupported()),
            warnings=(*self._warnings(source, given), *lathe_warning(self._turning(), moves)),
            assumptions=(START, "LinuxCNC's interpreter (rs274) read the program", *self._left_out()),
            tools=tuple(tool_of(request.tool_table, number).in_use() for number in follower.used_tools),
            interpreter="linuxcnc",
            dialect="linuxcnc",
        )

    def _uses(self, codes: re.Pattern[str]) -> bool:
        return any(codes.search(line.plain) for line in self.lines)

    def _shift(self, origin: ShopPose | None, default_origin: ShopPose) -> Sequence[float]:
        """The shift of all work offsets for machine coordinates to be those of the machine; mm.

        It matters to G53, G28 and G30 alone. G10 writes offsets that are machine coordinates already: then none.
        """
        g54 = self.offsets.table[0]
        place = origin if origin is not None else None if g54.given else default_origin
        if place is None or not self._uses(MACHINE_CODES) or self._uses(OFFSET_CODES):
            return NO_SHIFT
        if any(place[3:]):
            raise self._machine_error()
        return (place[0] - g54.axes[0], place[1] - g54.axes[1], place[2] - g54.axes[2])

    def _machine_error(self) -> InputError:
        return ProgramError(
            "machine coordinates (G53, G28, G30) in a program whose zero lies elsewhere than its G10 says, or is "
            "turned: LinuxCNC's interpreter knows the machine by its offsets alone",
            expected="G54 as the program or the offsets file sets it",
            hint=f"leave {both_names('--origin')} out, or read the program with --interpreter builtin",
            file=self.request.name,
            line=next((line.number for line in self.lines if MACHINE_CODES.search(line.plain)), None),
        )

    def _prefix(self, shift: Sequence[float]) -> tuple[tuple[str, ...], int]:
        """Blocks before the program, and the work offset (index) that is in force before them.

        rs274 begins at 0 of the machine and, where the offset in force is turned, with wrong numbers: so another one
        is in force until it has begun.
        """
        active = 0
        prefix: list[str] = []
        if self.offsets.table[0].rotation:
            plain = [index for index, offset in enumerate(self.offsets.table) if not offset.rotation]
            if not plain:
                raise ProgramError(
                    "every work offset is turned: LinuxCNC's rs274 begins with wrong numbers",
                    expected="one of G54 to G59.3 without a rotation",
                    file=self.request.name,
                )
            active = plain[0]
            prefix.append("N0G54")
        if self.request.controller.feed is not None:
            prefix.append(f"N0G21F{self.request.controller.feed:.6f}")
        if any(shift):
            x, y, z = shift
            prefix += [f"N0G21G90G53G0X{x:.6f}Y{y:.6f}Z{z:.6f}", "N0G80"]
        return tuple(prefix), active

    def _run(self, shift: Sequence[float], until: int | None = None) -> tuple[Run, Follower]:
        """Run the program, or its part before the line `until` is first executed."""
        name = self.request.name
        prefix, active = self._prefix(shift)
        lines = [Line(line.number, "M2") if line.number == until else line for line in self.lines]
        switch = bool(self.request.switches)
        try:
            run = run_rs274(
                numbered(lines, name, block_delete=switch, tags=self.tagged, prefix=prefix),
                parameter_file(self.offsets, shift, active),
                tool_file(self.tool_numbers, self.request.tool_table),
                rs274=self.rs274,
                limits=self.limits,
            )
        except StoppedError as error:
            loops = [str(line.number) for line in self.lines if LOOPS.match(line.words)][:MOST_NAMED]
            hint = f"loops begin in the lines {', '.join(loops)}" if loops else ""
            raise ProgramError(str(error), hint=hint, file=name, line=error.line) from None
        follower = self._follow(run)
        if run.message or not follower.ended:
            raise self._refusal(run.message, len(prefix))
        return run, follower

    def _follow(self, run: Run, reference: Sequence[float] = NO_SHIFT) -> Follower:
        request = self.request
        tools = (request.tool_table, request.posted, self.tagged, self.tool_numbers)
        follower = Follower(request.name, self.lines, *tools, reference)
        follower.follow(run.canon)
        return follower

    def _refusal(self, message: str, lines_before: int) -> InputError:
        text, line = message_and_line(message)
        seeking = re.search(r"seeking o-word: (\S+) from line: (\d+)", text)
        if seeking:
            line = int(seeking[2]) - lines_before
            text = f"the end of O word {seeking[1]} is missing"
        elif "File ended" in text:  # it did not see the M2 that the copy ends with
            line, text = unclosed(self.lines), "the end of an O word is missing"
        return ProgramError(
            f"LinuxCNC's interpreter refuses: {text or 'it stopped without a message'}",
            file=self.request.name,
            line=line or None,
        )

    def _first_g54(self, run: Run, follower: Follower, shift: Sequence[float]) -> tuple[list[float], bool]:
        """G54's axes (mm) at the first motion, and whether they were set at all."""
        g54 = self.offsets.table[0]
        before = [a + s for a, s in zip(g54.axes, (*shift, 0.0, 0.0, 0.0), strict=True)]

        def moved(axes: list[float]) -> bool:
            return any(abs(a - b) >= 1e-4 for a, b in zip(axes, before, strict=True))

        after = first_offset(run.parameters)
        if not moved(after) and not self._uses(OFFSET_CODES):
            return before, g54.given
        if follower.first_motion is None:
            return after, True
        at_first = first_offset(self._run(shift, until=follower.first_motion)[0].parameters)
        if moved(at_first):
            return at_first, True
        early = (line.plain for line in self.lines if line.number < follower.first_motion)
        return before, g54.given or any(OFFSET_CODES.search(words) and SETS_G54.search(words) for words in early)

    def _turning(self) -> dict[str, int]:
        """Codes that make the program look like a lathe's, with their lines."""
        signs: dict[str, int] = {}
        for line in self.lines:
            for number in TURNING.findall(line.plain) if "G" in line.words else ():
                signs.setdefault(f"G{number}", line.number)
        return signs

    def _left_out(self) -> list[str]:
        words = list(dict.fromkeys(word for _, word in self.dropped))
        more = f" and {len(words) - MOST_NAMED} more" if len(words) > MOST_NAMED else ""
        shown = ", ".join(words[:MOST_NAMED]) + more
        reason = "left out for LinuxCNC's interpreter, which does not know it there, and which changes no path"
        return [f"{reason}: {shown}"] if words else []

    def _unsupported(self) -> list[Unsupported]:
        """Words that change nothing in a path, and comments that would write files."""
        unsupported = []

        def add(line: Line, word: str, reason: str) -> None:
            unsupported.append(Unsupported(line.number, self._column(line, word), word, reason))

        for number, word in self.dropped:
            reason = "an M code of one control, not acted upon" if word[0] == "M" else "changes no path"
            add(self.lines[number - 1], word, reason)
        for line in self.lines:
            for letter, digits in HARMLESS_WORD.findall(line.plain):
                code = code_name(letter, float(digits))
                if code in LISTED:
                    add(line, letter + digits, LISTED[code])
            unsupported += [
                Unsupported(line.number, column, text.split(",")[0].strip(), "no file is written")
                for column, text in line.comments
                if FILES.match(text)
            ]
        return unsupported

    def _column(self, line: Line, word: str) -> int:
        """Column of a word in its line, whatever blanks are within it."""
        text = self.request.lines[line.number - 1]
        for start, comment in line.comments:
            text = text[: start - 1] + " " * (len(comment) + 1) + text[start + len(comment) :]
        match = re.search(r"\s*".join(map(re.escape, word)), text, re.IGNORECASE)
        return match.start() + 1 if match else 1

    def _warnings(self, source: str, given: bool) -> list[str]:
        warnings = []
        if source == "option" and given:
            warnings.append(ORIGIN_WINS)
        warnings += [
            f"line {number}: what {word} does on its control is not known"
            for number, word in self.dropped
            if word[0] == "M"
        ]
        warnings += [
            f"line {line.number}: M66 waits for an input that is not there; what depends on it may differ"
            for line in self.lines
            if WAITS.search(line.plain)
        ]
        return warnings
