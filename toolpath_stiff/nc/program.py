"""An NC program or a cutter-location file, and the options for reading it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Self, TypedDict, Unpack

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file
from toolpath_stiff.hints import options
from toolpath_stiff.nc.controller import ALL_SWITCHES, Controller, dialect_named, read_controller
from toolpath_stiff.nc.lines import read_lines, split_lines
from toolpath_stiff.nc.moves import ReadProgram, move_columns
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.tables import read_offsets, read_tool_table
from toolpath_stiff.options import Option, arguments_of, checked, switches
from toolpath_stiff.poses import Pose
from toolpath_stiff.results import DataFrame, frame_of

File = str | Path


class Reading(TypedDict, total=False):
    """Options of reading: the arguments of `Program.read`."""

    dialect: Annotated[
        str | None, Option("--dialect", choices=("generic", "linuxcnc", "fanuc", "haas", "heidenhain", "siemens"))
    ]
    controller: Annotated[File | None, Option("--controller", "FILE")]
    offsets: Annotated[File | None, Option("--offsets", "FILE")]
    tools: Annotated[File | None, Option("--tools", "FILE")]
    block_delete: Annotated[bool | Iterable[int], Option("--block-delete", "N,N", read=switches)]
    interpreter: Annotated[str, Option("--interpreter", choices=("builtin", "linuxcnc", "auto"))]
    rs274: Annotated[str | None, Option("--rs274", "PATH")]
    feed_mm_per_min: Annotated[float | None, Option("--feed", "mm/min", above=0, at_most=1e6)]
    subprograms: Annotated[File | None, Option("--subprograms", "FOLDER")]
    unconfined: Annotated[bool, Option("--unconfined")]


@dataclass(frozen=True)
class Program:
    r"""An NC program or a cutter-location file, and the options for reading it.

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
    >>> program.lines[1], program.inputs
    ('G0 X0 Y0 Z5', ())
    """

    name: str
    file: str | None
    request: Request  # without lines and without a zero yet
    text: str | None = None
    given: Mapping[str, object] = field(default_factory=dict)
    _last: list[tuple[object, ReadProgram]] = field(default_factory=list, compare=False)

    @classmethod
    @checked
    def read(cls, file: File, **reading: Unpack[Reading]) -> Self:
        r"""A program in a file.

        Parameters
        ----------
        file
            NC program or cutter-location file.
        dialect
            The control, where controls differ: X10 without a decimal point, the time of G4 P, G70 and G71, `;`. Unless
            given, that of the controller file, otherwise generic. Heidenhain's and Siemens' languages are recognised in
            any case.
        controller
            Settings of the control (TOML: dialect, block_delete, offsets, tools, the kinematics that the program was
            posted for; or LinuxCNC's .var or .tbl).
        offsets
            Work offsets G54 to G59.3, instead of the controller file's.
        tools
            Tool table, instead of the controller file's: LinuxCNC .tbl, or CSV tool,length_mm,diameter_mm.
        block_delete
            Leave out blocks that begin with a slash, or those of the switches that are on, 1 to 9 (/ is /1).
        interpreter
            What reads the program: builtin, the default; LinuxCNC's rs274; auto: rs274 where the built-in reader
            refuses.
        rs274
            LinuxCNC's interpreter, if it is not on PATH.
        feed_mm_per_min
            Feed of cuts before the program's first F (a cutter-location file's first FEDRAT), mm/min.
        subprograms
            Folder of the files that the program calls (`o<name> call`, `M98 P1234`); without it none is opened.
        unconfined
            Run rs274 even if bubblewrap, which keeps it from all other files, cannot be used.

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
        if not is_file(file):
            read_lines(file)  # raises the error that names the problem
        return cls._of(Path(file).name, str(file), None, reading)

    @classmethod
    def from_text(cls, text: str, name: str = "program", **reading: Unpack[Reading]) -> Self:
        r"""A program given as text; further arguments as of `read`.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Program.from_text("G1 X40 F300\nM2", name="slot.nc", dialect="linuxcnc")
        <Program slot.nc: 2 lines>
        """
        return cls._of(name, None, text, reading)

    @classmethod
    def _of(cls, name: str, file: str | None, text: str | None, reading: Reading) -> Self:
        """A program with its reading options resolved, tables included."""
        arguments = arguments_of(cls.read)
        if unknown := reading.keys() - arguments.keys():
            raise TypeError(f"Program.read does not know {', '.join(unknown)}")
        given: dict[str, object] = {}
        for option in arguments:
            value = reading.get(option)
            if value and value != "builtin":
                arguments[option].check(value)
                given[option.removesuffix("_mm_per_min")] = value
        switches, on = frozenset[int](), reading.get("block_delete") or False
        if isinstance(on, bool):
            switches = ALL_SWITCHES if on else switches
        else:
            switches = frozenset(on)
            given["block_delete"] = ",".join(map(str, sorted(switches)))
            if not switches <= ALL_SWITCHES:
                raise InputError(f"block_delete {sorted(switches)}", expected="switches 1 to 9, True or False")
        file_of_controller, dialect = reading.get("controller"), reading.get("dialect")
        controller = Controller(dialect_named(dialect or "generic"))
        if file_of_controller:
            controller = read_controller(file_of_controller, dialect)
        if switches:
            controller = replace(controller, switches=switches)
        if offsets := reading.get("offsets"):
            controller = replace(controller, offsets=read_offsets(offsets))
        if tools := reading.get("tools"):
            controller = replace(controller, tools=read_tool_table(tools))
        if feed := reading.get("feed_mm_per_min"):
            controller = replace(controller, feed=feed)
        if folder := reading.get("subprograms"):
            if not Path(folder).is_dir():
                raise InputError(f"{str(folder)!r} is no folder", expected="the folder of subprograms")
            controller = replace(controller, subprograms=str(folder))
        request = Request(
            (),
            name,
            file or "",
            controller=controller,
            interpreter=reading.get("interpreter") or "builtin",
            rs274=reading.get("rs274"),
            unconfined=bool(reading.get("unconfined")),
        )
        return cls(name, file, request, text, given)

    def __repr__(self) -> str:
        count = "" if self.text is None else f": {len(self.text.splitlines())} lines"
        return f"<Program {self.name}{count}>"

    @property
    def lines(self) -> tuple[str, ...]:
        """The program's lines as they stand, without line ends."""
        return read_lines(self.file) if self.file is not None else split_lines(self.text or "", self.name)

    @property
    def words(self) -> list[str]:
        """Command-line options that state how the program is read."""
        return options(**self.given)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Files from which the program is read."""
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
        from toolpath_stiff.nc.reader import read  # imports the tables of codes, so only when a program is read

        key = (origin, tuple(default_origin))
        if not self._last or self._last[0][0] != key:
            self._last[:] = [(key, read(self.placed(origin, default_origin)))]
        return self._last[0][1]

    def placed(self, origin: Pose | None, default_origin: Pose) -> Request:
        r"""The reader's request for a zero, SI.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Program.from_text("G21 G90\nG1 X40 F300\nM2", name="slot.nc").placed(None, (0.0,) * 6).name
        'slot.nc'
        """
        request = replace(self.request, lines=self.lines, name=self.name, path=self.file or "")
        return replace(request, origin=origin, default_origin=default_origin)

    def to_frame(self) -> DataFrame:
        r"""The moves, one a row: line, motion, tool, start and end in program coordinates of G54, feed.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
        >>> slot.to_frame()[["line", "motion"]].values.tolist()
        [[2, 'rapid'], [3, 'feed'], [4, 'feed']]
        """
        return frame_of(move_columns(self.moves().moves))


def program_from(program: Program | str | Path) -> Program:
    """The program given, or that of a file, read with default options."""
    return program if isinstance(program, Program) else Program.read(program)
