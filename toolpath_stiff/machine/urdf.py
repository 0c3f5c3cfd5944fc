"""Chains of URDF files (wiki.ros.org/urdf/XML): joints from the root link to a tip link; m and rad."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from contextlib import suppress
from xml.parsers import expat

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.chain import STILL, FixedFrame, placement
from toolpath_stiff.machine.unfilled import JOINTS, SPINDLE, axis_row, file_text, place_keys, section, tool_section
from toolpath_stiff.units import deg_from_rad, mm_from_m

Fault = Callable[..., InputError]
FARTHEST = 100.0  # m between two joints: more are millimetres
MOST_TURNS = 4.0 * np.pi + 0.1  # rad, of a limit: more are degrees
MOVING = {"revolute": False, "continuous": False, "prismatic": True}


def machine_from_urdf(text: str, tip: str, file: str) -> tuple[str, list[str]]:
    """A machine file and notes, from the text of a URDF file, with the tool at the link `tip`.

    Raises `InputError` for what is no chain, limits that are missing, and units that cannot be.
    """

    def fault(mistake: str, expected: str = "", hint: str = "", at: ET.Element | None = None) -> InputError:
        line = None if at is None else lines[at]
        return InputError(mistake, expected=expected, hint=hint, file=file, line=line)

    macros = ("not a plain URDF", "XML without entities and macros", "run xacro over it first")
    if "<!ENTITY" in text:
        raise fault(*macros)
    try:
        robot, lines = _parsed(text)
    except expat.ExpatError as error:
        raise InputError(f"not XML: {expat.ErrorString(error.code)}", file=file, line=error.lineno) from None
    if robot.tag != "robot":
        raise fault(f"<{robot.tag}>", "<robot>", at=robot)
    for element in robot.iter():
        if "}" in element.tag or any("${" in value for value in element.attrib.values()):  # xacro's
            raise fault(*macros, at=element)
    chain = _chain(robot, tip, fault)
    rows, rest, notes, masses, frame = [], STILL, [], [], ""
    inertias = {link.get("name"): inertia for link in robot.iter("link") for inertia in link.findall("inertial")}
    for joint in chain:
        name, kind = joint.get("name", "?"), joint.get("type", "")
        rest = rest.then(_origin(joint, fault))
        if kind not in ("fixed", *MOVING):
            raise fault(f"joint {name} is {kind}", expected=f"fixed, {', '.join(MOVING)}", at=joint)
        if kind != "fixed":
            rows.append(_row(joint, name, kind, rest, fault))
            rest, frame = STILL, name
            if joint.find("mimic") is not None:
                notes.append(f"joint {name} follows another one (mimic); here it moves by itself")
        link = joint.find("child").get("link", "")  # type: ignore[union-attr]
        inertia = inertias.get(link, ET.Element("none"))
        mass = _number(inertia.find("mass"), "value", f"link {link}", "kg", fault)
        if frame and mass:
            centre = mm_from_m(rest.then(placement(_numbers(inertia.find("origin"), "xyz", "0 0 0", fault))).origin)
            masses.append(section("[[mass]]", {"name": link, "kg": mass, "frame": frame, "centre_mm": centre}))
    if not rows:
        raise fault("no joint moves on the way to the tip", expected="a chain of joints")
    notes.insert(0, f"Made from {file}: {len(rows)} joints; limits of effort are left out.")
    if not rest.axes[:, 2] @ rest.origin < 0.0:
        notes.append(f"z of {tip} does not run back to the arm, as that of a tool's tip does: turn it in [tool]")
    name = robot.get("name", "robot")
    return file_text(
        name, "serial", f"URDF {file}", notes, [*rows, tool_section(rest), JOINTS, SPINDLE, *masses]
    ), notes


def _parsed(text: str) -> tuple[ET.Element, dict[ET.Element, int]]:
    """Root of the tree, and the line of each element."""
    builder, lines, parser = ET.TreeBuilder(), {}, expat.ParserCreate(namespace_separator="}")

    def start(tag: str, attributes: dict[str, str]) -> None:
        lines[builder.start(tag, attributes)] = parser.CurrentLineNumber

    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    parser.Parse(text, True)
    return builder.close(), lines


def _chain(robot: ET.Element, tip: str, fault: Fault) -> list[ET.Element]:
    """Joints from the root link to the tip."""
    above: dict[str, ET.Element] = {}
    named: dict[tuple[str, str], ET.Element] = {}
    for element in (*robot.findall("link"), *robot.findall("joint")):  # others, of plug-ins, lie deeper
        if named.setdefault((element.tag, name := element.get("name", "")), element) is not element or not name:
            raise fault(f"{element.tag} {name!r} is there twice", expected="a name of its own", at=element)
    for joint in robot.findall("joint"):
        name = joint.get("name", "")
        for role in ("parent", "child"):
            end = joint.find(role)
            link = "" if end is None else end.get("link", "")
            if ("link", link) not in named:
                raise fault(f"joint {name}: no link {link!r}, its {role}", expected="<link> in the file", at=joint)
        if link in above:
            mistake = f"link {link} hangs on the joints {above[link].get('name')} and {name}: a loop"
            raise fault(mistake, expected="a tree: each link on one joint", at=joint)
        above[link] = joint
    if tip not in above:
        parents = {joint.find("parent").get("link") for joint in above.values()}  # type: ignore[union-attr]
        ends = " or ".join(sorted(set(above) - parents))
        raise fault(f"no link {tip} that hangs on a joint", expected=f"--tip {ends}")
    chain: list[ET.Element] = []
    while tip in above:
        if above[tip] in chain:
            mistake = f"joint {above[tip].get('name')} leads back to itself: a loop"
            raise fault(mistake, expected="a tree", at=above[tip])
        chain.insert(0, above[tip])
        tip = above[tip].find("parent").get("link", "")  # type: ignore[union-attr]
    return chain


def _row(joint: ET.Element, name: str, kind: str, rest: FixedFrame, fault: Fault) -> str:
    """`[[axis]]` of a joint that moves."""
    axis, linear = _numbers(joint.find("axis"), "xyz", "1 0 0", fault), MOVING[kind]
    if not np.linalg.norm(axis) > 0.0:
        raise fault(f"joint {name}: axis 0 0 0", expected="a direction", at=joint.find("axis"))
    speed = _number(joint.find("limit"), "velocity", f"joint {name}", "m/s or rad/s", fault)
    key, value = ("speed_mm_per_s", mm_from_m(speed)) if linear else ("speed_deg_per_s", deg_from_rad(speed))
    place = place_keys(rest, axis / np.linalg.norm(axis))
    return axis_row(name, linear, {**place, **({key: value} if speed else {})}, _limits(joint, name, kind, fault))


def _number(element: ET.Element | None, key: str, where: str, unit: str, fault: Fault) -> float:
    """A number of 0 or more; 0 if there is none."""
    word, (number, *_) = _words(element, key, "0", 1)
    if not 0.0 <= number < np.inf:
        raise fault(f'{where}: {key}="{word}"', expected=f"a number, {unit}", at=element)
    return number


def _numbers(element: ET.Element | None, key: str, default: str, fault: Fault) -> FloatArray:
    text, values = _words(element, key, default, 3)
    if not np.isfinite(values).all():
        raise fault(f'{key}="{text}"', expected="three numbers", at=element)
    return np.array(values)


def _words(element: ET.Element | None, key: str, default: str, count: int) -> tuple[str, list[float]]:
    """An attribute, and the `count` numbers in it; nan if it does not hold these."""
    text = default if element is None else element.get(key, default)
    with suppress(ValueError):
        values = [float(word) for word in text.split()]
        if len(values) == count:
            return text, values
    return text, [np.nan] * count


def _origin(joint: ET.Element, fault: Fault) -> FixedFrame:
    place = [_numbers(joint.find("origin"), key, "0 0 0", fault) for key in ("xyz", "rpy")]
    if np.abs(place[0]).max() > FARTHEST or np.abs(place[1]).max() > MOST_TURNS:
        mistake = f"joint {joint.get('name')}: origin {place[0].tolist()}, rpy {place[1].tolist()}"
        raise fault(mistake, "metres and radians", "these look like mm or degrees", at=joint.find("origin"))
    return placement(*place)


def _limits(joint: ET.Element, name: str, kind: str, fault: Fault) -> FloatArray:
    if kind == "continuous":
        return np.array([-np.inf, np.inf])
    limit = joint.find("limit")
    ends = np.array([_words(limit, key, "nan", 1)[1][0] for key in ("lower", "upper")])
    if not ends[0] < ends[1]:
        found = f"joint {name} has no limits" if np.isnan(ends).any() else f"joint {name}: limits {ends.tolist()}"
        expected = '<limit lower="..." upper="..."/>, lower below upper'
        raise fault(found, expected, at=joint if limit is None else limit)
    if np.abs(ends).max() > (FARTHEST if kind == "prismatic" else MOST_TURNS):
        raise fault(f"joint {name}: limits {ends.tolist()}", "radians or metres, not degrees or mm", at=limit)
    return ends
