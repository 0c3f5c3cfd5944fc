"""Effect files without code: terms as `[[effect]] name = "term"` entries of a TOML file, as a draft writes them.

The terms of a file are one effect; those of the geometry and those of readings have one of their own.
"""

from collections.abc import Sequence
from dataclasses import replace

from toolpath_stiff.documents import Document
from toolpath_stiff.errors import EffectError
from toolpath_stiff.stiffness.contract import Effect, Parameter
from toolpath_stiff.stiffness.declarations import NAME, wrong_in
from toolpath_stiff.stiffness.term_effect import ENDINGS, TermEffect, size_parameter
from toolpath_stiff.stiffness.terms import (
    ALONG,
    ASSUMED,
    AXES,
    FORMULAS,
    IN_SERIES,
    LINKS,
    OF_FORCES,
    PAIR,
    PLACE,
    SEEN,
    SHAPES,
    SWINGS,
    Constants,
    Term,
)
from toolpath_stiff.toml_reader import TomlReader, is_text
from toolpath_stiff.units import RAD_PER_DEG

# Variable -> unit of its constants in files and its SI value; others, and those named below, are plain numbers.
CONSTANT_UNITS = {
    **dict.fromkeys((*PLACE, "strut length", "tool length"), ("mm", 1e-3)),
    **dict.fromkeys(("strut force", "load"), ("N", 1.0)),
    "tilt": ("deg", RAD_PER_DEG),
    "time": ("min", 60.0),
    "temperature": ("C", 1.0),
}
PLAIN = ("power", "side", *PAIR)
LARGEST = 1e9
SHAPE_KEYS = ("varies_with", "of", "shape", "constants")
KEYS = ("name", "size", "meaning", "link", "action", "where", "along", *SHAPE_KEYS, "times")
SHAPES_OF = {**dict.fromkeys(("constant", "direction", "setup"), ("offset",)), "force sign": ("sign",)}
COLUMNS = {"tilt": ("", *AXES, *SWINGS), "joint offset": ("frame", "platform")}


def constant_key(name: str, variable: str) -> tuple[str, float]:
    """Key of a constant in files, with its unit, and the SI value of that unit."""
    unit, si = CONSTANT_UNITS.get(variable, ("", 1.0))
    return (f"{name}_{unit}", si) if unit and name not in PLAIN else (name, 1.0)


def entry_of(term: Term, size: str, meaning: str) -> Document:
    """A term as an entry of a file, in the order of its keys."""
    parameter = size_parameter(term.action, size, meaning)
    bounds, typical = _range_keys(parameter)
    return {
        "name": "term",
        "size": size,
        "meaning": meaning,
        "link": term.link,
        "action": term.action,
        **({} if term.where is None else {"where": term.where}),
        "along": term.direction,
        **_shape_entry(term),
        bounds: list(parameter.bounds),
        typical: list(parameter.typical),
        **({} if term.times is None else {"times": _shape_entry(term.times)}),
    }


def _shape_entry(term: Term) -> Document:
    of = {"of": term.column} if term.column else {}
    keys = [(constant_key(name, term.variable), value) for name, value in term.at]
    constants = {key: float(f"{value / si:.12g}") for (key, si), value in keys}
    return {"varies_with": term.variable, **of, "shape": term.shape, "constants": constants}


def _range_keys(parameter: Parameter) -> tuple[str, str]:
    """Keys of bounds and usual sizes, with their unit."""
    unit = parameter.key.removeprefix(parameter.name)
    return f"bounds{unit}", f"typical{unit}"


def effects_of_terms(file: str) -> dict[str, Effect]:
    """Name -> effect of a file's terms. Raises `InputError` with file, line and key."""
    toml = TomlReader.read(file, "effect file", EffectError)
    toml.only("", toml.data, ("name", "source", "effect", "drawn_from"))
    common, rows = _text(toml, "name", toml.data.get("name")), toml.data.get("effect")
    if not NAME.fullmatch(common):
        raise toml.error(f"name = {common!r}", "letters, digits and underscores, such as missing", where="name")
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise toml.error("no [[effect]]", '[[effect]] with name = "term"', where="effect")
    source = _text(toml, "source", toml.data.get("source", ASSUMED))
    drawn_from = toml.table("drawn_from", toml.data.get("drawn_from", {}), "[drawn_from] with readings")
    toml.only("drawn_from", drawn_from, ("readings",))
    marks = tuple(str(drawn_from.get("readings", "")).split())
    by_ending: dict[str, list[tuple[Term, Parameter]]] = {}
    names: list[str] = []
    for number, row in enumerate(rows, 1):
        term, parameter = _entry(toml, f"effect[{number}]", row)
        if parameter.name in names:
            raise toml.error(f"size {parameter.name!r} is there twice", where=f"effect[{number}].size")
        names.append(parameter.name)
        by_ending.setdefault(ENDINGS.get(term.action, ""), []).append((term, parameter))
    effects = {
        common if len(by_ending) == 1 else f"{common}{ending}": by_ending[ending] for ending in sorted(by_ending)
    }
    return {name: TermEffect(name, entries, source, marks, file) for name, entries in effects.items()}


