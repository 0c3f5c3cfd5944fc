"""An NC program or a cutter-location file, and how it is to be read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file
from toolpath_stiff.hints import options
from toolpath_stiff.nc.words import read_lines, split_lines
from toolpath_stiff.options import Option, arguments_of, checked, switches
from toolpath_stiff.units import Pose

if TYPE_CHECKING:
    import pandas as pd

    from toolpath_stiff.nc.controller import Controller
    from toolpath_stiff.nc.moves import ReadProgram


class Reading(TypedDict, total=False):
    """Options of reading: the arguments of `Program.read`."""

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
    given: dict[str, Any] = field(default_factory=dict, repr=False)
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
        reading = {name: value for name, value in locals().items() if name not in ("cls", "file")}
        if not is_file(file):
            read_lines(file)  # says what is wrong with it
        return cls._of(Path(file).name, str(file), None, reading)

    @classmethod
    def from_text(cls, text: str, name: str = "program", **reading: Unpack[Reading]) -> Program:
        r"""A program given as text; further arguments as of `read`.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Program.from_text("G1 X40 F300\nM2", name="slot.nc", dialect="linuxcnc")
        <Program slot.nc: 2 lines>
        """
        arguments = arguments_of(cls.read)
        if not arguments.keys() >= reading.keys():
            raise TypeError(f"Program.from_text does not know {', '.join(reading.keys() - arguments.keys())}")
        if reading.get("feed_mm_per_min") is not None:
            arguments["feed_mm_per_min"].check(reading["feed_mm_per_min"])
        return cls._of(name, None, text, reading)

    @classmethod
    def _of(cls, name: str, file: str | None, text: str | None, reading: Mapping[str, Any]) -> Program:
        """A program whose options of reading are looked up, tables included."""
        from toolpath_stiff.nc.controller import Controller, dialect_named, read_controller
        from toolpath_stiff.nc.tables import read_offsets, read_tool_table

        values = {option: reading.get(option) for option in Reading.__annotations__}
        given = {option.removesuffix("_mm_per_min"): value for option, value in values.items() if value}
        switches = values["block_delete"] or False
        if not isinstance(switches, bool):
            switches = frozenset(switches)
            if not switches <= set(range(1, 10)):
                raise InputError(f"block_delete {sorted(switches)}", expected="switches 1 to 9, True or False")
            given["block_delete"] = ",".join(map(str, sorted(switches)))
        if values["interpreter"] == "builtin":
            del given["interpreter"]
        controller = Controller(dialect_named(values["dialect"] or "generic"))
        if values["controller"]:
            controller = read_controller(values["controller"], values["dialect"])
        tables = dict[str, Any]()
        if values["offsets"]:
            tables["offsets"] = read_offsets(values["offsets"])
        if values["tools"]:
            tables["tools"] = read_tool_table(values["tools"])
        if values["feed_mm_per_min"]:
            tables["feed"] = values["feed_mm_per_min"]
        if values["subprograms"]:
            tables["subprograms"] = str(values["subprograms"])
            if not Path(tables["subprograms"]).is_dir():
                raise InputError(f"{tables['subprograms']!r} is no folder", expected="the folder of subprograms")
        options = {
            "block_delete": switches,
            "interpreter": values["interpreter"] or "builtin",
            "rs274": values["rs274"],
            "unconfined": bool(values["unconfined"]),
        }
        return cls(name, file, replace(controller, **tables), options, text, given)

    def __repr__(self) -> str:
        count = "" if self.text is None else f": {len(self.text.splitlines())} lines"
        return f"<Program {self.name}{count}>"

    @property
    def lines(self) -> tuple[str, ...]:
        """The program's lines as they stand, without line ends."""
        return read_lines(self.file) if self.file is not None else split_lines(self.text or "", self.name)

    @property
    def read_as(self) -> dict[str, Any]:
        """Arguments of the reader of its blocks beside the text: offsets, tools, block delete."""
        control = self.controller
        return {"offsets": control.offsets, "tools": control.tools, "block_delete": self.options["block_delete"]}

    @property
    def words(self) -> list[str]:
        """The options of a command that say how it is read."""
        return options(**self.given)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that it is read from."""
        beside = (self.given.get(name) for name in ("controller", "offsets", "tools"))
        return tuple(str(file) for file in (self.file, *beside) if file)

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
        from toolpath_stiff.nc.reader import read
        from toolpath_stiff.nc.request import Request

        key = (origin, tuple(default_origin))
        if self._last.get("key") != key:
            place = (self.lines, self.name, self.file or "", origin, default_origin)
            self._last.update(key=key, program=read(Request(*place, controller=self.controller, **self.options)))
        last: ReadProgram = self._last["program"]
        return last

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


def program_from(program: Program | str | Path) -> Program:
    """A program; of a file, as `Program.read` reads it without options."""
    return program if isinstance(program, Program) else Program.read(program)
