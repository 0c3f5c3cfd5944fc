"""Signs of a lathe's program, whose X is a diameter; two of them, and it is refused."""

import re
from collections.abc import Iterable, Mapping, Sequence

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.moves import Moves, Remark
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.state import LATHE_HINT

HEAD = 2000  # lines: a lathe's program shows what it is at its beginning
_NO_CODE = re.compile(r"\([^)]*\)?|;.*|<[^>]*>")  # comments, names
_M6, _Y = r"M0*6(?![\d.])", r"(?<![A-Z])Y[-+]?[\d.#\[]"
_CYCLE = r"G8[1-9](?![\d.])"  # of a mill, which G99 belongs to
_OTHER_U = r"^(?!.*G(?:0*(?:28|30)|6[56])(?![\d.])).*"  # not homes, nor arguments of a macro
# Fanuc, operator's manuals of lathes, G-code system A: T has the tool and its offset, U and W are X and Z in steps,
# G98 and G99 the feed per minute and per revolution. A sign, its pattern, what the program then has not, and has too.
SIGNS = (
    ("T with four digits and no M6", r"T\d{4}(?![\d.])", _M6, ""),
    ("G18 and never Y", r"G18(?![\d.])", _Y, ""),
    ("a U or W word", _OTHER_U + r"(?<![A-Z])[UW][-+]?[\d.#\[]", "", ""),
    ("G28 with U or W", r"G0*(?:28|30)(?![\d.]).*[UW][-+]?[\d.]", "", ""),
    ("G99 and a feed below 1 a revolution", r"(?<![A-Z])F0*\.\d*[1-9]", _CYCLE, r"G99(?![\d.])"),
    ("G96 and never Y", r"G96(?![\d.])", _Y, ""),
)


def lathe_program(lines: Sequence[str], name: str) -> InputError | None:
    """The error for a lathe's program; None where not two signs are there.

    Examples
    --------
    >>> print(lathe_program(("G28 U0 W0", "T0101", "G1 X20. F200"), "shaft.nc"))  # doctest: +ELLIPSIS
    shaft.nc:1: a lathe's program: G28 with U or W (line 1), T with four digits and no M6 (line 2); expected ...
    >>> lathe_program(("G28 U0 W0", "T1 M6", "G1 X20. F200"), "plate.nc")
    """
    signs = _signs(lines[:HEAD])
    if len(signs) > 1 and len(lines) > HEAD:
        signs = _signs(lines)
    if len(signs) < 2:
        return None
    return Place(name, signs[0][0]).fail(
        f"a lathe's program: {', '.join(f'{what} (line {line})' for line, what in signs)}",
        "a mill's: on a lathe X is a diameter",
        f"{LATHE_HINT}; one of LinuxCNC's lathes, whose X is a radius (G8), is read with --dialect linuxcnc",
    )


def _signs(lines: Iterable[str]) -> list[tuple[int, str]]:
    """Line (from 1) and name of each sign, in the order of lines."""
    text = "\n".join("".join(_NO_CODE.sub(" ", line).split()).upper() for line in lines)
    signs = []
    for what, pattern, nowhere, beside in SIGNS:
        sign = re.search(pattern, text, re.MULTILINE)
        if sign and not (nowhere and re.search(nowhere, text)) and re.search(beside, text):
            signs.append((text.count("\n", 0, sign.start()) + 1, what))
    return sorted(signs)


def lathe_warning(signs: Mapping[str, int], moves: Moves | None) -> list[Remark]:
    """What makes a program look like a lathe's (with its line), if nothing of it ever moves along Y."""
    if moves is None or not signs or (moves.start[:, 1] != moves.end[:, 1]).any() or moves.arc_normal[:, 2].any():
        return []
    what, line = next(iter(signs.items()))
    text = f"{what} and no move along Y: this looks like a lathe's program. X is read as a position; "
    return [Remark(f"{text}where it is a diameter, the path is wrong", line)]
