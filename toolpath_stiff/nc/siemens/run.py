"""Run of a program in Siemens' language: a parametric run with Siemens' words, labels, loops and calls.

SIEMENS, SINUMERIK 840D sl, Programming Manual Job Planning, "Flexible NC programming", "Program section repetition",
"Subprogram technique". Plain blocks of G0 to G3 are executed many at a time, as those of G code.
"""

import math
import re
from collections.abc import Iterator
from itertools import zip_longest

from toolpath_stiff.nc.lines import code_text
from toolpath_stiff.nc.moves import Remark
from toolpath_stiff.nc.parametric.formulas import Value
from toolpath_stiff.nc.parametric.run import ParametricRun, Step
from toolpath_stiff.nc.parametric.statements import Statement, Steering
from toolpath_stiff.nc.parametric.variables import Values
from toolpath_stiff.nc.plain_lines import PlainRun
from toolpath_stiff.nc.plain_words import PlainWords
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.run_records import Subprogram, Tally, beyond_the_end
from toolpath_stiff.nc.siemens.blocks import carry_out, draw, sort_words, straight
from toolpath_stiff.nc.siemens.contours import contour_ends
from toolpath_stiff.nc.siemens.coordinates import bring_back, modes_of
from toolpath_stiff.nc.siemens.expressions import NAME, SET_HERE, SiemensScanner, array_of
from toolpath_stiff.nc.siemens.programs import PROGRAM, heads_of, is_head, labels_of, line_of, plain_texts, programs_of
from toolpath_stiff.nc.siemens.tools import set_data
from toolpath_stiff.nc.siemens.vocabulary import meaning_of
from toolpath_stiff.nc.siemens.words import chosen, range_of, read_words, section_of, steering_of
from toolpath_stiff.nc.state import LATHE_HINT, CurrentBlock, Flow, Then
from toolpath_stiff.nc.words import AXES, Block, Word

OFFSET = re.compile(r"\bG(?:5[4-7]|5(?:0[5-9]|[1-9]\d))(?!\d)")
CHANGE = re.compile(r"(?<![A-Z])M0*6(?!\d)")
OF_LATHES = re.compile(r"\bG(?:18|96)(?!\d)|\bLIMS\b|\bDIAM(?:ON|90)\b")
ALONG_Y = re.compile(r"(?<![A-Z_$])Y\s*[-+=\d.]")
IN_MACHINE = re.compile(r"\b(?:SUPA|G53|G153)\b")
BY_TEXT, PATH = ("CALL", "EXTCALL"), re.compile(r"^(?:.*/)?(?:_N_)?|[._][SM]PF$")
PARAMETER = re.compile(r"(VAR\s+)?(REAL|INT|BOOL)\s+(\w+)\s*(\[[^]]*\])?(?:\s*=\s*([^,)]+))?", re.ASCII)
INDEX = re.compile(r"(?<=[\[,])[A-Z_]\w*(?=[\],])", re.ASCII)
END_OF_FILE, SUFFIXES = "%_N__END_SPF", (".SPF", ".MPF", "")
SEARCHED = ("$P_SEARCH", "$P_SEARCHL", "$P_ISTEST", "$P_SIM", "$P_DRYRUN")
RUNS = "the program runs from its beginning, not searched, tested or simulated ($P_SEARCH, $P_ISTEST, $P_SIM)"


