"""Files of serial machines: joints by Denavit-Hartenberg rows, by origin and axis, or a mill's axes by their limits."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.chain import (
    STILL,
    ChainJoint,
    Placement,
    aligned,
    modified_dh,
    placement,
    standard_dh,
)
from toolpath_stiff.machine.common_sections import common_fields
from toolpath_stiff.machine.schema import NAMES, SETUP, Key, MachineToml, Sections, read_rows, read_sections
from toolpath_stiff.machine.serial import Serial
from toolpath_stiff.machine.serial_elements import ELEMENT, read_bodies
from toolpath_stiff.units import m_from_mm, rad_from_deg

MODIFIED, STANDARD, XYZAC, XYZBC = "modified DH", "standard DH", "linuxcnc xyzac-trt-kins", "linuxcnc xyzbc-trt-kins"
LENGTH, ANGLE = Key(unit="mm", required=False), Key(unit="deg", required=False, low=-3600.0, high=3600.0)
POINT, DIRECTION = Key(unit="mm", shape=(3,), required=False), Key(shape=(3,), low=-1.0, high=1.0, required=False)
TEXT = Key(text=True, required=False)
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
        f"{side}_{unit}": Key(unit=unit, required=False, infinite=True, low=-np.inf, high=np.inf)
        for side in ("min", "max")
        for unit in ("mm", "deg")
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
    "pose[]": {},
}
SECTIONS_BESIDE = [name for name in SCHEMA if name]
# Limits of all rotary axes within a turn of 2 pi: such degrees are radians. Angles of a row that are multiples of a
# right angle in radians, to the digits that people write.
RADIANS, RIGHT_ANGLE, WRITTEN = 6.29, np.pi / 2.0, 1e-3
SHORTEST_ARM = 0.05  # m from the first joint to the tip: less is a description in metres


def read(toml: MachineToml) -> Serial:
    """A serial machine of a machine file. Raises `InputError`."""
    values = read_sections(toml, SCHEMA, SECTIONS_BESIDE, stated=False)
    names = ["X", "Y", "Z", "A", "B", "C"]
    if rows := read_rows(toml, "axis", AXIS):
        names = [row["name"] for row in rows]
        tool, work, tip, table = _of_rows(toml, rows, values)
    else:
        tool, work, tip, table = _of_mill(toml, values)
    bodies = read_bodies(toml, (tool, work), (tip, table))
    if not any(bodies):
        raise InputError("no [[element]]: nothing gives way", expected="springs, joints or beams", file=toml.file)
    machine = Serial(
        **common_fields(toml, values),
        reference_tool_length=m_from_mm(values.get("reference_tool", {}).get("length_mm", np.nan)),
        tool_joints=tool,
        work_joints=work,
        order=tuple(int(i) for i in np.argsort([names.index(joint.name) for joint in (*tool, *work)])),
        tip=tip,
        work=table,
        tool_bodies=bodies[0],
        work_bodies=bodies[1],
        least={name: v for name, v in values.get("singularity", {}).items() if isinstance(v, float)},
    )
    _check_solvable(toml, machine)
    return machine


def _of_rows(
    toml: MachineToml, rows: Sequence[Document], values: Sections
) -> tuple[tuple[ChainJoint, ...], tuple[ChainJoint, ...], Placement, Placement]:
    """Joints of tool and work, the tip in the last frame of the one, the work in that of the other."""
    convention = values[""].get("convention", MODIFIED)
    if convention not in (MODIFIED, STANDARD):
        raise toml.fault("", "convention", f" = {convention!r}", expected=f"{MODIFIED!r} or {STANDARD!r}")
    for section in ("trunnion", "limits"):
        if section in values:
            raise toml.fault(section, "", ": the file has [[axis]] rows", expected="limits and places of axes there")
    sides: dict[str, list[ChainJoint]] = {"tool": [], "work": []}
    rests = {"tool": STILL, "work": STILL}  # what follows the last joint of each side
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
        sides[side].append(ChainJoint(row["name"], linear, place, *_bounds(toml, section, row, linear), given))
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


def _placements(toml: MachineToml, section: str, row: Document, convention: str) -> tuple[Placement, Placement]:
    """What stands between the joint before and this one, and what follows this one."""
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


def _bounds(toml: MachineToml, section: str, row: Document, linear: bool) -> tuple[float, float]:
    """M or rad; every joint has both, so that none is without limits by mistake."""
    unit, other = ("mm", "deg") if linear else ("deg", "mm")
    for side in ("min", "max"):
        if f"{side}_{other}" in row:
            kind = "linear" if linear else "rotary"
            raise toml.fault(section, f"{side}_{other}", f": the axis is {kind}", expected=f"{side}_{unit}")
        if f"{side}_{unit}" not in row:
            expected = f"its limit in {unit}; {'-' if side == 'min' else ''}inf where it has none"
            raise toml.fault(section, f"{side}_{unit}", " is missing", expected)
    low, high = row[f"min_{unit}"], row[f"max_{unit}"]
    if not low < high:
        raise toml.fault(section, f"max_{unit}", f" = {high:g}", expected=f"more than min_{unit} = {low:g}")
    return (m_from_mm(low), m_from_mm(high)) if linear else (rad_from_deg(low), rad_from_deg(high))


def _check_units(toml: MachineToml, joints: Sequence[ChainJoint]) -> None:
    """Refuse what is most likely written in radians, and linear axes X, Y, Z that are left-handed."""
    ends = [abs(np.rad2deg(end)) for joint in joints if not joint.linear for end in (joint.low, joint.high)]
    if ends and max(ends) < RADIANS and max(ends) > 0.0:
        mistake = f": no rotary axis turns by more than {max(ends):.4g} deg; are these radians?"
        raise toml.fault("axis[1]", "max_deg", mistake, expected="degrees")


def _tip(toml: MachineToml, tool: Document) -> Placement:
    """The tip in the flange; its axes by two columns, the third checked if it is there."""
    names = [name for name in ("x_axis", "y_axis", "z_axis") if name in tool]
    if not names:
        return Placement(np.eye(3), m_from_mm(tool["tip_mm"]))
    if len(names) == 1:
        raise toml.fault("tool", names[0], " is given alone", expected="x_axis and z_axis")
    for name in names:
        length = float(np.linalg.norm(tool[name]))
        if not 0.999 < length < 1.001:
            raise toml.fault("tool", name, f" has the length {length:.4g}", expected="a unit vector")
    given = {name: tool[name] / np.linalg.norm(tool[name]) for name in names}
    for first, second in zip(names, names[1:] + names[:1], strict=True):
        if abs(float(given[first] @ given[second])) > 1e-3 and first != second:
            raise toml.fault("tool", second, f" is not square to {first}", expected="axes square to each other")
    x = given.get("x_axis", np.cross(given.get("y_axis", np.zeros(3)), given.get("z_axis", np.zeros(3))))
    z = given.get("z_axis", np.cross(x, given.get("y_axis", np.zeros(3))))
    y = np.cross(z, x)
    if len(names) == 3 and float(y @ given["y_axis"]) < 0.0:
        raise toml.fault("tool", "y_axis", ": the frame is mirrored", expected="a right-handed frame, y = z cross x")
    return Placement(np.column_stack([x, y, z]), m_from_mm(tool["tip_mm"]))


def _of_mill(
    toml: MachineToml, values: Sections
) -> tuple[tuple[ChainJoint, ...], tuple[ChainJoint, ...], Placement, Placement]:
    """Axes X, Y, Z by their limits: on the work's side where an element moves against one; a trunnion of two more."""
    limits, convention = values.get("limits", {}), values[""].get("convention")
    moved = [(row.get("side"), row.get("moves_with", ())) for row in read_rows(toml, "element", ELEMENT)]
    against = {name[1:] for _, names in moved for name in names if name.startswith("-")}
    joints = {}
    for i, axis in enumerate("XYZ"):
        key = f"{axis}_mm"
        if key not in limits:
            raise toml.fault("limits", key, " is missing", expected="[min, max] in mm; or [[axis]] rows")
        low, high = m_from_mm(limits[key])
        if not low < high:
            raise toml.fault("limits", key, f" = [{1e3 * low:g}, {1e3 * high:g}]", expected="min below max")
        direction = np.eye(3)[i] * (-1.0 if axis in against else 1.0)
        joints[axis] = (direction, float(low), float(high))
    # In the order in which elements say that they move with them: the axis of the most elements is nearest the base.
    carried = {axis: sum(axis in [name.strip("-") for name in names] for _, names in moved) for axis in "XYZ"}
    order = sorted("XYZ", key=lambda axis: -carried[axis])
    chains = [
        _square_chain([(axis, True, *joints[axis]) for axis in order if (axis in against) == of_work], np.zeros(3))
        for of_work in (False, True)
    ]
    tool, work = chains
    if convention is None:
        return tool, work, _home(tool).inverse(), _home(work).inverse()
    return tool, *_trunnion(toml, values, convention, work, _home(tool).inverse())


