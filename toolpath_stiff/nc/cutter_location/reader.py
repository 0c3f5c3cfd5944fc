"""Reader of cutter-location files: the points, tool axes and feeds of a CAM system's output, in APT words.

`statements` splits lines; `vocabulary` is the table of words, whose functions are in `modes`, `motion` and `cycles`;
each takes the `state` and a statement. `state` also makes moves of what `circles` and `tool_axes` compute.

A file is read to `ReadProgram`, the same contract as the reader of G code, or checked, with all its errors.
"""

import copy
import math
import re
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.cutter_location.modes import one_frame
from toolpath_stiff.nc.cutter_location.motion import to_point
from toolpath_stiff.nc.cutter_location.state import CutterLocationState
from toolpath_stiff.nc.cutter_location.statements import MajorStatement, frame_in_comment, plain_point, read_statement
from toolpath_stiff.nc.cutter_location.vocabulary import execute, meaning_of
from toolpath_stiff.nc.geometry import GeometryError
from toolpath_stiff.nc.languages import any_statement
from toolpath_stiff.nc.moves import CUTTER_LOCATION, PACKED_AT, ReadProgram, Remark
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.run_records import Tally

NO_UNITS = "the file names no UNITS; its numbers are taken as mm"
# CATIA's heading of an operation, a comment; NX and Autodesk's posts have TOOL PATH/ and CSI_TOOL_PATH/.
OPERATION = re.compile(r"\s*\$\$\s*OPERATION NAME\s*:\s*(.*\S)", re.IGNORECASE)


def not_for(request: Request) -> list[Remark]:
    """Warning about requested options that do not apply to a cutter-location file."""
    controller = request.controller
    given = {
        "a dialect": controller.dialect.name != "generic",
        "work offsets": any(offset.given for offset in request.work_offsets.table),
        "posted kinematics": controller.kinematics is not None,
        "block-delete switches": bool(request.controller.switches),
    }
    return [Remark(f"{what} do not apply to a cutter-location file") for what in given if given[what]]


class CutterLocationRun(ProgramRun):
    r"""Run of a cutter-location file; parameters as of `ProgramRun`. The tool table's lengths win over the file's.

    Examples
    --------
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> parse_program("UNITS/MM\nFEDRAT/600,MMPM\nFROM/0,0,50\nGOTO/0,0,0\nGOTO/40,0,0\nFINI\n", "part.apt")
    <ReadProgram part.apt: 2 moves, read as cutter-location file>
    """

    meaning = staticmethod(meaning_of)
    cuts_by = "GOTO/ after FEDRAT/, not after RAPID"
    state: Any  # a `CutterLocationState`

    def __init__(self, request: Request, tally: Tally | None = None) -> None:
        self.request, self.lines, self.name, self.tally = request, request.lines, request.name, tally
        controller = request.controller
        self.state = CutterLocationState(request.name, tools=copy.deepcopy(controller.tools), feed=controller.feed)

    def program(self, ending: list[Remark]) -> ReadProgram:
        """Program made by the run."""
        request, state = self.request, self.state
        return request.program(
            state,
            origin=request.default_origin if request.origin is None else request.origin,
            origin_source="default" if request.origin is None else "option",
            warnings=(*not_for(request), *state.warnings),
            assumptions=tuple(state.assumptions),
            dialect=CUTTER_LOCATION,
            marks=tuple(state.marks),
        )

    def run(self) -> list[Remark]:
        """Execute all lines in order."""
        state, lines, index = self.state, self.lines, 0
        while index < len(lines) and not state.ended:
            state.recorder.pack(PACKED_AT)
            here, index = index, index + 1
            statement: MajorStatement | None = MajorStatement(here + 1, 1, "GOTO")
            point = plain_point(lines[here])
            try:
                if point is None:
                    statement, index = read_statement(lines, here, self.name)
                if statement is None:
                    _take_comment(state, lines, here)
                else:
                    self._execute_statement(statement, point)
            except InputError as error:
                if state.last_word == "END" and not any_statement(lines[here:]):  # only notes of a CAM system follow
                    state.warnings.append(Remark("what follows END is no statement, and not read", here + 1))
                    break
                if self.tally is None:
                    raise
                self.tally.keep(error)
        if state.ended and any(line.strip() and not line.lstrip().startswith("$$") for line in lines[index:]):
            state.warnings.append(Remark("FINI ends the file; what follows is not read", index))
        self._tried(state.no_circle, "the end of the file", None)
        _conclude(state)
        return []

    def _execute_statement(self, statement: MajorStatement, point: list[float] | None) -> None:
        """Execute a statement, with its numbers if it is a plain GOTO; errors of geometry get its place."""
        state, word = self.state, statement.word
        state.statement = statement
        if word and self.tally is not None:
            self.tally.add(word, statement.line, 1)
        try:
            if point is None:
                execute(state, statement)
            else:
                to_point(state, point)
        except GeometryError as error:
            raise state.fail(error.found, error.expected) from None
        state.last_word = word or state.last_word


def _take_comment(state: CutterLocationState, lines: tuple[str, ...], index: int) -> None:
    """Take information that CAM systems put in comments: CATIA's operations, CATIA's and Creo's coordinate systems."""
    operation, frame = OPERATION.match(lines[index]), frame_in_comment(lines, index)
    state.on_contour = state.on_contour or "OUTPUT_ON_PROFILE" in lines[index]
    if operation:
        state.marks.append((index + 1, operation[1]))
    elif frame is not None:
        state.statement = MajorStatement(index + 1, 1, frame[0])
        one_frame(state, *frame, lines[index].strip()[:40])


def _conclude(state: CutterLocationState) -> None:
    """Warnings about the file as a whole."""
    if not state.units_given and len(state.recorder):
        state.assume(NO_UNITS)
    state.warnings += state.doubted.values()
    unknown = [str(number) for number, tool in state.used_tools.items() if number and math.isnan(tool.length)]
    if unknown:
        text = f"LOADTL without a length (tools {', '.join(unknown)}): they are taken as long as the reference tool"
        state.warnings.append(Remark(f"{text}; --tools FILE gives them"))
    if state.turning_back and not state.smooth:
        text = "the tool turns back where this arc begins, and no arc of the file begins smoothly: "
        remark = Remark(f"{text}check that the arcs turn the right way about their axes", state.turning_back[0])
        state.warnings.append(remark)
