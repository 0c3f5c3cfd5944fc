"""Terms of a portrait as source text: for each link, variable and shape a few lines of Python, and its formula.

What `updating.portrait.terms` computes from a `Term`, these lines say for one term alone, so that an engineer can read
and change them; a test holds both to the same numbers. Constants keep twelve digits.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from toolpath_stiff.portrait.terms import IN_SERIES, PINS, SWINGS, UNITS, Term, effect_of
from toolpath_stiff.stiffness.contract import Effect
from toolpath_stiff.units import RAD_PER_DEG

AXES = ("X", "Y", "Z")


STRUCTURE, GEOMETRY, INSTRUMENT = "structure", "geometry", "instrument"


HOOKS = dict.fromkeys(IN_SERIES, "strut_compliance") | {"joint offset": "geometry", "turning": "parallel_stiffness"}


LEAST_STRUT = 0.8  # share of its own compliance that a strut may lose at most, so that it keeps some


MOST_COUPLED = 0.9  # of the mean of both compliances: beyond 1 the pair has none left


LEAST_READ = 0.05  # of the deflection: less is never read


@dataclass(frozen=True)
class Piece:
    """One term as source text.

    Attributes
    ----------
    term, words
        The term, and what the portrait calls it.
    parameter
        Name of its size.
    functions
        Functions of the module: the share of the size at each pose, the loads of the link.
    statements
        Lines of the hook that adds it.
    formula
        What it adds, without its constants.
    """

    term: Term
    words: str
    parameter: str
    functions: str
    statements: tuple[str, ...]
    formula: str

    @property
    def hook(self) -> str:
        """Method of the effect that adds it."""
        return HOOKS.get(self.term.action, "load_compliance")

    @property
    def kind(self) -> str:
        """Which effect of the file it belongs to: readings and geometry have one of their own."""
        return {"reading": INSTRUMENT, "geometry": GEOMETRY}.get(self.hook, STRUCTURE)

    @property
    def effect(self) -> Effect:
        """The term as an effect, for what it declares."""
        return effect_of(self.term)

    @property
    def bounds(self) -> tuple[float, float]:
        """What the size may be, in the unit of files."""
        return UNITS[self.term.action][2]

    @property
    def typical(self) -> tuple[float, float]:
        """What is usual, in the unit of files."""
        return UNITS[self.term.action][3]


def pieces_of(terms: Sequence[Term], words: Sequence[str]) -> list[Piece]:
    """Terms as source text, each with a parameter of its own name."""
    taken: list[str] = []
    found = []
    for term, said in zip(terms, words, strict=True):
        name = base = parameter_name(term)
        while name in taken:
            name = f"{base}_{sum(one.startswith(base) for one in taken) + 1}"
        taken.append(name)
        found.append(_piece(term, said, name))
    return found


def parameter_name(term: Term) -> str:
    """What the size of a term is called: its link, which one, and its direction."""
    if term.action == "coupling":
        return f"coupling_{term.constants['first']:.0f}_{term.constants['second']:.0f}"
    place = [f"strut_{term.where}" if term.link == "one strut" else f"{term.link} {term.where or ''}"]
    if term.action == "joint offset":
        place = [f"{term.column}_joint_{term.where}"]
    if term.action == "turning" or term.action in PINS:
        place = [f"strut_{term.where}" if term.where else "", term.action]
    if term.direction not in ("reading", "along the struts") and term.action != "turning":
        place.append(term.direction)
    if term.action in ("rocking", "tilting", "reading shift"):
        place.append(term.action.removeprefix("reading "))
    return re.sub(r"\W+", "_", " ".join(place).strip().lower()).strip("_")


def number(value: float) -> str:
    """A float literal of twelve digits."""
    return repr(float(f"{value:.12g}"))


VARIABLES: Mapping[str, tuple[str, str, str]] = {
    "x": ("x", "path.position[:, 0]", "m, X of the tool tip"),
    "y": ("y", "path.position[:, 1]", "m, Y of the tool tip"),
    "z": ("z", "path.position[:, 2]", "m, Z of the tool tip"),
    "radius": ("radius", "np.hypot(path.position[:, 0], path.position[:, 1])", "m, of the tool tip from the Z axis"),
    "tilt": (
        "tilt",
        "np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2])",
        "rad, of the spindle from the vertical",
    ),
    "strut length": ("length", "path.struts.lengths", "(n, 6) m, of each strut"),
    "strut force": ("force", "np.abs(path.strut_forces)", "(n, 6) N, size of the force in each strut"),
    "force sign": ("force", "np.sign(path.strut_forces)", "(n, 6), 1 in tension, -1 in compression"),
    "load": ("load", "path.force", "N, at the tool tip"),
    "time": ("time", "path.time", "s since the indicator was zeroed"),
    "temperature": ("temperature", "path.temperature", "degrees C"),
}


JOINT_ANGLES = "joint_angles(path.machine, path.struts, path.rotation)"


EACH_STRUT = ("strut length", "strut force", "force sign")


# Variable -> unit of its constants in SI, in the workshop, and the SI value of one of the latter.
CONSTANTS: Mapping[str, tuple[str, str, float]] = {
    **dict.fromkeys(("x", "y", "z", "radius", "strut length"), ("m", "mm", 1e-3)),
    "tilt": ("rad", "degrees", RAD_PER_DEG),
    "time": ("s", "min", 60.0),
    "temperature": ("degrees C", "degrees C", 1.0),
    **dict.fromkeys(("strut force", "load"), ("N", "N", 1.0)),
}


CALLED = {"from": "begin"}  # constants whose name Python keeps for itself


MEANINGS = {
    "start": "where it is nothing",
    "end": "where it is as large as the size says",
    "power": "of the variable",
    "reference": "where it is as large as the size says",
    "centre": "where it is {}",
    "reach": "from there to where it is as large as the size says",
    "width": "from there to where it is 0.61 of its most",
    "edge": "on one side it is there, on the other not",
    "from": "where it begins",
    "beyond": "what friction holds",
    "within": "where the play is used up",
    "period": "from one crest to the next",
    "crest": "where it is as large as the size says",
}


def _variable_lines(term: Term) -> list[str]:
    """Lines that say what the variable is; none for what does not vary."""
    if term.variable == "setup":
        return [f"on = (path.setup == {term.column!r}).astype(float)  # 1 in this set-up"]
    if term.column in SWINGS:
        said = f"# (n, 6) rad, swing of the {term.column}s from their place at rest"
        return [said, f"swing = {JOINT_ANGLES}[{SWINGS.index(term.column)}]"]
    if term.variable == "tilt" and term.column:
        axis = AXES.index(term.column)
        return [f"tilt = np.arcsin(np.clip(path.rotation[:, {axis}, 2], -1.0, 1.0))  # rad, towards {term.column}"]
    if term.variable not in VARIABLES:
        return []
    name, code, meaning = VARIABLES[term.variable]
    lines = [f"{name} = {code}  # {meaning}"]
    if term.variable == "tilt":
        lines.insert(0, "axis = path.rotation[:, :, 2]  # the spindle's")
    if term.variable in ("strut force", "force sign"):  # linear tensors have no direction of load
        lines[:0] = [
            "if path.strut_forces is None:  # no direction of the load, no forces",
            "    return np.zeros((len(path), 6))",
        ]
    return lines


def _variable_name(term: Term) -> str:
    if term.column in SWINGS and term.variable == "tilt":
        return "swing"
    return "on" if term.variable == "setup" else VARIABLES[term.variable][0] if term.variable in VARIABLES else ""


def _constant_lines(term: Term) -> list[str]:
    """A line a constant, in SI, its unit behind it."""
    lines = []
    for name, value in term.at:
        if name in MEANINGS:
            meaning = MEANINGS[name].format("least" if term.shape == "square" else "largest")
            unit = "" if name == "power" else f"{CONSTANTS[term.variable][0]}: "
            lines.append(f"{CALLED.get(name, name)} = {number(value)}  # {unit}{meaning}")
    return lines


def _constants_in_words(term: Term) -> str:
    """For the formula, as ", start = -200 mm, end = 250 mm"; "" without any."""
    said = []
    for name, value in term.at:
        if name in MEANINGS:
            _, unit, si = ("", "", 1.0) if name == "power" else CONSTANTS[term.variable]
            said.append(f", {CALLED.get(name, name)} = {value / si:.4g} {unit}".rstrip())
    return "".join(said)


def _shape(term: Term, signed: bool | None = None) -> tuple[str, str]:
    """The share of the size as an expression and as a formula, without its second variable; `signed`: to both sides."""
    v = _variable_name(term)
    if not v:
        return "np.ones(len(path))", ""
    above = term.constants.get("side", 1.0) > 0.0
    signed = len(term.signs) > 1 if signed is None else signed
    if term.shape == "slope" and "power" in term.constants:
        return f"(np.maximum({v}, 1e-3) / reference) ** power", f"({v} / reference)^power"
    if term.shape == "slope":
        line = f"({v} - start) / (end - start)"
        return (line, line) if signed else (f"np.maximum({line}, 0.0)", f"max(0, {line})")
    if term.shape == "threshold" and "from" in term.constants:
        line = f"({v} - begin) / (end - begin)"
        return f"np.maximum({line}, 0.0)", f"max(0, {line})"
    if term.shape == "threshold" and "beyond" in term.constants:
        return f"np.maximum(1.0 - beyond / np.maximum({v}, 1e-3), 0.0)", f"max(0, 1 - beyond / {v})"
    if term.shape == "threshold" and "within" in term.constants:
        return f"np.minimum(within / np.maximum({v}, 1e-3), 1.0)", f"min(1, within / {v})"
    return {
        "offset": (v, "" if v == "on" else v),
        "square": (f"(({v} - centre) / reach) ** 2", f"(({v} - centre) / reach)^2"),
        "bump": (
            f"np.exp(-0.5 * (({v} - centre) / width) ** 2)",
            f"exp(-(({v} - centre) / width)^2 / 2)",
        ),
        "threshold": (
            f"({v} {'>' if above else '<'} edge).astype(float)",
            f"(1 where {v} {'>' if above else '<'} edge, else 0)",
        ),
        "periodic": (
            f"0.5 * (1.0 + np.cos(2.0 * np.pi * ({v} - crest) / period))",
            f"(1 + cos(2 pi ({v} - crest) / period)) / 2",
        ),
        "sign": (
            f"({v} {'>' if above else '<'} 0.0).astype(float)",
            f"(1 in {'tension' if above else 'compression'}, else 0)"
            if term.variable == "force sign"
            else f"(1 where {v} {'>' if above else '<'} 0, else 0)",
        ),
    }[term.shape]


def _rows(term: Term) -> tuple[list[str], str]:
    """Lines that fill `rows` (n, k, 12), the loads of the link; and the load in words."""
    if term.action == "vertex":
        return _vertex_rows(term)
    if term.link in ("tool", "platform"):
        own = {"X": [0], "Y": [1], "Z": [2], "axial": [2], "radial": [0, 1], "all": [0, 1, 2]}[term.direction]
        lines = [f"rows = np.zeros((len(path), {len(own)}, 12))"]
        if term.action == "tilting":
            lines.append("lever = -path.struts.arms.mean(axis=1)  # (n, 3) m, from the middle of the joints to the tip")
        for k, axis in enumerate(own):
            along = f"path.rotation[:, :, {axis}]"
            if term.action == "tilting":  # moment about the platform's axis across the spindle and this one
                along = f"np.cross(np.cross(path.rotation[:, :, 2], {along}), lever)"
            lines.append(f"rows[:, {k}, 6:9] = {along}")
        if term.action == "tilting":
            return lines, f"moment of the tip force about the platform's middle, towards {term.direction}"
        return lines, f"tip force along {term.direction} of the {term.link}"
    if term.action == "rocking":
        of = {"X": "[z, 0, -x]", "Y": "[0, z, -y]", "tangential": "[-y, x, 0]"}
        chosen = ("X", "Y") if term.direction == "all" else (term.direction,)
        lines = ["x, y, z = path.position.T  # m, the tool tip", f"rows = np.zeros((len(path), {len(chosen)}, 12))"]
        for k, one in enumerate(chosen):
            entries = of[one].strip("[]").split(", ")
            lines += [f"rows[:, {k}, {6 + j}] = {entry}" for j, entry in enumerate(entries) if entry != "0"]
        return lines, f"moment of the tip force about the origin, towards {term.direction}"
    if term.direction in ("radial", "tangential"):
        first, second = ("x", "y") if term.direction == "radial" else ("-y", "x")
        return [
            "x, y, _ = path.position.T  # m, the tool tip",
            "reach = np.maximum(np.hypot(x, y), 1e-9)",
            "rows = np.zeros((len(path), 1, 12))",
            f"rows[:, 0, 6] = {first} / reach",
            f"rows[:, 0, 7] = {second} / reach",
        ], f"{term.direction} tip force"
    own = {"all": [0, 1, 2], "horizontal": [0, 1]}.get(term.direction) or [AXES.index(term.direction)]
    lines = [f"rows = np.zeros((len(path), {len(own)}, 12))"]
    lines += [f"rows[:, {k}, {6 + axis}] = 1.0" for k, axis in enumerate(own)]
    named = {"all": "tip force", "horizontal": "horizontal tip force"}
    return lines, named.get(term.direction, f"tip force along {term.direction}")


def _vertex_rows(term: Term) -> tuple[list[str], str]:
    joints = "frame_joints" if term.link == "frame" else "platform_joints"
    count = 3 if term.where is None else 1
    lines = [f"rows = np.zeros((len(path), {count}, 12))"]
    vertices = f"frame_vertices(path.machine.{joints})"
    if term.where is None:
        lines.append(f"for k, (pair, outward) in enumerate({vertices}):  # two struts meet in each")
        k, indent = "k", "    "
    else:
        lines.append(f"pair, outward = {vertices}[{term.where - 1}]  # the two struts that meet there")
        k, indent = "0", ""
    which = f"{term.link} vertex" + ("" if term.where is None else f" {term.where}")
    if term.direction == "along the struts":
        return [*lines, f"{indent}rows[:, {k}, pair] = 1.0"], f"sum of both strut forces in the {which}"
    axis = {"radial": "outward", "tangential": "np.array([-outward[1], outward[0], 0.0])"}.get(
        term.direction, "np.array([0.0, 0.0, 1.0])"
    )
    lines.append(f"{indent}axis = {axis}  # {term.direction}" + (", turned with the platform" * (term.link != "frame")))
    turned = "path.struts.directions[:, pair] @ axis"
    if term.link != "frame":
        turned = 'np.einsum("nij,nj->ni", path.struts.directions[:, pair], path.rotation @ axis)'
    return [*lines, f"{indent}rows[:, {k}, pair] = {turned}"], f"{term.direction} force in the {which}"


_LAW = "path.machine.strut_law.stiffness(path.struts.lengths{})"


def _piece(term: Term, words: str, name: str) -> Piece:
    first = _of_one(replace(term, times=None), words, name)
    if term.second is None:
        return first
    second, share = term.second, f"{name}_share(path)"
    own, said = _shape(second, signed=False)
    each = second.variable in EACH_STRUT or second.column in SWINGS
    wide = term.action in IN_SERIES or term.action == "turning"
    if wide and not each:
        own = f"{_grouped(own)}[:, None]"
    what = f"{'(n, 6)' if each else '(n, 1)' if wide else '(n,)'}: by what that is multiplied."
    function = _function(f"{name}_factor", what, _share_lines(second), own)
    lines = tuple(line.replace(share, f"{share} * {name}_factor(path)") for line in first.statements)
    formula = f"{first.formula}; times {said or 'whether it is on'}{_constants_in_words(second)}"
    return replace(first, term=term, functions=f"{first.functions}\n\n\n{function}", statements=lines, formula=formula)


def _of_one(term: Term, words: str, name: str) -> Piece:
    if term.action in IN_SERIES:
        return _strut_piece(term, words, name)
    if term.action == "turning":
        return _turning_piece(term, words, name)
    if term.action == "joint offset":
        return _joint_piece(term, words, name)
    if term.action in ("reading factor", "reading shift"):
        return _reading_piece(term, words, name)
    if term.action == "coupling":
        return _coupling_piece(term, words, name)
    return _spring_piece(term, words, name)


def _strut_piece(term: Term, words: str, name: str) -> Piece:
    lines, (share, shape) = _share_lines(term), _shape(term)
    function = _function(f"{name}_share", "(n, 6): how much of the size each strut has.", lines, _each(term, share))
    own = f"{_size(name)} * {name}_share(path)"
    formula = f"c_i += {_times(name, shape)}"
    statements: tuple[str, ...] = (f"added += {own}",)
    if term.action == "strut factor":
        statements = (
            f"stiffness = {_LAW.format('')}  # (n, 6) N/m, by the strut law",
            "# No strut loses more than four fifths of its compliance.",
            f"added += np.maximum({own}, {-LEAST_STRUT}) / stiffness",
        )
        formula = f"c_i += {_times(name, shape)} / k_i"
    if term.action in PINS:
        pins, along = _pins(term, name)
        function += f"\n\n\n{pins}"
        statements = (f"own = {own}", f"added += own * {name}_along(path) ** 2")
        formula = f"{formula} ({along})^2"
    if term.where is not None:
        formula = formula.replace("_i", f"_{term.where}")
    return Piece(term, words, name, function, statements, formula + _constants_in_words(term))


def _pins(term: Term, name: str) -> tuple[str, str]:
    """The function of how much of its strut's force each pin has, and that in words."""
    end = term.action.removesuffix(" pin")
    lines = [
        f"x, y = path.machine.{end}_joints[:, :2].T",
        "nothing = np.zeros(6)",
        f"pins = np.stack([{'x, y' if term.direction == 'radial' else '-y, x'}, nothing], axis=1)",
        "pins = pins / np.hypot(x, y)[:, None]",
    ]
    if end == "platform":
        lines.append("pins = pins @ np.swapaxes(path.rotation, 1, 2)  # turned with the platform")
    what = "(n, 6): cosine of the angle between each strut and the pin of its joint."
    function = _function(f"{name}_along", what, lines, "(path.struts.directions * pins).sum(axis=-1)")
    return function, f"u_i . {term.direction} pin"


