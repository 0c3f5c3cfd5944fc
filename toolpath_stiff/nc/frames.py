"""Coordinates of a control: program, work offsets, G92 and G52, tool length, machine. mm and degrees.

As LinuxCNC: control = Rz(rotation) (program + g92) + offset, and the spindle nose = control + tool length; G68 turns
the program's X and Y about its own centre before all that. The "control" coordinates are those in which the work
offsets are numbers; the set-up frame of `Moves` is the control frame shifted so that G54 (its value at the first
motion) is zero; the machine frame places that at the origin.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.nc.geometry import cross
from toolpath_stiff.nc.kinematics import PostedKinematics
from toolpath_stiff.nc.tables import Offsets
from toolpath_stiff.poses import ShopPose

Numbers = TypeVar("Numbers", float, FloatArray)
Matrix = list[list[float]]
UNIT: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
STILL = 1e-12  # of a coordinate, or of 1 mm if more: rounding by frames of an axis that does not move
Rotation = tuple[float, float, float]  # of G68: centre X, Y in program coordinates, angle in degrees


@dataclass
class Frames:
    """Coordinate systems in force, and the tool tip in control coordinates.

    Attributes
    ----------
    offsets
        Work offsets and reference points.
    option, default
        Where G54's zero sits on the machine as the caller says, and by default; mm and degrees.
    active
        Index of the work offset in force, as `Offsets.at` counts.
    g92
        Shift of G92 or G52; `g92_kept` remembers it while G92.2 suspends it.
    rotation
        Rotation of G68 in force.
    tool
        Tool length offset in force along Z.
    position
        Controlled point in control coordinates.
    from_machine
        Axes of `position` that were given in machine coordinates.
    reference
        G54's zero in control coordinates, fixed at the first motion.
    posted
        The machine that the program was posted for, whose coordinates these are; None: this one.
    tip_held
        Whether tool centre point control is on (G43.4): positions are then those of the tip on the part.
    linear
        Turn, mirror image and scale of the program's X, Y, Z ahead of all that (3, 3); None: they are as they are.
    """

    offsets: Offsets
    option: ShopPose | None
    default: ShopPose
    active: int = 0
    g92: list[float] = field(default_factory=lambda: [0.0] * 6)
    g92_kept: list[float] = field(default_factory=lambda: [0.0] * 6)
    rotation: Rotation | None = None
    tool: float = 0.0
    position: list[float] = field(default_factory=lambda: [0.0] * 6)
    from_machine: list[bool] = field(default_factory=lambda: [False] * 6)
    reference: tuple[float, float, float] | None = None
    source: str = ""
    posted: PostedKinematics | None = None
    tip_held: bool = False
    linear: Matrix | None = None

    @property
    def bound(self) -> bool:
        """True if at least one axis of the present point was given in machine coordinates."""
        # Rotary axes of a posted machine have the same zero in both systems.
        return any(self.from_machine if self.posted is None else self.from_machine[:3])

    def to_control(self, program: list[float]) -> list[float]:
        """Control coordinates of a point in program coordinates."""
        offset = self.offsets.at(self.active)
        if self.linear is not None:
            program = [*rotate(self.linear, program[:3]), *program[3:]]
        if self.rotation is not None:
            program = _about(self.rotation, program, self.rotation[2])
        if not offset.rotation:
            return [shifted(p, g, o) for p, g, o in zip(program, self.g92, offset.axes, strict=True)]
        moved = [p + g for p, g in zip(program, self.g92, strict=True)]
        moved[0], moved[1] = _turned(moved[0], moved[1], offset.rotation)
        return [m + o for m, o in zip(moved, offset.axes, strict=True)]

    def to_program(self, control: list[float]) -> list[float]:
        """Program coordinates of a point in control coordinates."""
        offset = self.offsets.at(self.active)
        if not offset.rotation:
            program = [shifted_back(c, g, o) for c, g, o in zip(control, self.g92, offset.axes, strict=True)]
        else:
            moved = [c - o for c, o in zip(control, offset.axes, strict=True)]
            moved[0], moved[1] = _turned(moved[0], moved[1], -offset.rotation)
            program = [m - g for m, g in zip(moved, self.g92, strict=True)]
        if self.linear is not None:
            square = sum(row[0] ** 2 for row in self.linear)  # of the scale
            program = [*(v / square for v in rotate(_transposed(self.linear), program[:3])), *program[3:]]
        return program if self.rotation is None else _about(self.rotation, program, -self.rotation[2])

    def axis_to_control(self, axis: int, program: Numbers) -> Numbers:
        """`to_control` for one axis of many points at once, without rotation."""
        return shifted(program, self.g92[axis], self.offsets.at(self.active).axes[axis])

    def axis_to_program(self, axis: int, control: Numbers) -> Numbers:
        """`to_program` for one axis of many points at once, without rotation."""
        return shifted_back(control, self.g92[axis], self.offsets.at(self.active).axes[axis])

    @property
    def rotated(self) -> bool:
        """True if a work offset or G68 rotates the program's X and Y."""
        turned = self.rotation is not None or self.linear is not None
        return turned or self.offsets.at(self.active).rotation != 0.0

    @property
    def turned(self) -> float:
        """Angle in degrees of the program's X and Y axes from the control's: work offset and G68."""
        return self.offsets.at(self.active).rotation + (self.rotation[2] if self.rotation else 0.0)

    def turn_direction(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        """Normal of an arc, from program axes to control axes; a mirror image reverses it."""
        if self.linear is not None:
            first, second, third = self.linear
            x, y, z = (  # the cofactors, whose lengths are the square of the scale
                sum(c * v for c, v in zip(cross(a, b), vector, strict=True)) / sum(v * v for v in third)
                for a, b in ((second, third), (third, first), (first, second))
            )
            vector = (x, y, z)
        rotation = self.turned
        if not rotation:
            return vector
        return (*_turned(vector[0], vector[1], rotation), vector[2])

    def fix_reference(self) -> tuple[float, float, float]:
        """G54's zero at the first motion, which defines the set-up frame from then on."""
        if self.reference is None:
            g54 = self.offsets.table[0]
            x, y, z = g54.axes[:3]
            self.reference = (x, y, z)
            self.source = "option" if self.option is not None else "program" if g54.given else "default"
        return self.reference

    @property
    def origin(self) -> ShopPose:
        """Position of G54's zero on the machine, mm and degrees."""
        x, y, z = self.fix_reference()
        if self.option is not None:
            return self.option
        return (x, y, z, 0.0, 0.0, 0.0) if self.source == "program" else self.default

    def to_setup(self, control: list[float]) -> list[float]:
        """Set-up coordinates of a point in control coordinates."""
        (a, b, c), (x, y, z, *angles) = self.reference or self.fix_reference(), control
        return [x - a, y - b, z - c, *angles]

    def from_setup(self, setup: list[float]) -> list[float]:
        """Control coordinates of a point in set-up coordinates."""
        return [*(s + r for s, r in zip(setup[:3], self.fix_reference(), strict=True)), *setup[3:]]

    def machine_position(self) -> list[float]:
        """Spindle position in machine coordinates, as a control shows it: without the tool length in force."""
        point = self.to_setup(self.position)
        point[2] += self.tool
        origin = self.origin
        return [
            *(t + o for t, o in zip(rotate(rotation_matrix(origin[3:]), point[:3]), origin[:3], strict=True)),
            *point[3:],
        ]

    def control_of_machine(self, machine: list[float]) -> list[float]:
        """Control coordinates of a point in machine coordinates."""
        origin = self.origin
        moved = [m - o for m, o in zip(machine[:3], origin[:3], strict=True)]
        control = self.from_setup([*rotate(_transposed(rotation_matrix(origin[3:])), moved), *machine[3:]])
        control[2] -= self.tool
        return control

    def set_tool(self, length: float) -> None:
        """Put another tool length in force: the machine stands still, the controlled point's numbers change."""
        self.position = [*self.position[:2], self.position[2] + (self.tool - length), *self.position[3:]]
        self.tool = length


def standing(start: list[float], end: list[float]) -> list[float]:
    """End of a move, with the start's numbers for axes that differ by rounding only."""
    return [s if s == e or abs(e - s) < STILL * max(1.0, abs(s)) else e for s, e in zip(start, end, strict=True)]


def shifted(program: Numbers, shift: float, offset: float) -> Numbers:
    """Program coordinate in control coordinates: first G92 or G52, then the work offset."""
    return (program + shift) + offset


def shifted_back(control: Numbers, shift: float, offset: float) -> Numbers:
    """Control coordinate in program coordinates."""
    return (control - offset) - shift


def _turned(x: float, y: float, degrees: float) -> tuple[float, float]:
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return (cos * x - sin * y, sin * x + cos * y)


def _about(rotation: Rotation, point: list[float], degrees: float) -> list[float]:
    """A point (6) turned by `degrees` about the centre of a rotation."""
    x, y = _turned(point[0] - rotation[0], point[1] - rotation[1], degrees)
    return [rotation[0] + x, rotation[1] + y, *point[2:]]


def rotation_matrix(angles: Sequence[float]) -> Matrix:
    """Rz(C) Ry(B) Rx(A) of angles A, B, C in degrees; plain floats, faster than arrays for one matrix."""
    (ca, sa), (cb, sb), (cc, sc) = (
        (math.cos(math.radians(v)), math.sin(math.radians(v))) if v else (1.0, 0.0) for v in angles
    )
    return [
        [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
        [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
        [-sb, cb * sa, cb * ca],
    ]


def _transposed(matrix: Matrix) -> Matrix:
    return [list(column) for column in zip(*matrix, strict=True)]


def rotate(matrix: Matrix, vector: list[float]) -> list[float]:
    """Vector times a matrix."""
    return [sum(m * v for m, v in zip(row, vector, strict=True)) for row in matrix]


def product(a: Matrix, b: Matrix) -> Matrix:
    """Matrix product."""
    return [[sum(x * y for x, y in zip(row, column, strict=True)) for column in zip(*b, strict=True)] for row in a]
