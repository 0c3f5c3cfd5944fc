"""A program posted for another machine: its moves on the part as far as they are known, and warnings about the rest."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toolpath_stiff.arrays import BoolArray
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.kinematics import MACHINE, PROGRAM, TABLE, PostedKinematics, tool_poses
from toolpath_stiff.nc.moves import RAPID, Moves, ReadProgram, Remark
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.recovery import recover_moves, turns_far
from toolpath_stiff.nc.tables import Offsets
from toolpath_stiff.poses import Pose
from toolpath_stiff.units import m_from_mm, mm_from_m, rad_from_deg

OWN_ZERO = (
    "G54 as the program or the controller file sets it is that of the machine that the program was posted for; it does "
    "not say where the work sits here"
)
OWN_POINTS = (
    "G53, G28 and G30 go to points of the machine that the program was posted for, as it stands about the work; their "
    "place on this machine means nothing"
)


def recovered(
    program: ReadProgram, kinematics: PostedKinematics, tip_held: Sequence[tuple[int, bool]], origin: Pose, source: str
) -> ReadProgram:
    """A program as read for its own machine, converted to moves of the tool on the part.

    Parameters
    ----------
    program
        Its origin is G54's zero on the posted machine, if its `origin_source` is "program".
    kinematics
        Of the posted machine.
    tip_held
        Numbers of moves before which tool centre point control was switched on or off.
    origin, source
        Where the work sits on this machine, m and rad, and where that comes from.

    Raises
    ------
    InputError
        The program does not suit the kinematics, points in machine coordinates need G54, or a cut goes to a point
        that is not known on the part.
    """
    moves, name = program.moves, program.name
    zero = program.origin if program.origin_source == "program" else None
    placed = _points_at(kinematics, zero, name)
    known, warnings, assumptions = _known_points(moves, placed, zero, name)
    kept = moves if known.all() else moves.take(known)
    held = np.full(len(moves), kinematics.tcp)
    for first, on in tip_held:
        held[first:] = on or kinematics.tcp
    if zero is not None:
        assumptions.append(OWN_ZERO)
    far = turns_far(kept, kinematics)
    if far:
        line, letter, degrees = far[0]
        others = f", and {len(far) - 1} more cuts turn as far" if far[1:] else ""
        advice = f"if the control takes the shorter way, set rollover = true for {letter} in the controller file"
        warnings.append(Remark(f"{letter} turns by {degrees:.0f} degrees within one cut{others}; {advice}", line))
    lengths = {tool.number: m_from_mm(tool.length) for tool in program.tools}
    on_part, of_kept = recover_moves(kept, placed, lengths, name, held[known])
    of_move = np.flatnonzero(known)[of_kept]
    return replace(
        program,
        moves=on_part,
        origin=origin,
        origin_source=source,
        warnings=(*program.warnings, *warnings),
        assumptions=(*program.assumptions, kinematics.assumption(switched=any(on for _, on in tip_held)), *assumptions),
        kinematics=kinematics.label,
        jumps=tuple(jump._replace(moves=int(np.searchsorted(of_move, jump.moves))) for jump in program.jumps),
    )


def check_rotary_offsets(offsets: Offsets, kinematics: PostedKinematics, name: str) -> None:
    """Raise `InputError` for work offsets with A, B, C under tool centre point control: controls differ in them."""
    every = (*offsets.table, *offsets.additional.values())
    if kinematics.tcp and any(any(offset.axes[3:]) for offset in every):
        problem = "a work offset with A, B or C, and tool centre point control (kinematics.tcp = true): controls differ"
        raise ProgramError(problem, expected="work offsets of X Y Z alone", file=name)


def switched(frames: Frames, tool_length: float, hold: bool) -> list[float]:
    """Coordinates of the present point after tool centre point control is switched on (`hold`) or off.

    The machine stands still. Control coordinates, mm and degrees; `tool_length` in mm. nan where a head has none.
    """
    assert frames.posted is not None
    zero = frames.fix_reference()
    shift = zero if frames.posted.points == PROGRAM else (0.0, 0.0, 0.0)
    point = np.array([p - s for p, s in zip(frames.position[:3], shift, strict=True)])
    # The tip of four points of the linear axes: it moves with them as one body.
    corners = np.concatenate([np.zeros((1, 3)), np.eye(3)])
    abc = np.tile(rad_from_deg(np.array(frames.position[3:])), (4, 1))
    tips = mm_from_m(tool_poses(frames.posted, m_from_mm(corners), abc, m_from_mm(tool_length))[0])
    turn = (tips[1:] - tips[0]).T
    moved = tips[0] + turn @ point if hold else turn.T @ (point - tips[0])
    return [*(float(m) + s for m, s in zip(moved, shift, strict=True)), *frames.position[3:]]


def _points_at(kinematics: PostedKinematics, zero: Pose | None, name: str) -> PostedKinematics:
    """The kinematics with its tables' points relative to G54's zero."""
    used = any(axis.turns == TABLE and axis.point is not None for axis in kinematics.axes) and not kinematics.tcp
    if kinematics.points != MACHINE or not used:
        return kinematics
    if zero is None:
        problem = 'kinematics.points = "machine" needs the place of G54 on the machine that the program was posted for'
        expected = "G54 in the controller file's [offsets], or G10 L2 P1 in the program"
        hint = 'or give the points in program coordinates: points = "program"'
        raise ProgramError(problem, expected=expected, hint=hint, file=name)
    axes = []
    for axis in kinematics.axes:
        point = axis.point
        if axis.turns == TABLE and point is not None:
            point = (point[0] - zero[0], point[1] - zero[1], point[2] - zero[2])
        axes.append(replace(axis, point=point))
    return replace(kinematics, axes=tuple(axes))


def _known_points(
    moves: Moves, kinematics: PostedKinematics, zero: Pose | None, name: str
) -> tuple[BoolArray, list[Remark], list[str]]:
    """(n,) True for moves whose ends are known on the part; warnings and assumptions about moves to machine points."""
    fixed = np.asarray(moves.from_machine.any(axis=1))
    if not fixed.any():
        return ~fixed, [], []
    if zero is not None and not kinematics.tcp:
        return np.ones(len(moves), dtype=bool), [], [OWN_POINTS]
    reason = "the place of G54 on that machine is not known"
    hint = "give G54 in the controller file's [offsets]"
    if kinematics.tcp:
        reason, hint = "tool centre point control does not hold there", ""
    cuts = fixed & (moves.motion != RAPID)
    if cuts.any():
        problem = "a cut that begins or ends at a point of the machine that the program was posted for (G53, G28, G30)"
        expected = "rapids alone there, and X Y Z in the move after"
        raise Place(name, int(moves.line[np.argmax(cuts)])).fail(f"{problem}: {reason}", expected, hint)
    lines = np.unique(moves.line[fixed])
    more = f", in {len(lines)} lines," if len(lines) > 1 else ""
    text = (
        f"rapids to or from points of the machine that the program was posted for (G53, G28, G30, another tool length "
        f"while the tool leans){more} are left out of the path: {reason}"
    )
    return ~fixed, [Remark(text, int(lines[0]))], []
