"""Files of serial machines: joints by Denavit-Hartenberg rows, by origin and axis, or as a mill's axes with limits."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.chain import (
    STILL,
    ChainJoint,
    FixedFrame,
    aligned,
    modified_dh,
    placement,
    standard_dh,
)
from toolpath_stiff.machine.common_sections import common_fields
from toolpath_stiff.machine.elements import TORSION, beam_axes, turns
from toolpath_stiff.machine.model import Limits
from toolpath_stiff.machine.schema import NAMES, SETUP, Key, MachineToml, Sections, read_rows, read_sections
from toolpath_stiff.machine.serial import Serial
from toolpath_stiff.machine.serial_elements import ELEMENT, MASS, read_elements
from toolpath_stiff.machine.words import LETTERS
from toolpath_stiff.units import m_from_mm, rad_from_deg

MODIFIED, STANDARD, XYZAC, XYZBC = "modified DH", "standard DH", "linuxcnc xyzac-trt-kins", "linuxcnc xyzbc-trt-kins"
LENGTH, ANGLE = Key(unit="mm", required=False), Key(unit="deg", required=False, low=-3600.0, high=3600.0)
POINT, DIRECTION = Key(unit="mm", shape=(3,), required=False), Key(shape=(3,), low=-1.0, high=1.0, required=False)
TEXT = Key(text=True, required=False)
ENDS = ("min", "max", "stands")
UNITS = {"mm": m_from_mm, "deg": rad_from_deg}
AXIS = {
    "name": Key(text=True),
    "type": Key(text=True),
    "side": TEXT,
    **dict.fromkeys(("a_mm", "d_mm"), LENGTH),
    **dict.fromkeys(("alpha_deg", "offset_deg"), ANGLE),
    "xyz_mm": POINT,
    "rpy_deg": Key(unit="deg", shape=(3,), low=-360.0, high=360.0, required=False),
    "axis": DIRECTION,
    **{
        f"{key}_{unit}": Key(unit=unit, required=False, infinite=True, low=-np.inf, high=np.inf)
        for key in ENDS
        for unit in UNITS
    },
    **{
        f"speed_{unit}_per_s": Key(unit=f"{unit}/s", low=0.0, open_low=True, high=1e5, required=False) for unit in UNITS
    },
}
DH = ("a_mm", "d_mm", "alpha_deg", "offset_deg")
TRUNNION = ("x_rot_point_mm", "y_rot_point_mm", "z_rot_point_mm", "x_offset_mm", "y_offset_mm", "z_offset_mm")
SCHEMA = {
    "": {**NAMES, "convention": TEXT},
    "limits": {
        **{f"{axis}_mm": Key(unit="mm", shape=(2,), required=False) for axis in "XYZ"},
        **{f"{axis}_deg": Key(unit="deg", shape=(2,), low=-1e6, high=1e6, required=False) for axis in "ABC"},
    },
    "trunnion": dict.fromkeys(TRUNNION, LENGTH),
    "tool": {"tip_mm": Key(unit="mm", shape=(3,)), **dict.fromkeys(("x_axis", "y_axis", "z_axis"), DIRECTION)},
    "work": {"xyz_mm": POINT, "rpy_deg": AXIS["rpy_deg"]},
    "singularity": {name: Key(low=0.0, high=1.0, required=False) for name in ("shoulder", "elbow", "wrist")},
    "reference_tool": {"length_mm": Key(unit="mm", low=0.0, high=2000.0)},
    "setup": SETUP,
    "axis[]": AXIS,
    "element[]": ELEMENT,
    "mass[]": MASS,
    "pose[]": {},
}
SECTIONS_BESIDE = [name for name in SCHEMA if name]
# Rotary limits that are all within 2 pi are radians, not degrees. Angles of a row that are multiples of a
# right angle in radians, to the digits that people write.
RADIANS, RIGHT_ANGLE, WRITTEN = 6.29, np.pi / 2.0, 1e-3
PARALLEL = 1e-3  # sine of the angle, or volume, below which directions count as dependent
SHORTEST_ARM = 0.05  # m from the first joint to the tip: less means a description in metres


def read(toml: MachineToml) -> Serial:
    """Serial machine from a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, SECTIONS_BESIDE, stated=False)
    if rows := read_rows(toml, "axis", AXIS):
        names, convention = [row["name"] for row in rows], values[""].get("convention", MODIFIED)
        if "trunnion" in values or "limits" in values:
            section = "trunnion" if "trunnion" in values else "limits"
            raise toml.fault(section, "", ": the file has [[axis]] rows", expected="limits and places of axes there")
    else:
        rows, names, convention = _rows_of_mill(toml, values), ["X", "Y", "Z", "A", "B", "C"], MODIFIED
    tool, work, tip, table = _of_rows(toml, rows, values, convention)
    parts = read_elements(toml, (tool, work), (tip, table))
    if not any(parts.bodies):
        raise InputError("no [[element]]: nothing is compliant", expected="springs, joints or beams", file=toml.file)
    known = [body.element.name + TORSION for side in parts.bodies for body in side if turns(body.element)]
    common = common_fields(toml, values, known)
    machine = Serial(
        **{"limits": Limits(neutral_pose=common["default_origin"]), **common},
        reference_tool_length=m_from_mm(values.get("reference_tool", {}).get("length_mm", np.nan)),
        tool_joints=tool,
        work_joints=work,
        order=tuple(int(i) for i in np.argsort([names.index(joint.name) for joint in (*tool, *work)])),
        tip=tip,
        work=table,
        tool_bodies=tuple(parts.bodies[0]),
        work_bodies=tuple(parts.bodies[1]),
        tool_masses=tuple(parts.masses[0]),
        work_masses=tuple(parts.masses[1]),
        least={name: v for name, v in values.get("singularity", {}).items() if isinstance(v, float)},
    )
    _check_solvable(toml, machine)
    return machine


