"""Machines of LinuxCNC's kinematics modules: files whose compliances are left to fill in.

trivkins(9), 5axiskins(9), xyzac-trt-kins(9), xyzbc-trt-kins(9), genserkins(9), pumakins(9), genhexkins(9),
pentakins(9), lineardeltakins(9) and rotarydeltakins(9); their units are those of the machine, angles of genserkins'
rows in rad, limits in degrees.
"""

from collections.abc import Callable

import numpy as np

from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.linuxcnc_files import ControlFiles
from toolpath_stiff.machine.unfilled import EXPERIENCE, JOINTS, SPINDLE, axis_row, carriages, file_text, section
from toolpath_stiff.machine.writer import HEADINGS
from toolpath_stiff.units import deg_from_rad, mm_from_m

GIVE = dict.fromkeys(("translation_nm_per_N", "rotation_nrad_per_Nm"))
STRUT = f"# A strut with both joints has typically 10 to 30 nm/N ({EXPERIENCE}).\n"
TABLE = '# The files do not say which axes carry the work: an element with moves_with = ["-X"] does, of X'
RADIANS = 2.0 * np.pi + 0.01


def machine_from_control(files: ControlFiles, name: str) -> tuple[str, list[str]]:
    """A machine file and notes. Raises `InputError` for pins that are missing and modules without a kind."""
    if files.module not in MODULES:
        what = f"no machine of {files.module or 'a kinematics module'}"
        raise InputError(what, expected=", ".join(MODULES), file=files.file)
    kind, parts = MODULES[files.module](files)
    notes = [f"Made from {files.file}: {files.module}."]
    notes += [f"{pin} is not set: 0, as {files.module} has it then" for pin in files.unset]
    return file_text(name, kind, f"{files.module} pins of {files.file}", notes, parts), notes


def _mill(files: ControlFiles) -> tuple[str, list[str]]:
    if left := set(files.coordinates) - set("XYZ"):
        expected = "X, Y, Z; where rotary axes stand trivkins does not say"
        raise InputError(f"trivkins with axis {min(left)}", expected=expected, file=files.file)
    return "serial", [section("[limits]", files.limits_of("XYZ", "XYZ")), f"{TABLE}\n{SPINDLE}"]


def _trunnion(files: ControlFiles) -> tuple[str, list[str]]:
    letter = files.module[3].upper()
    keys = [f"{axis}-rot-point" for axis in "xyz"] + ["y-offset" if letter == "A" else "x-offset", "z-offset"]
    trunnion = {f"{key.replace('-', '_')}_mm": files.length(key, 0.0) for key in keys}
    if files.pins.get("tool-offset"):
        raise InputError(f"{files.module}.tool-offset is not 0", expected="joints that place the tip", file=files.file)
    parts = [section("", {"convention": f"linuxcnc {files.module}"}), section("[trunnion]", trunnion)]
    parts.append(section("[limits]", files.limits_of(f"XYZ{letter}C", f"XYZ{letter}C")))
    for axis in (letter, "C"):
        keys_of = {"name": f"{axis} axis", "type": "spring", "side": "work", "centre": axis}
        parts.append(section("[[element]]", {**keys_of, **GIVE}))
    return "serial", [*parts, SPINDLE]


def _head(files: ControlFiles) -> tuple[str, list[str]]:
    pivot, axes = files.length("pivot-length"), np.eye(3)
    letters = files.coordinates or "XYZBC"
    rows = [(name, axes[i], [0.0] * 3) for i, name in enumerate("XYZ")]
    rows += [("C", axes[2], [0.0, 0.0, pivot]), ("B", -axes[1], [0.0] * 3)]  # B is left-handed
    parts = []
    for name, axis, place in rows:
        bounds = files.bounds(letters.index(name), name in "XYZ") if name in letters else None
        parts.append(axis_row(name, name in "XYZ", {"xyz_mm": place, "axis": axis}, bounds))
    tip = section("[tool]", {"tip_mm": [0.0, 0.0, -pivot]})
    return "serial", [*parts, tip, *carriages([(row[0], "tool") for row in rows]), SPINDLE]


def _rows(files: ControlFiles, rows: list[tuple[float, float, float]]) -> tuple[str, list[str]]:
    """`[[axis]]` rows by modified DH, from alpha in rad, a and d in mm."""
    parts = []
    for i, (alpha, a, d) in enumerate(rows):
        if abs(alpha) > RADIANS:
            raise InputError(f"{files.module}.ALPHA-{i} = {alpha:g}", expected="rad, not degrees", file=files.file)
        keys = {"alpha_deg": deg_from_rad(alpha), "a_mm": a, "d_mm": d}
        parts.append(axis_row(f"J{i + 1}", False, keys, files.bounds(i, linear=False)))
    return "serial", [*parts, JOINTS, SPINDLE]


def _genser(files: ControlFiles) -> tuple[str, list[str]]:
    return _rows(files, [(files.pin(f"ALPHA-{i}"), files.length(f"A-{i}"), files.length(f"D-{i}")) for i in range(6)])


