"""Machine files: TOML in shop units to `Machine` in SI, checked key by key.

`SECTIONS` lists what a file may hold: sections, keys, units, bounds. Each section names the origin of its figures
("published", "recovered", "assumed", "fitted"). A key that is not known is an error, so that a typing mistake cannot
fall back to a default; the message has section, key, value and bound.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError, MachineFileError
from toolpath_stiff.files import is_file, read_bytes
from toolpath_stiff.hints import command_line
from toolpath_stiff.machine.kinematics import solve_struts_at
from toolpath_stiff.machine.model import ORIGINS, EffectEntry, Limits, Machine, StrutLaw, read_uncertainty
from toolpath_stiff.machine.symmetry import describe_stray, find_symmetry
from toolpath_stiff.toml_reader import LARGEST_BYTES, TomlReader, is_number, is_text, shortened
from toolpath_stiff.units import (
    Pose,
    m_from_mm,
    m_per_s_from_mm_per_min,
    mm_from_m,
    n_per_m_from_n_per_um,
    rad_from_deg,
)

INFINITY = math.inf


CLOSEST_LENGTHS = 1e-6  # m, of a strut law: nobody measures closer, and the slope between them stays a number


# Smallest singular value of the six strut screws (arms in units of the platform's size) that is no singularity.
SINGULAR = 1e-6


@dataclass(frozen=True)
class Key:
    """What a key of a machine file may hold.

    `shape` () for a number, (3,) or (6, 3) for lists; `also_length` admits a second length, `many` any greater one,
    `or_one` a single number instead of a list.
    Bounds are inclusive unless `open_low`.
    """

    unit: str = ""
    shape: tuple[int, ...] = ()
    low: float = -1e5
    high: float = 1e5
    required: bool = True
    text: bool = False
    infinite: bool = False
    open_low: bool = False
    also_length: int | None = None
    many: bool = False
    or_one: bool = False


JOINTS_MM = Key(unit="mm", shape=(6, 3), required=False)


# Rows of radius, angle about Z, height: keeps the symmetry of a machine exact, and reads better.
JOINTS_CYLINDRICAL = Key(unit="mm, deg, mm", shape=(6, 3), required=False)


SECTIONS: dict[str, dict[str, Key]] = {
    "": {
        "name": Key(text=True),
        "title": Key(text=True, required=False),
        "source": Key(text=True, required=False),
    },
    "frame_joints": {"mm": JOINTS_MM, "cylindrical_mm_deg": JOINTS_CYLINDRICAL},
    "platform_joints": {"mm": JOINTS_MM, "cylindrical_mm_deg": JOINTS_CYLINDRICAL},
    "reference_tool": {"length_mm": Key(unit="mm", low=0.0, high=2000.0)},
    "strut_law": {
        "length_mm": Key(unit="mm", shape=(2,), low=0.0, open_low=True, required=False, many=True),
        "stiffness_N_per_um": Key(unit="N/um", shape=(2,), low=1e-6, high=1e5, many=True, or_one=True),
    },
    "platform": {"bar_stiffness_N_per_m": Key(unit="N/m", low=1e5, high=INFINITY, infinite=True, open_low=True)},
    "limits.strut_length": {
        "min_mm": Key(unit="mm", low=0.0),
        "max_mm": Key(unit="mm", low=0.0, open_low=True),
    },
    "limits.joint_angle": {
        "frame_max_deg": Key(unit="deg", low=0.0, high=180.0, open_low=True, infinite=True),
        "platform_max_deg": Key(unit="deg", low=0.0, high=180.0, open_low=True, infinite=True),
        "neutral_pose_mm_deg": Key(unit="mm, deg", shape=(6,)),
    },
    "limits.workspace": {"min_mm": Key(unit="mm", shape=(3,)), "max_mm": Key(unit="mm", shape=(3,))},
    "limits.singularity": {"min_index": Key(low=0.0, high=1.0)},
    "setup": {
        "default_origin_mm": Key(unit="mm[, deg]", shape=(3,), also_length=6),
        "rapid_mm_per_min": Key(unit="mm/min", low=0.0, high=1e6, open_low=True),
        "name": Key(text=True, required=False),
        "names": Key(text=True, shape=(0,), required=False),
        "temperature_C": Key(unit="degrees C", low=-50.0, high=200.0, required=False),
    },
}


OPTIONAL_SECTIONS = ("limits.joint_angle", "limits.workspace", "limits.singularity", "platform", "setup")


def as_array(raw: Any) -> FloatArray | None:
    """A float array of TOML numbers and lists of them; None for anything else (booleans too)."""

    def numeric(item: Any) -> bool:
        if isinstance(item, list):
            return all(numeric(part) for part in item)
        return is_number(item)

    if not numeric(raw):
        return None
    try:
        return np.array(raw, dtype=float)
    except ValueError:  # rows of unequal length
        return None


def describe(rule: Key) -> str:
    """What a key may hold, in words."""
    if rule.text:
        return "a text"
    shape = {
        (): "a number",
        (2,): "2 numbers",
        (3,): "3 numbers",
        (6,): "6 numbers",
        (6, 3): "6 rows of 3 numbers",
    }[rule.shape]
    if rule.also_length:
        shape = f"{rule.shape[0]} or {rule.also_length} numbers"
    if rule.many:
        shape = f"{'a number or ' if rule.or_one else ''}{rule.shape[0]} or more numbers"
    unit = f" in {rule.unit}" if rule.unit else ""
    low = f"above {rule.low:g}" if rule.open_low else f"at least {rule.low:g}"
    high = "" if math.isinf(rule.high) else f", at most {rule.high:g}"
    return f"{shape}{unit}, {low}{high}"


def packaged_machines() -> dict[str, Path]:
    """Name -> file of the machines that ship with the package."""
    folder = Path(__file__).parent.parent / "data" / "machines"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_machine(name_or_file: str | Path = defaults.MACHINE) -> Machine:
    """Load a machine by the name of a packaged one or from a machine file.

    Parameters
    ----------
    name_or_file
        A name that `packaged_machines` lists, or a path to a TOML file.

    Raises
    ------
    InputError
        There is no such machine or file, or the file is wrong; the message has section, key, value, bound.

    Examples
    --------
    >>> machine = load_machine("nist")
    >>> machine.name, machine.frame_joints.shape
    ('nist', (6, 3))
    >>> round(machine.reference_tool_length, 5)
    0.15
    """
    known = packaged_machines()
    if str(name_or_file) in known:
        return deepcopy(_packaged(known[str(name_or_file)]))  # its arrays are the caller's own
    path = Path(name_or_file)
    if not is_file(path):
        template = command_line("machine", "new", path.with_suffix(".toml") if path.name else "mine.toml")
        raise MachineFileError(
            f"machine {str(name_or_file)!r} is neither a packaged machine nor a file",
            expected=f"one of {', '.join(known)}, or a machine file",
            hint=f"`tps machine list` lists the machines, `{template}` writes a commented template",
        )
    try:
        text = read_bytes(path, "machine file", LARGEST_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise MachineFileError(
            f"not a text file (byte {error.start})", expected="a machine file (TOML, UTF-8)", file=str(path)
        ) from None
    return parse_machine(text, file=str(path))


@cache
def _packaged(path: Path) -> Machine:
    """A machine that ships with the package, read once."""
    return parse_machine(path.read_text(encoding="utf-8"), file=path.name)


def parse_machine(text: str, file: str = "machine.toml") -> Machine:
    """Parse the text of a machine file; `file` is only used in messages. Raises `InputError`."""
    toml = TomlReader(text, file, kind=MachineFileError)
    return _machine(toml, toml.data)


def _fail(toml: TomlReader, section: str, key: str, found: str, expected: str = "", hint: str = "") -> InputError:
    label = f"[{section}] {key}".strip() if section else key
    line = toml.line_of(section, key)
    return MachineFileError(f"{label}{found}", expected=expected, hint=hint, file=toml.file, line=line)


def _machine(toml: TomlReader, table: dict[str, Any]) -> Machine:
    sections = _sections(toml, table)
    values = {name: _section(toml, name, content) for name, content in sections.items()}
    top, setup = values[""], values.get("setup", {})
    effects, instruments = _entries(toml, table, "effect"), _entries(toml, table, "instrument")
    law = _strut_law(toml, values["strut_law"], values["limits.strut_length"])
    machine = Machine(
        name=top["name"],
        title=top.get("title", top["name"]),
        source=top.get("source", ""),
        frame_joints=_joints(toml, "frame_joints", values),
        platform_joints=_joints(toml, "platform_joints", values),
        reference_tool_length=m_from_mm(values["reference_tool"]["length_mm"]),
        strut_law=law,
        platform_bar_stiffness=values.get("platform", {}).get("bar_stiffness_N_per_m", INFINITY),
        limits=_limits(toml, values),
        default_origin=_pose(setup.get("default_origin_mm", np.zeros(3))),
        rapid_feed=m_per_s_from_mm_per_min(setup["rapid_mm_per_min"]) if setup else defaults.RAPID_FEED,
        setup=setup.get("name"),
        temperature=setup.get("temperature_C"),
        setups=setup.get("names", ()),
        origins={name: v["origin"] for name, v in values.items() if name and "origin" in v},
        remarks={name: v["remark"] for name, v in values.items() if name and "remark" in v},
        effects=effects,
        instruments=instruments,
        uncertainty=read_uncertainty(toml, law, (*effects, *instruments)),
    )
    _check_law(toml, machine)
    _check_neutral_pose(toml, machine)
    return machine


def _check_law(toml: TomlReader, machine: Machine) -> None:
    """The struts must keep some stiffness over their whole travel."""
    law = machine.strut_law
    for key, length in zip(("min_mm", "max_mm"), machine.limits.strut_length, strict=True):
        intercept, slope = law.line_at(length)
        if np.isfinite(length) and intercept + slope * length <= 0.0:
            vanishes = mm_from_m(-intercept / slope)
            raise _fail(
                toml,
                "limits.strut_length",
                key,
                f" = {mm_from_m(length):g}: the strut law leaves no stiffness there",
                expected=f"a travel on this side of {vanishes:.1f} mm, where the law vanishes",
            )


def _check_neutral_pose(toml: TomlReader, machine: Machine) -> None:
    """Margins are counted from the neutral pose, so the machine must not be singular there."""
    struts = solve_struts_at(machine, machine.limits.neutral_pose)
    directions, arms = struts.directions[0], struts.arms[0] - struts.arms[0].mean(axis=0)
    size = max(float(np.linalg.norm(arms, axis=1).mean()), 1e-9)
    screws = np.concatenate([directions, np.cross(arms, directions) / size], axis=1)
    if not np.isfinite(screws).all() or np.linalg.svd(screws)[1][-1] < SINGULAR:
        symmetry = find_symmetry(machine)
        strays = "; ".join(describe_stray(stray, symmetry.kind) for stray in symmetry.strays)
        raise _fail(
            toml,
            "limits.joint_angle",
            "neutral_pose_mm_deg",
            ": the machine is singular there",
            expected="a pose in the middle of the workspace",
            hint=strays or "check the joints as well: similar hexagons without a twist are singular everywhere",
        )


def _sections(toml: TomlReader, table: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Split the file into the sections of the schema; unknown and missing ones are errors."""
    found: dict[str, dict[str, Any]] = {"": {}}
    for name, content in table.items():
        if name in ("effect", "instrument", "uncertainty"):
            continue
        if name == "limits" and isinstance(content, dict):
            for sub, inner in content.items():
                if f"limits.{sub}" not in SECTIONS:
                    raise _unknown(toml, f"limits.{sub}", list(SECTIONS))
                found[f"limits.{sub}"] = _table(toml, "limits." + sub, inner)
        elif name in SECTIONS:
            found[name] = _table(toml, name, content)
        elif isinstance(content, dict):
            raise _unknown(toml, name, list(SECTIONS))
        else:
            found[""][name] = content
    for name in SECTIONS:
        if name not in found and name not in OPTIONAL_SECTIONS:
            raise MachineFileError(
                f"section [{name}] is missing",
                hint="`tps machine new template.toml` writes a template with every section",
                file=toml.file,
            )
    return found


