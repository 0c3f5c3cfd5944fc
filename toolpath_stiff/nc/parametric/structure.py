"""Structure of a parametric program: matching O words of RS274/NGC, DO and END of Macro B.

LinuxCNC's manual, "O Codes"; Fanuc's operator's manuals, "Custom macro" ("Branch and repetition").
"""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.parametric.statements import Steering

MACRO_LOOPS = ("LOOP", "WHILE LOOP")
OPENS = ("SUB", "IF", "WHILE", "DO", "REPEAT", "FOR", "DO UNTIL", *MACRO_LOOPS)  # FOR and DO UNTIL: Siemens
# Words that continue or close one of these with the same label.
BELONGS = {
    "ELSEIF": ("IF",), "ELSE": ("IF",), "ENDIF": ("IF",), "ENDSUB": ("SUB",), "ENDWHILE": ("WHILE",), "WHILE": ("DO",),
    "ENDREPEAT": ("REPEAT",), "END": MACRO_LOOPS, "ENDFOR": ("FOR",), "ENDLOOP": ("LOOP",), "UNTIL": ("DO UNTIL",),
}  # fmt: skip
LEAVES = {"BREAK": ("WHILE", "DO"), "CONTINUE": ("WHILE", "DO")}  # LinuxCNC refuses them in a repeat


@dataclass
class Structure:
    """Matching of the words that steer; lines from 0.

    Attributes
    ----------
    subs
        Label -> line of `sub`.
    end
        Line of what opens -> line that closes it.
    start
        Line of what closes, goes on with or leaves something -> line that opens that.
    branches
        Line of `if` -> lines of its `elseif`, `else` and `endif`.
    faults
        Line that fits nowhere -> what to say if the run comes to it.
    """

    subs: dict[str, int] = field(default_factory=dict)
    end: dict[int, int] = field(default_factory=dict)
    start: dict[int, int] = field(default_factory=dict)
    branches: dict[int, list[int]] = field(default_factory=dict)
    faults: dict[int, InputError] = field(default_factory=dict)


def structure_of(
    steerings: Iterable[tuple[int, Steering]], files: Collection[int], fail: Callable[..., InputError]
) -> Structure:
    """Structure of the blocks that steer, given with their lines.

    `files` are the first lines of files, which have labels of their own; `fail` makes the error of a line.
    """
    structure, opened = Structure(), list[tuple[int, Steering]]()
    labels: list[set[str]] = [set()]  # labels of the file, and of the open sub
    for row, steering in steerings:
        kind, label = steering.kind, steering.label
        if row in files:
            labels = [set()]
        start, last = opened[-1] if opened else (row, None)
        loops = [first for first, word in opened if word.label == label and word.kind in LEAVES.get(kind, ())]
        if last is not None and last.label == label and last.kind in BELONGS.get(kind, ()):
            structure.start[row] = start
            structure.branches.setdefault(start, []).append(row)
            if kind not in ("ELSEIF", "ELSE"):
                structure.end[start] = row
                opened.pop()
            if kind == "ENDSUB":
                labels.pop()
        elif loops:
            structure.start[row] = loops[-1]
        elif kind in MACRO_LOOPS or (kind in OPENS and not (label and label in labels[-1])):
            opened.append((row, steering))
            labels[-1].add(label)
            if kind == "SUB":
                structure.subs[label] = row
                labels.append(set())
        elif kind in OPENS or kind in BELONGS or kind in LEAVES:
            fault = "has a label that is there already" if kind in OPENS else "does not belong to what is open before"
            structure.faults[row] = fail(row, f"{steering.shown} {fault}", column=steering.column)
    for start, steering in opened:
        for row in (start, *(row for row, first in structure.start.items() if first == start)):
            structure.faults[row] = fail(row, f"{steering.shown} (line {start + 1}) has no end")
    return structure
