"""Signs of a lathe's program, whose X is a diameter; two of them, and it is refused."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.moves import Moves, Remark
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.state import LATHE_HINT

HEAD = 2000  # lines: a lathe's program shows what it is at its beginning
_NO_CODE = re.compile(r"\([^)]*\)?|;.*|<[^>]*>")  # comments, names
_M6, _Y = re.compile(r"M0*6(?![\d.])"), re.compile(r"(?<![A-Z])Y[-+]?[\d.#\[]")
_CYCLE = re.compile(r"G8[1-9](?![\d.])")  # of a mill, which G99 belongs to
_OTHER_U = re.compile(r"G(?:0*(?:28|30)|6[56])(?![\d.])")  # homes, and gives arguments to a macro


class Sign(NamedTuple):
    """A sign: what it is, in which block (without blanks), and which blocks it is not in, or what the program has not.

    `beside`: what the program has too.
    """

    what: str
    pattern: re.Pattern[str]
    nowhere: re.Pattern[str] | None = None
    not_in: re.Pattern[str] | None = None
    beside: re.Pattern[str] | None = None


# Fanuc, operator's manuals of lathes, G-code system A: T has the tool and its offset, U and W are X and Z in steps,
# G98 and G99 the feed per minute and per revolution.
SIGNS = (
    Sign("T with four digits and no M6", re.compile(r"T\d{4}(?![\d.])"), nowhere=_M6),
    Sign("G18 and never Y", re.compile(r"G18(?![\d.])"), nowhere=_Y),
    Sign("a U or W word", re.compile(r"(?<![A-Z])[UW][-+]?[\d.#\[]"), not_in=_OTHER_U),
    Sign("G28 with U or W", re.compile(r"G0*(?:28|30)(?![\d.]).*[UW][-+]?[\d.]")),
    Sign(
        "G99 and a feed below 1 a revolution", re.compile(r"(?<![A-Z])F0*\.\d*[1-9]"), nowhere=_CYCLE,
        beside=re.compile(r"G99(?![\d.])"),
    ),
    Sign("G96 and never Y", re.compile(r"G96(?![\d.])"), nowhere=_Y),
)  # fmt: skip


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
    blocks = ["".join(_NO_CODE.sub(" ", line).split()).upper() for line in lines]
    text = "\n".join(blocks)
    signs = []
    for sign in SIGNS:
        if (sign.nowhere and sign.nowhere.search(text)) or (sign.beside and not sign.beside.search(text)):
            continue
        for number, block in enumerate(blocks, 1):
            if sign.pattern.search(block) and not (sign.not_in and sign.not_in.search(block)):
                signs.append((number, sign.what))
                break
    return sorted(signs)


def lathe_warning(signs: Mapping[str, int], moves: Moves | None) -> list[Remark]:
    """What makes a program look like a lathe's (with its line), if nothing of it ever moves along Y."""
    if moves is None or not signs or (moves.start[:, 1] != moves.end[:, 1]).any() or moves.arc_normal[:, 2].any():
        return []
    what, line = next(iter(signs.items()))
    text = f"{what} and no move along Y: this looks like a lathe's program. X is read as a position; "
    return [Remark(f"{text}where it is a diameter, the path is wrong", line)]
