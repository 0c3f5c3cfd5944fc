"""Faults outside the catalogue that the rig can hide: oddities, and unknowns, judged by their description.

Each is invented from its physics, with the shape that worn, damaged or badly set machines show; no source gives figures
for them. The sizes that are drawn of unknowns change the stiffness by 4 to 15 % rms. Oddities are what a blind draw
hides: one formula each, which the columns of any campaign show.
"""

from toolpath_stiff.rig.unknown_ends import END_KINDS
from toolpath_stiff.rig.unknown_struts import STRUT_KINDS

OUTSIDE = {**STRUT_KINDS, **END_KINDS}
ODDITIES = {name: OUTSIDE[name] for name in ("cracked_bed", "saddle_overhang", "cable_drag")}
UNKNOWNS = {name: kind for name, kind in OUTSIDE.items() if name not in ODDITIES}
