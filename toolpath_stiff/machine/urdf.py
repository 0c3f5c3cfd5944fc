"""Chains of URDF files (wiki.ros.org/urdf/XML): joints from the root link to a tip link; m and rad."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.chain import STILL, FixedFrame, placement
from toolpath_stiff.machine.unfilled import JOINTS, SPINDLE, axis_row, file_text, place_keys, tool_section
from toolpath_stiff.units import deg_from_rad, mm_from_m

Fault = Callable[..., InputError]
FARTHEST = 100.0  # m between two joints: more are millimetres
MOST_TURNS = 4.0 * np.pi + 0.1  # rad, of a limit: more are degrees
MOVING = {"revolute": False, "continuous": False, "prismatic": True}


def machine_from_urdf(text: str, tip: str, file: str) -> tuple[str, list[str]]:
    """A machine file and notes from the text of a URDF file, with the tool at the link `tip`.

    Raises `InputError` for what is no chain, limits that are missing, and units that cannot be.
    """

    def fault(mistake: str, expected: str = "", hint: str = "") -> InputError:
        return InputError(mistake, expected=expected, hint=hint, file=file)

    if "<!ENTITY" in text or "xacro:" in text:
        raise fault("not a plain URDF", expected="XML without entities and macros", hint="run xacro over it first")
    try:
        robot = ET.fromstring(text)
    except ET.ParseError as error:
        raise InputError(f"not XML: {error.msg}", file=file, line=error.position[0]) from None
    above: dict[str, ET.Element] = {}
    for joint in robot.iter("joint"):
        if (child := joint.find("child")) is None or joint.find("parent") is None:
            continue  # of a transmission or a plug-in
        link = child.get("link", "")
        if link in above:
            mistake = f"link {link} hangs on the joints {above[link].get('name')} and {joint.get('name')}: a loop"
            raise fault(mistake, expected="a tree: each link on one joint")
        above[link] = joint
    if tip not in above:
        parents = {joint.find("parent").get("link") for joint in above.values()}  # type: ignore[union-attr]
        ends = " or ".join(sorted(set(above) - parents))
        raise fault(f"no link {tip} that hangs on a joint", expected=f"--tip {ends}")
    chain: list[ET.Element] = []
    while tip in above:
        if above[tip] in chain:
            raise fault(f"joint {above[tip].get('name')} leads back to itself: a loop", expected="a tree")
        chain.insert(0, above[tip])
        tip = above[tip].find("parent").get("link", "")  # type: ignore[union-attr]
    rows, rest, notes = [], STILL, []
    for joint in chain:
        name, kind = joint.get("name", "?"), joint.get("type", "")
        rest = rest.then(_origin(joint, fault))
        if kind == "fixed":
            continue
        if kind not in MOVING:
            raise fault(f"joint {name} is {kind}", expected=f"fixed, {', '.join(MOVING)}")
        if joint.find("mimic") is not None:
            notes.append(f"joint {name} follows another one (mimic); here it moves by itself")
        axis = _numbers(joint.find("axis"), "xyz", [1.0, 0.0, 0.0], fault)
        if not np.linalg.norm(axis) > 0.0:
            raise fault(f"joint {name}: axis 0 0 0", expected="a direction")
        limits, place = _limits(joint, name, kind, fault), place_keys(rest, axis / np.linalg.norm(axis))
        rows.append(axis_row(name, MOVING[kind], {**place, **_speed(joint, name, MOVING[kind], fault)}, limits))
        rest = STILL
    if not rows:
        raise fault("no joint moves on the way to the tip", expected="a chain of joints")
    notes.insert(0, f"Made from {file}: {len(rows)} joints from link {tip}; masses and limits of effort are left out.")
    name = robot.get("name", "robot")
    return file_text(name, "serial", f"URDF {file}", notes, [*rows, tool_section(rest), JOINTS, SPINDLE]), notes


def _numbers(element: ET.Element | None, key: str, default: list[float], fault: Fault) -> FloatArray:
    text = None if element is None else element.get(key)
    try:
        values = np.array(default if text is None else [float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise fault(f'{key}="{text}"', expected="three numbers")
    return values


def _origin(joint: ET.Element, fault: Fault) -> FixedFrame:
    place = [_numbers(joint.find("origin"), key, [0.0] * 3, fault) for key in ("xyz", "rpy")]
    if np.abs(place[0]).max() > FARTHEST or np.abs(place[1]).max() > MOST_TURNS:
        mistake = f"joint {joint.get('name')}: origin {place[0].tolist()}, rpy {place[1].tolist()}"
        raise fault(mistake, expected="metres and radians", hint="these look like mm or degrees")
    return placement(*place)


def _speed(joint: ET.Element, name: str, linear: bool, fault: Fault) -> Document:
    """The key of the speed that a joint reaches; none where the file has none, or 0."""
    limit = joint.find("limit")
    word = "0" if limit is None else limit.get("velocity", "0")
    try:
        speed = float(word)
    except ValueError:
        speed = np.nan
    if not 0.0 <= speed < np.inf:
        raise fault(f'joint {name}: velocity="{word}"', expected="a number, m/s or rad/s")
    return (
        {("speed_mm_per_s" if linear else "speed_deg_per_s"): (mm_from_m if linear else deg_from_rad)(speed)}
        if speed
        else {}
    )


def _limits(joint: ET.Element, name: str, kind: str, fault: Fault) -> FloatArray:
    if kind == "continuous":
        return np.array([-np.inf, np.inf])
    limit = joint.find("limit")
    try:
        ends = np.array([float(limit.get(key, "nan")) for key in ("lower", "upper")])  # type: ignore[union-attr]
    except (AttributeError, ValueError):
        ends = np.full(2, np.nan)
    if not ends[0] < ends[1]:
        raise fault(f"joint {name} has no limits", expected='<limit lower="..." upper="..."/>, lower below upper')
    if np.abs(ends).max() > (FARTHEST if kind == "prismatic" else MOST_TURNS):
        raise fault(f"joint {name}: limits {ends.tolist()}", expected="radians or metres, not degrees or mm")
    return ends
