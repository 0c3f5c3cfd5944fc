"""Files that are not G code, recognised by their lines: cutter-location files; other languages, refused by name."""

import re
from collections.abc import Iterable
from itertools import islice

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import Dialect
from toolpath_stiff.nc.lathes import lathe_program
from toolpath_stiff.nc.place import Place

# Of cutter-location files, which are not blocks of words: what tells them from G code is known here, their own
# reader is loaded for them alone.
EXTENSIONS = (".apt", ".aptsource", ".cl", ".cls", ".clsf", ".ncl")
HEAD_LINES = 50  # a file says what it is at its beginning, comments and blank lines apart
# What no line of G code looks like.
STATEMENT = re.compile(
    r"\s*(?:N?\d+\s+)?(?:(?:GOTO|FROM|FEDRAT|CUTTER|LOADTL|UNITS?|MACHIN|SPINDL|TLDATA|MSYS|TOOL\s+PATH|TLAXIS|TOOLNO"
    r"|GODLTA|INTOL|OUTTOL)\s*/|PPRINT\b|PARTNO\b|MULTAX\s*(?:/|$)|(?:RAPID|FINI)\s*$)",
    re.IGNORECASE,
)

_HEIDENHAIN = "Heidenhain's conversational language"
_SIEMENS = "Siemens' own language (Sinumerik)"
_ISG = "ISG's own language (Beckhoff TwinCAT CNC)"
_ACRAMATIC = "the language of Acramatic controls (Cincinnati, Vickers)"
_SUB = "neither LinuxCNC's language (o<name> sub) nor Fanuc's"
HINTS = {
    _HEIDENHAIN: "post it as ISO G code, in X, Y, Z, A, B, C of the tool tip",
    _SIEMENS: "post it as ISO G code: no frames (TRANS, ROT), no CYCLE calls, no variables, no X=... words",
    _ISG: "post it as ISO G code: no # commands, no $IF, no V. variables",
    _ACRAMATIC: "post it as ISO G code of Fanuc's or LinuxCNC's kind",
    _SUB: "post it as ISO G code, or write its subprograms as LinuxCNC's O words",
}
LONGEST_SIGN = 200  # characters of a line that are looked at
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
    (_ISG, r"#\s*SLOPE\b|SLOPE\s*\[|#\s*(?:TRAFO|HSC|RTCP|CS|MCS|SCALE)\s+(?:ON|OFF)\b|\$(?:IF|FOR|WHILE|ENDIF)\b"),
    (_ACRAMATIC, r":?\s*\(\s*PGM\s*,\s*NAME\s*="),
    (_SUB, r"SUB\s+\w+\s*\["),
    (_SIEMENS, r"(?:[A-Z]++[\d.+-]*+\s++)*(?:T\s*=\s*\"|[XYZABCIJKFS]\d?\s*=|CR\s*=|(?:A3|B3|C3|AP|RP)\s*=)"),
)


_PATTERNS = [(what, re.compile(rf"\s*(?:N\d+\s+|\d+\s+)?(?:{sign})", re.IGNORECASE)) for what, sign in _SIGNS]


def language_of(line: str) -> str | None:
    """The other language that a line is written in, or None.

    Examples
    --------
    >>> language_of("L X+10 Y+20 R0 F MAX")
    "Heidenhain's conversational language"
    >>> language_of("G1 X10 Y20")
    """
    head = line.lstrip()[:LONGEST_SIGN]
    return next((what for what, pattern in _PATTERNS if pattern.match(head)), None)


def foreign_program(lines: tuple[str, ...], name: str, suspect: int | None = None) -> InputError | None:
    """The error for a program in another language; `suspect` is a line (from 1) that could not be read as G code."""
    places = list(range(min(HEAD_LINES, len(lines))))
    if suspect is not None and 0 < suspect <= len(lines):
        places.append(suspect - 1)
    for index in places:
        language = language_of(lines[index])
        if language is not None:
            problem = f"{lines[index].strip()[:40]!r} is {language}, which is not read"
            return Place(name, index + 1).fail(problem, "G code", HINTS[language])
    return None


def refused_program(lines: tuple[str, ...], name: str, dialect: Dialect) -> InputError | None:
    """The error for a program in another language, or for a lathe; LinuxCNC's lathes have X as a position."""
    foreign = foreign_program(lines, name)
    return foreign if foreign is not None or dialect.name == "linuxcnc" else lathe_program(lines, name)


def looks_like_cutter_location(lines: tuple[str, ...], name: str) -> bool:
    """Whether a file is a cutter-location file, by its extension or by how it begins.

    Examples
    --------
    >>> looks_like_cutter_location(("$$ part 7", "UNITS/MM", "GOTO/1,2,3"), "part.txt")
    True
    >>> looks_like_cutter_location(("G21", "G1 X1 F100"), "part.txt")
    False
    """
    if name.lower().endswith(EXTENSIONS):
        return True
    texts = (line for line in lines if line.strip() and not line.lstrip().startswith("$$"))
    return any_statement(islice(texts, HEAD_LINES))


def any_statement(lines: Iterable[str]) -> bool:
    """Whether any of these lines is a statement that no other text looks like."""
    return any(STATEMENT.match(line) for line in lines)
