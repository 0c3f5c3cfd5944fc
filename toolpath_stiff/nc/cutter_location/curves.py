"""Words of a cutter-location file that make the next motion follow a circle."""

from __future__ import annotations

import math

from toolpath_stiff.nc.cutter_location import circles
from toolpath_stiff.nc.cutter_location.circles import Circle
from toolpath_stiff.nc.cutter_location.modes import Modes
from toolpath_stiff.nc.cutter_location.statements import Nested, Statement, nested, number_of
from toolpath_stiff.nc.cutter_location.tilting import AxisError, Vector, unit_axis
from toolpath_stiff.nc.tables import ToolEntry

Z: Vector = (0.0, 0.0, 1.0)
ROUNDING = 1e-3  # rad, of the arcs that make a whole turn


class Curves(Modes):
    """Circles; the motion along one comes with the point that ends it."""

    def __init__(self, name: str, tools: dict[int, ToolEntry] | None) -> None:
        super().__init__(name, tools)
        self.followed: Circle | None = None  # whose arc the last GOTO made
        self.direction: Vector | None = None  # of INDIRV
        self._swept = 0.0  # rad, along the circle

    def _circle(self, statement: Statement) -> None:
        times = 1
        arguments = statement.arguments
        if len(arguments) > 2 and arguments[-2].text.upper() == "TIMES":
            count = number_of(arguments[-1], self.name, "a whole number of turns")
            if count != int(count) or not 1 <= count <= 10000:
                raise self.fail("CIRCLE/ ... TIMES", "a whole number of turns", at=arguments[-1])
            times, arguments = int(count), arguments[:-2]
        numbers = [number_of(argument, self.name) for argument in arguments]
        if len(numbers) not in (4, 6, 7, 11):
            raise self.fail(
                f"CIRCLE/ with {len(numbers)} numbers", "x,y,z,i,j,k,r or NX' x,y,z,i,j,k,r,t,f,d,e or x,y,z,r"
            )
        center = self._scaled(numbers[:3])
        if len(numbers) == 4:
            axis, radius = Z, numbers[3]
            if self.direction is None:
                raise self.fail("CIRCLE/x,y,z,r, which does not say which way round", "INDIRV/ before it, or i,j,k")
        else:
            axis, radius = self._circle_axis(numbers[3:6]), numbers[6] if len(numbers) > 6 else math.nan
            if len(numbers) == 11:
                axis = (-axis[0], -axis[1], -axis[2])
        self._await_circle(Circle(center, axis, radius * self.scale, times))

    def _circle_axis(self, numbers: list[float]) -> Vector:
        try:
            return unit_axis(*numbers)
        except AxisError as error:
            raise self.fail(error.found.replace("a tool axis", "a circle's axis"), error.expected) from None

    def _movarc(self, statement: Statement) -> None:
        words = self._words(statement)
        if len(words) != 9 or words[7] != "ANGLE":
            raise self.fail(statement.shown, "MOVARC/x,y,z,i,j,k,r,ANGLE,a")
        numbers = [number_of(a, self.name) for a in (*statement.arguments[:7], statement.arguments[8])]
        if not 0.0 < numbers[7] <= 3.6e6:
            raise self.fail(f"an arc of {numbers[7]:g} degrees", "an angle above 0", at=statement.arguments[8])
        axis = self._circle_axis(numbers[3:6])
        center = self._scaled(numbers[:3])
        self._await_circle(Circle(center, axis, numbers[6] * self.scale, sweep=numbers[7]))

    def _await_circle(self, circle: Circle) -> None:
        if self.rapid:
            raise self.fail(f"an arc after the RAPID of line {self.rapid}", "a rapid to a point, or an arc at a feed")
        if self.cycle is not None:
            raise self.fail("an arc within a drilling cycle", "CYCLE/OFF before it")
        if self.circle is not None:
            raise self.fail(f"a circle while the one of line {self.circle_line} waits for its GOTO", "GOTO/")
        if self.point is None:
            raise self.fail("an arc before any point", "FROM/ or GOTO/ before it")
        if self.direction is not None:
            axis = circles.turned_as(circle.center, circle.axis, self.point, self.direction)
            circle = Circle(circle.center, axis, circle.radius, circle.turns, circle.sweep)
            self.direction = None
        self.circle, self.circle_line = circle, self.statement.line
        self._swept = 0.0
        self.note_entry(self.statement.line, circle)

    def arc_through(self, targets: list[Vector], axis: Vector) -> None:
        """Follow the circle that waits through points; the last one ends the arc."""
        circle = self.circle
        assert circle is not None
        self.circle, self.followed = None, circle
        for target in targets:
            if self._swept and circle.sweep is not None:
                raise self.fail("a second point of an arc whose ANGLE is said", "one point")
            self._swept += self.circular(self.statement.line, circle, target, axis)
            if circle.sweep is None and self._swept > math.tau * circle.turns + ROUNDING:
                raise self.fail(
                    "points of an arc that do not follow each other in its direction", "points in the order of the cut"
                )

    def _indirv(self, statement: Statement) -> None:
        x, y, z = self._numbers(statement, 3)
        self.direction = (x, y, z)

    def _tlon(self, statement: Statement) -> None:
        """CATIA's and Creo's arcs in APT's own words."""
        if self.direction is None:
            raise self.fail("TLON,GOFWD/ without its direction", "INDIRV/ before it")
        geometry = [nested(argument.text) or argument.text.upper() for argument in statement.arguments]
        which = 1
        if len(geometry) == 5 and geometry[2] in ("1", "2") and geometry[3] == "INTOF":
            which = int(str(geometry[2]))
            geometry = [geometry[0], geometry[1], geometry[4]]
        if len(geometry) != 3 or geometry[1] != "ON" or isinstance(geometry[0], str) or isinstance(geometry[2], str):
            raise self.fail(
                statement.shown, "TLON,GOFWD/(CIRCLE/x,y,z,r),ON,(LINE/x,y,z,x,y,z), or CATIA's (CYLNDR/...)"
            )
        circle = self._tlon_circle(geometry[0])
        line = self._tlon_line(geometry[2])
        self._await_circle(circle)
        waiting = self.circle
        assert waiting is not None and self.point is not None
        self.arc_through([circles.line_meets(waiting, self.point, line, which)], self.next_axis)
        self.followed = None

    def _tlon_circle(self, given: Nested) -> Circle:
        numbers = [value for value in given[1] if isinstance(value, float)]
        if given[0] == "CIRCLE" and len(given[1]) == len(numbers) == 4:
            return Circle(self._scaled(numbers[:3]), Z, numbers[3] * self.scale)
        if given[0] in ("CYLNDR", "CIRCLE") and len(given[1]) == len(numbers) == 7:
            axis = self._circle_axis(numbers[3:6])
            return Circle(self._scaled(numbers[:3]), axis, numbers[6] * self.scale)
        raise self.fail(f"TLON,GOFWD/ along ({given[0]}/...)", "(CIRCLE/x,y,z,r) or (CYLNDR/x,y,z,i,j,k,r)")

    def _tlon_line(self, given: Nested) -> tuple[Vector, Vector]:
        """The line up to which the tool goes: two points, of CATIA's plane the two that it goes through."""
        numbers = [value for value in given[1] if isinstance(value, float)]
        if given[0] == "LINE" and len(given[1]) == len(numbers) == 6:
            return self._scaled(numbers[:3]), self._scaled(numbers[3:])
        points = [value for value in given[1] if isinstance(value, tuple) and value[0] == "POINT"]
        if given[0] == "PLANE" and given[1][0] == "PERPTO" and len(given[1]) == 4 and len(points) == 2:
            ends = [[value for value in point[1] if isinstance(value, float)] for point in points]
            if all(len(end) == 3 for end in ends):
                return self._scaled(ends[0]), self._scaled(ends[1])
        raise self.fail(f"TLON,GOFWD/ up to ({given[0]}/...)", "(LINE/x,y,z,x,y,z)")
