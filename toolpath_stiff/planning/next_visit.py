"""Which pose next, at the machine: a plan's tables, and the readings taken so far, without the model.

A plan's rivals are linear about their fits: each expects ln k of every possible reading as a mean, with a factor of the
covariance that its parameters and the machine's unknowns leave open. Readings then change all of it in closed form,
by Bayes' rule: the probabilities of the rivals, their means, their factors (Gaussian conditioning; Rasmussen and
Williams 2006, Gaussian Processes for Machine Learning, appendix A.2). What a plan has worked out once
serves every step.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolpath_stiff.arrays import FloatArray, IntArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.errors import FileError, InputError
from toolpath_stiff.files import read_bytes, write_atomically
from toolpath_stiff.planning.gaps import SETTLED, ReadingNoise, choose, further_minutes, pair_shares, why_of
from toolpath_stiff.planning.plan import RivalPlan
from toolpath_stiff.planning.result import Plan
from toolpath_stiff.planning.rivals import Forecast, principal
from toolpath_stiff.planning.rows import POSE, plan_csv, plan_rows
from toolpath_stiff.planning.visits import Costs, Menu, Visits, planned_readings
from toolpath_stiff.readings.mapping import mapped_table
from toolpath_stiff.readings.rows import COLUMNS, Row, read_rows
from toolpath_stiff.results import Result
from toolpath_stiff.units import certain

if TYPE_CHECKING:
    import pandas as pd

TABLES = "plan_tables.npz"  # in the plan's folder


VERSION = 1


OUT = 5e-3  # probability below which a rival no longer takes part in the choice


DOUBTFUL = 4.0  # standard deviations by which a reading is off under every rival


WILD_SHARE = 0.1  # of the readings may be that far off; assumed


OF_VISITS = ("pose", "extension", "wait", "setup", "label", "names", "rounds", "members", "starts")


def tables_of(planned: Plan) -> bytes:
    """Content of `TABLES`: everything that the choice of the next visit needs."""
    plan = planned.choice
    assert isinstance(plan, RivalPlan)
    readings, beside = plan.visits.readings, plan.visits.readings.beside
    arrays: dict[str, Any] = {name: getattr(plan.visits, name) for name in OF_VISITS}
    arrays |= {
        "loop": np.full(len(plan.visits), "") if plan.visits.loop is None else plan.visits.loop,
        "force": readings.force,
        "time": readings.time,
        "of_loop": readings.loop,
        "offset": np.zeros(len(readings)) if beside is None else beside.offset,
        "toward": np.ones(len(readings)) if beside is None else beside.toward,
        "usable": plan.usable,
        "machine": _certain(_canonical(plan.scatter.machine), DIGITS_OF_FACTOR),
    }
    for k, one in enumerate(plan.forecasts):
        arrays[f"mean_{k}"] = _certain(one.mean, DIGITS_OF_MEAN)
        arrays[f"factor_{k}"] = _certain(_canonical(one.factor), DIGITS_OF_FACTOR)
    said = {
        "version": VERSION,
        "rivals": [[one.name, one.weight] for one in plan.forecasts],
        "noise": [plan.scatter.repeat, plan.scatter.clamping],
        "costs": vars(planned.costs),
        "setups": list(planned.menu.setups),
        "tools": list(planned.menu.tool_extensions),
        "waits": list(planned.menu.waits),
    }
    file = io.BytesIO()
    np.savez(file, said=np.frombuffer(json.dumps(said).encode(), dtype=np.uint8), **arrays)
    return file.getvalue()


# Digits of the largest value that are kept: coarse enough that the differences of processors, some 1e-12 in 1e5 values,
# hardly ever turn one; 0.02 % of a standard deviation, 1e-5 of a stiffness.
DIGITS_OF_FACTOR, DIGITS_OF_MEAN = 4, 7


INDEPENDENT = 1e-4  # of the largest row, by which a row has a direction of its own


def _canonical(columns: FloatArray) -> FloatArray:
    """(m, k) columns with the covariance of (m, q), the same on every processor.

    A factor of a covariance is one of many, turned as the processor's eigenvectors happen to be. This one is lower
    triangular over the first rows that are independent of those before them, with a positive diagonal.
    """
    least = INDEPENDENT * float(np.linalg.norm(columns, axis=1).max(initial=0.0))
    basis = np.zeros((0, columns.shape[1]))
    for row in columns:
        own = row - (row @ basis.T) @ basis
        own -= (own @ basis.T) @ basis  # once more, against rounding
        length = float(np.linalg.norm(own))
        if length > least:
            basis = np.concatenate([basis, own[None] / length])
        if len(basis) == columns.shape[1]:
            break
    return np.asarray(columns @ basis.T)


def _certain(values: FloatArray, digits: int) -> FloatArray:
    """Values rounded to so many digits of the largest."""
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return np.round(values, digits - int(np.ceil(np.log10(largest)))) + 0.0 if largest > 0.0 else values


@dataclass(frozen=True)
class Tables:
    """What a plan has worked out: visits, forecasts of all their readings, noise, what work costs."""

    visits: Visits
    usable: NDArray[np.bool_]
    forecasts: tuple[Forecast, ...]
    noise: ReadingNoise
    costs: Costs
    menu: Menu
    offset: FloatArray
    toward: FloatArray

    @classmethod
    def read(cls, folder: str | Path) -> Tables:
        """Of a plan's folder. Raises `InputError` where it holds none, or those of another version."""
        path = Path(folder) / TABLES
        try:
            with np.load(io.BytesIO(read_bytes(path, "the plan's tables")), allow_pickle=False) as file:
                found = {name: file[name] for name in file.files}
            said = json.loads(found.pop("said").tobytes())
            if said["version"] != VERSION:
                raise ValueError
            return _tables(found, said)
        except FileError as error:
            raise InputError(
                error.found, expected="the folder of a plan between rivals", hint="make one with tps plan"
            ) from None
        except (ValueError, KeyError, OSError, EOFError):
            raise InputError(
                f"{path} is no table of a plan", expected="what tps plan of this version wrote", hint="plan again"
            ) from None


