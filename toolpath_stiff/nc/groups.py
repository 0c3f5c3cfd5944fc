"""Modal groups, in the order in which the codes and words of a block act.

Groups and order are LinuxCNC's (manual, "G-Code Overview", "Modal Groups" and "Order of Execution"), because its
interpreter is what the results are compared with. Groups of M codes begin with "M ", since a G code may have a group of
that name too. "dwell" is a step of G4 alone; F, S and T act without a code.
"""

from typing import Literal, get_args

# Units first, so that an F beside G20 is in inches; the moves last. Up to `LAST_MODE`, a group may be executed ahead of
# the rest of the block: doing so twice changes nothing but dwells.
Group = Literal[
    "units", "feed mode", "F", "S", "T", "M tool change", "dwell", "plane", "polar", "tool length", "M subprogram",
    "work offset", "path control", "exact stop", "look-ahead", "dynamic offset", "spindle mode", "distance",
    "arc distance", "cycle return", "cutter compensation", "lathe diameter", "scaling", "mirror image", "stroke check",
    "speed watch", "polar interpolation", "M spindle", "M coolant", "M overrides", "M rigid tapping",
    "rotation", "non-modal", "M stop", "motion", "corner",
]  # fmt: skip
STEPS: dict[Group, int] = {group: place for place, group in enumerate(get_args(Group))}
LAST_MODE = STEPS["M rigid tapping"]
