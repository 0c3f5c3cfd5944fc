"""What goes in: a machine, a program; lengths in mm, angles in degrees, forces in N, as their names say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import options
from toolpath_stiff.units import Pose, mm_from_m, pose_in_mm, pose_in_si

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from toolpath_stiff.api.machines import MachineCheck
    from toolpath_stiff.machine import Machine as MachineData
    from toolpath_stiff.machine import Reach, Struts
    from toolpath_stiff.nc.controller import Controller
    from toolpath_stiff.nc.moves import Program as ReadProgram
    from toolpath_stiff.stiffness.effects.contract import Conditions
    from toolpath_stiff.stiffness.model import StiffnessModel

    FloatArray = NDArray[np.float64]

FARTHEST_MM = 1e5  # 100 m: no machine is larger; more is a slip of unit or key
FARTHEST_DEG = 360.0
STRONGEST_N = 1e6
LONGEST_STEP_MM = 1000.0
TEMPERATURES_C = (-50.0, 200.0)
FIGURE_2_MM_DEG = (-300.0, 300.0, 300.0, -30.0, 0.0, 0.0)  # the pose of the paper's Figure 2


def positive(name: str, value: float, unit: str, highest: float) -> float:
    """A number above 0 and up to `highest`. Raises `InputError`."""
    if not 0.0 < value <= highest:
        raise InputError(f"{name} {value:g} {unit}", expected=f"more than 0 and at most {highest:g} {unit}")
    return float(value)


def whole(name: str, value: int, lowest: int, highest: int | None = None) -> int:
    """A whole number within bounds. Raises `InputError`."""
    if value < lowest or (highest is not None and value > highest):
        raise InputError(
            f"{name} {value}", expected=f"{lowest} or more" if highest is None else f"{lowest} to {highest}"
        )
    return value


def pose_si(name: str, pose: Sequence[float]) -> Pose:
    """X, Y, Z or X, Y, Z, A, B, C in mm and degrees, in SI. Raises `InputError`."""
    values = [float(value) for value in pose]
    if len(values) not in (3, 6):
        raise InputError(f"{name} of {len(values)} numbers", expected="X, Y, Z or X, Y, Z, A, B, C in mm and degrees")
    x, y, z, a, b, c = (*values, 0.0, 0.0, 0.0)[:6]
    near = max(abs(x), abs(y), abs(z)) <= FARTHEST_MM and max(abs(a), abs(b), abs(c)) <= FARTHEST_DEG
    if not near:  # nan is not near either
        raise InputError(
            f"{name} {values}",
            expected=f"positions within +-{FARTHEST_MM:g} mm and angles within +-{FARTHEST_DEG:g} degrees",
        )
    return pose_in_si((x, y, z, a, b, c))


def origin_word(origin: Pose) -> str:
    """A placement in SI as --origin takes it; angles that are all 0 go without saying."""
    words = [f"{value:.10g}" for value in pose_in_mm(origin)]
    return ",".join(words if any(origin[3:]) else words[:3])


@dataclass(frozen=True)
class Machine:
    """A machine with the physical effects that act on it, and what it runs under.

    `Machine.load` makes one from a packaged machine or a machine file.

    Attributes
    ----------
    model
        The machine and its effects as the stiffness is computed from them; SI.
    asked
        The name or file that it was loaded by.
    effect_files
        Python files with effects of one's own.
    setup, temperature_C
        As `load` was told; None: as the controller file or the machine file says.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> machine = tps.Machine.load("nist")
    >>> machine
    <Machine nist: 6 struts, no effects>
    >>> machine.strut_lengths_mm((0, 0, 800)).round(1).tolist()
    [2884.7, 2869.9, 2884.7, 2869.9, 2884.7, 2869.9]
    """

    model: StiffnessModel
    asked: str
    effect_files: tuple[str, ...] = ()
    setup: str | None = None
    temperature_C: float | None = None  # noqa: N815  (degrees Celsius)

    @classmethod
    def load(
        cls,
        machine: str | Path = "nist",
        *,
        effects: Iterable[str | Path] = (),
        setup: str | None = None,
        temperature_C: float | None = None,
    ) -> Machine:
        """Load a packaged machine by name, or a machine file.

        Parameters
        ----------
        machine
            Name (`Machine.names()` lists them) or TOML file.
        effects
            Python files with physical effects of one's own, which the machine file may name.
        setup
            The set-up that is on the machine, for effects that belong to one; "none": none that has a name.
        temperature_C
            Degrees Celsius, for effects that need it.

        Raises
        ------
        InputError
            There is no such machine, the file is wrong, an effect is unknown, or no effect knows the set-up.
        """
        from toolpath_stiff.machine import load_machine
        from toolpath_stiff.stiffness.model import build_model

        files = tuple(map(str, effects))
        model = build_model(load_machine(machine), files)
        found = cls(model, str(machine), files).under(setup, temperature_C)
        found.running()
        return found

    def under(self, setup: str | None = None, temperature_C: float | None = None) -> Machine:
        """The same machine under a set-up and a temperature, as of `load`; None: as the files say.

        Whether an effect knows the set-up is checked where it matters: beside a second machine one of them has to.
        """
        low, high = TEMPERATURES_C
        if temperature_C is not None and not low <= temperature_C <= high:
            raise InputError(f"{temperature_C:g} degrees C", expected=f"{low:g} to {high:g}")
        return replace(self, setup=setup, temperature_C=temperature_C)

    def __reduce__(self) -> tuple[Any, ...]:
        """For another process: effects of one's own travel as their files, a class of such a file cannot."""
        files = tuple(str(Path(file).absolute()) for file in self.effect_files)
        built_from = (self.model.given or self.model.machine, files, self.model.conditions)
        return _machine_again, (*built_from, self.asked, self.setup, self.temperature_C)

    @staticmethod
    def names() -> list[str]:
        """The packaged machines.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Machine.names()
        ['genhexkins', 'nategh_agheli', 'nist']
        """
        from toolpath_stiff.machine import packaged_machines

        return list(packaged_machines())

    def __repr__(self) -> str:
        acting = ", ".join(self.effects) or "no effects"
        return f"<Machine {self.name}: 6 struts, {acting}>"

    @property
    def name(self) -> str:
        """Its short name."""
        return self.model.machine.name

    @property
    def title(self) -> str:
        """Its name for headings."""
        return self.model.machine.title

    @property
    def source(self) -> str:
        """Where its figures come from."""
        return self.model.machine.source

    @property
    def effects(self) -> list[str]:
        """Names of the effects that it carries, those that act on readings too."""
        return [active.effect.name for active in (*self.model.effects, *self.model.instruments)]

    @property
    def setups(self) -> list[str]:
        """The set-ups that its file lists and its effects name."""
        from toolpath_stiff.stiffness.model import known_setups

        return known_setups([self.model])

    @property
    def origin_mm_deg(self) -> tuple[float, ...]:
        """Where program zero sits unless a program or an argument says: X, Y, Z, A, B, C in machine coordinates."""
        return pose_in_mm(self.model.machine.default_origin)

    def running(self, program: Program | None = None, beside: Sequence[Machine] = ()) -> StiffnessModel:
        """The model under what it runs under: what `load` was told, then a program's controller file, then its own.

        `beside` are machines that the same is said of. Raises `InputError` for a set-up that none of them knows.
        """
        from toolpath_stiff.stiffness.effects.contract import Conditions
        from toolpath_stiff.stiffness.model import NO_SETUP, check_setup

        model, setup, said_by = self.model, self.setup, f"--setup {self.setup}"
        if setup is None and program is not None:
            setup, said_by = program.controller.setup, str(program.said.get("controller"))
        check_setup(model.conditions.setup or "", f"machine {self.name}, [setup] name", model)
        check_setup(setup or "", said_by, model, *(other.model for other in beside))
        asked = "" if setup == NO_SETUP else setup
        conditions = Conditions(
            model.conditions.setup if asked is None else asked,
            model.conditions.temperature if self.temperature_C is None else self.temperature_C,
        )
        return replace(model, conditions=conditions)

    def like(self, machine: str | Path) -> Machine:
        """Another machine with the same effect files, set-up and temperature."""
        from toolpath_stiff.machine import load_machine
        from toolpath_stiff.stiffness.model import build_model

        model = build_model(load_machine(str(machine)), self.effect_files)
        return replace(self, model=model, asked=str(machine))

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files that it was read from."""
        return (self.asked, *self.effect_files)

    def strut_lengths_mm(self, pose_mm_deg: Sequence[float]) -> FloatArray:
        """(6,) lengths of the struts between their joint centres at a pose (inverse kinematics).

        `pose_mm_deg` is X, Y, Z or X, Y, Z, A, B, C of the tool tip; the reference tool is in the spindle.
        """
        return mm_from_m(self.standing(pose_mm_deg)[1].lengths[0])

    def to_frame(self) -> pd.DataFrame:
        """Its figures: quantity, value, unit, origin (published, recovered, assumed, fitted), remark."""
        import pandas as pd

        from toolpath_stiff.report.machine import figure_entries

        return pd.DataFrame(figure_entries(self.model.machine))

    def plot(self, pose_mm_deg: Sequence[float] | None = None) -> Figure:
        """The machine at a pose, from three sides."""
        from toolpath_stiff.report.machine import machine_picture

        return machine_picture.figure(self.model.machine, *self.standing(pose_mm_deg)[:2])

    def standing(self, pose_mm_deg: Sequence[float] | None = None) -> tuple[FloatArray, Struts, Reach]:
        """A pose (6,) in SI (unless given, the paper's Figure 2 or the default origin), struts and reach there."""
        import numpy as np

        from toolpath_stiff.machine import reach, solve_struts
        from toolpath_stiff.rotations import rotation_matrices

        machine = self.model.machine
        given = self._shown_pose() if pose_mm_deg is None else pose_si("pose", pose_mm_deg)
        pose = np.array(given)
        turn = rotation_matrices(pose[3:])
        struts = solve_struts(machine, pose[:3], turn)
        return pose, struts, reach(machine, pose[:3], struts, turn[None])

    def _shown_pose(self) -> Pose:
        return pose_in_si(FIGURE_2_MM_DEG) if self.name == "nist" else self.model.machine.default_origin

    def picture(self, pose_mm_deg: Sequence[float] | None = None) -> bytes:
        """What `plot` draws as a PNG."""
        from toolpath_stiff.report.machine import machine_picture

        return machine_picture(self.model.machine, *self.standing(pose_mm_deg)[:2])

    def text(self, pose_mm_deg: Sequence[float] | None = None) -> str:
        """Its figures with their origin, and how far the limits are at a pose."""
        from toolpath_stiff.report.machine import text

        return text(self.model.machine, self.standing(pose_mm_deg)[2])

    def __str__(self) -> str:
        return self.text()

    def check(self) -> MachineCheck:
        """Look for slips in the figures: units, signs, mirrored joints; what its effects lack."""
        from toolpath_stiff.api.machines import check_machine

        return check_machine(self)

    def save(self, file: str | Path) -> Path:
        """Write the machine file, effects included, whole or not at all."""
        from toolpath_stiff.files import write_atomically
        from toolpath_stiff.machine import machine_toml

        return write_atomically(Path(file), machine_toml(self.model.given or self.model.machine))


def _machine_again(
    given: MachineData,
    files: tuple[str, ...],
    conditions: Conditions,
    asked: str,
    setup: str | None,
    temperature_C: float | None,
) -> Machine:
    """A machine in another process."""
    from toolpath_stiff.stiffness.model import build_model

    return Machine(build_model(given, files, conditions=conditions), asked, files, setup, temperature_C)


def machine_from(machine: Machine | str | Path) -> Machine:
    """A machine, loaded if it is a name or a file."""
    return machine if isinstance(machine, Machine) else Machine.load(machine)


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
    """

    name: str
    file: str | None
    controller: Controller = field(repr=False)
    options: dict[str, Any] = field(repr=False)
    text: str | None = field(default=None, repr=False)
    said: dict[str, Any] = field(default_factory=dict, repr=False)
    _last: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def read(
        cls,
        file: str | Path,
        *,
        dialect: str | None = None,
        controller: str | Path | None = None,
        offsets: str | Path | None = None,
        tools: str | Path | None = None,
        block_delete: bool | Iterable[int] = False,
        interpreter: str = "builtin",
        rs274: str | None = None,
    ) -> Program:
        """A program in a file.

        Parameters
        ----------
        file
            NC program or cutter-location file.
        dialect
            "generic", "linuxcnc", "fanuc" or "haas": how the control reads what others read otherwise; unless given, as
            the controller file says, else generic.
        controller
            File of what belongs to the control: dialect, block delete, offsets, tools, kinematics.
        offsets, tools
            Work offsets G54 to G59.3; tool table. They win over the controller file's.
        block_delete
            Leave out blocks that begin with a slash: True, all of them; or the switches that are on, 1 to 9.
        interpreter
            "builtin"; "linuxcnc", LinuxCNC's rs274; "auto", the second where the first refuses.
        rs274
            LinuxCNC's interpreter, if it is not on PATH.

        Raises
        ------
        InputError
            A file cannot be read, or says what cannot be.
        """
        from toolpath_stiff.nc.words import read_lines

        if not Path(file).is_file():
            read_lines(file)  # says what is wrong with it
        said = _said(dialect, controller, offsets, tools, block_delete, interpreter, rs274)
        return cls(Path(file).name, str(file), *_control(said, block_delete), said=said)

    @classmethod
    def from_text(
        cls,
        text: str,
        name: str = "program",
        *,
        dialect: str | None = None,
        controller: str | Path | None = None,
        offsets: str | Path | None = None,
        tools: str | Path | None = None,
        block_delete: bool | Iterable[int] = False,
        interpreter: str = "builtin",
        rs274: str | None = None,
    ) -> Program:
        """A program given as text; arguments as of `read`."""
        said = _said(dialect, controller, offsets, tools, block_delete, interpreter, rs274)
        return cls(name, None, *_control(said, block_delete), text, said)

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
        """The program read for a zero, SI: as asked for, and unless anyone says; the last one is kept.

        Raises `InputError` with file, line and column for what cannot be read.
        """
        from toolpath_stiff.nc import parse_program, read_program

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
        """The moves, one a row: line, motion, tool, start and end in program coordinates of G54, feed."""
        import pandas as pd

        from toolpath_stiff.nc.moves import move_columns

        return pd.DataFrame(move_columns(self.moves().moves))


def _said(
    dialect: str | None,
    controller: str | Path | None,
    offsets: str | Path | None,
    tools: str | Path | None,
    block_delete: bool | Iterable[int],
    interpreter: str,
    rs274: str | None,
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
    switches = block_delete if isinstance(block_delete, bool) else frozenset(block_delete)
    interpreter = said["interpreter"] or "builtin"
    return found, {"block_delete": switches, "interpreter": interpreter, "rs274": said["rs274"]}


def program_from(program: Program | str | Path) -> Program:
    """A program; of a file, as `Program.read` reads it without options."""
    return program if isinstance(program, Program) else Program.read(program)
