"""Faults outside the catalogue that the rig can hide: oddities, and unknowns, judged by their description.

Unknowns are there to judge descriptions of what is missing. Each is invented from its physics, with the shape that
worn, damaged or badly set machines show; no source gives figures for them. The sizes that are drawn change the
stiffness by 4 to 15 % rms.
"""

from toolpath_stiff.rig.unknown_ends import END_KINDS, ODDITIES
from toolpath_stiff.rig.unknown_struts import STRUT_KINDS

UNKNOWNS = {**STRUT_KINDS, **END_KINDS}
OUTSIDE = {**ODDITIES, **UNKNOWNS}
