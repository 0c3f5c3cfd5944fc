"""Run of a program in Heidenhain's plain language: statements in order, labels, repeats, calls and jumps.

HEIDENHAIN, user's manual of the iTNC 530, "Programming: subprograms and program section repeats", "Q parameters". Plain
straight statements, most of a CAM system's program, are written as G0 and G1 and executed many at a time.
"""

import math
import re
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import PurePath

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import Code
from toolpath_stiff.nc.contouring.contour import SIDES
from toolpath_stiff.nc.contouring.drawing import drawing, elements_of
from toolpath_stiff.nc.elements import Element
from toolpath_stiff.nc.heidenhain.cycles import call, pattern
from toolpath_stiff.nc.heidenhain.expressions import CONDITIONS, PARAMETER, assigned, condition, work_out
from toolpath_stiff.nc.heidenhain.free_contour import CORNERS, FREE, NOT_DETERMINED
from toolpath_stiff.nc.heidenhain.functions import miscellaneous, retract
from toolpath_stiff.nc.heidenhain.plain_statements import EMPTY, as_g_code, corner_follows
from toolpath_stiff.nc.heidenhain.statements import PlainStatement, labels, read_statement
from toolpath_stiff.nc.heidenhain.system_data import SYSREAD, system_value
from toolpath_stiff.nc.heidenhain.vocabulary import look_up, meaning_of, refusal_of
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.plain_lines import PlainRun
from toolpath_stiff.nc.plain_words import PlainWords
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.run_records import Subprogram, Tally, beyond_the_end
from toolpath_stiff.nc.state import CurrentBlock, Flow
from toolpath_stiff.nc.words import Block, Word

CALLED = re.compile(r'\s*(?:(\d+|Q[LR]?\d+)|"([^"]*)")\s*(REP\s*(\d+|Q[LR]?\d+)?\s*(?:/\s*(?:\d+|Q[LR]?\d+))?)?\s*$')
END_OF_LABEL = re.compile(r"\s*0+\s*")
CONTOUR = frozenset(("RND", "CHF", "L", "LP", "C", "CP", "CR", "CT", "CTP", "LN", *FREE))
FORMULAS = ("FN0", "FN1", "FN2", "FN3", "FN4", "FN5", "FN6", "FN7", "FN8", "FN13")
DRAWS = CONTOUR | {"CC", "FPOL", "M", "LBL", "CALL LBL", *FORMULAS, *CONDITIONS}
OF_CONTROL = ("FN18", "FN28")
TO_MACHINE = ("M91", "M92")  # with these FMAX may lead to an unknown point
TILTING = ("Q120", "Q121", "Q122")  # positions of A, B, C that the control computes for a tilted plane


