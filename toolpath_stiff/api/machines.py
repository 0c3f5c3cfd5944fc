"""Machines with the effects that act on them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from toolpath_stiff.analysis.evaluation import joint_columns
from toolpath_stiff.analysis.machine_check import MachineCheck, check_machine
from toolpath_stiff.api.inputs import pose_si
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.files import write_atomically
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.file import load_machine, packaged_machines
from toolpath_stiff.machine.kinematics import Struts
from toolpath_stiff.machine.limits import Reach, reach_along, stand
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.nc.program import Program
from toolpath_stiff.options import Option, checked
from toolpath_stiff.poses import pose_in_mm, pose_in_si
from toolpath_stiff.results import DataFrame, Figure, Result, frame_of
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness.contract import Conditions
from toolpath_stiff.stiffness.model import NO_SETUP, StiffnessModel, build_model, check_setup
from toolpath_stiff.stiffness.trial import failures, own_effects, refuse_failing
from toolpath_stiff.units import mm_from_m

FIGURE_2_MM_DEG = (-300.0, 300.0, 300.0, -30.0, 0.0, 0.0)  # the pose of the paper's Figure 2


@dataclass(frozen=True)
class Machine(Result):
    """A machine with the physical effects that act on it, and the conditions that it runs under.

    `Machine.load` makes one from a packaged machine or a machine file.

    Attributes
    ----------
    model
        The machine and its effects as the stiffness is computed from them; SI.
    asked
        The name or file that it was loaded by.
    effect_files
        Python files with your own effects.
    setup, temperature_C
        As `load` was told; None: as the controller file or the machine file says.
    allow_unchecked_effects
        As `load` was told.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> machine = tps.Machine.load("nist")
    >>> machine
    <Machine nist: 6 struts, no effects>
    >>> machine.name, machine.effects, machine.inputs
    ('nist', [], ('nist',))
    >>> machine.origin_mm_deg
    (0.0, 0.0, 800.0, 0.0, 0.0, 0.0)
    >>> machine.carrying(machine.stated)
    <Machine nist: 6 struts, no effects>
    """

    command: ClassVar[str] = "machine"
    shown_by: ClassVar[str] = "machine"

    model: StiffnessModel
    asked: str
    effect_files: tuple[str, ...] = ()
    setup: str | None = None
    temperature_C: float | None = None  # noqa: N815  (degrees Celsius)
    allow_unchecked_effects: bool = False

    @classmethod
    @checked
    def load(
        cls,
        machine: Annotated[str | Path, Option("--machine", "NAME|FILE")] = "nist",
        *,
        effects: Annotated[Iterable[str | Path], Option("--effects", "FILE.py", count="append")] = (),
        allow_unchecked_effects: Annotated[bool, Option("--allow-unchecked-effects")] = False,
        setup: str | None = None,
        temperature_C: float | None = None,
    ) -> Machine:
        """Load a packaged machine by name, or a machine file.

        Parameters
        ----------
        machine
            Name or file.
        effects
            File with your own physical effects, which the machine file may use.
        setup
            The set-up on the machine, for effects that belong to a set-up; "none": one without a name.
        temperature_C
            Degrees Celsius, for effects that need it.
        allow_unchecked_effects
            Use your own effects even if they fail `tps effects check`; every result says so.

        Raises
        ------
        InputError
            There is no such machine, the file is wrong, an effect is unknown or fails, or no effect knows the set-up.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Machine.load("nist", temperature_C=22)
        <Machine nist: 6 struts, no effects>
        """
        files = tuple(map(str, effects))
        model = _checked_model(str(machine), files, allow_unchecked_effects)
        loaded = cls(model, str(machine), files, allow_unchecked_effects=allow_unchecked_effects)
        loaded = loaded.under(setup, temperature_C)
        loaded.running()
        return loaded

    @checked
    def under(
        self,
        setup: Annotated[str | None, Option("--setup", "NAME", read=str.strip)] = None,
        temperature_C: Annotated[float | None, Option("--temperature", "C", at_least=-50, at_most=200)] = None,
    ) -> Machine:
        """The same machine under a set-up and a temperature.

        That an effect knows the set-up is checked later: of two machines compared, one must have such an effect.

        Parameters
        ----------
        setup
            Set-up on the machine, for effects that belong to a set-up; none: one without a name. Unless given, that of
            the controller file, otherwise of the machine file.
        temperature_C
            Degrees Celsius, for effects that need it; unless given, the machine file's.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> machine.under(temperature_C=22).running().conditions.temperature
        22
        """
        return replace(self, setup=setup, temperature_C=temperature_C)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickling for another process: effects of one's own travel as files, as their classes cannot."""
        files = tuple(str(Path(file).absolute()) for file in self.effect_files)
        given = (self.asked, files, self.setup, self.temperature_C, self.allow_unchecked_effects)
        return _machine_again, (self.stated, self.model.conditions, self.model.unchecked, given)

    @staticmethod
    def names() -> list[str]:
        """The packaged machines.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Machine.names()
        ['genhexkins', 'nategh_agheli', 'nist']
        """
        return list(packaged_machines())

    def __repr__(self) -> str:
        return f"<Machine {self.name}: {self._short()}>"

    def _short(self) -> str:
        machine, effects = self.model.machine, ", ".join(self.effects) or "no effects"
        struts = isinstance(machine, Hexapod)
        return f"{'6 struts' if struts else f'{machine.kind}, {len(machine.joint_names)} joints'}, {effects}"

    def __str__(self) -> str:
        return self.text()

    @property
    def name(self) -> str:
        """Short name of the machine."""
        return self.model.machine.name

    @property
    def stated(self) -> MachineTool:
        """The machine as its file has it."""
        return self.model.given or self.model.machine

    def carrying(self, stated: MachineTool) -> Machine:
        """The same machine with its file's content replaced."""
        model = build_model(stated, self.effect_files, conditions=self.model.conditions)
        return replace(self, model=replace(model, unchecked=self.model.unchecked))

    @property
    def effects(self) -> list[str]:
        """Names of the machine's effects, those that act on readings included."""
        return [active.effect.name for active in (*self.model.effects, *self.model.instruments)]

    @property
    def origin_mm_deg(self) -> tuple[float, ...]:
        """Default position of program zero: X, Y, Z, A, B, C in machine coordinates."""
        return pose_in_mm(self.model.machine.default_origin)

    def running(self, program: Program | None = None, beside: Sequence[Machine] = ()) -> StiffnessModel:
        """The model under its conditions: those given to `load`, else a program's controller file's, else its own.

        `beside`: further machines under the same conditions. Raises `InputError` for a set-up that none of them knows.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> machine.running().machine.name, machine.running().conditions.setup
        ('nist', None)
        """
        model, setup, said_by = self.model, self.setup, f"--setup {self.setup}"
        if setup is None and program is not None:
            setup, said_by = program.request.controller.setup, str(program.given.get("controller"))
        check_setup(model.conditions.setup or "", f"machine {self.name}, [setup] name", model)
        check_setup(setup or "", said_by, model, *(other.model for other in beside))
        chosen = "" if setup == NO_SETUP else setup
        temperature = model.conditions.temperature if self.temperature_C is None else self.temperature_C
        return replace(model, conditions=Conditions(model.conditions.setup if chosen is None else chosen, temperature))

    def like(self, machine: str | Path) -> Machine:
        """Another machine with the same effect files, set-up and temperature.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> machine.like("genhexkins").name
        'genhexkins'
        """
        model = _checked_model(str(machine), self.effect_files, self.allow_unchecked_effects)
        return replace(self, model=model, asked=str(machine))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Files from which the machine was read."""
        return (self.asked, *self.effect_files)

    def joint_values(self, pose_mm_deg: Sequence[float]) -> dict[str, float]:
        """Values of the joints at a pose, mm or degrees, by their columns in results; nan where none lead there.

        `pose_mm_deg` is X, Y, Z or X, Y, Z, A, B, C of the tool tip; the reference tool is in the spindle.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> lengths = tps.Machine.load("nist").joint_values((100, 0, 800, 0, 10, 0))
        >>> {name: round(length, 1) for name, length in lengths.items()}["strut1_mm"]
        2874.1
        """
        columns = joint_columns(self.model.machine, self.standing(pose_mm_deg)[1].joints)
        return {name: float(values[0]) for name, values in columns.items()}

    def to_frame(self) -> DataFrame:
        """The machine's figures: quantity, value, unit, origin (published, recovered, assumed, fitted), remark.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> machine.to_frame()[["quantity", "unit", "origin"]].values.tolist()[-1]
        ['rapid feed', 'mm/min', 'assumed']
        """
        return frame_of(self.to_dict()["figures"])

    def plot(self, pose_mm_deg: Sequence[float] | None = None) -> Figure:
        """The machine at a pose, from three sides.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> type(machine.plot((0, 0, 800))).__name__
        'Figure'
        """
        return self._figure(machine=self.model.machine, pose=self.standing(pose_mm_deg)[0])

    def standing(self, pose_mm_deg: Sequence[float] | None = None) -> tuple[FloatArray, Struts | Stance, Reach]:
        """A pose (6,) in SI (unless given, the paper's Figure 2 or the default origin), joints and reach there.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> pose, struts, reach = machine.standing((0, 0, 800))
        >>> pose.tolist(), struts.lengths.shape, bool(reach.reachable[0])
        ([0.0, 0.0, 0.8, 0.0, 0.0, 0.0], (1, 6), True)
        """
        machine = self.model.machine
        if pose_mm_deg is None:
            return stand(machine, pose_in_si(FIGURE_2_MM_DEG) if self.name == "nist" else machine.default_origin)
        return stand(machine, pose_si("pose", pose_mm_deg))

    def reach_mm(self, from_mm_deg: Sequence[float], directions: Sequence[Sequence[float]]) -> FloatArray:
        """(n,) how far the tool tip can go from a pose along directions (n, 3), unturned, before the first limit.

        0 where the pose itself is out of reach.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Machine.load("nist").reach_mm((0, 0, 800), [(1, 0, 0), (0, 0, -1)]).round().tolist()
        [750.0, 946.0]
        """
        pose, rays = np.array(pose_si("pose", from_mm_deg)), np.asarray(directions, dtype=float)
        rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return mm_from_m(reach_along(self.model.machine, pose[:3], rays, rotation_matrices(pose[3:])))

    def picture(self, pose_mm_deg: Sequence[float] | None = None) -> bytes:
        """The drawing of `plot`, as a PNG."""
        return self._picture(machine=self.model.machine, pose=self.standing(pose_mm_deg)[0])

    def page(self, pose_mm_deg: Sequence[float] | None = None) -> str:
        """The machine at a pose as an interactive page, with its reach and its figures.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.Machine.load("nist").page((0, 0, 800))[:15]
        '<!DOCTYPE html>'
        """
        pose, _, stand = self.standing(pose_mm_deg)
        return str(self.view.page(self.model.machine, pose, stand))

    def text(self, pose_mm_deg: Sequence[float] | None = None) -> str:
        """The machine's figures with their origin, and the distances from its limits at a pose.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> print(machine.text().splitlines()[0])
        NIST Ingersoll Octahedral Hexapod
        """
        return str(self.view.text(self.model.machine, self.standing(pose_mm_deg)[2]))

    def to_dict(self) -> dict[str, object]:
        """Name, title, source, effects, and its figures as `to_frame` has them, each with its unit and origin.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> found = tps.Machine.load("nist").to_dict()
        >>> found["name"], found["effects"], found["figures"][-1]["unit"]
        ('nist', [], 'mm/min')
        """
        return {
            "name": self.name,
            "title": self.model.machine.title,
            "source": self.model.machine.source,
            "effects": self.effects,
            "figures": [figure._asdict() for figure in self.view.machine_figures(self.model.machine)],
        }

    def check(self) -> MachineCheck:
        """Look for slips in the figures: units, signs, mirrored joints; what its effects lack.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist")
        >>> machine.check()
        <MachineCheck: nist, 0 wrong, 0 doubtful>
        """
        return check_machine(self.running(), self.asked)

    def save(self, file: str | Path) -> Path:
        """Write the machine file, effects included, completely or not at all.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     file = tps.Machine.load("nist").save(pathlib.Path(folder, "copy.toml"))
        ...     tps.Machine.load(file).name
        'nist'
        """
        stated = self.stated
        return write_atomically(file, machine_toml(stated) if isinstance(stated, Hexapod) else stated.text)


def _machine_again(
    stated: MachineTool, conditions: Conditions, unchecked: tuple[str, ...], given: tuple[Any, ...]
) -> Machine:
    """A machine rebuilt in another process."""
    return Machine(replace(build_model(stated, given[1], conditions=conditions), unchecked=unchecked), *given)


def _checked_model(machine: str, files: tuple[str, ...], allow_unchecked_effects: bool) -> StiffnessModel:
    """The model of a machine; raises `InputError` for effects that fail, unless they are allowed."""
    given = load_machine(machine)
    model = build_model(given, files)
    effects = own_effects(model, files)
    if not allow_unchecked_effects:
        refuse_failing(effects, given, machine)
    return replace(model, unchecked=tuple(failures(effects, given)))


def machine_from(machine: Machine | str | Path) -> Machine:
    """A machine, loaded if it is a name or a file."""
    return machine if isinstance(machine, Machine) else Machine.load(machine)
