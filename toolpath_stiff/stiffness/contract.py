"""The contract of a physical effect: a deviation from six linear struts on a rigid platform and frame.

An effect sits on one link of the load path, declares its parameters, and implements what it adds:

- `strut_compliance`: compliance in series with each strut;
- `load_compliance`: a quadratic form in the loads, the six strut forces and the tip wrench. Frame vertices couple
  two struts, platform bars all six, a spindle only the wrench;
- `parallel_stiffness`: a stiffness parallel to the struts. The core then solves instead of using equilibrium alone;
- `geometry`: another machine geometry, of six struts; `stands`: of a machine of elements, how it truly stands;
- `reading`: a change of the measured figure, not of the machine (an instrument).

Everything is SI and batched over n poses. A method that an effect does not implement adds nothing.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np

from toolpath_stiff.arrays import AnyArray, ArrayColumns, BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.errors import EffectError
from toolpath_stiff.machine.elements import LoadRows, Spring, Stance
from toolpath_stiff.machine.kinematics import Struts
from toolpath_stiff.machine.model import Hexapod, MachineTool, as_hexapod
from toolpath_stiff.stiffness.measuring_loop import MeasuringLoop
from toolpath_stiff.stiffness.sizes import about, sizes_in_words
from toolpath_stiff.units import mm_from_m

Values = Mapping[str, Any]  # name of a parameter -> SI value, or its choice: a number, a name
LINKS = ("tool", "platform", "joints", "struts", "frame", "table", "geometry", "instrument")
HOOKS = ("strut_compliance", "load_compliance", "parallel_stiffness", "geometry", "reading", "element_compliance",
         "stands")  # fmt: skip

# Columns of measurements that an effect may wait for -> attribute of `LoadPath`, None where the value is unknown.
CONDITIONS = {"setup": "setup", "temperature_C": "temperature", "time_min": "time", "direction": "direction"}
SETUP = "setup"  # the condition, and the name of every parameter that names a set-up
ELEMENT = "element"  # the name of every parameter that names an element of the machine
EXPERIENCE = "engineering experience, no source"
IDLE = 1e-3  # N in a strut: below it powers of the force would diverge, and the strut adds nothing visible


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes
    ----------
    name
        Physical name, without unit.
    unit
        Unit in files and reports.
    si
        SI value of one `unit`; effects compute in SI.
    bounds
        (low, high) in `unit`: what is physically possible. A value outside is an error.
    typical
        (low, high) in `unit`: what is usual. Ranks, never excludes.
    source
        Where `typical` comes from.
    neutral
        The value (in `unit`) at which the effect vanishes; may be inf.
    meaning
        One line for the user.
    kind
        "real" numbers are fitted. What the effect acts on is chosen, never fitted: an "integer" within `bounds`
        (which strut), a "text" (which set-up).

    Examples
    --------
    >>> compliance = Parameter("compliance", "nm/N", 1e-9, (0.0, 50.0), (1.0, 5.0), "an example")
    >>> compliance.key, compliance.expected, compliance.discrete
    ('compliance_nm_per_N', 'a number from 0 to 50 nm/N', False)
    """

    name: str
    unit: str
    si: float
    bounds: tuple[float, float]
    typical: tuple[float, float]
    source: str
    neutral: float = 0.0
    meaning: str = ""
    kind: Literal["real", "integer", "text"] = "real"

    @property
    def discrete(self) -> bool:
        """True if it names what the effect acts on; fits then compare the choices."""
        return self.kind != "real"

    @property
    def expected(self) -> str:
        """Allowed values, in words."""
        if self.kind == "text":
            return "a name in quotes"
        low, high = self.bounds
        if self.kind == "integer":
            return f"a whole number from {low:g} to {high:g}"
        return f"a number from {low:g} to {high:g} {self.unit}".rstrip()

    @property
    def key(self) -> str:
        """The key in machine files: the name with its unit, such as `bar_stiffness_N_per_m`."""
        unit = self.unit.replace("/", "_per_").replace(" ", "_").replace("%", "percent")
        return f"{self.name}_{unit}" if unit else self.name


