"""The dictionary: for every link its own compliance, times each shape of what it can depend on; and its columns.

Drawn up from the mechanics of a machine, not from any simulator: which forces a link carries says where its compliance
shows, and a link depends on what it feels. A table feels where the work stands on it; a strut its length, its force and
the nut's place on the screw; a platform and a tool how they lean; instruments the time, the load and where they stand.

A term's prior weight is even over links, over the variables of a link, over its places and directions, over shapes and
over the constants of a shape, so that no link is preferred for having many terms.

The columns are what terms do to readings: the shapes over the values that occur, and the compliance that a unit of a
term adds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.effects.contract import LoadPath
from toolpath_stiff.stiffness.effects.joint_moment_stiffness import end_rotations
from toolpath_stiff.updating.inference.prediction import Predictor, scaled_law
from toolpath_stiff.updating.portrait.terms import (
    AXES,
    IN_SERIES,
    PINS,
    SWINGS,
    VARIABLES,
    Action,
    Constants,
    Factor,
    Term,
    along_pins,
    carriers,
    coupled,
    coupling_share,
    factor_values,
    multiplied,
    reading_share,
    shape_values,
    variable_values,
)

WHOLE = ("constant", "load", "time", "order", "temperature", "setup")
ONCE = ("constant", "direction")  # variables whose every place stands in the dictionary as it is
ALL_STRUTS, ALL_VERTICES = (None, 1, 2, 3, 4, 5, 6), (None, 1, 2, 3)
SIDE = 0.2  # prior weight of what a link could do by a way round: a frame does not feel where the tip is
NOTHING = 1e-4  # rms change of stiffness by the largest size below which a term does nothing to these readings
Shapes = tuple[tuple[tuple[str, Constants], ...], FloatArray]  # shape and constants; (s, n) or (s, n, 6) values
PLACE = ("x", "y", "z", "radius")
BUMPS, MOST_EDGES = 5, 5
SHORTEST_PITCH = 8e-3  # m, period in a strut's length: screws of mills have leads of 5 to 40 mm
MOST_TURNS = 5  # of a wave over a place: clamps and grooves of a table
TURNED = 0.1  # rms change of stiffness at which a resistance to turning is looked for: it is not linear in its size
PHASES = 3  # of half a turn; the other half is the other sign's


@dataclass(frozen=True)
class Local:
    """A link as it gives way locally, with what it may depend on.

    `side`: variables on which it depends by a way round only; `crossed`: further variables, tried where another place
    has shown them.
    """

    link: str
    action: Action
    direction: str
    where: int | None
    variables: tuple[str, ...]
    column: str = ""
    at: Constants = ()
    side: tuple[str, ...] = ()
    crossed: tuple[str, ...] = ()

    @property
    def single(self) -> bool:
        """Whether it is one of several places or channels: a joint, a vertex, the readings along one axis."""
        return self.where is not None or (self.link == "instrument" and self.direction != "reading")

    def term(self, variable: str, shape: str, at: Constants, column: str = "", times: Factor | None = None) -> Term:
        """With a variable and a shape, and a second one where there is one."""
        column = column or self.column
        return Term(
            self.link, self.direction, variable, shape, self.action, self.where, (*self.at, *at), column, times=times
        )


def locals_of(extra: Iterable[str]) -> list[Local]:
    """Every link with its places and directions; `extra`: names of further columns, which instruments may feel."""
    further = tuple(extra)
    whole = (*WHOLE, *further)
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
        *_of_head("tool", whole),
        *_of_head("platform", whole),
        *_of_vertices("platform", ("radial", "tangential", "axial", "along the struts"), (*whole, "tilt")),
        *_of_joints(whole),
        *_of_struts(whole),
        *_of_vertices("frame", ("radial", "tangential", "Z", "along the struts"), whole),
        *(Local("frame", "give", axis, None, (*whole, *PLACE), side=PLACE) for axis in base),
        *(Local("frame", "rocking", axis, None, ("constant", "load")) for axis in turning),
        *(Local("table", "give", axis, None, (*whole, *PLACE)) for axis in (*base, "radial", "tangential")),
        *(Local("table", "rocking", axis, None, ("constant", "load", "setup", "z")) for axis in turning),
    ]


def _of_head(link: str, whole: tuple[str, ...]) -> Iterator[Local]:
    """Tool or platform: gives across and along its axis, and tips about the middle of the joints."""
    for direction in ("radial", "axial", "X", "Y", "all"):
        yield Local(link, "give", direction, None, (*whole, "tilt"))
    for direction in ("radial", "X", "Y"):
        yield Local(link, "tilting", direction, None, ("constant", "load", "tilt"))


def _of_vertices(link: str, directions: Iterable[str], variables: tuple[str, ...]) -> Iterator[Local]:
    """The vertices of frame or platform, all together or one alone."""
    for direction in directions:
        for where in ALL_VERTICES:
            own = ("constant", "load") if where else variables
            yield Local(link, "vertex", direction, where, own, crossed=variables if where else ())


def _of_joints(whole: tuple[str, ...]) -> Iterator[Local]:
    """Joints: they give along their strut or along a pin of their cross, resist turning, or stand off their place."""
    for where in ALL_STRUTS:
        own = ("strut force", "force sign")
        variables = ("constant", "load", "temperature", *own) if where else (*whole, *own, "tilt")
        yield Local("joints", "strut", "along the struts", where, variables, crossed=(*whole, *own, "tilt"))
        turning = ("constant",) if where else ("constant", "load", "tilt")
        yield Local("joints", "turning", "all", where, turning, crossed=(*whole, "tilt"))
        for action, direction in product(PINS, ("radial", "tangential")):
            yield Local("joints", action, direction, where, ("constant",), crossed=variables)
    for axis in "XYZ":
        for where in ALL_STRUTS[1:]:
            for end in ("frame", "platform"):
                yield Local("joints", "joint offset", axis, where, ("constant",), column=end)


def _of_struts(whole: tuple[str, ...]) -> Iterator[Local]:
    """Struts: their own share of the strut law, all together or one alone, and what couples two of them."""
    own = (*whole[1:], "strut length", "strut force", "force sign", *PLACE)
    yield Local("struts", "strut factor", "along the struts", None, (*own, "tilt"))
    for first, second in combinations(range(1, 7), 2):
        at = (("first", float(first)), ("second", float(second)))
        yield Local("struts", "coupling", "along the struts", None, ("constant",), at=at)
    for where in ALL_STRUTS[1:]:
        yield Local("one strut", "strut factor", "along the struts", where, ("constant", *own))


@dataclass(frozen=True)
class Entry:
    """One term of the dictionary, not yet made: what it is, and its share of the prior."""

    local: Local
    variable: str
    column: str
    shape: str
    at: Constants
    log_prior: float
    times: Factor | None = None

    @property
    def term(self) -> Term:
        """The term."""
        return self.local.term(self.variable, self.shape, self.at, self.column, self.times)


@dataclass(frozen=True)
class Dictionary:
    """N terms with what they do to n readings.

    Attributes
    ----------
    entries
        The terms.
    columns
        (N, n) change of compliance over the compliance, scaled to an rms of 1.
    scale
        (N,) rms of that change per SI unit of size.
    log_prior
        (N,) weights.
    signed
        (N,) whether the size may go to both sides.
    """

    entries: tuple[Entry, ...]
    columns: FloatArray
    scale: FloatArray
    log_prior: FloatArray
    signed: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.entries)


def dictionary_of(ground: Ground) -> Dictionary:
    """Every term that does something to these readings."""
    entries: list[Entry] = []
    blocks: list[FloatArray] = []
    largest: list[FloatArray] = []
    signs: list[NDArray[np.bool_]] = []
    every = locals_of(ground.data.extra)
    prior = Prior.of(every, ground)
    for local in every:
        plain = local.term("constant", "offset", ())
        share, signed = ground.share(plain), len(plain.signs) > 1
        limit = max(abs(bound) for bound in plain.bounds) * plain.si
        for variable in local.variables:
            every_column = columns_of(variable, ground, local.link == "joints")
            for column in every_column:
                named, values = ground.shapes(variable, column, signed, local.where)
                if not named:
                    continue
                blocks.append(ground.columns(plain, share, values))
                kinds = Counter(shape for shape, _ in named)
                log = prior.place(local, variable) - float(np.log(len(kinds) * len(every_column)))
                entries += [
                    Entry(local, variable, column, shape, at, log - float(np.log(kinds[shape]))) for shape, at in named
                ]
                largest.append(np.full(len(named), limit))
                signs.append(np.full(len(named), signed))
    relative = np.concatenate(blocks) / ground.compliance
    scale = np.sqrt((relative**2).mean(axis=1))
    # A term that changes every reading alike is the strut law's affair.
    spread = relative.std(axis=1)
    kept = (scale * np.concatenate(largest) > NOTHING) & (spread > 1e-6 * scale)
    chosen = [entries[i] for i in np.flatnonzero(kept).tolist()]
    return Dictionary(
        tuple(chosen),
        relative[kept] / scale[kept, None],
        scale[kept],
        np.array([entry.log_prior for entry in chosen]),
        np.concatenate(signs)[kept],
    )


def columns_of(variable: str, ground: Ground, joints: bool = False) -> list[str]:
    """What a variable comes in: set-ups by name, a tilt, its two leans and swings, else once; none where unknown."""
    if not ground.known(variable):
        return []
    if variable == "setup":
        names = sorted(set(ground.data.setup.tolist()) - {""})
        return names if len(names) > 1 or "" in ground.data.setup else []
    return ["", "X", "Y", *(SWINGS if joints else ())] if variable == "tilt" else [""]


@dataclass(frozen=True)
class Prior:
    """Logarithms of prior weights: even over links, over the variables of each, over places and directions.

    `places`: link, variable and whether at one place -> how many; `variables`: link -> how many variables.
    """

    places: Mapping[tuple[str, str, bool], int]
    variables: Mapping[str, int]

    @classmethod
    def of(cls, every: Iterable[Local], ground: Ground) -> Prior:
        """Of the links and those of their variables that the readings tell."""
        told: dict[str, bool] = {}
        places: Counter[tuple[str, str, bool]] = Counter()
        for local in every:
            for variable in local.variables:
                if variable not in told:
                    told[variable] = bool(columns_of(variable, ground))
                if told[variable]:
                    places[local.link, variable, local.single] += 1
        return cls(places, Counter(link for link, _ in {key[:2] for key in places}))

    def place(self, local: Local, variable: str) -> float:
        """Of a link with one place and direction and a variable, all shapes together.

        A link with single places (a joint, a vertex) has half for one of them and half for all of them together.
        """
        both = (local.link, variable, not local.single) in self.places
        share = (SIDE if variable in local.side else 1.0) * (0.5 if both else 1.0)
        count = max(self.places.get((local.link, variable, local.single), 1), 1)
        return float(np.log(share / count / self.variables[local.link] / len(self.variables)))


def crossed(term: Term, ground: Ground) -> list[Entry]:
    """The same variable and shape, constants included, at every other link, place and direction that may feel it."""
    every = locals_of(ground.data.extra)
    prior = Prior.of(every, ground)
    found = []
    for local in every:
        if term.variable not in (*local.variables, *local.crossed) or term.variable in ONCE:
            continue
        if local.action in ("coupling", "joint offset"):
            continue
        if term.column in SWINGS and local.link != "joints":
            continue
        if term.times is not None and not _may_feel(local, term.times):
            continue
        signed = len(local.term("constant", "offset", ()).signs) > 1
        log = prior.place(local, term.variable)
        found += [
            Entry(local, term.variable, term.column, shape, at, log, term.times)
            for shape, at in _translated(term, signed, ground)
        ]
    return found


def _may_feel(local: Local, factor: Factor) -> bool:
    """Whether a link may depend on a second variable."""
    if factor.column in SWINGS and local.link != "joints":
        return False
    return factor.variable in (*local.variables, *local.crossed)


def products(term: Term, ground: Ground) -> list[Term]:
    """The same term times every shape of every other variable that its link may depend on, itself not negative."""
    if term.times is not None or term.action in ("coupling", "joint offset"):
        return []
    place = (term.link, term.action, term.direction, term.where)
    every = locals_of(ground.data.extra)
    (local,) = (one for one in every if (one.link, one.action, one.direction, one.where) == place)
    found = []
    for variable in dict.fromkeys((*local.variables, *local.crossed)):
        if variable in (*ONCE, term.variable):
            continue
        for column in columns_of(variable, ground, local.link == "joints"):
            named = ground.shapes(variable, column, False, local.where)[0]
            found += [
                replace(term, times=Factor(variable, shape, at, column)) for shape, at in named if shape != "periodic"
            ]
    return found


def _translated(term: Term, signed: bool, ground: Ground) -> list[tuple[str, Constants]]:
    """A shape for links that give only, or whose stiffness may change to both sides, as it says the same there."""
    at = term.constants
    if (len(term.signs) > 1) == signed or "power" in at:
        return [(term.shape, term.at)]
    if term.shape == "slope" and signed:  # it begins where it is 0
        return [("threshold", (("from", at["start"]), ("end", at["end"])))]
    if term.shape == "threshold" and "from" in at:
        return [("slope", (("start", at["from"]), ("end", at["end"])))]
    values = ground.values(term.variable, term.column)
    low, high = float(values.min()), float(values.max())
    if term.shape == "slope":  # a straight line to both sides: up or down over the range
        return [("slope", (("start", one), ("end", other))) for one, other in ((low, high), (high, low))]
    if "side" in at and not signed:  # more on one side is less on the other
        return [
            (term.shape, tuple((name, side if name == "side" else value) for name, value in term.at))
            for side in (1.0, -1.0)
        ]
    return [(term.shape, term.at)]


# -- shapes ------------------------------------------------------------------------------------------------------------


def shapes_of(variable: str, values: FloatArray, signed: bool, column: str = "") -> list[tuple[str, Constants]]:
    """Shapes over the values that a variable takes, with their constants; none where it does not vary.

    `signed`: of what may change to both sides, where one side of each shape says it all; `column`: of a tilt. About a
    lean few poses say more than its side and its size; a swing counts from where the joint rests.
    """
    if variable in ("constant", "direction", "setup"):
        return [("offset", ())]
    different = np.unique(np.round(values, 9))
    if variable == "force sign":
        return _signs(signed) if len(different) > 1 else []
    if len(different) < 2 or different[-1] - different[0] <= 1e-9 * max(abs(different[-1]), 1e-9):
        return []
    low, high = float(different[0]), float(different[-1])
    many = len(different)
    found: list[tuple[str, Constants]] = []
    if variable in ("load", "strut force") and not (signed and many == 2):
        # Of what may change to both sides, less of what friction holds is play.
        play = variable == "strut force" and not signed
        found += _of_a_force(low, high, float(np.median(values)), many > 2, play)
    found += _slopes(low, high, signed, many > 4)
    return found if many == 2 else found + _bent(variable, different, signed, column)


def _bent(variable: str, different: FloatArray, signed: bool, column: str) -> list[tuple[str, Constants]]:
    """Shapes that are no straight lines, over three values or more of a variable, ascending."""
    sides = (1.0,) if signed else (1.0, -1.0)
    low, high = float(different[0]), float(different[-1])
    many, place = len(different), variable in (*PLACE, "strut length")
    found = _squares(low, high, place)
    if column in SWINGS:
        found.append(("square", (("centre", 0.0), ("reach", high))))
    edges = [0.0] if column in AXES else _edges(different, MOST_EDGES if place else 3)
    found += [("threshold", (("edge", edge), ("side", side))) for edge in edges for side in sides]
    if place and many > 4:
        found += _bumps(low, high)
    if (place or variable not in VARIABLES) and many > 8:
        found += _periodic(variable, low, high - low, many, signed)
    return found


def _signs(signed: bool) -> list[tuple[str, Constants]]:
    """Tension or compression alone."""
    return [("sign", (("side", side),)) for side in ((1.0,) if signed else (1.0, -1.0))]


def _of_a_force(low: float, high: float, reference: float, several: bool, play: bool) -> list[tuple[str, Constants]]:
    """Powers of a force, what friction holds below some of it, and play that some of it uses up."""
    powers: list[tuple[str, Constants]] = [
        ("slope", (("power", power), ("reference", reference))) for power in (-1.0, -1.0 / 3.0)
    ]
    held = [low + share * (high - low) for share in (0.05, 0.15, 0.3)] if several else [0.5 * low, 0.9 * low]
    used_up: list[tuple[str, Constants]] = [("threshold", (("within", force),)) for force in held if play]
    return [*powers, *(("threshold", (("beyond", force),)) for force in held), *used_up]


def _squares(low: float, high: float, place: bool) -> list[tuple[str, Constants]]:
    """Squares about the middle of the range, and of a place about the machine's axis."""
    centres = [0.5 * (low + high)] + ([0.0] if low < 0.0 < high and place else [])
    return [("square", (("centre", c), ("reach", max(high - c, c - low)))) for c in centres]


