"""Effects of terms on readings: shapes over the values that occur, and compliance added by a unit of a term."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.inference.prediction import Predictor, scaled_law
from toolpath_stiff.stiffness import exact
from toolpath_stiff.stiffness.contract import LoadPath
from toolpath_stiff.stiffness.effects.joint_moment_stiffness import end_rotations
from toolpath_stiff.stiffness.term_effect import (
    NEEDS,
    carriers,
    coupled,
    pair_stiffness,
    reading_share,
    spring_rows,
    spring_stiffness,
    strut_share,
)
from toolpath_stiff.stiffness.terms import (
    AXES,
    IN_SERIES,
    PAIR,
    PARALLEL,
    PLACE,
    SWINGS,
    VARIABLES,
    Constants,
    Term,
    shape_values,
    shaped,
    variable_values,
)

Shape = tuple[str, Constants]  # and its constants
Shapes = tuple[tuple[Shape, ...], FloatArray]  # shape and constants; (s, n) or (s, n, 6) values
BUMPS, MOST_EDGES = 5, 5
SHORTEST_PITCH = 8e-3  # m, period in a strut's length: screws of mills have leads of 5 to 40 mm
MOST_TURNS = 5  # of a wave over a place: clamps and grooves of a table
TURNED = 0.1  # rms change of stiffness at which a resistance to turning, not linear in size, is searched for
MOST_HELD = 1000  # readings; beyond, the dictionary keeps no columns, only shapes with seven digits
PHASES = 3  # phases over half a turn; the other half is covered by the other sign


def shapes_of(variable: str, values: FloatArray, signed: bool, column: str = "") -> list[Shape]:
    """Shapes over the values of a variable, with their constants; none if it does not vary.

    `signed`: of what may change to both sides, where one side of each shape says it all; `column`: of a tilt. About a
    lean few poses say more than its side and its size; a swing counts from where the joint rests.
    """
    if variable in ("constant", "direction", "setup"):
        return [("offset", ())]
    sides = (1.0,) if signed else (1.0, -1.0)
    different = np.unique(np.round(values, 9))
    low, high, many = float(different[0]), float(different[-1]), len(different)
    if variable == "force sign":
        return [("sign", (("side", side),)) for side in sides] if many > 1 else []
    if many < 2 or high - low <= 1e-9 * max(abs(high), 1e-9):
        return []
    middle, place = 0.5 * (low + high), variable in (*PLACE, "strut length")
    shapes: list[Shape] = []
    if variable in ("load", "strut force") and not (signed and many == 2):
        # Powers of a force, and what friction holds below some of it. Of what may change to both sides, less of what
        # friction holds is play, which some of a force uses up.
        reference = float(np.median(values))
        shapes += [("slope", (("power", power), ("reference", reference))) for power in (-1.0, -1.0 / 3.0)]
        held = [low + share * (high - low) for share in (0.05, 0.15, 0.3)] if many > 2 else [0.5 * low, 0.9 * low]
        shapes += [("threshold", (("beyond", force),)) for force in held]
        if variable == "strut force" and not signed:
            shapes += [("threshold", (("within", force),)) for force in held]
    if variable == "tool length":  # a holder that tilts, a tool that bends (a cantilever: l^2, l^3 / 3 E I)
        return [("slope", (("power", power), ("reference", low))) for power in (2.0, 3.0)]
    # Straight lines over the range, and from its middle on.
    bent = ([low, high] if signed else [high, low]) if many > 4 else []
    if signed:
        shapes.append(("slope", (("start", middle), ("end", high))))
        shapes += [("threshold", (("from", middle), ("end", end))) for end in bent]
    else:
        lines = [(low, high), (high, low), *((middle, end) for end in bent)]
        shapes += [("slope", (("start", start), ("end", end))) for start, end in lines]
    if many == 2:
        return shapes
    # Squares about the middle of the range, and of a place about the machine's axis.
    squares = [(c, max(high - c, c - low)) for c in [middle, *([0.0] if low < 0.0 < high and place else [])]]
    squares += [(0.0, high)] if column in SWINGS else []
    shapes += [("square", (("centre", centre), ("reach", reach))) for centre, reach in squares]
    edges = [0.0] if column in AXES else _edges(different, MOST_EDGES if place else 3)
    shapes += [("threshold", (("edge", edge), ("side", side))) for edge in edges for side in sides]
    if place and many > 4:
        bumps = product(np.linspace(low, high, BUMPS).tolist(), (4.0, 8.0))
        shapes += [("bump", (("centre", centre), ("width", (high - low) / parts))) for centre, parts in bumps]
    if (place or variable not in VARIABLES) and many > 8:
        shapes += _periodic(variable, low, high - low, many, signed)
    return shapes


def _edges(different: FloatArray, most: int) -> list[float]:
    """Edges between neighbouring values, and 0 if it lies among them."""
    between = 0.5 * (different[1:] + different[:-1])
    if len(between) > most:
        between = between[np.unique(np.linspace(0, len(between) - 1, most + 2).round().astype(int)[1:-1])]
    return [*between.tolist(), 0.0] if different[0] < 0.0 < different[-1] else between.tolist()


def _periodic(variable: str, low: float, span: float, many: int, signed: bool) -> list[Shape]:
    """Waves over the range: a few periods over a place; down to a screw's lead over a strut's length."""
    turns = np.arange(1.0, min(MOST_TURNS, many / 3.0) + 0.5)
    if variable == "strut length":
        # Spaced so that over the whole range two neighbouring waves differ by a quarter of a turn at most.
        turns = np.arange(1.0, min(span / SHORTEST_PITCH, many / 3.0), 0.5)
    phases = np.arange(PHASES if signed else 2 * PHASES) / (2.0 * PHASES)
    waves = product((span / turns).tolist(), phases.tolist())
    return [("periodic", (("period", period), ("crest", low + phase * period))) for period, phase in waves]


def shapes_near(term: Term, ground: Ground, finer: float) -> list[Term]:
    """The term with constants near its own, in steps of a grid's spacing times `finer`."""
    constants = term.constants
    names = set(constants) - {"first", "second", "side", "power", "reference", "reach"}
    if not names or term.shape == "sign":
        return []
    values = ground.values(term.variable, term.column)
    low, high = float(values.min()), float(values.max())
    step = finer * (high - low) / BUMPS
    about = np.linspace(-0.5, 0.5, 7)
    moves = {name: constants[name] + step * about for name in constants if name in names}
    for name in {"width", "period"} & names:
        spread = 0.7 if name == "width" else 0.25 * constants["period"] / (high - low)
        moves[name] = constants[name] * np.exp(finer * np.linspace(-spread, spread, 7))
    if "crest" in names:
        moves["crest"] = constants["crest"] + finer * constants["period"] / (2 * PHASES) * about
    begins = "from" if "from" in constants else "start"
    if "end" in constants:  # only the beginning moves; the end merely scales
        if begins == "start" and term.signed:
            return []
        moves = {begins: np.clip(moves[begins], low - step, high + step)}
    near = []
    for combination in product(*(move.tolist() for move in moves.values())):
        new = constants | dict(zip(moves, combination, strict=True))
        narrow = "width" in new and new["width"] < (high - low) / 30.0
        turned = "end" in constants and (new["end"] - new[begins]) * (constants["end"] - constants[begins]) <= 0.0
        if not (narrow or turned):
            near.append(replace(term, at=tuple(new.items())))
    return near