def _table(toml: TomlReader, name: str, content: Any) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise _fail(toml, "", name, f" = {content!r}", expected=f"a section [{name}]")
    return content


def _unknown(toml: TomlReader, name: str, known: list[str]) -> InputError:
    sections = ", ".join(f"[{n}]" for n in known if n)
    return MachineFileError(
        f"unknown section [{name}]",
        expected=f"one of {sections}, [[effect]], [[instrument]], [uncertainty]",
        file=toml.file,
        line=toml.line_at(name),
    )


def _section(toml: TomlReader, name: str, content: dict[str, Any]) -> dict[str, Any]:
    keys = SECTIONS[name]
    allowed = [*keys, *(("origin", "remark") if name else ())]
    for key in content:
        if key not in allowed:
            raise _fail(toml, name, key, ": unknown key", expected=f"one of {', '.join(allowed)}")
    for key, rule in keys.items():
        if rule.required and key not in content:
            raise _fail(toml, name, key, " is missing", expected=describe(rule))
    if name and name != "setup" and content.get("origin") not in ORIGINS:
        raise _fail(
            toml,
            name,
            "origin",
            f" = {content['origin']!r}" if "origin" in content else " is missing",
            expected=f"one of {', '.join(ORIGINS)}",
        )
    return {k: _value(toml, name, k, v, keys[k]) if k in keys else str(v) for k, v in content.items()}


