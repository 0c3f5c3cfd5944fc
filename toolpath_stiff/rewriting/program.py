"""A program written for another placement.

`rewrite_program` returns the text that, analyzed at the original origin, takes the tool along the placed path. Every
motion word has new numbers; everything else stays byte for byte: comments, line numbers, order, blank lines, tape
marks, line ends, upper and lower case. The rapid with which the tool comes from where the control was switched on is
the one move that cannot match.
"""

import copy
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.errors import ProgramError
from toolpath_stiff.files import write_atomically
from toolpath_stiff.nc.controller import DIALECTS, UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.heidenhain.plain_statements import in_inches
from toolpath_stiff.nc.lines import read_text, split_lines
from toolpath_stiff.nc.moves import CUTTER_LOCATION, RAPID, ReadProgram
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.reader import read
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import Offsets
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.poses import Pose, pose_in_mm
from toolpath_stiff.results import Result
from toolpath_stiff.rewriting.blocks import rewrite_block
from toolpath_stiff.rewriting.controls import DECIMALS_INCH, DECIMALS_MM, Controls
from toolpath_stiff.rewriting.plain_language import placed_lines
from toolpath_stiff.rewriting.turn import Turn
from toolpath_stiff.units import MM_PER_INCH, mm_from_m

MOST_ROUNDINGS = 100  # by which rounded numbers of a path of steps may add up
LINE_END = re.compile("\r\n|\n|\r")
PLAIN_DIALECTS = ("generic", "linuxcnc", "heidenhain")
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
    placement, original = pose_in_mm(placement_origin), pose_in_mm(original_origin)
    source, out = (
        State(
            program.name,
            Frames(copy.deepcopy(control.offsets or Offsets()), origin, origin),
            copy.deepcopy(control.tools),
        )
        for origin in (placement, original)
    )
    turn = Turn(placement, original)
    controls = Controls(source, out, turn, decimals, linearise and mm_from_m(linearise))
    text, encoding = read_text(program.path) if program.path else ("\n".join([*program.source, ""]), "utf-8")
    if placement == original:
        return RewrittenProgram(program.name, text, encoding, [])
    if program.dialect == "heidenhain":
        written = _plain_language(program, text, turn, decimals, replace(control, dialect=DIALECTS[program.dialect]))
        return RewrittenProgram(program.name, written, encoding, [])
    lines = list(_rewritten_lines(controls, text, program.name, control.switches))
    return RewrittenProgram(program.name, "".join(lines), encoding, sorted(controls.notes))


def _plain_language(program: ReadProgram, text: str, turn: Turn, decimals: int | None, control: Controller) -> str:
    """Heidenhain's text at its new place, read again: where the path is not the placed one, it is refused."""
    lines, inch = split_lines(text, program.name), in_inches(program.source)
    unit, usual = (MM_PER_INCH, DECIMALS_INCH) if inch else (1.0, DECIMALS_MM)
    decimals = usual if decimals is None else decimals
    placed = placed_lines(turn, lines, program.name, unit, decimals)
    again, moves = read(Request(tuple(placed), program.name, controller=control)).moves, program.moves
    wrong = np.zeros(1, dtype=int)
    if np.array_equal(again.motion, moves.motion):
        ends = np.array([turn.point(mm_from_m(end[:3]).tolist()) for end in moves.end])
        off = np.abs(mm_from_m(again.end[:, :3]) - ends).max(axis=1)
        wrong = np.flatnonzero((moves.motion != RAPID) & (off > MOST_ROUNDINGS * unit * 10.0**-decimals))
    if len(wrong):
        problem = "the program written for the placement would go another way"
        raise Place(program.name, int(moves.line[wrong[0]])).fail(problem, hint="place it without --write")
    ending = LINE_END.search(text)
    return (ending[0] if ending else "\n").join([*placed, ""])


def check_rewritable(program: ReadProgram) -> None:
    """Raise `InputError` for a program whose blocks are not what a control of this machine executes."""
    control = f"read by {program.interpreter!r} as {program.dialect!r}, not as one of {', '.join(PLAIN_DIALECTS)},"
    refused = (
        (
            bool(program.kinematics),
            f"posted for another kinematics ({program.kinematics})",
            ", set the work so in the CAM system, and post it for this machine",
        ),
        (program.parametric, "with variables", ", and set the work offset that is printed (G10)"),
        (
            program.dialect == CUTTER_LOCATION,
            "for a post processor (a cutter-location file)",
            ", or place the posted program",
        ),
        (program.interpreter != "builtin" or program.dialect not in PLAIN_DIALECTS, control, ""),
    )
    for holds, what, instead in refused:
        if holds:
            hint = f"place it without --write{instead}"
            raise ProgramError(f"a program {what} cannot be rewritten", hint=hint, file=program.name)


def _rewritten_lines(controls: Controls, text: str, name: str, switches: frozenset[int]) -> Iterator[str]:
    """Lines with their ends; what follows the program's end stays as it is."""
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
