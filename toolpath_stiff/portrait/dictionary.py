"""The dictionary: for each link of the load path its compliance, times each shape of each variable it may depend on.

Drawn up from the mechanics of a machine, not from any simulator: which forces a link carries says where its compliance
shows, and a link depends on what it feels. A table feels where the work stands on it; a strut its length, its force and
the nut's place on the screw; a platform and a tool how they lean; instruments the time, the load and where they stand.

A term's prior weight is even over links, over the variables of a link, over its places and directions, over shapes and
over the constants of a shape, so that no link is preferred for having many terms.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.portrait.columns import MOST_HELD, Ground
from toolpath_stiff.stiffness.terms import PARALLEL, PINS, PLACE, SWINGS, Action, Constants, Term

WHOLE = ("constant", "load", "time", "order", "temperature", "setup")
ONCE = ("constant", "direction")  # variables whose every place stands in the dictionary as it is
ALL_STRUTS, ALL_VERTICES = (None, 1, 2, 3, 4, 5, 6), (None, 1, 2, 3)
ALONE = ("coupling", "joint offset")  # actions that depend on no variable
SIDE = 0.2  # prior weight of an indirect dependence: a frame does not feel where the tip is
NOTHING = 1e-4  # rms change of stiffness at the largest size below which a term is negligible here


@dataclass(frozen=True)
class Local:
    """A link with its local way of giving, and the variables it may depend on.

    `side`: variables on which it depends by a way round only; `crossed`: further variables, tried where another place
    has shown them.
    """

    link: str
    action: Action
    direction: str
    where: int | None
    variables: tuple[str, ...]
    column: str = ""
    constants: Constants = ()
    side: tuple[str, ...] = ()
    crossed: tuple[str, ...] = ()

    @property
    def single(self) -> bool:
        """True if it is one of several places or channels: a joint, a vertex, the readings along one axis."""
        return self.where is not None or (self.link == "instrument" and self.direction != "reading")

    def term(self, variable: str, shape: str, constants: Constants, column: str = "") -> Term:
        """A term of this link with a variable and a shape."""
        column, constants = column or self.column, (*self.constants, *constants)
        return Term(self.link, self.direction, variable, shape, self.action, self.where, constants, column)


def locals_of(extra: Iterable[str]) -> list[Local]:
    """Every link with its places and directions; `extra`: names of further columns, on which instruments may depend."""
    whole = (*WHOLE, *extra)
    base, turning = ("X", "Y", "Z", "horizontal", "all"), ("X", "Y", "all", "tangential")
    return [
        Local("instrument", "reading factor", "reading", None, (*PLACE, *whole[1:], "tilt")),
        *(
            Local("instrument", "reading factor", axis, None, ("direction", *PLACE, *whole[1:], "tilt"))
            for axis in "XYZ"
        ),
        *(
            Local("instrument", "reading shift", axis, None, ("constant", "time", "order", "temperature", "setup"))
            for axis in ("reading", "X", "Y", "Z")
        ),
        *_of_head("tool", (*whole, "tool length")),
        *_of_head("platform", whole),
        *_of_vertices("platform", ("radial", "tangential", "axial", "along the struts"), (*whole, "tilt")),
        *(
            Local("platform", "spring", axis, None, ("constant", *PLACE), crossed=(*whole, "tilt"))
            for axis in ("X", "Y", "Z", "horizontal")
        ),
        *_of_joints(whole),
        *_of_struts(whole),
        *_of_vertices("frame", ("radial", "tangential", "Z", "along the struts"), whole),
        *(Local("frame", "give", axis, None, (*whole, *PLACE), side=PLACE) for axis in base),
        *(Local("frame", "rocking", axis, None, ("constant", "load")) for axis in turning),
        *(Local("table", "give", axis, None, (*whole, *PLACE)) for axis in (*base, "radial", "tangential")),
        *(Local("table", "rocking", axis, None, ("constant", "load", "setup", "z")) for axis in turning),
    ]


def _of_head(link: str, whole: tuple[str, ...]) -> list[Local]:
    """Tool or platform: gives across and along its axis, and tilts about the middle of the joints."""
    return [
        *(Local(link, "give", direction, None, (*whole, "tilt")) for direction in ("radial", "axial", "X", "Y", "all")),
        *(Local(link, "tilting", direction, None, ("constant", "load", "tilt")) for direction in ("radial", "X", "Y")),
    ]


def _of_vertices(link: str, directions: Iterable[str], variables: tuple[str, ...]) -> Iterator[Local]:
    """Vertices of frame or platform, all together or one alone."""
    for direction, where in product(directions, ALL_VERTICES):
        if where is None:
            yield Local(link, "vertex", direction, where, variables)
        else:
            yield Local(link, "vertex", direction, where, ("constant", "load"), crossed=variables)


def _of_joints(whole: tuple[str, ...]) -> Iterator[Local]:
    """Joints: give along their strut or along a pin of their cross, resist turning, or are displaced."""
    forces = ("strut force", "force sign")
    for where in ALL_STRUTS:
        variables = ("constant", "load", "temperature", *forces) if where else (*whole, *forces, "tilt")
        yield Local("joints", "strut", "along the struts", where, variables, crossed=(*whole, *forces, "tilt"))
        turning = ("constant",) if where else ("constant", "load", "tilt")
        yield Local("joints", "turning", "all", where, turning, crossed=(*whole, "tilt"))
        for action, direction in product(PINS, ("radial", "tangential")):
            yield Local("joints", action, direction, where, ("constant",), crossed=variables)
    for axis, where, end in product("XYZ", ALL_STRUTS[1:], ("frame", "platform")):
        yield Local("joints", "joint offset", axis, where, ("constant",), column=end)


def _of_struts(whole: tuple[str, ...]) -> list[Local]:
    """Struts: their share of the strut law, all together or one alone, and couplings of two."""
    variables, along = (*whole[1:], "strut length", "strut force", "force sign", *PLACE), "along the struts"
    pairs = [(("first", float(first)), ("second", float(second))) for first, second in combinations(range(1, 7), 2)]
    return [
        Local("struts", "strut factor", along, None, (*variables, "tilt")),
        *(Local("struts", "coupling", along, None, ("constant",), constants=pair) for pair in pairs),
        *(Local("one strut", "strut factor", along, where, ("constant", *variables)) for where in ALL_STRUTS[1:]),
    ]


@dataclass(frozen=True)
class Dictionary:
    """N terms with their effect on n readings.

    Attributes
    ----------
    terms
        Without sizes.
    blocks
        Changes of compliance over the compliance, (m, n) of some terms at a time in their order, or what makes them: of
        5,000 readings they would take half a gigabyte.
    log_prior
        (N,) weights.
    signed
        (N,) whether the size may go to both sides.
    """

    terms: tuple[Term, ...]
    blocks: tuple[FloatArray | Callable[[], FloatArray], ...]
    log_prior: FloatArray
    signed: NDArray[np.bool_]

    def columns(self) -> Iterator[FloatArray]:
        """The blocks, one at a time."""
        return (block() if callable(block) else block for block in self.blocks)


def dictionary_of(ground: Ground) -> Dictionary:
    """Every term that has an effect on these readings."""
    terms, logs, blocks = list[Term](), list[float](), list[FloatArray | Callable[[], FloatArray]]()
    for local, priors in place_priors(ground):
        plain = local.term("constant", "offset", ())
        for variable in local.variables:
            names = columns_of(variable, ground, local.link == "joints")
            for column in names:
                named = ground.shapes(variable, column, plain.signed, local.where)[0]
                if not named:
                    continue
                relative = _relative(ground, plain, variable, column, slice(None))
                scale = np.sqrt((relative**2).mean(axis=1))
                limit = max(map(abs, plain.bounds)) * plain.si
                # A term that changes every reading alike belongs to the strut law.
                kept = np.flatnonzero((scale * limit > NOTHING) & (relative.std(axis=1) > 1e-6 * scale))
                held = len(ground.data) <= MOST_HELD or plain.action in PARALLEL  # expensive columns are kept
                blocks.append(relative[kept] if held else partial(_relative, ground, plain, variable, column, kept))
                kinds = Counter(shape for shape, _ in named)
                log = priors[variable] - float(np.log(len(kinds) * len(names)))
                terms += [local.term(variable, *named[i], column) for i in kept]
                logs += [log - float(np.log(kinds[named[i][0]])) for i in kept]
    signed = np.array([term.signed for term in terms], dtype=bool)
    return Dictionary(tuple(terms), tuple(blocks), np.array(logs), signed)


def _relative(ground: Ground, plain: Term, variable: str, column: str, kept: IntArray | slice) -> FloatArray:
    """(m, n) change of compliance relative to the compliance, for the shapes kept."""
    shapes = ground.shapes(variable, column, plain.signed, plain.where)[1]
    return ground.columns(plain, ground.share(plain), shapes)[kept] / ground.compliance


def columns_of(variable: str, ground: Ground, joints: bool = False) -> list[str]:
    """Variants of a variable: set-ups by name; of a tilt its size, leans and swings; otherwise one. None if unknown."""
    if not ground.known(variable):
        return []
    if variable == "setup":
        names = sorted(set(ground.data.setup.tolist()) - {""})
        return names if len(names) > 1 or "" in ground.data.setup else []
    return ["", "X", "Y", *(SWINGS if joints else ())] if variable == "tilt" else [""]


def place_priors(ground: Ground) -> list[tuple[Local, dict[str, float]]]:
    """Every link with its places and directions, and for each variable the log prior weight of all its shapes together.

    Even over links, over the variables of each that the readings tell, over places and directions. A link with single
    places (a joint, a vertex) has half for one of them and half for all of them together.
    """
    every = locals_of(ground.data.extra)
    known = {variable for local in every for variable in local.variables if columns_of(variable, ground)}
    places = Counter((local.link, name, local.single) for local in every for name in local.variables if name in known)
    variables = Counter(link for link, _ in {key[:2] for key in places})

    def prior(local: Local, name: str) -> float:
        share = (SIDE if name in local.side else 1.0) / max(places[local.link, name, local.single], 1)
        share *= 0.5 if places[local.link, name, not local.single] else 1.0
        return float(np.log(share / variables[local.link] / len(variables)))

    return [(local, {name: prior(local, name) for name in (*local.variables, *local.crossed)}) for local in every]


def crossed(term: Term, ground: Ground) -> dict[Term, float]:
    """Terms with the same variable, shape and constants at every other link, place and direction that may feel it.

    With the log prior weight of each.
    """
    if term.variable in ONCE:
        return {}
    terms: dict[Term, float] = {}
    for local, priors in place_priors(ground):
        able = local.action not in ALONE and term.variable in priors
        if able and not (term.column in SWINGS and local.link != "joints"):
            for shape, constants in _translated(term, local.term("constant", "offset", ()).signed, ground):
                terms[local.term(term.variable, shape, constants, term.column)] = priors[term.variable]
    return terms


def _translated(term: Term, signed: bool, ground: Ground) -> list[tuple[str, Constants]]:
    """Equivalent shapes for a link that can only give, or for one whose stiffness may change to both sides."""
    constants = term.constants
    if term.signed == signed or "power" in constants:
        return [(term.shape, term.at)]
    if term.shape == "slope" and signed:  # it begins where it is 0
        return [("threshold", (("from", constants["start"]), ("end", constants["end"])))]
    if term.shape == "threshold" and "from" in constants:
        return [("slope", (("start", constants["from"]), ("end", constants["end"])))]
    values = ground.values(term.variable, term.column)
    low, high = float(values.min()), float(values.max())
    if term.shape == "slope":  # a straight line of either sign: rising or falling over the range
        return [("slope", (("start", start), ("end", end))) for start, end in ((low, high), (high, low))]
    if "side" in constants and not signed:  # an increase on one side is a decrease on the other
        return [
            (term.shape, tuple((name, side if name == "side" else value) for name, value in term.at))
            for side in (1.0, -1.0)
        ]
    return [(term.shape, term.at)]