def _square_chain(
    rows: Sequence[tuple[str, bool, FloatArray, float, float]], start: FloatArray
) -> tuple[ChainJoint, ...]:
    """Joints along or about machine axes: name, whether linear, direction, limits."""
    joints, rest = [], Placement(np.eye(3), start)
    for name, linear, direction, low, high in rows:
        turn = aligned(direction)
        joints.append(ChainJoint(name, linear, rest.then(turn), low, high))
        rest = turn.inverse()
    return tuple(joints)


def _home(joints: Sequence[ChainJoint]) -> Placement:
    """The last frame at joint values of 0."""
    home = STILL
    for joint in joints:
        home = home.then(joint.place)
    return home


def _trunnion(
    toml: MachineToml, values: Sections, convention: str, work: tuple[ChainJoint, ...], tip: Placement
) -> tuple[tuple[ChainJoint, ...], Placement, Placement]:
    """C on A or B on the base: X = r + o + Rx(A) (Rz(C) (p - r) - o) (xyzac-trt-kins(9), xyzbc-trt-kins(9))."""
    names = {XYZAC: "A", XYZBC: "B"}
    if convention not in names:
        raise toml.fault("", "convention", f" = {convention!r}", expected=f"{XYZAC!r}, {XYZBC!r}, or [[axis]] rows")
    if work:
        raise toml.fault("limits", f"{work[0].name}_mm", ": an element moves against it", "X, Y, Z on the tool's side")
    trunnion, limits = values.get("trunnion"), values.get("limits", {})
    if trunnion is None:
        raise toml.fault("", "convention", f" = {convention!r}: section [trunnion] is missing", ", ".join(TRUNNION))
    letter = names[convention]
    for key in ("x_offset_mm",) if letter == "A" else ("y_offset_mm",):
        if trunnion.get(key):
            raise toml.fault(
                "trunnion", key, f" = {trunnion[key]:g}", expected=f"none: {convention} has no such offset"
            )
    if (letter == "A" and "B_deg" in limits) or (letter == "B" and "A_deg" in limits):
        raise toml.fault("limits", "B_deg" if letter == "A" else "A_deg", f": the machine turns {letter} and C")
    point, offset = (m_from_mm(np.array([trunnion.get(key, 0.0) for key in TRUNNION[i : i + 3]])) for i in (0, 3))
    axis = np.eye(3)["AB".index(letter)]
    bounds = {name: rad_from_deg(limits.get(f"{name}_deg", np.array([-np.inf, np.inf]))) for name in (letter, "C")}
    for name, (low, high) in bounds.items():
        if not low < high:
            raise toml.fault("limits", f"{name}_deg", ": min is not below max", expected="min below max")
    first = aligned(axis)
    places = Placement(np.eye(3), point + offset).then(first), first.inverse().then(Placement(np.eye(3), -offset))
    joints = tuple(
        ChainJoint(name, False, place, float(bounds[name][0]), float(bounds[name][1]))
        for name, place in zip((letter, "C"), places, strict=True)
    )
    return joints, tip, Placement(np.eye(3), -point)


def _check_solvable(toml: MachineToml, machine: Serial) -> None:
    """A pose needs three linear axes and up to two rotary ones, or six joints."""
    linear = sum(joint.linear for joint in machine.joints)
    if machine.rotary_axes is None and len(machine.tool_joints) < 6:
        mistake = f"{linear} linear and {len(machine.joints) - linear} rotary axes"
        raise toml.fault("", "axis", f": {mistake}", "three linear axes and up to two rotary ones, or six joints")
