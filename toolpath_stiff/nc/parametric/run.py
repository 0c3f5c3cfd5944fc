"""Runs a parametric program: goes where O words, GOTO and WHILE lead.

LinuxCNC's manual, "O Codes"; Fanuc's operator's manuals, "Custom macro" ("Macro call", "Branch and repetition").
Bounded: the blocks that run, and calls within calls.
"""

from bisect import bisect_right
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.parametric.expressions import EQUAL, number
from toolpath_stiff.nc.parametric.families import NGC
from toolpath_stiff.nc.parametric.statements import Steering
from toolpath_stiff.nc.parametric.structure import Structure, loops_of, shown, structure_of
from toolpath_stiff.nc.parametric.values import ValuesRun
from toolpath_stiff.nc.program_run import HEAD, Subprogram, Tally, beyond_the_end
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.state import Flow, GoTo

MOST_STEPS = 1_000_000  # blocks that run, all repeats counted
MOST_IDLE = 100_000  # blocks of loops that run without a move between; a program that works out values needs far fewer


class ParametricRun(ValuesRun):
    """A run of a program with variables, and with what steers it."""

    def __init__(self, request: Request, tally: Tally | None = None) -> None:
        super().__init__(request, tally)
        self._structure: Structure | None = None
        self._loops: dict[int, int] | None = None
        self._counts: dict[int, int] = {}  # repeats left in the main program, by line
        self._steps = 0
        self._passes: dict[int, str] = {}  # by the line that jumps back: what changes often, as it was there
        self._moved = (0, 0)  # moves at the last jump back after a move, and the blocks that had run by then
        self._began = False  # a variable was set, or the flow steered

    def _load(self, names: tuple[str, ...]) -> None:
        super()._load(names)
        self._structure = self._loops = None

    def _steered(self, row: int) -> int | None:
        """Where the run goes on, of a block that steers it or is left out; None for a block that acts."""
        self._at = row
        if any(row == first for first, *_ in self._files):  # the end of the file before it
            return len(self.lines)
        self._steps += 1
        if self._steps > MOST_STEPS:
            raise self._fail(row, f"more than {MOST_STEPS:,} blocks have run", "a loop that ends")
        statement = self._statement(row)
        self.variables.line = statement.line
        if statement.percent and self._began:  # as after a word, the tape mark is the last one
            return len(self.lines)
        self._began |= bool(statement.assignments or statement.steering)
        if statement.optional and statement.switch in self.switches:
            return row + 1
        if statement.steering is None:
            return None
        to = self._steer(row, statement.steering)
        if to is None:
            return row + 1
        return to if to == row + 1 else self._jump(row, to)

    def _jump(self, row: int, to: int) -> int:
        if to <= row:
            self._check_loop(row, to)
        return super()._jump(row, to) if max(row, to) < self._main_lines else to

    def _check_loop(self, row: int, to: int) -> None:
        """Refuse a loop in which nothing changes, or that makes no move in very many blocks, where it goes back."""
        state, known = self.state, self.variables
        kept = repr((state.frames.position, known.levels, known.common, known.named, self._counts, self._levels))
        if len(state.recorder) != self._moved[0]:
            self._moved = (len(state.recorder), self._steps)
        last = self._passes.get(row, "")
        if last.startswith(kept):  # the offsets, which take long to write down, only then
            kept += repr(state.frames)
        if kept == last or self._steps - self._moved[1] > MOST_IDLE:
            problem = f"the loop back to line {self._place(to).line} never ends"
            raise self._fail(row, f"{problem}: no variable or position changes, or nothing moves", "a loop that ends")
        self._passes[row] = kept

    def _return(self, row: int, flow: Flow | GoTo) -> int | None:
        """M99; with P it goes on at that block of the caller, wherever that is."""
        if not isinstance(flow, GoTo) or not self._levels:
            return super()._return(row, flow)
        self._levels[-1].again = 0
        return self._go_on(self._leave(row) - 1, flow.number, flow.column)

    def _steer(self, row: int, steering: Steering) -> int | None:
        """The line (from 0) at which the run goes on; None: the next one."""
        if self.family == NGC and row in self._ngc().faults:
            raise self._ngc().faults[row]
        act = (NGC_STEPS if self.family == NGC else MACRO_STEPS).get(steering.kind)
        return None if act is None else act(self, row, steering)

    def _value(self, steering: Steering, which: int = 0) -> float:
        return number(steering.values[which](self.variables))

    def _true(self, steering: Steering) -> bool:
        return self._value(steering) != 0.0

    def _if(self, row: int, steering: Steering) -> int | None:
        if self._true(steering):
            return None
        for branch in self._ngc().branches[row]:
            other = self._statement(branch).steering
            assert other is not None
            if other.kind != "ELSEIF" or self._true(other):
                return branch + 1
        raise AssertionError("every if has its endif")

    def _else(self, row: int, steering: Steering) -> int | None:
        """Reached from the branch before: the rest is passed over."""
        return self._ngc().branches[self._ngc().branch_of[row]][-1] + 1

    def _while(self, row: int, steering: Steering) -> int | None:
        structure = self._ngc()
        if row in structure.start:  # the end of a do
            return structure.start[row] + 1 if self._true(steering) else None
        return None if self._true(steering) else structure.end[row] + 1

    def _end_while(self, row: int, steering: Steering) -> int | None:
        return self._ngc().start[row]

    def _repeat(self, row: int, steering: Steering) -> int | None:
        count = self._value(steering)
        if abs(count - round(count)) > EQUAL:
            raise self._fail(row, f"repeat [{count:g}]", "a whole number", column=steering.column)
        if round(count) <= 0:
            return self._ngc().end[row] + 1
        self._repeats_left[row] = round(count)
        return None

    def _end_repeat(self, row: int, steering: Steering) -> int | None:
        start, counts = self._ngc().start[row], self._repeats_left
        counts[start] = counts.get(start, 1) - 1
        return start + 1 if counts[start] > 0 else None

    @property
    def _repeats_left(self) -> dict[int, int]:
        return self._levels[-1].counts if self._levels else self._counts

    def _break(self, row: int, steering: Steering) -> int | None:
        structure = self._ngc()
        return structure.end[structure.inside[row]] + 1

    def _continue(self, row: int, steering: Steering) -> int | None:
        structure = self._ngc()
        start = structure.inside[row]
        opener = self._statement(start).steering
        assert opener is not None
        return start if opener.kind == "WHILE" else structure.end[start]

    def _sub(self, row: int, steering: Steering) -> int | None:
        return self._ngc().end[row] + 1

    def _return_sub(self, row: int, steering: Steering) -> int | None:
        if not self._levels:
            raise self._fail(row, f"{steering.kind.lower()} outside any subprogram", column=steering.column)
        self.variables.named["_VALUE_RETURNED"] = float(bool(steering.values))
        self.variables.named["_VALUE"] = self._value(steering) if steering.values else 0.0
        return self._leave(row)

    def _call_sub(self, row: int, steering: Steering) -> int | None:
        label = steering.label
        structure = self._ngc()
        name = label.strip("<>")
        if label not in structure.subs and self.folder is not None and Path(name).name == name:
            self._load((name.lower(), name, *(() if label.startswith("<") else (f"o{name}",))))
            structure = self._ngc()
        if label not in structure.subs:
            problem = f"{shown(steering)}: the program, or the folder of its subprograms, has no such sub"
            raise self._fail(row, problem, "--subprograms FOLDER, with that name", column=steering.column)
        first = structure.subs[label] + 1
        values = {place: number(value(self.variables)) for place, value in enumerate(steering.values, 1)}
        self._begin(Subprogram(f"o{name.lower()}", first, row + 1, 0, dict(values)), row, steering.column)
        return first

    def _goto(self, row: int, steering: Steering) -> int | None:
        return self._go_on(row, self._value(steering, -1), steering.column)

    def _if_goto(self, row: int, steering: Steering) -> int | None:
        return self._goto(row, steering) if self._true(steering) else None

    def _then(self, row: int, steering: Steering) -> int | None:
        if self._true(steering):
            self._assign(steering.then, row)
        return None

    def _while_do(self, row: int, steering: Steering) -> int | None:
        return None if self._true(steering) else self._macro_loops()[row] + 1

    def _do(self, row: int, steering: Steering) -> int | None:
        self._macro_loops()
        return None

    def _end_do(self, row: int, steering: Steering) -> int | None:
        loops = self._macro_loops()
        if row not in loops:
            raise self._fail(row, f"END{steering.label} without DO{steering.label}", column=steering.column)
        return loops[row]

    def _numbered(self, row: int, number: float) -> list[int]:
        program = self._program_of(row)
        return [candidate for candidate in super()._numbered(row, number) if self._program_of(candidate) == program]

    def _go_on(self, row: int, number: float, column: int) -> int:
        """The block with an N number in the program that runs. Raises `InputError` for a jump into a loop."""
        to = self._block_numbered(row, "the run goes on at", number, column)
        for start, end in self._macro_loops().items():
            if start < to < end and not start < row < end:
                problem = f"a jump into the loop that begins in line {self._place(start).line}"
                raise self._fail(row, problem, "a block outside of loops", column=column)
        return to

    def _program_of(self, row: int) -> int:
        """The line at which the program (from O number to O number) begins that holds a line."""
        begins = sorted({0, *self._heads().values(), *(first for first, *_ in self._files)})
        return begins[bisect_right(begins, row) - 1]

    def _macro_loops(self) -> dict[int, int]:
        if self._loops is None:
            self._loops = loops_of(self._steerings(), self._fail)
        return self._loops

    def _steerings(self) -> list[tuple[int, Steering]]:
        """The lines that steer; one that cannot be read is an error where it runs, if it does."""
        steerings = []
        for row in range(len(self.lines)):
            try:
                steering = self._statement(row).steering
            except InputError:
                continue
            if steering is not None:
                steerings.append((row, steering))
        return steerings

    def _ngc(self) -> Structure:
        if self._structure is None:
            self._structure = structure_of(self._steerings(), {first for first, *_ in self._files}, self._fail)
        return self._structure

    def _end(self, row: int, what: str, ended: bool = False) -> list[Remark]:
        if self._levels and not ended:
            raise self._unended(self._at)
        if row >= self._main_lines:
            return []
        subs = self._ngc() if self.family == NGC else Structure()
        ends = [(start, subs.end[start]) for start in subs.subs.values() if start in subs.end]
        heads = [index for index in range(row + 1, self._main_lines) if HEAD.match(self.lines[index])]
        rest = [
            index
            for index in range(row + 1, min([*heads, self._main_lines]))
            if self.lines[index].strip() not in ("", "%") and not any(a <= index <= b for a, b in ends)
        ]
        return beyond_the_end(what, row, len(rest))


NGC_STEPS = {
    "IF": ParametricRun._if, "ELSEIF": ParametricRun._else, "ELSE": ParametricRun._else,
    "WHILE": ParametricRun._while, "ENDWHILE": ParametricRun._end_while,
    "REPEAT": ParametricRun._repeat, "ENDREPEAT": ParametricRun._end_repeat, "BREAK": ParametricRun._break,
    "CONTINUE": ParametricRun._continue, "SUB": ParametricRun._sub, "ENDSUB": ParametricRun._return_sub,
    "RETURN": ParametricRun._return_sub, "CALL": ParametricRun._call_sub,
}  # fmt: skip


MACRO_STEPS = {
    "IF": ParametricRun._if_goto, "THEN": ParametricRun._then, "GOTO": ParametricRun._goto,
    "WHILE": ParametricRun._while_do, "DO": ParametricRun._do, "END": ParametricRun._end_do,
}  # fmt: skip