def _entry(toml: TomlReader, where: str, row: Document) -> tuple[Term, Parameter]:
    """One entry of a file, checked."""
    _choice(toml, where, row, "name", ("term",))
    link = _choice(toml, where, row, "link", LINKS)
    action = _choice(toml, where, row, "action", [action for action, place in ALONG if place == link])
    along = _choice(toml, where, row, "along", ALONG[action, link])
    parameter = _parameter(toml, where, row, action)
    toml.only(where, row, (*KEYS, *_range_keys(parameter)))
    variable, shape, constants, column = _shape(toml, where, row, action, action)
    term = Term(link, along, variable, shape, action, _place(toml, where, row, action), constants, column)
    if "times" in row:
        toml.only(f"{where}.times", toml.table(f"{where}.times", row["times"], "a table"), SHAPE_KEYS)
        term = term.with_second(*_shape(toml, f"{where}.times", row["times"], "", action))
    return term, parameter


def _choice(toml: TomlReader, where: str, row: Document, key: str, choices: Sequence[str]) -> str:
    return toml.choice(f"{where}.{key}", row.get(key), choices, f"one of {', '.join(choices)}")


def _parameter(toml: TomlReader, where: str, row: Document, action: str) -> Parameter:
    """Parameter for the size, with its range."""
    size, meaning = (_text(toml, f"{where}.{key}", row.get(key)) for key in ("size", "meaning"))
    usual = size_parameter(action, size, meaning)
    pairs = (row.get(key, pair) for key, pair in zip(_range_keys(usual), (usual.bounds, usual.typical), strict=True))
    bounds, typical = (tuple(pair) if isinstance(pair, list) else pair for pair in pairs)
    parameter = replace(usual, bounds=bounds, typical=typical)
    if wrong := wrong_in(parameter):
        raise toml.error(f"size {size}: {wrong[0]}", wrong[1], where=where)
    return parameter


def _shape(toml: TomlReader, where: str, row: Document, action: str, of: str) -> tuple[str, str, Constants, str]:
    """Variable, shape, constants and column of an action; "" for a second variable, which must suit action `of`."""
    by_strut = of in (*IN_SERIES, "turning")
    seen = [name for name in SEEN if by_strut or name not in (*OF_FORCES, "strut length")]
    variable = _choice(toml, where, row, "varies_with", seen)
    shape = _choice(toml, where, row, "shape", SHAPES_OF.get(variable, SHAPES[1:-1]))
    if variable == "setup" and action != "joint offset":
        column = _text(toml, f"{where}.of", row.get("of"))
    else:
        columns = COLUMNS.get(action, COLUMNS.get(variable, ("",)))
        column = _choice(toml, where, {"of": "", **row}, "of", [c for c in columns if by_strut or c not in SWINGS])
    given = toml.table(f"{where}.constants", row.get("constants", {}), "a table of numbers")
    pair = PAIR if action == "coupling" else ()
    ways = [{constant_key(n, variable): n for n in (*names, *pair)} for kind, names in FORMULAS if kind == shape]
    keys = next((way for way in ways if {key for key, _ in way} == given.keys()), None)
    if keys is None:
        known = " or ".join(", ".join(key for key, _ in way) or "none" for way in ways)
        raise toml.error(f"constants {', '.join(given) or 'none'}", f"of {shape}: {known}", where=f"{where}.constants")
    numbers = {key: toml.number(f"{where}.constants", given[key], LARGEST) * si for key, si in keys}
    values = tuple((name, numbers[key]) for (key, _), name in keys.items())
    if pair and not {dict(values)[name] for name in pair} <= set(range(1, 7)):
        raise toml.error("first and second", "two numbers of struts, 1 to 6", where=f"{where}.constants")
    return variable, shape, values, column


def _place(toml: TomlReader, where: str, row: Document, action: str) -> int | None:
    """Number of the strut or vertex; None: all of them."""
    number = row.get("where")
    needed = action == "joint offset" or row["link"] == "one strut"
    most = 3 if action == "vertex" else 6 if needed or row["link"] in ("joints", "struts") else 0
    if number is None and not needed:
        return None
    if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= most:
        expected = f"a number from 1 to {most}" if most else f"no `where` of {action} of {row['link']}"
        raise toml.error(f"{where}.where = {number!r}", expected, where=f"{where}.where")
    return number


def _text(toml: TomlReader, where: str, value: object) -> str:
    if not is_text(value):
        raise toml.error(f"{where} = {value!r}", "a text that is not empty", where=where)
    return value
