"""Tool tables and work-offset files: LinuxCNC's own formats and plain ones. mm and degrees."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path

from toolpath_stiff.errors import FileError, ProgramError
from toolpath_stiff.files import read_bytes
from toolpath_stiff.nc.moves import ToolUse
from toolpath_stiff.nc.place import Place
from toolpath_stiff.units import m_from_mm

WORK_OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
ADDITIONAL_OFFSETS = {"G54.1": 300, "G154": 99}  # Fanuc's and Haas', numbered by P up to that
LARGEST_BYTES = 10_000_000
LARGEST_MM = 1e5  # 100 m: a coordinate beyond is a slip of unit or key
LARGEST_WORD = 1e9  # any other word: the radius of an arc that is nearly straight, a tool's number
# LinuxCNC's parameter file (manual, "Parameters"): G54 is 5221 to 5230, each further offset 20 on; X Y Z A B C U V W R.
FIRST_OFFSET, OFFSET_STRIDE, ROTATION = 5221, 20, 9
HOME_G28, HOME_G30 = 5161, 5181
HOMES = ("G28", "G30")
ADDITIONAL = re.compile(r"(G54\.1|G154) ?P([1-9]\d{0,2})")


def tool_table_hint(tool: int) -> str:
    """How to give the length of a tool where there is no tool table, with one to copy."""
    return (
        "give one with --tools tools.csv, or drop it on the studio's page first; with the length in mm:\n"
        f"tool,length_mm\n{tool},LENGTH"
    )


@dataclass
class ToolEntry:
    """A tool: length, diameter and stick-out (out of its holder) in mm, nan where the table does not say."""

    number: int
    length: float = math.nan
    diameter: float = math.nan
    remark: str = ""
    stick_out: float = math.nan
    material: str = ""

    def in_use(self) -> ToolUse:
        """The tool as programs report it, in SI."""
        length, diameter, stick_out = m_from_mm(self.length), m_from_mm(self.diameter), m_from_mm(self.stick_out)
        return ToolUse(self.number, length, diameter, self.remark, stick_out, self.material)

    def __deepcopy__(self, _memo: dict[int, object]) -> ToolEntry:
        # Every reading copies its tables, field by field at ten times the cost.
        return replace(self)


def tool_of(tools: dict[int, ToolEntry] | None, number: int) -> ToolEntry:
    """The tool of a number; where no table has it, one of which nothing else is known."""
    return (tools or {}).get(number) or ToolEntry(number)


@dataclass
class WorkOffset:
    """A work offset: six axes in mm and degrees, and the rotation of X and Y in degrees. `given`: someone set it."""

    axes: list[float] = field(default_factory=lambda: [0.0] * 6)
    rotation: float = 0.0
    given: bool = False

    def __deepcopy__(self, _memo: dict[int, object]) -> WorkOffset:
        return replace(self, axes=[*self.axes])


@dataclass
class Offsets:
    """Work offsets in the order of `WORK_OFFSETS`, additional ones by their P, reference points of G28 and G30."""

    table: list[WorkOffset] = field(default_factory=lambda: [WorkOffset() for _ in WORK_OFFSETS])
    additional: dict[int, WorkOffset] = field(default_factory=dict)
    home_g28: list[float] = field(default_factory=lambda: [0.0] * 6)
    home_g30: list[float] = field(default_factory=lambda: [0.0] * 6)

    def at(self, index: int) -> WorkOffset:
        """The offset of an index: of `WORK_OFFSETS`, and beyond them G54.1 P1, P2 and so on."""
        standard = len(self.table)
        return self.table[index] if index < standard else self.additional[index - standard + 1]


def _lines(path: str | Path, what: str) -> list[str]:
    try:
        return read_bytes(path, what, LARGEST_BYTES).decode("utf-8-sig").splitlines()
    except FileError as error:
        raise ProgramError(error.found, hint=error.hint) from None
    except UnicodeDecodeError:
        raise ProgramError(f"{what} is not a text file", file=str(path)) from None


def _number(text: str, what: str, place: Place) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or abs(value) > LARGEST_MM:
        raise place.fail(f"{what} = {text[:40]!r}", f"a number within +-{LARGEST_MM:g}")
    return value


def read_tool_table(path: str | Path) -> dict[int, ToolEntry]:
    r"""Tool number -> tool, from a LinuxCNC table (`T1 P1 Z50 D6 ;end mill`) or CSV (`tool,length_mm,...`).

    Lengths are taken as mm in both. Raises `InputError` with the line.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "tool.tbl"
    ...     _ = file.write_text("T1 P1 Z50 D6 ;end mill\n")
    ...     tools = read_tool_table(file)
    >>> tools[1].length, tools[1].diameter, tools[1].remark
    (50.0, 6.0, 'end mill')
    """
    lines = _lines(path, "tool table")
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if not filled:
        raise ProgramError("the tool table is empty", file=str(path))
    is_csv = "," in filled[0][1] and not filled[0][1].lstrip().upper().startswith(("T0", "T1", ";"))
    tools = _csv_tools(path, filled) if is_csv else _linuxcnc_tools(path, filled)
    by_number: dict[int, ToolEntry] = {}
    for line, tool in tools:
        if tool.number in by_number:
            raise Place(str(path), line).fail(f"tool {tool.number} appears twice")
        by_number[tool.number] = tool
    return by_number


def _csv_tools(path: str | Path, lines: list[tuple[int, str]]) -> list[tuple[int, ToolEntry]]:
    columns = ("tool", "length_mm", "diameter_mm", "remark", "stick_out_mm", "material")
    heading_place = Place(str(path), lines[0][0])
    heading = _cells(heading_place, lines[0][1])
    unknown = [name for name in heading if name not in columns]
    missing = [name for name in columns[:2] if name not in heading]
    if unknown or missing:
        problem = f"column {unknown[0]!r} is not known" if unknown else f"column {missing[0]!r} is missing"
        raise heading_place.fail(problem, f"columns {', '.join(columns)}")
    rows = []
    for line, text in lines[1:]:
        place = Place(str(path), line)
        cells = dict(zip(heading, _cells(place, text), strict=False))
        number = _number(cells.get("tool", ""), "tool", place)
        if number != int(number) or number < 0:
            raise place.fail(f"tool = {cells['tool']!r}", "a whole number")
        length = _number(cells.get("length_mm", ""), "length_mm", place)
        diameter, stick_out = (
            _number(cells[name], name, place) if cells.get(name) else math.nan
            for name in ("diameter_mm", "stick_out_mm")
        )
        tool = ToolEntry(int(number), length, diameter, cells.get("remark", ""), stick_out, cells.get("material", ""))
        rows.append((line, tool))
    return rows


def _cells(place: Place, text: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([text]))]
    except csv.Error as error:  # a cell of more than 131,072 characters
        raise place.fail(f"a row that cannot be read: {error}") from None


def _linuxcnc_tools(path: str | Path, lines: list[tuple[int, str]]) -> list[tuple[int, ToolEntry]]:
    rows = []
    for line, text in lines:
        place = Place(str(path), line)
        content, _, remark = text.partition(";")
        if not content.strip():
            continue
        words = dict(re.findall(r"([A-Za-z])\s*([^\sA-Za-z]+(?:[eE][+-]?\d+)?)", content))
        words = {letter.upper(): value for letter, value in words.items()}
        if re.fullmatch(r"[0-9]{1,9}", words.get("T", "")) is None:
            raise place.fail(
                f"{content.strip()[:40]!r} is not a tool", "T<number> P<pocket> Z<length mm> D<diameter mm> ;remark"
            )
        length = _number(words["Z"], "Z", place) if "Z" in words else math.nan
        diameter = _number(words["D"], "D", place) if "D" in words else math.nan
        rows.append((line, ToolEntry(int(words["T"]), length, diameter, remark.strip())))
    return rows


def is_offset(name: str) -> bool:
    """Whether a table may set it: a work offset or a reference point."""
    return name in (*WORK_OFFSETS, *HOMES) or additional_offset(name) is not None


def additional_offset(name: str) -> int | None:
    """The P of `G54.1 P3` or `G154 P3`, which name the same offset; None for any other name.

    Examples
    --------
    >>> additional_offset("G54.1 P3")
    3
    >>> additional_offset("G54") is None
    True
    """
    match = ADDITIONAL.fullmatch(name)
    return int(match[2]) if match and int(match[2]) <= ADDITIONAL_OFFSETS[match[1]] else None


def read_offsets(path: str | Path) -> Offsets:
    r"""Work offsets from a file. Raises `InputError` with the line.

    Lines are `G55 = [x, y, z, a, b, c, r]` (mm and degrees, short lists allowed), or those of a LinuxCNC parameter
    file (`5221 12.5`).

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "offsets.txt"
    ...     _ = file.write_text("G54 = [100, -50, 800]\n")
    ...     offsets = read_offsets(file)
    >>> offsets.at(0).axes
    [100.0, -50.0, 800.0, 0.0, 0.0, 0.0]
    """
    lines = _lines(path, "offsets file")
    filled = [(number, line.split("#")[0].strip()) for number, line in enumerate(lines, 1)]
    filled = [(number, line) for number, line in filled if line]
    if not filled:
        raise ProgramError("the offsets file is empty", expected="lines such as G55 = [100, 0, 0]", file=str(path))
    offsets = Offsets()
    for line, text in filled:
        place = Place(str(path), line)
        parameter = re.fullmatch(r"([0-9]{1,9})\s+(\S+)", text)
        assignment = re.fullmatch(r'"?([Gg][\d.]+(?: ?[Pp]\d+)?)"?\s*=\s*\[(.*)\]', text)
        if parameter:
            _set_parameter(offsets, int(parameter[1]), _number(parameter[2], parameter[1], place))
        elif assignment and is_offset(assignment[1].upper()):
            name = assignment[1].upper()
            values = [_number(v.strip(), name, place) for v in assignment[2].split(",") if v.strip()]
            most = 6 if name in HOMES else 7
            if not 1 <= len(values) <= most:
                raise place.fail(f"{name} has {len(values)} numbers", f"1 to {most}")
            set_offset(offsets, name, values)
        else:
            raise place.fail(
                f"{text[:40]!r} is not an offset",
                "G54 = [x, y, z, a, b, c, r] (to G59.3, G28, G30, G54.1 P1), or LinuxCNC's `5221 12.5`",
            )
    return offsets


def set_offset(offsets: Offsets, name: str, values: list[float]) -> None:
    """Set an offset (x, y, z, a, b, c, r) or a reference point, G28 or G30; missing numbers are 0.

    Examples
    --------
    >>> offsets = Offsets()
    >>> set_offset(offsets, "G55", [100.0, 50.0])
    >>> offsets.at(1)
    WorkOffset(axes=[100.0, 50.0, 0.0, 0.0, 0.0, 0.0], rotation=0.0, given=True)
    """
    axes = [*values[:6], *[0.0] * (6 - len(values[:6]))]
    if name == "G28":
        offsets.home_g28 = axes
    elif name == "G30":
        offsets.home_g30 = axes
    else:
        offset = WorkOffset(axes, values[6] if len(values) > 6 else 0.0, given=True)
        if name in WORK_OFFSETS:
            offsets.table[WORK_OFFSETS.index(name)] = offset
        else:
            number = additional_offset(name)
            assert number is not None
            offsets.additional[number] = offset


def _set_parameter(offsets: Offsets, number: int, value: float) -> None:
    """One line of a LinuxCNC parameter file; other parameters are ignored."""
    for home, first in ((offsets.home_g28, HOME_G28), (offsets.home_g30, HOME_G30)):
        if 0 <= number - first < 6:
            home[number - first] = value
    index, place = divmod(number - FIRST_OFFSET, OFFSET_STRIDE)
    if 0 <= index < len(offsets.table) and 0 <= place <= ROTATION and not 6 <= place < ROTATION:
        offset = offsets.table[index]
        if place == ROTATION:
            offset.rotation = value
        else:
            offset.axes[place] = value
        offset.given = offset.given or value != 0.0