def _tables(found: dict[str, Any], said: dict[str, Any]) -> Tables:
    which = np.empty(len(found["names"]), dtype=np.int64)
    for visit, start in enumerate(found["starts"].tolist()):
        end = found["starts"][visit + 1] if visit + 1 < len(found["starts"]) else len(found["members"])
        which[found["members"][start:end]] = visit
    readings = planned_readings(
        found["pose"][which], found["names"], found["force"], found["extension"][which], found["setup"][which],
        found["time"], found["of_loop"],
    )  # fmt: skip
    visits = Visits(
        **{name: found[name] for name in OF_VISITS},
        readings=readings,
        loop=found["loop"] if any(found["loop"]) else None,
    )
    forecasts = tuple(
        Forecast(name, float(weight), found[f"mean_{k}"], found[f"factor_{k}"])
        for k, (name, weight) in enumerate(said["rivals"])
    )
    menu = Menu(setups=tuple(said["setups"]), tool_extensions=tuple(said["tools"]), waits=tuple(said["waits"]))
    repeat, clamping = said["noise"]
    noise = ReadingNoise(repeat, clamping, found["machine"])
    return Tables(
        visits, found["usable"], forecasts, noise, Costs(**said["costs"]), menu, found["offset"], found["toward"],
    )  # fmt: skip


