"""Variables of parametric programs: local, common and named ones, and numbered ones of the control.

RS274/NGC: LinuxCNC's manual, "Parameters" ("Numbered Parameters", "Subroutine Parameters", "Named Parameters",
"Predefined Named Parameters"). Macro B: Fanuc's operator's manuals, "Custom macro" ("Variables", "System variables");
Haas, mill operator's manual, "Macros". Variables on which a path can depend are read: the position, the modal state,
work offsets and tool lengths where they are in units that the program states. The others are refused by number.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from toolpath_stiff.nc.codes.motion import know_height
from toolpath_stiff.nc.codes.points import know_place
from toolpath_stiff.nc.parametric.families import EITHER, MACRO_B, NGC
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.tables import FIRST_OFFSET, OFFSET_STRIDE, tool_of
from toolpath_stiff.nc.words import AXES, Block, Word

# Variables that a program may set: NGC's numbered parameters below the control's; Macro B's locals and commons.
LOCALS = {NGC: 30, MACRO_B: 33, EITHER: 30}
NGC_LAST = 5000
DEBUG_SWITCH = 5599  # if set, (DEBUG,...) comments print
COMMON = (range(100, 200), range(500, 1000))  # Fanuc's series 16 to 31i, Haas; the second survive power-off
NGC_POSITION, NGC_TOOL, NGC_OFFSET = 5420, 5400, 5220
MACRO_POSITIONS = (5001, 5041)  # block end; present position, with the tool length: the same without one
TOOL_LENGTHS = range(2001, 2201)  # Fanuc's memory A and Haas: geometry of the length of H1 to H200
LAST_WORK_OFFSET = 6  # G54 to G59 in Macro B's numbers, which are those of LinuxCNC's parameters
MODAL = range(4001, 4121)
ALARM, WITHOUT_PATH = 3000, (3003, 3004, 3006)

Which = str | int  # a variable: its name or its number
Values = dict[Which, float | None]


@dataclass
class Variables:
    """All variables of a run.

    Attributes
    ----------
    family
        `NGC`, `MACRO_B`, or `EITHER` where the program shows no sign of one.
    state
        Of the control.
    levels
        Local variables, the running call's last.
    common
        Those of all calls.
    line
        Of the block that runs, for `#<_line>`.
    """

    family: str
    state: State
    levels: list[Values] = field(default_factory=lambda: [{}])
    common: Values = field(default_factory=dict)
    line: int = 0

    def get(self, which: Which, place: Place) -> float | None:
        """The value of a variable; None: empty. Raises `InputError` for a variable of unknown value."""
        scope = self._scope(which)
        if scope is not None and which in scope:
            return scope[which]
        if isinstance(which, int):
            kept = scope is not None or (which == 0 and self.family != NGC)
            return self._unset(which, place) if kept else self._system(which, place)
        if which in PREDEFINED:
            return PREDEFINED[which](self)
        problem = f"the variable #<{which.lower()}> is read before it is set"
        raise place.fail(problem, "it in the same subprogram before; not #<_task>, which a preview has otherwise")

    def exists(self, name: str) -> bool:
        """True if a named variable has a value."""
        return name in PREDEFINED or name in (self._scope(name) or ())

    def _scope(self, which: Which) -> Values | None:
        """The dictionary that holds a variable which a program may set; None for a variable of the control."""
        if isinstance(which, str):
            return self.common if which.startswith("_") else self.levels[-1]
        if 1 <= which <= LOCALS[self.family]:
            return self.levels[-1]
        return self.common if self._settable(which) else None

    def _unset(self, number: int, place: Place) -> float | None:
        if self.family == NGC:
            if number > LOCALS[NGC]:
                self.state.assume(f"#{number} is read before it is set: 0, as in an empty parameter file")
            return 0.0
        if number and (self.family == EITHER or number in COMMON[1]):  # these may keep values from earlier programs
            reason = "0 on LinuxCNC and empty on Fanuc's and Haas' controls, which keep those from #500 on"
            raise place.fail(f"#{number} is read before it is set: {reason}", f"#{number}=... before, or --dialect")
        return None

    def _system(self, number: int, place: Place) -> float:
        """The value of a system variable, one that the control itself sets."""
        if self.family == EITHER:
            problem = f"#{number} has another meaning on LinuxCNC than on Fanuc's and Haas' controls"
            raise place.fail(problem, hint="name it with --dialect")
        value = (self._ngc_system if self.family == NGC else self._macro_system)(number, place)
        if value is None:
            problem = f"#{number} is a parameter of the control that is not known here, or in a unit of the machine's"
            raise place.fail(problem, hint="put the number into the program")
        return value

    def _settable(self, number: int) -> bool:
        """True if a program may set this numbered variable, which is above the local ones."""
        macro = any(number in numbers for numbers in COMMON)
        ngc = LOCALS[NGC] < number <= NGC_LAST or number == DEBUG_SWITCH
        if self.family == EITHER:
            return (ngc and macro) or number == DEBUG_SWITCH
        return ngc if self.family == NGC else macro

    def set(self, which: Which, value: float | None, place: Place) -> None:
        """Set a variable. Raises `InputError` for one that a program cannot set."""
        if which in PREDEFINED:
            raise place.fail(f"#<{str(which).lower()}> is the control's own", "another name")
        scope = self._scope(which)
        if scope is not None:
            scope[which] = value
        elif self.family == MACRO_B and which in WITHOUT_PATH:
            word = Word("#", 0.0, place.column or 1, f"#{which}")
            self.state.note(place.line, word, "single block, feed hold or a message: the path does not depend on it")
        elif self.family == MACRO_B and which == ALARM:
            raise place.fail(f"the program stops with its alarm {value or 0.0:g} (#3000)", "no alarm")
        else:
            known = f"#31 to #{NGC_LAST}" if self.family == NGC else "#1 to #33, #100 to #199, #500 to #999"
            raise place.fail(f"#{which} cannot be set here", f"{known}; G10 for work offsets and tool lengths")

    def angle(self, y: float, x: float) -> float:
        """ATAN[y]/[x], degrees: -180 to 180 on LinuxCNC, 0 to 360 on Fanuc's (parameter 6004, NAT = 0)."""
        degrees = float(f"{math.degrees(math.atan2(y, x)):.14g}")  # as `expressions.trimmed`
        if degrees >= 0.0 or self.family == NGC:
            return degrees
        if self.state.dialect.name == "fanuc":
            self.state.assume("ATAN gives 0 to 360 degrees (parameter 6004, bit 0, is 0)")
            return degrees + 360.0
        raise ValueError("controls differ in angles below 0: name the control with --dialect")

    def position(self, axis: int, shown: str, place: Place) -> float:
        """The present point in program coordinates and units; refused where controls may differ in it."""
        state, frames = self.state, self.state.frames
        word = Word("#", 0.0, place.column or 1, shown)
        block = CurrentBlock(place.name, Block(place.line, (word,)))
        if axis == 2:
            know_height(state, block, word)
        if axis < 2:
            know_place(state, block, word)
        if state.cutter is not None:
            raise block.fail(word, "depends on the present point while cutter compensation is on", "G40 before it")
        if frames.from_machine[axis]:
            problem = "depends on where program zero sits on the machine"
            raise block.fail(word, problem, "a move to program coordinates before")
        value = frames.to_program(frames.position)[axis]
        return value / state.length_scale if axis < 3 else value

    def _ngc_system(self, number: int, place: Place) -> float | None:
        if NGC_POSITION <= number < NGC_POSITION + 6:
            return self.position(number - NGC_POSITION, f"#{number}", place)
        return {NGC_TOOL: float(self.state.tool), NGC_OFFSET: float(self.state.frames.active + 1)}.get(number)

    def _macro_system(self, number: int, place: Place) -> float | None:
        state, (end, present) = self.state, MACRO_POSITIONS
        if end <= number < end + 6:
            return self.position(number - end, f"#{number}", place)
        if present <= number < present + 6 and (number != present + 2 or not state.frames.tool):
            return self.position(number - present, f"#{number}", place)
        if number in TOOL_LENGTHS:
            length = tool_of(state.tools, number - TOOL_LENGTHS.start + 1).length
            return None if math.isnan(length) else length / state.length_scale
        offset, axis = divmod(number - FIRST_OFFSET, OFFSET_STRIDE)  # #5221 to #5326
        if 0 <= offset < LAST_WORK_OFFSET and axis < len(AXES):
            work_offset = state.frames.offsets.table[offset]
            value = work_offset.axes[axis] / (state.length_scale if axis < 3 else 1.0)
            return value if work_offset.given else None
        return self._modal(number) if number in MODAL else None

    def _modal(self, number: int) -> float | None:
        """#4001 to #4120: the modal state before this block, by Fanuc's groups of G codes, then by letters."""
        state = self.state
        cycle = state.motion is not None and state.motion not in ("G0", "G1", "G2", "G3")
        group_values: dict[int, float | None] = {
            1: None if cycle or state.motion is None else float(state.motion[1:]),
            2: float(state.plane[1:]),
            3: 90.0 if state.absolute else 91.0,
            5: float(state.feed_mode[1:]),
            6: 20.0 if state.inch else 21.0,
            7: 40.0,
            9: float((state.motion or "G80")[1:]) if cycle else 80.0,
            10: float(state.retract[1:]) if state.retract else None,
            14: 54.0 + state.frames.active if state.frames.active < LAST_WORK_OFFSET else None,
            109: 0.0 if state.feed is None else state.feed / state.feed_scale,
            119: state.speed,
            120: float(state.selected),
        }
        return group_values.get(number - 4000)


