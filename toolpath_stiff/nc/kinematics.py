"""The kinematics that a program was posted for: rotary axes on tables and heads; tool tip and axis on the part.

Read from `[kinematics]` of a controller file (mm there, SI here); `posted` gets the tool's moves through it. Types as
in R.-S. Lee, C.-H. She, "Developing a postprocessor for three types of five-axis machine tools", Int J Adv Manuf
Technol 13 (1997) 658-665: both axes on the table, both on the spindle, one on each; and machines with one rotary axis.

The chain runs from the tool to the work. With all rotary axes at 0 the tip stands at the numbers X of the linear axes,
its axis along +z, and part and machine coordinates are one. Each rotary axis then turns tip q and axis k by its angle t
about its line, which has the direction n and goes through c:

    q' = c + R(n, t) (q - c),    k' = R(n, t) k,    R right-handed (ISO 841: the tool against the work)

Heads first, from the spindle back to the column: their lines ride with the linear axes, c = X + pivot + L z with L the
tool's length from the gauge line. Then tables, from the base to the work: c stays. It is the forward kinematics of Lee
and She, written with rotations about lines.
"""

import math
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.nc.geometry import Vector
from toolpath_stiff.nc.tables import LARGEST_MM
from toolpath_stiff.toml_reader import TomlReader
from toolpath_stiff.units import m_from_mm, mm_from_m

TABLE, HEAD = "table", "head"
PROGRAM, MACHINE = "program", "machine"
# Type -> its axes, the one nearest the machine's base first: the name of its table in the file, and what it turns.
TYPES: dict[str, tuple[tuple[str, str], ...]] = {
    "table-table": (("primary", TABLE), ("secondary", TABLE)),
    "head-head": (("primary", HEAD), ("secondary", HEAD)),
    "head-table": (("head", HEAD), ("table", TABLE)),
    "table": (("table", TABLE),),
    "head": (("head", HEAD),),
}
LETTERS = "ABC"
DIRECTIONS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
PLACE_KEYS = {TABLE: "point_mm", HEAD: "pivot_mm"}
TOLERANCE_MM, LEAST_TOLERANCE_MM, LARGEST_TOLERANCE_MM = 1e-3, 1e-5, 1.0
PARALLEL = 1e-6  # sine of the angle between two axes below which they are one
UPRIGHT = 1e-9  # of a unit vector: a tool axis along y has no pitch
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class RotaryAxis:
    """A rotary axis of the machine that a program was posted for.

    Attributes
    ----------
    letter
        A, B or C: the program's word.
    turns
        "table" (the work) or "head" (the tool).
    direction
        Unit vector in the machine's axes. A positive angle turns the tool against the work by the right hand about it
        (ISO 841): a head turns so itself, a table the other way.
    point
        m; of a table a point of its axis with all rotary axes at 0; of a head the way from the spindle's gauge line to
        a point of its axis, at 0 too. None: not given.
    rollover
        Whether the axis takes the shorter way round to any angle.
    """

    letter: str
    turns: str
    direction: Vector
    point: Vector | None
    rollover: bool = False

    @property
    def column(self) -> int:
        """Position among A, B, C."""
        return LETTERS.index(self.letter)


@dataclass(frozen=True)
class PostedKinematics:
    """The machine that a program was posted for.

    Attributes
    ----------
    type
        A key of `TYPES`.
    axes
        In the order of `TYPES`.
    tcp
        Whether X Y Z are the tool tip's on the part (tool centre point control), or the numbers of the machine's axes.
    points
        Coordinates of the tables' points: "program", those of G54, or "machine".
    tolerance
        m, how far a divided move may be from the true curve.
    """

    type: str
    axes: tuple[RotaryAxis, ...]
    tcp: bool
    points: str = PROGRAM
    tolerance: float = m_from_mm(TOLERANCE_MM)

    @property
    def from_tool_to_work(self) -> tuple[RotaryAxis, ...]:
        """Axes in order from the tool to the work."""
        heads = [axis for axis in self.axes if axis.turns == HEAD]
        return (*reversed(heads), *(axis for axis in self.axes if axis.turns == TABLE))

    @property
    def label(self) -> str:
        """Type and letters: "table-table A C"."""
        return " ".join([self.type, *(axis.letter for axis in self.axes)])

    def assumption(self, *, switched: bool = False) -> str:
        """Sentence on how X Y Z A B C were interpreted; `switched`: tool centre point control was switched."""
        directions = [", ".join(f"{v:.6g}" for v in axis.direction) for axis in self.axes]
        turns = zip(self.axes, directions, strict=True)
        axes = ", ".join(f"{axis.letter} turns the {axis.turns} about ({direction})" for axis, direction in turns)
        where = "the tip on the part (tool centre point control)" if self.tcp else "the machine's axes"
        where += ", of the tip on the part from G43.4 on to G43 or G49" if switched and not self.tcp else ""
        return (
            f"posted for another kinematics ({self.label}): X Y Z are those of {where}; {axes}, positive angles of the "
            "tool against the work by the right hand (ISO 841). Tool tip and tool axis are recovered, moves with "
            f"turning axes divided within {mm_from_m(self.tolerance):g} mm; the free yaw about the tool is 0"
        )


