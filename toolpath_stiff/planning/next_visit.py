"""The next pose, at the machine: from a plan's tables and the readings taken so far, without the model.

Readings change what a plan has worked out (`tables`) in closed form, by Bayes' rule: the probabilities of the rivals,
their means, their factors (Gaussian conditioning; Rasmussen and Williams 2006, Gaussian Processes for Machine
Learning, appendix A.2). What a plan has worked out once serves every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, count, takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray, TextArray
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.documents import certain
from toolpath_stiff.files import write_atomically
from toolpath_stiff.planning.choice import choose, why_of
from toolpath_stiff.planning.forecasts import Forecast, principal
from toolpath_stiff.planning.gaps import pair_shares
from toolpath_stiff.planning.outlook import SETTLED, percent
from toolpath_stiff.planning.rows import POSE, PlanRow, plan_csv, plan_rows
from toolpath_stiff.planning.tables import Tables
from toolpath_stiff.planning.visits import Visits
from toolpath_stiff.readings.mapping import mapped_table
from toolpath_stiff.readings.rows import COLUMNS, Row, read_rows
from toolpath_stiff.results import Result

if TYPE_CHECKING:
    import pandas as pd

OUT = 5e-3  # probability below which a rival no longer takes part in the choice
DOUBTFUL = 4.0  # standard deviations by which a reading is off under every rival
WILD_SHARE = 0.1  # of the readings may be that far off; assumed
Key = tuple[float | str, ...]  # what makes two readings the same of a plan, to a micrometre and a microradian


class Taken(NamedTuple):
    """Readings taken: which of the plan's (k,), ln k (k,), label of the clamping (k,), file and line of each."""

    rows: IntArray
    logs: FloatArray
    clamp: TextArray
    where: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class NextVisit(Result):
    """A plan after some readings, and the visit to make next.

    Attributes
    ----------
    folder, tables
        The plan's.
    taken
        Readings so far.
    probability
        Explanation -> probability, the likeliest first; figures as they are written.
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
    probability: dict[str, float]
    visit: int | None
    why: str
    unlike: bool
    notes: tuple[str, ...]

    @property
    def settled(self) -> bool:
        """True where one of them has 95 %."""
        return not self.unlike and max(self.probability.values()) >= SETTLED

    @cached_property
    def rows(self) -> list[PlanRow]:
        """Rows of the next visit, as of plan.csv; none where there is no next visit."""
        if self.visit is None:
            return []
        clamp = len(set(self.taken.clamp.tolist())) + 1
        point = str(self.tables.visits.label[self.visit]) or f"next {clamp}"
        return [{**row, "clamp": clamp, "point": point} for row in plan_rows(self.tables.visits, [self.visit])]

    @property
    def sentences(self) -> list[str]:
        """Sentences on where the plan stands, and what is next."""
        chances = ", ".join(f"{name} {percent(weight)}" for name, weight in self.probability.items())
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
        minutes = None if self.visit is None else float(self.tables.visits.further_minutes(())[self.visit])
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
        return f"{len(self.taken.rows)} readings, {'settled' if self.settled else 'open'}"


def next_visit(
    folder: str | Path, data: Sequence[str | Path] | str | Path = (), *, columns: Mapped = None
) -> NextVisit:
    """The pose of a plan to go to next, after the readings so far.

    Parameters
    ----------
    folder
        Where `plan` has been saved; a plan between explanations, not a first campaign.
    data
        Measurement files with the plan's readings taken so far, rows still empty among them; unless given, the
        folder's own plan.csv and next_1.csv, next_2.csv ... Readings from before the plan are in it already.
    columns
        Which columns the files call otherwise: "stiffness=stiff_mean:N/um", or such a dict.

    Raises
    ------
    InputError, InputErrors
        The folder holds no plan between explanations; a file cannot be read, every bad row.

    Examples
    --------
    >>> import tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = tps.plan(machine="nist", between=("spindle_compliance", "none"), n=2).save(folder, plots=False)
    ...     found = tps.next_visit(folder)
    ...     [file.name for file in found.save()]
    ['next_1.csv']
    >>> found
    <NextVisit: 0 readings, open>
    >>> found.probability, found.settled
    ({'spindle_compliance': 0.5, 'none': 0.5}, False)
    >>> len(found.to_frame()) == len(found.to_dict()["rows"]) == len(found.rows)
    True
    """
    tables = Tables.read(folder)
    files = (data,) if isinstance(data, str | Path) else data
    taken, notes = _taken(tables, tuple(map(str, files)) or own_files(folder), columns)
    forecasts, far = tables.forecasts, list[tuple[int, float]]()
    if len(taken.rows):
        forecasts, far = conditioned(tables, taken)
        notes += [f"{taken.where[k]}: {size:.1f} standard deviations off under every rival" for k, size in far]
    likely = sorted(forecasts, key=lambda rival: -rival.weight)
    probability: dict[str, float] = certain({rival.name: rival.weight for rival in likely})
    unlike = len(far) > max(1.0, WILD_SHARE * len(taken.rows))
    done = unlike or max(probability.values()) >= SETTLED
    visit, why = (None, "") if done else _next(tables, forecasts, taken)
    return NextVisit(folder, tables, taken, probability, visit, why, unlike, tuple(notes))


def own_files(folder: str | Path) -> tuple[str, ...]:
    """A plan's own measurement files: plan.csv, and next_1.csv and so on as far as there are any."""
    further = takewhile(Path.exists, (Path(folder) / f"next_{number}.csv" for number in count(1)))
    return tuple(map(str, (Path(folder) / "plan.csv", *further)))


