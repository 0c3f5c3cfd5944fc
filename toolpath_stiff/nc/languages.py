"""The language of a program, recognised by its lines.

Cutter-location files and the languages of `READ` have readers; others, and programs of lathes, are refused by name.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import LANGUAGES, Dialect
from toolpath_stiff.nc.moves import Moves, Remark
from toolpath_stiff.nc.place import Place
from toolpath_stiff.nc.state import LATHE_HINT

# Signs of cutter-location files, which are not blocks of words: they are known here, while their own
# reader is loaded only for them.
EXTENSIONS = (".apt", ".aptsource", ".cl", ".cls", ".clsf", ".ncl")
HEAD_LINES = 50  # a file shows its language at its beginning, apart from comments and blank lines
# Lines that cannot be G code.
STATEMENT = re.compile(
    r"\s*(?:N?\d+\s+)?(?:(?:GOTO|FROM|FEDRAT|CUTTER|LOADTL|UNITS?|MACHIN|SPINDL|TLDATA|MSYS|TOOL\s+PATH|TLAXIS|TOOLNO"
    r"|GODLTA|INTOL|OUTTOL)\s*/|PPRINT\b|PARTNO\b|MULTAX\s*(?:/|$)|(?:RAPID|FINI)\s*$)",
    re.IGNORECASE,
)

G_CODE, CUTTER_LOCATION_FILE = "G code", "cutter-location file (APT)"
_HEIDENHAIN = LANGUAGES["heidenhain"]
_SIEMENS = LANGUAGES["siemens"]
_DIN_ISO = "the DIN/ISO language of Heidenhain's controls"
_ISG = "ISG's own language (Beckhoff TwinCAT CNC)"
_ACRAMATIC = "the language of Acramatic controls (Cincinnati, Vickers)"
_SUB = "neither LinuxCNC's language (o<name> sub) nor Fanuc's"
HINTS = {
    _HEIDENHAIN: "post it as ISO G code, in X, Y, Z, A, B, C of the tool tip",
    _DIN_ISO: "post it as conversational language (.h), or as ISO G code of another control",
    _SIEMENS: "one language throughout, or the program alone",
    _ISG: "post it as ISO G code: no # commands, no $IF, no V. variables",
    _ACRAMATIC: "post it as ISO G code of Fanuc's or LinuxCNC's kind",
    _SUB: "post it as ISO G code, or write its subprograms as LinuxCNC's O words",
}
READ = {language: dialect for dialect, language in LANGUAGES.items()}
LONGEST_SIGN = 200  # characters of a line that are examined
# Beginnings of a block, after blanks and N words, that no G code of the supported controls has.
_SIGNS = (
    (_HEIDENHAIN, r"BEGIN\s+PGM\b"),
    (_HEIDENHAIN, r"(?:L|LN|C|CC|CR|CT|RND|CHF)\s[^(;]*\bF\s*MAX\b|C\s+I?[A-Z][+-][^(;]*\bDR[+-]"),
    (_HEIDENHAIN, r"(?:L|CC|LN)\s+I?[XYZABC][+-]"),
    (_HEIDENHAIN, r"TOOL\s+(?:CALL|DEF)\b|CYCL\s+(?:DEF|CALL)\b|BLK\s+FORM\b|CALL\s+LBL\b|LBL\s+\d|PLANE\s+[A-Z]+"),
    (_DIN_ISO, r"%\S+\s+G7[01]\b"),
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

PLAIN_LANGUAGE = re.compile(r"\s*(?:N?\d+\s+)?BEGIN\s+PGM\b", re.IGNORECASE)  # also behind a long heading
# Signs of Siemens' programs that begin like G code.
LATE_SIGN = re.compile(
    r"\s*(?:N\d+\s+)?(?:(?:MCALL\s+)?CYCLE\d+\s*\(|MSG\s*\(|A?TRANS\b|TRAORI\b|SUPA\b|R\d+\s*=|T\s*=\s*\"|"
    r"(?:[A-Z]++[\d.+-]*+\s++)*(?:CR|[XYZ])\s*=)",
    re.IGNORECASE,
)
# Signs absent from Siemens' language but present in the ISO dialect of the same controls.
_ISO = re.compile(r"\s*\(|[^;(]*(?<![A-Z])G(?:2[018]|43|8\d|9[89])(?![\d.])|\s*O\d", re.IGNORECASE)
LATHE_LINES = 2000  # lines: a lathe's program shows what it is at its beginning
_NO_CODE = re.compile(r"\([^)]*\)?|;.*|<[^>]*>")  # comments, names
_M6, _Y = r"M0*6(?![\d.])", r"(?<![A-Z])Y[-+]?[\d.#\[]"
_CYCLE = r"G8[1-9](?![\d.])"  # a mill's cycle, to which G99 belongs
_OTHER_U = r"^(?!.*G(?:0*(?:28|30)|6[56])(?![\d.])).*"  # neither homes nor arguments of a macro
# Fanuc, operator's manuals of lathes, G-code system A: T has the tool and its offset, U and W are X and Z in steps,
# G98 and G99 the feed per minute and per revolution. A sign, its pattern, what the program then has not, and has too.
LATHE_SIGNS = (
    ("T with four digits and no M6", r"T\d{4}(?![\d.])", _M6, ""),
    ("G18 and never Y", r"G18(?![\d.])", _Y, ""),
    ("a U or W word", _OTHER_U + r"(?<![A-Z])[UW][-+]?[\d.#\[]", "", ""),
    ("G28 with U or W", r"G0*(?:28|30)(?![\d.]).*[UW][-+]?[\d.]", "", ""),
    ("G99 and a feed below 1 a revolution", r"(?<![A-Z])F0*\.\d*[1-9]", _CYCLE, r"G99(?![\d.])"),
    ("G96 and never Y", r"G96(?![\d.])", _Y, ""),
)


def language_of(line: str) -> str | None:
    """Other language in which a line is written, or None.

    Examples
    --------
    >>> language_of("L X+10 Y+20 R0 F MAX")
    "Heidenhain's conversational language"
    >>> language_of("G1 X10 Y20")
    """
    head = line.lstrip()[:LONGEST_SIGN]
    return next((what for what, pattern in _PATTERNS if pattern.match(head)), None)


def recognise(lines: tuple[str, ...], name: str, dialect: Dialect) -> tuple[str, str]:
    """Language of a program and the sign of it: from its first lines, unless the dialect decides.

    Examples
    --------
    >>> from toolpath_stiff.nc.controller import GENERIC
    >>> recognise(("0 BEGIN PGM PLATE MM", "1 L X+10 FMAX"), "plate.h", GENERIC)
    ("Heidenhain's conversational language", "line 1: '0 BEGIN PGM PLATE MM'")
    >>> recognise(("G21", "G1 X1 F100"), "plate.nc", GENERIC)
    ('G code', 'no sign of another language')
    """
    if dialect.name in LANGUAGES:
        return LANGUAGES[dialect.name], f"as asked for: --dialect {dialect.name}"
    if looks_like_cutter_location(lines, name):
        return CUTTER_LOCATION_FILE, "its ending, or statements such as GOTO/"
    for index, line in enumerate(lines[:LATHE_LINES]):
        language = language_of(line) if index < HEAD_LINES else _HEIDENHAIN if PLAIN_LANGUAGE.match(line) else None
        language = language or (_SIEMENS if LATE_SIGN.match(line) else None)
        if language is not None:
            return language, f"line {index + 1}: {line.strip()[:40]!r}"
    if name.lower().endswith((".mpf", ".spf")):
        iso = next((line for line in lines[:LATHE_LINES] if _ISO.match(line)), None)
        return (
            (_SIEMENS, "its ending")
            if iso is None
            else (G_CODE, f"the ISO dialect in spite of its ending: {iso[:40]!r}")
        )
    return G_CODE, "no sign of another language"


def foreign_program(lines: tuple[str, ...], name: str, suspect: int | None = None) -> InputError | None:
    """Error for a program in another language; `suspect` is a line (from 1) that could not be read as G code."""
    places = list(range(min(HEAD_LINES, len(lines))))
    if suspect is not None and 0 < suspect <= len(lines):
        places.append(suspect - 1)
    for index in places:
        language = language_of(lines[index])
        if language is not None:
            problem = f"{lines[index].strip()[:40]!r} is {language}, which is not read"
            problem += " among G code" if language in READ else ""
            return Place(name, index + 1).fail(problem, "G code", HINTS[language])
    return None


def refused_program(lines: tuple[str, ...], name: str, dialect: Dialect) -> InputError | None:
    """Error for a program in another language, or for a lathe; LinuxCNC's lathes have X as a position."""
    foreign = foreign_program(lines, name)
    return foreign if foreign is not None or dialect.name == "linuxcnc" else lathe_program(lines, name)


