"""Blocks to moves: in which order the blocks of a file run, and in which order the codes of a block act.

The meaning of each code is a function in `codes`, found in the table of `codes.registry`; here is the order alone
(LinuxCNC's manual, "G-Code Overview", "Order of Execution").

Subprograms are those of Fanuc's controls: O numbers within the file, after the main program or before it, called by
`M98 P1000 L2` or, with the repeats before the four digits of the number, `M98 P21000`; they end with M99. LinuxCNC
reads the first form alike. `M97 P100` (Haas) and `M98 Q100` (Fanuc) call the block N100 of the file, up to an M99.
Modal state goes through a call unchanged.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import Code, code_name
from toolpath_stiff.nc.codes.cutter import check_block
from toolpath_stiff.nc.codes.drilling import CYCLES, begin_cycle
from toolpath_stiff.nc.codes.motion import homes_standing
from toolpath_stiff.nc.codes.offsets import HOLDS_TIP, list_numbers
from toolpath_stiff.nc.codes.points import read_numbers
from toolpath_stiff.nc.codes.registry import CODES, INCH_METRIC, REFUSED, m_parameters
from toolpath_stiff.nc.codes.saved import leave_level
from toolpath_stiff.nc.groups import LAST_MODE
from toolpath_stiff.nc.moves import Jump
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.state import POINT_WORDS, Call, CurrentBlock, Flow, GoTo, State, Then
from toolpath_stiff.nc.tables import LARGEST_MM, LARGEST_WORD
from toolpath_stiff.nc.words import AXES, CORNERS, Block, Word, leader, read_block

if TYPE_CHECKING:
    from toolpath_stiff.nc.plain_lines import PlainRun
    from toolpath_stiff.nc.plain_words import PlainWords


COORDINATES = frozenset((*AXES, "@"))
WORDS_THAT_ACT = ("F", "S", "T")


def execute(state: State, block: Block) -> Then:
    """Execute a block; returns what runs after it. Raises `InputError` at a word, or at the block."""
    if not block.words:
        return Flow.NEXT
    return finish(state, begin(state, block))


def begin(state: State, block: Block) -> CurrentBlock:
    """Take a block's codes and set its modes, not moving yet; doing so twice changes nothing but dwells."""
    current = sort_words(state, block)
    read_numbers(state, current)
    check_block(state, current)
    for code in _in_order(current, ahead=True):
        code.act(state, current, code.name)
    if any(word.letter == "M" for word in block.words):
        m_parameters(state, current)
    return current


def finish(state: State, block: CurrentBlock) -> Then:
    """Offsets and moves of the block begun; returns what runs after it."""
    _check_axis_words(block)
    for code in _in_order(block, ahead=False):
        code.act(state, block, code.name)
    pending = state.corner
    _move(state, block)
    for letter in CORNERS:
        if block.has(letter):
            CODES[letter].act(state, block, letter)
    if pending is not None and state.corner is pending:
        raise block.fail(
            None, f"line {pending.line} makes a corner ({pending.letter}) with this block", "a feed move (G1)"
        )
    list_numbers(state, block)
    for letter in sorted(block.free):
        raise block.fail(letter, "is not used by any code of its block", hint="remove it")
    return block.flow


def _in_order(block: CurrentBlock, ahead: bool) -> list[Code]:
    """The codes and words of a block that set modes (`ahead`), or act after those, in the order of execution."""
    found = [code for name in block.groups.values() if (code := CODES[name]).when != "motion"]
    found += [CODES[letter] for letter in WORDS_THAT_ACT if letter in block.values]
    return sorted((code for code in found if (code.rank <= LAST_MODE) == ahead), key=lambda code: code.rank)


# -- the words of a block --------------------------------------------------------------------------------------------


