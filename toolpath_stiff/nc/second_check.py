"""`tps check` through LinuxCNC's interpreter: what it says of a program, in the words of the built-in check."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.checking import (
    ERROR,
    NOTE,
    Checked,
    Finding,
    UsedCode,
    check_lines,
    finding_of,
    findings_of,
    in_order,
)
from toolpath_stiff.nc.codes.contract import code_name
from toolpath_stiff.nc.codes.registry import code_meaning
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller, Switches, plain
from toolpath_stiff.nc.cutter_location.statements import looks_like_cutter_location
from toolpath_stiff.nc.linuxcnc.copy import split
from toolpath_stiff.nc.moves import Program
from toolpath_stiff.nc.reader import INTERPRETERS, ZERO, parse_program
from toolpath_stiff.units import Pose

CODE = re.compile(r"([GM])(\d+\.?\d*)")


def check_by(
    interpreter: str,
    lines: tuple[str, ...],
    name: str,
    *,
    origin: Iterable[float] | None = None,
    default_origin: Iterable[float] = ZERO,
    block_delete: Switches = False,
    controller: Controller = UNKNOWN_CONTROL,
    rs274: str | None = None,
) -> tuple[Checked, str]:
    """Check a program by an interpreter; parameters as in `read_program`. Returns who read it, too.

    "auto" is the built-in check where that reads the whole program, or LinuxCNC's interpreter cannot. Raises
    `InputError` for an empty program, or where "linuxcnc" is asked for and cannot be had.
    """
    if interpreter not in INTERPRETERS:
        raise InputError(f"interpreter {interpreter!r}", expected=", ".join(INTERPRETERS))
    options: dict[str, Any] = {"origin": origin, "default_origin": default_origin, "block_delete": block_delete}
    ours = None
    if interpreter != "linuxcnc":
        ours = check_lines(lines, name, controller=controller, **options)
        second = plain(block_delete, controller) and not looks_like_cutter_location(lines, name)
        if interpreter == "builtin" or ours.complete or not second:
            return ours, "builtin"
    try:
        program = parse_program(
            "\n".join([*lines, ""]), name, controller=controller, interpreter="linuxcnc", rs274=rs274, **options
        )
    except InputError as error:
        if ours is not None:
            return _refused_by_both(ours, error), "builtin"
        if error.file is None:
            raise
        at = _pose(origin, default_origin)
        return Checked(_used(lines, name), (), (finding_of(error),), {}, {}, None, at, False), "linuxcnc"
    return _checked(program, lines, ours), "linuxcnc"


def _refused_by_both(ours: Checked, error: InputError) -> Checked:
    """The built-in check, with what LinuxCNC's interpreter refuses."""
    refused = finding_of(error)
    said = Finding(refused.line, refused.column, "not read", f"nor by LinuxCNC: {refused.text}", ERROR)
    return replace(ours, findings=in_order([*ours.findings, said]))


def _checked(program: Program, lines: tuple[str, ...], ours: Checked | None) -> Checked:
    """What LinuxCNC's interpreter made of a program, and why the built-in one did not read it (`ours`)."""
    findings = findings_of((), program.warnings, program.assumptions)
    if ours is not None:
        why = next(finding for finding in ours.findings if finding.severity == ERROR)
        text = f"the built-in interpreter says: {why.text.partition('; ')[0]}"
        findings = in_order([*findings, Finding(why.line, why.column, "interpreter", text, NOTE)])
    return Checked(
        used=_used(lines, program.name),
        unsupported=tuple(
            Finding(word.line, word.column, word.word, f"{word.reason}; not acted upon", NOTE)
            for word in program.unsupported
        ),
        findings=findings,
        start={},
        end={},
        moves=program.moves,
        origin=program.origin,
        complete=True,
        dialect=program.dialect,
        remarks={tool.number: tool.remark for tool in program.tools},
        marks=program.marks,
    )


def _pose(origin: Iterable[float] | None, default: Iterable[float]) -> Pose:
    x, y, z, a, b, c = default if origin is None else origin
    return (x, y, z, a, b, c)


def _used(lines: tuple[str, ...], name: str) -> tuple[UsedCode, ...]:
    """G and M codes as they stand in the lines, not how often they run; computed ones are not among them."""
    first: dict[str, tuple[int, int]] = {}
    count: dict[str, int] = {}
    try:
        split_lines = split(lines, name)
    except InputError:
        return ()
    for line in split_lines:
        for letter, digits in CODE.findall(line.plain):
            code = code_name(letter, float(digits))
            first.setdefault(code, (line.number, 0))
            count[code] = count.get(code, 0) + 1
    return tuple(UsedCode(*first[code], code, code_meaning(code), NOTE, count[code]) for code in first)