class HeidenhainRun(ProgramRun):
    """Run of a program in the plain language; parameters as for `ProgramRun`.

    Programs that CALL PGM names are looked for in the folder of the controller.
    """

    def __init__(self, request: Request, tally: Tally | None = None) -> None:
        super().__init__(request, tally, fast=False)
        self.state.plain.tool_feed, self.state.plain.drawn = request.controller.feed, self._drawn
        self._plain = self._lexer = PlainRun(self.state, as_g_code(self.lines), self.name)
        self._statements: dict[int, PlainStatement] = {}
        self._has_labels = any("LBL" in line.upper() for line in self.lines)  # without any no statement runs again
        self._labels: dict[int, dict[str, list[int]]] = {}  # by the first line of the program
        self._repeats: dict[tuple[int, int], int] = {}
        self._locals: list[dict[str, float]] = [{}]  # QL, one dictionary for each running program
        self._to_machine = False  # the statement is a rapid in machine coordinates

    def _tally_plain(self, first: int, words: PlainWords) -> None:
        """Count plain statements, which are all L."""
        rows = words.count.nonzero()[0]
        if self.tally is not None and len(rows):
            self._count(self._statement(first + int(rows[0])))
            self.tally.count["L"] += len(rows) - 1

    meaning = staticmethod(meaning_of)

    def _statement(self, row: int) -> PlainStatement:
        if row not in self._statements:
            if not self._has_labels:
                self._statements.clear()
            self._statements[row] = read_statement(self.lines, row, self.name)
        return self._statements[row]

    def _steered(self, row: int) -> int:
        """Carry out the statement at a line; returns the line where the run goes on."""
        self._count_block(row)
        statement = self._statement(row)
        if not statement.head or (statement.optional and 1 in self.switches):
            return statement.after
        self._count(statement)
        after, plain = self._acted(row, statement), self.state.plain
        waits = plain.modal or plain.unknown or plain.held or plain.approach or plain.held_tip or plain.doubt
        self._plain = None if waits or self.state.plane != "G17" else self._lexer
        return after

    def _count(self, statement: PlainStatement) -> None:
        if self.tally is None:
            return
        name = statement.head if look_up(statement.head) is None or statement.head[0] != "Q" else "Q"
        ms = [word for word in statement.words if word.letter[0] == "M" and word.letter[1:].isdigit()]
        for code, column in [(name, statement.column), *((word.letter, word.column) for word in ms)]:
            if code != "M":
                self.tally.add(code, statement.line, column)

    def _acted(self, row: int, statement: PlainStatement) -> int:
        head, code, plain = statement.head, look_up(statement.head), self.state.plain
        if code is None:
            problem, hint = refusal_of(head)
            raise self._fail(row, f"{head} {problem}", "", hint, statement.column)
        block = self._block_of(row, statement)
        plain.to_corner = corner_follows(self.lines, statement.after)
        if plain.free and head not in (*FREE, *CORNERS):
            raise plain.free[0][0].fail(None, NOT_DETERMINED, "more of its data, or L and C")
        if plain.held is not None and head not in CONTOUR and not head.startswith("DEP"):
            raise block.fail(None, "stands between a corner (CHF, RND) and the element behind it", "the element")
        with block.placing():
            self._act(block, head, code)
        flow = self._flow(row, statement, block)
        return len(self.lines) if block.flow is Flow.END or flow is None else flow

    def _act(self, block: CurrentBlock, head: str, code: Code) -> None:
        """Carry out a statement, its M functions, and the cycle that it calls."""
        plain = self.state.plain
        miscellaneous(self.state, block)
        if block.has("M140"):
            retract(self.state, block)
        once, modal = block.take("M99"), block.take("M89")
        before = len(self.state.recorder)
        code.act(self.state, block, head)
        unused = next((letter for letter in block.values if letter in block.free), None)
        if unused is not None and not head.startswith("APPR") and not plain.free and head not in FREE:
            raise block.fail(unused, f"is no word of {head}", "its own words")
        positioned = head in ("L", "LP") and (
            len(self.state.recorder) > before or bool(block.values.keys() & {*"XYZ", "IX", "IY", "IZ"})
        )
        if once is not None or ((modal is not None or plain.modal) and positioned):
            call(self.state, block)
        plain.modal = (plain.modal or modal is not None) and once is None

    def _block_of(self, row: int, statement: PlainStatement) -> CurrentBlock:
        """The statement with the numbers of its words."""
        words = list(statement.words)
        letters = {word.letter for word in words}
        self._to_machine = "FMAX" in letters and not letters.isdisjoint(TO_MACHINE)
        for place, text in statement.computed.items():
            word = words[place]
            # Axes that the control turns to a plane are 0, which is valid only in an untilted plane.
            turns = word.letter in ("A", "B", "C") and text.lstrip("+-") in TILTING
            with suppress(InputError) if statement.head.startswith("BLK") else nullcontext():  # a blank not known yet
                word = word._replace(value=math.nan)
                word = word._replace(value=0.0 if turns else self._value(row, text, word.column))
            words[place] = word
        line = statement.line if row < self._main_lines else self._line_of_call()
        head = Word("", 0.0, statement.column, statement.head)
        block = CurrentBlock(self.name, Block(line, (head, *words), optional=statement.optional))
        for word in words:
            block.add(word.letter, word)
        return block

    def _value(self, row: int, text: str, column: int) -> float:
        """Number of a word, as written or from a Q parameter."""
        if "Q" not in text:
            try:
                return float(text)
            except ValueError:
                raise self._fail(row, f"{text!r} is no number here", "a number", column=column) from None
        return (-1.0 if text[0] == "-" else 1.0) * self._parameter(text.lstrip("+-"))

    def _parameter(self, name: str) -> float:
        value = self._scope(name).get(name)
        if value is not None and (self._to_machine or not math.isnan(value)):
            return value
        known = {"Q108": self.state.plain.radius, "Q113": float(self.state.inch)}.get(name)
        if self._to_machine:
            return math.nan
        if known is None or math.isnan(known):
            reason = "a control keeps it from earlier programs, or works it out itself"
            raise self._fail(self._at, f"{name} is read before it is set: {reason}", f"FN 0: {name} = ... before")
        return known

    def _scope(self, name: str) -> dict[str, float]:
        """Dictionary that holds a parameter; nan: set by the control to an unknown value."""
        return self._locals[-1] if name.startswith("QL") else self.state.plain.parameters

    def _work_out(self, formula: str, place: Place) -> float:
        """Value of a formula; nan if one of its parameters is unknown."""
        unknown = any(math.isnan(self._scope(name).get(name, 0.0)) for name in PARAMETER.findall(formula))
        return math.nan if unknown else work_out(formula, self._parameter, place)

    def _flow(self, row: int, statement: PlainStatement, block: CurrentBlock) -> int | None:
        """Line where the run goes on after a statement, with parameters and jumps carried out; None at the end."""
        head, rest, after = statement.head, statement.rest, statement.after
        place = self._place(row)._replace(column=statement.begins)
        if head.startswith("CYCL DEF 2"):
            for word in block.values.values():
                scope = self._scope(word.letter) if word.letter[0] == "Q" else {}
                scope[word.letter] = word.value
                if word.text.endswith(("MAX", "AUTO")):  # which is no number there
                    del scope[word.letter]
        elif head == "PATTERN DEF":
            pattern(self.state, block, rest, lambda text: self._value(row, text.replace(",", "."), statement.begins))
        elif head == "CYCL DEF 14.1":
            self.state.plain.labels = [float(number) for number in re.findall(r"\d+", rest)]
        elif head in CONDITIONS:
            holds, number, name = condition(head, rest, self._parameter, place)
            return self._jump_back(row, self._label(row, number, name)) if holds else after
        elif head == "FUNCTION MODE" and rest.split() != ["MILL"]:
            raise self._fail(row, f"{head}{rest}: turning is not supported", "FUNCTION MODE MILL")
        elif head == "FN14":
            raise self._fail(row, f"the program stops with its error {rest.strip()}", "a program that runs through")
        elif head in OF_CONTROL or head.startswith("TCH"):  # what it reads is not known from here on, but for some
            reads = SYSREAD.match(rest) if head == "FN18" else None
            for name in PARAMETER.findall(rest) if reads is None else ():
                self._scope(name)[name] = math.nan
            if reads is not None:
                index = self._work_out(reads[4] or "0", place)
                self._scope(reads[1])[reads[1]] = system_value(self.state, reads[2], reads[3], index)
        elif (head[0] == "Q" and head[1] != "S") or head in FORMULAS:
            name, formula, place = assigned(head, rest, place)
            self._scope(name)[name] = self._work_out(formula, place)
        elif head == "CALL LBL":
            return self._call(row, statement)
        elif head == "CALL PGM":
            return self._program(row, statement)
        elif head == "END PGM" and not self._levels:
            return None
        elif head == "END PGM" or (head == "LBL" and self._levels and END_OF_LABEL.fullmatch(rest)):
            level = self._levels[-1]
            if head == "END PGM" and level.arguments is None:
                raise self._fail(row, f"the subprogram {level.name} of line {level.first + 1} has no end", "LBL 0")
            if head == "END PGM":
                self._locals.pop()
            return self._jump(row, self._leave(row)) if head == "END PGM" or level.arguments is None else after
        return after

    def _jump_back(self, row: int, to: int) -> int:
        """Jump to a label on a condition."""
        if to <= row:
            self._check_loop(row, to, (self.state.plain.parameters, self._locals, self._repeats))
        return self._jump(row, to)

    def _label(self, row: int, number: str | None, name: str | None) -> int:
        """Line of a label in the running program. Raises `InputError` if there is none."""
        first, stop = next((file[:2] for file in self._files if file[0] <= row < file[1]), (0, self._main_lines))
        if first not in self._labels:
            self._labels[first] = labels(self.lines, first, stop)
        shown = name if name is not None else f"{self._value(row, number or '', 1):g}"
        places = self._labels[first].get(shown, [])
        if len(places) != 1:
            raise self._fail(row, f"LBL {shown}: the program has {'several' if places else 'none'}", "one label")
        return places[0]

    def _drawn(self, block: CurrentBlock, label: float) -> tuple[list[Element], int]:
        """The contour of a label, with the side of its compensation, drawn beside the run."""
        state, base, side, row = self.state, len(self._levels), 0, self._label(self._at, f"{label:g}", None) + 1
        self.state = drawn = drawing(state)
        drawn.plain.parameters, drawn.plain.radius = state.plain.parameters, state.plain.radius
        drawn.plain.tool_feed = 1.0  # any: the cycle has its own
        try:
            while True:
                statement = self._statement(row)
                if statement.head == "LBL" and len(self._levels) == base and END_OF_LABEL.fullmatch(statement.rest):
                    break
                self._count_block(row)
                if statement.head and statement.head not in DRAWS and statement.head[0] != "Q":
                    problem = f"{statement.head} in a contour of cycle 14"
                    raise self._fail(row, problem, "contour elements, Q parameters")
                side = next((SIDES[word.letter] for word in statement.words if word.letter in SIDES), side)
                words = tuple(w._replace(letter="R0") if w.letter in SIDES else w for w in statement.words)
                row = self._acted(row, replace(statement, words=words)) if statement.head else statement.after
            self._end(row, "the contour")
            return elements_of(drawn, block, "a cycle"), side
        finally:
            self.state = state

    def _call(self, row: int, statement: PlainStatement) -> int:
        called = CALLED.match(statement.rest)
        if called is None:
            raise self._fail(
                row, f"CALL LBL{statement.rest[:30]}", "CALL LBL 1, CALL LBL 1 REP 3", column=statement.column
            )
        label, here = self._label(row, called[1], called[2]), (len(self._levels), row)
        if called[4] is None:
            self._begin(Subprogram(f"LBL {called[1] or called[2]}", label, statement.after, 0), row, statement.column)
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

    def _program(self, row: int, statement: PlainStatement) -> int:
        """First line of a called program, whose file is read if it is not loaded."""
        name = PurePath(statement.rest.strip().strip('"').replace("\\", "/")).name
        stem = name.removesuffix(".H")
        first = next((first for first, _, file in self._files if PurePath(file).stem.upper() == stem), None)
        if first is None:
            end = ("END PGM",)  # of what has none
            first = self._load(self._files_called(stem, (".H", "")), end, end)
            if first is None:
                problem = f"CALL PGM {name}: no folder of programs has it"
                expected = "--subprograms FOLDER, with that file; an empty one, if it moves nothing"
                raise self._fail(row, problem, expected, column=statement.column)
            self._lexer = PlainRun(self.state, as_g_code(self.lines), self.name)
        self._begin(Subprogram(name, first, statement.after, 0, {}), row, statement.column)
        self._locals.append({})
        return first

    def _end(self, row: int, what: str, ended: bool = False) -> list[Remark]:
        """Warning on text after END PGM; raises an error if a corner or an approach is still pending."""
        plain = self.state.plain
        if plain.free:
            raise plain.free[0][0].fail(None, NOT_DETERMINED, "more of its data, or L and C")
        if plain.held is not None or plain.approach is not None:
            raise self._fail(self._at, "the program ends before the element behind a corner or an APPR", "the element")
        statement = self._statements.get(self._at)
        rest = [line for line in self.lines[self._at + 1 : self._main_lines] if not EMPTY.fullmatch(line)]
        return beyond_the_end("END PGM", self._at, len(rest)) if statement and statement.head == "END PGM" else []
