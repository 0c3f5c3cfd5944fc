"""The words of a block in Siemens' language, and the statements that steer the run; evaluated as they are read.

SIEMENS, SINUMERIK 840D sl, Programming Manual Fundamentals, "Structure and contents of an NC program", "Non-modal
absolute and incremental dimensions"; Job Planning, "Definition of user variables", "Control structures".
"""

import re
from collections.abc import Callable

from toolpath_stiff.nc.parametric.expressions import Value as Number
from toolpath_stiff.nc.parametric.formulas import Value
from toolpath_stiff.nc.parametric.statements import Steering
from toolpath_stiff.nc.siemens.cycles import SIGNATURES, TEXTS
from toolpath_stiff.nc.siemens.expressions import NAME, SiemensScanner
from toolpath_stiff.nc.siemens.motion import CORNERS, VECTOR
from toolpath_stiff.nc.siemens.vocabulary import REFUSED, TABLE, WORDS
from toolpath_stiff.nc.words import AXES, Word

PLAIN = re.compile(r"([A-Z]) ?([+-]?(?:\d++\.?+\d*+|\.\d++)(?:EX[+-]?\d++)?)(?!\s*=(?!=)|\[|_)", re.ASCII)
LITERAL = re.compile(r"([A-Z]\w*)=([+-]?(?:\d++\.?+\d*+|\.\d++))(?=\s|$)", re.ASCII)
IN_BRACKETS = re.compile(r'\((?:[^()"]|"[^"]*"|\((?:[^()"]|"[^"]*")*\))*\)?')
DIMENSION = re.compile(r"(IC|ACP|ACN|AC|DC)(?=\s*\()")
PREFIX = {"IC": "I", "AC": "@", "DC": "DC", "ACP": "ACP", "ACN": "ACN", "": ""}
JUMP = re.compile(r"(GOTO[FBC]?)\s+([A-Z_]\w*|:?\d+)\s*$", re.ASCII)
DEFAULT, CASE_JUMP = re.compile(r"DEFAULT\b"), re.compile(r"\s*(GOTO[FB]?)\s+([A-Z_]\w*|:?\d+)\s*", re.ASCII)
SECTION = re.compile(r"(REPEATB?)\s+(?!P\s*=)([A-Z_:]\w*)(?:\s+(?!P\s*=)(\w+))?", re.ASCII)
TYPES: dict[str, Value] = {"REAL": 0.0, "INT": 0.0, "BOOL": False, "CHAR": "", "STRING": ""}
ADDRESSES = {
    *AXES, *VECTOR, *CORNERS, *WORDS, *"IJKFSTDMGH", "RP", "AP", "CR", "AR", "TURN", "I1", "J1", "K1", "RPL", "FP",
    "X1", "Y1", "Z1", "ANG", "RNDM",
}  # fmt: skip
STEERING = (
    "ELSE", "ENDIF", "ENDWHILE", "LOOP", "ENDLOOP", "ENDFOR", "RET", "ENDPROC", "FOR", "IF", "WHILE", "UNTIL", "CASE",
)  # fmt: skip
OTHERWISE = {"T": "#", "RP": "PR", "AP": "PA", "CR": "R"}  # other names under which these words are kept
SPINDLE = re.compile(r"([SM])(\d+)")  # of a spindle; 1: the master spindle
Define = Callable[[str, Value, int, str], None]  # sets a variable: name, value, column, its type if it is declared


def steering_of(scanner: SiemensScanner, evaluate: Callable[[int], Number]) -> Steering | None:
    """The effect of a block on the flow; None if it only acts. `evaluate`: the value of the expression at a place."""
    scanner.blanks()
    begin, column, plain = scanner.position, scanner.column, PLAIN.match(scanner.text, scanner.position)
    name = scanner.take(NAME)
    if not name or (plain and name[0] != "L") or name in ("DEF", "PROC"):
        return None
    jump, values = JUMP.search(scanner.text, begin), (evaluate(scanner.position),)
    if jump is not None and (name == "IF" or name.startswith("GOTO")):
        return Steering("JUMP", f"{jump[1]} {jump[2]}", jump[0], column, values if name == "IF" else ())
    scanner.refuse_if(name.startswith("GOTO"), f"{scanner.text[begin:].strip()[:30]} names no label", "GOTOF LABEL")
    if name in STEERING:
        return Steering(name, "", name, column, values)
    if name in ("REPEAT", "REPEATB"):
        return Steering("SECTION" if SECTION.match(scanner.text, begin) else "DO UNTIL", "", name, column)
    scanner.blanks()
    a_word = name in TABLE or name in REFUSED or name in ADDRESSES or scanner.begins("[", "=")
    return None if a_word else Steering("CALL", name, name, column)