def read_kinematics(toml: TomlReader) -> PostedKinematics | None:
    """Kinematics in a controller file's `[kinematics]`; None if there is none. Raises `InputError`."""
    given = toml.data.get("kinematics")
    if given is None:
        return None
    table = toml.table("kinematics", given, "a table [kinematics] with type, tcp and the rotary axes")
    known_types = ", ".join(TYPES)
    kind = toml.choice(
        "kinematics.type", toml.needed("kinematics", table, "type", f"one of {known_types}"), TYPES, known_types
    )
    parts = TYPES[kind]
    known = ("type", "tcp", "points", "tolerance_mm", *(key for key, _ in parts))
    toml.only("kinematics", table, known, f" in the type {kind!r}")
    expected = "true (X Y Z are the tool tip on the part) or false (of the machine's axes)"
    tcp = toml.flag("kinematics.tcp", toml.needed("kinematics", table, "tcp", expected))
    axes = tuple(
        _axis(toml, f"kinematics.{key}", toml.needed("kinematics", table, key, f"[kinematics.{key}]"), turns, tcp)
        for key, turns in parts
    )
    _check_pair(toml, axes, parts)
    expected = '"program" (coordinates of G54) or "machine": what point_mm is'
    placed = any(axis.turns == TABLE and axis.point is not None for axis in axes)
    points = toml.needed("kinematics", table, "points", expected) if placed else table.get("points", PROGRAM)
    toml.choice("kinematics.points", points, (PROGRAM, MACHINE), expected)
    where = "kinematics.tolerance_mm"
    tolerance = toml.number(where, table.get("tolerance_mm", TOLERANCE_MM), LARGEST_MM)
    if not LEAST_TOLERANCE_MM <= tolerance <= LARGEST_TOLERANCE_MM:
        raise toml.error(f"{where} = {tolerance:g}", f"{LEAST_TOLERANCE_MM:g} to {LARGEST_TOLERANCE_MM:g}", where=where)
    return PostedKinematics(kind, axes, tcp, points, m_from_mm(tolerance))


def _axis(toml: TomlReader, where: str, given: object, turns: str, tcp: bool) -> RotaryAxis:
    place = PLACE_KEYS[turns]
    known = ("letter", "axis", "reversed", "rollover", place)
    part = toml.table(where, given, f"a table [{where}] with {', '.join(known)}")
    toml.only(where, part, known)
    letter = toml.choice(
        f"{where}.letter", toml.needed(where, part, "letter", "A, B or C"), tuple(LETTERS), "A, B or C"
    )
    point = None
    if place in part:
        x, y, z = _vector(toml, f"{where}.{place}", part[place])
        point = (m_from_mm(x), m_from_mm(y), m_from_mm(z))
    elif not tcp:
        points = {
            TABLE: "a point of the table's axis",
            HEAD: "[x, y, z] from the gauge line to the axis (pivot length)",
        }
        raise toml.error(f"{where}.{place} is missing, and tcp is false", points[turns], where=where)
    sign = -1.0 if toml.flag(f"{where}.reversed", part.get("reversed", False)) else 1.0
    x, y, z = _direction(toml, f"{where}.axis", part.get("axis", "xyz"[LETTERS.index(letter)]))
    direction = (sign * x + 0.0, sign * y + 0.0, sign * z + 0.0)
    return RotaryAxis(letter, turns, direction, point, toml.flag(f"{where}.rollover", part.get("rollover", False)))


def _direction(toml: TomlReader, where: str, value: object) -> Vector:
    i, j, k = DIRECTIONS[value] if isinstance(value, str) and value in DIRECTIONS else _vector(toml, where, value)
    length = math.hypot(i, j, k)
    if length < PARALLEL:
        raise toml.error(f"{where} = {value!r} has no direction", "a vector [i, j, k]", where=where)
    return (i / length, j / length, k / length)


def _vector(toml: TomlReader, where: str, value: object) -> Vector:
    if not isinstance(value, list) or len(value) != 3:
        raise toml.error(
            f"{where} = {value!r}", 'three numbers [x, y, z]; of a direction "x", "y", "z" too', where=where
        )
    x, y, z = (toml.number(where, v, LARGEST_MM) for v in value)
    return (x, y, z)