def _axis(axis: int) -> Callable[[Variables], float]:
    shown = f"#<_{AXES[axis].lower()}>"
    return lambda variables: variables.position(axis, shown, Place(variables.state.name, variables.line, 1))


def _plain(read: Callable[[State], float]) -> Callable[[Variables], float]:
    return lambda variables: float(read(variables.state))


# LinuxCNC's predefined named parameters that a path can depend on.
PREDEFINED: dict[str, Callable[[Variables], float]] = {
    **{f"_{letter}": _axis(axis) for axis, letter in enumerate(AXES)},
    **dict.fromkeys(("_VALUE", "_VALUE_RETURNED"), lambda variables: 0.0),  # before any call has returned
    "_LINE": lambda variables: float(variables.line),
    "_CALL_LEVEL": lambda variables: float(len(variables.levels) - 1),
    "_REMAP_LEVEL": lambda variables: 0.0,
    "_MOTION_MODE": _plain(lambda state: round(10.0 * float((state.motion or "G-1")[1:]))),  # -10: none
    "_PLANE": _plain(lambda state: 10.0 * float(state.plane[1:])),
    "_METRIC": _plain(lambda state: not state.inch),
    "_IMPERIAL": _plain(lambda state: state.inch),
    "_ABSOLUTE": _plain(lambda state: state.absolute),
    "_INCREMENTAL": _plain(lambda state: not state.absolute),
    "_INVERSE_TIME": _plain(lambda state: state.feed_mode == "G93"),
    "_UNITS_PER_MINUTE": _plain(lambda state: state.feed_mode == "G94"),
    "_UNITS_PER_REV": _plain(lambda state: state.feed_mode == "G95"),
    "_IJK_ABSOLUTE_MODE": _plain(lambda state: state.arc_absolute),
    "_FEED": _plain(lambda state: (state.feed or 0.0) / state.feed_scale),
    "_RPM": _plain(lambda state: state.speed),
    "_CURRENT_TOOL": _plain(lambda state: state.tool),
    "_SELECTED_TOOL": _plain(lambda state: state.selected),
}