def _value(toml: TomlReader, section: str, key: str, raw: Any, rule: Key) -> Any:
    shown = shortened(raw)
    if rule.text and rule.shape:
        if not isinstance(raw, list) or not all(map(is_text, raw)) or len(set(raw)) < len(raw):
            raise _fail(toml, section, key, f" = {shown}", expected="a list of names, each once")
        return tuple(raw)
    if rule.text:
        if not is_text(raw):
            raise _fail(toml, section, key, f" = {shown}", expected="a text that is not empty")
        return raw
    array = as_array(raw)
    if array is None or not _fits(array.shape, rule):
        raise _fail(toml, section, key, f" = {shown}", expected=describe(rule))
    bad = np.isnan(array) | (array < rule.low) | (array > rule.high)
    if rule.open_low:
        bad |= array <= rule.low
    if not rule.infinite:
        bad |= np.isinf(array)
    if bad.any():
        worst = float(array[bad][0])
        raise _fail(toml, section, key, f" = {worst:g}", expected=describe(rule))
    return float(array) if array.ndim == 0 else array


def _fits(shape: tuple[int, ...], rule: Key) -> bool:
    if rule.many and len(shape) == 1:
        return shape[0] >= rule.shape[0]
    return (
        shape == rule.shape
        or (rule.also_length is not None and shape == (rule.also_length,))
        or (rule.or_one and not shape)
    )


