"""Hexapods of LinuxCNC: the `genhexkins` pins of a HAL file.

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
from toolpath_stiff.machine.linuxcnc_files import ControlFiles
from toolpath_stiff.machine.model import Hexapod, Limits, StrutLaw
from toolpath_stiff.units import m_from_mm, mm_from_m, n_per_m_from_n_per_um, rad_from_deg

KNOWN = re.compile(
    r"((base|platform)(-n)?\.[0-5]\.[xyz]|tool-offset|spindle-offset|screw-lead|"
    r"convergence-criterion|limit-iterations|max-error)$"
)
# Struts of a screw about 40 mm thick; LinuxCNC knows no stiffness.
ASSUMED_STIFFNESS = n_per_m_from_n_per_um(50.0)


def hexapod_of_pins(files: ControlFiles) -> tuple[Hexapod, list[str]]:
    """A machine of the pins of genhexkins, and what was assumed or left out. Raises `InputError` for missing pins."""
    pins = files.pins
    if strange := [pin for pin in pins if not KNOWN.match(pin)]:
        raise InputError(f"genhexkins has no pin {strange[0]!r}", file=files.file)
    names = np.array([[[f"{part}.{n}.{axis}" for axis in "xyz"] for n in range(6)] for part in ("base", "platform")])
    missing = [f"genhexkins.{name}" for name in names.flat if name not in pins]
    if missing:
        mistake = f"{len(missing)} joint pins are not set, first {missing[0]}"
        expected = "setp genhexkins.base.N.x|y|z and genhexkins.platform.N.x|y|z for N = 0 to 5"
        raise InputError(mistake, expected=expected, file=files.file)
    joints = m_from_mm(np.vectorize(pins.__getitem__)(names) * files.scale)
    offset = m_from_mm((pins.get("tool-offset", 0.0) + pins.get("spindle-offset", 0.0)) * files.scale)
    notes = []
    if offset:
        notes.append(f"{mm_from_m(offset):g} mm (tool-offset plus spindle-offset) are added to Z of all joints")
    if any(name.startswith(("base-n", "platform-n")) or name == "screw-lead" for name in pins):
        notes.append("screw-lead and the joint normals correct strut lengths for the turning screw; left out")
    notes.append(
        "strut stiffness, travel, joint angles, workspace, tool length and default origin are assumed from the "
        "machine's size: edit them"
    )
    frame, platform = joints + np.array([0.0, 0.0, offset])
    return _with_assumptions(frame, platform, files.file), notes


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