class Ground:
    """Basis for columns: the readings with the forces and variables that the links see.

    Parameters
    ----------
    predictor
        The model and n readings.
    compliance, law
        (n,) m/N of the model that a term is added to; (2,) logarithms of the factors on its strut law.
    """

    def __init__(self, predictor: Predictor, compliance: FloatArray, law: FloatArray) -> None:
        data, path = predictor.data, predictor.full_path
        forces = predictor.strut_forces()
        self.predictor, self.data, self.compliance = predictor, data, compliance
        machine = predictor.machine.with_changes(strut_law=scaled_law(predictor.machine.strut_law, law))
        self.path: LoadPath = replace(
            path, machine_tool=machine, strut_forces=forces * data.force[:, None], direction=data.direction
        )
        self.forces = np.concatenate([forces, data.direction, np.zeros_like(data.direction)], axis=1)  # [f; w]
        self._values: dict[tuple[str, str], FloatArray] = {}
        self._shares: dict[Term, FloatArray] = {}
        self._shapes: dict[tuple[Any, ...], Shapes] = {}

    def values(self, variable: str, column: str = "") -> FloatArray:
        """(n,) or (n, 6) values of a variable, SI; also of the order of readings (0 to 1) and of further columns."""
        if variable == "order":
            return np.linspace(0.0, 1.0, len(self.data))
        if variable in self.data.extra:
            return self.data.extra[variable]
        if (variable, column) not in self._values:
            self._values[variable, column] = variable_values(variable, self.path, column)
        return self._values[variable, column]

    def known(self, variable: str) -> bool:
        """True if the readings state the variable."""
        if variable in self.data.extra:
            return bool(np.isfinite(self.data.extra[variable]).all())
        if variable == "tool length":
            return self.predictor.machine.reference_tool_length > 0.0 and "tool_extension_mm" not in self.data.missing
        return NEEDS.get(variable, "") not in self.data.missing

    def share(self, term: Term) -> FloatArray:
        """(n,) or (n, 6) m/N added by a term's link where its shape is 1, per unit of its size; computed once."""
        plain = _plain(term)
        if plain not in self._shares:
            self._shares[plain] = self._share(plain)
        return self._shares[plain]

    def _share(self, term: Term) -> FloatArray:
        path = self.path
        if term.action in IN_SERIES:
            return self.forces[:, :6] ** 2 * strut_share(term, path)
        if term.action == "turning":
            turns = np.einsum("nkai,nij,nj->nka", self._rotations, self._flexibility, self.forces[:, 6:])
            return np.asarray(-(turns**2).sum(axis=2) * self._seen[:, None] * strut_share(term, path))
        if term.action == "coupling":
            first, second = coupled(term)
            return np.asarray(2.0 * self.forces[:, first] * self.forces[:, second] * (1.0 / pair_stiffness(term, path)))
        if term.action == "joint offset":
            strut, axis = (term.where or 1) - 1, "XYZ".index(term.direction)
            index = 3 * (strut + 6 * (term.column == "platform")) + axis
            return np.asarray(-self.compliance * self.predictor.joint_columns[:, index])
        if term.action == "spring":
            moves = np.einsum("nki,nij,nj->nk", spring_rows(term, path), self._flexibility, self.forces[:, 6:])
            return np.asarray(-(moves**2).sum(axis=1) * self._seen)
        if term.action in ("reading factor", "reading shift"):
            share = reading_share(term, path)
            return np.asarray(share * (self.compliance if term.action == "reading factor" else 1.0 / self.data.force))
        rows = carriers(term, path)
        return np.asarray((np.einsum("nkj,nj->nk", rows, self.forces) ** 2).sum(axis=1))

    @cached_property
    def _rotations(self) -> FloatArray:
        return end_rotations(self.path)

    @cached_property
    def _flexibility(self) -> FloatArray:
        """(n, 6, 6) compliance of the tip to forces and moments."""
        path = self.path
        links = exact.assemble_links(replace(self.predictor.base, machine=path.machine), path)
        return exact.respond(path, *links, np.broadcast_to(np.eye(6), (len(path), 6, 6)))[0]

    @cached_property
    def _seen(self) -> FloatArray:
        """(n,) ratio of the compliance to that of `_flexibility`: the joints turn by so much more in proportion."""
        wrench = self.forces[:, 6:]
        return np.asarray(self.compliance / np.einsum("ni,nij,nj->n", wrench, self._flexibility, wrench))

    def _parallel(self, term: Term, shape: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
        """(n,) m/N per unit of size that a term of `PARALLEL` adds at a size, and its slope there.

        Springs K of the motions B x of a twist x stand parallel to what bears the load: C + dC = (C^-1 + B^T K B)^-1.
        """
        if term.action == "spring":
            springs = spring_stiffness(term, self.path, size * shape)
        else:
            weights = size * strut_share(_plain(term), self.path) * shape.reshape(len(shape), -1)
            rows = self._rotations.reshape(len(shape), -1, 6)
            springs = np.swapaxes(rows, 1, 2) @ (weights[:, :, None, None] * self._rotations).reshape(rows.shape)
        wrench = self.forces[:, 6:, None]
        moved = np.linalg.solve(np.eye(6) + self._flexibility @ springs, self._flexibility @ wrench)
        change = ((moved - self._flexibility @ wrench) * wrench).sum(axis=(1, 2))
        slope = -(np.einsum("nij,njk->nik", springs, moved) * moved).sum(axis=(1, 2))
        return np.asarray(change * self._seen / size), np.asarray(slope * self._seen / size)

    def _at_size(self, term: Term, tangents: FloatArray, shapes: FloatArray) -> FloatArray:
        """(s, n) secant columns of a term of `PARALLEL`, at its size or, if it has none yet, at a usual one."""
        rows = []
        for tangent, shape in zip(tangents, shapes, strict=True):
            size = term.size or TURNED / max(float(np.sqrt(np.mean((tangent / self.compliance) ** 2))), 1e-12)
            rows.append(self._parallel(term, shape, min(size, term.bounds[1] * term.si))[0])
        return np.array(rows).reshape(tangents.shape)

    def slope(self, term: Term) -> FloatArray:
        """(n,) derivative of a term's contribution in m/N by its size; equal to its `column` if linear in size."""
        if not term.size or term.action not in PARALLEL:
            return self.column(term)
        return self._parallel(term, self.shape(term), term.size)[1]

    def shape(self, term: Term) -> FloatArray:
        """(n,) or (n, 6) shape of a term at the readings."""
        return shaped(term, self.values)

    def shapes(self, variable: str, column: str, signed: bool, where: int | None) -> Shapes:
        """All shapes of a variable over these readings, computed once; of strut `where` if each has its own."""
        values = self.values(variable, column)
        strut = where if values.ndim == 2 else None
        key = (variable, column, signed, strut)
        if key not in self._shapes:
            values = values if strut is None else values[:, strut - 1]
            named = tuple(shapes_of(variable, values, signed, column if variable == "tilt" else ""))
            kind = float if len(values) <= MOST_HELD else np.float32
            rows = [shape_values(shape, values, dict(at), signed).astype(kind) for shape, at in named]
            self._shapes[key] = named, np.stack(rows) if rows else np.zeros((0, *values.shape))
        return self._shapes[key]

    def columns(self, term: Term, share: FloatArray, shapes: FloatArray) -> FloatArray:
        """(s, n) m/N per unit of size of a term's link, for shapes (s, n) or (s, n, 6) and `share` (n,) or (n, 6)."""
        if share.ndim == 1:
            columns = share * shapes
        elif shapes.ndim == 3:
            columns = np.einsum("ni,sni->sn", share, shapes)
        else:
            columns = (share.sum(axis=1) if term.where is None else share[:, term.where - 1]) * shapes
        # Springs searched for are small beside the struts: the tangent will do.
        straight = term.action not in PARALLEL or (term.action == "spring" and not term.size)
        return np.asarray(columns) if straight else self._at_size(term, columns, shapes)

    def column(self, term: Term) -> FloatArray:
        """(n,) m/N per unit (SI) of a term's size."""
        return np.asarray(self.columns(term, self.share(term), self.shape(term)[None])[0])


def _plain(term: Term) -> Term:
    """The term's link with shape 1, as a key; a coupling keeps its pair, a joint offset its end."""
    column = term.column if term.action == "joint offset" else ""
    pair = tuple((name, value) for name, value in term.at if name in PAIR)
    return replace(term, variable="constant", shape="offset", at=pair, column=column)