def _bumps(low: float, high: float) -> list[tuple[str, Constants]]:
    """Bumps over the range of a place, of two widths."""
    return [
        ("bump", (("centre", float(c)), ("width", (high - low) / parts)))
        for c in np.linspace(low, high, BUMPS)
        for parts in (4.0, 8.0)
    ]


def _slopes(low: float, high: float, signed: bool, within: bool) -> list[tuple[str, Constants]]:
    """Straight lines over the range, and from its middle on."""
    middle = 0.5 * (low + high)
    if signed:
        begins = (middle,) if within else ()
        bent = [(("from", b), ("end", e)) for b in begins for e in (low, high)]
        return [("slope", (("start", middle), ("end", high))), *(("threshold", at) for at in bent)]
    lines = [(low, high), (high, low)] + ([(middle, high), (middle, low)] if within else [])
    return [("slope", (("start", start), ("end", end))) for start, end in lines]


def _edges(different: FloatArray, most: int) -> list[float]:
    """Edges between values, and 0 where it lies among them."""
    between = 0.5 * (different[1:] + different[:-1])
    if len(between) > most:
        between = between[np.unique(np.linspace(0, len(between) - 1, most + 2).round().astype(int)[1:-1])]
    return [*between.tolist(), 0.0] if different[0] < 0.0 < different[-1] else between.tolist()


