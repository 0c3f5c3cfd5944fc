"""The dictionary: for every link of the load path its own compliance, times each shape of what it can depend on.

Drawn up from the mechanics of a machine, not from any simulator: which forces a link carries says where its compliance
shows, and a link depends on what it feels. A table feels where the work stands on it; a strut its length, its force and
the nut's place on the screw; a platform and a tool how they lean; instruments the time, the load and where they stand.

A term's prior weight is even over links, over the variables of a link, over its places and directions, over shapes and
over the constants of a shape, so that no link is preferred for having many terms.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.stiffness.effects.contract import LoadPath
from toolpath_stiff.updating.inference.prediction import Predictor, scaled_law
from toolpath_stiff.updating.portrait.terms import (
    LINKS,
    VARIABLES,
    Action,
    Term,
    carriers,
    coupled,
    coupling_share,
    reading_share,
    shape_values,
    variable_values,
)

FloatArray = NDArray[np.float64]
Constants = tuple[tuple[str, float], ...]

WHOLE = ("constant", "load", "time", "order", "temperature", "setup")
PLACE = ("x", "y", "z", "radius")
ALL_STRUTS, ALL_VERTICES = (None, 1, 2, 3, 4, 5, 6), (None, 1, 2, 3)
SIDE = 0.2  # prior weight of what a link could do by a way round: a frame does not feel where the tip is
BUMPS, MOST_EDGES = 5, 5
SHORTEST_PITCH = 8e-3  # m, period in a strut's length: screws of mills have leads of 5 to 40 mm
PHASES = 3  # of half a turn; the other half is the other sign's
NOTHING = 1e-4  # rms change of stiffness by the largest size below which a term does nothing to these readings


@dataclass(frozen=True)
class Local:
    """A link as it gives way locally, with what it may depend on."""

    link: str
    action: Action
    direction: str
    where: int | None
    variables: tuple[str, ...]
    weight: float = 1.0
    column: str = ""
    at: Constants = ()

    def term(self, variable: str, shape: str, at: Constants, column: str = "") -> Term:
        """With a variable and a shape."""
        return Term(
            self.link, self.direction, variable, shape, self.action, self.where, (*self.at, *at), column or self.column
        )


def locals_of(extra: Iterable[str]) -> list[Local]:
    """Every link with its places and directions; `extra`: names of further columns, which instruments may feel."""
    further = tuple(extra)
    whole = (*WHOLE, *further)
    turning = ("X", "Y", "all", "tangential")
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
        *(Local("frame", "give", axis, None, (*whole, *PLACE), SIDE) for axis in ("X", "Y", "Z", "all")),
        *(Local("frame", "rocking", axis, None, ("constant", "load"), SIDE) for axis in turning),
        *(
            Local("table", "give", axis, None, (*whole, *PLACE))
            for axis in ("X", "Y", "Z", "all", "radial", "tangential")
        ),
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
            yield Local(link, "vertex", direction, where, ("constant", "load") if where else variables)


def _of_joints(whole: tuple[str, ...]) -> Iterator[Local]:
    """Joints: they give along their strut, or stand off their place."""
    for where in ALL_STRUTS:
        own = ("strut force", "force sign")
        variables = ("constant", "load", "temperature", *own) if where else (*whole, *own, "tilt")
        yield Local("joints", "strut", "along the struts", where, variables)
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


# -- shapes ------------------------------------------------------------------------------------------------------------


def shapes_of(variable: str, values: FloatArray, signed: bool, lean: bool = False) -> list[tuple[str, Constants]]:
    """Shapes over the values that a variable takes, with their constants; none where it does not vary.

    `signed`: of what may change to both sides, where one side of each shape says it all; `lean`: of a signed tilt,
    about which few poses say more than its side and its size.
    """
    if variable in ("constant", "direction", "setup"):
        return [("offset", ())]
    different = np.unique(np.round(values, 9))
    if variable == "force sign":
        sides = (1.0,) if signed else (1.0, -1.0)
        return [("sign", (("side", side),)) for side in sides] if len(different) > 1 else []
    if len(different) < 2 or different[-1] - different[0] <= 1e-9 * max(abs(different[-1]), 1e-9):
        return []
    low, high = float(different[0]), float(different[-1])
    many, place = len(different), variable in (*PLACE, "strut length")
    found: list[tuple[str, Constants]] = []
    if variable in ("load", "strut force") and not (signed and many == 2):
        reference = float(np.median(values))
        found += [("slope", (("power", power), ("reference", reference))) for power in (-1.0, -1.0 / 3.0)]
    found += _slopes(low, high, signed, many > 4)
    if many == 2:
        return found
    centres = [0.5 * (low + high)] + ([0.0] if low < 0.0 < high and place else [])
    found += [("square", (("centre", c), ("reach", max(high - c, c - low)))) for c in centres]
    edges = [0.0] if lean else _edges(different, MOST_EDGES if place else 3)
    sides = (1.0,) if signed else (1.0, -1.0)
    found += [("threshold", (("edge", edge), ("side", side))) for edge in edges for side in sides]
    if place and many > 4:
        found += [
            ("bump", (("centre", float(c)), ("width", (high - low) / parts)))
            for c in np.linspace(low, high, BUMPS)
            for parts in (4.0, 8.0)
        ]
    if (place or variable not in VARIABLES) and many > 8:
        found += _periodic(variable, low, high - low, many, signed)
    return found


def _slopes(low: float, high: float, signed: bool, within: bool) -> list[tuple[str, Constants]]:
    """Straight lines over the range, and from its middle on."""
    middle = 0.5 * (low + high)
    if signed:
        return [("slope", (("start", middle), ("end", high)))]
    lines = [(low, high), (high, low)] + ([(middle, high), (middle, low)] if within else [])
    return [("slope", (("start", start), ("end", end))) for start, end in lines]


def _edges(different: FloatArray, most: int) -> list[float]:
    """Edges between values, and 0 where it lies among them."""
    between = 0.5 * (different[1:] + different[:-1])
    if len(between) > most:
        between = between[np.unique(np.linspace(0, len(between) - 1, most + 2).round().astype(int)[1:-1])]
    return [*between.tolist(), 0.0] if different[0] < 0.0 < different[-1] else between.tolist()


def _periodic(variable: str, low: float, span: float, many: int, signed: bool) -> list[tuple[str, Constants]]:
    """Waves over the range: two turns at most of a place or of time, down to a screw's lead in a strut's length."""
    turns = np.array([1.0, 2.0])
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
    if term.shape == "slope":  # where it begins; its end is a matter of scale
        moves = {"start": np.clip(moves["start"], low - step, high + step)} if len(term.signs) == 1 else {}
    found = []
    for values_of in product(*moves.values()):
        new = at | dict(zip(moves, (float(v) for v in values_of), strict=True))
        if "width" in new and new["width"] < (high - low) / 30.0:
            continue
        if term.shape == "slope" and (new["end"] - new["start"]) * (at["end"] - at["start"]) <= 0.0:
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
        self.softness = 1.0 / scaled_law(predictor.machine.strut_law, law).stiffness(path.struts.lengths)
        self._values: dict[tuple[str, str], FloatArray] = {}

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
        """(n,) or (n, 6) m/N that a term's link adds where its shape is 1, per unit of its size."""
        path = self.path
        plain = replace(term, variable="constant", shape="offset")
        if term.action in ("strut", "strut factor"):
            each = self.forces[:, :6] ** 2 * (self.softness if term.action == "strut factor" else 1.0)
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

    def columns(
        self, share: FloatArray, variable: str, column: str, shape: str, at: list[Constants], signed: bool
    ) -> FloatArray:
        """(s, n) m/N per unit of size, for s sets of constants of one shape."""
        values = self.values(variable, column)
        constants = {name: np.array([dict(one)[name] for one in at]) for name, _ in (at[0] if at else ())}
        if share.ndim == 1 and values.ndim == 1:
            over: Mapping[str, Any] = {name: found[:, None] for name, found in constants.items()}
            return np.asarray(share * shape_values(shape, values[None], over, signed))
        each = share if share.ndim == 2 else share[:, None] / 6.0
        if values.ndim == 1:
            return self.columns(each.sum(axis=1), variable, column, shape, at, signed)
        used = np.flatnonzero(each.any(axis=0))
        over = {name: found[:, None, None] for name, found in constants.items()}
        return np.asarray((each[:, used] * shape_values(shape, values[None, :, used], over, signed)).sum(axis=-1))

    def column(self, term: Term) -> FloatArray:
        """(n,) m/N per unit (SI) of a term's size."""
        signed = len(term.signs) > 1
        return self.columns(self.share(term), term.variable, term.column, term.shape, [term.at], signed)[0]