def _of_rows(
    toml: MachineToml, rows: Sequence[Document], values: Sections, convention: str
) -> tuple[tuple[ChainJoint, ...], tuple[ChainJoint, ...], FixedFrame, FixedFrame]:
    """Joints of tool and work; placements of the tip and of the work in the last frame of each."""
    if convention not in (MODIFIED, STANDARD):
        raise toml.fault("", "convention", f" = {convention!r}", expected=f"{MODIFIED!r} or {STANDARD!r}")
    sides: dict[str, list[ChainJoint]] = {"tool": [], "work": []}
    rests = {"tool": STILL, "work": STILL}  # placement after the last joint of each side
    for nth, row in enumerate(rows, 1):
        section, side = f"axis[{nth}]", row.get("side", "tool")
        if side not in sides:
            raise toml.fault(section, "side", f" = {side!r}", expected="tool or work")
        if any(row["name"] == joint.name for joints in sides.values() for joint in joints):
            raise toml.fault(section, "name", f" = {row['name']!r} is there twice")
        linear = _is_linear(toml, section, row)
        before, after = _placements(toml, section, row, convention)
        given = STILL if any(key in row for key in DH) else after
        place = rests[side].then(before)
        travel = _travel(toml, section, row, linear)
        sides[side].append(ChainJoint(row["name"], linear, place, given=given, **travel))
        rests[side] = after
    _check_units(toml, sides["tool"] + sides["work"])
    tip, work = values.get("tool"), values.get("work", {})
    flange = rests["tool"] if tip is None else rests["tool"].then(_tip(toml, tip))
    table = placement(m_from_mm(work.get("xyz_mm", np.zeros(3))), rad_from_deg(work.get("rpy_deg", np.zeros(3))))
    reach = sum(float(np.linalg.norm(joint.place.origin)) for joint in sides["tool"][1:])
    if reach + float(np.linalg.norm(flange.origin)) < SHORTEST_ARM and not any(joint.linear for joint in sides["tool"]):
        raise toml.fault(
            "axis[1]", "", f": the whole arm is {1e3 * reach:.3g} mm long", expected="lengths in mm, not m"
        )
    return tuple(sides["tool"]), tuple(sides["work"]), flange, rests["work"].then(table)


def _is_linear(toml: MachineToml, section: str, row: Document) -> bool:
    kinds = {"r": False, "rotary": False, "p": True, "linear": True}
    if row["type"].lower() not in kinds:
        raise toml.fault(section, "type", f" = {row['type']!r}", expected="R or rotary, P or linear")
    return kinds[row["type"].lower()]