def setup_parameter(meaning: str) -> Parameter:
    """Parameter that names the set-up to which an effect belongs."""
    source = "column setup of the measurements"
    return Parameter(SETUP, "", 1.0, (0, 0), (0, 0), source=source, meaning=meaning, kind="text")


def element_parameter(meaning: str) -> Parameter:
    """Parameter that names an element of the machine."""
    return Parameter(ELEMENT, "", 1.0, (0, 0), (0, 0), source="machine file", meaning=meaning, kind="text")


def compliance(name: str, largest: float, typical: tuple[float, float], source: str, meaning: str) -> Parameter:
    """Parameter of a part that gives way along a line, nm/N, from 0 to the largest."""
    return Parameter(name, "nm/N", 1e-9, (0.0, largest), typical, source=source, meaning=meaning)


def rocking(name: str, source: str, meaning: str) -> Parameter:
    """Parameter of a body that turns about horizontal axes under a moment, nrad/(N m)."""
    return Parameter(name, "nrad/N/m", 1e-9, (0.0, 500.0), (0.5, 10.0), source, meaning=meaning)


@dataclass(frozen=True)
class LoadPath(ArrayColumns):
    """State of n poses under load, as an effect sees it. SI, base axes.

    Attributes
    ----------
    machine_tool
        The machine, geometry effects included; `machine` where it has six struts.
    position, rotation
        (n, 3) m, (n, 3, 3): the tool tip and the platform.
    stance
        How the machine stands; `struts` of six struts, their lengths, directions, arms.
    tool_extension
        (n,) m, how much longer the tool is than the machine's reference tool.
    force
        (n,) N, size of the load at the tip.
    strut_forces
        (n, 6) N, forces in the struts under that load, these effects included; None where no direction is given. Only
        effects that depend on the load (`load_dependent`) may ask for it.
    element_loads
        (n, r) N and N m, the loads of all elements one after the other under that load, of a machine of elements; None
        where no direction is given.
    direction
        (n, 3) unit vectors, along which the load acts and the displacement is read; None where no direction is given.
    setup
        (n,) names of the clamping arrangement, or None.
    time, temperature
        (n,) s since the indicator was zeroed, (n,) degrees C; or None.
    """

    machine_tool: MachineTool
    position: FloatArray
    rotation: FloatArray
    stance: Struts | Stance
    tool_extension: FloatArray
    force: FloatArray
    strut_forces: FloatArray | None = None
    element_loads: FloatArray | None = None
    direction: FloatArray | None = None
    setup: TextArray | None = None
    time: FloatArray | None = None
    temperature: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.position)

    def take(self, rows: IntArray | BoolArray | slice) -> Self:
        """Some of the poses, repeated if the index repeats them."""
        return replace(super().take(rows), stance=self.stance.take(rows))

    def element(self, name: str) -> tuple[slice, Spring | LoadRows]:
        """Columns of an element's loads, and these loads; of a machine of elements. Raises `EffectError`."""
        assert isinstance(self.stance, Stance)
        start = 0
        for element, load in zip(self.machine_tool.elements, self.stance.loads, strict=True):
            columns = slice(start, start + load.compliance.shape[-1])
            if element.name == name:
                return columns, load
            start = columns.stop
        names = ", ".join(element.name for element in self.machine_tool.elements)
        raise EffectError(f"machine {self.machine_tool.name} has no element {name!r}", expected=f"one of {names}")

    def element_zeros(self) -> FloatArray:
        """(n, r) zeros: nothing added to any load of the elements."""
        assert isinstance(self.stance, Stance)
        return np.zeros((len(self), sum(load.compliance.shape[-1] for load in self.stance.loads)))

    @cached_property
    def weight_loads(self) -> FloatArray:
        """(n, r) loads of the elements under the machine's own weight; 0 where its file has no masses."""
        assert isinstance(self.stance, Stance)
        return self.machine_tool.weight_loads(self.stance)

    @property
    def machine(self) -> Hexapod:
        """The hexapod. Raises `InputError` for another kind of machine."""
        return as_hexapod(self.machine_tool, "an effect on struts")

    @property
    def struts(self) -> Struts:
        """Struts of a hexapod."""
        assert isinstance(self.stance, Struts)
        return self.stance


