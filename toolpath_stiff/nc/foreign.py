"""Programs in other languages than G code, told by their look, so that they can be refused by name."""

from __future__ import annotations

import re

from toolpath_stiff.errors import InputError

HEAD_LINES = 50  # a file says what it is at its beginning

_HEIDENHAIN = "Heidenhain's conversational language"
_SIEMENS = "Siemens' own language (Sinumerik)"
HINTS = {
    _HEIDENHAIN: "post it as ISO G code, in X, Y, Z, A, B, C of the tool tip",
    _SIEMENS: "post it as ISO G code: no frames (TRANS, ROT), no CYCLE calls, no variables, no X=... words",
}
# What no G code of the controls read here has at the beginning of a block, blanks and N words apart.
_SIGNS = (
    (_HEIDENHAIN, r"BEGIN\s+PGM\b"),
    (_HEIDENHAIN, r"(?:L|LN|C|CC|CR|CT|RND|CHF)\s[^(;]*\bF\s*MAX\b|C\s+I?[A-Z][+-][^(;]*\bDR[+-]"),
    (_HEIDENHAIN, r"(?:L|CC|LN)\s+I?[XYZABC][+-]"),
    (_HEIDENHAIN, r"TOOL\s+(?:CALL|DEF)\b|CYCL\s+(?:DEF|CALL)\b|BLK\s+FORM\b|CALL\s+LBL\b|LBL\s+\d|PLANE\s+[A-Z]+"),
    (_SIEMENS, r";\s*\$PATH\s*=|%_N_\w+_(?:MPF|SPF)\b"),
    (_SIEMENS, r"DEF\s+(?:REAL|INT|BOOL|STRING|CHAR|AXIS|FRAME)\b|PROC\s+\w+|EXTERN\s+\w+"),
    (_SIEMENS, r"MSG\s*\(|(?:CYCLE|POCKET|SLOT|HOLES)\d+\s*\(|WORKPIECE\s*\("),
    (_SIEMENS, r"A?(?:TRANS|ROT|SCALE|MIRROR)(?:\s|;|$)|TRAORI\b|TRAFOOF\b|SUPA\b|D?R\d+\s*="),
    (_SIEMENS, r"(?:[A-Z]+\d*[\d.+-]*\s+)*(?:T\s*=\s*\"|[XYZABCIJKFS]\d?\s*=|CR\s*=|(?:A3|B3|C3|AP|RP)\s*=)"),
)
_PATTERNS = tuple((what, re.compile(r"\s*(?:N\d+\s+|\d+\s+)?(?:" + sign + ")", re.IGNORECASE)) for what, sign in _SIGNS)


def language_of(line: str) -> str | None:
    """The other language that a line is written in, or None."""
    return next((what for what, pattern in _PATTERNS if pattern.match(line)), None)


def foreign_program(lines: tuple[str, ...], name: str, suspect: int | None = None) -> InputError | None:
    """The error for a program in another language; `suspect` is a line (from 1) that could not be read as G code."""
    places = list(range(min(HEAD_LINES, len(lines))))
    if suspect is not None and 0 < suspect <= len(lines):
        places.append(suspect - 1)
    for at in places:
        what = language_of(lines[at])
        if what is not None:
            return InputError(
                f"{lines[at].strip()[:40]!r} is {what}, which is not read",
                expected="G code",
                hint=HINTS[what],
                file=name,
                line=at + 1,
            )
    return None
