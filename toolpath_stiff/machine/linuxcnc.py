"""Machines from LinuxCNC: the `genhexkins` pins of a HAL file, with the unit of the ini file beside it.

genhexkins(9): `base.N.x|y|z` are the joints of the base, `platform.N.x|y|z` those of the platform in its own frame,
`tool-offset` and `spindle-offset` are added to Z of both, so that no joint moves while the platform is level
(genhexkins.c, genhex_read_hal_pins). `base-n`, `platform-n` and `screw-lead` correct the strut
length for the turning of the screw in its joints; they do not change where the joints are.
"""

import re
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Hexapod, Limits, StrutLaw
from toolpath_stiff.units import MM_PER_INCH, m_from_mm, mm_from_m, n_per_m_from_n_per_um, rad_from_deg

SETP = re.compile(r"^\s*setp\s+([\w-]+)\.(\S+?)\s*(?:=\s*|\s+)(\S+)\s*$")
KNOWN = re.compile(
    r"((base|platform)(-n)?\.[0-5]\.[xyz]|tool-offset|spindle-offset|screw-lead|"
    r"convergence-criterion|limit-iterations|max-error)$"
)
UNITS_MM = {"mm": 1.0, "inch": MM_PER_INCH}
SAME_UNIT = {"mm": "mm", "metric": "mm", "inch": "inch", "in": "inch", "imperial": "inch"}
# Struts of a screw about 40 mm thick; LinuxCNC knows no stiffness.
ASSUMED_STIFFNESS = n_per_m_from_n_per_um(50.0)


def units_of(hal: Path) -> str:
    """`mm` or `inch`, from LINEAR_UNITS of the ini files beside a HAL file.

    Raises `InputError` if they do not agree or say.
    """
    texts = (ini.read_text(encoding="utf-8", errors="replace") for ini in sorted(hal.parent.glob("*.ini")))
    words = (word for text in texts for word in re.findall(r"(?m)^\s*LINEAR_UNITS\s*=\s*(\w+)", text))
    units = {SAME_UNIT.get(word.lower(), "") for word in words}
    if len(units) != 1 or "" in units:
        mistake = "the unit of the pins is not known (no ini file beside it that says LINEAR_UNITS)"
        raise InputError(mistake, hint="give it with --units mm or --units inch", file=str(hal))
    return units.pop()


def machine_from_hal(text: str, units: str, file: str = "kinematics.hal") -> tuple[Hexapod, list[str]]:
    """Machine from the text of a HAL file.

    Parameters
    ----------
    text
        The file.
    units
        "mm" or "inch", of the pins' values.
    file
        For messages and the machine's source.

    Returns
    -------
    machine, notes
        The machine; sentences about what was assumed or left out.

    Raises
    ------
    InputError
        A pin is missing, set twice, unknown, or its value is no number.
    """
    values = read_pins(text, "genhexkins", file, KNOWN)
    names = np.array([[[f"{part}.{n}.{axis}" for axis in "xyz"] for n in range(6)] for part in ("base", "platform")])
    missing = [f"genhexkins.{name}" for name in names.flat if name not in values]
    if missing:
        mistake = f"{len(missing)} joint pins are not set, first {missing[0]}"
        expected = "setp genhexkins.base.N.x|y|z and genhexkins.platform.N.x|y|z for N = 0 to 5"
        raise InputError(mistake, expected=expected, file=file)
    scale = UNITS_MM[units]
    joints = m_from_mm(np.vectorize(values.__getitem__)(names) * scale)
    offset = m_from_mm((values.get("tool-offset", 0.0) + values.get("spindle-offset", 0.0)) * scale)
    notes = []
    if offset:
        notes.append(f"{mm_from_m(offset):g} mm (tool-offset plus spindle-offset) are added to Z of all joints")
    if any(name.startswith(("base-n", "platform-n")) or name == "screw-lead" for name in values):
        notes.append("screw-lead and the joint normals correct strut lengths for the turning screw; left out")
    notes.append(
        "strut stiffness, travel, joint angles, workspace, tool length and default origin are assumed from the "
        "machine's size: edit them"
    )
    frame, platform = joints + np.array([0.0, 0.0, offset])
    return _with_assumptions(frame, platform, file), notes


def read_pins(text: str, module: str, file: str, known: re.Pattern[str] | None = None) -> dict[str, float]:
    """Pins of a module that a HAL file sets. Raises `InputError` at the line of a non-number or of a pin set twice."""
    values: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), 1):
        match = SETP.match(line.split("#")[0])
        if not match or match[1] != module:
            continue
        _, pin, raw = match.groups()
        mistake, expected = f"{module}.{pin} = {raw!r}", ""
        try:
            value = float(raw)
        except ValueError:
            value, expected = np.inf, "a number (variables are not read)"
        if known and not known.match(pin):
            mistake = f"{module} has no pin {pin!r}"
        elif pin in values:
            mistake = f"{module}.{pin} is set twice"
        elif np.isfinite(value):
            values[pin] = value
            continue
        else:
            expected = expected or "a finite number"
        raise InputError(mistake, expected=expected, file=file, line=number)
    return values


def _with_assumptions(frame: FloatArray, platform: FloatArray, file: str) -> Hexapod:
    """Hexapod with limits and stiffness that LinuxCNC does not state, assumed from the machine's own size."""
    size = float(np.linalg.norm(frame[:, :2], axis=1).mean())
    height = float(frame[:, 2].mean() + 0.87 * size)  # so that struts lean by about 45 degrees
    neutral = (0.0, 0.0, height, 0.0, 0.0, 0.0)
    struts = platform + np.array(neutral[:3]) - frame
    middle = float(np.sqrt(np.einsum("ij,ij->i", struts, struts)).mean())
    travel = (0.7 * middle, 1.4 * middle)
    name = Path(file).name
    return Hexapod(
        name=Path(file).stem,
        title=f"hexapod of {name}",
        source=f"genhexkins pins of {name}",
        frame_joints=frame,
        platform_joints=platform,
        reference_tool_length=0.0,
        strut_law=StrutLaw(travel[0], ASSUMED_STIFFNESS, travel[1], ASSUMED_STIFFNESS),
        limits=Limits(
            strut_length=travel,
            frame_joint_angle=rad_from_deg(45.0),
            platform_joint_angle=rad_from_deg(45.0),
            workspace=np.array([[-size, -size, height - 0.5 * size], [size, size, height + 0.5 * size]]),
            singularity=0.1,
            neutral_pose=neutral,
        ),
        default_origin=neutral,
        origins={"frame_joints": "published", "platform_joints": "published"},
        remarks={"strut_law": "LinuxCNC knows no stiffness; set your own"},
    )