def _turning_piece(term: Term, words: str, name: str) -> Piece:
    lines, (share, shape) = _share_lines(term), _shape(term)
    function = _function(f"{name}_share", "(n, 6): how much of the size each strut has.", lines, _each(term, share))
    statements = (
        f"weight = {_size(name)} * {name}_share(path)",
        "turns = end_rotations(path)  # (n, 6, 6, 6), of each strut's two ends by the tip's motion",
        'added += np.einsum("nk,nkai,nkaj->nij", weight, turns, turns)',
    )
    over = "i" if term.where is None else f"i = {term.where}"
    formula = f"K += sum over {over} of {_times(name, shape)} B_i^T B_i"
    return Piece(term, words, name, function, statements, formula + _constants_in_words(term))


def _joint_piece(term: Term, words: str, name: str) -> Piece:
    assert term.where is not None
    joints = f"{term.column}_joints"
    statements = (
        f"joints = np.array(machine.{joints})",
        f"joints[{term.where - 1}, {AXES.index(term.direction)}] += {_size(name)}",
        f"machine = machine.with_changes({joints}=joints)",
    )
    formula = f"{term.direction.lower()}_{term.column}_{term.where} += {name}"
    return Piece(term, words, name, "", statements, formula)


def _reading_piece(term: Term, words: str, name: str) -> Piece:
    share, shape = _shape(term)
    if term.direction in AXES:
        along = f"path.direction[:, {AXES.index(term.direction)}] ** 2"
        share = along if share.startswith("np.ones") else f"{_grouped(share)} * {along}"
    function, own = _pose_share(term, name, share)
    if term.action == "reading factor":
        factor, formula = f"factor = 1.0 + {own}", f"k_read = k / (1 + {_times(name, shape)})"
    else:
        factor = f"factor = 1.0 + {own} * stiffness / path.force"
        formula = f"F / k_read = F / k + {_times(name, shape)}"
    statements = (factor, f"stiffness = stiffness / np.maximum(factor, {LEAST_READ})")
    return Piece(term, words, name, function, statements, formula + _along(term) + _constants_in_words(term))


