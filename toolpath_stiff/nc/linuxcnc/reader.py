"""LinuxCNC's own interpreter (`rs274`) as a second reader of NC programs: fence, copy, run, moves."""

from __future__ import annotations

import copy as copying
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.codes.registry import LISTED
from toolpath_stiff.nc.linuxcnc.canon import Follower
from toolpath_stiff.nc.linuxcnc.inputs import (
    Dropped,
    Line,
    first_offset,
    needs_tags,
    numbered,
    parameter_file,
    refuse_other_programs,
    split,
    tool_file,
    tool_numbers,
    unclosed,
    without_others,
)
from toolpath_stiff.nc.linuxcnc.runner import StoppedError, find_rs274, message_and_line, run_rs274
from toolpath_stiff.nc.moves import Moves, ToolUse, Unsupported
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.state import START
from toolpath_stiff.nc.tables import Offsets, tool_of
from toolpath_stiff.units import ShopPose

if TYPE_CHECKING:
    from toolpath_stiff.nc.linuxcnc.runner import Limits, Run


MACHINE_CODES = re.compile(r"G0*(?:53|28|30)(?!\d)")


OFFSET_CODES = re.compile(r"G0*10(?!\d)")


SETS_G54 = re.compile(r"L0*20?(?!\d).*P0*[01](?!\d)|P0*[01](?!\d).*L0*20?(?!\d)")


HARMLESS_WORD = re.compile(r"([GM])([0-9]+\.?[0-9]*)")


FILES = re.compile(r"\s*(logopen|logappend|probeopen)\b", re.IGNORECASE)


LOOPS = re.compile(r"O(?:<[^<>]*>|\d+|[#\[].*)(?:WHILE|REPEAT|DO)")


MOST_NAMED = 5  # loops, in a message


TURNING = re.compile(r"G0*(33|76|95|96)(?![\d.])")  # what lathes' programs have, seldom those of mills


WAITS = re.compile(r"M0*66(?!\d)")


@dataclass(frozen=True)
class Reading:
    """What the second interpreter found; see `Program` for the fields."""

    moves: Moves
    origin: ShopPose
    source: str
    unsupported: tuple[Unsupported, ...]
    warnings: tuple[str, ...]
    assumptions: tuple[str, ...]
    tools: tuple[ToolUse, ...]
    turning: dict[str, int]  # what makes the program look like a lathe's, with its line


