"""LinuxCNC's own interpreter (`rs274`) as a second reader of NC programs: fence, copy, run, moves."""

import copy
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.codes.registry import LISTED
from toolpath_stiff.nc.linuxcnc.canon import Follower
from toolpath_stiff.nc.linuxcnc.fence import called_files, refuse_other_programs, without_user_codes
from toolpath_stiff.nc.linuxcnc.inputs import (
    Line,
    first_offset,
    numbered,
    numbered_line,
    parameter_file,
    split,
    tool_file,
    tool_numbers,
)
from toolpath_stiff.nc.linuxcnc.runner import Run, find_rs274, run_rs274
from toolpath_stiff.nc.moves import ReadProgram, Remark, Unsupported
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.request import ORIGIN_WINS, Request
from toolpath_stiff.nc.state import START
from toolpath_stiff.poses import ShopPose, pose_in_si

MACHINE_CODES = re.compile(r"G0*(?:53|28|30)(?!\d)")
OFFSET_CODES = re.compile(r"G0*10(?!\d)")
SETS_G54 = re.compile(r"L0*20?(?!\d).*P0*[01](?!\d)|P0*[01](?!\d).*L0*20?(?!\d)")
G_OR_M_WORD = re.compile(r"([GM])([0-9]+\.?[0-9]*)")
WAITS = re.compile(r"M0*66(?!\d)")
WAITING = "M66 waits for an input that is not there; what depends on it may differ"
USER = "{} runs a program of its machine's (M100 to M199): taken as nothing"
NO_SHIFT = (0.0, 0.0, 0.0)


def read(request: Request) -> ReadProgram:
    """A program as `rs274` reads it.

    Raises
    ------
    InputError
        The fence, or the interpreter, refuses the program, or a limit was exceeded.
    """
    return _Session(request, *fenced(request.lines, request.name, request.controller.subprograms)).read()


def fenced(source: Sequence[str], name: str, folder: str | None = None) -> tuple[list[Line], dict[int, int]]:
    """Lines of a program, then lines of the files that it calls, with the line of the call of each.

    Raises `InputError` for a program that the interpreter is not started on.
    """
    lines = [without_user_codes(line) for line in split(source, name)]
    subs, callers = called_files(lines, folder)
    refuse_other_programs([*lines, *subs], name)
    return [*lines, *subs], callers


