"""Family of a parametric program: RS274/NGC or Macro B, by its dialect or by its signs."""

import re
from collections.abc import Iterable, Iterator

from toolpath_stiff.nc.controller import Dialect
from toolpath_stiff.nc.place import Place

NGC, MACRO_B, EITHER = "RS274/NGC", "Macro B", "either family"
NGC_WORDS = (
    "SUB", "ENDSUB", "CALL", "RETURN", "IF", "ELSEIF", "ELSE", "ENDIF", "WHILE", "ENDWHILE", "DO", "REPEAT",
    "ENDREPEAT", "BREAK", "CONTINUE",
)  # fmt: skip
# Signs of one family only, in a line without comments and blanks, in upper case.
_BEGIN = r"^(?:/\d?)?(?:N\d+)?"
_NGC_SIGN = re.compile(
    rf"{_BEGIN}O(?:<|\[|#|\d+(?:{'|'.join(NGC_WORDS)}))|#<|\*\*|EXISTS\["  # o<x> sub, #<name>
)
_MACRO_SIGN = re.compile(rf"{_BEGIN}(?:IF\[|WHILE\[|GOTO[\d#\[]|DO\d|END\d)|G6[5-7](?!\d)|POW\[")
_SIGNS = (re.compile(r"[#\[]"), _NGC_SIGN, _MACRO_SIGN)
_COMMENT = re.compile(r"\([^)]*\)|;.*")
_SUSPECT = re.compile(r"[#\[oOiIwWdD]|[gG]\s*0*6")


def line_with_variables(lines: Iterable[str]) -> int:
    """First line, from 1, with a variable, an expression, or flow control; 0 if there is none.

    Examples
    --------
    >>> line_with_variables(("G1 X10 (#1)",)), line_with_variables(("#1 = 5", "G1 X#1"))
    (0, 1)
    """
    return next((number for number, text in _bare(lines) if any(sign.search(text) for sign in _SIGNS)), 0)


def _bare(lines: Iterable[str]) -> Iterator[tuple[int, str]]:
    """Number and text of lines that may matter, without comments and blanks, in upper case."""
    for number, line in enumerate(lines, 1):
        if _SUSPECT.search(line):
            yield number, "".join(_COMMENT.sub(" ", line).split()).upper()


def family_of(lines: tuple[str, ...], dialect: Dialect, name: str) -> str:
    """Family of a program: the dialect's or, for `generic`, the one whose signs the program shows.

    Raises
    ------
    ProgramError
        It shows signs of both.
    """
    if dialect.name == "linuxcnc":
        return NGC
    if dialect.name in ("fanuc", "haas"):
        return MACRO_B
    ngc, macro = (
        next((number for number, text in _bare(lines) if sign.search(text)), 0) for sign in (_NGC_SIGN, _MACRO_SIGN)
    )
    if ngc and macro:
        ours, theirs = "LinuxCNC's language (O words, #<name>, **)", "Macro B (IF GOTO, WHILE DO, G65)"
        problem = f"line {ngc} is of {ours}, line {macro} of {theirs}"
        raise Place(name, max(ngc, macro)).fail(problem, hint="name the control with --dialect")
    return NGC if ngc else MACRO_B if macro else EITHER
