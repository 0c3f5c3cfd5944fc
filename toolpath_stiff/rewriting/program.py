"""A program written for another placement: analysed at the original origin its tool takes the placed path.

`rewrite_program` returns the text. Every motion word has new numbers; everything else stays byte for byte: comments,
line numbers, order, blank lines, tape marks, line ends, upper and lower case. The rapid with which the tool comes from
where the control was switched on is the one move that cannot match.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Switches, switches_on
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.moves import CUTTER_LOCATION, Program
from toolpath_stiff.nc.source import split_lines
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import Offsets, ToolEntry
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.rewriting.blocks import rewrite_block
from toolpath_stiff.rewriting.controls import Controls
from toolpath_stiff.rewriting.turn import Turn
from toolpath_stiff.units import Pose, ShopPose, mm_from_m, pose_in_mm

LINE_END = re.compile("\r\n|\n|\r")
FEWEST_DECIMALS, MOST_DECIMALS = 2, 9  # 0.01 mm is no machining; beyond nine a double has no more to say
PLAIN_DIALECTS = ("generic", "linuxcnc")
SLASHED = "blocks that begin with / were rewritten as executed: run the written program with the switch off"


@dataclass(frozen=True)
class Rewritten:
    """A rewritten program.

    Attributes
    ----------
    text, encoding
        The program with its line ends, and how the original was encoded.
    notes
        What the user should hear of, sentences for people.
    """

    text: str
    encoding: str
    notes: tuple[str, ...]

    @property
    def content(self) -> bytes:
        """The file's bytes."""
        return self.text.encode(self.encoding)


def rewrite_program(
    program: Program,
    placement_origin: Pose,
    original_origin: Pose,
    *,
    decimals: int | None = None,
    linearise: float | None = None,
    offsets: Offsets | None = None,
    tools: dict[int, ToolEntry] | None = None,
    block_delete: Switches = False,
) -> Rewritten:
    """Write a program so that at the original origin it does what it does, untouched, at a placement.

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
    offsets, tools, block_delete
        What the program was read with, as in `parse_program`.

    Raises
    ------
    InputError
        A block cannot be expressed at the placement, with its line and the reason.
    """
    check_decimals(decimals)
    check_rewritable(program)
    if program.interpreter != "builtin" or program.dialect not in PLAIN_DIALECTS:
        raise InputError(
            "a program is rewritten by the words of the built-in interpreter in the dialects "
            f"{' and '.join(PLAIN_DIALECTS)}; this one was read by {program.interpreter!r} as {program.dialect!r}",
            hint="place it without --write",
            file=program.name,
        )
    text, encoding = _text_of(program)
    placement, original = pose_in_mm(placement_origin), pose_in_mm(original_origin)

    def frames(origin: ShopPose) -> Frames:
        return Frames(copy.deepcopy(offsets or Offsets()), origin, origin)

    controls = Controls(
        State(program.name, frames(placement), copy.deepcopy(tools)),
        State(program.name, frames(original), copy.deepcopy(tools)),
        Turn(placement, original),
        decimals,
        None if linearise is None else mm_from_m(linearise),
    )
    switches = switches_on(block_delete, UNKNOWN_CONTROL)
    pieces = list(_rewritten_lines(controls, text, program.name, switches))
    return Rewritten("".join(pieces), encoding, tuple(controls.notes))


def check_rewritable(program: Program) -> None:
    """Raise `InputError` for a file that is no program of a control, or one of another machine's."""
    if program.kinematics:
        raise InputError(
            f"a program posted for another kinematics ({program.kinematics}) is not rewritten: its words are those of "
            "that machine's axes",
            hint="place it without --write, set the work so in the CAM system, and post it for this machine",
            file=program.name,
        )
    if program.dialect == CUTTER_LOCATION:
        raise InputError(
            "a cutter-location file is not rewritten: it is no program that a control runs",
            hint="place it without --write, set the work so in the CAM system, or place the posted program",
            file=program.name,
        )


def check_decimals(decimals: int | None) -> None:
    """Raise `InputError` for a number of decimals that makes no program."""
    if decimals is not None and not FEWEST_DECIMALS <= decimals <= MOST_DECIMALS:
        raise InputError(f"{decimals} decimals", expected=f"{FEWEST_DECIMALS} to {MOST_DECIMALS}")


def _rewritten_lines(controls: Controls, text: str, name: str, switches: frozenset[int]) -> Iterator[str]:
    """Lines with their ends; what follows the program's end stays as it is."""
    lines, raw_lines, ends = split_lines(text, name), LINE_END.split(text), LINE_END.findall(text)
    ends += [""] * (len(lines) - len(ends))
    between = ends[0] or "\n"
    running, started = True, False
    for number, (line, raw, end) in enumerate(zip(lines, raw_lines, ends, strict=False), 1):
        if not running:
            yield raw + end
            continue
        block = read_block(line, number, name)
        written = [line]
        if block.percent:
            running, started = not started, True
        elif block.optional and block.switch in switches:
            _refuse_left_out(bool(block.words), number, name)
        else:
            started = started or bool(block.words)
            written, running = rewrite_block(controls, block, line)
            if block.optional and written != [line] and SLASHED not in controls.notes:
                controls.notes.append(SLASHED)
        yield raw + end if written == [line] else (end or between).join(written) + end


def _refuse_left_out(words: bool, number: int, name: str) -> None:
    """A block that --block-delete leaves out would stay as it was, and be wrong once the switch is off."""
    if words:
        raise InputError(
            "a block that --block-delete leaves out cannot be rewritten",
            hint="take it out of the program, or do without --block-delete",
            file=name,
            line=number,
        )


def _text_of(program: Program) -> tuple[str, str]:
    """The program's text with its line ends, and its encoding."""
    if not program.path:
        return "\n".join([*program.source, ""]), "utf-8"
    try:
        content = Path(program.path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {program.path!r}: {error.strerror}") from None
    encoding = "utf-8-sig" if content.startswith(b"\xef\xbb\xbf") else "utf-8"
    try:
        return content.decode(encoding), encoding
    except UnicodeDecodeError:
        return content.decode("latin-1"), "latin-1"