def _periodic(variable: str, low: float, span: float, many: int, signed: bool) -> list[tuple[str, Constants]]:
    """Waves over the range: some turns of a place, down to a screw's lead in a strut's length."""
    turns = np.arange(1.0, min(MOST_TURNS, many / 3.0) + 0.5)
    if variable == "strut length":
        # So close that between two neighbours a wave over the whole range loses a quarter of a turn at most.
        turns = np.arange(1.0, min(span / SHORTEST_PITCH, many / 3.0), 0.5)
    found: list[tuple[str, Constants]] = []
    for turn in turns.tolist():
        period = span / turn
        phases = np.arange(PHASES if signed else 2 * PHASES) / (2.0 * PHASES)
        found += [("periodic", (("period", period), ("crest", low + float(p) * period))) for p in phases]
    return found


def shapes_near(term: Term, ground: Ground, finer: float) -> list[Term]:
    """The same term with constants about its own: steps of a grid's spacing times `finer`."""
    at = term.constants
    names = [name for name in at if name not in ("first", "second", "side", "power", "reference", "reach")]
    if not names or term.shape == "sign":
        return []
    values = ground.values(term.variable, term.column)
    low, high = float(values.min()), float(values.max())
    step = finer * (high - low) / BUMPS
    moves: dict[str, FloatArray] = {name: at[name] + step * np.linspace(-0.5, 0.5, 7) for name in names}
    for name in {"width", "period"} & set(names):
        spread = 0.7 if name == "width" else 0.25 * at["period"] / (high - low)
        moves[name] = at[name] * np.exp(finer * np.linspace(-spread, spread, 7))
    if "crest" in names:
        moves["crest"] = at["crest"] + finer * at["period"] / (2 * PHASES) * np.linspace(-0.5, 0.5, 7)
    if "end" in at:  # where it begins; its end is a matter of scale
        begins = "from" if "from" in at else "start"
        moves = {begins: np.clip(moves[begins], low - step, high + step)}
        if begins == "start" and len(term.signs) > 1:
            return []
    found = []
    for values_of in product(*moves.values()):
        new = at | dict(zip(moves, (float(v) for v in values_of), strict=True))
        if "width" in new and new["width"] < (high - low) / 30.0:
            continue
        if "end" in at and (new["end"] - new[begins]) * (at["end"] - at[begins]) <= 0.0:
            continue
        found.append(replace(term, at=tuple(new.items())))
    return found if moves else []


