"""Input of a cut besides program and machine: `cut.toml` with stock, tools, coefficients and spindle.

What is missing is refused with one line that says what to write where; what is assumed stands in the result.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.cutting.coefficients import Coefficients, coefficients_from, material, read_coefficients
from toolpath_stiff.cutting.cutters import Cutter, cutter_of, merged_tool
from toolpath_stiff.cutting.stock import Stock, box_stock, stock_from_stl, stock_of_extents
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.courses import Extents, extents
from toolpath_stiff.nc.moves import RAPID, ReadProgram
from toolpath_stiff.nc.tables import ToolEntry, tool_of, tools_of
from toolpath_stiff.path.sampling import Samples
from toolpath_stiff.toml_reader import TomlReader, is_text
from toolpath_stiff.units import m_from_mm, mm_from_m, rad_per_s_from_per_min

LARGEST_MM = 1e5
FASTEST = 1e6  # 1/min
CELLS = 40  # of an STL's grid across the smallest cutter
SECTIONS = ("stock", "coefficients", "spindle", "tool")
DIRECTIONS = {"clockwise": 1.0, "counter-clockwise": -1.0}
STOCK_HINT = (
    "write [stock] with box_mm = [X, Y, Z], extents = true or stl = FILE in cut.toml, or say --stock X,Y,Z or "
    "--stock extents"
)
COEFFICIENTS_HINT = "write [coefficients] with material = NAME, numbers or file = JSON in cut.toml, or say --material"


@dataclass(frozen=True)
class CutSetup:
    """Input of a cut besides program and machine. SI.

    Attributes
    ----------
    coefficients
        Of the cutting force.
    size, corner
        m: X, Y, Z of a box and its lowest corner in program coordinates, None: not given. Without a size, or an STL,
        the stock is the extents of the cuts, or `from_program` the blank that the program states.
    body
        An STL file in program coordinates, mm; "" for none.
    tools
        Number -> tool, which wins over the program's tool table.
    spindle
        rad/s where the program names no speed, less than 0 counter-clockwise; nan: not given.
    file, from_program
        Where it was read from, for messages; whether it leaves the stock to the program.
    """

    coefficients: Coefficients
    size: tuple[float, float, float] | None = None
    corner: tuple[float, float, float] | None = None
    body: str = ""
    tools: Mapping[int, ToolEntry] = field(default_factory=dict)
    spindle: float = math.nan
    file: str = ""
    from_program: bool = False

    @property
    def inputs(self) -> tuple[str, ...]:
        """Files from which the setup is read."""
        return tuple(name for name in (self.file, self.body) if name)


def read_setup(file: str | Path) -> CutSetup:
    """The setup in a file. Raises `InputError` with line and key."""
    toml = TomlReader.read(file, "the cut's setup")
    toml.only("", toml.data, SECTIONS)
    if "coefficients" not in toml.data:
        raise toml.error("[coefficients] is missing", hint=COEFFICIENTS_HINT)
    missing = "stock" not in toml.data
    size, corner, body = (None, None, "") if missing else _stock_in(toml)
    tools = tools_of(toml, "tool") or {}
    return CutSetup(_coefficients_in(toml), size, corner, body, tools, _spindle_in(toml), str(file), missing)


def setup_of(material_name: str, stock: str | None) -> CutSetup:
    """The setup for `--material` and `--stock` ("X,Y,Z" in mm, "extents", None: the program's). Raises `InputError`."""
    coefficients = material(material_name)
    if stock is None or stock == "extents":
        return CutSetup(coefficients, from_program=stock is None)
    try:
        x, y, z = (m_from_mm(float(part)) for part in stock.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(0.0 < edge <= m_from_mm(LARGEST_MM) for edge in (x, y, z)):
        raise InputError(f"--stock {stock[:60]}", expected="X,Y,Z of a box in mm, or extents")
    return CutSetup(coefficients, (x, y, z))


def _numbers(toml: TomlReader, where: str, value: object, least: float) -> tuple[float, float, float]:
    """Three numbers, given in mm, in m."""
    if not isinstance(value, list) or len(value) != 3:
        raise toml.error(f"{where} = {value!r}", "[X, Y, Z] in mm", where=where)
    x, y, z = (toml.number(where, part, LARGEST_MM) for part in value)
    if min(x, y, z) < least:
        raise toml.error(f"{where} = {value!r}", f"numbers of {least:g} mm or more", where=where)
    return m_from_mm(x), m_from_mm(y), m_from_mm(z)


def _stock_in(
    toml: TomlReader,
) -> tuple[tuple[float, float, float] | None, tuple[float, float, float] | None, str]:
    table = toml.table("stock", toml.data["stock"], "a section [stock]")
    toml.only("stock", table, ("box_mm", "corner_mm", "extents", "stl"))
    kinds = [key for key in ("box_mm", "extents", "stl") if key in table]
    if len(kinds) != 1:
        kind = " and ".join(kinds) or "nothing"
        raise toml.error(f"[stock] with {kind}", "one of box_mm, extents, stl", where="stock")
    if "corner_mm" in table and kinds != ["box_mm"]:
        raise toml.error("stock.corner_mm without box_mm", "the box that it is of", where="stock.corner_mm")
    size = corner = None
    if "box_mm" in table:
        size = _numbers(toml, "stock.box_mm", table["box_mm"], 1e-3)
    if "corner_mm" in table:
        corner = _numbers(toml, "stock.corner_mm", table["corner_mm"], -LARGEST_MM)
    if "extents" in table and not toml.flag("stock.extents", table["extents"]):
        raise toml.error("stock.extents = false", "true, or box_mm, or stl", where="stock.extents")
    return size, corner, _beside(toml, "stock.stl", table["stl"]) if "stl" in table else ""


def _beside(toml: TomlReader, where: str, value: object) -> str:
    """The path of a file named in the setup, relative to the setup's folder."""
    if not is_text(value):
        raise toml.error(f"{where} = {value!r}", "the name of a file", where=where)
    return str(Path(toml.file).parent / value)


def _coefficients_in(toml: TomlReader) -> Coefficients:
    table = toml.table("coefficients", toml.data["coefficients"], "a section [coefficients]")
    if "file" in table:
        toml.only("coefficients", table, ["file"], " beside file")
        return read_coefficients(_beside(toml, "coefficients.file", table["file"]))
    if list(table) == ["material"]:
        try:
            return material(str(table["material"]))
        except InputError as error:
            raise toml.error(error.found, error.expected, error.hint, "coefficients.material") from None

    def fault(key: str, mistake: str, expected: str) -> InputError:
        return toml.error(f"coefficients: {mistake}", expected, where=f"coefficients.{key}")

    return coefficients_from(table, fault)


def _spindle_in(toml: TomlReader) -> float:
    table: Document = toml.table("spindle", toml.data.get("spindle", {}), "a section [spindle]")
    toml.only("spindle", table, ("speed_per_min", "direction"))
    if not table:
        return math.nan
    speed = toml.number("spindle.speed_per_min", toml.needed("spindle", table, "speed_per_min", "1/min"), FASTEST)
    if speed <= 0.0:
        raise toml.error(f"spindle.speed_per_min = {speed:g}", "more than 0", where="spindle.speed_per_min")
    expected = " or ".join(DIRECTIONS)
    direction = toml.choice("spindle.direction", table.get("direction", "clockwise"), DIRECTIONS, expected)
    return DIRECTIONS[direction] * rad_per_s_from_per_min(speed)


def cutters_of(setup: CutSetup, program: ReadProgram) -> dict[int, Cutter]:
    """Number -> cutter of the tools that cut. Raises `InputError` for one with missing data."""
    known = {tool.number: tool for tool in program.tools}
    numbers = np.unique(program.moves.tool[program.moves.motion != RAPID]).tolist()
    tools = (merged_tool(tool_of(known, n), tool_of(dict(setup.tools), n)) for n in numbers)
    return {tool.number: cutter_of(tool) for tool in tools}


def stock_of(setup: CutSetup, program: ReadProgram, cutters: Mapping[int, Cutter]) -> Stock:
    """The stock in program coordinates. Raises `InputError`.

    A box without a corner stands where a shop would put its zero: at the middle or an edge of the top face (the
    underside's, where the cuts are above zero), whichever is nearest to the cuts.
    """
    if setup.body:
        smallest = min(cutter.diameter for cutter in cutters.values())
        return stock_from_stl(setup.body, smallest / CELLS)
    if setup.from_program:
        if program.stock is None:
            raise ProgramError("no stock is given, the program states none", hint=STOCK_HINT, file=program.name)
        return box_stock(*program.stock, "as the program states it (BLK FORM, WORKPIECE)", program.name)
    if setup.size is None:
        return stock_of_extents(program.moves, cutters)
    low, origin = setup.corner, "given"
    if low is None:
        low = _usual_corner(setup.size, extents(program.moves.take(program.moves.motion != RAPID)))
        corner = ", ".join(f"{mm_from_m(value) + 0.0:g}" for value in low)
        origin = f"its place is assumed: lowest corner at {corner} mm (corner_mm in [stock] of cut.toml says otherwise)"
    (x, y, z), (width, depth, height) = low, setup.size
    return box_stock(low, (x + width, y + depth, z + height), origin)


def _usual_corner(size: tuple[float, float, float], cuts: Extents) -> tuple[float, float, float]:
    """The lowest corner of a box around program zero, m; `cuts` in mm."""

    def nearest(axis: str, edge: float) -> float:
        middle = m_from_mm(0.5 * (cuts[axis][0] + cuts[axis][1]))
        return min((-0.5 * edge, 0.0, -edge), key=lambda low: abs(low + 0.5 * edge - middle))

    above = cuts["z"][1] > 0.0 and cuts["z"][0] >= 0.0
    return nearest("x", size[0]), nearest("y", size[1]), 0.0 if above else -size[2]


def spindle_of(setup: CutSetup, program: ReadProgram, samples: Samples) -> FloatArray:
    """(n,) rad/s at samples, negative counter-clockwise. Raises `ProgramError` for a cut without a speed."""
    speed = np.asarray(samples.spindle)
    if not math.isnan(setup.spindle):
        speed = np.where(speed == 0.0, setup.spindle, speed)
    without = samples.cutting & (samples.weight > 0.0) & ~(np.abs(speed) > 0.0)
    if without.any():
        row = int(np.argmax(without))
        surface = bool(np.isnan(speed[row]))
        problem = "a constant surface speed (G96) does not give a spindle speed" if surface else "the spindle stands"
        hint = "program G97 S" if surface else "program S and M3, or write [spindle] speed_per_min in cut.toml"
        raise ProgramError(f"a cut while {problem}", hint=hint, file=program.name, line=int(samples.line[row]))
    return speed
