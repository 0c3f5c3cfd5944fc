"""Run of a parametric program: values of its blocks, and the way through O words, GOTO, WHILE and calls.

LinuxCNC's manual, "O Codes"; Fanuc's operator's manuals, "Custom macro" ("Macro call", "Branch and repetition"). Each
block's words act as those of any program (`interpreter.execute`). Subprograms of other files are read from one folder
that the caller names, and from nowhere else. Bounded: the blocks that run, and calls within calls.
"""

from bisect import bisect_right
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.interpreter import execute
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.parametric.expressions import EQUAL, number
from toolpath_stiff.nc.parametric.families import NGC, family_of
from toolpath_stiff.nc.parametric.macro_calls import MACRO_CALLS, call_of
from toolpath_stiff.nc.parametric.statements import Assignment, Statement, Steering, read_statement, worked_out
from toolpath_stiff.nc.parametric.structure import Structure, structure_of
from toolpath_stiff.nc.parametric.variables import Variables
from toolpath_stiff.nc.program_run import HEAD, ProgramRun
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.run_records import Subprogram, Tally, beyond_the_end
from toolpath_stiff.nc.state import Call, Flow, Then
from toolpath_stiff.nc.words import Block, Word

Step = Callable[[Any, int, Steering], int | None]  # of a run: its line, what it steers; where the run goes on
SUFFIXES = (".ngc", ".nc", ".NGC", ".NC", "")


