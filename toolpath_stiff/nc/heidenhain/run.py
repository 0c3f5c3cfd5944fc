"""Runs a program in Heidenhain's plain language: its statements one after another, labels, repeats, calls and jumps.

HEIDENHAIN, user's manual of the iTNC 530, "Programming: subprograms and program section repeats", "Q parameters". Plain
straight statements, most of a CAM system's program, are written as G0 and G1 and executed many at a time.
"""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.heidenhain.cycles import AUTO, MAX, call
from toolpath_stiff.nc.heidenhain.expressions import CONDITIONS, assigned, condition
from toolpath_stiff.nc.heidenhain.functions import miscellaneous, retract
from toolpath_stiff.nc.heidenhain.plain_statements import EMPTY, as_g_code, corner_follows
from toolpath_stiff.nc.heidenhain.points import WORDS_OF_AXES
from toolpath_stiff.nc.heidenhain.statements import PlainStatement, labels, read_statement
from toolpath_stiff.nc.heidenhain.vocabulary import look_up, meaning_of, refusal_of
from toolpath_stiff.nc.lines import read_lines
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.plain_lines import PlainRun
from toolpath_stiff.nc.plain_words import PlainWords
from toolpath_stiff.nc.program_run import DEEPEST, ProgramRun, Tally, beyond_the_end
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.state import CurrentBlock, Flow
from toolpath_stiff.nc.tables import LARGEST_MM, LARGEST_WORD

MOST_STEPS = 1_000_000  # statements that run, all repeats counted
MOST_IDLE = 100_000  # of them without a move between
CALLED = re.compile(r'\s*(?:(\d+|Q[LR]?\d+)|"([^"]*)")\s*(REP\s*(\d+|Q[LR]?\d+)?\s*(?:/\s*\d+)?)?\s*$')
SPECIAL = {"MAX": MAX, "FMAX": MAX, "AUTO": AUTO, "FAUTO": AUTO}
CONTOUR = frozenset(("RND", "CHF", "L", "LP", "C", "CP", "CR", "CT", "CTP", "LN"))
FORMULAS = ("FN0", "FN1", "FN2", "FN3", "FN4", "FN5", "FN6", "FN7", "FN8", "FN13")
TILTING = ("Q120", "Q121", "Q122")  # positions of A, B, C that the control works out for a tilted plane


