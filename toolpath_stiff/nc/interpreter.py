"""Blocks to moves: executes them in order, each in LinuxCNC's order of execution. mm, degrees, mm/min inside.

Order of execution within a block and start-up state are LinuxCNC's (manual, "G-Code overview").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from toolpath_stiff.nc.blocks import POINT_WORDS, Codes
from toolpath_stiff.nc.codes import ADDITIONAL_OFFSETS, ARCS, CYCLES, HOLDS_TIP, M_SUBPROGRAM, MOTION, WORK_OFFSETS
from toolpath_stiff.nc.dialects import GENERIC, SECONDS, Dialect
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.motion import SECONDS_PER_DAY
from toolpath_stiff.nc.moves import FEED, RAPID
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import Block, Word
from toolpath_stiff.nc.zeros import Zeros
from toolpath_stiff.units import MM_PER_INCH

HOLDS_HINT = (
    "post X, Y, Z, A, B, C of the tip, or name the machine it is posted for ([kinematics] of a controller file)"
)
USES_AXES = ("G10", "G28", "G30", "G52", "G92")  # non-modal codes that take the axis words of their block


@dataclass(frozen=True)
class Call:
    """A subprogram call: its P, its L (None: not given), the column of its M98; `local`: it is M97, P an N number."""

    number: int
    repeats: int | None
    column: int
    local: bool = False


class Interpreter(Zeros):
    """Executes blocks in order; `recorder` holds the moves found so far.

    `call` and `returns` are the M98 and M99 of the last block, for whoever chooses the next one.
    """

    def __init__(
        self, name: str, frames: Frames, tools: dict[int, ToolEntry] | None, dialect: Dialect = GENERIC
    ) -> None:
        super().__init__(name, frames, tools, dialect)
        self.call: Call | None = None
        self.returns = False
        # Tool centre point control, by the number of moves before it is switched (G43.4) on or off.
        self.tip_held: list[tuple[int, bool]] = []

    def execute(self, block: Block) -> bool:
        """Execute a block; False once the program has ended."""
        if not block.words:
            self.block = block
            self.call, self.returns = None, False
            return True
        return self.finish(self.begin(block))

    def begin(self, block: Block) -> Codes:
        """Take a block's codes and set its modes, not moving yet; to do so twice changes nothing but dwells."""
        self.block = block
        codes = self._collect(block)
        self._read_numbers(codes)
        self._modes(codes)
        return codes

    def finish(self, codes: Codes) -> bool:
        """Offsets and moves of the block begun; False once the program has ended."""
        self._once(codes)
        self._move(codes)
        for letter in sorted(self.free):
            raise self.fail(self.values[letter], "is not used by any code of its block", hint="remove it")
        return codes.get("M stop") not in ("M2", "M30")

    # -- modes ---------------------------------------------------------------------------------------------------

    def _modes(self, codes: Codes) -> None:
        """Everything modal, in LinuxCNC's order; units first, so that an F beside G20 is in inches."""
        units = codes.get("units")
        if units is not None:
            self._check_unit_change(units == "G20", codes.groups["units"][1])
            self.inch = units == "G20"
        feed_mode = codes.get("feed mode")
        if feed_mode is not None:
            if feed_mode != self.feed_mode:
                self.feed = None  # the old number means something else now
            self.feed_mode = feed_mode
        self._feed_and_speed()
        self._tools(codes)
        for _, word in [c for c in codes.once if c[0] == "G4"]:
            self._dwell(word)
        self._plane(codes)
        self._polar_mode(codes.get("polar"))
        self._tool_length(codes)
        self._subprogram(codes)
        if "work offset" in codes.groups:
            self._work_offset(*codes.groups["work offset"])
        if codes.get("path control"):
            self.take("P")
            self.take("Q")
        if codes.get("spindle mode") == "G96":
            self.take("D")
        distance = codes.get("distance")
        if distance is not None:
            self.absolute = distance == "G90"
        arc_distance = codes.get("arc distance")
        if arc_distance is not None:
            self.arc_absolute = arc_distance == "G90.1"
        self.retract = codes.get("cycle return") or self.retract
        if any(group.startswith("M ") for group in codes.groups) or any(w.letter == "M" for w in self.block.words):
            self._drop_m_parameters(codes)

    def _check_unit_change(self, inch: bool, word: Word) -> None:
        if inch != self.inch and self.frames.tool:
            raise self.fail(
                word, "while a tool length is in force: LinuxCNC would take its number anew", "G49 before it"
            )

    def _subprogram(self, codes: Codes) -> None:
        """M98 and M99: whoever runs the blocks acts upon them, after the block's own moves."""
        code = codes.get(f"M {M_SUBPROGRAM}")
        self.call, self.returns = None, code == "M99"
        if code is None:
            return
        word = codes.groups[f"M {M_SUBPROGRAM}"][1]
        if code == "M99":
            if self.has("P"):
                raise self.fail(self.values["P"], "makes M99 return to another block, which is not supported", "M99")
            return
        if code == "M97" and not self.dialect.local_calls:
            raise self.fail(
                word,
                "is Haas' call of a block by its N number",
                hint="give --dialect haas if it is that, or make it a subprogram (O number, M98, M99)",
            )
        if any(other in ("G4", "G10") for other, _ in codes.once):
            raise self.fail(word, "beside a code that wants the P word too", "two blocks")
        number, repeats = self._whole("P", word), self._whole("L", word)
        if number is None:
            raise self.fail(word, "without P", "P with the number of what it calls")
        self.call = Call(number, repeats, word.column, local=code == "M97")

    def _whole(self, letter: str, word: Word) -> int | None:
        value = self.take(letter)
        if value is None:
            return None
        if value != int(value) or value < 1:
            raise self.fail(self.values[letter], f"beside {word.text} is no count", "a whole number from 1")
        return int(value)

    def _work_offset(self, code: str, word: Word) -> None:
        index = WORK_OFFSETS.index(code) if code in WORK_OFFSETS else self._additional_offset(code, word)
        if index != self.frames.active:
            self._refuse_while_rotated(word, "takes another work offset")
            turned = self.frames.offsets.at(index).rotation != self.frames.offsets.at(self.frames.active).rotation
            self.rotation_changed = self.rotation_changed or turned
            self.frames.active = index
            self._zero_moved()
            self._forget_polar()

    def _additional_offset(self, code: str, word: Word) -> int:
        """Index of the offset that G54.1 P or G154 P names; the controller file or G10 must have said where it is."""
        if code not in self.dialect.additional:
            known = " or ".join(self.dialect.additional)
            raise self.fail(
                word, f"is not a code of the dialect {self.dialect.name}", f"{known} P" if known else "G54 to G59.3"
            )
        number = self._whole("P", word)
        if number is None or number > ADDITIONAL_OFFSETS[code]:
            raise self.fail(word, "needs the number of its offset", f"P1 to P{ADDITIONAL_OFFSETS[code]}")
        if number not in self.frames.offsets.additional:
            raise self.fail(
                word,
                f"P{number} is an offset that nothing defines",
                hint=f'give it in the controller file: [offsets] "{code} P{number}" = [x, y, z]',
            )
        return len(WORK_OFFSETS) + number - 1

    def _plane(self, codes: Codes) -> None:
        plane = codes.get("plane")
        if plane is not None and plane != self.plane:
            self._refuse_while_rotated(codes.groups["plane"][1], "takes another plane")
            self.plane = plane
            self._forget_polar()

    def _drop_m_parameters(self, codes: Codes) -> None:
        """M codes may carry P, Q, E words; unless the block moves, these are theirs."""
        moves = codes.get(MOTION) is not None or codes.once or any(self.has(a) for a in POINT_WORDS)
        if not moves:
            for letter in "PQERS":
                self.take(letter)

    @property
    def feed_scale(self) -> float:
        """Millimetres of the length unit of F."""
        return MM_PER_INCH if self.inch and self.feed_mode != "G93" else 1.0

    def _feed_and_speed(self) -> None:
        feed = self.take("F")
        if feed is not None:
            word = self.values["F"]
            if feed < 0.0:
                raise self.fail(word, "is a negative feed", "F above 0")
            if "." not in word.text and feed and self.feed_mode != "G93":
                self._check_bare_feed(word)
            self.feed = feed * self.feed_scale if feed > 0.0 else None
        speed = self.take("S")
        if speed is not None:
            if speed < 0.0:
                raise self.fail(self.values["S"], "is a negative speed", "S of 0 or more")
            self.speed = speed

    def _check_bare_feed(self, word: Word) -> None:
        units = "inch" if self.inch else "mm"
        per_revolution = self.dialect.increments and self.feed_mode == "G95"
        if per_revolution or units in self.dialect.feed_needs_point:
            raise self.fail(
                word,
                f"without a decimal point is a feed that hangs on the control's parameters ({self.dialect.name})",
                f"{word.text}. if it is that many {units} per {'revolution' if self.feed_mode == 'G95' else 'minute'}",
            )

    def _tools(self, codes: Codes) -> None:
        number = self.take("T")
        if number is not None:
            self.selected = int(number)
        change, chosen = codes.get("M tool change"), None
        if change == "M61":
            chosen = self.take("Q")
            if chosen is None or chosen < 0 or chosen != int(chosen):
                raise self.fail(codes.groups["M tool change"][1], "needs the tool number", "Q with a whole number")
        if change is not None:  # M61 leaves alone what T has selected for the next M6
            self.tool = self.selected if chosen is None else int(chosen)
            self.renamed = change == "M61"
            self.height_lost = self.height_lost or self.length_changed
            if self.rotation_changed:
                self.unsettled = "G10"

    def _dwell(self, word: Word) -> None:
        seconds = self._seconds("X" if self.dialect.dwell != SECONDS and self.has("X") else "P")
        if seconds is None or not 0.0 <= seconds <= SECONDS_PER_DAY:
            raise self.fail(word, "needs its time", "P with the seconds, 0 or more")
        self.recorder.add_dwell(seconds)

    def _tool_length(self, codes: Codes) -> None:
        code = codes.get("tool length")
        if code is None:
            return
        word = codes.groups["tool length"][1]
        if code == HOLDS_TIP and self.frames.posted is None:
            raise self.fail(
                word, "is tool centre point control of one control, which is not supported", hint=HOLDS_HINT
            )
        self._hold_tip(False, word)
        if code == "G49":
            length = math.nan
        elif code == "G43.1":
            value = self.take("Z")
            if value is None or any(self.has(axis) for axis in "XYABC"):
                raise self.fail(word, "with other words than Z", "Z with the tool length")
            length = value * self.length_scale
        else:
            length = self._table_length(word)
        self.tool_length = length
        new = 0.0 if math.isnan(length) else length
        self.length_changed = self.length_changed or new != self.frames.tool
        self.frames.set_tool(new)
        self._hold_tip(code == HOLDS_TIP, word)

    def _hold_tip(self, hold: bool, word: Word) -> None:
        """Switch tool centre point control: the machine stands still, the numbers of the present point change."""
        frames = self.frames
        if frames.posted is None or (not frames.posted.tcp and frames.tip_held == hold):
            return
        turned = any(frames.position[3 + axis.column] for axis in frames.posted.axes)
        if not frames.posted.tcp:
            frames.tip_held = hold
            self.tip_held.append((len(self.recorder), hold))
        if not turned:
            return
        if frames.posted.tcp or (frames.bound and frames.source != "program"):
            frames.from_machine[:3] = [True] * 3  # not known until X, Y and Z are named
            return
        from toolpath_stiff.nc.posted.program import switched

        length = self.tool_length
        if math.isnan(length):
            length = (self.tools or {}).get(self.tool, ToolEntry(self.tool)).length
        position = switched(frames, length, hold)
        if any(map(math.isnan, position)):
            raise self.fail(word, "with a tilted head needs the tool's length", hint="add it to the tool table")
        frames.position = position

    def _table_length(self, word: Word) -> float:
        """Length of the tool that G43 names by H, or of the one in the spindle."""
        number = self.take("H")
        if number == 0:
            if self.dialect.increments:
                return math.nan
            raise self.fail(self.values["H"], "is no offset on some controls, on LinuxCNC that of its tool", "H or G49")
        tool = self.tool if number is None else int(number)
        if number is None and self.renamed:
            raise self.fail(
                word, "without H after M61: controls differ in whose length it takes", f"G43 H{tool}, or T and M6"
            )
        if number is not None and (number < 0 or number != int(number)):
            raise self.fail(self.values["H"], "is no tool number", "a whole number")
        if self.tools is None:
            raise self.fail(
                word, f"needs the length of tool {tool}, and there is no tool table", hint="give one with --tools FILE"
            )
        if tool not in self.tools or math.isnan(self.tools[tool].length):
            raise self.fail(word, f"needs the length of tool {tool}", hint="add it to the tool table (--tools FILE)")
        return self.tools[tool].length

    # -- codes that act once -------------------------------------------------------------------------------------

    def _once(self, codes: Codes) -> None:
        takers = [(c, w) for c, w in codes.once if c in USES_AXES]
        rotation = codes.groups.get("rotation")
        if rotation is not None and rotation[0] == "G68":
            takers.append(rotation)
        length = codes.groups.get("tool length")
        if length is not None and length[0] == "G43.1":  # LinuxCNC would move to that Z too
            takers.append(length)
        moving = codes.groups.get(MOTION)
        if len(takers) > 1 or (takers and moving and moving[0] != "G80"):
            other = moving[0] if moving and len(takers) == 1 else takers[0][0]
            raise self.fail(takers[-1][1], f"and {other} both want the axis words of their block", "two blocks")
        if rotation is not None:
            self._rotate(*rotation)
        for code, word in codes.once:
            if code == "G10":
                self._g10(word)
            elif code in ("G28", "G30"):
                self._go_home(code, word)
            elif code in ("G28.1", "G30.1"):
                self._know_position(word, range(6))
                home = self.frames.offsets.home_g28 if code == "G28.1" else self.frames.offsets.home_g30
                home[:] = self.frames.machine_position()
            elif code in ("G92", "G52"):
                self._shift(code, word)
            elif code in ("G92.1", "G92.2", "G92.3"):
                self._g92_state(code, word)

    # -- motion ----------------------------------------------------------------------------------------------------

    def _move(self, codes: Codes) -> None:
        given = codes.groups.get(MOTION)
        machine_word = next((w for c, w in codes.once if c == "G53"), None)
        if given is not None:
            if given[0] != self.motion and given[0] in CYCLES:
                kept = ("level", "unit") if self.motion in CYCLES else ()
                self.sticky = {name: self.sticky[name] for name in kept if name in self.sticky}
            self.motion = None if given[0] == "G80" else given[0]
        axes = any(self.has(letter) for letter in POINT_WORDS)
        if self.motion is None:
            if axes:
                first = next(self.values[a] for a in POINT_WORDS if self.has(a))
                raise self.fail(first, "has no motion mode to move in", "G0, G1, G2, G3 or a cycle before it")
            if machine_word:
                raise self.fail(machine_word, "without G0 or G1")
            return
        if machine_word is not None:
            self._machine_move(machine_word)
        elif self.motion in ("G0", "G1") and axes:
            words = self._point_words()
            target = self._control_point(self.frames.to_program(self.frames.position), words)
            self._straight(RAPID if self.motion == "G0" else FEED, target, set(words))
        elif self.motion in ARCS and (axes or any(self.has(c) for c in "IJKR") or given):
            self._arc()
        elif self.motion in CYCLES and (axes or given):
            self._cycle(given is not None)
        elif given is not None and self.motion == "G1" and self.height_lost:  # rs274 moves then
            self._find_height(FEED, named=False)

    def _machine_move(self, word: Word) -> None:
        """G53: the axis words are machine coordinates, for this block only."""
        if self.motion not in ("G0", "G1"):
            raise self.fail(word, f"with {self.motion}", "G0 or G1")
        if not self.absolute:
            raise self.fail(word, "in incremental mode (G91)", "G90")
        words = self._axis_words()
        if any(axis > 2 for axis in words) and any(self.frames.origin[3:]):
            raise self.fail(word, "with rotary axes, while the work is turned", "X, Y, Z alone")
        if words:
            self._leave_program_coordinates(word, words)
        point = self.frames.machine_position()
        for axis, value in words.items():
            point[axis] = value
        motion = RAPID if self.motion == "G0" else FEED
        self._straight(motion, self.frames.control_of_machine(point), set(), machine=set(words))