def _placements(toml: MachineToml, section: str, row: Document, convention: str) -> tuple[FixedFrame, FixedFrame]:
    """Placements between the previous joint and this one, and after this one."""
    dh, free = [key for key in DH if key in row], [key for key in ("xyz_mm", "rpy_deg", "axis") if key in row]
    if dh and free:
        raise toml.fault(section, free[0], f": the row has {dh[0]} too", expected="a DH row, or an origin and an axis")
    if not dh:
        axis = row.get("axis", np.array([0.0, 0.0, 1.0]))
        if not 0.99 < np.linalg.norm(axis) < 1.01:
            raise toml.fault(section, "axis", f" has the length {np.linalg.norm(axis):.3g}", expected="a unit vector")
        place = placement(m_from_mm(row.get("xyz_mm", np.zeros(3))), rad_from_deg(row.get("rpy_deg", np.zeros(3))))
        turn = aligned(axis)
        return place.then(turn), turn.inverse()
    for key in ("alpha_deg", "offset_deg"):
        angle = row.get(key, 0.0)
        if angle and abs(angle / RIGHT_ANGLE - round(angle / RIGHT_ANGLE)) < WRITTEN and abs(angle) < RADIANS:
            expected = f"degrees: {np.rad2deg(angle):.6g}"
            raise toml.fault(section, key, f" = {angle:g} is a right angle in radians", expected)
    lengths = (m_from_mm(row.get("a_mm", 0.0)), m_from_mm(row.get("d_mm", 0.0)))
    angles = (rad_from_deg(row.get("alpha_deg", 0.0)), rad_from_deg(row.get("offset_deg", 0.0)))
    if convention == STANDARD:
        return STILL, standard_dh(angles[0], lengths[0], angles[1], lengths[1])
    return modified_dh(angles[0], lengths[0], angles[1], lengths[1]), STILL


def _travel(toml: MachineToml, section: str, row: Document, linear: bool) -> dict[str, float]:
    """Limits, speed and place of a joint, SI; every joint has both limits, so that none is without them by mistake."""
    unit, other = ("mm", "deg") if linear else ("deg", "mm")
    if strange := [key for key in row if key in (*(f"{k}_{other}" for k in ENDS), f"speed_{other}_per_s")]:
        kind = "linear" if linear else "rotary"
        raise toml.fault(section, strange[0], f": the axis is {kind}", expected=strange[0].replace(other, unit))
    for side in ("min", "max"):
        if f"{side}_{unit}" not in row:
            expected = f"its limit in {unit}; {'-' if side == 'min' else ''}inf where it has none"
            raise toml.fault(section, f"{side}_{unit}", " is missing", expected)
    low, high = row[f"min_{unit}"], row[f"max_{unit}"]
    stands = row.get(f"stands_{unit}", float(np.clip(0.0, low, high)))
    if not low < high:
        raise toml.fault(section, f"max_{unit}", f" = {high:g}", expected=f"more than min_{unit} = {low:g}")
    if not low <= stands <= high:
        raise toml.fault(
            section, f"stands_{unit}", f" = {stands:g}", expected=f"{low:g} to {high:g}, as its limits are"
        )
    figures = {"low": low, "high": high, "stands": stands, "speed": row.get(f"speed_{unit}_per_s", np.inf)}
    return {name: UNITS[unit](value) for name, value in figures.items()}


def _check_units(toml: MachineToml, joints: Sequence[ChainJoint]) -> None:
    """Refuse limits most likely written in radians."""
    ends = [abs(np.rad2deg(end)) for joint in joints if not joint.linear for end in (joint.low, joint.high)]
    if ends and max(ends) < RADIANS and max(ends) > 0.0:
        mistake = f": no rotary axis turns by more than {max(ends):.4g} deg; are these radians?"
        raise toml.fault("axis[1]", "max_deg", mistake, expected="degrees")


def _tip(toml: MachineToml, tool: Document) -> FixedFrame:
    """Placement of the tip in the flange; its axes by two columns, the third checked if given."""
    given = {name: tool[name] for name in ("x_axis", "y_axis", "z_axis") if name in tool}
    if not given:
        return FixedFrame(np.eye(3), m_from_mm(tool["tip_mm"]))
    if "x_axis" not in given or "z_axis" not in given:
        raise toml.fault("tool", next(iter(given)), " is given alone", expected="x_axis and z_axis")
    y = given.get("y_axis", np.cross(given["z_axis"], given["x_axis"]))
    axes = np.column_stack([given["x_axis"], y, given["z_axis"]])
    if np.abs(axes.T @ axes - np.eye(3)).max() > WRITTEN:
        raise toml.fault("tool", "x_axis", ": the axes are not square, or no unit vectors", expected="a frame")
    if np.linalg.det(axes) < 0.0:
        raise toml.fault("tool", "y_axis", ": the frame is mirrored", expected="a right-handed frame, y = z cross x")
    return FixedFrame(beam_axes(axes[:, 0], axes[:, 2]), m_from_mm(tool["tip_mm"]))


