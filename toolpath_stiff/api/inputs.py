"""A program, and the checks of what arguments say: mm, degrees and N, as their names tell."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file
from toolpath_stiff.hints import both_names, options
from toolpath_stiff.options import Option, arguments_of, checked, numbers
from toolpath_stiff.units import Pose, pose_in_mm, pose_in_si

if TYPE_CHECKING:
    import pandas as pd

    from toolpath_stiff.nc.controller import Controller
    from toolpath_stiff.nc.moves import Program as ReadProgram

FARTHEST_MM = 1e5  # 100 m: no machine is larger; more is a slip of unit or key
FARTHEST_DEG = 360.0
SWITCHES = re.compile(r"[1-9](?:,[1-9])*")  # of block delete


def switches(text: str) -> frozenset[int] | bool:
    """Block-delete switches, `2,3`; nothing, what the option means alone."""
    if not text:
        return True
    if not SWITCHES.fullmatch(text):
        raise ValueError("switches 1 to 9, as 2,3")
    return frozenset(map(int, text.split(",")))


# Options that several functions share.
Step = Annotated[float, Option("--step", "mm", above=0, at_most=1000, help="Largest distance of two samples.")]
Force = Annotated[
    float,
    Option(
        "--force",
        "N",
        above=0,
        at_most=1e6,
        help="Load at the tool tip: for deflections, and for effects that depend on it.",
    ),
]
LoadDirection = Annotated[
    str,
    Option(
        "--load",
        "DIRECTION",
        help="Direction of the load: tangential, axial, normal, softest, radial, x, y, z or DX,DY,DZ.",
    ),
]
Origin = Annotated[
    Sequence[float] | None,
    Option(
        "--origin",
        "X,Y,Z[,A,B,C]",
        read=numbers,
        help="Where program zero (G54) sits in machine coordinates, mm and degrees. Unless given, where the program's "
        "G10 says, else the machine's default.",
    ),
]
Linearised = Annotated[
    float | None,
    Option(
        "--linearise",
        "mm",
        above=0,
        at_most=10,
        help="Write arcs that the turn takes out of the planes as straight moves within so much; else refuse them.",
    ),
]


def finite(name: str, value: Any) -> float:
    """A number that is neither infinite nor nan: of a command, a call and a page alike. Raises `InputError`."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{name} {str(value)[:40]!r}".strip(), expected="a finite number")
    return number


def pose_si(name: str, pose: Sequence[float]) -> Pose:
    """X, Y, Z or X, Y, Z, A, B, C in mm and degrees, in SI. Raises `InputError`."""
    values = [finite(name, value) for value in pose]
    if len(values) not in (3, 6):
        raise InputError(f"{name} of {len(values)} numbers", expected="X, Y, Z or X, Y, Z, A, B, C in mm and degrees")
    x, y, z, a, b, c = (*values, 0.0, 0.0, 0.0)[:6]
    near = max(abs(x), abs(y), abs(z)) <= FARTHEST_MM and max(abs(a), abs(b), abs(c)) <= FARTHEST_DEG
    if not near:
        raise InputError(
            f"{name} {values}",
            expected=f"positions within +-{FARTHEST_MM:g} mm and angles within +-{FARTHEST_DEG:g} degrees",
        )
    return pose_in_si((x, y, z, a, b, c))


def origin_si(origin_mm_deg: Sequence[float] | None) -> Pose | None:
    """A placement in SI, None where none is given. Raises `InputError`."""
    return None if origin_mm_deg is None else pose_si(both_names("--origin"), origin_mm_deg)


def origin_word(origin: Pose) -> str:
    """A placement in SI as --origin takes it; angles that are all 0 go without saying."""
    words = [f"{value:.10g}" for value in pose_in_mm(origin)]
    return ",".join(words if any(origin[3:]) else words[:3])


class Reading(TypedDict, total=False):
    """How a program is read: the arguments of `Program.read`."""

    dialect: str | None
    controller: str | Path | None
    offsets: str | Path | None
    tools: str | Path | None
    block_delete: bool | Iterable[int]
    interpreter: str
    rs274: str | None
    feed_mm_per_min: float | None
    subprograms: str | Path | None
    unconfined: bool