def sort_words(state: State, block: Block) -> CurrentBlock:
    """Sort the words; repeated words and two codes of one group are errors."""
    current = CurrentBlock(state.name, block)
    for word in block.words:
        if word.letter == "G":
            _sort_g(state, current, word)
        elif word.letter == "M":
            _sort_m(state, current, word)
        elif word.letter == "O":
            state.note(block.line, word, "program number")
        elif word.letter in current.values:
            raise current.fail(word, f"repeats the word {word.letter} of its block", "each word once")
        else:
            current.values[word.letter] = word
    current.free = set(current.values)
    for letter in ("U", "V", "W"):
        if letter in current.values and not homes_standing(current, letter):
            raise current.fail(letter, "moves an axis that this machine does not have", "X Y Z A B C")
    for letter, word in current.values.items():
        if letter in COORDINATES:
            if abs(word.value) > LARGEST_MM:
                raise current.fail(word, "is beyond 100 m", f"at most {LARGEST_MM:g}")
        elif abs(word.value) > LARGEST_WORD:
            raise current.fail(word, "is beyond any number that a control takes", f"at most {LARGEST_WORD:.0f}")
    return current


def _sort_g(state: State, block: CurrentBlock, word: Word) -> None:
    name = code_name("G", word.value)
    if name == state.dialect.holds_tip:
        name = HOLDS_TIP
    if name in INCH_METRIC:
        if not state.dialect.inch_metric:
            raise block.fail(word, f"is {state.dialect.g70[0]}, which is not supported", hint=state.dialect.g70[1])
        name = INCH_METRIC[name]
    _refuse(block, word, name)
    code = CODES.get(name)
    if code is not None and code.listed and state.dialect.name not in code.controls:
        raise block.fail(word, f"is not a code of the dialect {state.dialect.name}", " or ".join(code.controls))
    if code is None:
        raise block.fail(word, "is not a G code that is known", hint="check the program, or post it without it")
    if code.listed:
        state.note(block.line, word, code.listed)
    other = block.groups.get(code.group)
    if other is not None:
        if code.group == "non-modal":  # LinuxCNC's modal group 0
            raise block.fail(word, f"and {other} both act once, in this block", "one of them in a block")
        # `G0 G17 G40 G49 G80 G90`, the usual first block: G80 ends a cycle, the other code says what follows.
        if name == "G80" and other != "G80":
            return
        if other != "G80" or name == "G80":
            raise _same_group(block, word, other, code.group)
    block.groups[code.group] = name
    block.codes[name] = word


def _sort_m(state: State, block: CurrentBlock, word: Word) -> None:
    name = code_name("M", word.value)
    _refuse(block, word, name)
    code = CODES.get(name)
    if code is None:  # it may run anything, a change of kinematics included; its parameters go with it
        state.note(block.line, word, "an M code of one control, not acted upon")
        state.warnings.append(f"line {block.line}: what {word.text} does on its control is not known")
        for other in block.block.words:
            if other.letter in "PQE":
                state.note(block.line, other, f"parameter of {word.text}")
        return
    if code.group in block.groups:
        raise _same_group(block, word, block.groups[code.group], code.group.removeprefix("M "))
    block.groups[code.group] = name
    block.codes[name] = word
    if code.listed:
        state.note(block.line, word, code.listed)


def _refuse(block: CurrentBlock, word: Word, name: str) -> None:
    if name in REFUSED:
        raise block.fail(word, f"is {REFUSED[name].what}, which is not supported", hint=REFUSED[name].hint)


def _same_group(block: CurrentBlock, word: Word, other: str, group: str) -> Exception:
    return block.fail(word, f"and {other} are both of the modal group {group!r}", "one of them in a block")


def _check_axis_words(block: CurrentBlock) -> None:
    """Two codes that use the axis words of their block are an error."""
    present = [
        name for group in ("non-modal", "rotation", "tool length") if (name := block.groups.get(group)) is not None
    ]
    takers = [name for name in present if CODES[name].takes_axes]
    moving = block.groups.get("motion")
    if takers in (["G28"], ["G30"]) and moving in ("G0", "G1"):  # it homes, and that motion mode holds afterwards
        return
    if len(takers) > 1 or (takers and moving and moving != "G80"):
        other = moving if moving and len(takers) == 1 else takers[0]
        word = block.codes[takers[-1]]
        raise block.fail(word, f"and {other} both use the axis words of their block", "two blocks")


# -- the moves of a block --------------------------------------------------------------------------------------------


