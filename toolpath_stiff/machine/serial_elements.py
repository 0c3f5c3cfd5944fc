"""`[[element]]` of serial machines: springs, joints and beams, in the frames of the chain."""

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.bodies import Body, SpanningBeam
from toolpath_stiff.machine.chain import STILL, ChainJoint, FixedFrame
from toolpath_stiff.machine.elements import Element, beam_axes, beam_compliance, joint_element
from toolpath_stiff.machine.schema import Key, MachineToml, read_rows
from toolpath_stiff.units import m_from_mm, m_from_nm

TEXT, NAMES = Key(text=True, required=False), Key(text=True, shape=(0,), required=False)
POINT, DIRECTION = Key(unit="mm", shape=(3,), required=False), Key(shape=(3,), low=-1.0, high=1.0, required=False)
ALONG = Key(unit="nm/N", shape=(3,), low=0.0, high=1e7, required=False)
ABOUT = Key(unit="nrad/(N m)", shape=(3,), low=0.0, high=1e9, required=False)
PER_JOINT = Key(unit="nrad/(N m)", shape=(1,), many=True, or_one=True, low=0.0, high=1e9, required=False)
BEAM = ("EA_MN", "EIy_MNm2", "EIz_MNm2", "GJ_MNm2")
ELEMENT = {
    "name": Key(text=True),
    "type": Key(text=True),
    **dict.fromkeys(("side", "at", "centre", "frame", "link"), TEXT),
    **dict.fromkeys(("moves_with", "to_moves_with"), NAMES),
    **dict.fromkeys(("centre_mm", "from_mm", "to_mm"), POINT),
    **dict.fromkeys(("x_axis", "z_axis"), DIRECTION),
    "translation_nm_per_N": ALONG,
    "rotation_nrad_per_Nm": ABOUT,
    **dict.fromkeys(("torsion_nrad_per_Nm", "bending_nrad_per_Nm"), PER_JOINT),
    **dict.fromkeys(BEAM, Key(low=0.0, high=1e9, open_low=True, infinite=True, required=False)),
}
USED = {
    "spring": ("side", "at", "centre", "centre_mm", "frame", "moves_with", "x_axis", "z_axis", "translation_nm_per_N",
               "rotation_nrad_per_Nm"),
    "joint": ("torsion_nrad_per_Nm", "bending_nrad_per_Nm"),
    "beam": ("side", "frame", "from_mm", "to_mm", "moves_with", "to_moves_with", "z_axis", *BEAM),
}  # fmt: skip
MASS = {
    "name": Key(text=True),
    "kg": Key(unit="kg", low=0.0, high=1e5),
    **dict.fromkeys(("side", "frame"), TEXT),
    "moves_with": NAMES,
    "centre_mm": POINT,
}
LINKS = ("tool", "joints", "struts", "frame", "table")
Part = Body | SpanningBeam
Mass = tuple[float, int, FloatArray]  # kg, number of the frame that it moves with, (3,) m in that frame