class HeidenhainRun(ProgramRun):
    """A run of a program in the plain language; parameters as of `ProgramRun`.

    Programs that CALL PGM names are looked for in the folder of the controller.
    """

    def __init__(self, request: Request, tally: Tally | None = None) -> None:
        super().__init__(request, tally, fast=False)
        self.folder = request.controller.subprograms
        self._lex()
        self._main_lines = len(self.lines)
        self._statements: dict[int, PlainStatement] = {}
        self._labels: dict[int, dict[str, list[int]]] = {}  # by the first line of their program
        self._files: list[tuple[int, int, str]] = []  # first line, line after the last, name
        self._returns: list[tuple[int, int]] = []  # of calls: the line after, and the label's line (-1: a program)
        self._repeats: dict[tuple[int, int], int] = {}
        self._locals: list[dict[str, float]] = [{}]
        self._steps = 0
        self._passes: dict[int, str] = {}  # what a condition found when it went back last
        self._moved = (0, 0)
        self._row = 0

    def _lex(self) -> None:
        """Write plain statements as G code."""
        self._to_corner = [corner_follows(self.lines, row + 1) for row in range(len(self.lines))]
        texts, self._poles = as_g_code(self.lines, self._to_corner)
        self._plain = self._lexer = PlainRun(self.state, texts, self.name)

    def _tally_plain(self, first: int, words: PlainWords) -> None:
        """Count plain statements; circle centre and direction as the last ones left them."""
        plain, rows, unit = self.state.plain, words.count.nonzero()[0] + first, self.state.length_scale
        centers = [row for row in range(first, first + len(words.code)) if row in self._poles]
        if centers:
            x, y = self._poles[centers[-1]]
            plain.pole = (x * unit, y * unit)
        if len(rows):
            plain.heading, last = None, self.state.recorder.parts[-1] if self.state.recorder.parts else None
            plain.fast = bool(words.code[rows[-1] - first] == 0)
            if last is not None and last.line[-1] == rows[-1] + 1 and last.end[-1, 2] == last.start[-1, 2]:
                ahead = last.end[-1] - last.start[-1]
                if last.arc_sweep[-1]:
                    ahead = np.cross(last.arc_sweep[-1] * last.arc_normal[-1], last.end[-1, :3] - last.arc_center[-1])
                plain.heading = (float(ahead[0]), float(ahead[1])) if ahead[0] or ahead[1] else None
        for row in [*rows.tolist(), *centers] if self.tally is not None else ():
            statement = self._statement(row)
            self._count(statement)

    def _place(self, row: int) -> Place:
        """File and line (from 1) of a line that is read."""
        in_files = (Place(name, row - first + 1) for first, stop, name in self._files if first <= row < stop)
        return next(in_files, super()._place(row))

    @staticmethod
    def meaning(code: str) -> str:
        """What a statement, or an M function, is taken for."""
        return meaning_of(code)

    def _statement(self, row: int) -> PlainStatement:
        if row not in self._statements:
            self._statements[row] = read_statement(self.lines, row, self.name)
        return self._statements[row]

    def _steered(self, row: int) -> int:
        """Carry out the statement in a line; where the run goes on."""
        self._row = row
        self._steps += 1
        moves = len(self.state.recorder)
        if moves != self._moved[0]:
            self._moved = (moves, self._steps)
        if self._steps > MOST_STEPS or self._steps - self._moved[1] > MOST_IDLE:
            raise self._fail(row, "a loop that never ends, or never moves", f"at most {MOST_STEPS} statements")
        try:
            return self._carried_out(row, self._statement(row))
        except InputError as error:
            if row >= self._main_lines:  # its block stands on the line that calls its file
                error.file, error.line, _ = self._place(row)
            raise

    def _carried_out(self, row: int, statement: PlainStatement) -> int:
        if not statement.head or (statement.optional and 1 in self.switches):
            return statement.after
        if self.tally is not None:
            self._count(statement)
        after = self._acted(row, statement)
        plain = self.state.plain
        waits = (
            self.state.plane != "G17"
            or plain.modal
            or plain.unknown
            or plain.held
            or plain.approach
            or plain.held_tip
            or plain.doubt
        )
        self._plain = None if waits else self._lexer
        return after

    def _count(self, statement: PlainStatement) -> None:
        assert self.tally is not None
        name = statement.head if look_up(statement.head) is None or statement.head[0] != "Q" else "Q"
        ms = [word for word in statement.words if word[0][0] == "M" and word[0][1:].isdigit()]
        for code, column in [(name, statement.column), *((word[0], word[2]) for word in ms)]:
            if code != "M":
                self.tally.first.setdefault(code, (statement.line, column))
                self.tally.count[code] += 1

    def _acted(self, row: int, statement: PlainStatement) -> int:
        head, code = statement.head, look_up(statement.head)
        if code is None:
            problem, hint = refusal_of(head)
            raise self._fail(row, f"{head} {problem}", "", hint, statement.column)
        block = self._block_of(row, statement)
        self.state.plain.to_corner = self._to_corner[statement.after - 1]
        waits = self.state.plain.held is not None and head not in CONTOUR
        if waits and not head.startswith("DEP"):
            raise block.fail(None, "stands between a corner (CHF, RND) and the element behind it", "the element")
        miscellaneous(self.state, block)
        if block.has("M140"):
            retract(self.state, block)
        once, modal = block.take("M99"), block.take("M89")
        before = len(self.state.recorder)
        try:
            code.act(self.state, block, head)
        except InputError as error:
            if error.column != statement.column or str(error.found).startswith(head):
                raise
            place = Place(error.file or self.name, error.line or 0, error.column)
            raise place.fail(f"{head}: {error.found}", error.expected or "", error.hint or "") from None
        plain = self.state.plain
        unused = next((letter for letter in block.values if letter in block.free), None)
        if unused is not None and not head.startswith("APPR"):
            raise block.fail(unused, f"is no word of {head}", "its own words")
        positioned = head in ("L", "LP") and (len(self.state.recorder) > before or bool(block.values.keys() & {*"XYZ"}))
        if once is not None or ((modal is not None or plain.modal) and positioned):
            call(self.state, block)
        plain.modal = (plain.modal or modal is not None) and once is None
        flow = self._flow(row, statement)
        return len(self.lines) if block.flow is Flow.END or flow is None else flow

    def _block_of(self, row: int, statement: PlainStatement) -> CurrentBlock:
        """The statement with the numbers of its words."""
        words = statement.block(lambda *word: self._word_value(row, *word))
        calls = [back for back, label in self._returns if label < 0]  # the first is of the main program
        block = CurrentBlock(self.name, replace(words, line=calls[0]) if calls else words)
        for word in words.words[1:]:
            block.refuse_if(word.letter in block.values, word, "repeats a word of its statement", "each word once")
            largest = LARGEST_MM if word.letter in WORDS_OF_AXES else LARGEST_WORD
            block.refuse_if(abs(word.value) > largest, word, "is beyond 100 m, or any number of a control")
            block.values[word.letter] = word
        block.free = set(block.values)
        return block

    def _word_value(self, row: int, key: str, text: str, column: int) -> float:
        """The number of a word; of axes that the control turns to a plane 0, which counts in an untilted one alone."""
        turns = key in ("A", "B", "C") and text.lstrip("+-") in TILTING
        return 0.0 if turns else self._value(row, text, column)

    def _value(self, row: int, text: str, column: int) -> float:
        """The number of a word: as written, or of a Q parameter."""
        if text in SPECIAL:
            return SPECIAL[text]
        if "Q" not in text:
            try:
                return float(text)
            except ValueError:
                raise self._fail(row, f"{text!r} is no number here", "a number", column=column) from None
        sign, name = (-1.0 if text[0] == "-" else 1.0), text.lstrip("+-")
        return sign * self._parameter(name)

    def _parameter(self, name: str) -> float:
        values = self._locals[-1] if name.startswith("QL") else self.state.plain.parameters
        if name in values:
            return values[name]
        known = {"Q108": self.state.plain.radius, "Q113": float(self.state.inch)}.get(name)
        if known is None or math.isnan(known):
            reason = "a control keeps it from earlier programs, or works it out itself"
            raise self._fail(self._row, f"{name} is read before it is set: {reason}", f"FN 0: {name} = ... before")
        return known

    def _assign(self, row: int, name: str, value: float) -> None:
        (self._locals[-1] if name.startswith("QL") else self.state.plain.parameters)[name] = value

    def _flow(self, row: int, statement: PlainStatement) -> int | None:
        """Where the run goes on after a statement, whose parameters and jumps are carried out; None: nowhere."""
        head, rest, after = statement.head, statement.rest, statement.after
        if head.startswith("CYCL DEF 2") and "." not in head:
            for key, written, column, _ in statement.words:
                if key[0] == "Q" and written not in SPECIAL and written != "PREDEF":
                    self._assign(row, key, self._value(row, written, column))
        elif head in CONDITIONS:
            holds, number, name = condition(head, rest, self._parameter, self._place(row))
            return self._condition_jump(row, self._label(row, number, name)) if holds else after
        elif head == "FUNCTION MODE" and rest.split() != ["MILL"]:
            raise self._fail(row, f"{head}{rest}: turning is not supported", "FUNCTION MODE MILL")
        elif head == "FN14":
            raise self._fail(row, f"the program stops with its error {rest.strip()}", "a program that runs through")
        elif head[0] == "Q" or head in FORMULAS:
            self._assign(row, *assigned(head, rest, self._parameter, self._place(row)))
        elif head == "LBL":
            return self._end_of_subprogram(row, statement)
        elif head == "CALL LBL":
            return self._call(row, statement)
        elif head == "CALL PGM":
            return self._program(row, statement)
        elif head == "END PGM":
            if self._returns:
                back, label = self._returns.pop()
                if label < 0:
                    self._locals.pop()
                    return self._jump(row, back)
                raise self._fail(row, f"the subprogram of line {label + 1} has no end", "LBL 0")
            return None
        return after

    def _condition_jump(self, row: int, to: int) -> int:
        """Go to a label; back to it only if anything has changed since the last time."""
        frames = self.state.frames
        kept = self.state.plain.parameters, self._locals[-1], frames.position, frames.g92, frames.linear
        now = repr((len(self.state.recorder), kept))
        if to <= row and self._passes.get(row) == now:
            raise self._fail(row, "a loop that never ends: no parameter or position changes", "one that ends")
        self._passes[row] = now
        return self._jump(row, to)

    def _label(self, row: int, number: str | None, name: str | None) -> int:
        """The line of a label in the program that runs. Raises `InputError` unless there is one."""
        program = self._program_of(row)
        if program not in self._labels:
            stop = next((stop for first, stop, _ in self._files if first == program), self._main_lines)
            self._labels[program] = labels(self.lines, program, stop)
        shown = name if name is not None else f"{self._value(row, number or '', 1):g}"
        places = self._labels[program].get(shown, [])
        if len(places) != 1:
            raise self._fail(row, f"LBL {shown}: the program has {'several' if places else 'none'}", "one label")
        return places[0]

    def _program_of(self, row: int) -> int:
        return next((first for first, stop, _ in self._files if first <= row < stop), 0)

    def _end_of_subprogram(self, row: int, statement: PlainStatement) -> int:
        if not re.match(r"\s*0+\s*$", statement.rest) or not self._returns or self._returns[-1][1] < 0:
            return statement.after
        return self._jump(row, self._returns.pop()[0])

    def _call(self, row: int, statement: PlainStatement) -> int:
        called = CALLED.match(statement.rest)
        if called is None:
            raise self._fail(
                row, f"CALL LBL{statement.rest[:30]}", "CALL LBL 1, CALL LBL 1 REP 3", column=statement.column
            )
        label, here = self._label(row, called[1], called[2]), (len(self._returns), row)
        if called[3] is None or called[4] is None:
            self._enter_call(row, statement.after, label)
            return self._jump(row, label)
        if label > row:
            raise self._fail(row, "CALL LBL with REP repeats what stands before it", "a label before it")
        left = self._repeats.get(here)
        count = self._value(row, called[4], 1) if left is None else float(left)
        if count < 1.0 or count != int(count):
            self._repeats.pop(here, None)
            if count:
                raise self._fail(row, f"REP {count:g}", "a whole number from 1")
            return statement.after
        self._repeats[here] = int(count) - 1
        return self._jump(row, label)

    def _enter_call(self, row: int, back: int, label: int) -> None:
        if len(self._returns) >= DEEPEST:
            raise self._fail(row, f"more than {DEEPEST} calls within each other", "calls that end")
        self._returns.append((back, label))
        if label < 0:  # QL parameters belong to a program
            self._locals.append({})

    def _program(self, row: int, statement: PlainStatement) -> int:
        """Read the file of a program that is called, unless it is there; its lines follow those that are read."""
        name = Path(statement.rest.strip().strip('"').replace("\\", "/")).name
        stem = name.removesuffix(".H")
        known = next((first for first, _, file in self._files if Path(file).stem.upper() == stem), None)
        if known is None:
            files = sorted(Path(self.folder).iterdir()) if self.folder and stem else []
            named = (file for file in files if file.suffix.upper() in (".H", "") and file.stem.upper() == stem)
            file = next((file for file in named if file.is_file()), None)
            if file is None:
                problem = f"CALL PGM {name}: no folder of programs has it"
                raise self._fail(row, problem, "--subprograms FOLDER, with that file", column=statement.column)
            known = len(self.lines) + 1
            self.lines = (*self.lines, "END PGM", *read_lines(file))  # which ends what has no END PGM before it
            self._files.append((known, len(self.lines), file.name))
            self._lex()
        self._enter_call(row, statement.after, -1)
        return known

    def _end(self, row: int, what: str, ended: bool = False) -> list[Remark]:
        """A warning about what follows END PGM; an error where a corner or an approach still waits."""
        plain = self.state.plain
        if plain.held is not None or plain.approach is not None:
            raise self._fail(self._row, "the program ends before the element behind a corner or an APPR", "the element")
        statement = self._statements.get(self._row)
        rest = [line for line in self.lines[self._row + 1 : self._main_lines] if not EMPTY.fullmatch(line)]
        return beyond_the_end("END PGM", self._row, len(rest)) if statement and statement.head == "END PGM" else []