# -- columns -----------------------------------------------------------------------------------------------------------


class Ground:
    """What columns are made from: the readings as the links feel them.

    Parameters
    ----------
    predictor
        The model and n readings.
    compliance, law
        (n,) m/N of the model that a term is added to; (2,) logarithms of the factors on its strut law.
    """

    def __init__(self, predictor: Predictor, compliance: FloatArray, law: FloatArray) -> None:
        data, path = predictor.data, predictor.full_path()
        forces = predictor.strut_forces()
        self.predictor, self.data, self.compliance = predictor, data, compliance
        self.path: LoadPath = replace(path, strut_forces=forces * data.force[:, None], direction=data.direction)
        self.forces = np.concatenate([forces, data.direction, np.zeros_like(data.direction)], axis=1)  # [f; w]
        self.law = law
        self.softness = 1.0 / scaled_law(predictor.machine.strut_law, law).stiffness(path.struts.lengths)
        self._values: dict[tuple[str, str], FloatArray] = {}
        self._shares: dict[tuple[Any, ...], FloatArray] = {}
        self._shapes: dict[tuple[Any, ...], Shapes] = {}

    def values(self, variable: str, column: str = "") -> FloatArray:
        """(n,) or (n, 6) of a variable, SI; also the order of the readings (0 to 1) and further columns."""
        key = (variable, column)
        if key not in self._values:
            if variable == "order":
                found = np.linspace(0.0, 1.0, len(self.data))
            elif variable in self.data.extra:
                found = self.data.extra[variable]
            else:
                found = variable_values(variable, self.path, column)
            self._values[key] = found
        return self._values[key]

    def known(self, variable: str) -> bool:
        """Whether the readings say what a variable is."""
        needed = {"time": "time_min", "temperature": "temperature_C", "load": "force_N", "strut force": "force_N"}
        if variable in self.data.extra:
            return bool(np.isfinite(self.data.extra[variable]).all())
        return needed.get(variable, "") not in self.data.missing

    def share(self, term: Term) -> FloatArray:
        """(n,) or (n, 6) m/N that a term's link adds where its shape is 1, per unit of its size; worked out once."""
        key = (term.link, term.action, term.direction, term.where, term.column, *term.at[:2])
        if term.action not in ("coupling", "joint offset"):
            key = key[:4]
        if key not in self._shares:
            self._shares[key] = self._share(term)
        return self._shares[key]

    def _share(self, term: Term) -> FloatArray:
        path = self.path
        plain = replace(term, variable="constant", shape="offset", times=None)
        if term.action in (*IN_SERIES, "turning"):
            each = self.forces[:, :6] ** 2
            if term.action == "turning":
                turns = np.einsum("nkai,nij,nj->nka", self._rotations, self._flexibility, self.forces[:, 6:])
                each = -(turns**2).sum(axis=2) * self._seen[:, None]
            if term.action in PINS:
                each = each * along_pins(term.action, term.direction, path) ** 2
            if term.action == "strut factor":
                each = each * self.softness
            if term.where is not None:
                each = each * (np.arange(6) == term.where - 1)
            return np.asarray(each)
        if term.action == "coupling":
            first, second = coupled(term)
            return np.asarray(2.0 * self.forces[:, first] * self.forces[:, second] * coupling_share(plain, path))
        if term.action == "joint offset":
            strut, axis = (term.where or 1) - 1, "XYZ".index(term.direction)
            at = 3 * (strut + 6 * (term.column == "platform")) + axis
            return np.asarray(-self.compliance * self.predictor.joint_columns()[:, at])
        if term.action in ("reading factor", "reading shift"):
            own = reading_share(plain, path)
            return np.asarray(own * (self.compliance if term.action == "reading factor" else 1.0 / self.data.force))
        rows = carriers(term.link, term.action, term.direction, term.where, path)
        return np.asarray((np.einsum("nkj,nj->nk", rows, self.forces) ** 2).sum(axis=1))

    @cached_property
    def _rotations(self) -> FloatArray:
        return end_rotations(self.path)

    @cached_property
    def _flexibility(self) -> FloatArray:
        """(n, 6, 6) of the tip, forces and moments."""
        machine = self.path.machine
        machine = machine.with_changes(strut_law=scaled_law(machine.strut_law, self.law))
        path = replace(self.path, machine=machine)
        links = exact.assemble_links(replace(self.predictor.base, machine=machine), path)
        return exact.respond(path, links, np.broadcast_to(np.eye(6), (len(path), 6, 6)))[0]

    @cached_property
    def _seen(self) -> FloatArray:
        """(n,) compliance over that of `_flexibility`: where more gives way, the joints turn by as much more."""
        wrench = self.forces[:, 6:]
        return np.asarray(self.compliance / np.einsum("ni,nij,nj->n", wrench, self._flexibility, wrench))

    def _turned_by(self, weights: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
        """(n,) m/N per unit of size that `turning` of weights (n, 6) adds at a size, and by which it grows there.

        Springs K of the rotations B x of a twist x stand parallel to what bears the load: C + dC = (C^-1 + B^T K B)^-1.
        """
        springs = np.einsum("nk,nkai,nkaj->nij", size * weights, self._rotations, self._rotations)
        wrench = self.forces[:, 6:, None]
        moved = np.linalg.solve(np.eye(6) + self._flexibility @ springs, self._flexibility @ wrench)
        change = ((moved - self._flexibility @ wrench) * wrench).sum(axis=(1, 2))
        slope = -(np.einsum("nij,njk->nik", springs, moved) * moved).sum(axis=(1, 2))
        return np.asarray(change * self._seen / size), np.asarray(slope * self._seen / size)

    def _turned(self, term: Term, tangents: FloatArray, shapes: FloatArray) -> FloatArray:
        """(s, n) of `turning`, at the term's size or, where it has none, at one as it is usually found."""
        found = []
        for tangent, shape in zip(tangents, shapes, strict=True):
            size = term.size or TURNED / max(float(np.sqrt(np.mean((tangent / self.compliance) ** 2))), 1e-12)
            found.append(self._turned_by(_each(shape, term), min(size, term.bounds[1] * term.si))[0])
        return np.array(found).reshape(tangents.shape)

    def slope(self, term: Term) -> FloatArray:
        """(n,) m/N by which what a term adds grows with its size; its `column` unless it is not linear in it."""
        if not term.size or term.action != "turning":
            return self.column(term)
        return self._turned_by(_each(self.shape(term), term), term.size)[1]

    def shape(self, term: Term) -> FloatArray:
        """(n,) or (n, 6) of what a term depends on."""
        values = self.values(term.variable, term.column)
        first = shape_values(term.shape, values, term.constants, len(term.signs) > 1)
        if term.times is None:
            return first
        return multiplied(first, factor_values(term.times, self.values(term.times.variable, term.times.column)))

    def shapes(self, variable: str, column: str, signed: bool, where: int | None) -> Shapes:
        """All shapes of a variable over these readings, worked out once; of strut `where` where each has its own."""
        values = self.values(variable, column)
        own = where if values.ndim == 2 else None
        key = (variable, column, signed, own)
        if key not in self._shapes:
            values = values if own is None else values[:, own - 1]
            named = tuple(shapes_of(variable, values, signed, column if variable == "tilt" else ""))
            rows = [shape_values(shape, values, dict(at), signed) for shape, at in named]
            self._shapes[key] = named, np.stack(rows) if rows else np.zeros((0, *values.shape))
        return self._shapes[key]

    def columns(self, term: Term, share: FloatArray, shapes: FloatArray) -> FloatArray:
        """(s, n) m/N per unit of size of a term's link, for shapes (s, n) or (s, n, 6); its `share` (n,) or (n, 6)."""
        if share.ndim == 1:
            return np.asarray(share * shapes)
        if shapes.ndim == 3:
            found = np.einsum("ni,sni->sn", share, shapes)
        else:
            found = (share.sum(axis=1) if term.where is None else share[:, term.where - 1]) * shapes
        return self._turned(term, found, shapes) if term.action == "turning" else np.asarray(found)

    def column(self, term: Term) -> FloatArray:
        """(n,) m/N per unit (SI) of a term's size."""
        share = self.share(term)
        if share.ndim == 1 and any(self.values(*one).ndim == 2 for one in _asked(term)):
            raise ValueError(f"{term.link} has no {' or '.join(term.variables)} of its own")
        shape = self.shape(term)
        return np.asarray(self.columns(term, share, shape[None])[0])


def _asked(term: Term) -> list[tuple[str, str]]:
    """Variables with their columns."""
    own = [(term.variable, term.column)]
    return own if term.times is None else [*own, (term.times.variable, term.times.column)]


def _each(shape: FloatArray, term: Term) -> FloatArray:
    """(n, 6) of a shape (n,) or (n, 6) at the struts of a term."""
    each = shape if shape.ndim == 2 else np.repeat(shape[:, None], 6, axis=1)
    return each if term.where is None else np.asarray(each * (np.arange(6) == term.where - 1))