@dataclass(frozen=True)
class Dictionary:
    """N terms with what they do to n readings.

    Attributes
    ----------
    terms
        The terms.
    columns
        (N, n) change of compliance over the compliance, scaled to an rms of 1.
    scale
        (N,) rms of compliance change over compliance, per SI unit of size.
    log_prior
        (N,) weights, normalised.
    signed
        (N,) whether the size may go to both sides.
    """

    terms: tuple[Term, ...]
    columns: FloatArray
    scale: FloatArray
    log_prior: FloatArray
    signed: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.terms)


def dictionary_of(ground: Ground) -> Dictionary:
    """Every term that does something to these readings."""
    terms: list[Term] = []
    blocks: list[FloatArray] = []
    groups: list[tuple[str, str, tuple[Any, ...], str, float]] = []
    for local in locals_of(ground.data.extra):
        share = ground.share(local.term("constant", "offset", ()))
        for variable in local.variables:
            for column, made in _shaped(local, variable, ground):
                for shape, at in made.items():
                    own = [(*local.at, *one) for one in at]
                    signed = len(local.term(variable, shape, at[0]).signs) > 1
                    blocks.append(ground.columns(share, variable, column, shape, own, signed))
                    terms += [local.term(variable, shape, one, column) for one in at]
                    place = (local.action, local.direction, local.where, local.at, local.column or column)
                    groups += [(local.link, variable, place, shape, local.weight)] * len(at)
    relative = np.concatenate(blocks) / ground.compliance
    scale = np.sqrt((relative**2).mean(axis=1))
    kept = scale * np.array([_largest(term) for term in terms]) > NOTHING
    kept &= ~_follows_law(relative, scale)
    chosen = np.flatnonzero(kept).tolist()
    return Dictionary(
        tuple(terms[i] for i in chosen),
        relative[kept] / scale[kept, None],
        scale[kept],
        _log_prior([groups[i] for i in chosen]),
        np.array([len(terms[i].signs) > 1 for i in chosen], dtype=bool),
    )


