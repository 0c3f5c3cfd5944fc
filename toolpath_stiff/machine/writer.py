"""Machines as commented machine files; `parse_machine` reads the same machine back."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.units import deg_from_rad, mm_from_m, mm_per_min_from_m_per_s, n_per_um_from_n_per_m

# `tps machine new` puts it in every section; where it is still present, nothing was replaced.
TEMPLATE_REMARK = "value of the template, not of this machine"
HEADINGS = {
    "frame_joints": "Base frame: Z up. Row i is strut i + 1: x, y, z in mm\n"
    "# (or cylindrical_mm_deg: rows of radius in mm, angle in degrees, height in mm).",
    "platform_joints": "Platform frame: origin at the tip of the reference tool, spindle along Z. Rows as above.",
    "reference_tool": "The tool whose tip the platform joints refer to: length from the spindle nose in mm.\n"
    "# Tools of other lengths (G43 with a tool table) move the tip along the spindle.",
    "strut_law": "Stiffness of a strut, linear in its length: two lengths in mm and the stiffness at each in N/um.\n"
    "# Outside the two lengths it is extrapolated, and every result says how often.",
    "strut_law, a table": "Stiffness of a strut by its length: lengths in mm and the stiffness at each in N/um,\n"
    "# linear between. Outside it is extrapolated along the end segments, and every result says how often.",
    "strut_law, constant": "Stiffness of a strut in N/um, the same at every length.",
    "platform": "Stiffness in N/m of each of the 19 bars that stand for platform, spindle and tool; inf is rigid.",
    "as_built": "By how much struts are stiffer than their law, and joints off their places, unknown to the control:\n"
    "# the likeliest by the readings, given how far struts and joints of such machines are off.",
    "limits.strut_length": "Travel of the struts, between the joint centres, in mm.",
    "limits.joint_angle": "Largest swing of the joints in degrees from the direction that each strut has at the\n"
    "# neutral pose (x, y, z in mm, roll, pitch, yaw in degrees); inf is no limit.",
    "limits.workspace": "Box that the tool tip may not leave: lower and upper corner x, y, z in mm.",
    "limits.singularity": "Smallest |det J| relative to the neutral pose; 0 is singular.",
    "setup": "Where program zero sits unless the user or the program says so (x, y, z in mm[, A, B, C in degrees]);\n"
    "# feed of rapid moves in mm/min, for times only.",
    "uncertainty": "What was fitted to measurements: standard deviations in the units of the keys, and correlations.",
    "uncertainty.errors": "How far the stiffness may be off at a pose, for bands. Rows of loadings: by how many of\n"
    "# its standard deviations each parameter is off by scatter, then by struts 1 to 6 and the joints' coordinates.\n"
    "# learned: rows A, by which readings shrink the latter; form_percent: what the model lacks, here and elsewhere.\n"
    "# load_N, by_load_percent: the readings' one load, and the share of the compliance that may hang on it.",
}


def machine_toml(machine: Hexapod, preamble: str = "") -> str:
    """Text of a machine file, with `preamble` lines as comments before it."""
    limits, law = machine.limits, machine.strut_law
    stiffnesses = [n_per_um_from_n_per_m(stiffness) for _, stiffness in law.points]
    lengths = [mm_from_m(length) for length, _ in law.points]
    shortest, longest = mm_from_m(np.array(limits.strut_length))
    conditions = {"name": machine.setup, "names": machine.setups or None, "temperature_C": machine.temperature}
    sections: dict[str, Document] = {
        "frame_joints": {"mm": mm_from_m(machine.frame_joints)},
        "platform_joints": {"mm": mm_from_m(machine.platform_joints)},
        "reference_tool": {"length_mm": mm_from_m(machine.reference_tool_length)},
        "strut_law": {"stiffness_N_per_um": stiffnesses[0]}
        if law.constant
        else {"length_mm": lengths, "stiffness_N_per_um": stiffnesses},
        "platform": {"bar_stiffness_N_per_m": machine.platform_bar_stiffness},
        # A file needs a longest strut: 100 m stands for none.
        "limits.strut_length": {"min_mm": shortest, "max_mm": min(longest, 1e5)},
        "limits.joint_angle": {
            "frame_max_deg": deg_from_rad(limits.frame_joint_angle),
            "platform_max_deg": deg_from_rad(limits.platform_joint_angle),
            "neutral_pose_mm_deg": pose_in_mm(limits.neutral_pose),
        },
        "limits.singularity": {"min_index": limits.singularity},
        "setup": {
            "default_origin_mm": pose_in_mm(machine.default_origin),
            "rapid_mm_per_min": mm_per_min_from_m_per_s(machine.rapid_feed),
            **{key: value for key, value in conditions.items() if value is not None},
        },
    }
    if machine.as_built is not None:
        frame, platform = mm_from_m(machine.as_built[6:]).round(6).reshape(2, 6, 3)
        struts = (100.0 * np.expm1(machine.as_built[:6])).round(6)
        sections["as_built"] = {"struts_percent": struts, "frame_joints_mm": frame, "platform_joints_mm": platform}
    if np.isfinite(limits.workspace).all():
        low, high = mm_from_m(limits.workspace)
        sections["limits.workspace"] = {"min_mm": low, "max_mm": high}
    lines = [f"# {line}".rstrip() for line in preamble.splitlines()]
    lines += _rows({key: getattr(machine, key) for key in ("name", "title", "source") if getattr(machine, key)})
    kind_of_law = ", constant" if law.constant else ", a table" if law.shape else ""
    for name, values in sections.items():
        heading = HEADINGS[name + kind_of_law if name == "strut_law" else name]
        remark = {"remark": machine.remarks[name]} if name in machine.remarks else {}
        origin = {"origin": machine.origins.get(name, "assumed"), **remark}
        lines += ["", f"# {heading}", f"[{name}]", *_rows({**values, **origin})]
    return "\n".join([*lines, *fitted_lines(machine), ""])


TORSION = re.compile(r"(?m)^([ \t]*torsion_nrad_per_Nm[ \t]*=[ \t]*)(\[[^\]]*\]|[^#\n]*)")
FITTED = "# Effects, and what was fitted to measurements, follow; they are written anew by `tps update`."


def elements_toml(machine: MachineTool, torsions: Sequence[float]) -> str:
    """Text of a machine of elements with torsions of its joints (none: the file's), effects and uncertainty.

    Torsions in nrad/(N m), in the order of the joints. Raises `InputError` where the file does not hold them once.
    """
    text = machine.text
    if torsions:
        text, count = TORSION.subn(rf"\g<1>[{', '.join(f'{value:.5g}' for value in torsions)}]", text)
        if count != 1:
            mistake = f"machine {machine.name} states torsion_nrad_per_Nm {count} times"
            raise InputError(mistake, expected="once, for all joints", hint="write one [[element]] of type joint")
    heads = re.split(r"(?m)^(?=\[)", text)
    kept = [part for part in heads if not re.match(r"\[\[?(effect|instrument|uncertainty)\b", part)]
    return "\n".join(["".join(kept).rstrip().removesuffix(FITTED).rstrip(), "", FITTED, *fitted_lines(machine), ""])


def fitted_lines(machine: MachineTool) -> list[str]:
    """Lines of effects, instruments, and the uncertainty of fitted parameters."""
    lines: list[str] = []
    for kind, entries in (("effect", machine.effects), ("instrument", machine.instruments)):
        for entry in entries:
            lines += ["", f"[[{kind}]]", *_rows({"name": entry.name, **entry.parameters})]
            lines += [f"[{kind}.provenance]", *_rows(entry.provenance)] if entry.provenance else []
    if (known := machine.uncertainty) is not None:
        figures = {"parameters": known.names, "sd": known.sd, "correlation": known.correlation}
        lines += ["", f"# {HEADINGS['uncertainty']}", "[uncertainty]", *_rows(figures)]
        if (errors := known.errors) is not None:
            position, angles = errors.poses
            written = {
                "loadings": errors.loadings,
                "struts_percent": 100.0 * errors.struts,
                "joints_mm": mm_from_m(errors.joints),
                "learned": errors.learned,
                "form_percent": [100.0 * errors.near, 100.0 * errors.away],
                "places_mm_deg": np.round(np.hstack([mm_from_m(position), deg_from_rad(angles)]), 6),
            }
            if errors.by_load:
                written |= {"load_N": errors.load, "by_load_percent": 100.0 * errors.by_load}
            lines += ["", f"# {HEADINGS['uncertainty.errors']}", "[uncertainty.errors]", *_rows(written)]
    return lines


def _rows(values: Document) -> list[str]:
    return [f"{key} = {value_text(value)}" for key, value in values.items()]


def _number(value: float) -> str:
    """Shortest text that reads back as the same number to 14 digits: 304.77, not 304.77000000000004."""
    return str(value) if math.isinf(value) else repr(float(f"{value:.14g}") + 0.0)


def toml_text(value: str) -> str:
    """A TOML basic string; JSON's escapes are TOML's."""
    return json.dumps(value, ensure_ascii=False)


def value_text(value: Any) -> str:
    """A TOML value."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, np.ndarray):
        if value.ndim == 2:
            return "[\n" + "".join(f"    {value_text(row)},\n" for row in value) + "]"
        value = value.tolist()
    if isinstance(value, list | tuple):
        return "[" + ", ".join(value_text(v) for v in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {value_text(v)}" for key, v in value.items()) + "}"
    return toml_text(str(value))