def conditioned(tables: Tables, taken: Taken) -> tuple[tuple[Forecast, ...], list[tuple[int, float]]]:
    """The rivals' forecasts after readings, weights with them; and readings far off under every rival."""
    same = taken.clamp[:, None] == taken.clamp[None, :]
    scatter = tables.noise.repeat**2 * np.eye(len(taken.rows)) + tables.noise.clamping**2 * same
    inverse = np.linalg.inv(scatter)
    logs, means, factors, off = [], [], [], []
    for rival in tables.forecasts:
        factor = np.concatenate([rival.factor, tables.noise.machine], axis=1)
        measured, residual = factor[taken.rows], taken.logs - rival.mean[taken.rows]
        pulled = measured.T @ inverse
        inner = np.eye(factor.shape[1]) + pulled @ measured
        moved = np.linalg.solve(inner, pulled @ residual)
        square = residual @ inverse @ residual - (pulled @ residual) @ moved
        logs.append(np.log(rival.weight) - 0.5 * (square + np.linalg.slogdet(inner)[1]))
        means.append(rival.mean + factor @ moved)
        # (1 + G^T R^-1 G)^-1 = L^-T L^-1 of the lower L of what is inverted.
        factors.append(principal(np.linalg.solve(np.linalg.cholesky(inner), factor.T).T))
        deviation = np.sqrt(np.diag(scatter) + (measured**2).sum(axis=1))
        off.append(np.abs(residual) / deviation)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    forecasts = tuple(
        Forecast(rival.name, float(weight), mean, factor)
        for rival, weight, mean, factor in zip(tables.forecasts, weights, means, factors, strict=True)
    )
    least = np.min(off, axis=0)
    return forecasts, [(int(k), float(least[k])) for k in np.flatnonzero(least > DOUBTFUL)]