def chosen(scanner: SiemensScanner) -> tuple[str, str] | None:
    """The way and the label that CASE ... OF 1 GOTOF ONE 2 GOTOF TWO DEFAULT GOTOF REST chooses; None: it goes on."""
    scanner.part(NAME)
    value, way = scanner.real(), None
    wrong = scanner.part(NAME) != "OF"
    while not wrong and not scanner.done:
        case = scanner.part(DEFAULT) or scanner.real()
        jump = CASE_JUMP.match(scanner.text, scanner.position)
        wrong = jump is None
        if jump is not None:
            scanner.position = jump.end()
            if case == value:
                return jump[1], jump[2]
            way = (jump[1], jump[2]) if case == "DEFAULT" else way
    scanner.refuse_if(wrong, "CASE of another form", "CASE R1 OF 1 GOTOF ONE 2 GOTOF TWO DEFAULT GOTOF REST")
    return way


def range_of(scanner: SiemensScanner) -> tuple[str, float, float]:
    """The variable, first value and last value of a FOR."""
    scanner.part(NAME)
    name = scanner.part(NAME) + scanner.index()
    scanner.refuse_if(not scanner.sign("="), "FOR without its first value", "FOR I=1 TO 5")
    first = scanner.real()
    scanner.refuse_if(scanner.part(NAME) != "TO", "FOR without TO", "FOR I=1 TO 5")
    return name, first, scanner.real()


def section_of(scanner: SiemensScanner) -> tuple[str, str, str, int]:
    """REPEAT or REPEATB, the first and the last label of its section ("": not given), and how often it runs."""
    section = SECTION.match(scanner.text, scanner.position)
    assert section is not None
    scanner.position = section.end()
    times = scanner.times()
    scanner.refuse_if(not scanner.done, f"{scanner.rest()} behind {section[1]}", "REPEAT LABEL P=2")
    return section[1], section[2], section[3] or "", times


def read_words(scanner: SiemensScanner, define: Define) -> list[Word]:
    """The words of a block; sets variables along the way. Raises `InputError` with line and column."""
    words = list[Word]()
    while True:
        scanner.blanks()
        if scanner.done:
            return words
        begin, column, plain = scanner.position, scanner.column, PLAIN.match(scanner.text, scanner.position)
        if plain is not None:
            scanner.position = plain.end()
            letter = "#" if plain[1] == "T" else plain[1]
            words.append(Word(letter, float(plain[2].replace("EX", "E")), column, plain[0]))
            continue
        literal = LITERAL.match(scanner.text, scanner.position)
        if literal is not None and literal[1] in ADDRESSES:  # shortcut for most words
            scanner.position = literal.end()
            words.append(Word(OTHERWISE.get(literal[1], literal[1]), float(literal[2]), column, literal[0]))
            continue
        name = scanner.take(NAME)
        scanner.refuse_if(not name, f"{scanner.rest()} is no word", "words such as X10, X=R1, CR=5", column=column)
        if name == "DEF":
            _declare(scanner, define)
            continue
        if name == "EXTERN":  # declares a subprogram's parameters: its PROC does too
            scanner.position = len(scanner.text)
            return [*words, Word(name, 0.0, column, name)]
        index = scanner.index()
        if scanner.begins("==") or not scanner.sign("="):
            words += _named(scanner, name, column)
            continue
        if name == "$P_UIFR":
            words += _offset(scanner, index, column)
            continue
        spindle = SPINDLE.fullmatch(name)
        if spindle and spindle[2] != "1":
            scanner.result()
            words.append(Word("SPOS", 0.0, column, scanner.text[begin : scanner.position]))
            continue
        name = spindle[1] if spindle else name
        if name in REFUSED:
            if scanner.result():  # a zero switches it off
                words.append(Word(name, 0.0, column, name))
        elif name in ADDRESSES:
            words.append(_addressed(scanner, name, column, begin))
        else:
            define(name + index, scanner.result(), column, "")


