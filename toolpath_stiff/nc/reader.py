"""An NC program, from file or text, to `Program`."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.frames import Frames, Pose
from toolpath_stiff.nc.interpreter import Interpreter
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.nc.source import read_lines, split_lines
from toolpath_stiff.nc.tables import Offsets, ToolEntry, read_offsets, read_tool_table
from toolpath_stiff.nc.words import read_block
from toolpath_stiff.units import deg_from_rad, m_from_mm, mm_from_m, rad_from_deg

ZERO: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
START = "before its first move the tool stands at 0, 0, 0 of the control, as LinuxCNC assumes"


def read_program(
    path: str | Path,
    *,
    origin: Iterable[float] | None = None,
    default_origin: Iterable[float] = ZERO,
    offsets_file: str | Path | None = None,
    tool_table: str | Path | None = None,
    block_delete: bool = False,
) -> Program:
    """Read an NC program file to its moves in the set-up frame.

    Parameters
    ----------
    path
        The program.
    origin, default_origin
        Where program zero (G54) sits in machine coordinates, x, y, z in m, A, B, C in rad: as asked for, and unless
        anyone says. Only moves in machine coordinates (G53, G28, G30) depend on it.
    offsets_file
        Work offsets: `G55 = [x, y, z, a, b, c, r]` (mm, degrees) or a LinuxCNC parameter file.
    tool_table
        Tool lengths: a LinuxCNC tool table or CSV.
    block_delete
        Leave out blocks that begin with a slash.

    Raises
    ------
    InputError
        With file, line and column, what was found and what was expected.
    """
    return _read(
        read_lines(path),
        Path(path).name,
        str(path),
        origin,
        default_origin,
        read_offsets(offsets_file) if offsets_file else Offsets(),
        read_tool_table(tool_table) if tool_table else None,
        block_delete,
    )


def parse_program(
    text: str,
    name: str = "program",
    *,
    origin: Iterable[float] | None = None,
    default_origin: Iterable[float] = ZERO,
    offsets: Offsets | None = None,
    tools: dict[int, ToolEntry] | None = None,
    block_delete: bool = False,
) -> Program:
    """Read an NC program from text; parameters as in `read_program`, tables as read by `nc.tables`."""
    lines = split_lines(text, name)
    return _read(lines, name, "", origin, default_origin, offsets or Offsets(), tools, block_delete)


def _read(
    lines: tuple[str, ...],
    name: str,
    path: str,
    origin: Iterable[float] | None,
    default_origin: Iterable[float],
    offsets: Offsets,
    tools: dict[int, ToolEntry] | None,
    block_delete: bool,
) -> Program:
    if not any(line.strip() for line in lines):
        raise InputError("the program is empty", expected="an NC program", file=name)
    frames = Frames(copy.deepcopy(offsets), None if origin is None else _to_mm(origin), _to_mm(default_origin))
    interpreter = Interpreter(name, frames, copy.deepcopy(tools))
    warnings = _execute(interpreter, lines, name, block_delete)
    if not interpreter.recorder.cuts:
        raise InputError("no cutting move", expected="a feed move (G1, G2, G3 or a cycle)", file=name)
    x, y, z, a, b, c = frames.origin
    g54 = offsets.table[0].given or frames.offsets.table[0].given
    if frames.source == "option" and g54:
        warnings.append(
            "the program or the offsets file sets G54; --origin overrides it, other offsets keep their distance to it"
        )
    return Program(
        name=name,
        path=path,
        source=lines,
        moves=interpreter.recorder.moves(),
        origin=(m_from_mm(x), m_from_mm(y), m_from_mm(z), rad_from_deg(a), rad_from_deg(b), rad_from_deg(c)),
        origin_source=frames.source,
        unsupported=tuple(interpreter.unsupported),
        warnings=(*warnings, *interpreter.warnings),
        assumptions=(START, *interpreter.assumptions),
        tools=tuple(interpreter.used_tools.values()),
    )


def _execute(interpreter: Interpreter, lines: tuple[str, ...], name: str, block_delete: bool) -> list[str]:
    """Run the blocks up to the end of the program; returns warnings."""
    started = False
    for number, line in enumerate(lines, 1):
        block = read_block(line, number, name)
        if block.percent:
            if started:
                return _left_over(lines, number, "%")
            started = True
            continue
        started = started or bool(block.words)
        if block.optional and block_delete:
            continue
        if not interpreter.execute(block):
            return _left_over(lines, number, "the program's end")
    return []


def _left_over(lines: tuple[str, ...], number: int, what: str) -> list[str]:
    """A warning if anything but tape marks follows the end."""
    rest = [line for line in lines[number:] if line.strip() not in ("", "%")]
    return [f"what follows {what} in line {number} is not part of the program (lines: {len(rest)})"] if rest else []


def _to_mm(origin: Iterable[float]) -> Pose:
    x, y, z, a, b, c = origin
    return (mm_from_m(x), mm_from_m(y), mm_from_m(z), deg_from_rad(a), deg_from_rad(b), deg_from_rad(c))
