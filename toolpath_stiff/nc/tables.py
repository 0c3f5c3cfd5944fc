"""Tool tables and work-offset files: LinuxCNC's own formats and plain ones. mm and degrees."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.files import read_utf8
from toolpath_stiff.nc.place import Place
from toolpath_stiff.tables import Columns, parse_table
from toolpath_stiff.toml_reader import TomlReader, is_number

WORK_OFFSETS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
ADDITIONAL_OFFSETS = {"G54.1": 300, "G154": 99}  # Fanuc's and Haas', with the largest P
LARGEST_BYTES = 10_000_000
LARGEST_MM = 1e5  # 100 m: a larger coordinate is a mistaken unit or key
LARGEST_WORD = 1e9  # for any other word, such as the radius of a nearly straight arc or a tool's number
# LinuxCNC's parameter file (manual, "Parameters"): G54 is 5221 to 5230, each further offset 20 on; X Y Z A B C U V W R.
FIRST_OFFSET, OFFSET_STRIDE, ROTATION = 5221, 20, 9
HOME_G28, HOME_G30 = 5161, 5181
HOMES = ("G28", "G30")
# Data of a cutter that a path does not need (`cutting.cutters`): key -> smallest and largest number.
CUTTER_KEYS = {
    "flutes": (1.0, 100.0), "helix_deg": (-80.0, 80.0), "corner_radius_mm": (0.0, 1000.0), "core_mm": (0.01, 1000.0),
    "cutting_length_mm": (0.01, 1000.0), "modulus_GPa": (1.0, 2000.0), "lateral_nm_per_N": (0.0, 1e6),
    "axial_nm_per_N": (0.0, 1e6), "run_out_um": (0.0, 1000.0), "run_out_angle_deg": (-360.0, 360.0),
}  # fmt: skip
TOOL_KEYS = ("number", "length_mm", "diameter_mm", "stick_out_mm", "remark", "material", *CUTTER_KEYS)
TOOL_WORD = re.compile(r"([A-Za-z])\s*([^\sA-Za-z]+(?:[eE][+-]?\d+)?)")
PARAMETER = re.compile(r"[0-9]{1,9}")
OFFSET_KEY = re.compile(r"^[ \t]*([Gg][\d.]+(?: ?[Pp]\d+)?)\s*=", re.MULTILINE)  # G54.1 P1 in TOML has quotes
ADDITIONAL = re.compile(r"(G54\.1|G154) ?P([1-9]\d{0,2})")


def tool_table_hint(tool: int) -> str:
    """Advice on giving the length of a tool without a tool table, with a table to copy."""
    return (
        "give one with --tools tools.csv, or drop it on the studio's page first; with the length in mm:\n"
        f"tool,length_mm\n{tool},LENGTH"
    )


@dataclass
class ToolEntry:
    """A tool: length, diameter and stick-out (out of its holder) in mm, nan where the table does not say.

    `cutter`: those of `CUTTER_KEYS` that the table gives.
    """

    number: int
    length: float = math.nan
    diameter: float = math.nan
    remark: str = ""
    stick_out: float = math.nan
    material: str = ""
    cutter: dict[str, float] = field(default_factory=dict)


def tool_of(tools: dict[int, ToolEntry] | None, number: int) -> ToolEntry:
    """The tool with this number; if no table has it, one of unknown length and diameter."""
    return (tools or {}).get(number) or ToolEntry(number)


@dataclass
class WorkOffset:
    """A work offset: six axes in mm and degrees, and the rotation of X and Y in degrees. `given`: someone set it."""

    axes: list[float] = field(default_factory=lambda: [0.0] * 6)
    rotation: float = 0.0
    given: bool = False


@dataclass
class Offsets:
    """Work offsets in the order of `WORK_OFFSETS`, additional ones by their P, reference points of G28 and G30."""

    table: list[WorkOffset] = field(default_factory=lambda: [WorkOffset() for _ in WORK_OFFSETS])
    additional: dict[int, WorkOffset] = field(default_factory=dict)
    home_g28: list[float] = field(default_factory=lambda: [0.0] * 6)
    home_g30: list[float] = field(default_factory=lambda: [0.0] * 6)

    def at(self, index: int) -> WorkOffset:
        """The offset with an index: into `WORK_OFFSETS`, and beyond these G54.1 P1, P2 and so on."""
        standard = len(self.table)
        return self.table[index] if index < standard else self.additional[index - standard + 1]


def _text(path: str | Path, what: str) -> str:
    try:
        text = read_utf8(path, what, LARGEST_BYTES)
    except InputError as error:
        raise ProgramError(error.found, hint=error.hint, file=error.file) from None
    if not text.strip():
        raise ProgramError(f"the {what} is empty", file=str(path))
    return text


def _number(text: str, what: str) -> float:
    """A number in a table. Raises `ProgramError` without a place."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST_MM:
        raise ProgramError(f"{what} = {text[:40]!r}", expected=f"a number within +-{LARGEST_MM:g}")
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
    text, file = _text(path, "tool table"), str(path)
    first = next(line for line in text.splitlines() if line.strip()).lstrip().upper()
    is_csv = "," in first and not first.startswith(("T0", "T1", ";"))
    tools: dict[int, ToolEntry] = {}
    for line, tool in (_csv_tools if is_csv else _linuxcnc_tools)(text, file):
        if tools.setdefault(tool.number, tool) is not tool:
            raise Place(file, line).fail(f"tool {tool.number} appears twice")
    return tools


