"""Runs a parametric program: works out the values of each block, and goes where O words, GOTO, WHILE and G65 lead.

LinuxCNC's manual, "O Codes"; Fanuc's operator's manuals, "Custom macro" ("Macro call", "Branch and repetition"). Each
block's words then act as those of any program (`interpreter.execute`). Bounded: the blocks that run, and calls within
calls. Subprograms of other files are read from one folder that the caller names, and from nowhere else.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field, replace
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.interpreter import (
    DEEPEST,
    HEAD,
    MOST_REPEATS,
    SEQUENCE,
    ProgramRun,
    Subprogram,
    beyond_the_end,
    execute,
)
from toolpath_stiff.nc.parametric.expressions import EQUAL, NGC, number
from toolpath_stiff.nc.parametric.statements import (
    Assignment,
    Statement,
    Steering,
    family_of,
    plain_word,
    read_statement,
)
from toolpath_stiff.nc.parametric.structure import Structure, arguments_of, loops_of, structure_of
from toolpath_stiff.nc.parametric.variables import Level, Variables
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.state import Call, Flow, GoTo, State, Then
from toolpath_stiff.nc.words import Block, Word, read_lines

MOST_STEPS = 1_000_000  # blocks that run, all repeats counted


MOST_IDLE = 100_000  # blocks of loops that run without a move between; a program that works out values needs far fewer


# What a control gathers and no block reads: left out where one pass of a loop is compared with another.
GATHERED = frozenset(
    ("recorder", "used_tools", "tip_held", "unsupported", "warnings", "assumptions", "bare", "pointed", "trace")
) | {"turning"}


SUFFIXES = (".ngc", ".nc", ".NGC", ".NC", "")


SHOWN = 40  # characters of the program in a message


LARGEST_NUMBER = 99_999_999  # of a program, or of repeats


WHOLE_WORDS = frozenset("GMTL")  # codes and numbers, which a value must be


MACRO_CALLS = ("G65", "G66", "G67")


@dataclass(frozen=True)
class MacroCall(Call):
    """G65, or a call by G66: P, L, and the local variables that it gives."""

    arguments: dict[int, float | None] = field(default_factory=dict)
    modal: bool = False


@dataclass
class MacroLevel(Subprogram):
    """A subprogram with variables of its own; `arguments` begin each of its runs."""

    arguments: dict[int, float | None] = field(default_factory=dict)
    modal: bool = False


class ParametricRun(ProgramRun):
    """A run of a program with variables; parameters as in `ProgramRun`.

    Parameters
    ----------
    folder
        Where files of subprograms are: `name.ngc` for `o<name> call`, `O1234.nc` or `1234.nc` for M98 and G65 P1234.
        None: there are none.
    """

    def __init__(
        self,
        state: State,
        lines: tuple[str, ...],
        name: str,
        switches: frozenset[int],
        folder: str | Path | None,
    ) -> None:
        super().__init__(state, lines, name, switches, fast=False)
        self.family = family_of(lines, state.dialect, name)
        self.variables = Variables(self.family, state)
        self.folder = None if folder is None else Path(folder)
        self._main_lines = len(lines)
        self._files: list[tuple[int, int, str]] = []  # first line, line after the last, name
        self._statements: dict[int, Statement] = {}
        self._structure: Structure | None = None
        self._loops: dict[int, int] | None = None
        self._numbers: dict[tuple[int, int], list[int]] | None = None  # N number in a program: lines
        self._counts: list[dict[int, int]] = [{}]  # repeats left, by line, of each call
        self._steps = 0
        self._passes = 0  # jumps back
        self._idle = (-1, 0)  # moves at the last jump back after a move, and the blocks that had run by then
        self._earlier: tuple[list[object], str] | None = None  # the run at an earlier jump back
        self._modal: MacroCall | None = None
        self._at = 0
        self._began = False  # a variable was set, or the flow steered

    # -- blocks ----------------------------------------------------------------------------------------------------

    def _place(self, at: int) -> Place:
        """File and line (from 1) of a line that is read."""
        for first, stop, name in self._files:
            if first <= at < stop:
                return Place(name, at - first + 1)
        return super()._place(at)

    def _steered(self, at: int) -> int | None:
        """Where the run goes on, of a block that steers it or is left out; None for a block that acts."""
        self._at = at
        if any(at == first for first, *_ in self._files):  # the end of the file before it
            return len(self.lines)
        self._steps += 1
        if self._steps > MOST_STEPS:
            raise self._fail(at, f"more than {MOST_STEPS:,} blocks have run", "a loop that ends")
        statement = self._statement(at)
        self.variables.line = statement.line
        if statement.percent and self._began:  # as after a word, the tape mark is the last one
            return len(self.lines)
        self._began |= bool(statement.assignments or statement.steering)
        if statement.optional and statement.switch in self.switches:
            return at + 1
        if statement.steering is None:
            return None
        to = self._steer(at, statement.steering)
        if to is None:
            return at + 1
        return to if to == at + 1 else self._jump(at, to)

    def _statement(self, at: int) -> Statement:
        found = self._statements.get(at)
        if found is None:
            found = read_statement(self.lines[at], self._place(at), self.family, self.state.dialect)
            self._statements[at] = found
        return found

    def _block(self, at: int) -> Block:
        return self._read(at)

    def _read(self, at: int) -> Block:
        """The block with its values; its variables are set."""
        statement = self._statement(at)
        words = []
        for letter, value, column, written in statement.words:
            computed = not isinstance(value, float)
            worked = value(self.variables) if callable(value) else value
            if worked is None:  # an empty variable: the word is as if it were not there (Macro B)
                continue
            if computed and letter in WHOLE_WORDS:
                worked = self._whole(letter, worked, at, column, written)
            words.append(plain_word(letter, worked, column, written, computed))
        self._assign(statement.assignments, at)
        line = statement.line if at < self._main_lines else self._line_of_call()
        return Block(line, tuple(words), statement.optional, statement.percent, statement.switch)

    def _whole(self, letter: str, value: float, at: int, column: int, written: str) -> float:
        """The code or number that a value stands for, as LinuxCNC's interpreter rounds it."""
        known = round(value, 1 if letter in "GM" else 0)
        if abs(known - value) > EQUAL or known < 0.0:
            expected = f"a code such as {letter}1 or {letter}59.3" if letter in "GM" else "a whole number from 0"
            raise self._fail(at, f"{written[:SHOWN]} is {letter}{value:g}", expected, column=column)
        return known

    def _assign(self, assignments: tuple[Assignment, ...], at: int) -> None:
        """Set variables, once all values are known (LinuxCNC, "Numbered Parameters")."""
        known = [(a.which(self.variables), a.value(self.variables), a.column) for a in assignments]
        for which, value, column in known:
            self.variables.set(which, value, self._place(at)._replace(column=column))

    def _line_of_call(self) -> int:
        """The line of the main file from which a subprogram's file is called: its moves are of that line."""
        return next((level.back for level in reversed(self._levels) if level.back <= self._main_lines), 1)

    def _jump(self, at: int, to: int) -> int:
        if to <= at:
            self._check_loop(at, to)
        return super()._jump(at, to) if max(at, to) < self._main_lines else to

    def _check_loop(self, at: int, to: int) -> None:
        """Refuse a loop that cannot end, or makes no move in very many blocks, where it goes back.

        What runs next follows from the run's present state alone: once a state comes again, so does all after it. The
        state is held against one that is renewed after 2, 4, 8... passes, so that any period is found within about
        three times its length (Brent, "An improved Monte Carlo factorization algorithm", BIT 20 (1980) 176).
        """
        self._passes += 1
        now = self._values(at)
        if self._earlier is not None and self._earlier[0] == now and self._earlier[1] == self._modes():
            raise self._fail(
                at,
                f"the loop back to line {self._place(to).line} never ends: no variable or position changes in it",
                "a loop whose condition becomes false",
            )
        if self._passes & (self._passes - 1) == 0:
            self._earlier = now, self._modes()
        moves = len(self.state.recorder)
        if moves != self._idle[0]:
            self._idle = moves, self._steps
        elif self._steps - self._idle[1] > MOST_IDLE:
            found = (
                f"more than {MOST_IDLE:,} blocks of loops without a move, back to line {self._place(to).line} each time"
            )
            raise self._fail(at, found, "a loop that ends: see whether its condition becomes false")

    def _values(self, at: int) -> list[object]:
        """Where the run is, and the numbers that a loop's condition reads."""
        known = self.variables
        return [
            at,
            [*self.state.frames.position],
            [(dict(level.numbered), dict(level.named)) for level in known.levels],
            dict(known.common),
            dict(known.named),
            [dict(counts) for counts in self._counts],
            [(level.first, level.back, level.again) for level in self._levels],
        ]

    def _modes(self) -> str:
        """All else that the control keeps, as text: it is large, and rarely compared."""
        kept = [value for name, value in vars(self.state).items() if name not in GATHERED]
        return repr((kept, self._modal, self._began))

    def _execute(self, block: Block) -> Then:
        try:
            return self._act(block)
        except InputError as error:
            error.file, error.line, _ = self._place(self._at)  # the block stands on the line that calls its file
            raise

    def _act(self, block: Block) -> Then:
        call, block = self._macro_call(block)
        if call is not None and not call.modal:
            return call
        moves = len(self.state.recorder)
        flow = execute(self.state, block) if block.words else Flow.NEXT
        modal = self._modal
        if flow is Flow.NEXT and modal is not None and len(self.state.recorder) > moves and not self._in_modal():
            return modal
        return flow

    # -- macro calls of Macro B ------------------------------------------------------------------------------------

    def _macro_call(self, block: Block) -> tuple[MacroCall | None, Block]:
        """G65, G66 or G67 of a block, carried out but for G65's call; and the block without it."""
        calls = [
            (at, word)
            for at, word in enumerate(block.words)
            if word.letter == "G" and code_name("G", word.value) in MACRO_CALLS
        ]
        if not calls or self.family == NGC:  # LinuxCNC has none: refused where the codes are sorted
            return None, block
        place, word = calls[0]
        code, before, after = code_name("G", word.value), block.words[:place], block.words[place + 1 :]
        if before:
            execute(self.state, replace(block, words=before))
        if code == "G67":
            self._modal = None
            return None, replace(block, words=after)
        given = {w.letter: w for w in after if w.letter in "PL"}
        if "P" not in given:
            raise self._fail(self._at, f"{code} without P", "P with the number of the macro", column=word.column)
        number_of, repeats = (self._count(given[k]) if k in given else 1 for k in "PL")
        call = MacroCall(
            number_of,
            repeats,
            word.column,
            arguments=arguments_of(after, self.state.dialect.increments, self._word_fault),
            modal=code == "G66",
        )
        if call.modal:
            self._modal = call
        return call, replace(block, words=())

    def _count(self, word: Word) -> int:
        if word.value != round(word.value) or not 1 <= word.value <= LARGEST_NUMBER:
            raise self._word_fault(word, "is not a count", "a whole number from 1")
        return int(word.value)

    def _word_fault(self, word: Word, found: str, expected: str) -> InputError:
        return self._fail(self._at, f"{word.text} {found}", expected, column=word.column)

    def _in_modal(self) -> bool:
        return any(isinstance(level, MacroLevel) and level.modal for level in self._levels)

    # -- calls -----------------------------------------------------------------------------------------------------

    def _enter(self, at: int, call: Call) -> int:
        if call.local:
            self._counts.append({})
            return super()._enter(at, call)
        known, repeats = self._target(at, call)
        heads = self._heads()
        if isinstance(call, MacroCall):
            known, repeats = call.number, call.repeats or 1
        if known not in heads:
            raise self._fail(at, f"the file has no program O{known}", column=call.column)
        if not 1 <= repeats <= MOST_REPEATS:
            raise self._fail(at, f"a call with {repeats} repeats", f"1 to {MOST_REPEATS}", column=call.column)
        if isinstance(call, MacroCall):
            level: Subprogram = MacroLevel(
                f"O{known}", heads[known] + 1, at + 1, repeats - 1, arguments=call.arguments, modal=call.modal
            )
            self._push(Level(dict(call.arguments)))
        else:
            level = Subprogram(f"O{known}", heads[known] + 1, at + 1, repeats - 1)
            self._counts.append({})
        return self._call(level, at, call.column)

    def _call(self, level: Subprogram, at: int, column: int) -> int:
        if len(self._levels) == DEEPEST:
            raise self._fail(at, f"more than {DEEPEST} subprograms within each other", column=column)
        self._levels.append(level)
        return level.first

    def _push(self, level: Level) -> None:
        self.variables.levels.append(level)
        self._counts.append({})

    def _leave(self, at: int) -> int:
        level = self._levels[-1]
        back = super()._leave(at)
        left = not self._levels or self._levels[-1] is not level
        if isinstance(level, MacroLevel):
            self.variables.levels.pop()
            if not left:
                self.variables.levels.append(Level(dict(level.arguments)))
        if not left:
            self._counts[-1] = {}
            return back
        self._counts.pop()
        return back

    def _return(self, at: int, flow: Flow | GoTo) -> int | None:
        """M99; with P it goes on at that block of the caller, wherever that is."""
        if not isinstance(flow, GoTo) or not self._levels:
            return super()._return(at, flow)
        self._levels[-1].again = 0
        return self._numbered(self._leave(at) - 1, flow.number, flow.column)

    def _target(self, at: int, call: Call) -> tuple[int, int]:
        heads = self._heads()
        if call.number not in heads and self.folder is not None and call.number < 10_000:
            self._load((f"O{call.number:04d}", f"O{call.number}", f"{call.number}", f"{call.number:04d}"))
        if isinstance(call, MacroCall):
            return call.number, call.repeats or 1
        return super()._target(at, call)

    def _load(self, names: tuple[str, ...]) -> None:
        """Read a subprogram's file from the folder, if it is there; its lines follow those that are read."""
        assert self.folder is not None
        for name in names:
            for suffix in SUFFIXES:
                file = self.folder / (name + suffix)
                if file.is_file():
                    first = len(self.lines)
                    self.lines = (*self.lines, *read_lines(file))
                    self._files.append((first, len(self.lines), file.name))
                    self._programs = self._structure = self._loops = self._numbers = None
                    return

    # -- steering --------------------------------------------------------------------------------------------------

    def _steer(self, at: int, steering: Steering) -> int | None:
        """The line (from 0) at which the run goes on; None: the next one."""
        if self.family == NGC and at in self._ngc().faults:
            raise self._ngc().faults[at]
        act = NGC_STEPS[steering.kind] if self.family == NGC else MACRO_STEPS[steering.kind]
        return act(self, at, steering)

    def _true(self, steering: Steering) -> bool:
        return number(steering.values[0](self.variables)) != 0.0

    def _if(self, at: int, steering: Steering) -> int | None:
        if self._true(steering):
            return None
        for branch in self._ngc().branches[at]:
            other = self._statement(branch).steering
            assert other is not None
            if other.kind != "ELSEIF" or self._true(other):
                return branch + 1
        raise AssertionError("every if has its endif")

    def _else(self, at: int, steering: Steering) -> int | None:
        """Reached from the branch before: the rest is passed over."""
        return self._ngc().branches[self._ngc().branch_of[at]][-1] + 1

    def _while(self, at: int, steering: Steering) -> int | None:
        structure = self._ngc()
        if at in structure.start:  # the end of a do
            return structure.start[at] + 1 if self._true(steering) else None
        return None if self._true(steering) else structure.end[at] + 1

    def _end_while(self, at: int, steering: Steering) -> int | None:
        return self._ngc().start[at]

    def _repeat(self, at: int, steering: Steering) -> int | None:
        count = number(steering.values[0](self.variables))
        if abs(count - round(count)) > EQUAL:
            raise self._fail(at, f"repeat [{count:g}]", "a whole number", column=steering.column)
        if round(count) <= 0:
            return self._ngc().end[at] + 1
        self._counts[-1][at] = round(count)
        return None

    def _end_repeat(self, at: int, steering: Steering) -> int | None:
        start = self._ngc().start[at]
        self._counts[-1][start] = self._counts[-1].get(start, 1) - 1
        return start + 1 if self._counts[-1][start] > 0 else None

    def _break(self, at: int, steering: Steering) -> int | None:
        structure = self._ngc()
        return structure.end[structure.inside[at]] + 1

    def _continue(self, at: int, steering: Steering) -> int | None:
        structure = self._ngc()
        start = structure.inside[at]
        opener = self._statement(start).steering
        assert opener is not None
        return start if opener.kind == "WHILE" else structure.end[start]

    def _do_nothing(self, at: int, steering: Steering) -> int | None:
        return None

    def _sub(self, at: int, steering: Steering) -> int | None:
        return self._ngc().end[at] + 1

    def _return_sub(self, at: int, steering: Steering) -> int | None:
        if not self._levels:
            raise self._fail(at, f"{steering.kind.lower()} outside any subprogram", column=steering.column)
        value = number(steering.values[0](self.variables)) if steering.values else None
        self.variables.named["_VALUE_RETURNED"] = float(value is not None)
        self.variables.named["_VALUE"] = 0.0 if value is None else value
        return self._leave(at)

    def _call_sub(self, at: int, steering: Steering) -> int | None:
        label = steering.label.known(self.variables)
        structure = self._ngc()
        if label not in structure.subs and self.folder is not None:
            name = label.strip("<>")
            if Path(name).name != name:
                raise self._fail(at, f"o{label.lower()[:SHOWN]} is not the name of a file", column=steering.column)
            self._load((name.lower(), name, *(() if label.startswith("<") else (f"o{name}",))))
            structure = self._ngc()
        if label not in structure.subs:
            where = "" if self.folder is None else f", and {str(self.folder)!r} has no file of it"
            raise self._fail(
                at,
                f"o{label.lower()[:SHOWN]} call: the program has no such sub{where}",
                hint="" if self.folder else "name the folder of its subprograms with --subprograms FOLDER",
                column=steering.column,
            )
        first = structure.subs[label] + 1
        values = {place: number(value(self.variables)) for place, value in enumerate(steering.values, 1)}
        to = self._call(MacroLevel(f"o{label.lower()[:SHOWN]}", first, at + 1, 0), at, steering.column)
        self._push(Level(dict(values)))
        return to

    def _goto(self, at: int, steering: Steering) -> int | None:
        return self._numbered(at, number(steering.values[-1](self.variables)), steering.column)

    def _if_goto(self, at: int, steering: Steering) -> int | None:
        return self._goto(at, steering) if self._true(steering) else None

    def _then(self, at: int, steering: Steering) -> int | None:
        if self._true(steering):
            self._assign(steering.then, at)
        return None

    def _while_do(self, at: int, steering: Steering) -> int | None:
        return None if self._true(steering) else self._macro_loops()[at] + 1

    def _do(self, at: int, steering: Steering) -> int | None:
        self._macro_loops()
        return None

    def _end_do(self, at: int, steering: Steering) -> int | None:
        loops = self._macro_loops()
        if at not in loops:
            raise self._fail(at, f"END{steering.label.text} without DO{steering.label.text}", column=steering.column)
        return loops[at]

    def _numbered(self, at: int, target: float, column: int) -> int:
        """The block with an N number in the program that runs. Raises `InputError` unless there is one to jump to."""
        if self._numbers is None:
            self._numbers = {}
            for index, line in enumerate(self.lines):
                match = SEQUENCE.match(line)
                if match:
                    self._numbers.setdefault((self._program_of(index), int(match[1] or 0)), []).append(index)
        found = self._numbers.get((self._program_of(at), round(target)), []) if target == round(target) else []
        if len(found) != 1:
            places = ", ".join(str(self._place(index).line) for index in found)
            raise self._fail(
                at,
                f"the run goes on at N{target:g}, which " + (f"is in the lines {places}" if found else "no block has"),
                "one block with that N number in the program",
                column=column,
            )
        for start, end in self._macro_loops().items():
            if start < found[0] < end and not start < at < end:
                raise self._fail(
                    at,
                    f"a jump into the loop that begins in line {self._place(start).line}",
                    "a block outside of loops",
                    column=column,
                )
        return found[0]

    def _program_of(self, at: int) -> int:
        """The line at which the program (from O number to O number) begins that holds a line."""
        if self._programs is None:
            self._heads()
        begins = sorted({0, *(self._programs or {}).values(), *(first for first, *_ in self._files)})
        return begins[bisect_right(begins, at) - 1]

    def _macro_loops(self) -> dict[int, int]:
        if self._loops is None:
            self._loops = loops_of(self._steerings(), self._fail)
        return self._loops

    def _steerings(self) -> list[tuple[int, Steering]]:
        """The lines that steer; one that cannot be read is an error where it runs, if it does."""
        found = []
        for at in range(len(self.lines)):
            try:
                steering = self._statement(at).steering
            except InputError:
                continue
            if steering is not None:
                found.append((at, steering))
        return found

    def _ngc(self) -> Structure:
        if self._structure is None:
            self._structure = structure_of(self._steerings(), {first for first, *_ in self._files}, self._fail)
        return self._structure

    def _end(self, at: int, what: str, ended: bool = False) -> list[str]:
        if self._levels and not ended:
            raise self._unended(self._at)
        if at >= self._main_lines:
            return []
        subs = self._ngc() if self.family == NGC else Structure()
        ends = [(start, subs.end[start]) for start in subs.subs.values() if start in subs.end]
        heads = [index for index in range(at + 1, self._main_lines) if HEAD.match(self.lines[index])]
        rest = [
            index
            for index in range(at + 1, min([*heads, self._main_lines]))
            if self.lines[index].strip() not in ("", "%") and not any(a <= index <= b for a, b in ends)
        ]
        return [beyond_the_end(what, at, len(rest))] if rest else []


NGC_STEPS = {
    "IF": ParametricRun._if, "ELSEIF": ParametricRun._else, "ELSE": ParametricRun._else,
    "ENDIF": ParametricRun._do_nothing,
    "WHILE": ParametricRun._while, "ENDWHILE": ParametricRun._end_while, "DO": ParametricRun._do_nothing,
    "REPEAT": ParametricRun._repeat, "ENDREPEAT": ParametricRun._end_repeat, "BREAK": ParametricRun._break,
    "CONTINUE": ParametricRun._continue, "SUB": ParametricRun._sub, "ENDSUB": ParametricRun._return_sub,
    "RETURN": ParametricRun._return_sub, "CALL": ParametricRun._call_sub,
}  # fmt: skip


MACRO_STEPS = {
    "IF": ParametricRun._if_goto, "THEN": ParametricRun._then, "GOTO": ParametricRun._goto,
    "WHILE": ParametricRun._while_do, "DO": ParametricRun._do, "END": ParametricRun._end_do,
}  # fmt: skip
