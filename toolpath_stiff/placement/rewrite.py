"""A program written for another placement: analysed at the original origin its tool takes the placed path.

`rewrite_program` returns the text; every motion word has new numbers, everything else stays byte for byte: comments,
line numbers, blank lines, tape marks, line ends, upper and lower case.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Pose
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.interpreter import Interpreter
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.nc.source import split_lines
from toolpath_stiff.nc.tables import Offsets, ToolEntry
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.placement.rewrite_blocks import Rewriter
from toolpath_stiff.placement.rewrite_trace import Tracer
from toolpath_stiff.placement.rewrite_turn import Turn
from toolpath_stiff.units import deg_from_rad, mm_from_m

LINE_END = re.compile("\r\n|\n|\r")


@dataclass(frozen=True)
class Rewritten:
    """A rewritten program: its text, how it was encoded, and what the user should hear of."""

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
    block_delete: bool = False,
) -> Rewritten:
    """Write a program so that at the original origin it does what it does untouched at a placement."""
    text, encoding = _text_of(program)
    placement, original = _in_mm(placement_origin), _in_mm(original_origin)
    turn = Turn(placement, original)
    source = Tracer(program.name, Frames(copy.deepcopy(offsets or Offsets()), placement, placement), copy.deepcopy(tools))
    out = Interpreter(
        program.name, Frames(copy.deepcopy(offsets or Offsets()), original, original), copy.deepcopy(tools)
    )
    rewriter = Rewriter(source, out, turn, decimals, linearise)
    pieces = _execute(rewriter, text, program.name, block_delete)
    return Rewritten("".join(pieces), encoding, tuple(rewriter.notes))


def _execute(rewriter: Rewriter, text: str, name: str, block_delete: bool) -> Iterable[str]:
    lines = split_lines(text, name)
    ends = LINE_END.findall(text)
    ends += [""] * (len(lines) - len(ends))
    started = running = True
    started = False
    for number, (line, end) in enumerate(zip(lines, ends, strict=False), 1):
        block = read_block(line, number, name) if running else None
        if block is None:
            yield line + end
            continue
        if block.percent:
            running, started = not started, True
            yield line + end
            continue
        started = started or bool(block.words)
        if block.optional and block_delete:
            if block.words:
                raise InputError(
                    "a block that --block-delete leaves out cannot be rewritten",
                    hint="take it out of the program, or leave out --block-delete",
                    file=name,
                    line=number,
                )
            yield line + end
            continue
        written, running = rewriter.block(block, line)
        yield (end or "\n").join(written) + end


def _text_of(program: Program) -> tuple[str, str]:
    """The program's text with its line ends, and its encoding."""
    if not program.path:
        return "\n".join([*program.source, ""]), "utf-8"
    content = Path(program.path).read_bytes()
    encoding = "utf-8-sig" if content.startswith(b"\xef\xbb\xbf") else "utf-8"
    try:
        return content.decode(encoding), encoding
    except UnicodeDecodeError:
        return content.decode("latin-1"), "latin-1"


def _in_mm(origin: Pose) -> Pose:
    x, y, z, a, b, c = origin
    return (mm_from_m(x), mm_from_m(y), mm_from_m(z), deg_from_rad(a), deg_from_rad(b), deg_from_rad(c))