def _coupling_piece(term: Term, words: str, name: str) -> Piece:
    share, shape = _shape(term)
    function, own = _pose_share(term, name, share)
    first, second = (int(term.constants[one]) for one in ("first", "second"))
    statements = (
        f"stiffness = {_LAW.format(f'[:, [{first - 1}, {second - 1}]]')}",
        "# Coupled by as much as both give way alone, the pair would have no stiffness left.",
        f"own = np.clip({own}, {-MOST_COUPLED}, {MOST_COUPLED}) / np.sqrt(stiffness.prod(axis=1))",
        f"form[:, {first - 1}, {second - 1}] += own",
        f"form[:, {second - 1}, {first - 1}] += own",
    )
    formula = f"c_{first}{second} += {_times(name, shape)} / sqrt(k_{first} k_{second})"
    return Piece(term, words, name, function, statements, formula + _constants_in_words(term))


def _spring_piece(term: Term, words: str, name: str) -> Piece:
    share, shape = _shape(term)
    function, own = _pose_share(term, name, share)
    rows, load = _rows(term)
    what = "(n, k, 12): what loads the link, of strut forces (0 to 5), tip force (6 to 8), moment (9 to 11)."
    functions = f"{function}\n\n\n{_function(f'{name}_loads', what, rows, 'rows')}"
    statements = (f"weight = {own}", f"form += springs(weight, {name}_loads(path))")
    formula = f"c += {_times(name, shape)} h^2, h = {load} per unit load{_constants_in_words(term)}"
    return Piece(term, words, name, functions, statements, formula)