def tools_of(toml: TomlReader, key: str = "tools") -> dict[int, ToolEntry] | None:
    """Tool number -> tool, from `tools` of a controller file or `tool` of `cut.toml`: tables, or the name of a file."""
    given = toml.data.get(key)
    if given is None:
        return None
    if isinstance(given, str):
        return read_tool_table(Path(toml.file).parent / given)
    if not isinstance(given, list) or not all(isinstance(tool, dict) for tool in given):
        expected = f"[[{key}]] with number, length_mm, ..., or the name of a file"
        raise toml.error(f"{key} is not a list of tables", expected, where=key)
    tools: dict[int, ToolEntry] = {}
    for place, row in enumerate(given, 1):
        where = f"{key}[{place}]"
        toml.only(where, row, TOOL_KEYS)
        try:
            tool = _tool(row)
        except ProgramError as error:
            raise toml.error(f"{where}: {error.found}", error.expected, where=where) from None
        if tools.setdefault(tool.number, tool) is not tool:
            raise toml.error(f"{where}: tool {tool.number} appears twice", where=f"{where}.number")
    return tools


def _csv_tools(text: str, file: str) -> Iterator[tuple[int, ToolEntry]]:
    columns = ("tool", *TOOL_KEYS[1:])
    numbers_of = (*columns[:4], *CUTTER_KEYS)
    table = parse_table(text, file, Columns(numbers_of, columns[4:6]))
    unknown = [f"{name!r} is not known" for name in table.heading if name not in columns]
    for problem in unknown + [f"{name!r} is missing" for name in columns[:1] if name not in table.heading]:
        raise Place(file, table.heading_line).fail(f"column {problem}", f"columns {', '.join(columns)}")
    for line, cells in table.rows:
        try:
            row = {key: cell for key, cell in table.record(cells).items() if cell}
            numbers = {key: _number(row[key], key) for key in numbers_of if key in row}
            tool = _tool({**row, **numbers, "number": numbers.get("tool")})
        except InputError as error:
            raise error.in_line(file, line) from None
        yield line, tool


def _tool(row: Mapping[str, object]) -> ToolEntry:
    """The tool given by `TOOL_KEYS`. Raises `ProgramError` without a place."""
    number, remark, material = row.get("number"), row.get("remark", ""), row.get("material", "")
    lengths: dict[str, float] = {}
    if not is_number(number) or number != int(number) or number < 0:
        raise ProgramError(f"tool number {number!r}", expected="a whole number")
    for key in TOOL_KEYS[1:4]:
        value, positive = row.get(key, math.nan), key != "length_mm"
        if not is_number(value) or abs(value) > LARGEST_MM or (positive and value <= 0.0):
            raise ProgramError(f"{key} = {value!r}", expected=f"a number of mm{', more than 0' * positive}")
        lengths[key.removesuffix("_mm")] = float(value)
    cutter: dict[str, float] = {}
    for key, (low, high) in CUTTER_KEYS.items():
        value = row.get(key, low)
        if not is_number(value) or not low <= value <= high or (key == "flutes" and value != int(value)):
            whole = "a whole number" if key == "flutes" else "a number"
            raise ProgramError(f"{key} = {value!r}", expected=f"{whole} from {low:g} to {high:g}")
        cutter |= {key: float(value)} if key in row else {}
    if not isinstance(remark, str) or not isinstance(material, str):
        raise ProgramError(f"remark and material {remark!r}, {material!r}", expected="texts")
    return ToolEntry(int(number), remark=remark, material=material, cutter=cutter, **lengths)


