"""The moves of an NC program, one row a move, in SI units.

This is what the reader hands on: geometry with its line, feed and tool; no machine, no sampling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, NamedTuple

from toolpath_stiff.units import Pose

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]
    BoolArray = NDArray[np.bool_]

RAPID, FEED, ARC, CYCLE = 0, 1, 2, 3
CUTTER_LOCATION = "cutter-location file"
MOTION_NAMES = ("rapid", "feed", "arc", "cycle")


@dataclass(frozen=True)
class Moves:
    """Columns over n moves, in the set-up frame (program zero of G54 at the origin) unless placed.

    A move of zero length in all six axes is not a move and has no row. `start[i]` is `end[i - 1]`,
    except where a coordinate system changed in between (then the tool stands still, the numbers change).

    Attributes
    ----------
    line
        (n,) line of the program, from 1, that asked for the move.
    motion
        (n,) RAPID, FEED, ARC or CYCLE; rapids within a canned cycle are RAPID, its feeds CYCLE.
    start, end
        (n, 6) tool-tip position x, y, z in m and rotary words a, b, c in rad as programmed
        (interpolated linearly along the move, as a control does).
    arc_sweep
        (n,) rad, the signed angle of an arc about `arc_normal` (right hand), turns included; 0: not an arc.
    arc_center
        (n, 3) m, centre of the arc in the plane of its start; 0 where there is no arc. A helix climbs
        along `arc_normal`; radii of start and end that differ within tolerance are interpolated.
    arc_normal
        (n, 3) unit vector; 0 where there is no arc.
    feed
        (n,) m/s along the path (rad/s for a move of the rotary axes alone); nan for rapids.
    dwell
        (n,) s, the pause after the move (G4 and the dwell of a cycle).
    tool
        (n,) tool number in the spindle (T with M6), 0 for none.
    tool_length
        (n,) m, the length in force through G43; nan: the machine's reference tool.
    from_machine
        (n, 2) whether start, end were given in machine coordinates (G53, G28, G30): these ends do
        not follow the work when it is placed elsewhere.
    """

    line: IntArray
    motion: IntArray
    start: FloatArray
    end: FloatArray
    arc_sweep: FloatArray
    arc_center: FloatArray
    arc_normal: FloatArray
    feed: FloatArray
    dwell: FloatArray
    tool: IntArray
    tool_length: FloatArray
    from_machine: BoolArray

    def __len__(self) -> int:
        return len(self.line)

    def take(self, index: IntArray | BoolArray | slice) -> Moves:
        """The moves at `index` (integers, a mask or a slice)."""
        return Moves(**{f.name: getattr(self, f.name)[index] for f in fields(self)})


class Jump(NamedTuple):
    """A run that leaves the order of the lines: moves before it, the line left, the line after which it goes on."""

    moves: int
    left: int
    after: int


@dataclass(frozen=True)
class Unsupported:
    """A word of the program that was read, is harmless to the path, and was not acted upon."""

    line: int
    column: int
    word: str
    reason: str


@dataclass(frozen=True)
class ToolUse:
    """A tool of the tool table: number; length, diameter, stick-out in m (nan: not given); remark, material."""

    number: int
    length: float
    diameter: float
    remark: str = ""
    stick_out: float = math.nan
    material: str = ""


@dataclass(frozen=True)
class Program:
    """A program that was read to its end.

    Attributes
    ----------
    name
        File name without its folder, for headings.
    path
        Where it was read from ("" for text).
    source
        The program's lines as they stand in the file, without line ends.
    moves
        The moves in the set-up frame.
    origin
        Where program zero (G54) sits in machine coordinates: x, y, z in m, A, B, C in rad. The moves do
        not depend on it, except those that were given in machine coordinates.
    origin_source
        Who says so: "option" (the caller), "program" (`G10 L2 P1` or an offsets file) or "default".
    unsupported, warnings, assumptions
        What was read but not acted upon; what deserves a look; what was assumed. Sentences for people.
    tools
        The tools that the program used.
    interpreter
        Who read it: "builtin" or "linuxcnc".
    dialect
        How it was read: "generic", "linuxcnc", "fanuc", "haas", or one of them as a controller file changes it;
        `CUTTER_LOCATION` for a cutter-location file.
    kinematics
        The kinematics that it was posted for ("table-table A C"), from which the moves were recovered; "": A, B, C are
        roll, pitch, yaw of the platform.
    marks
        (line, name) where operations begin, ascending, in a language whose text says so otherwise than by comment
        lines; None: the comment lines of `source` say it.
    jumps
        Where the run left the order of the lines, for a subprogram or back from it; None: not known.
    """

    name: str
    path: str
    source: tuple[str, ...]
    moves: Moves
    origin: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    origin_source: str = "default"
    unsupported: tuple[Unsupported, ...] = ()
    warnings: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    tools: tuple[ToolUse, ...] = field(default=())
    interpreter: str = "builtin"
    dialect: str = "generic"
    kinematics: str = ""
    marks: tuple[tuple[int, str], ...] | None = None
    jumps: tuple[Jump, ...] | None = None
