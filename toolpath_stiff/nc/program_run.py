"""The blocks of a file, in the order in which they run.

Subprograms are those of Fanuc's controls: O numbers within the file, after the main program or before it, called by
`M98 P1000 L2` or, with the repeats before the four digits of the number, `M98 P21000`; they end with M99. LinuxCNC
reads the first form alike. `M97 P100` (Haas) calls the block N100 of the file, up to an M99. Modal state goes through a
call unchanged.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from marshal import dumps
from pathlib import Path
from typing import Any, TypeVar

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.registry import code_meaning
from toolpath_stiff.nc.codes.saved import leave_call
from toolpath_stiff.nc.interpreter import execute
from toolpath_stiff.nc.lines import read_lines
from toolpath_stiff.nc.moves import PACKED_AT, Jump, ReadProgram, Remark
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.plain_lines import PlainRun
from toolpath_stiff.nc.plain_words import PlainWords
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.run_records import Subprogram, Tally, beyond_the_end, collector_at_rest
from toolpath_stiff.nc.run_result import program_of
from toolpath_stiff.nc.state import Call, CurrentBlock, Flow, Then
from toolpath_stiff.nc.words import Block, Word, read_block

DEEPEST = 10  # calls within calls (LinuxCNC, and Fanuc's series 30i; older controls have 4)
MOST_BLOCKS = 1_000_000  # that run, all repeats counted; a count beyond is a slip in a number of repeats
MOST_IDLE = 100_000  # of loops that run without a move between; a program that works out values needs far fewer
MOST_REPEATS = 9999
SEQUENCE = re.compile(r"\s*+(?:/\d?\s*+)?[nN]\s*+0*+(\d{0,17}+)(?![\d.])", re.ASCII)
HEAD = re.compile(r"\s*+(?:/\s*+)?[oO:]\s*+0*+(\d{0,17}+)\s*+(?:[(;].*)?$", re.ASCII)
REPEATS_IN_P = 10_000  # P with more than four digits holds the repeats before them

Argument = TypeVar("Argument", int, str, Block)
Outcome = TypeVar("Outcome")


class ProgramRun:
    """Runs the blocks of a file on a control.

    Parameters
    ----------
    request
        The file, and what is known of its control at the start.
    tally
        Gathers errors and codes; the run then goes on after a block with an error.
    fast
        Whether plain lines are executed many at a time; the moves are the same.
    """

    def __init__(self, request: Request, tally: Tally | None = None, fast: bool = True) -> None:
        state, lines, name = request.start(), request.lines, request.name
        self.request, self.state, self.lines, self.name = request, state, lines, name
        state.keep = tally.keep if tally is not None else None
        self.switches, self.tally = request.controller.switches, tally
        self._plain = PlainRun(state, lines, name) if fast else None
        self._levels: list[Subprogram] = []
        self._programs: dict[int, int] | None = None
        self._sequence: dict[int, list[int]] | None = None
        self._called: dict[int, Block] = {}  # blocks of subprograms by line, from 0: each is read once
        self._blocks = 0
        self.jumps: list[Jump] = []
        # Files of subprograms, whose lines follow those of the program: first line, line after the last, name.
        self.folder = None if request.controller.subprograms is None else Path(request.controller.subprograms)
        self._files: list[tuple[int, int, str]] = []
        self._main_lines = len(lines)
        self._passes: dict[int, bytes] = {}  # line that jumps back -> the often-changing state, as it was there
        self._moved = (0, 0)  # moves, and blocks run, at the last jump back after a move

    _at, _main_lines = 0, 1  # the line that runs, and how many lines the file itself has
    _plain: PlainRun | None = None
    meaning = staticmethod(code_meaning)  # the meaning of a code, or of a word of the language
    cuts_by = "a feed move (G1, G2, G3 or a cycle)"

    def program(self, ending: list[Remark]) -> ReadProgram:
        """The program as run so far, with the warnings `ending` of its end."""
        return program_of(self.state, self.request, self.lines, self.jumps, ending)

    @collector_at_rest()
    def run(self) -> list[Remark]:
        """Run to the program's end; returns warnings. Raises `InputError` with the line."""
        state, row, begun, numbered = self.state, 0, False, False  # after the first word, a tape mark is the last one
        while row < len(self.lines):
            self._at = row
            if state.cutter is None and state.corner is None:  # these change the last moves
                state.recorder.pack(PACKED_AT)
            words = self._plain.execute(row) if self._plain is not None and not self._levels else None
            if words is not None:
                self._tally_plain(row, words)
                begun = begun or bool(words.count.any())
                row += len(words.code)
                continue
            following: int | None = row + 1
            steered = self._tried(self._steered, row, following)
            if steered is not None:
                row = steered
                continue
            block = self._block(row)
            if block.percent and begun:
                return self._end(row, "%")
            begun = begun or block.percent or bool(block.words)
            if block.words and block.words[0].letter == "O":
                self._check_head(block, numbered)
                numbered = True
            flow: Then = Flow.NEXT
            if block.words and not (block.optional and block.switch in self.switches):
                if self.tally is not None:
                    self.tally.add_block(block)
                flow = self._tried(self._execute, block, flow)
            if flow is Flow.END:
                return self._end(row, "the program's end", ended=True)
            if flow is Flow.NEXT:
                row += 1
                continue
            to = self._enter(row, flow) if isinstance(flow, Call) else self._return(row, flow)
            if to is None:
                again = "M99 outside any subprogram starts the program again, without end: it is read once"
                return [Remark(again, row + 1), *self._end(row, "M99")]
            row = self._jump(row, to)
        return self._end(len(self.lines) - 1, "the file")

    def _tried(self, act: Callable[[Argument], Outcome], argument: Argument, instead: Outcome) -> Outcome:
        """The result of a step; in a check its error is kept and the run continues with `instead`."""
        try:
            return act(argument)
        except InputError as error:
            if self._at >= self._main_lines and error.file == self.name:  # its block stands on the line of the call
                error = self._fail(self._at, error.found, error.expected, error.hint, error.column)
            if self.tally is None:
                raise error from None
            self.tally.keep(error)
            if self._plain is not None:  # what follows may have its error too
                self._plain.hole = None
            return instead

    def _tally_plain(self, first: int, words: PlainWords) -> None:
        """Count the codes of plain lines from `first`."""
        if self.tally is None:
            return
        rows_of_codes = [(words.code == number).nonzero()[0] for number in range(int(words.code.max()) + 1)]
        for rows in sorted((rows for rows in rows_of_codes if len(rows)), key=lambda rows: int(rows[0])):
            code, line = f"G{words.code[rows[0]]}", first + int(rows[0])
            column = next(word.column for word in self._read(line).words if word.letter == "G")
            self.tally.add(code, line + 1, column, len(rows))

    def _steered(self, row: int) -> int | None:
        """The line at which the run continues, for a line that only steers the run; None: its words act."""
        return None

    def _block(self, row: int) -> Block:
        block = self._called.get(row) if self._levels else None
        if self._levels:
            self._count_block(row)
        if block is None:
            block = self._tried(self._read, row, Block(row + 1, ()))
            if self._levels:
                self._called[row] = block
        return block

    def _execute(self, block: Block) -> Then:
        return execute(self.state, block)

    def _read(self, row: int) -> Block:
        block = read_block(self.lines[row], row + 1, self.name, self.state.dialect.semicolon)
        cut = block.rest is not None and block.switch in self.switches  # drop the words behind a slash in mid-block
        return replace(block, words=block.words[: block.rest]) if cut else block

    def _fail(
        self, row: int, problem: str, expected: str = "", hint: str = "", column: int | None = None
    ) -> InputError:
        return self._place(row).fail(problem, expected, hint, column)

    def _place(self, row: int) -> Place:
        """File, and line in it (from 1), of the line `row` of all lines read."""
        if row < self._main_lines:
            return Place(self.name, row + 1)
        in_files = (Place(name, row - first + 1) for first, stop, name in self._files if first <= row < stop)
        return next(in_files, Place(self.name, row + 1))

    def _line_of_call(self) -> int:
        """The line of the main file that calls a subprogram's file: the subprogram's moves belong to that line."""
        return next((level.back for level in reversed(self._levels) if level.back <= self._main_lines), 1)

    def _count_block(self, row: int) -> None:
        """Count a block that runs. Raises `InputError` beyond `MOST_BLOCKS`."""
        self._blocks += 1
        if self._blocks > MOST_BLOCKS:
            raise self._fail(row, f"more than {MOST_BLOCKS:,} blocks have run", "fewer repeats, a loop that ends")

    def _check_loop(self, row: int, to: int, changing: Any) -> None:
        """At a jump back: refuse a loop in which nothing changes, or which makes no move in very many blocks."""
        moves = len(self.state.recorder)
        if moves != self._moved[0]:
            self._moved = (moves, self._blocks)
        frames, table = self.state.frames, self.state.frames.offsets
        offsets = [(offset.axes, offset.rotation) for offset in (*table.table, *table.additional.values())]
        turns: Any = (frames.rotation, frames.linear, offsets, [(level.back, level.again) for level in self._levels])
        now = dumps([frames.position, frames.g92, frames.active, frames.tool, turns, changing], 2)
        if now == self._passes.get(row) or self._blocks - self._moved[1] > MOST_IDLE:
            problem = f"the loop back to line {self._place(to).line} never ends"
            raise self._fail(row, f"{problem}: no variable or position changes, or nothing moves", "a loop that ends")
        self._passes[row] = now

    def _load(self, names: Iterable[str], before: tuple[str, ...] = (), after: tuple[str, ...] = ()) -> int | None:
        """Read the first of these files that exists in the folder; returns its first line, None if none exists.

        `before`, `after`: lines that end what stands before the file, and the file.
        """
        files = (self.folder / name for name in names) if self.folder is not None else ()
        file = next((file for file in files if file.is_file()), None)
        if file is None:
            return None
        first = len(self.lines) + len(before)
        self.lines = (*self.lines, *before, *read_lines(file), *after)
        self._files.append((first, len(self.lines), file.name))
        self._programs = self._sequence = None
        return first

    def _files_called(self, stem: str, suffixes: tuple[str, ...]) -> list[str]:
        """Files of the folder with this name, in upper or lower case."""
        files = sorted(self.folder.iterdir()) if self.folder is not None and stem else []
        return [file.name for file in files if file.suffix.upper() in suffixes and file.stem.upper() == stem]

    def _check_head(self, block: Block, numbered: bool) -> None:
        """Refuse a program number within a program: the next program begins before this one has ended."""
        if self._levels:
            raise self._unended(block.line - 1)
        if (numbered or len(self.state.recorder)) and self.state.dialect.name != "linuxcnc":
            head, problem = block.words[0], "begins another program before the first one has ended"
            raise self._fail(block.line - 1, f"{head.text} {problem}", "M30 or M2 before it", column=head.column)

    def _unended(self, row: int) -> InputError:
        level = self._levels[-1]
        return self._fail(
            row, f"the subprogram {level.name}, which begins in line {level.first + 1}, has no end", "M99"
        )

    def _end(self, row: int, what: str, ended: bool = False) -> list[Remark]:
        """A warning if lines other than tape marks and the subprograms that ran follow the end."""
        if self._levels and not ended:
            raise self._unended(row)
        rest = [
            line
            for index, line in enumerate(self.lines[row + 1 :], row + 1)
            if line.strip() not in ("", "%") and index not in self._called and index + 1 not in self._called
        ]
        return beyond_the_end(what, row, len(rest))

    def _enter(self, row: int, call: Call) -> int:
        """The line at which the called subprogram begins."""
        if call.local:
            code, name, repeats = "M97", f"N{call.number}", call.repeats or 1
            first = self._block_numbered(row, "M97 calls", call.number, call.column)
        else:
            number, repeats = self._target(row, call)
            code, name, first = "M98" if call.arguments is None else "a call", f"O{number}", self._heads()[number] + 1
        if not 1 <= repeats <= MOST_REPEATS:
            raise self._fail(row, f"{code} with {repeats} repeats", f"1 to {MOST_REPEATS}", column=call.column)
        self._begin(Subprogram(name, first, row + 1, repeats - 1, call.arguments, call.modal), row, call.column)
        return first

    def _begin(self, level: Subprogram, row: int, column: int) -> None:
        if len(self._levels) == DEEPEST:
            problem = f"more than {DEEPEST} subprograms within each other, {level.name} the last one"
            raise self._fail(row, problem, "calls that end", column=column)
        self._levels.append(level)
        self.state.saved.append(None)

    def _jump(self, row: int, to: int) -> int:
        self.jumps.append(Jump(len(self.state.recorder), row + 1, to))
        return to

    def _numbered(self, row: int, number: float) -> list[int]:
        """Lines (from 0) with this N number, in the program that runs at `row`."""
        if self._sequence is None:
            self._sequence = {}
            for index, line in enumerate(self.lines):
                match = SEQUENCE.match(line)
                if match:
                    self._sequence.setdefault(int(match[1] or 0), []).append(index)
        return self._sequence.get(round(number), []) if number == round(number) else []

    def _block_numbered(self, row: int, what: str, number: float, column: int) -> int:
        """The line (from 0) of the block with this N number. Raises `InputError` unless there is one."""
        rows = self._numbered(row, number)
        if len(rows) != 1:
            places = ", ".join(str(self._place(duplicate).line) for duplicate in rows)
            other = f"which is in the lines {places}" if rows else "which no block has"
            raise self._fail(row, f"{what} N{number:g}, {other}", "one block with that number", column=column)
        return rows[0]

    def _return(self, row: int, flow: Flow | Word) -> int | None:
        """The line at which M99 continues; None if that is the beginning of the program, or a line before this one."""
        if not isinstance(flow, Word):
            return self._leave(row) if self._levels else None
        to = self._block_numbered(row, "M99 P goes to", flow.value, flow.column)
        if not self._levels:
            return to if to > row else None
        level = self._pop_level(row)
        if level.again or to < level.back:
            problem = f"M99 P goes back to line {to + 1} of the caller, or leaves out repeats of its own subprogram"
            raise self._fail(row, problem, "a block after the call, which is not repeated", column=flow.column)
        return to

    def _leave(self, row: int) -> int:
        level = self._levels[-1]
        if level.again:
            level.again -= 1
            return level.first
        self._pop_level(row)
        return level.back

    def _pop_level(self, row: int) -> Subprogram:
        leave_call(self.state, CurrentBlock(self.name, Block(row + 1, (Word("M", 99.0, 1, "the end of the call"),))))
        return self._levels.pop()

    def _target(self, row: int, call: Call) -> tuple[int, int]:
        """Program number and repeats of a call."""
        heads = self._heads()
        meanings = {(call.number, call.repeats or 1)}
        style = self.state.dialect.repeats_in_p
        if call.repeats is None and call.number >= REPEATS_IN_P and style is not False:
            repeats, number = divmod(call.number, REPEATS_IN_P)
            meanings = {(number, repeats)} if style else meanings | {(number, repeats)}
        known = [meaning for meaning in sorted(meanings) if meaning[0] in heads]
        if not known:
            names = " or ".join(f"O{number}" for number, _ in sorted(meanings))
            hint = "put the subprogram into the file, after the main program's M30"
            raise self._fail(row, f"M98 calls {names}, and the file has no such subprogram", "", hint, call.column)
        if len(known) > 1:
            both = f"O{call.number} or, {known[0][1]} times, O{known[0][0]}: the file has both"
            hint = "give the number of repeats as L"
            raise self._fail(row, f"M98 P{call.number} calls {both}", "", hint, call.column)
        return known[0]

    def _heads(self) -> dict[int, int]:
        """Program number -> line (from 0) of its O word; lines after the last tape mark belong to no program."""
        if self._programs is None:
            self._programs = {}
            started = False
            for index, line in enumerate(self.lines):
                if line.strip() == "%" and started:
                    break
                started = started or bool(line.strip())
                head = HEAD.match(line)
                number = int(head[1] or 0) if head else None
                if number in self._programs:
                    raise self._fail(index, f"O{number} is in line {self._programs[number] + 1} already")
                if number is not None:
                    self._programs[number] = index
        return self._programs
