"""Cutters of a program: geometry, teeth, and the tool's own compliance; from tool tables and `cut.toml`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.units import m_from_mm, m_from_nm, m_from_um, pa_from_gpa, rad_from_deg

# Young's modulus, GPa, by the tool table's `material`. Cemented carbide WC-10Co: 580 to 600 (makers' data sheets);
# high-speed steel: 210 to 230.
MODULI = {"carbide": 600.0, "hss": 210.0}
CORE_SHARE = 0.8  # of the diameter: a beam of this diameter bends as a fluted one (Kops, Vo, CIRP Annals 39 (1990) 93)
NEEDED = ("diameter_mm", "flutes", "helix_deg")


@dataclass(frozen=True)
class Cutter:
    r"""An end mill. SI.

    Attributes
    ----------
    number
        Of the tool in the program.
    diameter, corner_radius
        m; corner radius 0: flat, half of the diameter: ball, between: bull nose.
    flutes, helix, hand
        Number of teeth, evenly spaced; rad, at least 0; 1: right-hand, -1: left-hand.
    run_out, run_out_angle
        m, distance of the tool's axis from the spindle's; rad, from the first tooth to where it points.
    cutting_length
        m of cutting edge from the tip; nan: not given.
    stickout
        m from holder to tip; nan: not given.
    lateral_compliance, axial_compliance
        m/N of the tool itself at its tip, across and along; nan: not known.
    origin
        Where compliance, corner radius and run-out come from, a sentence each.

    Examples
    --------
    >>> geometry = {"flutes": 3, "helix_deg": 30, "core_mm": 8, "modulus_GPa": 600}
    >>> cutter = cutter_of(ToolEntry(1, diameter=10.0, stick_out=30.0, cutter=geometry))
    >>> round(cutter.lateral_compliance * 1e9, 1)  # nm/N
    74.6
    """

    number: int
    diameter: float
    corner_radius: float
    flutes: int
    helix: float
    hand: int = 1
    run_out: float = 0.0
    run_out_angle: float = 0.0
    cutting_length: float = math.nan
    stickout: float = math.nan
    lateral_compliance: float = math.nan
    axial_compliance: float = math.nan
    origin: tuple[str, ...] = ()

    @property
    def radius(self) -> float:
        """m, half of the diameter."""
        return self.diameter / 2.0

    @property
    def flat(self) -> float:
        """m, radius of the flat part of its end."""
        return self.radius - self.corner_radius


def of_tools(cutters: Mapping[int, Cutter], tools: IntArray, name: str, without: float = 0.0) -> FloatArray:
    """(n,) attribute of the cutter of each tool number (n,); `without` for tools that do not cut."""
    values = np.full(len(tools), without)
    for number, cutter in cutters.items():
        values[tools == number] = getattr(cutter, name)
    return values


def merged_tool(table: ToolEntry, further: ToolEntry) -> ToolEntry:
    """A tool of the tool table, overridden by its values in `cut.toml`."""
    known = {name: getattr(further, name) for name in ("length", "diameter", "stick_out")}
    known = {name: value for name, value in known.items() if not math.isnan(value)}
    words = {name: getattr(further, name) or getattr(table, name) for name in ("remark", "material")}
    return replace(table, **known, **words, cutter={**table.cutter, **further.cutter})


def cutter_of(tool: ToolEntry) -> Cutter:
    """The cutter of a tool. Raises `InputError` that names missing data."""
    name = f"tool {tool.number}"
    given: dict[str, float] = {"diameter_mm": tool.diameter, "stick_out_mm": tool.stick_out, **tool.cutter}
    given = {key: value for key, value in given.items() if not math.isnan(value)}
    missing = [key for key in NEEDED if key not in given]
    if missing:
        raise InputError(
            f"{name}: {', '.join(missing)} not known",
            hint=f"write it in cut.toml, [[tool]] with number = {tool.number}, or in the tool table (--tools)",
        )
    diameter, corner = given["diameter_mm"], given.get("corner_radius_mm", 0.0)
    for key, most in (("corner_radius_mm", f"{diameter / 2.0:g}, a ball"), ("core_mm", f"{diameter:g}, the diameter")):
        if given.get(key, 0.0) > float(most.partition(",")[0]):
            raise InputError(f"{name}: {key} = {given[key]:g}", expected=f"at most {most}")
    origin = [] if "corner_radius_mm" in given else [f"{name}: no corner_radius_mm is given, its end is flat"]
    lateral, axial, beam = _beam(given, tool.material)
    origin += [f"{name}: {beam}"] if beam else []
    if "run_out_um" not in given:
        origin.append(f"{name}: no run_out_um is given, it runs true")
    return Cutter(
        number=tool.number,
        diameter=m_from_mm(diameter),
        corner_radius=m_from_mm(corner),
        flutes=int(given["flutes"]),
        helix=rad_from_deg(abs(given["helix_deg"])),
        hand=-1 if given["helix_deg"] < 0.0 else 1,
        run_out=m_from_um(given.get("run_out_um", 0.0)),
        run_out_angle=rad_from_deg(given.get("run_out_angle_deg", 0.0)),
        cutting_length=m_from_mm(given.get("cutting_length_mm", math.nan)),
        stickout=m_from_mm(given.get("stick_out_mm", math.nan)),
        lateral_compliance=lateral,
        axial_compliance=axial,
        origin=tuple(origin),
    )


def _beam(given: Mapping[str, float], material: str) -> tuple[float, float, str]:
    """Lateral and axial compliance of the tool as a beam, m/N, and their source; nan: unknown.

    A cantilever of the core's diameter: L^3 / 3EI across and L / EA along (Timoshenko, Strength of Materials).
    """
    axial = m_from_nm(given.get("axial_nm_per_N", 0.0))
    if "lateral_nm_per_N" in given:
        return m_from_nm(given["lateral_nm_per_N"]), axial, ""
    if "stick_out_mm" not in given:
        return math.nan, math.nan, "machine only: without stick_out_mm or lateral_nm_per_N the tool counts as rigid"
    assumed = []
    if "core_mm" not in given:
        assumed.append(f"a core of {CORE_SHARE:g} of the diameter")
    modulus = given.get("modulus_GPa", MODULI.get(material.lower(), MODULI["carbide"]))
    if "modulus_GPa" not in given:
        assumed.append(f"{modulus:g} GPa{'' if material.lower() in MODULI else ' (carbide)'}")
    core = m_from_mm(given.get("core_mm", CORE_SHARE * given["diameter_mm"]))
    length, stress = m_from_mm(given["stick_out_mm"]), pa_from_gpa(modulus)
    lateral = length**3 / (3.0 * stress * math.pi * core**4 / 64.0)
    if "axial_nm_per_N" not in given:
        axial = length / (stress * math.pi * core**2 / 4.0)
    return lateral, axial, f"its beam assumes {' and '.join(assumed)}" if assumed else ""