def _rows_of_mill(toml: MachineToml, values: Sections) -> list[Document]:
    """`[[axis]]` rows of X, Y, Z from limits, on the work's side if an element moves against one; also a trunnion's."""
    convention = values[""].get("convention")
    if convention not in (None, XYZAC, XYZBC):
        raise toml.fault("", "convention", f" = {convention!r}", expected=f"{XYZAC!r}, {XYZBC!r}, or [[axis]] rows")
    turning = {XYZAC: "AC", XYZBC: "BC"}.get(str(convention), "")
    if foreign := [key for key in values.get("limits", {}) if key[0] not in f"XYZ{turning}"]:
        expected = f"limits of {', '.join(f'XYZ{turning}')}"
        raise toml.fault("limits", foreign[0], ": there is no such axis", expected=expected)
    moved = [name for row in read_rows(toml, "element", ELEMENT) for name in row.get("moves_with", ())]
    side = {axis: "work" if f"-{axis}" in moved else "tool" for axis in "XYZ"}
    rows: list[Document] = []
    # The axis with which most elements move is nearest the base; rows keep to a side, so one order serves both.
    for axis in sorted("XYZ", key=lambda axis: -moved.count(axis) - moved.count(f"-{axis}")):
        direction = np.eye(3)["XYZ".index(axis)] * (1.0 if side[axis] == "tool" else -1.0)
        row = {"name": axis, "type": "linear", "side": side[axis], "axis": direction}
        rows.append({**row, **_ends(toml, values, axis)})
    if convention is None:
        return rows
    letter, idle = turning[0], {"A": "x_offset_mm", "B": "y_offset_mm"}[turning[0]]
    trunnion = values.get("trunnion")
    if trunnion is None:
        raise toml.fault("", "convention", f" = {convention!r}: section [trunnion] is missing", ", ".join(TRUNNION))
    if trunnion.get(idle):
        mistake = f" = {trunnion[idle]:g}"
        raise toml.fault("trunnion", idle, mistake, expected=f"none: {convention} has no such offset")
    if "work" in side.values():
        raise toml.fault("limits", "X_mm", ": an element moves against an axis", "X, Y, Z on the tool's side")
    # C on A or B: X = r + o + Rx(A) (Rz(C) (p - r) - o) (xyzac-trt-kins(9), xyzbc-trt-kins(9)).
    point, offset = (np.array([trunnion.get(key, 0.0) for key in TRUNNION[i : i + 3]]) for i in (0, 3))
    values["work"] = {"xyz_mm": -point}
    for name, place, axis in ((letter, point + offset, np.eye(3)["AB".index(letter)]), ("C", -offset, np.eye(3)[2])):
        row = {"name": name, "type": "rotary", "side": "work", "xyz_mm": place, "axis": axis}
        rows.append({**row, **_ends(toml, values, name)})
    return rows


def _ends(toml: MachineToml, values: Sections, axis: str) -> Document:
    """Keys of the limits of a mill's axis; a rotary axis without limits turns endlessly."""
    unit = "mm" if axis in "XYZ" else "deg"
    ends = values.get("limits", {}).get(f"{axis}_{unit}", None if unit == "mm" else np.array([-np.inf, np.inf]))
    if ends is None:
        raise toml.fault("limits", f"{axis}_mm", " is missing", expected="[min, max] in mm; or [[axis]] rows")
    if not ends[0] < ends[1]:
        raise toml.fault("limits", f"{axis}_{unit}", f" = {ends.tolist()}", expected="min below max")
    return {f"min_{unit}": float(ends[0]), f"max_{unit}": float(ends[1])}


def _check_solvable(toml: MachineToml, machine: Serial) -> None:
    """Refuse machines other than three linear axes that span space with up to two named rotary ones, or six joints."""
    linear = [joint.name for joint in machine.joints if joint.linear]
    rotary = [joint.name for joint in machine.joints if not joint.linear]
    expected = "three linear axes and up to two rotary ones, or six joints"
    if (axes := machine.rotary_axes) is None:
        if len(machine.tool_joints) < 6:
            raise toml.fault("", "axis", f": {len(linear)} linear and {len(rotary)} rotary axes", expected)
        return
    if strange := [name for name in rotary if name not in LETTERS]:
        raise toml.fault("", "axis", f": rotary axis {strange[0]!r}", expected="A, B or C, as programs call it")
    if len(axes.axes) == 2 and np.linalg.norm(np.cross(*axes.axes)) < PARALLEL:
        raise toml.fault("", "axis", f": {' and '.join(rotary)} turn about the same direction", expected)
    volume = float(np.linalg.det([machine.motion_at_zero(name) for name in sorted(linear)]))
    if abs(volume) < PARALLEL:
        raise toml.fault("", "axis", f": {', '.join(linear)} do not reach all places", expected)
    if volume < 0.0 and sorted(linear) == ["X", "Y", "Z"]:
        raise toml.fault("", "axis", ": X, Y, Z are mirrored (left-handed)", expected="a right-handed frame")
