"""Cutter-location files: the points, tool axes and feeds that CAM systems hand to post processors, in APT's words.

`statements` splits lines; `vocabulary` is the table of words, whose functions are in `modes` and `motion`; each takes
the `state` and a statement. `state` also makes moves of what `geometry` computes.

A file is read to `Program`, the same contract as the reader of G code, or checked, with all its errors.
"""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.controller import Controller, Switches
from toolpath_stiff.nc.cutter_location.modes import one_frame
from toolpath_stiff.nc.cutter_location.motion import to_point
from toolpath_stiff.nc.cutter_location.state import State
from toolpath_stiff.nc.cutter_location.statements import Statement, frame_in_comment, plain_point, read_statement
from toolpath_stiff.nc.cutter_location.vocabulary import execute, meaning_of
from toolpath_stiff.nc.geometry import ArcError
from toolpath_stiff.nc.moves import CUTTER_LOCATION, Program, Unsupported
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.tables import Offsets, ToolEntry
from toolpath_stiff.nc.words import any_statement

NO_CUT = "no cutting move"


NO_UNITS = "the file names no UNITS; its numbers are taken as mm"


# CATIA's heading of an operation, a comment; NX and Autodesk's posts have TOOL PATH/ and CSI_TOOL_PATH/.
OPERATION = re.compile(r"\s*\$\$\s*OPERATION NAME\s*:\s*(.*\S)", re.IGNORECASE)


PACKED_AT = 50_000  # moves


OnError = Callable[[InputError], None]


OnWord = Callable[[str, int], None]


def not_for(controller: Controller, offsets: Offsets | None, block_delete: Switches) -> tuple[str, ...]:
    """Warnings about what was asked for and means nothing to a cutter-location file."""
    given = (
        ("a dialect", controller.dialect.name != "generic"),
        ("work offsets", offsets is not None and any(offset.given for offset in offsets.table)),
        ("posted kinematics", controller.kinematics is not None),
        ("block-delete switches", bool(block_delete) or bool(controller.switches)),
        ("posted kinematics", controller.kinematics is not None),
    )
    return tuple(f"{what} mean nothing to a cutter-location file and are not used" for what, asked in given if asked)


def read(request: Request) -> Program:
    r"""Read a cutter-location file; lengths of the tool table win over the file's.

    Raises
    ------
    InputError
        With line and column, what was found and what was expected.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> parse_program("UNITS/MM\nFEDRAT/600,MMPM\nFROM/0,0,50\nGOTO/0,0,0\nGOTO/40,0,0\nFINI\n", "part.apt")
    <Program part.apt: 2 moves, read as cutter-location file>
    """
    state = State(request.name, copy.deepcopy(request.tools), feed=request.controller.feed)
    run(state, request.lines)
    if not state.recorder.cuts:
        raise _no_cut(request.name)
    warnings = not_for(request.controller, request.offsets, request.block_delete)
    return Program(
        name=request.name,
        path=request.path,
        source=request.lines,
        moves=state.recorder.moves(),
        origin=request.default_origin if request.origin is None else request.origin,
        origin_source="default" if request.origin is None else "option",
        unsupported=unsupported(state),
        warnings=(*warnings, *state.warnings),
        assumptions=tuple(state.assumptions),
        tools=tuple(state.used_tools.values()),
        dialect=CUTTER_LOCATION,
        marks=tuple(state.marks),
    )


def _no_cut(name: str) -> InputError:
    return ProgramError(NO_CUT, expected="GOTO/ after FEDRAT/, not after RAPID", file=name)


def run(state: State, lines: tuple[str, ...], on_error: OnError | None = None, on_word: OnWord | None = None) -> None:
    """Execute all lines in order.

    Parameters
    ----------
    state
        What is in force; it goes on from there.
    lines
        The file's.
    on_error
        Called with an error, after which the next statement is executed; without it errors are raised.
    on_word
        Called with the word and line of every statement.
    """
    at = 0
    while at < len(lines) and not state.ended:
        if len(state.recorder.line) > PACKED_AT:
            state.recorder.pack()
        here = at
        try:
            statement: Statement | None = Statement(at + 1, 1, "GOTO")
            point = plain_point(lines[at])
            if point is None:
                statement, at = read_statement(lines, at, state.name)
            else:
                at += 1
            if statement is None:
                _comment(state, lines, here)
            else:
                if on_word is not None:
                    on_word(statement.word, statement.line)
                _perform(state, statement, point)
        except InputError as error:
            if state.last_word == "END" and not any_statement(lines[here:]):  # notes that a CAM system writes behind it
                state.warnings.append(f"line {here + 1}: what follows END is no statement, and not read")
                break
            _pass_on(error, on_error)
            at = max(at, here + 1)
    if state.ended and any(line.strip() and not line.lstrip().startswith("$$") for line in lines[at:]):
        state.warnings.append(f"line {at}: FINI ends the file; what follows is not read")
    try:
        state.no_circle("the end of the file")
    except InputError as error:
        _pass_on(error, on_error)
    _conclude(state)