def _size(name: str) -> str:
    return f'p["{name}"]'


def _share_lines(term: Term) -> list[str]:
    return [*_variable_lines(term), *_constant_lines(term)]


def _pose_share(term: Term, name: str, share: str) -> tuple[str, str]:
    """The function of how much of the size acts at each pose, and the size times it."""
    function = _function(f"{name}_share", "(n,): how much of the size acts at each pose.", _share_lines(term), share)
    return function, f"{_size(name)} * {name}_share(path)"


def _each(term: Term, share: str) -> str:
    """The share of each strut, (n, 6), from one of all or from their own."""
    own = term.variable in EACH_STRUT or term.column in SWINGS
    if term.where is not None:
        alone = f"np.eye(6)[{term.where - 1}]  # strut {term.where} alone"
        return f"{_grouped(share)} * {alone}" if own else f"{_grouped(share)}[:, None] * {alone}"
    return share if own else f"np.repeat({_grouped(share)}[:, None], 6, axis=1)"


def _grouped(share: str) -> str:
    """In brackets, unless it is a call or a name already."""
    return share if re.fullmatch(r"[\w.]*\(((?![()]).|\([^()]*\))*\)(\.astype\(float\))?|\w+", share) else f"({share})"


def _times(name: str, shape: str) -> str:
    return f"{name} {shape}".strip()


def _along(term: Term) -> str:
    return f" along {term.direction}" if term.direction in AXES else ""


def _function(name: str, what: str, lines: Sequence[str], result: str) -> str:
    body = [f'    """{what}"""', *(f"    {line}" for line in lines), f"    return {result}"]
    return "\n".join([f"def {name}(path):", *body])