def _addressed(scanner: SiemensScanner, name: str, column: int, begin: int) -> Word:
    """The word of an address with `=`: X=10, X=IC(5), T="MILL"."""
    dimension = scanner.part(DIMENSION)
    values = scanner.arguments() if dimension else [scanner.result()]
    shown, value = scanner.text[begin : scanner.position], values[0] if len(values) == 1 else None
    scanner.refuse_if(value is None, f"{shown} with no value, or several", "one", column=column)
    if isinstance(value, str):
        scanner.refuse_if(name != "T", f"{shown} is no number", "a number", column=column)
        return Word('"', 0.0, column, value)
    name = OTHERWISE.get(name, name)
    letter = name if name in ("#", "PA", "PR") and dimension == "AC" else PREFIX[dimension] + name
    return Word(letter, float(value or 0.0), column, shown)


def _offset(scanner: SiemensScanner, index: str, column: int) -> list[Word]:
    """A settable offset: $P_UIFR[1]=CTRANS(X,10,Y,5), $P_UIFR[1,X,TR]=10."""
    number, *part = index.strip("[]").split(",")
    scanner.refuse_if(not number.isdigit(), f"$P_UIFR{index} without its number", "$P_UIFR[1]", column=column)
    words = [Word("$P_UIFR", float(number), column, f"$P_UIFR{index}")]
    if part:
        known = len(part) == 2 and part[0] in tuple(AXES) and part[1] == "TR"
        scanner.refuse_if(not known, f"$P_UIFR{index} is no shift of an axis", "$P_UIFR[1,X,TR]", column=column)
        return [*words, Word(part[0], scanner.real(), column, part[0]), Word("TR", 0.0, column, "TR")]
    while len(words) == 1 or scanner.sign(":"):
        name, values = scanner.part(NAME), scanner.arguments(range(0, 2 * len(AXES), 2))
        for axis, value in zip(values[::2], values[1::2], strict=False):
            shifts = name == "CTRANS" and str(axis) in tuple(AXES) and isinstance(value, float)
            wrong = not shifts and (name != "CROT" or value)
            scanner.refuse_if(wrong, f"$P_UIFR with more than a shift: {name}", "CTRANS(X,10,Y,5)", column=column)
            words += [Word(str(axis), float(value or 0.0), column, str(axis))] if shifts else []
        words += [Word("FRAME", 0.0, column, name)] if len(words) == 1 else []
    return words


def _named(scanner: SiemensScanner, name: str, column: int) -> list[Word]:
    """A word without a number, and the parameters in its brackets if these are known by name."""
    scanner.blanks()
    words = [Word(name, 0.0, column, name)]
    if name in SIGNATURES and scanner.begins("("):
        names, values = SIGNATURES[name].split(), scanner.arguments()
        for key, value in zip(names, values, strict=False):
            if value is not None:
                is_text = isinstance(value, str) and bool(value) and key not in TEXTS
                scanner.refuse_if(is_text, f"{name} with the text {value!r} for {key}", "a number", column=column)
                text = value if isinstance(value, str) else f"{key}={value:g}"
                words.append(Word(key, 0.0 if isinstance(value, str) else float(value), column, text))
        scanner.refuse_if(any(values[len(names) :]), f"{name} with {len(values)} parameters", f"{len(names)} of them")
    else:
        scanner.take(IN_BRACKETS)
    return words


def _declare(scanner: SiemensScanner, define: Define) -> None:
    """DEF REAL A=5, B[10]: variables with their first values."""
    kind = scanner.part(NAME)
    scanner.refuse_if(kind not in TYPES, f"DEF {kind} is not supported", f"DEF {', DEF '.join(TYPES)}")
    scanner.index()  # skip the length of a text
    while True:
        column, name = scanner.column, scanner.part(NAME)
        scanner.refuse_if(not name, f"{scanner.rest()} is no name of a variable", "DEF REAL LENGTH=5", column=column)
        array = bool(scanner.index())
        given = scanner.result() if scanner.sign("=") else TYPES[kind]
        scanner.refuse_if(array and given != TYPES[kind], f"{name} with first values", "its elements one by one")
        define(name + "[]" * array, bool(given) if kind == "BOOL" else given, column, kind)
        if not scanner.sign(","):
            return