def _next(tables: Tables, forecasts: tuple[Forecast, ...], taken: Taken) -> tuple[int | None, str]:
    """The visit that lowers the bound on a mistake most per minute, from where the machine stands now; what for."""
    visits, noise = tables.visits, tables.noise
    if not len(taken.rows):
        forecasts = tuple(
            replace(each, factor=principal(np.concatenate([each.factor, noise.machine], axis=1))) for each in forecasts
        )
    kept = [forecast for forecast in forecasts if forecast.weight >= OUT]
    total = sum(forecast.weight for forecast in kept)
    weights = {forecast.name: forecast.weight / total for forecast in kept}
    alone = replace(noise, machine=np.zeros((len(noise.machine), 0)))
    shares = {(f.name, g.name): pair_shares(visits, f, g, alone) for f, g in combinations(kept, 2)}
    usable = tables.usable & ~_been(visits, taken)
    if not usable.any():
        return None, ""
    if len(taken.rows):
        last, menu = taken.rows[-1], visits.menu
        setup, tool = str(visits.readings.setup[last]), float(visits.readings.tool_extension[last])
        setups, tools = dict.fromkeys([setup, *menu.setups]), dict.fromkeys([tool, *menu.tool_extensions])
        visits = replace(visits, menu=replace(menu, setups=tuple(setups), tool_extensions=tuple(tools)))
    chosen = choose(visits, usable, shares, weights, 1)
    return (chosen[0], why_of(visits, chosen[0], shares)) if chosen else (None, "")


def _been(visits: Visits, taken: Taken) -> BoolArray:
    """(v,) visits to poses of readings taken, with the same tool and set-up and the same second indicator."""
    readings, been = visits.readings, np.zeros(len(visits), dtype=bool)
    for clamp in np.unique(taken.clamp):
        rows = taken.rows[taken.clamp == clamp]
        across = next((str(name) for name in readings.loop[rows] if name), "")
        pose = np.concatenate([readings.position[rows[0]], readings.angles[rows[0]]])
        been |= (
            (np.abs(visits.pose - pose) < 1e-6).all(axis=1)
            & (visits.extension == readings.tool_extension[rows[0]])
            & (visits.setup == readings.setup[rows[0]])
            & np.isin(visits.loop, ["", across])
        )
    return been


def _taken(tables: Tables, files: tuple[str, ...], columns: Mapped) -> tuple[Taken, list[str]]:
    """The readings of measurement files that are the plan's, in their order; how many are not."""
    readings = tables.visits.readings
    numbers = [readings.position, readings.angles, readings.direction]
    numbers += [column[:, None] for column in (readings.force, readings.tool_extension)]
    names = zip(readings.setup.tolist(), readings.loop.tolist(), strict=True)
    known: dict[Key, int] = {}
    for k, (row, (setup, loop)) in enumerate(zip(np.concatenate(numbers, axis=1).tolist(), names, strict=True)):
        known.setdefault(_key(row, setup, loop), k)
    rows, logs, clamps, where, others = [], [], [], [], 0
    for table in [mapped_table(name, "measurements", COLUMNS, columns) for name in files]:
        for row in read_rows(table, planned=True)[0]:
            tool = 0.0 if np.isnan(row.tool_extension) else row.tool_extension
            setup, loop = row.labels["setup"] or tables.visits.menu.setups[0], row.labels["loop"]
            place = known.get(_key([*row.position, *row.angles, *row.direction, row.force, tool], setup, loop))
            if place is None:
                others += 1
                continue
            value = _log(row, float(tables.offset[place]), float(tables.toward[place]))
            if np.isfinite(value):
                rows.append(place)
                logs.append(value)
                clamps.append(f"{table.file} {row.labels['clamp'] or row.position}")
                where.append(f"{table.file}:{row.line}")
    notes = [f"{others} readings are not of this plan and are passed over"] if others else []
    return Taken(np.array(rows, dtype=np.int64), np.array(logs), np.array(clamps, dtype=str), tuple(where)), notes


def _key(numbers: Sequence[float], setup: str, loop: str) -> Key:
    """The key of position, angles, direction, force and tool; the force to a millinewton."""
    *lengths, force, tool = numbers
    return (*(round(float(value), 6) + 0.0 for value in (*lengths, 1e-3 * force, tool)), setup, loop)


def _log(row: Row, offset: float, toward: float) -> float:
    """Ln k of a row as the plan compares it; nan where it has not been taken."""
    if not row.labels["loop"]:
        return float(np.log(row.value))
    joined = offset + toward * row.value
    return float(-np.log(joined)) if joined > 0.0 else float("nan")