class Taken(NamedTuple):
    """Readings taken: which of the plan's (k,), ln k (k,), label of the clamping (k,), file and line of each."""

    rows: IntArray
    logs: FloatArray
    clamp: NDArray[np.str_]
    where: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class NextVisit(Result):
    """Where a plan stands, and the visit to make next.

    Attributes
    ----------
    folder, tables
        The plan's.
    taken
        Readings so far.
    weights
        Rival -> probability, the likeliest first.
    visit
        Number of the next visit; None where the question is settled or nothing is left to go to.
    why
        What it is for.
    unlike
        Whether more readings than chance allows are far off under every rival: then none of them is the explanation.
    notes
        What was passed over, or is doubtful.
    """

    command: ClassVar[str] = "plan"

    folder: str | Path
    tables: Tables
    taken: Taken
    weights: dict[str, float]
    visit: int | None
    why: str
    unlike: bool
    notes: tuple[str, ...]

    @property
    def probability(self) -> dict[str, float]:
        """Explanation -> probability, the likeliest first; figures as they are written."""
        weights: dict[str, float] = certain(self.weights)
        return weights

    @property
    def settled(self) -> bool:
        """Whether one of them has 95 %."""
        return not self.unlike and max(self.weights.values()) >= SETTLED

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """Rows of the next visit, as of plan.csv; none where there is no next visit."""
        if self.visit is None:
            return []
        clamp = len(set(self.taken.clamp.tolist())) + 1
        point = str(self.tables.visits.label[self.visit]) or f"next {clamp}"
        return [{**row, "clamp": clamp, "point": point} for row in plan_rows(self.tables.visits, [self.visit])]

    @property
    def sentences(self) -> list[str]:
        """Where the plan stands, and what is next."""
        chances = ", ".join(f"{name} {_percent(weight)}" for name, weight in self.weights.items())
        lines = [f"after {len(self.taken.rows)} readings of this plan: {chances}"]
        if self.unlike:
            return [*lines, "too many readings are far off under each of these: ask tps diagnose what else it could be"]
        if self.settled:
            return [*lines, f"settled: one explanation has {100 * SETTLED:.0f} % or more; confirm it with tps diagnose"]
        if not self.rows:
            return [*lines, "nothing is left to go to that would tell them apart; ask tps diagnose"]
        x, y, z, a, b, c, tool = (f"{self.rows[0][key]:g}" for key in (*POSE, "tool_extension_mm"))
        longer = f", tool {tool} mm longer" if float(tool) else ""
        return [*lines, f"next: X{x} Y{y} Z{z} mm, A{a} B{b} C{c} deg{longer}", f"  {self.why}"]

    def to_dict(self) -> dict[str, Any]:
        """Probabilities, the next visit and its rows."""
        minutes = None
        if self.visit is not None:
            minutes = float(further_minutes(self.tables.visits, (), self.tables.costs, self.tables.menu)[self.visit])
        return {
            "rivals": [{"name": name, "probability": weight} for name, weight in self.probability.items()],
            "readings": len(self.taken.rows),
            "settled": self.settled,
            "minutes": certain(minutes),
            "why": self.why,
            "text": self.sentences,
            "notes": list(self.notes),
            "rows": self.rows,
        }

    def to_frame(self) -> pd.DataFrame:
        """One row a reading of the next visit, the stiffness left empty; none where there is no next visit."""
        import pandas as pd

        return pd.DataFrame(self.rows)

    def save(self) -> list[Path]:
        """Write the next visit's rows, a measurement file to fill in, as next_1.csv (2, 3...) into the plan's folder.

        A file that is there already stays: it is the same visit, perhaps filled in.
        """
        file = Path(self.folder) / f"next_{self.rows[0]['clamp']}.csv" if self.rows else None
        return [] if file is None or file.exists() else [write_atomically(file, plan_csv(self.rows))]

    def __str__(self) -> str:
        return "\n".join([*self.sentences, *(f"note: {note}" for note in self.notes)])

    def _short(self) -> str:
        count = len(self.taken.rows)
        return f"{count} reading{'' if count == 1 else 's'}, {'settled' if self.settled else 'open'}"