def looks_like_cutter_location(lines: tuple[str, ...], name: str) -> bool:
    """True if a file is a cutter-location file, by its extension or by its beginning.

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
    """True if any of these lines is a statement that cannot be mistaken for other text."""
    return any(STATEMENT.match(line) for line in lines)


def lathe_program(lines: Sequence[str], name: str) -> InputError | None:
    """Error for a lathe's program; None without two signs of one.

    Examples
    --------
    >>> print(lathe_program(("G28 U0 W0", "T0101", "G1 X20. F200"), "shaft.nc"))  # doctest: +ELLIPSIS
    shaft.nc:1: a lathe's program: G28 with U or W (line 1), T with four digits and no M6 (line 2); expected ...
    >>> lathe_program(("G28 U0 W0", "T1 M6", "G1 X20. F200"), "plate.nc")
    """
    signs = _lathe_signs(lines[:LATHE_LINES])
    if len(signs) > 1 and len(lines) > LATHE_LINES:
        signs = _lathe_signs(lines)
    if len(signs) < 2:
        return None
    return Place(name, signs[0][0]).fail(
        f"a lathe's program: {', '.join(f'{what} (line {line})' for line, what in signs)}",
        "a mill's: on a lathe X is a diameter",
        f"{LATHE_HINT}; one of LinuxCNC's lathes, whose X is a radius (G8), is read with --dialect linuxcnc",
    )


def _lathe_signs(lines: Iterable[str]) -> list[tuple[int, str]]:
    """Line (from 1) and name of each sign, in order of lines."""
    text = "\n".join("".join(_NO_CODE.sub(" ", line).split()).upper() for line in lines)
    signs = []
    for what, pattern, nowhere, beside in LATHE_SIGNS:
        sign = re.search(pattern, text, re.MULTILINE)
        if sign and not (nowhere and re.search(nowhere, text)) and re.search(beside, text):
            signs.append((text.count("\n", 0, sign.start()) + 1, what))
    return sorted(signs)


def lathe_warning(signs: Mapping[str, int], moves: Moves | None) -> list[Remark]:
    """Warning on the first sign (with its line) of a lathe's program, if no move is along Y."""
    if moves is None or not signs or (moves.start[:, 1] != moves.end[:, 1]).any() or moves.arc_normal[:, 2].any():
        return []
    what, line = next(iter(signs.items()))
    text = f"{what} and no move along Y: this looks like a lathe's program. X is read as a position; "
    return [Remark(f"{text}where it is a diameter, the path is wrong", line)]