def _joints(toml: TomlReader, section: str, values: dict[str, dict[str, Any]]) -> FloatArray:
    """(6, 3) m from whichever of the two forms is given."""
    given = [key for key in ("mm", "cylindrical_mm_deg") if key in values[section]]
    if len(given) != 1:
        raise _fail(
            toml,
            section,
            "mm",
            " and cylindrical_mm_deg are both given" if given else " is missing",
            expected="one of mm (6 rows x, y, z) and cylindrical_mm_deg (6 rows radius, angle, height)",
        )
    rows = values[section][given[0]]
    if given[0] == "cylindrical_mm_deg":
        angle = rad_from_deg(rows[:, 1])
        rows = np.column_stack([rows[:, 0] * np.cos(angle), rows[:, 0] * np.sin(angle), rows[:, 2]])
    return m_from_mm(rows)


def _strut_law(toml: TomlReader, values: dict[str, Any], travel: dict[str, Any]) -> StrutLaw:
    """Linear by two lengths, a table by more, constant by one stiffness without a length."""
    lengths, stiffnesses = values.get("length_mm"), n_per_m_from_n_per_um(values["stiffness_N_per_um"])
    if np.ndim(stiffnesses) == 0:
        if lengths is not None:
            found = f": {len(lengths)} lengths, but one stiffness"
            raise _fail(toml, "strut_law", "length_mm", found, "a stiffness for each length, or no length_mm: constant")
        low, high = m_from_mm(travel["min_mm"]), m_from_mm(travel["max_mm"])
        return StrutLaw(low, float(stiffnesses), high, float(stiffnesses), constant=True)
    if lengths is None:
        expected = "a length for each stiffness, or a single stiffness: constant"
        raise _fail(toml, "strut_law", "length_mm", " is missing", expected)
    if len(lengths) != len(stiffnesses):
        found = f": {len(stiffnesses)} stiffnesses, but {len(lengths)} lengths"
        raise _fail(toml, "strut_law", "stiffness_N_per_um", found, f"{len(lengths)} numbers, one for each length")
    lengths = m_from_mm(lengths)
    if len(lengths) > 2:
        _check_table(toml, lengths)
        return StrutLaw.table(lengths, stiffnesses)
    if lengths[0] == lengths[1]:
        raise _fail(toml, "strut_law", "length_mm", ": both lengths are equal", "two lengths apart")
    if abs(lengths[1] - lengths[0]) < CLOSEST_LENGTHS:
        raise _fail(toml, "strut_law", "length_mm", ": the lengths are all but equal", "two lengths 0.001 mm apart")
    return StrutLaw(float(lengths[0]), float(stiffnesses[0]), float(lengths[1]), float(stiffnesses[1]))