def _puma(files: ControlFiles) -> tuple[str, list[str]]:
    a2, a3, d3, d4, d6 = (files.length(name) for name in ("A2", "A3", "D3", "D4", "D6"))
    square = 0.5 * np.pi
    wrist = [(-square, a3, d4), (square, 0.0, 0.0), (-square, 0.0, d6)]
    return _rows(files, [(0.0, 0.0, 0.0), (-square, 0.0, 0.0), (0.0, a2, d3), *wrist])


def _genhex(files: ControlFiles) -> tuple[str, list[str]]:
    """Six struts; tool-offset and spindle-offset are added to Z of all joints (genhexkins.c, genhex_read_hal_pins)."""
    raised = files.length("tool-offset", 0.0) + files.length("spindle-offset", 0.0)
    parts = []
    for part, name in (("base", "frame_joints"), ("platform", "platform_joints")):
        joints = np.array([[files.length(f"{part}.{i}.{axis}") for axis in "xyz"] for i in range(6)])
        parts.append(section(f"[{name}]", {"mm": joints + np.array([0.0, 0.0, raised]), "origin": "published"}))
    low, high = files.travel
    blanks: dict[str, Document] = {
        "reference_tool": {"length_mm": None},
        "strut_law": {"stiffness_N_per_um": None},
        "limits.strut_length": {"min_mm": low, "max_mm": high},
        "limits.joint_angle": dict.fromkeys(("frame_max_deg", "platform_max_deg", "neutral_pose_mm_deg")),
        "setup": dict.fromkeys(("default_origin_mm", "rapid_mm_per_min")),
    }
    note = "# screw-lead, base-n and platform-n, which correct lengths for the turning screw, are left out.\n"
    for name, values in blanks.items():
        heading = HEADINGS["strut_law, constant" if name == "strut_law" else name]
        parts.append(f"# {heading}\n" + section(f"[{name}]", {**values, "origin": "assumed"}))
    return "hexapod", [note + parts[0], *parts[1:]]


def _penta(files: ControlFiles) -> tuple[str, list[str]]:
    top: Document = {
        "base_mm": np.array([[files.length(f"base.{i}.{axis}") for axis in "xyz"] for i in range(5)]),
        "ring_radius_mm": [files.length(f"effector.{i}.r") for i in range(5)],
        "ring_height_mm": [files.length(f"effector.{i}.z") for i in range(5)],
    }
    low, high = files.travel
    blank = dict.fromkeys(("length_mm", "compliance_nm_per_N", "slope_nm_per_N_per_m"))
    strut: Document = {**blank, "min_mm": low, "max_mm": high}
    torsion = dict.fromkeys(("strut", "EI_MNm2", "hinge_nrad_per_Nm"))
    return "pentapod", [section("", top), STRUT + section("[strut]", strut), section("[torsion]", torsion), SPINDLE]


def _delta(files: ControlFiles) -> tuple[str, list[str]]:
    joints = dict.fromkeys(("carriage_joint_radius_mm", "effector_joint_radius_mm"))
    rest = dict.fromkeys(("rod_spacing_mm", "effector_joint_height_mm"))
    note = f"# carriage_joint_radius_mm is {files.length('R'):g} more than effector_joint_radius_mm.\n"
    bounds = files.bounds(0, linear=True)
    limits = {"carriage_mm": None if bounds is None else mm_from_m(bounds)}
    carriage = {"rail_radius_mm": None, "centre_height_mm": None, **GIVE}
    rod = section("[rod]", {"compliance_nm_per_N": None})
    parts = [section("[limits]", limits), rod, section("[carriage]", carriage)]
    return "delta", [note + section("", {"rod_length_mm": files.length("L"), **joints, **rest}), *parts, SPINDLE]


def _rotary_delta(files: ControlFiles) -> tuple[str, list[str]]:
    radii = {"hip_radius_mm": files.length("platformradius"), "effector_joint_radius_mm": files.length("footradius")}
    rest = {"rod_length_mm": files.length("shinlength"), "rod_spacing_mm": None, "effector_joint_height_mm": None}
    limits = section("[limits]", {"arm_deg": files.limits.get(0)})
    parts = [
        section("[rod]", {"compliance_nm_per_N": None}),
        section("[arm]", {"length_mm": files.length("thighlength"), **GIVE}),
    ]
    return "rotary_delta", [section("", {**radii, **rest}), limits, *parts, SPINDLE]


MODULES: dict[str, Callable[[ControlFiles], tuple[str, list[str]]]] = {
    "trivkins": _mill,
    "5axiskins": _head,
    "xyzac-trt-kins": _trunnion,
    "xyzbc-trt-kins": _trunnion,
    "genserkins": _genser,
    "pumakins": _puma,
    "genhexkins": _genhex,
    "pentakins": _penta,
    "lineardeltakins": _delta,
    "rotarydeltakins": _rotary_delta,
}
