"""The blocks of a parametric program with their values, and its calls with variables of their own.

Each block's words act as those of any program (`interpreter.execute`). Subprograms of other files are read from one
folder that the caller names, and from nowhere else.
"""

from dataclasses import replace
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.interpreter import execute
from toolpath_stiff.nc.lines import read_lines
from toolpath_stiff.nc.parametric.expressions import EQUAL
from toolpath_stiff.nc.parametric.families import NGC, family_of
from toolpath_stiff.nc.parametric.statements import Assignment, Statement, plain_word, read_statement
from toolpath_stiff.nc.parametric.structure import arguments_of
from toolpath_stiff.nc.parametric.variables import Level, Variables
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.program_run import ProgramRun, Subprogram, Tally
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.state import Call, Flow, Then
from toolpath_stiff.nc.words import Block, Word

SUFFIXES = (".ngc", ".nc", ".NGC", ".NC", "")
SHOWN = 40  # characters of the program in a message
LARGEST_NUMBER = 99_999_999  # of a program, or of repeats
WHOLE_WORDS = frozenset("GMTL")  # codes and numbers, which a value must be
MACRO_CALLS = ("G65", "G66", "G67")


class ValuesRun(ProgramRun):
    """A run whose blocks have values that variables give; parameters as of `ProgramRun`.

    Files of subprograms are looked for in the folder of the controller: `name.ngc` for `o<name> call`, `O1234.nc` or
    `1234.nc` for M98 and G65 P1234.
    """

    def __init__(self, request: Request, tally: Tally | None = None) -> None:
        super().__init__(request, tally, fast=False)
        self.family = family_of(self.lines, self.state.dialect, self.name)
        self.variables = Variables(self.family, self.state)
        self.folder = None if request.controller.subprograms is None else Path(request.controller.subprograms)
        self._main_lines = len(self.lines)
        self._files: list[tuple[int, int, str]] = []  # first line, line after the last, name
        self._statements: dict[int, Statement] = {}
        self._modal: Call | None = None
        self._at = 0  # the block that runs

    def _place(self, row: int) -> Place:
        """File and line (from 1) of a line that is read."""
        for first, stop, name in self._files:
            if first <= row < stop:
                return Place(name, row - first + 1)
        return super()._place(row)

    def _statement(self, row: int) -> Statement:
        statement = self._statements.get(row)
        if statement is None:
            statement = read_statement(self.lines[row], self._place(row), self.family, self.state.dialect)
            self._statements[row] = statement
        return statement

    def _block(self, row: int) -> Block:
        return self._tried(self._read, row, Block(row + 1, ()))

    def _read(self, row: int) -> Block:
        """The block with its values; its variables are set."""
        statement = self._statement(row)
        words = []
        for letter, value, column, written in statement.words:
            computed = not isinstance(value, float)
            worked = value(self.variables) if callable(value) else value
            if worked is None:  # an empty variable: the word is as if it were not there (Macro B)
                continue
            if computed and letter in WHOLE_WORDS:
                worked = self._whole(letter, worked, row, column, written)
            words.append(plain_word(letter, worked, column, written, computed))
        self._assign(statement.assignments, row)
        line = statement.line if row < self._main_lines else self._line_of_call()
        return Block(line, tuple(words), statement.optional, statement.percent, statement.switch)

    def _whole(self, letter: str, value: float, row: int, column: int, written: str) -> float:
        """The code or number that a value stands for, as LinuxCNC's interpreter rounds it."""
        known = round(value, 1 if letter in "GM" else 0)
        if abs(known - value) > EQUAL or known < 0.0:
            expected = f"a code such as {letter}1 or {letter}59.3" if letter in "GM" else "a whole number from 0"
            raise self._fail(row, f"{written[:SHOWN]} is {letter}{value:g}", expected, column=column)
        return known

    def _assign(self, assignments: tuple[Assignment, ...], row: int) -> None:
        """Set variables, once all values are known (LinuxCNC, "Numbered Parameters")."""
        known = [(a.which(self.variables), a.value(self.variables), a.column) for a in assignments]
        for which, value, column in known:
            self.variables.set(which, value, self._place(row)._replace(column=column))

    def _line_of_call(self) -> int:
        """The line of the main file from which a subprogram's file is called: its moves are of that line."""
        return next((level.back for level in reversed(self._levels) if level.back <= self._main_lines), 1)

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
        moved = flow is Flow.NEXT and len(self.state.recorder) > moves
        return flow if modal is None or not moved or any(level.modal for level in self._levels) else modal

    def _macro_call(self, block: Block) -> tuple[Call | None, Block]:
        """G65, G66 or G67 of a block, carried out but for G65's call; and the block without it."""
        calls = [
            (index, word)
            for index, word in enumerate(block.words)
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
        arguments = arguments_of(after, self.state.dialect.increments, self._word_fault)
        call = Call(number_of, repeats, word.column, arguments=arguments, modal=code == "G66")
        if call.modal:
            self._modal = call
        return call, replace(block, words=())

    def _count(self, word: Word) -> int:
        if word.value != round(word.value) or not 1 <= word.value <= LARGEST_NUMBER:
            raise self._word_fault(word, "is not a count", "a whole number from 1")
        return int(word.value)

    def _word_fault(self, word: Word, problem: str, expected: str) -> InputError:
        return self._fail(self._at, f"{word.text} {problem}", expected, column=word.column)

    def _begin(self, level: Subprogram, row: int, column: int) -> None:
        super()._begin(level, row, column)
        if level.arguments is not None:
            self.variables.levels.append(Level(dict(level.arguments)))

    def _leave(self, row: int) -> int:
        level, back = self._levels[-1], super()._leave(row)
        level.counts = {}
        if level.arguments is not None:
            self.variables.levels.pop()
            if self._levels and self._levels[-1] is level:
                self.variables.levels.append(Level(dict(level.arguments)))
        return back

    def _target(self, row: int, call: Call) -> tuple[int, int]:
        if call.number not in self._heads() and self.folder is not None and call.number < 10_000:
            self._load((f"O{call.number:04d}", f"O{call.number}", f"{call.number}", f"{call.number:04d}"))
        if call.arguments is None:
            return super()._target(row, call)
        if call.number not in self._heads():
            raise self._fail(row, f"the file has no program O{call.number}", column=call.column)
        return call.number, call.repeats or 1

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
                    self._programs = self._sequence = None
                    return
