"""A program written for another placement.

`rewrite_program` returns the text that, analyzed at the original origin, takes the tool along the placed path. Every
motion word has new numbers; everything else stays byte for byte: comments, line numbers, order, blank lines, tape
marks, line ends, upper and lower case. The rapid with which the tool comes from where the control was switched on is
the one move that cannot match.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from toolpath_stiff.errors import ProgramError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.nc.controller import LANGUAGES, UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.lines import read_text, split_lines
from toolpath_stiff.nc.moves import CUTTER_LOCATION, ReadProgram
from toolpath_stiff.nc.parametric.families import line_with_variables
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.poses import Pose, pose_in_mm
from toolpath_stiff.results import Result
from toolpath_stiff.rewriting.blocks import rewrite_block
from toolpath_stiff.rewriting.controls import Controls
from toolpath_stiff.rewriting.plain_language import write_placed
from toolpath_stiff.rewriting.side_shift import Course
from toolpath_stiff.rewriting.turn import Turn
from toolpath_stiff.units import mm_from_m

LINE_END = re.compile("\r\n|\n|\r")
PLAIN_DIALECTS = ("generic", "linuxcnc")
SLASHED = "blocks that begin with / were rewritten as executed: run the written program with the switch off"


@dataclass(frozen=True, repr=False)
class RewrittenProgram(Result):
    r"""A program written for another placement.

    Attributes
    ----------
    name, text, encoding
        The program's name, its text with line ends, and how the original was encoded.
    notes
        What the user should know, one sentence each.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> moved = tps.rewrite(slot, to_mm_deg=(10, 0, 0))
    >>> moved.content.splitlines()[3], moved.to_dict()["notes"]
    (b'G1 X50', [])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     moved.save(pathlib.Path(folder, "moved.nc")).name
    'moved.nc'
    """

    command: ClassVar[str] = "place"

    name: str
    text: str
    encoding: str
    notes: list[str]

    @property
    def content(self) -> bytes:
        """The file's bytes."""
        return self.text.encode(self.encoding)

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command."""
        return {"program": self.name, "text": self.text, "notes": self.notes}

    def __str__(self) -> str:
        return self.text

    def _short(self) -> str:
        return f"{self.name}, {len(self.text.splitlines())} lines"

    def save(self, file: str | Path) -> Path:
        """Write the program, whole or not at all."""
        return write_atomically(file, self.content)


def rewrite_program(
    program: ReadProgram,
    placement_origin: Pose,
    original_origin: Pose,
    *,
    decimals: int | None = None,
    linearise: float | None = None,
    control: Controller = UNKNOWN_CONTROL,
) -> RewrittenProgram:
    r"""Write a program so that at the original origin it does what it does, untouched, at a placement.

    Parameters
    ----------
    program
        As read; its file is read again for the line ends.
    placement_origin, original_origin
        Where program zero shall sit and sits, x, y, z in m, A, B, C in rad.
    decimals
        Of the numbers written; unless given, 4 in mm and degrees, 5 in inch.
    linearise
        m: arcs that lie in no plane any more, cycles that the set-up tilts and large turns of the tool are written as
        straight moves that stay within this of them. Unless given they are refused.
    control
        Offsets, tools and block-delete switches that the program was read with.

    Raises
    ------
    InputError
        A block cannot be expressed at the placement, with its line and the reason.

    Examples
    --------
    >>> from math import pi
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> program = parse_program("G21 G90 F600 (slot)\nG0 X0 Y0 Z5\nG1 Z-1\nX40\nM30\n", "slot.nc")
    >>> rewritten = rewrite_program(program, (0.1, 0.0, 0.8, 0.0, 0.0, pi / 2), (0.0, 0.0, 0.8, 0.0, 0.0, 0.0))
    >>> print(rewritten, end="")
    G21 G90 F600 (slot)
    G0 X100 Y0 Z5
    G1 Z-1
    X100 Y40
    M30
    """
    check_rewritable(program)
    stays = tuple(placement_origin) == tuple(original_origin)
    if stays or program.dialect in LANGUAGES:
        text, encoding = _text(program)
        if not stays:
            text = write_placed(program, text, _turn(placement_origin, original_origin), decimals, control)
        return RewrittenProgram(program.name, text, encoding, [])
    controls = _controls(program, control, placement_origin, original_origin, decimals)
    controls.linearise = linearise and mm_from_m(linearise)
    return _rewritten(program, controls, control)


def shift_program(
    program: ReadProgram,
    origin: Pose,
    courses: Mapping[int, Course],
    *,
    decimals: int | None = None,
    control: Controller = UNKNOWN_CONTROL,
) -> tuple[RewrittenProgram, list[int], dict[int, str]]:
    r"""A program with some moves on other courses; where each of its moves comes from; which moves must stay.

    The second is, for each of its moves, the row of the move that was there before; the third, for each row that no
    course may change, the reason.

    Parameters
    ----------
    program, decimals, control
        As of `rewrite_program`.
    origin
        Where program zero sits.
    courses
        Row of `program.moves` -> where that move goes instead (`side_shift.SideShift`). What does not move keeps its
        text; the words of what does get new numbers, and further blocks follow where a move becomes several.

    Raises
    ------
    InputError
        A block cannot be expressed so, with its line and the reason.

    Examples
    --------
    >>> import numpy as np
    >>> from toolpath_stiff.nc.reader import parse_program
    >>> from toolpath_stiff.rewriting.side_shift import SideShift
    >>> program = parse_program("G21 G90 F600\nG0 X0 Y0 Z0\nG1 X10\nG1 Y20 (wall)\nG1 X0\nM30\n", "slot.nc")
    >>> shift = SideShift(program.moves, {1: (np.array([0.0, 1.0]), np.array([-0.02, -0.02]))})  # mm, left is +
    >>> shifted, rows, fixed = shift_program(program, (0.0,) * 6, shift.courses)
    >>> print(shifted, end="")
    G21 G90 F600
    G0 X0 Y0 Z0
    G1 X10.02
    G1 Y20 (wall)
    G1 X0
    M30
    >>> rows, fixed
    ([0, 1, 2], {})
    """
    check_rewritable(program, shifted=True)
    controls = _controls(program, control, origin, origin, decimals)
    controls.courses = courses
    return _rewritten(program, controls, control), controls.row_of, controls.fixed


def _controls(
    program: ReadProgram, control: Controller, placement: Pose, original: Pose, decimals: int | None
) -> Controls:
    source, out = (Request((), program.name, origin=at, controller=control).start() for at in (placement, original))
    return Controls(source, out, _turn(placement, original), decimals, None)


def _turn(placement: Pose, original: Pose) -> Turn:
    return Turn(pose_in_mm(placement), pose_in_mm(original))


def _text(program: ReadProgram) -> tuple[str, str]:
    """A program's text with its line ends, and its encoding."""
    return read_text(program.path) if program.path else ("\n".join([*program.source, ""]), "utf-8")