class ElementReader:
    """Reader of rows, one by one, into `bodies` and `masses` of the tool's side and of the work's.

    Frames of each side are numbered from the base, the last one tip or work.
    """

    def __init__(self, toml: MachineToml, chains: Sequence[Sequence[ChainJoint]], ends: Sequence[FixedFrame]) -> None:
        self.toml, self.chains, self.section = toml, chains, ""
        self.bodies: tuple[list[Part], list[Part]] = ([], [])
        self.masses: tuple[list[Mass], list[Mass]] = ([], [])
        self.row: Document = {}
        self.names: set[str] = set()
        self.homes = []
        for joints, end in zip(chains, ends, strict=True):
            homes = [STILL]
            for joint in joints:
                homes.append(homes[-1].then(joint.place))
            self.homes.append([*homes, homes[-1].then(end)])

    def fault(self, key: str, mistake: str, expected: str = "") -> InputError:
        """Error at a key of the row."""
        return self.toml.fault(self.section, key, mistake, expected)

    def element(self, nth: int, row: Document) -> None:
        """Add the compliant bodies of one row."""
        self.section, self.row = f"element[{nth}]", row
        kind, side = row["type"], row.get("side", "tool")
        if row["name"] in self.names:
            raise self.fault("name", f" = {row['name']!r} is there twice")
        self.names.add(row["name"])
        if kind not in USED:
            raise self.fault("type", f" = {kind!r}", f"one of {', '.join(USED)}")
        for key in row:
            if key not in (*USED[kind], "name", "type", "link", "origin", "remark"):
                raise self.fault(key, f": a {kind} has no such key", f"one of {', '.join(USED[kind])}")
        if side not in ("tool", "work"):
            raise self.fault("side", f" = {side!r}", "tool or work")
        if row.get("link", LINKS[0]) not in LINKS:
            raise self.fault("link", f" = {row['link']!r}", f"one of {', '.join(LINKS)}")
        work = side == "work"
        if kind == "joint":
            self._joints()
        else:
            self.bodies[work].append(self._beam(work) if kind == "beam" else self._spring(work))

    def needed(self, key: str) -> FloatArray:
        """Value of a required key."""
        if key not in self.row:
            raise self.fault(key, " is missing", ELEMENT[key].expected)
        return np.asarray(self.row[key])

    def _element(self, link: str) -> Element:
        """Element named as results show it, with its link, or the file's."""
        return Element(self.row["name"].replace("_", " "), self.row.get("link", link))

    def _joints(self) -> None:
        """Add each rotary joint: torsion about its axis, and equal bending about the two others."""
        rotary = [(work, i) for work in (False, True) for i, j in enumerate(self.chains[work]) if not j.linear]
        given = {}
        for key in USED["joint"]:
            values = self.needed(key) if key.startswith("torsion") else np.asarray(self.row.get(key, 0.0))
            if values.ndim and len(values) != len(rotary):
                raise self.fault(key, f": {len(values)} numbers", f"{len(rotary)}, one a rotary joint")
            given[key] = np.broadcast_to(m_from_nm(values), (len(rotary),))
        for (work, i), torsion, bending in zip(rotary, *given.values(), strict=True):
            element = Element(joint_element(self.chains[work][i].name), self.row.get("link", "joints"))
            compliance = np.array([0.0, 0.0, 0.0, bending, bending, torsion])
            self.bodies[work].append(Body(element, i + 1, STILL, compliance))

    def _spring(self, work: bool) -> Part:
        ways = [key for key in ("at", "centre", "centre_mm") if key in self.row]
        if len(ways) != 1:
            raise self.fault("centre_mm", f": {' and '.join(ways) or 'no place'}", "one of at, centre, centre_mm")
        compliance = m_from_nm(
            np.concatenate([self.needed("translation_nm_per_N"), self.needed("rotation_nrad_per_Nm")])
        )
        homes = self.homes[work]
        if ways == ["at"]:
            places = {"base": 0, "tip": len(homes) - 1}
            if self.row["at"] not in places or work:
                raise self.fault("at", f" = {self.row['at']!r}", "base or tip, on the tool's side")
            frame, place = places[self.row["at"]], STILL
        elif ways == ["centre"]:
            frame, place = self._centre(work)
        else:
            frame, place = self._placed("centre_mm", "moves_with", work)
        if "x_axis" in self.row or "z_axis" in self.row:
            place = FixedFrame(beam_axes(self.needed("x_axis"), self.needed("z_axis")), place.origin)
        tip = frame == len(homes) - 1 and not work
        return Body(self._element("tool" if tip else "table" if work else "frame"), frame, place, compliance)

    def _centre(self, work: bool) -> tuple[int, FixedFrame]:
        """Placement on a rotary joint's axis, in the frame that carries it: machine axes with all joints at 0."""
        names = [joint.name for joint in self.chains[work]]
        if self.row["centre"] not in names:
            raise self.fault("centre", f" = {self.row['centre']!r}", f"one of {', '.join(names)}")
        carrier = names.index(self.row["centre"])
        homes = self.homes[work]
        return carrier, homes[carrier].inverse().then(FixedFrame(np.eye(3), homes[carrier + 1].origin))

    def _placed(self, key: str, moving: str, work: bool) -> tuple[int, FixedFrame]:
        """Point in a joint's frame, or in machine axes with all joints at 0, moving with some of the axes."""
        point = FixedFrame(np.eye(3), m_from_mm(self.needed(key)))
        joints = self.chains[work]
        if "frame" in self.row:
            names = [joint.name for joint in joints]
            if self.row["frame"] not in names:
                raise self.fault("frame", f" = {self.row['frame']!r}", f"one of {', '.join(names)}")
            number = names.index(self.row["frame"])
            return number + 1, joints[number].given.then(point)
        moved = {name.lstrip("-") for name in self.row.get(moving, ())}
        frame = len(moved)
        if {joint.name for joint in joints[:frame]} != moved:
            order = ", ".join(joint.name for joint in joints)
            mistake = f" = {sorted(moved)}: no part of the {'work' if work else 'tool'}'s axes moves so"
            raise self.fault(moving, mistake, f"the first ones of {order}")
        signs = {name.startswith("-") for name in self.row.get(moving, ())}
        if moved and signs != {work}:
            raise self.fault(moving, f" = {sorted(self.row[moving])}", "-X on the work's side, X on the tool's")
        return frame, self.homes[work][frame].inverse().then(point)

    def _beam(self, work: bool) -> Part:
        stiffness = [1e6 * float(self.needed(key)) for key in BEAM]
        (first, start), (second, end) = (
            self._placed(f"{key}_mm", f"{prefix}moves_with", work) for key, prefix in (("from", ""), ("to", "to_"))
        )
        element = self._element("table" if work else "frame")
        z_axis = start.axes @ self.needed("z_axis")
        spans, homes = first != second, self.homes[work]
        far = homes[first].inverse().then(homes[second].then(end)) if spans else end  # all joints at 0
        along = far.origin - start.origin
        if not np.linalg.norm(np.cross(along, z_axis)) > 1e-6 * np.linalg.norm(along) * np.linalg.norm(z_axis):
            raise self.fault("z_axis", " lies along the beam, or is 0", "a direction across it")
        if spans:
            return SpanningBeam(element, (first, second), start.origin, end.origin, z_axis, stiffness)
        place = FixedFrame(beam_axes(along, z_axis), 0.5 * (start.origin + end.origin))
        return Body(element, first, place, beam_compliance(float(np.linalg.norm(along)), stiffness))

    def mass(self, nth: int, row: Document) -> None:
        """Add the mass of one row."""
        self.section, self.row, work = f"mass[{nth}]", row, row.get("side") == "work"
        frame, place = self._placed("centre_mm", "moves_with", work)
        self.masses[work].append((float(row["kg"]), frame, place.origin))


def read_elements(
    toml: MachineToml, chains: Sequence[Sequence[ChainJoint]], ends: Sequence[FixedFrame] = (STILL, STILL)
) -> ElementReader:
    """Reader with the compliant bodies and the masses of the tool's and the work's side."""
    reader = ElementReader(toml, chains, ends)
    for name, keys, read in (("element", ELEMENT, reader.element), ("mass", MASS, reader.mass)):
        for nth, row in enumerate(read_rows(toml, name, keys), 1):
            read(nth, row)
    return reader