def _move(state: State, block: CurrentBlock) -> None:
    """Change the motion mode, and move as the block asks."""
    given = block.groups.get("motion")
    if given is not None:
        if given in (*CYCLES, "G80") and state.dialect.increments and state.motion not in CYCLES:
            state.group_01 = state.motion
        if given in CYCLES:
            begin_cycle(state, given)
        state.motion = given
        if given == "G80":
            CODES[given].act(state, block, given)
    once = block.groups.get("non-modal")
    instead = once if once is not None and CODES[once].when == "motion" else None  # G53
    if state.motion is None:
        for letter in POINT_WORDS:
            if block.has(letter):
                raise block.fail(letter, "has no motion mode to move in", "G0, G1, G2, G3 or a cycle before it")
        if instead is not None:
            raise block.fail(instead, "without G0 or G1")
    else:
        mode = instead or state.motion
        CODES[mode].act(state, block, mode)


# -- the blocks of a file ----------------------------------------------------------------------------------------------

DEEPEST = 10  # calls within calls (LinuxCNC, and Fanuc's series 30i; older controls have 4)
MOST_BLOCKS = 1_000_000  # run in subprograms; a count beyond is a slip in a number of repeats
MOST_REPEATS = 9999
FEWEST_LINES = 50  # of a program; below, loading what reads many lines at once costs more than it saves
SEQUENCE = re.compile(r"\s*+(?:/\d?\s*+)?[nN]\s*+0*+(\d{0,17}+)(?![\d.])", re.ASCII)
HEAD = re.compile(r"\s*+(?:/\s*+)?[oO:]\s*+0*+(\d{0,17}+)\s*+(?:[(;].*)?$", re.ASCII)
LABEL = re.compile(r"\s*(%\s*\d+)\s*", re.ASCII)
REPEATS_IN_P = 10_000  # P with more than four digits holds the repeats before them


@dataclass
class Subprogram:
    """A subprogram that runs: its name, first line (from 0), where to go on, and how often it runs again."""

    name: str
    first: int
    back: int
    again: int


def beyond_the_end(what: str, at: int, lines: int) -> str:
    """The warning that lines follow what ends a program in line `at` (from 0)."""
    return f"what follows {what} in line {at + 1} is not part of the program (lines: {lines})"


def without_label(state: State, lines: tuple[str, ...]) -> tuple[str, ...]:
    """The lines, without what stands behind the first tape mark in the dialect fanuc, whose controls skip that."""
    first = next((index for index, line in enumerate(lines) if line.strip()), 0)
    label = LABEL.fullmatch(lines[first]) if lines and state.dialect.name == "fanuc" else None
    if label is None:
        return lines
    state.note(first + 1, Word("%", 0.0, label.start(1) + 1, label[1]), "program number")
    return (*lines[:first], "%", *lines[first + 1 :])