def _pass_on(error: InputError, on_error: OnError | None) -> None:
    if on_error is None:
        raise error
    on_error(error)


def _perform(state: State, statement: Statement, point: list[float] | None) -> None:
    """Execute a statement, whose numbers are known if it is a plain GOTO; geometry's errors get its place."""
    state.statement = statement
    try:
        if point is None:
            execute(state, statement)
        else:
            to_point(state, point)
    except ArcError as error:
        raise state.fail(error.found, error.expected) from None
    state.last_word = statement.word or state.last_word


def _comment(state: State, lines: tuple[str, ...], at: int) -> None:
    """What CAM systems say in comments: CATIA's operations, CATIA's and Creo's coordinate systems."""
    found = OPERATION.match(lines[at])
    if found:
        state.marks.append((at + 1, found[1]))
        return
    frame = frame_in_comment(lines, at)
    if frame is not None:
        state.statement = Statement(at + 1, 1, frame[0])
        one_frame(state, *frame, lines[at].strip()[:40])


def _conclude(state: State) -> None:
    """Warnings about the file as a whole."""
    if not state.units_said and len(state.recorder):
        state.assume(NO_UNITS)
    for noted in state.doubtful.values():
        statement = noted.statement
        state.warnings.append(f"line {statement.line}: {statement.shown}: {noted.reason}{noted.times}")
    if state.unsmooth and not state.smooth:
        state.warnings.append(
            f"line {state.first_unsmooth}: the tool turns back where this arc begins, and no arc of the file begins "
            "smoothly: check that the arcs turn the right way about their axes"
        )


def unsupported(state: State) -> tuple[Unsupported, ...]:
    """Words that were not acted upon, in the order of the file, each once."""
    both = sorted({**state.noted, **state.doubtful}.values(), key=lambda noted: noted.statement.line)
    return tuple(
        Unsupported(noted.statement.line, noted.statement.column, noted.statement.word, f"{noted.reason}{noted.times}")
        for noted in both
    )


@dataclass
class CheckedCutterLocation:
    """A cutter-location file read with all its errors.

    Attributes
    ----------
    state
        After the last statement.
    start, end
        What was in force before the first and after the last.
    errors
        Those found.
    used
        Words to the line where they stand first and how often.
    """

    state: State
    start: dict[str, str]
    end: dict[str, str] = field(default_factory=dict)
    errors: list[InputError] = field(default_factory=list)
    used: dict[str, list[int]] = field(default_factory=dict)

    def meanings(self) -> list[tuple[str, str, int, int]]:
        """Words used: word, meaning, first line, count."""
        return [(word, meaning_of(word), line, count) for word, (line, count) in self.used.items()]


def check(
    lines: tuple[str, ...],
    name: str,
    tools: dict[int, ToolEntry] | None,
    most_errors: int,
    feed: float | None = None,
) -> CheckedCutterLocation:
    """Check a cutter-location file: it goes on where `read` would stop, up to so many errors."""
    state = State(name, copy.deepcopy(tools), feed=feed)
    checked = CheckedCutterLocation(state, in_force(state))

    def on_error(error: InputError) -> None:
        checked.errors.append(error)
        if len(checked.errors) >= most_errors:
            raise error

    def on_word(word: str, line: int) -> None:
        if word in checked.used:
            checked.used[word][1] += 1
        elif word:
            checked.used[word] = [line, 1]

    try:
        run(state, lines, on_error, on_word)
    except InputError as error:
        if error not in checked.errors:
            checked.errors.append(error)
    if not checked.errors and not state.recorder.cuts:
        checked.errors.append(_no_cut(name))
    checked.end = in_force(state)
    return checked


def in_force(state: State) -> dict[str, str]:
    """What is in force, names to words."""
    i, j, k = state.next_axis
    feed = "none" if state.feed is None else f"{state.feed:g} mm/{'rev' if state.per_revolution else 'min'}"
    return {
        "units": "mm" if state.scale == 1.0 else "inch",
        "tool axis": f"{i:g} {j:g} {k:g}",
        "MULTAX": {None: "not given", True: "on", False: "off"}[state.multax],
        "feed": feed,
        "spindle": f"{state.speed:g} rpm",
        "tool": str(state.tool),
        "tool length": "reference" if math.isnan(state.tool_length) else f"{state.tool_length:g} mm",
        "cycle": "off" if state.cycle is None else "on",
    }