def _shaped(local: Local, variable: str, ground: Ground) -> Iterator[tuple[str, dict[str, list[Constants]]]]:
    """Columns of a variable (set-ups, leans) -> shape -> constants."""
    if not ground.known(variable):
        return
    columns = [""]
    if variable == "setup":
        columns = sorted(set(ground.data.setup.tolist()) - {""})
        columns = columns if len(columns) > 1 or "" in ground.data.setup else []
    elif variable == "tilt":
        columns = ["", "X", "Y"]
    signed = len(local.term(variable, "offset", ()).signs) > 1
    for column in columns:
        values = ground.values(variable, column)
        if values.ndim == 2 and local.where is not None and local.action in ("strut", "strut factor"):
            values = values[:, local.where - 1]
        made: dict[str, list[Constants]] = {}
        for shape, at in shapes_of(variable, values, signed, bool(column)):
            made.setdefault(shape if "power" not in dict(at) else f"{shape} power", []).append(at)
        yield column, {name.split(" ")[0]: at for name, at in made.items() if " " not in name}
        if "slope power" in made:
            yield column, {"slope": made["slope power"]}


def _largest(term: Term) -> float:
    """Largest size in SI."""
    return max(abs(bound) for bound in term.bounds) * term.si


def _follows_law(relative: FloatArray, scale: FloatArray) -> NDArray[np.bool_]:
    """Terms that change every reading alike: the strut law does that."""
    flat = relative - relative.mean(axis=1, keepdims=True)
    still: NDArray[np.bool_] = (flat**2).mean(axis=1) < (1e-6 * scale) ** 2
    return still


def _log_prior(groups: list[tuple[str, str, tuple[Any, ...], str, float]]) -> FloatArray:
    """Even over links, over the variables of each, over places and directions by their weight, shapes, constants."""
    count: dict[tuple[Any, ...], int] = {}
    for one in groups:
        count[one] = count.get(one, 0) + 1
    tree: dict[str, dict[str, dict[tuple[Any, ...], dict[str, tuple[int, float]]]]] = {}
    for (link, variable, place, shape, weight), many in count.items():
        tree.setdefault(link, {}).setdefault(variable, {}).setdefault(place, {})[shape] = (many, weight)
    logs: dict[tuple[Any, ...], float] = {}
    for link, variables in tree.items():
        for variable, places in variables.items():
            total = sum(next(iter(shapes.values()))[1] for shapes in places.values())
            for place, shapes in places.items():
                for shape, (many, weight) in shapes.items():
                    share = weight / max(total, len(places) * SIDE) / len(shapes) / many
                    logs[link, variable, place, shape, weight] = float(np.log(share / len(variables) / len(tree)))
    return np.array([logs[one] for one in groups], dtype=float)


assert set(LINKS) >= {local.link for local in locals_of(())}
