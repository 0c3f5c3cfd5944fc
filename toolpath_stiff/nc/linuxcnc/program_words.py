"""Words of a program, where `rs274` prints too little; and commands that give no path."""

import re

MOTION_CODE = re.compile(r"G0*(0|1|2|3|5|33|38|73|74|76|8\d)(?![\d])")
CYCLE_CODES = {"73", "74", "76", *(f"8{digit}" for digit in range(1, 10))}
MACHINE_MOVE = re.compile(r"G0*53(?![\d.])")
HOME_MOVE = re.compile(r"G0*(28|30)(?![\d.])")
DISTANCE_MODE = re.compile(r"G0*9([01])(?![\d.])")
LEAVES = re.compile(r"O|.*M0*9[89](?!\d)")  # lines of which rs274 prints no comment: calls, returns, loops, conditions
FINE_WORD = re.compile(r"[XYZ]\[?[-+]?\d*\.\d{4,}[1-9]")  # more decimals than rs274 prints
REFUSED = {  # problem, what was expected
    "CHANGE_TOOL_NUMBER": ("M61: LinuxCNC's rs274 goes on with length and diameter of the tool before", "T and M6"),
    "NURBS_FEED": ("a spline, whose points LinuxCNC does not print", "arcs and lines"),
    "STRAIGHT_PROBE": ("probing: what follows depends on what is met", "no probing"),
}