class ParametricRun(ProgramRun):
    """Run of a program with variables and flow control; parameters as for `ProgramRun`.

    Files of subprograms are looked for in the folder of the controller: `name.ngc` for `o<name> call`, `O1234.nc` or
    `1234.nc` for M98 and G65 P1234.
    """

    def __init__(self, request: Request, tally: Tally | None = None) -> None:
        super().__init__(request, tally, fast=False)
        self.family = family_of(self.lines, self.state.dialect, self.name)
        self.variables = Variables(self.family, self.state)
        self._statements: dict[int, Statement] = {}
        self._structure_known: Structure | None = None
        self._modal: Call | None = None
        self._began = False  # True once a variable was set, or the flow steered
        self._repeats: dict[tuple[int, int], int] = {}  # repeats left of a loop, by depth of calls and its line
        self._marks: dict[str, int] = {}  # lines of BREAK and CONTINUE that LinuxCNC's interpreter has not forgotten

    def _statement(self, row: int) -> Statement:
        if row not in self._statements:
            place = self._place(row)
            self._statements[row] = read_statement(self.lines[row], place, self.family, self.state.dialect)
        return self._statements[row]

    def _block(self, row: int) -> Block:
        return self._tried(self._read, row, Block(row + 1, ()))

    def _read(self, row: int) -> Block:
        """Block with its values; its variables are set."""
        statement = self._statement(row)
        block = worked_out(statement, self.variables, self._place(row))
        self._assign(statement.assignments)
        line = statement.block.line if row < self._main_lines else self._line_of_call()
        return block if block.line == line else replace(block, line=line)

    def _assign(self, assignments: tuple[Assignment, ...]) -> None:
        """Set variables, once all values are known (LinuxCNC, "Numbered Parameters")."""
        for set_variable in [assignment(self.variables) for assignment in assignments]:
            set_variable()

    def _word_fault(self, word: Word, problem: str, expected: str) -> InputError:
        return self._fail(self._at, f"{word.text} {problem}", expected, column=word.column)

    def _execute(self, block: Block) -> Then:
        for place, word in enumerate(block.words if self.family != NGC else ()):  # LinuxCNC's: refused when sorted
            if word.letter == "G" and code_name("G", word.value) in MACRO_CALLS:
                return self._macro_call(block, code_name("G", word.value), place)
        return self._act(block)

    def _act(self, block: Block) -> Then:
        """Carry out a block; after a move comes the call of G66."""
        moves = len(self.state.recorder)
        flow = execute(self.state, block) if block.words else Flow.NEXT
        if self._modal is None or flow is not Flow.NEXT or len(self.state.recorder) == moves:
            return flow
        return flow if any(level.modal for level in self._levels) else self._modal

    def _macro_call(self, block: Block, code: str, place: int) -> Then:
        """Carry out G65, G66 or G67 at a place in a block, and the words before it."""
        before, word, after = block.words[:place], block.words[place], block.words[place + 1 :]
        if before:
            execute(self.state, replace(block, words=before))
        if code == "G67":
            self._modal = None
            return self._act(replace(block, words=after))
        call = call_of(word, after, code == "G66", self.state.dialect.increments, self._word_fault)
        if not call.modal:
            return call
        self._modal = call
        return Flow.NEXT

    def _begin(self, level: Subprogram, row: int, column: int) -> None:
        super()._begin(level, row, column)
        if level.arguments is not None:
            self.variables.levels.append({**level.arguments})

    def _leave(self, row: int) -> int:
        level, back = self._levels[-1], super()._leave(row)
        if level.arguments is not None:
            self.variables.levels.pop()
            if self._levels and self._levels[-1] is level:  # it runs again
                self.variables.levels.append({**level.arguments})
        return back

    def _target(self, row: int, call: Call) -> tuple[int, int]:
        if call.number not in self._heads() and call.number < 10_000:
            self._load_program((f"O{call.number:04d}", f"O{call.number}", f"{call.number}", f"{call.number:04d}"))
        if call.arguments is None:
            return super()._target(row, call)
        if call.number not in self._heads():
            raise self._fail(row, f"the file has no program O{call.number}", column=call.column)
        return call.number, call.repeats or 1

    def _load_program(self, names: tuple[str, ...]) -> None:
        """Read a subprogram's file from the folder, if it exists."""
        if self._load(name + suffix for name in names for suffix in SUFFIXES) is not None:
            self._structure_known = None

    def _steered(self, row: int) -> int | None:
        """Line where the run goes on after a block that steers or is skipped; None for a block that acts."""
        if self._ends_before(row):
            return len(self.lines)
        self._count_block(row)
        statement = self._statement(row)
        block, steering = statement.block, statement.steering
        self.variables.line = block.line
        if block.percent and self._began:  # as after a word, this tape mark is the last
            return len(self.lines)
        self._began |= bool(statement.assignments or steering)
        if block.optional and block.switch in self.switches:
            return row + 1
        if steering is None:
            return None
        if row in self._structure.faults:
            raise self._structure.faults[row]
        act, depth = self._step(steering.kind), len(self._levels)
        to = act(self, row, steering) if act else None
        if to is not None and to <= row and len(self._levels) == depth:  # otherwise a call, or its end
            variables = self.variables
            self._check_loop(row, to, (variables.levels, variables.common, self._repeats))
        return row + 1 if to is None else self._jump(row, to)

    def _ends_before(self, row: int) -> bool:
        """True if a line is the first of a file, so that the file before it has ended."""
        return bool(self._files) and any(row == first for first, *_ in self._files)

    def _step(self, kind: str) -> Step | None:
        """Function that carries out a kind of steering block."""
        return STEPS.get(kind)

    def _jump(self, row: int, to: int) -> int:
        return super()._jump(row, to) if to != row + 1 and max(row, to) < self._main_lines else to

    def _return(self, row: int, flow: Flow | Word) -> int | None:
        """M99; with P the run continues at that block of the caller, wherever it is."""
        if not isinstance(flow, Word) or not self._levels:
            return super()._return(row, flow)
        self._levels[-1].again = 0
        return self._go_on(self._leave(row) - 1, flow.value, flow.column)

    def _value(self, steering: Steering, which: int = 0) -> float:
        return number(steering.values[which](self.variables))

    def _if(self, row: int, steering: Steering) -> int | None:
        for branch in (row, *self._structure.branches[row]):
            condition = self._statement(branch).steering
            if condition is None or condition.kind not in ("IF", "ELSEIF") or self._value(condition):
                return branch + 1
        raise AssertionError("every if has its endif")

    def _else(self, row: int, steering: Steering) -> int | None:
        """Skip the other branches, when reached from the branch before."""
        return self._structure.end[self._structure.start[row]] + 1

    def _while(self, row: int, steering: Steering) -> int | None:
        start, true = self._structure.start.get(row), self._value(steering) != 0.0
        if start is None and true:
            return None
        if start is None:
            self._marks.pop("CONTINUE", None)
            return self._structure.end[row] + 1
        if true:
            self._refuse_after("BREAK", row, "would not run this loop again")
            return start + 1
        self._marks.pop("BREAK", None)
        return None

    def _back(self, row: int, steering: Steering) -> int | None:
        return self._structure.start[row]

    def _repeat(self, row: int, steering: Steering) -> int | None:
        count = self._value(steering)
        if abs(count - round(count)) > EQUAL:
            raise self._fail(row, f"repeat [{count:g}]", "a whole number", column=steering.column)
        self._repeats[len(self._levels), row] = round(count)
        return self._again(row)

    def _again(self, start: int) -> int:
        """Line where a repeat goes on, both at its beginning and at its end."""
        left = self._repeats.get((len(self._levels), start), 0)
        self._repeats[len(self._levels), start] = left - 1
        if left > 0:
            return start + 1
        self._refuse_after("CONTINUE", start, "would run this repeat once more, all of it")
        return self._structure.end[start] + 1

    def _break(self, row: int, steering: Steering) -> int | None:
        start = self._structure.start[row]
        if self._kind(start) == "WHILE":
            self._refuse_after("CONTINUE", row, "would go on with this loop")
            self._marks["BREAK"] = row
        return self._structure.end[start] + 1

    def _continue(self, row: int, steering: Steering) -> int | None:
        start = self._structure.start[row]
        if self._kind(start) == "WHILE":
            self._marks.pop("CONTINUE", None)
            return start
        self._marks["CONTINUE"] = row
        return self._structure.end[start]

    def _kind(self, row: int) -> str:
        steering = self._statement(row).steering
        return steering.kind if steering is not None else ""

    def _refuse_after(self, leave: str, row: int, what: str) -> None:
        """Refuse what LinuxCNC's interpreter does differently after a `break` or `continue`, whose mark it keeps.

        interp_o_word.cc: only the end of a do forgets a break, only that of a while or a repeat a continue, whatever
        loop they were for.
        """
        if leave in self._marks:
            line = self._place(self._marks[leave]).line
            problem = f"after the {leave.lower()} in line {line} LinuxCNC's interpreter {what}"
            raise self._fail(row, problem, "if and endif in place of it")

    def _return_sub(self, row: int, steering: Steering) -> int | None:
        if not self._levels:
            raise self._fail(row, f"{steering.kind.lower()} outside any subprogram", column=steering.column)
        self.variables.common["_VALUE_RETURNED"] = float(bool(steering.values))
        self.variables.common["_VALUE"] = self._value(steering) if steering.values else 0.0
        return self._leave(row)

    def _call_sub(self, row: int, steering: Steering) -> int | None:
        label, name = steering.label, steering.label.strip("<>")
        if label not in self._structure.subs and Path(name).name == name:
            self._load_program((name.lower(), name, *(() if label.startswith("<") else (f"o{name}",))))
        first = self._structure.subs.get(label, -1) + 1
        if not first:
            problem = f"{steering.shown}: the program, or the folder of its subprograms, has no such sub"
            raise self._fail(row, problem, "--subprograms FOLDER, with that name", column=steering.column)
        values = {place: number(value(self.variables)) for place, value in enumerate(steering.values, 1)}
        self._begin(Subprogram(f"o{name.lower()}", first, row + 1, 0, {**values}), row, steering.column)
        return first

    def _goto(self, row: int, steering: Steering) -> int | None:
        return self._go_on(row, self._value(steering, -1), steering.column)

    def _if_goto(self, row: int, steering: Steering) -> int | None:
        return self._goto(row, steering) if self._value(steering) else None

    def _if_then(self, row: int, steering: Steering) -> int | None:
        if self._value(steering):
            self._assign(steering.then)
        return None

    def _numbered(self, row: int, number: float) -> list[int]:
        program = self._program_of(row)
        return [candidate for candidate in super()._numbered(row, number) if self._program_of(candidate) == program]

    def _go_on(self, row: int, number: float, column: int) -> int:
        """Block with an N number in the running program. Raises `InputError` for a jump into a loop."""
        to = self._block_numbered(row, "the run goes on at", number, column)
        opens, ends = self._structure.start, self._structure.end
        loops = {opens.get(line, line) for line in range(min(row, to), max(row, to) + 1)}
        entered = [(ends[start], start) for start in loops & ends.keys() if start < to < ends[start]]
        entered = [(end, start) for end, start in entered if not start < row < end]
        if entered:
            problem = f"a jump into the loop that begins in line {self._place(min(entered)[1]).line}"
            raise self._fail(row, problem, "a block outside of loops", column=column)
        return to

    def _program_of(self, row: int) -> int:
        """First line of the program (from O number to O number) that contains a line."""
        begins = sorted({0, *self._heads().values(), *(first for first, *_ in self._files)})
        return begins[bisect_right(begins, row) - 1]

    @property
    def _structure(self) -> Structure:
        if self._structure_known is None:
            steerings = []
            for row in range(len(self.lines)):
                with suppress(InputError):  # an unreadable line is an error when it runs, if it does
                    steering = self._statement(row).steering
                    if steering is not None:
                        steerings.append((row, steering))
            self._structure_known = structure_of(steerings, {first for first, *_ in self._files}, self._fail)
        return self._structure_known

    def _end(self, row: int, what: str, ended: bool = False) -> list[Remark]:
        if self._levels and not ended:
            raise self._unended(self._at)
        if row >= self._main_lines:
            return []
        subs = [(start, self._structure.end.get(start, start)) for start in self._structure.subs.values()]
        heads = [index for index in range(row + 1, self._main_lines) if HEAD.match(self.lines[index])]
        rest = [
            index
            for index in range(row + 1, min([*heads, self._main_lines]))
            if self.lines[index].strip() not in ("", "%") and not any(a <= index <= b for a, b in subs)
        ]
        return beyond_the_end(what, row, len(rest))


STEPS: dict[str, Step] = {
    "IF": ParametricRun._if, "ELSEIF": ParametricRun._else, "ELSE": ParametricRun._else,
    "WHILE": ParametricRun._while, "ENDWHILE": ParametricRun._back,
    "REPEAT": ParametricRun._repeat, "ENDREPEAT": lambda run, row, steering: run._again(run._structure.start[row]),
    "BREAK": ParametricRun._break, "CONTINUE": ParametricRun._continue,
    "SUB": lambda run, row, steering: run._structure.end[row] + 1,
    "ENDSUB": ParametricRun._return_sub, "RETURN": ParametricRun._return_sub,
    "CALL": ParametricRun._call_sub,
    "IF GOTO": ParametricRun._if_goto, "IF THEN": ParametricRun._if_then, "GOTO": ParametricRun._goto,
    "WHILE LOOP": ParametricRun._while, "END": ParametricRun._back,
}  # fmt: skip
