"""Machines of FreeCAD (.fcm, JSON): axes with role, parent, joint, limits (its Mod/CAM/Machine/models/machine.py)."""

import json
from collections.abc import Callable, Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.chain import FixedFrame
from toolpath_stiff.machine.unfilled import SPINDLE, axis_row, carriages, file_text, place_keys
from toolpath_stiff.units import MM_PER_INCH, m_from_mm, rad_from_deg

Fault = Callable[..., InputError]
UNITS = {"metric": 1.0, "imperial": MM_PER_INCH}


def machine_from_fcm(text: str, order: Sequence[str], file: str) -> tuple[str, list[str]]:
    """A machine file and notes, from the text of a FreeCAD machine; `order`: axes from the base, if it states none.

    Raises `InputError` for what is no machine, a missing order of axes, and mirrored axes.
    """

    def fault(mistake: str, expected: str = "", hint: str = "") -> InputError:
        return InputError(mistake, expected=expected, hint=hint, file=file)

    try:
        machine = json.loads(text)["machine"]
        axes: dict[str, Document] = machine["axes"]
        scale = UNITS[machine.get("units", "metric")]
        joints = {name: _joint(axis) for name, axis in axes.items()}
        ends = {name: np.array([axis["limits"][key] for key in ("min", "max")], float) for name, axis in axes.items()}
        roles = {name: str(axis["role"]) for name, axis in axes.items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        expected = "machine.axes.NAME with role, joint and limits; units metric or imperial"
        raise fault(f"not a FreeCAD machine: {error}", expected) from None
    for name, (origin, direction) in joints.items():
        if not (np.shape(origin) == np.shape(direction) == (3,) and np.linalg.norm(direction) > 0.0):
            raise fault(f"axis {name}: joint {axes[name]['joint']}", "an origin and a direction, three numbers each")
        if axes[name].get("type") not in ("linear", "rotary"):
            raise fault(f"axis {name} has the type {axes[name].get('type')!r}", expected="linear or rotary")
    linear = [joints[name][1] for name in "XYZ" if name in joints]
    if len(linear) == 3 and np.linalg.det(np.array(linear)) < 0.0:
        raise fault("axes X, Y, Z are mirrored (left-handed)", expected="a right-handed frame")
    for name, (low, high) in ends.items():
        if not roles[name].startswith(("head", "table")):
            raise fault(f"axis {name} has the role {roles[name]!r}", expected="table_... or head_...")
        if not low < high:
            raise fault(f"axis {name}: limits {low:g} to {high:g}", expected="min below max")
    notes = [
        f"Made from {file}: origins of joints are those with all axes at 0; velocities are left out.",
        "A positive value of a table's axis is taken to move the work against that axis (ISO 841): check the signs.",
    ]
    parts, sides = [], []
    for role in ("head", "table"):
        names = _in_order({n: axis for n, axis in axes.items() if roles[n].startswith(role)}, order, fault)
        side, before = {"head": "tool", "table": "work"}[role], np.zeros(3)
        for name in names:
            (origin, axis), sort = joints[name], axes[name]["type"]
            place = FixedFrame(np.eye(3), m_from_mm(scale * (origin - before)))
            bounds = m_from_mm(scale * ends[name]) if sort == "linear" else rad_from_deg(ends[name])
            towards = -axis if side == "work" else axis  # a table moves against the programmed axis
            parts.append(axis_row(name, sort == "linear", place_keys(place, towards), bounds, side))
            sides.append((name, side))
            before = origin
    name = str(machine.get("name") or "mill")
    return file_text(name, "serial", f"FreeCAD {file}", notes, [*parts, *carriages(sides), SPINDLE]), notes


def _joint(axis: Document) -> tuple[FloatArray, FloatArray]:
    joint = axis["joint"]
    origin, direction = (joint["origin"], joint["axis"]) if isinstance(joint, dict) else joint
    if not isinstance(joint, dict) and not np.any(direction):
        origin, direction = direction, origin  # older files of linear axes
    vector = np.array(direction, dtype=float)
    return np.array(origin, dtype=float), vector / (np.linalg.norm(vector) or 1.0)


def _in_order(axes: dict[str, Document], order: Sequence[str], fault: Fault) -> list[str]:
    """Names from the base outwards, by parents, otherwise by --order."""
    if len(axes) < 2:
        return list(axes)
    depth = {}
    for name, axis in axes.items():
        seen, parent = [name], axis.get("parent")
        while parent in axes and parent not in seen:
            seen.append(parent)
            parent = axes[parent].get("parent")
        depth[name] = len(seen)
    if sorted(depth.values()) == list(range(1, len(axes) + 1)):
        return sorted(axes, key=depth.__getitem__)
    if not set(axes) <= set(order):
        mistake = f"the file does not say which of {', '.join(axes)} carries which"
        raise fault(mistake, hint=f"give them from the base outwards: --order {','.join(axes)}, say")
    return sorted(axes, key=list(order).index)
