"""A cutter-location file to `Program`: the same contract as the reader of G code."""

from __future__ import annotations

import copy

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import Controller
from toolpath_stiff.nc.cutter_location.reading import CutterLocation
from toolpath_stiff.nc.frames import Pose
from toolpath_stiff.nc.moves import CUTTER_LOCATION, Program
from toolpath_stiff.nc.tables import ToolEntry

NO_CUT = "no cutting move"
ZERO: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def not_for(controller: Controller, offsets_given: bool, block_delete: bool) -> tuple[str, ...]:
    """Warnings about what was asked for and means nothing to a cutter-location file."""
    given = (
        ("a dialect", controller.dialect.name != "generic"),
        ("work offsets", offsets_given),
        ("posted kinematics", controller.kinematics is not None),
        ("block-delete switches", block_delete or bool(controller.switches)),
        ("posted kinematics", controller.kinematics is not None),
    )
    return tuple(f"{what} mean nothing to a cutter-location file and are not used" for what, asked in given if asked)


def read(
    lines: tuple[str, ...],
    name: str,
    path: str,
    origin: Pose | None,
    default_origin: Pose,
    tools: dict[int, ToolEntry] | None,
    warnings: tuple[str, ...] = (),
) -> Program:
    """Read a cutter-location file.

    Parameters
    ----------
    lines, name, path
        The file's lines; its name for messages; where it lies.
    origin, default_origin
        Where program zero sits, m and rad: as asked for, and unless anyone says.
    tools
        Tool table; its lengths win over the file's.
    warnings
        What the reader has to say beforehand.

    Raises
    ------
    InputError
        With line and column, what was found and what was expected.
    """
    reading = CutterLocation(name, copy.deepcopy(tools))
    reading.run(lines)
    if not reading.recorder.cuts:
        raise InputError(NO_CUT, expected="GOTO/ after FEDRAT/, not after RAPID", file=name)
    return Program(
        name=name,
        path=path,
        source=lines,
        moves=reading.recorder.moves(),
        origin=default_origin if origin is None else origin,
        origin_source="default" if origin is None else "option",
        unsupported=reading.unsupported,
        warnings=(*warnings, *reading.warnings),
        assumptions=tuple(reading.assumptions),
        tools=tuple(reading.used_tools.values()),
        dialect=CUTTER_LOCATION,
        marks=tuple(reading.marks),
    )