def at_pose(path: LoadPath, i: int) -> str:
    """Pose i in words, such as " at X0 Y0 Z800 mm", with a leading space."""
    x, y, z = (mm_from_m(float(v)) + 0.0 for v in path.position[i])
    return f" at X{x:g} Y{y:g} Z{z:g} mm"


def body_on_springs(path: LoadPath, shifts: tuple[float, float, float], rocking: float) -> FloatArray:
    """(n, 3, 3) m/N at the tip of a body that shifts along base axes, m/N, and rocks about X and Y, rad/(N m).

    The tip's force F at p has the moment p x F about the origin.
    """
    x, y, z = path.position.T
    moment = np.zeros((len(path), 2, 3))  # (p x F)_x and (p x F)_y per component of F
    moment[:, 0, 1], moment[:, 0, 2] = -z, y
    moment[:, 1, 0], moment[:, 1, 2] = z, -x
    return np.asarray(rocking * np.swapaxes(moment, 1, 2) @ moment + np.diag(shifts))


def at_the_tip(path: LoadPath, compliances: FloatArray) -> FloatArray:
    """(n, 12, 12) quadratic form in the tip force alone, from compliances (n, 3, 3) or (3, 3) m/N, base axes."""
    form = np.zeros((len(path), 12, 12))
    form[:, 6:9, 6:9] = compliances
    return form


@dataclass(frozen=True)
class Conditions:
    """Conditions of a program run: measurements state them row by row, a program does not.

    Attributes
    ----------
    setup
        Name of the clamping arrangement; "": none of those that have a name; None: nobody says.
    temperature
        Degrees C; None: nobody says.
    """

    setup: str | None = None
    temperature: float | None = None

    @property
    def known(self) -> tuple[str, ...]:
        """Those of `CONDITIONS` that are given."""
        return tuple(name for name, attribute in CONDITIONS.items() if getattr(self, attribute, None) is not None)

    def columns(self, n: int) -> dict[str, AnyArray]:
        """The conditions as columns for n poses, as `LoadPath` holds them."""
        given = {"setup": self.setup, "temperature": self.temperature}
        return {name: np.full(n, value) for name, value in given.items() if value is not None}


def _told(clause: str, values: Values) -> str:
    """A clause with its values: numbers to two digits; of two words the first if the number is positive.

    Examples
    --------
    >>> _told("{error} mm too {error:long/short}", {"error": -0.123})
    '0.12 mm too short'
    """

    def word(place: re.Match[str]) -> str:
        value, words = values[place[1]], place[2]
        if words:
            return str(words.split("/")[not value > 0.0])
        return about(value) if isinstance(value, float) else str(value)

    return re.sub(r"\{(\w+)(?::(.*?))?\}", word, clause)