def _linuxcnc_tools(text: str, file: str) -> Iterator[tuple[int, ToolEntry]]:
    for line, row in enumerate(text.splitlines(), 1):
        content, _, remark = row.partition(";")
        if not content.strip() or row.startswith("#"):
            continue
        words = {key.upper(): value for key, value in TOOL_WORD.findall(content)}
        if re.fullmatch(r"[0-9]{1,9}", words.get("T", "")) is None:
            raise Place(file, line).fail(
                f"{content.strip()[:40]!r} is not a tool", "T<number> P<pocket> Z<length mm> D<diameter mm> ;remark"
            )
        try:
            length, diameter = (_number(words[key], key) if key in words else math.nan for key in "ZD")
        except ProgramError as error:
            raise error.in_line(file, line) from None
        yield line, ToolEntry(int(words["T"]), length, diameter, remark.strip())


def additional_offset(name: str) -> int | None:
    """The P in `G54.1 P3` or `G154 P3`, names of the same offset; None for any other name.

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
    text, file = _text(path, "offsets file"), str(path)
    lines = [(number, line.partition("#")[0].split()) for number, line in enumerate(text.splitlines(), 1)]
    if any(words and PARAMETER.fullmatch(words[0]) for _, words in lines):
        return _offsets_of_parameters([(number, words) for number, words in lines if words], file)
    toml = TomlReader(OFFSET_KEY.sub(r'"\1" =', text), file, "the offsets file", ProgramError)
    return _offsets_in(toml, toml.data, "")


def offsets_of(toml: TomlReader) -> Offsets | None:
    """Work offsets of `offsets` of a controller file: a table, or the name of a file."""
    given = toml.data.get("offsets")
    if isinstance(given, str):
        return read_offsets(Path(toml.file).parent / given)
    if given is None:
        return None
    table = toml.table("offsets", given, "a table G54 = [x, y, z, a, b, c, r], or the name of a file")
    return _offsets_in(toml, table, "offsets.")


def _offsets_in(toml: TomlReader, table: Mapping[str, object], before: str) -> Offsets:
    offsets = Offsets()
    for key, values in table.items():
        name, where = key.upper(), f"{before}{key}"
        number = additional_offset(name)
        if number in offsets.additional:
            raise toml.error(f"{where!r} is there twice: G54.1 and G154 name the same offsets", where=where)
        if name not in (*WORK_OFFSETS, *HOMES) and number is None:
            expected = f'{", ".join((*WORK_OFFSETS, *HOMES))}, "G54.1 P1" (to P300) or "G154 P1" (to P99)'
            raise toml.error(f"{where} is not an offset", expected, where=where)
        most = 6 if name in HOMES else 7
        if not isinstance(values, list) or not 1 <= len(values) <= most:
            raise toml.error(f"{where} = {values!r}", f"1 to {most} numbers: x, y, z, a, b, c, r", where=where)
        numbers = [toml.number(where, value, LARGEST_MM) for value in values]
        axes = [*numbers[:6], *[0.0] * (6 - len(numbers))]
        offset = WorkOffset(axes, numbers[6] if len(numbers) > 6 else 0.0, given=True)
        if name in HOMES:
            (offsets.home_g28 if name == "G28" else offsets.home_g30)[:] = axes
        elif number is None:
            offsets.table[WORK_OFFSETS.index(name)] = offset
        else:
            offsets.additional[number] = offset
    return offsets


def _offsets_of_parameters(lines: list[tuple[int, list[str]]], file: str) -> Offsets:
    """Offsets in the lines of a LinuxCNC parameter file; other parameters are ignored."""
    offsets = Offsets()
    for line, words in lines:
        if len(words) != 2 or not PARAMETER.fullmatch(words[0]):
            raise Place(file, line).fail(f"{' '.join(words)[:40]!r} is not a parameter", "LinuxCNC's `5221 12.5`")
        try:
            number, value = int(words[0]), _number(words[1], words[0])
        except ProgramError as error:
            raise error.in_line(file, line) from None
        for home, first in ((offsets.home_g28, HOME_G28), (offsets.home_g30, HOME_G30)):
            if 0 <= number - first < 6:
                home[number - first] = value
        index, place = divmod(number - FIRST_OFFSET, OFFSET_STRIDE)
        if 0 <= index < len(offsets.table) and (0 <= place < 6 or place == ROTATION):
            offset = offsets.table[index]
            offset.given = offset.given or value != 0.0
            if place == ROTATION:
                offset.rotation = value
            else:
                offset.axes[place] = value
    return offsets
