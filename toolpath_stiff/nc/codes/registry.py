"""The table of codes, and what the user is told of each. A new code is a row beside its function, in one of the files.

Codes and modal groups follow LinuxCNC (its manual, "G-Code Overview", modal groups), because its interpreter is what
the results are compared with; polar words and rotation, which it does not have, follow Fanuc's controls.
"""

from toolpath_stiff.nc.codes.arc import ARC_CODES
from toolpath_stiff.nc.codes.code import Alias, Code
from toolpath_stiff.nc.codes.corner import CORNER_CODES
from toolpath_stiff.nc.codes.cutter import CUTTER_CODES
from toolpath_stiff.nc.codes.drilling import DRILLING_CODES
from toolpath_stiff.nc.codes.dwell import DWELL_CODES
from toolpath_stiff.nc.codes.feeds import FEED_CODES
from toolpath_stiff.nc.codes.flow import FLOW_CODES
from toolpath_stiff.nc.codes.modes import MODE_ALIASES, MODE_CODES
from toolpath_stiff.nc.codes.motion import STRAIGHT_CODES
from toolpath_stiff.nc.codes.passive import PASSIVE_CODES
from toolpath_stiff.nc.codes.polar import POLAR_CODES
from toolpath_stiff.nc.codes.refused import REFUSED
from toolpath_stiff.nc.codes.rotation import ROTATION_CODES
from toolpath_stiff.nc.codes.saved import SAVED_CODES
from toolpath_stiff.nc.codes.set_offsets import SET_OFFSET_CODES
from toolpath_stiff.nc.codes.shifts import SHIFT_CODES
from toolpath_stiff.nc.codes.synchronised import SYNCHRONISED_CODES
from toolpath_stiff.nc.codes.tool_length import TOOL_ALIASES, TOOL_LENGTH_CODES
from toolpath_stiff.nc.codes.tools import TOOL_CODES
from toolpath_stiff.nc.codes.work_offsets import WORK_OFFSET_CODES

UNDERSTOOD = (
    *STRAIGHT_CODES, *ARC_CODES, *DRILLING_CODES, *MODE_CODES, *POLAR_CODES, *ROTATION_CODES, *WORK_OFFSET_CODES,
    *SET_OFFSET_CODES, *SHIFT_CODES, *FEED_CODES, *DWELL_CODES, *TOOL_CODES, *TOOL_LENGTH_CODES, *FLOW_CODES,
    *CUTTER_CODES, *SAVED_CODES, *SYNCHRONISED_CODES, *PASSIVE_CODES, *CORNER_CODES,
)  # fmt: skip
CODES: dict[str, Code] = {code.name: code for code in UNDERSTOOD}
ALIASES: dict[str, Alias] = {alias.name: alias for alias in (*MODE_ALIASES, *TOOL_ALIASES)}
INCH_METRIC = {alias.name: alias.code for alias in MODE_ALIASES}  # where the dialect has them
LISTED = {code.name: code.listed for code in UNDERSTOOD if code.listed}


def code_meaning(name: str) -> str:
    """What a code is taken for, in a few words.

    Examples
    --------
    >>> code_meaning("G2"), code_meaning("M8"), code_meaning("G87")
    ('clockwise arc', 'coolant: not acted upon', 'back boring: not supported')
    """
    if name in LISTED:
        return f"{LISTED[name]}: not acted upon"
    if name in CODES or name in ALIASES:
        return (CODES.get(name) or ALIASES[name]).meaning
    if name in REFUSED:
        return f"{REFUSED[name].what}: not supported"
    return "not known" if name.startswith("G") else "an M code of one control: not acted upon"