class SiemensRun(ParametricRun):
    """A run of a program in Siemens' language; parameters as of `ProgramRun`.

    Subprograms are sections of the file (`%_N_NAME_SPF`), or files NAME.SPF in the folder of the controller.
    """

    def __init__(self, request: Request, tally: Tally | None = None) -> None:
        super().__init__(request, tally)
        self.lines = (*self.lines, END_OF_FILE)
        self._texts: dict[str, str] = {}
        self._whole: set[str] = set()  # variables of type INT
        self._homes = False
        self._calls: list[tuple[int, int]] = []  # first and last row of the contours that CYCLE62 called
        self._milled = False  # by a cycle behind them
        self._lex()
        plain, text = self.state.plain, "\n".join(map(code_text, self.lines))
        self._of_lathe = None if ALONG_Y.search(text) else OF_LATHES.search(text)
        plain.offsets_named, plain.changes_by_t = OFFSET.search(text) is not None, CHANGE.search(text) is None
        self.state.motion, plain.feed_place = "G1", "CFC"  # a control's state at power-on

    def _lex(self) -> None:
        """Find programs and labels; plain blocks are left to the reader of plain lines."""
        self._begins = heads_of(self.lines)
        self._labels, self._subs = labels_of(self._begins), programs_of(self._begins)
        begins = {row for row in self._subs.values() if any(code_text(text).strip() for text in self.lines[:row])}
        self._ends = begins | {row for row, text in enumerate(self.lines) if text == END_OF_FILE}
        self._tangent = any(re.search(r"\bCT\b", begin.string) for begin in self._begins)  # needs directions
        self._plain = self._lexer = PlainRun(self.state, plain_texts(self.lines, self._begins), self.name)

    def run(self) -> list[Remark]:
        """Run to the program's end; a lathe's program is refused. Returns warnings."""
        if self._of_lathe is not None:
            row = self._of_lathe.string.count("\n", 0, self._of_lathe.start())
            raise self._fail(row, f"a lathe's program: {self._of_lathe[0]} and never Y", "a mill's", LATHE_HINT)
        return super().run()

    meaning = staticmethod(meaning_of)

    def _tally_plain(self, first: int, words: PlainWords) -> None:
        super()._tally_plain(first, words)
        self.state.plain.heading = None
        if self.state.absolute:
            self.state.plain.renumbered -= {axis for axis, letter in enumerate(AXES) if letter in words.values}

    def _scanner(self, row: int, begin: int) -> SiemensScanner:
        text = self._begins[row].string
        columns, place = range(1, len(text) + 2), self._place(row)
        return SiemensScanner(text, columns, place, "Siemens' language", False, begin, lookup=self._variable)

    def _code(self, row: int) -> SiemensScanner:
        """Scanner of a block behind its number and label."""
        return self._scanner(row, self._begins[row].end())

    def _statement(self, row: int) -> Statement:
        if row not in self._statements:
            begin = self._begins[row]
            slash = begin[1] or begin[4] or ""
            block = Block(row + 1, (), optional=bool(slash), switch=int(slash[1:] or 1) or 1)
            steering = None
            if not is_head(self._begins[row]):
                steering = steering_of(self._code(row), lambda place: lambda _: self._scanner(row, place).real())
            self._statements[row] = Statement(block, steering=steering)
        return self._statements[row]

    def _read(self, row: int) -> Block:
        statement, code = self._statement(row), self._begins[row].string
        self._homes = IN_MACHINE.search(code) is not None
        if row in self._called:
            return self._called[row]
        line = row + 1 if row < self._main_lines else self._line_of_call()
        if is_head(self._begins[row]):
            return Block(line, ())
        words = read_words(self._code(row), self._define)
        block = Block(line, tuple(words), statement.block.optional, switch=statement.block.switch)
        if row < self._main_lines and self._lexer.lines[row] != "?":
            self._called[row] = block
        return block

    # Variables

    def _scope(self, name: str) -> tuple[Values, str]:
        """Dictionary that holds a variable (R parameters: common to all programs), and its key, index as number."""
        name = INDEX.sub(self._index, name) if "[" in name else name
        parameter, base = re.fullmatch(r"R\[?(\d+)\]?", name), name.partition("[")[0]
        if parameter:
            return self.variables.common, f"R{parameter[1]}"
        called = next((level for level in reversed(self._levels) if level.stop < 0), None)
        if called is not None and base in called.references:
            scope, other = called.references[base]
            return scope, other + name.removeprefix(base)
        return self.variables.levels[-1], name

    def _index(self, found: re.Match[str]) -> str:
        """The value of a variable used as an index; the name of an axis is kept."""
        scope, name = self._scope(found[0])
        return f"{scope[name]:g}" if name in scope else found[0]

    def _variable(self, name: str, column: int) -> Value:
        """The value of a variable; nan for a machine builder's one in a move in machine coordinates."""
        scope, name = self._scope(name)
        value = scope.get(name, scope.get(array_of(name)))
        if name in self._texts:
            return self._texts[name]
        if name == "$P_TOOLR" and not math.isnan(self.state.plain.radius):
            return self.state.plain.radius / self.state.length_scale
        if name in SEARCHED:
            self.state.assume(RUNS)
            return False
        if value is not None and not math.isnan(value):
            return value
        if self._homes and scope is not self.variables.common:
            return math.nan
        problem = (
            f"{name} is read before it is set: a control keeps it from earlier programs, or its builder defines it"
        )
        raise self._fail(self._at, problem, f"{name}=... before", column=column)

    def _define(self, name: str, value: Value, column: int, kind: str) -> None:
        """Set a variable; `kind`: its type if it is declared here."""
        scope, name = self._scope(name)
        if not isinstance(value, str) and set_data(self.state, name, value):
            return
        array, machine = array_of(name), SET_HERE.match(name)
        if machine is not None:
            value = value if machine[1] else math.nan
        elif not (kind or scope is self.variables.common or scope.keys() & {name, array} or name in self._texts):
            problem = f"{name} is no variable that is declared, and no address that is known"
            raise self._fail(self._at, problem, f"DEF REAL {name}, R parameters", column=column)
        if kind == "INT":
            self._whole.add(name)
        if isinstance(value, str):
            self._texts[name] = value
        elif isinstance(scope.get(name), bool):
            scope[name] = bool(value)
        else:
            whole = bool({name, array} & self._whole) and math.isfinite(value)
            scope[name] = float(math.floor(value + 0.5)) if whole else value

    # Blocks

    def _execute(self, block: Block) -> Then:
        state, plain = self.state, self.state.plain
        if self._plain is not None and not self._tangent and straight(state, block):
            return Flow.NEXT
        current = sort_words(state, block, self.tally)
        if "CYCLE62" in current.codes:
            self._calls = [*self._calls * (not self._milled), self._contour_rows(current)]
            self._milled = False
        if "CYCLE72" in current.codes:
            plain.contour = draw(state, current, self._contour(current))
        with current.placing():
            carry_out(state, current)
        slow = plain.held or plain.side or plain.unknown or plain.transformed or plain.base == "machine"
        slow = slow or plain.rounding > 0.0
        self._plain = None if slow or (plain.renumbered and not state.absolute) else self._lexer
        called = any(level.stop < 0 for level in self._levels)
        return Flow.RETURN if current.flow is Flow.END and called else current.flow

    def _contour_rows(self, block: CurrentBlock) -> tuple[int, int]:
        """First and last row of a contour."""
        first, last = contour_ends(block)
        if last:
            begin, stop = (self._to_label(self._at, "GOTO", label) for label in (first, last))
            return begin, stop
        begin = self._sub(first, self._at, block.block.words[0].column) + 1
        return begin, min(end for end in (*self._ends, len(self.lines)) if end > begin) - 1

    def _contour(self, block: CurrentBlock) -> Iterator[Block]:
        """Blocks of the contour of CYCLE72: its own, or that of the CYCLE62 before it."""
        called = self._calls and not (block.values["KNAME"].text if "KNAME" in block.values else "")
        block.refuse_if(called and len(self._calls) > 1, None, "CYCLE72 behind several CYCLE62", "one contour")
        self._milled = self._milled or bool(called)
        begin, stop = self._calls[-1] if called else self._contour_rows(block)
        block.take("KNAME")
        for row in range(begin, stop + 1):
            steering = self._statement(row).steering
            if steering is not None and steering.kind == "RET":
                return
            block.refuse_if(steering, None, "CYCLE72 along a contour with jumps, loops or calls", "moves alone")
            yield self._read(row)

    # Flow

    def _ends_before(self, row: int) -> bool:
        return False  # an end-of-file line closes each file

    def _step(self, kind: str) -> Step | None:
        return SIEMENS_STEPS.get(kind) or super()._step(kind)

    def _steered(self, row: int) -> int | None:
        if row in self._ends:
            return self._return(row, Flow.RETURN)
        if self._levels and self._levels[-1].stop == row:
            return self._leave(row)
        return super()._steered(row)

    def _return(self, row: int, flow: Flow | Word) -> int:
        """M17, RET, the end of a program: the line after the call, or the end of the run."""
        while self._levels and self._levels[-1].stop >= 0:
            self._levels.pop()
        if self._levels and self._levels[-1].kept and not bring_back(self.state, self._levels[-1].kept):
            raise self._fail(row, "SAVE brings back frames that the subprogram changed", "TRANS before its end")
        return self._leave(row) if self._levels else len(self.lines)

    def _scanner_of(self, row: int, text: str) -> SiemensScanner:
        """Scanner of an expression in text that is not part of the line."""
        return SiemensScanner(text, [1] * (len(text) + 1), self._place(row), "", lookup=self._variable)

    def _to_label(self, row: int, way: str, label: str) -> int:
        """The line of a label; sections that are repeated and do not hold it end."""
        to = line_of(self._labels.get(label, []), self._ends, row, way)
        if to is None:
            raise self._fail(row, f"{way} {label}: the program has no such label there", "LABEL: before a block")
        while self._levels and self._levels[-1].stop >= 0 and not self._levels[-1].first <= to < self._levels[-1].stop:
            self._levels.pop()
        return to

    def _jump_to(self, row: int, steering: Steering) -> int | None:
        way, label = steering.label.split()
        stays = (steering.values and not self._value(steering)) or (way == "GOTOC" and label not in self._labels)
        return None if stays else self._to_label(row, way, label)

    def _case(self, row: int, steering: Steering) -> int | None:
        way = chosen(self._code(row))
        return self._to_label(row, *way) if way else None

    def _section(self, row: int, steering: Steering) -> int | None:
        """REPEAT, REPEATB: run the blocks from a label on again."""
        kind, label, last, times = section_of(self._code(row))
        if not times:
            return None
        first = self._to_label(row, "REPEAT", label)
        if last or kind == "REPEATB":
            stop = (self._to_label(first, "GOTO", last) if last else first) + 1
        elif first < row:
            stop = next((end for end in self._labels.get("ENDLABEL", []) if first < end < row), row)
        else:
            stop = self._to_label(first, "GOTOF", "ENDLABEL")
        self._begin(Subprogram(label, first, row + 1, times - 1, stop=stop), row, steering.column)
        return first

    def _for(self, row: int, steering: Steering) -> int | None:
        name, first, last = range_of(self._code(row))
        self._define(name, first, steering.column, "")
        return None if first <= last else self._structure.end[row] + 1

    def _end_for(self, row: int, steering: Steering) -> int | None:
        start = self._structure.start[row]
        name, _, last = range_of(self._code(start))
        value = self._variable(name, steering.column)
        assert not isinstance(value, str)
        again = value + 1.0 <= last
        self._define(name, value + 1.0 if again else math.nan, steering.column, "")  # what it then holds is not said
        return start + 1 if again else None

    def _until(self, row: int, steering: Steering) -> int | None:
        return None if self._value(steering) else self._structure.start[row] + 1

    def _call_sub(self, row: int, steering: Steering) -> int | None:
        name, scanner = steering.label, self._code(row)
        if scanner.part(NAME) in BY_TEXT:
            name = PATH.sub("", str(scanner.result()).upper())
        first = self._sub(name, row, steering.column) + 1
        level = Subprogram(name, first, row + 1, 0)
        heads = (PROGRAM.match(code_text(line)) for line in self.lines[first - 1 : first + 19])
        proc = next((head[3] for head in heads if head is not None and head[2]), "")
        level.arguments, level.references = self._bound(row, proc, scanner)
        times = scanner.times()
        scanner.refuse_if(not scanner.done, f"{scanner.rest()} behind the call of {name}", "a block of its own")
        level.again = times - 1
        if times:
            self._begin(level, row, steering.column)
            level.kept = modes_of(self.state) if re.search(r"\bSAVE\b", proc) else {}
        return first if times else None

    def _sub(self, name: str, row: int, column: int) -> int:
        """The line that a subprogram begins with, in the file or in one of the folder."""
        files = () if name in self._subs else self._files_called(name, SUFFIXES)
        if self._load(files, (f"%_N_{name}_SPF",), (END_OF_FILE,)) is not None:
            self._structure_known = None
            self._lex()
        if name not in self._subs:
            problem = f"{name} is no word that is known, and no subprogram of the file or of a folder"
            expected = "--subprograms FOLDER, with that file; an empty one, if it moves nothing"
            raise self._fail(row, problem, expected, column=column)
        return self._subs[name]

    def _bound(
        self, row: int, proc: str, scanner: SiemensScanner
    ) -> tuple[dict[str, float | None], dict[str, tuple[Values, str]]]:
        """PROC's parameters with the values of a call; those by reference (VAR), with the variables that they name."""
        parameters = PARAMETER.findall(proc)
        named = {place for place, (by, *_) in enumerate(parameters) if by}
        values = scanner.arguments(named) if scanner.sign("") and scanner.begins("(") else []
        bound, references = dict[str, float | None](), dict[str, tuple[Values, str]]()
        missing = any(values[place : place + 1] in ([], [None], [""]) for place in named)
        by_value = any(array and not by for by, _, _, array, _ in parameters)
        if len(values) > len(parameters) or missing or by_value:
            problem = f"a call with {len(values)} values; PROC has {len(parameters)}"
            raise self._fail(row, problem, "values of REAL, INT, BOOL, and the names of variables for VAR")
        for (by, kind, name, _, default), value in zip_longest(parameters, values):
            if by:
                references[name] = self._scope(str(value))
                continue
            given = self._scanner_of(row, default or "0").result() if value is None else value
            bound[name] = bool(given) if kind == "BOOL" else float(given)
        return bound, references

    def _end(self, row: int, what: str, ended: bool = False) -> list[Remark]:
        if self.state.plain.held is not None:
            raise self._fail(self._at, "the program ends before the move behind a corner (RND, CHF, CHR)", "the move")
        stop = min((end for end in self._ends if end > row), default=self._main_lines)
        texts = [code_text(line).strip() for line in self.lines[row + 1 : stop]]
        rest = [text for text in texts if text not in ("", "%") and not text.startswith("GROUP_END")]
        return beyond_the_end(what, row, len(rest)) if row < self._main_lines else []


SIEMENS_STEPS: dict[str, Step] = {
    "JUMP": SiemensRun._jump_to, "CASE": SiemensRun._case, "FOR": SiemensRun._for, "ENDFOR": SiemensRun._end_for,
    "UNTIL": SiemensRun._until, "SECTION": SiemensRun._section, "CALL": SiemensRun._call_sub,
    "ENDLOOP": SiemensRun._back,
    **dict.fromkeys(("RET", "ENDPROC"), lambda run, row, steering: run._return(row, Flow.RETURN)),
}  # fmt: skip
