"""Patterns of what the words of a program's line say, where `rs274` prints too little."""

import re

MOTION_CODE = re.compile(r"G0*(0|1|2|3|5|33|38|73|74|76|8\d)(?![\d])")
CYCLE_CODES = {"73", "74", "76", *(f"8{digit}" for digit in range(1, 10))}
MACHINE_MOVE = re.compile(r"G0*53(?![\d.])")
HOME_MOVE = re.compile(r"G0*(28|30)(?![\d.])")
AXIS_WORD = re.compile(r"([XYZABC])(?=[-+.\d#\[]|$|[A-Z])")
DISTANCE_MODE = re.compile(r"G0*9([01])(?![\d.])")
LEAVES = re.compile(r"O|.*M0*9[89](?!\d)")  # lines of which rs274 prints no comment: calls, returns, loops, conditions
FINE_WORD = re.compile(r"[XYZ]\[?[-+]?\d*\.\d{4,}[1-9]")  # more decimals than rs274 prints
# A block that moves in program coordinates, in the unit in force, and says where by numbers alone.
PLAIN_BLOCK = re.compile(
    r"(?:G(?:0*[0-3]|1[789]|9[014])(?![\d.])|M0*[3-9](?!\d)|[XYZABCIJKRFSPT][+-]?(?:\d++\.?\d*+|\.\d++))*+", re.ASCII
)
COORDINATE = re.compile(r"([XYZ])([+-]?(?:\d++\.?\d*+|\.\d++))", re.ASCII)