class Effect:
    """Base of all effects; subclass, fill in the attributes, implement what the effect adds.

    Attributes
    ----------
    name
        As in machine files and on the command line.
    title, equation, source
        For people: what it is, its formula, where the formula comes from.
    link
        Its place in the load path, one of `LINKS`.
    parameters
        What it is made of.
    needs
        Columns of the measurements without which it cannot be tested. Where one of `CONDITIONS` is among them and
        nobody gives it (a program without `--setup`), the effect does not act, and results say so.
    load_dependent
        Whether the compliance depends on the size of the load; it is then the secant one.
    unknown_to_control
        Of a geometry effect: whether the control computes with the geometry before it. The struts then get the
        lengths of the programmed pose on that geometry, and the platform goes where they put it.
    told_by
        A reading that tells it from what looks the same at the tip, words for people; "" where its link says it.
    vector
        Whether its real parameters are one vector, which is there as a whole or not at all.
    holds_for
        Machines that it holds for: "hexapods", those of "elements", or "all", where it asks for neither.
    described_from
        Of an effect whose form was read off measurements: the marks of those readings (`measurements.reading_marks`).
        A diagnosis of the same readings calls it `described`, not `identified`, until others confirm it.

    Examples
    --------
    A screw that adds the same compliance to every strut:

    >>> class Screws(Effect):
    ...     name, title, link = "screws", "the screws give way", "struts"
    ...     equation, source = "c_i += c", "an example"
    ...     parameters = (Parameter("compliance", "nm/N", 1e-9, (0.0, 50.0), (1.0, 5.0), "an example"),)
    ...
    ...     def strut_compliance(self, path, p):
    ...         return np.full((len(path), 6), p["compliance"])
    >>> Screws().parameters[0].key
    'compliance_nm_per_N'
    >>> Screws().finding({"compliance": 2.5})
    'the screws give way, compliance 2.5 nm/N'
    """

    name: str
    title: str
    link: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    needs: tuple[str, ...] = ()
    load_dependent: bool = False
    unknown_to_control: bool = False
    clause: str = ""  # what a fit has found, parameters by name: "the tool is {error} mm {error:longer/shorter}"
    parts: tuple[tuple[str, str], ...] = ()  # parameter, words after its size, where the clause says {sizes}
    told_by: str = ""
    vector: bool = False
    holds_for: Literal["hexapods", "elements", "all"] = "hexapods"
    described_from: tuple[str, ...] = ()
    file: str = ""  # that declares it without code

    def strut_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """(n, 6) m/N in series with each strut. `p`: parameter name -> SI value.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> from toolpath_stiff.stiffness.model import load_path
        >>> path = load_path(tps.Machine.load("nist").model, (0, 0, 0.8))
        >>> found = tps.effects()["weak_strut"].strut_compliance(path, {"strut": 4, "factor": 0.8})
        >>> (1e9 * found).round(2).tolist()
        [[0.0, 0.0, 0.0, 6.27, 0.0, 0.0]]
        """
        return None

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """(n, 12, 12) symmetric Q; twice the stored energy is [f; w]^T Q [f; w].

        f (6) are the strut forces with J^T f = w, w (6) the force and the moment about the tip, base axes. The
        force of strut i on the platform is -f_i u_i, on the frame +f_i u_i.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> from toolpath_stiff.stiffness.model import load_path
        >>> path = load_path(tps.Machine.load("nist").model, (0, 0, 0.8))
        >>> tps.effects()["spindle_compliance"].load_compliance(path, {"radial": 5e-9, "axial": 1e-9}).shape
        (1, 12, 12)
        """
        return None

    def element_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """(n, r) m/N and rad/(N m) in series with each load of the elements, on a machine that has these.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> "element_compliance" in tps.effects(kind="serial")["joint_torsion"].hooks
        True
        """
        return None

    def parallel_stiffness(self, path: LoadPath, p: Values) -> FloatArray | None:
        """(n, 6, 6) between platform and base about the tip, parallel to the struts, base axes.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> from toolpath_stiff.stiffness.model import load_path
        >>> path = load_path(tps.Machine.load("nist").model, (0, 0, 0.8))
        >>> tps.effects()["joint_moment_stiffness"].parallel_stiffness(path, {"strut": 3, "stiffness": 1e3}).shape
        (1, 6, 6)
        """
        return None

    def geometry(self, machine: Hexapod, p: Values) -> Hexapod:
        """The machine with this effect's geometry.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> machine = tps.Machine.load("nist").model.machine
        >>> longer = tps.effects()["tool_length_error"].geometry(machine, {"error": 0.001})
        >>> longer is machine
        False
        """
        return machine

    def stands(self, machine: MachineTool, joints: FloatArray, p: Values) -> tuple[MachineTool, FloatArray]:
        """The machine, and joint values (n, j) m or rad, at which it truly stands if its control believes these.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> "stands" in tps.effects(kind="serial")["joint_zero_error"].hooks
        True
        """
        return machine, joints

    def reading(self, stiffness: FloatArray, path: LoadPath, p: Values) -> FloatArray:
        """(n,) N/m that the instrument reads for a true stiffness (n,) N/m.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> from toolpath_stiff.stiffness.model import load_path
        >>> path = load_path(tps.Machine.load("nist").model, (0, 0, 0.8))
        >>> gauge = tps.effects()["gauge_scale"]
        >>> gauge.reading(np.array([50e6]), path, {"direction": 0, "setup": "", "scale": 0.02}).round().tolist()
        [51000000.0]
        """
        return stiffness

    def seen_by(self, loop: MeasuringLoop) -> float:
        """Share of its give that an indicator across part of the load path sees: all, if its link is inside.

        Of a joint's two ends each is taken to give half.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> from toolpath_stiff.stiffness.measuring_loop import MeasuringLoop
        >>> [tps.effects()["weak_strut"].seen_by(MeasuringLoop(kind)) for kind in ("tip", "strut", "spindle")]
        [1.0, 1.0, 0.0]
        """
        if self.link not in loop.links:
            return 0.0
        return 0.5 if loop.kind == "joint" and loop.where else 1.0

    def vertex_displacement(self, path: LoadPath, p: Values, forces: FloatArray, vertex: int) -> FloatArray | None:
        """(n, 3) m, base axes: displacement of a frame vertex (1 to 3) under strut forces (n, 6) N.

        Of effects with `link = "frame"`: energy alone does not say which way a vertex moves. Without it an indicator
        between a vertex and the floor is taken to see nothing of the effect.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> from toolpath_stiff.stiffness.model import load_path
        >>> path = load_path(tps.Machine.load("nist").model, (0, 0, 0.8))
        >>> frame = tps.effects()["frame_compliance"]
        >>> values = {"vertex": 1, "radial": 1e-9, "tangential": 1e-9, "vertical": 1e-9}
        >>> frame.vertex_displacement(path, values, np.ones((1, 6)), 1).shape
        (1, 3)
        """
        return None

    def conditions(self, p: Values) -> tuple[str, ...]:
        """Those of `CONDITIONS` that it waits for with these values: from `needs`, and from values that name one.

        None for a geometry: a machine has one, whatever the conditions.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> from toolpath_stiff.stiffness.model import load_path
        >>> path = load_path(tps.Machine.load("nist").model, (0, 0, 0.8))
        >>> setup = tps.effects()["setup_compliance"]
        >>> values = {"setup": "riser", "x": 1e-9, "y": 1e-9, "z": 0.0}
        >>> setup.conditions(values), setup.acts_on(path, values), setup.is_instrument  # the path names no set-up
        (('setup',), False, False)
        """
        if not {"geometry", "stands"}.isdisjoint(self.hooks):
            return ()
        named = (q.name for q in self.parameters if q.kind == "text" and p.get(q.name))
        return tuple(dict.fromkeys(name for name in (*self.needs, *named) if name in CONDITIONS))

    def acts_on(self, path: LoadPath, p: Values) -> bool:
        """True if these poses come with every condition that it waits for."""
        return all(getattr(path, CONDITIONS[name]) is not None for name in self.conditions(p))

    def finding(self, p: Values) -> str:
        """Result of a fit in an engineer's words: a clause with its size and unit, the cause first.

        `p`: parameter name -> value in the units of files, choices as they are.
        """
        if self.clause:
            sizes = sizes_in_words([(p[name], words) for name, words in self.parts])
            return _told(self.clause, {"sizes": sizes, **{q.name: p[q.name] for q in self.parameters}})
        named = []
        for q in self.parameters:
            value = p[q.name] if q.discrete else f"{float(f'{p[q.name]:.3g}'):g} {q.unit}".rstrip()
            named.append(f"{q.name.replace('_', ' ')} {value}")
        return f"{self.title}, {', '.join(named)}"

    @property
    def hooks(self) -> list[str]:
        """Those of `HOOKS` that it implements.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.effects()["weak_strut"].hooks
        ['strut_compliance']
        """
        return [hook for hook in HOOKS if getattr(type(self), hook) is not getattr(Effect, hook)]

    @property
    def is_instrument(self) -> bool:
        """True if it changes readings only."""
        return self.link == "instrument"
