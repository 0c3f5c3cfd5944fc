"""The table of codes, and what the user is told of each. A new code is a row beside its function, in one of the files.

Codes and modal groups follow LinuxCNC (its manual, "G-Code Overview", modal groups), because its interpreter is what
the results are compared with; polar words and rotation, which it does not have, follow Fanuc's controls.
"""

from __future__ import annotations

from collections.abc import Iterable

from toolpath_stiff.nc.codes import (
    circular,
    drilling,
    feeds,
    flow,
    modes,
    offsets,
    passive,
    points,
    straight,
    tools,
    turning,
)
from toolpath_stiff.nc.codes.contract import Alias, Code, Refused

GROUPS = (straight, circular, drilling, modes, points, turning, offsets, feeds, tools, flow, passive)


def table(codes: Iterable[Code]) -> dict[str, Code]:
    """Name -> code. Raises `ValueError` for a name that is there twice."""
    found: dict[str, Code] = {}
    for code in codes:
        if code.name in found:
            raise ValueError(f"{code.name} is in the table twice")
        found[code.name] = code
    return found


CODES: dict[str, Code] = table(code for group in GROUPS for code in group.CODES)
REFUSED: dict[str, Refused] = {code.name: code for code in passive.REFUSED}
ALIASES: dict[str, Alias] = {alias.name: alias for group in (modes, tools) for alias in group.ALIASES}
INCH_METRIC = {alias.name: alias.code for alias in modes.ALIASES}  # where the dialect has them
LISTED = {code.name: code.listed for code in CODES.values() if code.listed}

# What a code that is not acted upon would change, by its beginning.
CHANGES = (
    (("G41", "G42"), "the whole path, by the tool's radius"),
    (("G5 ", "G5.", "G05"), "the path between its points"),
    (("G43.4", "G43.5"), "the path of the tip wherever a rotary axis moves"),
    (("G43.2",), "the height of the tip"),
    (("G51",), "the size of the path"),
    (("G68.2",), "the whole path: it is turned in space"),
    (("G65", "G66", "M97", "M98", "O word"), "the path by whatever is called"),
    (("G33", "G74", "G76", "G84"), "the path by the thread's moves"),
    (("G86", "G87", "G88", "G12", "G13", "G70", "G71", "G72"), "the path by the cycle's moves"),
    (("G38",), "where the tool stops, which only the machine knows"),
    (("G61", "G64"), "corners, which a control rounds or stops at, and so the time"),
    (("G7 ",), "the size of X"),
    (("G96", "M48", "M49", "M50", "M51", "M52", "M53"), "speeds and times"),
    (("variables", "expressions"), "every coordinate that depends on them"),
)


def code_meaning(name: str) -> str:
    """What a code is taken for, in a few words."""
    if name in CODES:
        code = CODES[name]
        return f"{code.listed}: not acted upon" if code.listed else code.label or code.meaning
    if name in REFUSED:
        return f"{REFUSED[name].what}: not supported"
    if name in ALIASES and ALIASES[name].label:
        return ALIASES[name].label
    return "not known" if name.startswith("G") else "an M code of one control: not acted upon"


def would_change(text: str) -> str:
    """What the word at the beginning of `text` would change of the path or its time; "" if nothing is known."""
    for beginnings, changes in CHANGES:
        if (text + " ").startswith(beginnings):
            return changes
    word = text.split(" ", maxsplit=1)[0]
    if word.startswith("M") and word[1:].isdigit() and f"M{int(word[1:])}" not in CODES:
        return "what is not known: it may run anything on its control"
    return ""
