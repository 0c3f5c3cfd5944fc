"""Blocks to moves: modal state, work offsets, tool lengths, arcs, cycles. mm, degrees, mm/min inside.

Order of execution within a block and start-up state are LinuxCNC's (manual, "G-Code overview"). Every word of a block
is taken by something, or it is an error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc import arcs
from toolpath_stiff.nc.codes import (
    ARCS,
    CYCLES,
    G_GROUPS,
    G_HARMLESS,
    G_REFUSED,
    M_GROUPS,
    M_HARMLESS,
    M_QUIET,
    M_REFUSED,
    MOTION,
    ONCE,
    WORK_OFFSETS,
    code_name,
)
from toolpath_stiff.nc.cycles import SAME_HEIGHT_MM, Drilling, strokes
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.moves import ARC, CYCLE, FEED, RAPID, ToolUse, Unsupported
from toolpath_stiff.nc.recorder import Arc, Recorder
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import Block, Word
from toolpath_stiff.units import MM_PER_INCH, m_from_mm

AXES = "XYZABC"
LINEAR = frozenset("XYZ")
USES_AXES = ("G10", "G28", "G30", "G52", "G92")  # non-modal codes that take the axis words of their block
FARTHEST_MM = 1e5  # 100 m: a coordinate beyond is a slip of unit or key
SECONDS_PER_DAY = 86400.0


@dataclass
class Codes:
    """G and M codes of one block, by modal group, each with its word."""

    groups: dict[str, tuple[str, Word]] = field(default_factory=dict)
    once: list[tuple[str, Word]] = field(default_factory=list)

    def get(self, group: str) -> str | None:
        """The code of a group, if the block has one."""
        found = self.groups.get(group)
        return found[0] if found else None


class Interpreter:
    """Executes blocks in order; `recorder` holds the moves found so far."""

    def __init__(self, name: str, frames: Frames, tools: dict[int, ToolEntry] | None) -> None:
        self.name, self.frames, self.tools = name, frames, tools
        self.recorder = Recorder()
        self.unsupported: list[Unsupported] = []
        self.warnings: list[str] = []
        self.assumptions: list[str] = []
        self.used_tools: dict[int, ToolUse] = {}
        self.motion: str | None = None
        self.plane, self.feed_mode = "G17", "G94"
        self.retract: str | None = None  # G98 or G99, once said; LinuxCNC starts as in G99
        self.absolute, self.arc_absolute, self.inch = True, False, False
        self.feed: float | None = None
        self.speed = 0.0
        self.tool, self.selected = 0, 0
        self.tool_length = math.nan
        self.sticky: dict[str, float] = {}
        self.values: dict[str, Word] = {}
        self.free: set[str] = set()
        self.block = Block(0, ())

    # -- one block ---------------------------------------------------------------------------------------------

    def execute(self, block: Block) -> bool:
        """Execute a block; False once the program has ended."""
        self.block = block
        if not block.words:
            return True
        codes = self._collect(block)
        self._modes(codes)
        self._once(codes)
        self._move(codes)
        for letter in sorted(self.free):
            raise self.fail(self.values[letter], "is not used by any code of its block", hint="remove it")
        return codes.get("M stop") not in ("M2", "M30")

    def fail(self, word: Word | None, found: str, expected: str = "", hint: str = "") -> InputError:
        """An error at a word of the block, or at the block."""
        text = f"{word.text} {found}" if word else found
        column = word.column if word else self.block.words[0].column
        return InputError(text, expected=expected, hint=hint, file=self.name, line=self.block.line, column=column)

    def _collect(self, block: Block) -> Codes:
        """Sort the words; repeated words and two codes of one group are errors."""
        codes = Codes()
        self.values = {}
        for word in block.words:
            if word.letter == "G":
                self._collect_g(codes, word)
            elif word.letter == "M":
                self._collect_m(codes, word)
            elif word.letter == "O":
                self._note(word, "program number")
            elif word.letter in self.values:
                raise self.fail(word, f"repeats the word {word.letter} of its block", "each word once")
            else:
                self.values[word.letter] = word
        self.free = set(self.values)
        for letter in ("U", "V", "W"):
            if letter in self.values:
                raise self.fail(self.values[letter], "moves an axis that this machine does not have", "X Y Z A B C")
        for letter in AXES:
            if letter in self.values and abs(self.values[letter].value) > FARTHEST_MM:
                raise self.fail(self.values[letter], "is beyond 100 m", f"at most {FARTHEST_MM:g}")
        return codes

    def _collect_g(self, codes: Codes, word: Word) -> None:
        code = code_name("G", word.value)
        if code in G_REFUSED:
            what, hint = G_REFUSED[code]
            raise self.fail(word, f"is {what}, which is not supported", hint=hint)
        group = G_GROUPS.get(code)
        if group is None:
            raise self.fail(word, "is not a G code that is known", hint="check the program, or post it without it")
        if code in G_HARMLESS:
            self._note(word, G_HARMLESS[code])
        if group == ONCE:
            if any(code == other for other, _ in codes.once):
                raise self.fail(word, "appears twice in its block")
            codes.once.append((code, word))
            return
        if group in codes.groups:
            other = codes.groups[group][0]
            # `G0 G17 G40 G49 G80 G90`, the usual first block: G80 ends a cycle, the other code says what follows.
            if code == "G80" and other != "G80":
                return
            if other != "G80" or code == "G80":
                raise self.fail(word, f"and {other} are both of the modal group {group!r}", "one of them in a block")
        codes.groups[group] = (code, word)

    def _collect_m(self, codes: Codes, word: Word) -> None:
        code = code_name("M", word.value)
        if code in M_REFUSED:
            what, hint = M_REFUSED[code]
            raise self.fail(word, f"is {what}, which is not supported", hint=hint)
        group = M_GROUPS.get(code)
        if group is not None:
            key = f"M {group}"
            if key in codes.groups:
                other = codes.groups[key][0]
                raise self.fail(word, f"and {other} are both of the modal group {group!r}", "one of them in a block")
            codes.groups[key] = (code, word)
        if code not in M_QUIET:
            reason = M_HARMLESS.get(code, "an M code of one control, not acted upon")
            self._note(word, reason)
            if code not in M_HARMLESS:  # it may run anything, a change of kinematics included
                self.warnings.append(f"line {self.block.line}: what {word.text} does on its control is not known")
            if group is None:  # its parameters, whatever they are, go with it
                self.values_of_unknown(word)

    def values_of_unknown(self, word: Word) -> None:
        """P, Q, E, R words of a block with an unknown M code belong to it."""
        for other in self.block.words:
            if other.letter in "PQE":
                self._note(other, f"parameter of {word.text}")

    def _note(self, word: Word, reason: str) -> None:
        self.unsupported.append(Unsupported(self.block.line, word.column, word.text, reason))

    def _assume(self, sentence: str) -> None:
        if sentence not in self.assumptions:
            self.assumptions.append(sentence)

    def take(self, letter: str) -> float | None:
        """The value of a word, which is thereby used; None if the block has none."""
        if letter not in self.free:
            return None
        self.free.discard(letter)
        return self.values[letter].value

    def has(self, letter: str) -> bool:
        """Whether the block has that word, not used yet."""
        return letter in self.free

    # -- modes ---------------------------------------------------------------------------------------------------

    def _modes(self, codes: Codes) -> None:
        """Everything modal, in LinuxCNC's order; units first, so that an F beside G20 is in inches."""
        units = codes.get("units")
        if units is not None:
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
        plane = codes.get("plane")
        if plane is not None:
            self.plane = plane
        self._tool_length(codes)
        offset = codes.get("work offset")
        if offset is not None:
            self.frames.active = WORK_OFFSETS.index(offset)
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

    def _drop_m_parameters(self, codes: Codes) -> None:
        """M codes may carry P, Q, E words; unless the block moves, these are theirs."""
        moves = codes.get(MOTION) is not None or codes.once or any(self.has(a) for a in AXES)
        if not moves:
            for letter in "PQERS":
                self.take(letter)

    def _feed_and_speed(self) -> None:
        feed = self.take("F")
        if feed is not None:
            word = self.values["F"]
            if feed < 0.0:
                raise self.fail(word, "is a negative feed", "F above 0")
            scale = MM_PER_INCH if self.inch and self.feed_mode != "G93" else 1.0
            self.feed = feed * scale if feed > 0.0 else None
        speed = self.take("S")
        if speed is not None:
            if speed < 0.0:
                raise self.fail(self.values["S"], "is a negative speed", "S of 0 or more")
            self.speed = speed

    def _tools(self, codes: Codes) -> None:
        number = self.take("T")
        if number is not None:
            self.selected = int(number)
        change = codes.get("M tool change")
        if change == "M61":
            chosen = self.take("Q")
            if chosen is None or chosen < 0 or chosen != int(chosen):
                raise self.fail(codes.groups["M tool change"][1], "needs the tool number", "Q with a whole number")
            self.selected = int(chosen)
        if change is not None:
            self.tool = self.selected

    def _dwell(self, word: Word) -> None:
        seconds = self.take("P")
        if seconds is None or not 0.0 <= seconds <= SECONDS_PER_DAY:
            raise self.fail(word, "needs its time", "P with the seconds, 0 or more")
        self.recorder.add_dwell(seconds)

    def _tool_length(self, codes: Codes) -> None:
        code = codes.get("tool length")
        if code is None:
            return
        word = codes.groups["tool length"][1]
        if code == "G49":
            length = math.nan
        elif code == "G43.1":
            value = self.take("Z")
            if value is None or any(self.has(axis) for axis in "XYABC"):
                raise self.fail(word, "with other words than Z", "Z with the tool length")
            length = value * self._scale
        else:
            length = self._table_length(word)
        self.tool_length = length
        self.frames.set_tool(0.0 if math.isnan(length) else length)

    def _table_length(self, word: Word) -> float:
        """Length of the tool that G43 names by H, or of the one in the spindle."""
        number = self.take("H")
        tool = self.tool if number is None else int(number)
        if number is not None and (number < 0 or number != int(number)):
            raise self.fail(self.values["H"], "is no tool number", "a whole number")
        if self.tools is None:
            raise self.fail(
                word, f"needs the length of tool {tool}, and there is no tool table", hint="give one with --tools FILE"
            )
        if tool not in self.tools or math.isnan(self.tools[tool].length):
            raise self.fail(word, f"needs the length of tool {tool}", hint="add it to the tool table (--tools FILE)")
        return self.tools[tool].length

    @property
    def _scale(self) -> float:
        """Millimetres of one length unit of the program."""
        return MM_PER_INCH if self.inch else 1.0

    # -- codes that act once -------------------------------------------------------------------------------------

    def _once(self, codes: Codes) -> None:
        takers = [(c, w) for c, w in codes.once if c in USES_AXES]
        moving = codes.groups.get(MOTION)
        if len(takers) > 1 or (takers and moving and moving[0] != "G80"):
            other = moving[0] if moving and len(takers) == 1 else takers[0][0]
            raise self.fail(takers[-1][1], f"and {other} both want the axis words of their block", "two blocks")
        for code, word in codes.once:
            if code == "G10":
                self._g10(word)
            elif code in ("G28", "G30"):
                self._go_home(code)
            elif code in ("G28.1", "G30.1"):
                home = self.frames.offsets.home_g28 if code == "G28.1" else self.frames.offsets.home_g30
                home[:] = self.frames.machine_position()
            elif code in ("G92", "G52"):
                self._shift(code, word)
            elif code in ("G92.1", "G92.2", "G92.3"):
                self._g92_state(code)

    def _axis_words(self) -> dict[int, float]:
        """Axis index -> value of the block's axis words in mm and degrees; they are thereby used."""
        found = {}
        for index, letter in enumerate(AXES):
            value = self.take(letter)
            if value is not None:
                found[index] = value * self._scale if letter in LINEAR else value
        return found

    def _g10(self, word: Word) -> None:
        level, number = self.take("L"), self.take("P")
        if level == 1:
            self._g10_tool(word, number)
            return
        if level not in (2, 20):
            raise self.fail(word, f"with L{level:g}" if level is not None else "without L", "L2, L20 (offsets) or L1")
        if number is None or number != int(number) or not 0 <= number <= len(WORK_OFFSETS):
            raise self.fail(word, "needs the work offset", f"P0 (the active one) or P1 to P{len(WORK_OFFSETS)}")
        index = self.frames.active if number == 0 else int(number) - 1
        offset = self.frames.offsets.table[index]
        rotation = self.take("R")
        if rotation is not None:
            if level == 20:
                raise self.fail(self.values["R"], "does not go with L20", "L2")
            offset.rotation = rotation
        words = self._axis_words()
        if level == 20:
            self._offset_from_here(index, words)
        else:
            for axis, value in words.items():
                offset.axes[axis] = value
        offset.given = True

    def _offset_from_here(self, index: int, words: dict[int, float]) -> None:
        """L20: choose the offset so that the present point gets these coordinates."""
        frames = self.frames
        active, frames.active = frames.active, index
        here = frames.to_program(frames.position)
        wanted = [words.get(axis, here[axis]) for axis in range(6)]
        shift = [c - w for c, w in zip(frames.position, frames.to_control(wanted), strict=True)]
        frames.active = active
        for axis in range(6):
            frames.offsets.table[index].axes[axis] += shift[axis]

    def _g10_tool(self, word: Word, number: float | None) -> None:
        if number is None or number != int(number) or number < 0:
            raise self.fail(word, "needs the tool number", "P with a whole number")
        words = self._axis_words()
        radius = self.take("R")
        if any(axis != 2 for axis in words):
            raise self.fail(word, "sets other tool offsets than Z", "Z, the tool's length")
        self.tools = {} if self.tools is None else self.tools
        tool = self.tools.setdefault(int(number), ToolEntry(int(number)))
        tool.length = words.get(2, tool.length)
        tool.diameter = tool.diameter if radius is None else 2.0 * radius * self._scale

    def _go_home(self, code: str) -> None:
        """G28, G30: rapid to the intermediate point, then the axes named there, or all, to the reference point."""
        words = self._axis_words()
        if words:
            self._straight(RAPID, self._target(words), set(words))
        home = self.frames.offsets.home_g28 if code == "G28" else self.frames.offsets.home_g30
        if not any(home):
            self._assume(f"the reference point of {code}, not given by any offsets file, is machine 0, 0, 0")
        going = set(words) or set(range(6))
        # Axis by axis in program coordinates, as LinuxCNC does: with a rotation in force it is not the same.
        frames = self.frames
        there = frames.to_program(frames.control_of_machine(list(home)))
        here = frames.to_program(frames.position)
        point = [there[axis] if axis in going else here[axis] for axis in range(6)]
        self._straight(RAPID, frames.to_control(point), set(), machine=going)

    def _shift(self, code: str, word: Word) -> None:
        words = self._axis_words()
        if not words:
            raise self.fail(word, "without axis words", "X, Y, Z, A, B or C")
        frames = self.frames
        if code == "G52":
            for axis, value in words.items():
                frames.g92[axis] = value
        else:
            here = frames.to_program(frames.position)
            for axis, value in words.items():
                frames.g92[axis] += here[axis] - value
        frames.g92_kept = list(frames.g92)

    def _g92_state(self, code: str) -> None:
        frames = self.frames
        if code == "G92.3":
            frames.g92 = list(frames.g92_kept)
            return
        frames.g92 = [0.0] * 6
        if code == "G92.1":
            frames.g92_kept = [0.0] * 6

    # -- motion ----------------------------------------------------------------------------------------------------

    def _move(self, codes: Codes) -> None:
        given = codes.groups.get(MOTION)
        machine_word = next((w for c, w in codes.once if c == "G53"), None)
        if given is not None:
            if given[0] != self.motion and given[0] in CYCLES:
                level = self.sticky.get("level") if self.motion in CYCLES else None
                self.sticky = {} if level is None else {"level": level}
            self.motion = None if given[0] == "G80" else given[0]
        axes = any(self.has(letter) for letter in AXES)
        if self.motion is None:
            if axes:
                first = next(self.values[a] for a in AXES if self.has(a))
                raise self.fail(first, "has no motion mode to move in", "G0, G1, G2, G3 or a cycle before it")
            if machine_word:
                raise self.fail(machine_word, "without G0 or G1")
            return
        if machine_word is not None:
            self._machine_move(machine_word)
        elif self.motion in ("G0", "G1") and axes:
            words = self._axis_words()
            target = self._target(words)
            self._straight(RAPID if self.motion == "G0" else FEED, target, set(words))
        elif self.motion in ARCS and (axes or any(self.has(c) for c in "IJKR") or given):
            self._arc()
        elif self.motion in CYCLES and (axes or given):
            self._cycle(given is not None)
        elif given is None and not axes:
            return

    def _target(self, words: dict[int, float]) -> list[float]:
        """Control coordinates of the axis words' point in the distance mode in force."""
        point = self.frames.to_program(self.frames.position)
        for axis, value in words.items():
            point[axis] = value if self.absolute else point[axis] + value
        return self.frames.to_control(point)

    def _machine_move(self, word: Word) -> None:
        """G53: the axis words are machine coordinates, for this block only."""
        if self.motion not in ("G0", "G1"):
            raise self.fail(word, f"with {self.motion}", "G0 or G1")
        if not self.absolute:
            raise self.fail(word, "in incremental mode (G91)", "G90")
        words = self._axis_words()
        if any(axis > 2 for axis in words) and any(self.frames.origin[3:]):
            raise self.fail(word, "with rotary axes, while the work is turned", "X, Y, Z alone")
        point = self.frames.machine_position()
        for axis, value in words.items():
            point[axis] = value
        motion = RAPID if self.motion == "G0" else FEED
        self._straight(motion, self.frames.control_of_machine(point), set(), machine=set(words))

    def _straight(
        self, motion: int, control: list[float], work: set[int], machine: set[int] | None = None, dwell: float = 0.0
    ) -> None:
        """A straight move to a point in control coordinates; `work`, `machine`: axes that were given in each."""
        self._record(motion, control, work, machine or set(), None)
        if dwell:
            self.recorder.add_dwell(dwell)

    def _record(self, motion: int, control: list[float], work: set[int], machine: set[int], arc: Arc | None) -> None:
        frames = self.frames
        start, was = frames.to_setup(frames.position), any(frames.from_machine)
        for axis in work:
            frames.from_machine[axis] = False
        for axis in machine:
            frames.from_machine[axis] = True
        end = frames.to_setup(control)
        # An axis that was not asked to move keeps its number to the last digit, whatever the frames' sums say.
        for axis in range(6):
            if abs(end[axis] - start[axis]) < 1e-12 * max(1.0, abs(start[axis])):
                end[axis] = start[axis]
        feed = math.nan if motion == RAPID else self._feed_of(start, end, arc)
        added = self.recorder.add(
            self.block.line,
            motion,
            start,
            end,
            feed,
            self.tool,
            self.tool_length,
            (was, any(frames.from_machine)),
            arc,
        )
        frames.position = control
        if added and self.tool not in self.used_tools:
            self._use_tool()

    def _use_tool(self) -> None:
        entry = (self.tools or {}).get(self.tool, ToolEntry(self.tool))
        self.used_tools[self.tool] = ToolUse(
            self.tool, m_from_mm(entry.length), m_from_mm(entry.diameter), entry.remark
        )

    def _feed_of(self, start: list[float], end: list[float], arc: Arc | None) -> float:
        """Feed of a move in mm/min, or deg/min for one of the rotary axes alone."""
        if self.feed is None:
            words = [w for w in self.block.words if w.letter == "G"]
            raise self.fail(
                words[0] if words else self.block.words[0],
                "is a feed move before any feed" if self.feed_mode != "G93" else "is a feed move without F under G93",
                "F above 0",
            )
        linear = math.dist(start[:3], end[:3])
        if arc is not None:
            linear = max(linear, abs(arc.sweep) * math.dist(start[:3], arc.center))
        turn = max(abs(e - s) for s, e in zip(start[3:], end[3:], strict=True))
        if self.feed_mode == "G93":
            feed, self.feed = self.feed, None  # every move needs its own
            return feed * (linear if linear > 0.0 else turn)
        if self.feed_mode == "G95":
            if self.speed == 0.0:
                raise self.fail(None, "feed per revolution (G95) with the spindle at S0", "S above 0")
            return self.feed * self.speed
        if linear == 0.0:
            return self.feed / (MM_PER_INCH if self.inch else 1.0)  # degrees are degrees in inch programs too
        return self.feed

    # -- arcs --------------------------------------------------------------------------------------------------------

    def _arc(self) -> None:
        first, second, normal = arcs.PLANES[self.plane]
        clockwise = self.motion == "G2"
        frames = self.frames
        here = frames.to_program(frames.position)
        words = self._axis_words()
        target = list(here)
        for axis, value in words.items():
            target[axis] = value if self.absolute else here[axis] + value
        start, end = (here[first], here[second]), (target[first], target[second])
        turns = self._turns()
        try:
            center = self._arc_center(start, end, clockwise, words, first, second, normal)
            arcs.check_radii(start, end, center)
        except arcs.ArcError as error:
            raise self.fail(None, error.found, error.expected) from None
        sweep = arcs.arc_sweep(start, end, center, clockwise, turns)
        middle = list(here)
        middle[first], middle[second] = center
        axis_vector = [0.0, 0.0, 0.0]
        axis_vector[normal] = 1.0
        x, y, z = frames.to_setup(frames.to_control(middle))[:3]
        turned = frames.turn_direction((axis_vector[0], axis_vector[1], axis_vector[2]))
        self._record(ARC, frames.to_control(target), set(words), set(), Arc((x, y, z), turned, sweep))

    def _turns(self) -> int:
        turns = self.take("P")
        if turns is None:
            return 1
        if turns != int(turns) or not 1 <= turns <= 10000:
            raise self.fail(self.values["P"], "is no number of turns", "a whole number from 1")
        return int(turns)

    def _arc_center(
        self,
        start: arcs.Point2,
        end: arcs.Point2,
        clockwise: bool,
        words: dict[int, float],
        first: int,
        second: int,
        normal: int,
    ) -> arcs.Point2:
        radius = self.take("R")
        off_plane = arcs.CENTER_WORDS[normal]
        in_plane = (arcs.CENTER_WORDS[first], arcs.CENTER_WORDS[second])
        if self.has(off_plane):
            raise self.fail(self.values[off_plane], f"is off the plane {self.plane}", " and ".join(sorted(in_plane)))
        offsets = [self.take(letter) for letter in in_plane]
        if radius is not None:
            if offsets != [None, None]:
                raise self.fail(self.values["R"], "and a centre (I, J, K) are both given", "one of them")
            if not {first, second} & words.keys():
                raise arcs.ArcError("an arc with R and without an end point", "an axis word of the plane")
            return arcs.center_from_radius(start, end, radius * self._scale, clockwise)
        if offsets == [None, None]:
            raise arcs.ArcError("an arc without a centre", f"{in_plane[0]}, {in_plane[1]} or R")
        if self.arc_absolute:
            if None in offsets:
                raise arcs.ArcError("an absolute centre (G90.1) with one word", f"{in_plane[0]} and {in_plane[1]}")
            center = [v * self._scale for v in offsets if v is not None]
            middle = self.frames.to_program(self.frames.position)
            middle[first], middle[second] = center
            return (middle[first], middle[second])
        return (start[0] + (offsets[0] or 0.0) * self._scale, start[1] + (offsets[1] or 0.0) * self._scale)

    # -- cycles --------------------------------------------------------------------------------------------------------

    def _cycle(self, given: bool) -> None:
        """One block of a canned cycle: its holes, expanded."""
        code = self.motion or ""
        first, second, normal = arcs.PLANES[self.plane]
        repeats = self._repeats()
        for letter in "RQP":
            value = self.take(letter)
            if value is not None:
                self.sticky[letter] = value if letter == "P" else value * self._scale
        words = self._axis_words()
        if not words and given:
            raise self.fail(None, f"{code} without axis words", "X, Y, Z")
        if any(axis > 2 for axis in words):
            raise self.fail(None, f"{code} with rotary axes", "the rotary axes in a block before it")
        if normal in words:
            self.sticky["Z"] = words.pop(normal)
        self._check_cycle(code, normal)
        frames = self.frames
        here = frames.to_program(frames.position)[normal]
        # The level from which a run of cycles began: G91's R counts from it, G98 returns to it.
        initial = self.sticky.setdefault("level", here)
        retract = self.sticky["R"] if self.absolute else self.sticky["R"] + initial
        bottom = self.sticky["Z"] if self.absolute else retract + self.sticky["Z"]
        if retract < bottom:
            raise self.fail(None, f"{code}: R at {retract:g} mm is below the bottom at {bottom:g} mm", "R above it")
        if self.retract is None:
            self._assume("a drilling cycle before any G98 or G99 ends at its R plane (G99), as LinuxCNC starts")
        # As measured on LinuxCNC: a run that began below R goes to R first; otherwise a tool at or below R goes to the
        # level above the holes on its way to the next one.
        if initial < retract:
            self._along_normal(normal, retract, RAPID)
            here = retract
        clear = max(initial, retract) if self.retract == "G98" else retract
        level = here if here > retract + SAME_HEIGHT_MM else clear
        hole = Drilling(code, bottom, retract, clear, self.sticky.get("Q", 0.0), self.sticky.get("P", 0.0))
        for _ in range(repeats):
            place = frames.to_program(frames.position)
            for axis in (first, second):
                if axis in words:
                    place[axis] = words[axis] if self.absolute else place[axis] + words[axis]
            place[normal] = level
            self._straight(RAPID, frames.to_control(place), set(words))
            level = clear
            self._along_normal(normal, retract, RAPID)
            for stroke in strokes(hole):
                self._along_normal(normal, stroke.height, CYCLE if stroke.feed else RAPID, stroke.dwell)

    def _repeats(self) -> int:
        value = self.take("L")
        if value is None:
            return 1
        if value != int(value) or not 1 <= value <= 10000:
            raise self.fail(self.values["L"], "is no number of repeats", "a whole number from 1")
        return int(value)

    def _check_cycle(self, code: str, normal: int) -> None:
        axis = AXES[normal]
        for letter, what in (("Z", axis), ("R", "R")):
            if letter not in self.sticky:
                raise self.fail(None, f"{code} without {what}", f"{what} in the cycle's first block")
        if code in ("G73", "G83") and not self.sticky.get("Q", 0.0) > 0.0:
            raise self.fail(None, f"{code} without a peck", "Q above 0")
        if code in ("G82", "G89"):
            dwell = self.sticky.get("P")
            if dwell is None or not 0.0 <= dwell <= SECONDS_PER_DAY:
                raise self.fail(None, f"{code} without its dwell", "P with the seconds, 0 or more")

    def _along_normal(self, normal: int, height: float, motion: int, dwell: float = 0.0) -> None:
        frames = self.frames
        place = frames.to_program(frames.position)
        if place[normal] != height:
            place[normal] = height
            self._straight(motion, frames.to_control(place), {normal})
        if dwell:
            self.recorder.add_dwell(dwell)
