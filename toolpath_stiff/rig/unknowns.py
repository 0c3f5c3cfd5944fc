"""The unknowns that the rig can hide: what no effect of the catalogue and none of the oddities describes.

They are there to judge descriptions of what is missing. Each is invented from its physics, with the shape that worn,
damaged or badly set machines show; no source gives figures for them. The sizes that are drawn change the stiffness by
4 to 15 % rms.
"""

from __future__ import annotations

from toolpath_stiff.rig.oddities import ODDITIES
from toolpath_stiff.rig.unknown import Kind
from toolpath_stiff.rig.unknown_ends import END_KINDS
from toolpath_stiff.rig.unknown_joints import JOINT_KINDS
from toolpath_stiff.rig.unknown_struts import STRUT_KINDS

UNKNOWNS: dict[str, Kind] = {**JOINT_KINDS, **STRUT_KINDS, **END_KINDS}
OUTSIDE: dict[str, Kind] = {**ODDITIES, **UNKNOWNS}  # the catalogue