def _check_pair(toml: TomlReader, axes: tuple[RotaryAxis, ...], parts: tuple[tuple[str, str], ...]) -> None:
    """Raise the error if two axes coincide, or share a letter."""
    if len(axes) < 2:
        return
    first, second = (f"kinematics.{key}" for key, _ in parts)
    if axes[0].letter == axes[1].letter:
        problem = f"{first}.letter and {second}.letter are both {axes[0].letter!r}"
        raise toml.error(problem, "two letters", where=f"{second}.letter")
    (a, b, c), (d, e, f) = axes[0].direction, axes[1].direction
    if math.hypot(b * f - c * e, c * d - a * f, a * e - b * d) < PARALLEL:
        raise toml.error(f"{first}.axis and {second}.axis are parallel", "two directions", where=f"{second}.axis")


def tool_poses(
    kinematics: PostedKinematics,
    xyz: FloatArray,
    abc: FloatArray,
    tool_length: FloatArray | float = math.nan,
    tip_held: BoolArray | bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Tips (n, 3) in m and tool axes (n, 3), tip to spindle, on the part: forward kinematics of the posted machine.

    Parameters
    ----------
    kinematics
        With its tables' points in the coordinates of `xyz`.
    xyz
        (n, 3) m, X Y Z as programmed.
    abc
        (n, 3) rad, A B C as programmed.
    tool_length
        (n,) or one, m, from the spindle's gauge line to the tip; heads without tool centre point control alone need it.
    tip_held
        (n,) or one, whether tool centre point control is on where it is not for good (`kinematics.tcp`): X Y Z are the
        tip's on the part.

    Examples
    --------
    >>> tilting = RotaryAxis("A", TABLE, direction=(1.0, 0.0, 0.0), point=(0.0, 0.0, 0.0))
    >>> kinematics = PostedKinematics("table", (tilting,), tcp=False)
    >>> tip, axis = tool_poses(kinematics, np.array([[0.0, 0.0, 0.1]]), np.radians([[90.0, 0.0, 0.0]]))
    >>> tip.round(9).tolist(), axis.round(9).tolist()
    ([[0.0, -0.1, 0.0]], [[0.0, -1.0, 0.0]])
    """
    held = np.broadcast_to(np.asarray(tip_held) | kinematics.tcp, (len(xyz),))
    axis = np.tile(Z, (len(xyz), 1))
    tip = np.array(xyz, dtype=float)
    for rotary in kinematics.from_tool_to_work:
        angle = abc[:, rotary.column]
        axis = turned(axis, rotary, angle)
        if not kinematics.tcp:
            center = line_point(rotary, xyz, tool_length)
            # Where nothing turns, numbers stay exact to the last digit, and an unknown tool length does not matter.
            turns = ~held & (angle != 0.0)
            tip = np.where(turns[:, None], center + turned(tip - center, rotary, angle), tip)
    return tip, axis


def roll_pitch(axis: FloatArray) -> FloatArray:
    """Roll and pitch (n, 2), rad, of tool axes (n, 3) in their order, at a yaw of 0; see `geometry.roll_pitch_of_axis`.

    Pitch runs on from 0, over half a turn too, and stays what it was where the axis lies along y and has none.
    """
    i, j, k = axis.T
    across = np.hypot(i, k)
    pitch = np.concatenate([[0.0], np.arctan2(i, k)])
    known = np.concatenate([[0], np.where(across > UPRIGHT, np.arange(1, len(pitch)), 0)])
    pitch = np.unwrap(pitch[np.maximum.accumulate(known)])[1:]
    return np.stack([np.arctan2(-j, across), pitch], axis=1) + 0.0


def turned(vectors: FloatArray, rotary: RotaryAxis, angle: FloatArray) -> FloatArray:
    """Vectors (n, 3) turned by angles (n,) about the axis' direction: Rodrigues' formula."""
    n = np.array(rotary.direction)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = (vectors[:, 0] * n[0] + vectors[:, 1] * n[1] + vectors[:, 2] * n[2])[:, None] * n
    return np.asarray(along + cos * (vectors - along) + sin * np.cross(n, vectors))


def line_point(rotary: RotaryAxis, xyz: FloatArray, tool_length: FloatArray | float) -> FloatArray:
    """(n, 3) a point of the rotary axis at values X Y Z of the linear axes."""
    assert rotary.point is not None
    if rotary.turns == HEAD:
        reach = np.broadcast_to(np.asarray(tool_length, dtype=float), (len(xyz),))
        return np.asarray(xyz + np.array(rotary.point) + reach[:, None] * Z)
    return np.broadcast_to(np.array(rotary.point), xyz.shape)