def _rewritten(program: ReadProgram, controls: Controls, control: Controller) -> RewrittenProgram:
    text, encoding = _text(program)
    lines = list(_rewritten_lines(controls, text, program.name, control.switches))
    return RewrittenProgram(program.name, "".join(lines), encoding, sorted(controls.notes))


def check_rewritable(program: ReadProgram, shifted: bool = False) -> None:
    """Raise `InputError` for a program whose blocks are not those that a control of this machine executes.

    A frame places programs of Heidenhain's and Siemens' languages; `shifted` to one side they cannot be written.
    """
    if program.dialect in LANGUAGES and not (program.kinematics or shifted):
        return
    control = f"read by {program.interpreter!r} as {program.dialect!r}, not as one of {', '.join(PLAIN_DIALECTS)},"
    location = program.dialect == CUTTER_LOCATION
    refused = (
        (
            bool(program.kinematics),
            f"posted for another kinematics ({program.kinematics})",
            ", set the work so in the CAM system, and post it for this machine",
        ),
        (program.parametric, "with variables or O words", ", and set the work offset that is printed (G10)"),
        (location, "for a post processor (a cutter-location file)", ", or place the posted program"),
        (program.interpreter != "builtin" or program.dialect not in PLAIN_DIALECTS, control, ""),
    )
    for holds, what, instead in refused:
        if holds:
            hint = "post it as G code of the tool centre" if shifted else f"place it without --write{instead}"
            line = line_with_variables(program.source) if program.parametric else None
            raise ProgramError(f"a program {what} cannot be rewritten", hint=hint, file=program.name, line=line)


def _rewritten_lines(controls: Controls, text: str, name: str, switches: frozenset[int]) -> Iterator[str]:
    """Rewritten lines with their line ends; text after the program's end is left as it is."""
    lines, raw_lines, ends = split_lines(text, name), LINE_END.split(text), [*LINE_END.findall(text), ""]
    running, started = True, False
    for number, (line, raw, end) in enumerate(zip(lines, raw_lines, ends, strict=False), 1):
        written = [line]
        if running:
            block = read_block(line, number, name)
            left_out = block.optional and block.switch in switches
            if block.percent:
                running, started = not started, True
            elif not left_out:
                started = started or bool(block.words)
                written, running = rewrite_block(controls, block, line)
            elif block.words:  # it would be wrong once the switch is off
                problem = "a block that --block-delete leaves out cannot be rewritten"
                raise Place(name, number).fail(problem, hint="take it out of the program, or do without --block-delete")
            if block.optional and written != [line]:
                controls.notes.add(SLASHED)
        yield raw + end if written == [line] else (end or ends[0] or "\n").join(written) + end