def _check_table(toml: TomlReader, lengths: FloatArray) -> None:
    """Lengths of a table rise, each 0.001 mm or more above the one before."""
    bad = np.flatnonzero(np.diff(lengths) < CLOSEST_LENGTHS)
    if len(bad):
        before, after = (float(mm_from_m(v)) for v in lengths[bad[0] : bad[0] + 2])
        found = f": {after:g} comes after {before:g} (number {bad[0] + 2})"
        raise _fail(toml, "strut_law", "length_mm", found, "lengths of a table rising, 0.001 mm apart or more")


def _limits(toml: TomlReader, values: dict[str, dict[str, Any]]) -> Limits:
    strut = values["limits.strut_length"]
    if not strut["min_mm"] < strut["max_mm"]:
        raise _fail(
            toml,
            "limits.strut_length",
            "max_mm",
            f" = {strut['max_mm']:g}",
            expected=f"more than min_mm = {strut['min_mm']:g}",
        )
    given: dict[str, Any] = {"strut_length": (m_from_mm(strut["min_mm"]), m_from_mm(strut["max_mm"]))}
    box = values.get("limits.workspace")
    if box:
        if not (box["min_mm"] < box["max_mm"]).all():
            raise _fail(
                toml,
                "limits.workspace",
                "max_mm",
                ": not above min_mm",
                expected="max_mm > min_mm in x, y and z",
            )
        given["workspace"] = m_from_mm(np.array([box["min_mm"], box["max_mm"]]))
    angles = values.get("limits.joint_angle")
    if angles:
        given["frame_joint_angle"] = rad_from_deg(angles["frame_max_deg"])
        given["platform_joint_angle"] = rad_from_deg(angles["platform_max_deg"])
        given["neutral_pose"] = _pose(angles["neutral_pose_mm_deg"])
    else:  # joints without limits: the neutral pose only serves the singularity index
        given["neutral_pose"] = _pose(values.get("setup", {}).get("default_origin_mm", np.zeros(3)))
    if "limits.singularity" in values:
        given["singularity"] = values["limits.singularity"]["min_index"]
    return Limits(**given)


def _entries(toml: TomlReader, table: dict[str, Any], kind: str) -> tuple[EffectEntry, ...]:
    """`[[effect]]` and `[[instrument]]`: a name, the parameters in SI, the provenance if there is one.

    What the parameters mean, and their bounds, is known to the effects themselves (the room above).
    """
    rows = table.get(kind, [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise _fail(toml, "", kind, f" is not a list of tables; write [[{kind}]]")
    return tuple(_entry(toml, row, kind, nth) for nth, row in enumerate(rows))


def _entry(toml: TomlReader, row: dict[str, Any], kind: str, nth: int) -> EffectEntry:
    """The nth entry of its kind."""
    found = {key: toml.line_of(kind, key, nth) for key in ("", *row)}
    lines = {key: line for key, line in found.items() if line is not None}

    def refuse(key: str, told: str, expected: str) -> InputError:
        line = lines.get(key, lines.get(""))
        return MachineFileError(f"[[{kind}]] {key}{told}", expected=expected, file=toml.file, line=line)

    name, provenance = row.get("name"), row.get("provenance", {})
    if not isinstance(name, str) or not name:
        raise refuse("name", " is missing" if name is None else f" = {name!r}", "an effect's name")
    if not isinstance(provenance, dict):
        raise refuse("provenance", f" = {shortened(provenance)}", f"a table [{kind}.provenance]")
    parameters = {key: value for key, value in row.items() if key not in ("name", "provenance")}
    return EffectEntry(name, parameters, provenance, toml.file, lines)


def _pose(values: Any) -> Pose:
    """x, y, z in mm and optionally three angles in degrees, to SI."""
    x, y, z, *angles = (float(v) for v in values)
    a, b, c = angles or (0.0, 0.0, 0.0)
    return (
        m_from_mm(x),
        m_from_mm(y),
        m_from_mm(z),
        rad_from_deg(a),
        rad_from_deg(b),
        rad_from_deg(c),
    )