class _Session:
    """A program being read, with as many runs as it takes to know its zero."""

    def __init__(self, request: Request, lines: list[Line], callers: dict[int, int]) -> None:
        self.request, self.lines, self.callers = request, lines, callers
        self.rs274 = find_rs274(request.rs274, request.unconfined)
        self.offsets = copy.deepcopy(request.work_offsets)
        self.tool_numbers = tool_numbers(request.controller.tools, lines)

    def read(self) -> ReadProgram:
        request = self.request
        origin, default_origin = request.zero
        shift = self._shift(origin, default_origin)
        run = self._run(shift)
        follower = self._follow(run)
        if not follower.recorder.cuts:
            raise ProgramError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=request.name)
        # G54 as it stood at the first motion is the zero of the set-up frame.
        axes, given = self._first_g54(run, follower.first_motion or 0, shift)
        if any(axes[:3]):
            follower = self._follow(run, axes[:3])
        g54 = (axes[0], axes[1], axes[2], 0.0, 0.0, 0.0)
        place, source = (g54, "program") if given else (default_origin, "default")
        if origin is not None:
            place, source = origin, "option"
        if shift == NO_SHIFT and self._uses(MACHINE_CODES) and place != g54:
            raise self._machine_error()
        shown = len(request.lines)
        called = np.array([*range(shown + 1), *self.callers.values()])  # moves of a file are those of its call's line
        program = request.program(
            follower,
            origin=pose_in_si(place),
            origin_source=source,
            warnings=(
                *([ORIGIN_WINS] if source == "option" and given else ()),
                *(
                    Remark(USER.format(code), int(called[line.number]))
                    for line in self.lines
                    for code in line.user_codes
                ),
                *(Remark(WAITING, line.number) for line in self.lines if WAITS.search(line.plain)),
            ),
            assumptions=(START, "LinuxCNC's interpreter (rs274) read the program"),
            interpreter="linuxcnc",
            dialect="linuxcnc",
            jumps=tuple(jump for jump in follower.jumps if max(jump.left, jump.after) <= shown),
        )
        return replace(program, moves=replace(program.moves, line=called[program.moves.line]))

    def _uses(self, codes: re.Pattern[str]) -> bool:
        return any(codes.search(line.plain) for line in self.lines)

    def _shift(self, origin: ShopPose | None, default_origin: ShopPose) -> Sequence[float]:
        """Shift of all work offsets, mm, that makes machine coordinates those of the machine.

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
            hint="leave --origin out, or read the program with --interpreter builtin",
            file=self.request.name,
            line=next((line.number for line in self.lines if MACHINE_CODES.search(line.plain)), None),
        )

    def _run(self, shift: Sequence[float], until: int | None = None) -> Run:
        """Run the program, or its part before the line `until` is first executed."""
        name = self.request.name
        # rs274 begins at machine zero and, if the offset in force is rotated, with wrong numbers: so another offset
        # is in force until it has started.
        active = next((index for index, offset in enumerate(self.offsets.table) if not offset.rotation), None)
        if active is None:
            raise ProgramError("every work offset is turned", expected="one of G54 to G59.3 that is not", file=name)
        prefix = ["N0G54"] if active else []
        if self.request.controller.feed is not None:
            prefix.append(f"N0G21F{self.request.controller.feed:.6f}")
        if any(shift):
            x, y, z = shift
            prefix += [f"N0G21G90G53G0X{x:.6f}Y{y:.6f}Z{z:.6f}", "N0G80"]
        lines = [Line(line.number, "", "M2") if line.number == until else line for line in self.lines]
        main = len(lines) - len(self.callers)
        prefix += [numbered_line(line, line.words, Place(name, line.number)) for line in lines[main:]]
        return run_rs274(
            numbered(lines[:main], name, block_delete=bool(self.request.controller.switches), prefix=prefix),
            parameter_file(self.offsets, shift, active),
            tool_file(self.tool_numbers, self.request.controller.tools),
            rs274=self.rs274,
        )

    def _follow(self, run: Run, reference: Sequence[float] = NO_SHIFT) -> Follower:
        request, control = self.request, self.request.controller
        known = request.name, self.lines, control.kinematics, self.tool_numbers, reference
        follower = Follower(*known, tools=control.tools, unsupported=self._unsupported())
        follower.follow(run.canon)
        if run.refusal:
            raise ProgramError(run.refusal, file=request.name, line=self.callers.get(run.line or 0, run.line))
        return follower

    def _first_g54(self, run: Run, first_motion: int, shift: Sequence[float]) -> tuple[list[float], bool]:
        """G54's axes (mm) at the first motion, and True if they were set at all."""
        g54 = self.offsets.table[0]
        before = [a + s for a, s in zip(g54.axes, (*shift, 0.0, 0.0, 0.0), strict=True)]

        def moved(axes: list[float]) -> bool:
            return any(abs(a - b) >= 1e-4 for a, b in zip(axes, before, strict=True))

        if not moved(first_offset(run.parameters)) and not self._uses(OFFSET_CODES):
            return before, g54.given
        at_first = first_offset(self._run(shift, until=first_motion).parameters)
        if moved(at_first):
            return at_first, True
        early = (line.plain for line in self.lines if line.number < first_motion)
        return before, g54.given or any(OFFSET_CODES.search(words) and SETS_G54.search(words) for words in early)

    def _unsupported(self) -> list[Unsupported]:
        """Words that change nothing in a path."""
        matches = ((line, match) for line in self.lines for match in G_OR_M_WORD.finditer(line.plain))
        codes = ((line, match, code_name(match[1], float(match[2]))) for line, match in matches)
        return [
            Unsupported(line.number, line.columns[match.start()], match[0], LISTED[code])
            for line, match, code in codes
            if code in LISTED
        ]