def _percent(share: float) -> str:
    """Never "100 %" or "0 %"."""
    if share > 0.99:
        return "more than 99 %"
    return "less than 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def next_visit(folder: str | Path, files: tuple[str, ...] = (), columns: Mapped = None) -> NextVisit:
    """Where to go next after some readings of a plan.

    Parameters
    ----------
    folder
        Of the plan.
    files
        Measurement files with the readings taken so far, rows still empty among them; none: the plan's own plan.csv,
        and those of the visits chosen one by one.

    Raises
    ------
    InputError, InputErrors
        The folder holds no tables; a file cannot be read, bad rows.
    """
    tables = Tables.read(folder)
    taken, notes = _taken(tables, files or own_files(folder), columns)
    forecasts, far = tables.forecasts, list[tuple[int, float]]()
    if len(taken.rows):
        forecasts, far = conditioned(tables, taken)
        notes += [f"{taken.where[k]}: {size:.1f} standard deviations off under every rival" for k, size in far]
    probability = {one.name: one.weight for one in sorted(forecasts, key=lambda one: -one.weight)}
    unlike = len(far) > max(1.0, WILD_SHARE * len(taken.rows))
    done = unlike or max(probability.values()) >= SETTLED
    visit, why = (None, "") if done else _next(tables, forecasts, taken)
    return NextVisit(folder, tables, taken, probability, visit, why, unlike, tuple(notes))


def own_files(folder: str | Path) -> tuple[str, ...]:
    """A plan's own measurement files: plan.csv, and next_1.csv and so on as far as there are any."""
    chosen: list[str] = []
    while (file := Path(folder) / f"next_{len(chosen) + 1}.csv").exists():
        chosen.append(str(file))
    return (str(Path(folder) / "plan.csv"), *chosen)


def conditioned(tables: Tables, taken: Taken) -> tuple[tuple[Forecast, ...], list[tuple[int, float]]]:
    """The rivals' forecasts after readings, weights with them; and readings far off under every rival."""
    same = taken.clamp[:, None] == taken.clamp[None, :]
    scatter = tables.noise.repeat**2 * np.eye(len(taken.rows)) + tables.noise.clamping**2 * same
    inverse = np.linalg.inv(scatter)
    logs, means, factors, off = [], [], [], []
    for one in tables.forecasts:
        factor = np.concatenate([one.factor, tables.noise.machine], axis=1)
        own, residual = factor[taken.rows], taken.logs - one.mean[taken.rows]
        pulled = own.T @ inverse
        inner = np.eye(factor.shape[1]) + pulled @ own
        moved = np.linalg.solve(inner, pulled @ residual)
        square = residual @ inverse @ residual - (pulled @ residual) @ moved
        logs.append(np.log(one.weight) - 0.5 * (square + np.linalg.slogdet(inner)[1]))
        means.append(one.mean + factor @ moved)
        # (1 + G^T R^-1 G)^-1 = L^-T L^-1 of the lower L of what is inverted.
        factors.append(principal(np.linalg.solve(np.linalg.cholesky(inner), factor.T).T))
        deviation = np.sqrt(np.diag(scatter) + (own**2).sum(axis=1))
        off.append(np.abs(residual) / deviation)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    forecasts = tuple(
        Forecast(one.name, float(weight), mean, factor)
        for one, weight, mean, factor in zip(tables.forecasts, weights, means, factors, strict=True)
    )
    least = np.min(off, axis=0)
    return forecasts, [(int(k), float(least[k])) for k in np.flatnonzero(least > DOUBTFUL)]


def _next(tables: Tables, forecasts: tuple[Forecast, ...], taken: Taken) -> tuple[int | None, str]:
    """The visit that lowers the bound on a mistake most per minute, from where the machine stands now; what for."""
    visits = tables.visits
    if not len(taken.rows):
        forecasts = tuple(
            replace(one, factor=principal(np.concatenate([one.factor, tables.noise.machine], axis=1)))
            for one in forecasts
        )
    kept = [one for one in forecasts if one.weight >= OUT]
    weights = {one.name: one.weight / sum(other.weight for other in kept) for one in kept}
    own = ReadingNoise(tables.noise.repeat, tables.noise.clamping, np.zeros((len(tables.noise.machine), 0)))
    shares = {(f.name, g.name): pair_shares(visits, f, g, own) for f, g in combinations(kept, 2)}
    been = _been(tables, taken)
    usable = tables.usable & ~been
    if not usable.any():
        return None, ""
    setups, tools = tables.menu.setups, tables.menu.tool_extensions
    if len(taken.rows):
        last = taken.rows[-1]
        now, tool = str(visits.readings.setup[last]), float(visits.readings.tool_extension[last])
        setups = (now, *(name for name in setups if name != now))
        tools = (tool, *(one for one in tools if one != tool))
    menu = Menu(setups=setups, tool_extensions=tools, waits=tables.menu.waits)
    chosen = choose(visits, usable, shares, weights, 1, tables.costs, menu)
    return (chosen[0], why_of(visits, chosen[0], shares, menu)) if chosen else (None, "")