@dataclass(frozen=True)
class Program:
    r"""An NC program or a cutter-location file, and how it is to be read.

    `Program.read` and `Program.from_text` make one. What a program does may depend on the machine that runs it and on
    where its zero sits (G53, G28), so every function reads it for what it needs.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> program = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> program
    <Program slot.nc: 5 lines>
    >>> len(program.to_frame())
    3
    >>> program.lines[1], program.inputs, program.read_as["block_delete"]
    ('G0 X0 Y0 Z5', (), False)
    """

    name: str
    file: str | None
    controller: Controller = field(repr=False)
    options: dict[str, Any] = field(repr=False)
    text: str | None = field(default=None, repr=False)
    said: dict[str, Any] = field(default_factory=dict, repr=False)
    _last: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    @checked
    def read(
        cls,
        file: str | Path,
        *,
        dialect: Annotated[str | None, Option("--dialect", choices=("generic", "linuxcnc", "fanuc", "haas"))] = None,
        controller: Annotated[str | Path | None, Option("--controller", "FILE")] = None,
        offsets: Annotated[str | Path | None, Option("--offsets", "FILE")] = None,
        tools: Annotated[str | Path | None, Option("--tools", "FILE")] = None,
        block_delete: Annotated[bool | Iterable[int], Option("--block-delete", "N,N", read=switches)] = False,
        interpreter: Annotated[str, Option("--interpreter", choices=("builtin", "linuxcnc", "auto"))] = "builtin",
        rs274: Annotated[str | None, Option("--rs274", "PATH")] = None,
        feed_mm_per_min: Annotated[float | None, Option("--feed", "mm/min", above=0, at_most=1e6)] = None,
        subprograms: Annotated[str | Path | None, Option("--subprograms", "FOLDER")] = None,
        unconfined: Annotated[bool, Option("--unconfined")] = False,
    ) -> Program:
        r"""A program in a file.

        Parameters
        ----------
        file
            NC program or cutter-location file.
        dialect
            The control, for what controls read differently: X10 without a decimal point, the time of G4 P, G70 and G71,
            `;`. Unless given, as the controller file says, else generic.
        controller
            File of what belongs to the control (TOML: dialect, block_delete, offsets, tools, the kinematics that the
            program was posted for; or LinuxCNC's .var or .tbl).
        offsets
            Work offsets G54 to G59.3, instead of the controller file's.
        tools
            Tool table, instead of the controller file's: LinuxCNC .tbl, or CSV tool,length_mm,diameter_mm.
        block_delete
            Leave out blocks that begin with a slash, or those of the switches that are on, 1 to 9 (/ is /1).
        interpreter
            What reads the program: the built-in reader; LinuxCNC's rs274; auto: rs274 where the built-in one refuses.
        rs274
            LinuxCNC's interpreter, if it is not on PATH.
        feed_mm_per_min
            Feed of cuts before the program's first F (a cutter-location file's first FEDRAT), mm/min.
        subprograms
            Folder of the files that the program calls (`o<name> call`, `M98 P1234`); without it none is opened.
        unconfined
            Run rs274 even where bubblewrap, which keeps it from all files but its own, cannot be used.

        Raises
        ------
        InputError
            A file cannot be read, or says what cannot be.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = pathlib.Path(folder, "slot.nc")
        ...     _ = file.write_text("G21 G90\nG0 Z5\n/ G0 X90\nG1 X40 F300\nM2\n")
        ...     program = tps.Program.read(file, dialect="fanuc", block_delete=True)
        ...     len(program.to_frame())
        2
        >>> program.words
        ['--dialect', 'fanuc', '--block-delete']
        """
        from toolpath_stiff.nc.words import read_lines

        if not is_file(file):
            read_lines(file)  # says what is wrong with it
        said = _said(
            dialect,
            controller,
            offsets,
            tools,
            block_delete,
            interpreter,
            rs274,
            feed_mm_per_min,
            subprograms,
            unconfined,
        )
        return cls(Path(file).name, str(file), *_control(said, block_delete), said=said)

    @classmethod
    def from_text(cls, text: str, name: str = "program", **reading: Unpack[Reading]) -> Program:
        r"""A program given as text; further arguments as of `read`.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Program.from_text("G1 X40 F300\nM2", name="slot.nc", dialect="linuxcnc")
        <Program slot.nc: 2 lines>
        """
        feed = reading.get("feed_mm_per_min")
        if feed is not None:
            arguments_of(cls.read)["feed_mm_per_min"].check(feed)
        said = _said(**reading)
        return cls(name, None, *_control(said, reading.get("block_delete", False)), text, said)

    def __repr__(self) -> str:
        count = "" if self.text is None else f": {len(self.text.splitlines())} lines"
        return f"<Program {self.name}{count}>"

    @property
    def lines(self) -> tuple[str, ...]:
        """The program's lines as they stand, without line ends."""
        from toolpath_stiff.nc.words import read_lines, split_lines

        return read_lines(self.file) if self.file is not None else split_lines(self.text or "", self.name)

    @property
    def read_as(self) -> dict[str, Any]:
        """What the reader of its blocks needs beside the text: offsets, tools, block delete."""
        control = self.controller
        return {"offsets": control.offsets, "tools": control.tools, "block_delete": self.options["block_delete"]}

    @property
    def words(self) -> list[str]:
        """The options of a command that say how it is read."""
        return options(**self.said)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that it is read from."""
        beside = (self.said[name] for name in ("controller", "offsets", "tools"))
        return tuple(one for one in (self.file, *beside) if one)

    def moves(self, origin: Pose | None = None, default_origin: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)) -> ReadProgram:
        r"""The program read for a zero, SI: as asked for, and unless anyone says; the last one is kept.

        Raises `InputError` with file, line and column for what cannot be read.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> read = tps.Program.from_text("G21 G90\nG1 X40 F300\nM2", name="slot.nc").moves()
        >>> len(read.moves), read.unsupported
        (1, ())
        """
        from toolpath_stiff.nc.reader import parse_program, read_program

        key = (origin, tuple(default_origin))
        if self._last.get("key") != key:
            options = {
                "origin": origin,
                "default_origin": default_origin,
                "controller": self.controller,
                **self.options,
            }
            read = (
                read_program(self.file, **options)
                if self.file is not None
                else parse_program(self.text or "", self.name, **options)
            )
            self._last.update(key=key, program=read)
        found: ReadProgram = self._last["program"]
        return found

    def to_frame(self) -> pd.DataFrame:
        r"""The moves, one a row: line, motion, tool, start and end in program coordinates of G54, feed.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
        >>> slot.to_frame()[["line", "motion"]].values.tolist()
        [[2, 'rapid'], [3, 'feed'], [4, 'feed']]
        """
        import pandas as pd

        from toolpath_stiff.nc.moves import move_columns

        return pd.DataFrame(move_columns(self.moves().moves))


def _said(
    dialect: str | None = None,
    controller: str | Path | None = None,
    offsets: str | Path | None = None,
    tools: str | Path | None = None,
    block_delete: bool | Iterable[int] = False,
    interpreter: str = "builtin",
    rs274: str | None = None,
    feed_mm_per_min: float | None = None,
    subprograms: str | Path | None = None,
    unconfined: bool = False,
) -> dict[str, Any]:
    """What was said of the reading, as options have it; None for what was not."""
    switches = block_delete if isinstance(block_delete, bool) else sorted(block_delete)
    if not isinstance(switches, bool) and not all(switch in range(1, 10) for switch in switches):
        raise InputError(f"block_delete {switches}", expected="switches 1 to 9, True or False")
    return {
        "dialect": dialect,
        **{name: str(file) if file else None for name, file in (("controller", controller), ("offsets", offsets))},
        "tools": str(tools) if tools else None,
        "block_delete": ",".join(map(str, switches)) if isinstance(switches, list) else switches,
        "interpreter": interpreter if interpreter != "builtin" else None,
        "rs274": rs274,
        "feed": feed_mm_per_min,
        "subprograms": str(subprograms) if subprograms else None,
        "unconfined": unconfined,
    }


def _control(said: Mapping[str, Any], block_delete: bool | Iterable[int]) -> tuple[Controller, dict[str, Any]]:
    """The control that is meant, tables included, and the other options of reading."""
    from toolpath_stiff.nc.controller import Controller, dialect_named, read_controller
    from toolpath_stiff.nc.tables import read_offsets, read_tool_table

    unknown = Controller(dialect_named(said["dialect"] or "generic"))
    found = read_controller(said["controller"], said["dialect"]) if said["controller"] else unknown
    if said["offsets"]:
        found = replace(found, offsets=read_offsets(said["offsets"]))
    if said["tools"]:
        found = replace(found, tools=read_tool_table(said["tools"]))
    if said["feed"]:
        found = replace(found, feed=said["feed"])
    if said["subprograms"]:
        if not Path(said["subprograms"]).is_dir():
            raise InputError(f"{said['subprograms']!r} is no folder", expected="the folder of subprograms")
        found = replace(found, subprograms=said["subprograms"])
    switches = block_delete if isinstance(block_delete, bool) else frozenset(block_delete)
    interpreter = said["interpreter"] or "builtin"
    by = {name: said[name] for name in ("rs274", "unconfined")}
    return found, {"block_delete": switches, "interpreter": interpreter, **by}


def program_from(program: Program | str | Path) -> Program:
    """A program; of a file, as `Program.read` reads it without options."""
    return program if isinstance(program, Program) else Program.read(program)