class ProgramRun:
    """Runs the blocks of a file on a control.

    Parameters
    ----------
    state
        Of the control at the start; the blocks change it.
    lines, name
        The file.
    switches
        The block-delete switches that are on, 1 to 9: blocks that begin with their slash are left out.
    fast
        Whether plain lines are executed many at a time; the moves are the same.
    """

    def __init__(
        self, state: State, lines: tuple[str, ...], name: str, switches: frozenset[int], fast: bool = True
    ) -> None:
        self.state, self.lines, self.name = state, without_label(state, lines), name
        self._plain: PlainRun | None = None
        if fast and len(lines) >= FEWEST_LINES:
            from toolpath_stiff.nc.plain_lines import PlainRun

            self._plain = PlainRun(state, lines, name)
        self.switches = switches
        self._levels: list[Subprogram] = []
        self._programs: dict[int, int] | None = None
        self._sequence: dict[int, list[int]] | None = None
        self._called: dict[int, Block] = {}  # blocks of subprograms by line, from 0: each is read once
        self._blocks = 0
        self.jumps: list[Jump] = []

    def run(self) -> list[str]:
        """Run to the program's end; returns warnings. Raises `InputError` with the line."""
        at, percent, numbered = leader(self.lines, self.name, self.state.dialect.semicolon), False, False
        if at:
            self.state.warnings.append(f"what stands before the tape mark (%) in line {at + 1} is not read")
        while at < len(self.lines):
            if self._plain is not None and not self._levels:
                words = self._plain.execute(at)
                if words is not None:
                    self._executed(at, words)
                    percent = percent or bool(words.count.any())
                    at += len(words)
                    continue
            steered = self._steered(at)
            if steered is not None:
                at = steered
                continue
            block = self._block(at)
            if block.percent:
                if percent:
                    return self._end(at, "%")
                percent = True
            elif block.words:
                percent = True  # from the first word on, a tape mark is the last one
                if block.words[0].letter == "O":
                    self._check_head(block, numbered)
                    numbered = True
                if not (block.optional and block.switch in self.switches):
                    self.state.level = len(self._levels)
                    flow = self._execute(block)
                    if flow is Flow.END:
                        return self._end(at, "the program's end", ended=True)
                    if isinstance(flow, Call):
                        at = self._jump(at, self._enter(at, flow))
                        continue
                    if flow is Flow.RETURN or isinstance(flow, GoTo):
                        to = self._return(at, flow)
                        if to is None:
                            return [
                                f"M99 in line {at + 1}, outside any subprogram, makes the control start the program "
                                "again, without end: it is read once",
                                *self._end(at, "M99"),
                            ]
                        at = self._jump(at, to)
                        continue
            at += 1
        return self._end(len(self.lines) - 1, "the file")

    def _steered(self, at: int) -> int | None:
        """Where the run goes on, of a line that only says that; None: its words act."""
        return None

    def _block(self, at: int) -> Block:
        if not self._levels:
            return self._read(at)
        self._blocks += 1
        if self._blocks > MOST_BLOCKS:
            raise self._fail(at, f"the subprograms run more than {MOST_BLOCKS} blocks", "fewer repeats")
        block = self._called.get(at)
        if block is None:
            block = self._called[at] = self._read(at)
        return block

    def _execute(self, block: Block) -> Then:
        return execute(self.state, block)

    def _executed(self, at: int, words: PlainWords) -> None:
        """Plain lines from `at` were executed; `words` are theirs."""

    def _read(self, at: int) -> Block:
        block = read_block(self.lines[at], at + 1, self.name, self.state.dialect.semicolon)
        return block if block.rest is None else block.executed(self.switches)

    def _fail(self, at: int, found: str, expected: str = "", hint: str = "", column: int | None = None) -> InputError:
        return self._place(at).fail(found, expected, hint, column)

    def _place(self, at: int) -> Place:
        return Place(self.name, at + 1)

    def _check_head(self, block: Block, numbered: bool) -> None:
        """A program number within a program: the next one begins where this one did not end."""
        if self._levels:
            raise self._unended(block.line - 1)
        if (numbered or len(self.state.recorder)) and self.state.dialect.name != "linuxcnc":
            raise self._fail(
                block.line - 1,
                f"{block.words[0].text} begins another program before the first one has ended",
                "M30 or M2 before it",
                column=block.words[0].column,
            )

    def _unended(self, at: int) -> InputError:
        level = self._levels[-1]
        return self._fail(at, f"the subprogram {level.name}, which begins in line {level.first + 1}, has no end", "M99")

    def _end(self, at: int, what: str, ended: bool = False) -> list[str]:
        """A warning if anything but tape marks and the subprograms that ran follows the end."""
        if self._levels and not ended:
            raise self._unended(at)
        rest = [
            line
            for index, line in enumerate(self.lines[at + 1 :], at + 1)
            if line.strip() not in ("", "%") and index not in self._called and index + 1 not in self._called
        ]
        if not rest:
            return []
        return [beyond_the_end(what, at, len(rest))]

    # -- calls -----------------------------------------------------------------------------------------------------

    def _enter(self, at: int, call: Call) -> int:
        """The line at which the called subprogram begins."""
        code = "M98" if not call.local else "M97" if self.state.dialect.local_calls else "M98 Q"
        if call.local:
            name, repeats, first = f"N{call.number}", call.repeats or 1, self._block_numbered(at, f"{code} calls", call)
        else:
            number, repeats = self._target(at, call)
            name, first = f"O{number}", self._heads()[number] + 1
        if not 1 <= repeats <= MOST_REPEATS:
            raise self._fail(at, f"{code} with {repeats} repeats", f"1 to {MOST_REPEATS}", column=call.column)
        if any(level.name == name for level in self._levels):
            raise self._fail(at, f"{code} calls {name}, which is running: it would never end", column=call.column)
        if len(self._levels) == DEEPEST:
            raise self._fail(at, f"more than {DEEPEST} subprograms within each other", column=call.column)
        if not call.local and first == self._main + 1:
            raise self._fail(at, f"M98 calls {name}, the main program itself", column=call.column)
        self._levels.append(Subprogram(name, first, at + 1, repeats - 1))
        return first

    def _jump(self, at: int, to: int) -> int:
        self.jumps.append(Jump(len(self.state.recorder), at + 1, to))
        return to

    def _block_numbered(self, at: int, what: str, call: Call | GoTo) -> int:
        """The line (from 0) of the block with an N number. Raises `InputError` unless there is one."""
        if self._sequence is None:
            self._sequence = {}
            for index, line in enumerate(self.lines):
                match = SEQUENCE.match(line)
                if match:
                    self._sequence.setdefault(int(match[1] or 0), []).append(index)
        found = self._sequence.get(call.number, [])
        if len(found) != 1:
            places = ", ".join(str(index + 1) for index in found)
            raise self._fail(
                at,
                f"{what} N{call.number}, which is in the lines {places}"
                if found
                else f"{what} N{call.number}, and the file has no such block",
                "one block with that number",
                column=call.column,
            )
        return found[0]

    def _return(self, at: int, flow: Flow | GoTo) -> int | None:
        """The line at which M99 goes on; None where that is the beginning of the program, or before this line."""
        if not isinstance(flow, GoTo):
            return self._leave(at) if self._levels else None
        to = self._block_numbered(at, "M99 P goes to", flow)
        if not self._levels:
            return to if to > at else None
        self._restore(at)
        level = self._levels.pop()
        if level.again or to < level.back:
            raise self._fail(
                at,
                f"M99 P goes back to line {to + 1} of the caller, or leaves out repeats of its own subprogram",
                "a block after the call, which is not repeated",
                column=flow.column,
            )
        return to

    def _restore(self, at: int) -> None:
        """The caller's modes, where M73 has saved them."""
        found = leave_level(self.state, len(self._levels))
        if found:
            raise self._fail(at, f"the subprogram that saved modes with M73 returns where {found}")

    def _leave(self, at: int) -> int:
        self._restore(at)
        level = self._levels[-1]
        if level.again:
            level.again -= 1
            return level.first
        self._levels.pop()
        return level.back

    def _target(self, at: int, call: Call) -> tuple[int, int]:
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
            raise self._fail(
                at,
                f"M98 calls {names}, and the file has no such subprogram",
                hint="put the subprogram into the file, after the main program's M30",
                column=call.column,
            )
        if len(known) > 1:
            raise self._fail(
                at,
                f"M98 P{call.number} calls O{call.number} or, {known[0][1]} times, O{known[0][0]}: the file has both",
                hint="give the number of repeats as L",
                column=call.column,
            )
        return known[0]

    def _heads(self) -> dict[int, int]:
        """Program number -> line (from 0) of its O word; what follows the last tape mark is not part of one."""
        if self._programs is None:
            self._programs = {}
            started = False
            for index, line in enumerate(self.lines):
                if line.strip() == "%" and started:
                    break
                started = started or bool(line.strip())
                head = HEAD.match(line)
                if head is None:
                    continue
                number = int(head[1] or 0)
                if number in self._programs:
                    raise self._fail(index, f"O{number} is in line {self._programs[number] + 1} already")
                self._programs[number] = index
        return self._programs

    @cached_property
    def _main(self) -> int:
        """The line of the main program's own number; -1 if it has none."""
        for index, line in enumerate(self.lines):
            if HEAD.match(line):
                return index
            if line.strip() not in ("", "%") and not line.lstrip().startswith("("):
                break
        return -1