def _been(tables: Tables, taken: Taken) -> NDArray[np.bool_]:
    """(v,) visits to poses of readings taken, with the same tool and set-up and the same second indicator."""
    visits, readings = tables.visits, tables.visits.readings
    found = np.zeros(len(visits), dtype=bool)
    loops = np.full(len(visits), "") if visits.loop is None else visits.loop
    for clamp in np.unique(taken.clamp):
        rows = taken.rows[taken.clamp == clamp]
        across = next((str(name) for name in readings.loop[rows] if name), "")
        pose = np.concatenate([readings.position[rows[0]], readings.angles[rows[0]]])
        found |= (
            (np.abs(visits.pose - pose) < 1e-6).all(axis=1)
            & (visits.extension == readings.tool_extension[rows[0]])
            & (visits.setup == readings.setup[rows[0]])
            & np.isin(loops, ["", across])
        )
    return found


def _taken(tables: Tables, files: tuple[str, ...], columns: Mapped) -> tuple[Taken, list[str]]:
    """The readings of measurement files that are the plan's, in their order; how many are not."""
    readings = tables.visits.readings
    known: dict[tuple[Any, ...], int] = {}
    for k in range(len(readings)):
        known.setdefault(
            _key(
                readings.position[k], readings.angles[k], readings.direction[k], float(readings.force[k]),
                float(readings.tool_extension[k]), str(readings.setup[k]), str(readings.loop[k]),
            ),
            k,
        )  # fmt: skip
    rows, logs, clamps, where, others = [], [], [], [], 0
    for table in [mapped_table(name, "measurements", COLUMNS, columns) for name in files]:
        for row in read_rows(table, planned=True).rows:
            own = known.get(_of_row(row, tables.menu.setups[0]))
            value = np.nan if own is None else _log(row, float(tables.offset[own]), float(tables.toward[own]))
            if own is None:
                others += 1
            elif np.isfinite(value):
                rows.append(own)
                logs.append(value)
                clamps.append(f"{table.file} {row.labels['clamp'] or row.position}")
                where.append(f"{table.file}:{row.line}")
    notes = [f"{others} readings are not of this plan and are passed over"] if others else []
    return Taken(np.array(rows, dtype=np.int64), np.array(logs), np.array(clamps, dtype=str), tuple(where)), notes


def _of_row(row: Row, setup: str) -> tuple[Any, ...]:
    extension = 0.0 if np.isnan(row.tool_extension) else row.tool_extension
    return _key(
        row.position, row.angles, row.direction, row.force, extension, row.labels["setup"] or setup, row.labels["loop"]
    )


def _key(
    position: Any, angles: Any, direction: Any, force: float, tool: float, setup: str, loop: str
) -> tuple[Any, ...]:
    """What makes two readings the same of a plan, to a micrometre and a microradian."""
    numbers = [*position, *angles, *direction, force * 1e-3, tool]
    return (*(round(float(value), 6) + 0.0 for value in numbers), setup, loop)


def _log(row: Row, offset: float, toward: float) -> float:
    """Ln k of a row as the plan compares it; nan where it has not been taken."""
    if row.of_tip:
        return float(np.log(row.stiffness))
    joined = offset + toward * row.compliance
    return float(-np.log(joined)) if joined > 0.0 else float("nan")