def read(request: Request, limits: Limits | None = None) -> Reading:
    """What `rs274` makes of a program, within the limits of its run.

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
    """Why the second interpreter is not started on a program; None if it may be."""
    try:
        _checked(source, name)
    except InputError as error:
        return error
    return None


@dataclass
class _Session:
    request: Request
    lines: list[Line]
    rs274: str
    dropped: Sequence[Dropped]
    limits: Limits | None

    def read(self) -> Reading:
        origin, default_origin = self.request.zero
        offsets = copying.deepcopy(self.request.offsets)
        shift = self._shift(origin, default_origin)
        run, follower = self._run(offsets, shift)
        # G54 as it stood at the first motion is the zero of the set-up frame.
        axes, given = self._first_g54(run, follower, offsets, shift)
        if any(axes[:3]):
            follower = self._follow(run, (axes[0], axes[1], axes[2]))
        g54 = (axes[0], axes[1], axes[2], 0.0, 0.0, 0.0)
        if origin is not None:
            place, says = origin, "option"
        elif given:
            place, says = g54, "program"
        else:
            place, says = default_origin, "default"
        if shift == (0.0, 0.0, 0.0) and self._uses(MACHINE_CODES) and place != g54:
            raise self._machine_error()
        if not follower.recorder.cuts:
            raise ProgramError(
                "no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=self.request.name
            )
        return Reading(
            moves=follower.recorder.moves(),
            origin=place,
            source=says,
            unsupported=tuple(self._unsupported()),
            warnings=tuple(self._warnings(says, given, follower)),
            assumptions=(START, "LinuxCNC's interpreter (rs274) read the program", *self._left_out()),
            tools=tuple(tool_of(self.request.tools, number).in_use() for number in follower.used_tools),
            turning=self._turning(),
        )

    def _uses(self, codes: re.Pattern[str]) -> bool:
        return any(codes.search(line.plain) for line in self.lines)

    def _shift(self, origin: ShopPose | None, default_origin: ShopPose) -> tuple[float, float, float]:
        """How far all work offsets must be moved for machine coordinates to be those of the machine; mm.

        It matters to G53, G28 and G30 alone. G10 writes offsets that are machine coordinates already: then none.
        """
        g54 = self.request.offsets.table[0]
        place = origin if origin is not None else None if g54.given else default_origin
        if place is None or not self._uses(MACHINE_CODES) or self._uses(OFFSET_CODES):
            return (0.0, 0.0, 0.0)
        if any(place[3:]):
            raise self._machine_error()
        return (place[0] - g54.axes[0], place[1] - g54.axes[1], place[2] - g54.axes[2])

    def _machine_error(self) -> InputError:
        number = next((line.number for line in self.lines if MACHINE_CODES.search(line.plain)), None)
        return ProgramError(
            "machine coordinates (G53, G28, G30) in a program whose zero lies elsewhere than its G10 says, or is "
            "turned: LinuxCNC's interpreter knows the machine by its offsets alone",
            expected="G54 as the program or the offsets file sets it",
            hint=f"leave {both_names('--origin')} out, or read the program with --interpreter builtin",
            file=self.request.name,
            line=number,
        )

    def _prefix(self, offsets: Offsets, shift: tuple[float, float, float]) -> tuple[tuple[str, ...], int]:
        """Blocks before the program, and the work offset (index) that is in force before them.

        rs274 begins at 0 of the machine and, where the offset in force is turned, with wrong numbers: so another one
        is in force until it has begun.
        """
        active = 0
        prefix: list[str] = []
        if offsets.table[0].rotation:
            plain = [index for index, offset in enumerate(offsets.table) if not offset.rotation]
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

    def _run(
        self, offsets: Offsets, shift: tuple[float, float, float], until: int | None = None
    ) -> tuple[Run, Follower]:
        """Run the program, or its part before the line `until` is first executed."""
        prefix, active = self._prefix(offsets, shift)
        lines = self.lines
        if until is not None:
            lines = [Line(line.number, "M2") if line.number == until else line for line in lines]
        text = numbered(
            lines,
            self.request.name,
            block_delete=bool(self.request.switches),
            tags=needs_tags(self.lines),
            prefix=prefix,
        )
        try:
            run = run_rs274(
                text,
                parameter_file(offsets, shift, active),
                tool_file(tool_numbers(self.request.tools, self.lines), self.request.tools),
                rs274=self.rs274,
                limits=self.limits,
            )
        except StoppedError as error:
            loops = [str(line.number) for line in self.lines if LOOPS.match(line.words)][:MOST_NAMED]
            hint = f"loops begin in the lines {', '.join(loops)}" if loops else ""
            raise ProgramError(str(error), hint=hint, file=self.request.name, line=error.line) from None
        follower = self._follow(run, (0.0, 0.0, 0.0))
        if run.message or not follower.ended:
            raise self._refusal(run.message, len(prefix))
        return run, follower

    def _follow(self, run: Run, reference: tuple[float, float, float]) -> Follower:
        numbers = tool_numbers(self.request.tools, self.lines)
        follower = Follower(
            self.request.name, self.lines, self.request.tools, needs_tags(self.lines), numbers, reference
        )
        follower.posted = self.request.posted is not None
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

    def _first_g54(
        self, run: Run, follower: Follower, offsets: Offsets, shift: tuple[float, float, float]
    ) -> tuple[list[float], bool]:
        """G54's axes (mm) at the first motion, and whether they were set at all."""
        before = [a + s for a, s in zip(offsets.table[0].axes, (*shift, 0.0, 0.0, 0.0), strict=True)]
        given = offsets.table[0].given
        after, _ = first_offset(run.parameters)
        if all(abs(a - b) < 1e-4 for a, b in zip(after, before, strict=True)) and not self._uses(OFFSET_CODES):
            return before, given
        if follower.first_motion is None:
            return after, True
        at_first, _ = first_offset(self._run(offsets, shift, until=follower.first_motion)[0].parameters)
        moved = any(abs(a - b) > 1e-4 for a, b in zip(at_first, before, strict=True))
        early = [line for line in self.lines if line.number < follower.first_motion]
        zeroed = any(OFFSET_CODES.search(line.plain) and SETS_G54.search(line.plain) for line in early)
        return at_first if moved else before, given or moved or zeroed

    def _turning(self) -> dict[str, int]:
        found: dict[str, int] = {}
        for line in self.lines:
            for number in TURNING.findall(line.plain) if "G" in line.words else ():
                found.setdefault(f"G{number}", line.number)
        return found

    def _left_out(self) -> list[str]:
        if not self.dropped:
            return []
        words = list(dict.fromkeys(word for _, word in self.dropped))
        more = f" and {len(words) - MOST_NAMED} more" if len(words) > MOST_NAMED else ""
        return [
            "left out for LinuxCNC's interpreter, which does not know it there, and which changes no path: "
            f"{', '.join(words[:MOST_NAMED])}{more}"
        ]

    def _unsupported(self) -> list[Unsupported]:
        """Words that change nothing in a path, and comments that would write files."""
        found = [
            Unsupported(
                number,
                self._column(self.lines[number - 1], word),
                word,
                "an M code of one control, not acted upon" if word[0] == "M" else "changes no path",
            )
            for number, word in self.dropped
        ]
        for line in self.lines:
            if "G" in line.words or "M" in line.words:
                for letter, digits in HARMLESS_WORD.findall(line.plain):
                    reason = LISTED.get(code_name(letter, float(digits)))
                    if reason:
                        column = self._column(line, letter + digits)
                        found.append(Unsupported(line.number, column, letter + digits, reason))
            found += [
                Unsupported(line.number, column, text.split(",")[0].strip(), "no file is written")
                for column, text in line.comments
                if FILES.match(text)
            ]
        return found

    def _column(self, line: Line, word: str) -> int:
        """Where a word stands in its line, whatever blanks are within it."""
        text = self.request.lines[line.number - 1]
        for start, comment in line.comments:
            text = text[: start - 1] + " " * (len(comment) + 1) + text[start + len(comment) :]
        match = re.search(r"\s*".join(map(re.escape, word)), text, re.IGNORECASE)
        return match.start() + 1 if match else 1

    def _warnings(self, says: str, given: bool, follower: Follower) -> list[str]:
        warnings = list(follower.warnings)
        if says == "option" and given:
            warnings.append(
                f"the program or the offsets file sets G54; {both_names('--origin')} overrides it, other offsets keep "
                "their distance to it"
            )
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
