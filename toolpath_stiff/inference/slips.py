"""Rows that look mistyped: a row, or all rows of one clamping, tested against common slips of writing.

They are named; nothing is changed.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.covariances import Groups, Precision, Rows
from toolpath_stiff.inference.evidence import Fit, Problem, law_prior
from toolpath_stiff.inference.noise import Scatter
from toolpath_stiff.inference.prediction import scaled_law
from toolpath_stiff.readings.measurements import Readings, model_stiffness
from toolpath_stiff.stiffness.model import build_model
from toolpath_stiff.units import m_from_mm, n_per_mm_from_n_per_m, rad_from_deg

AS_WELL = 3.0  # log odds behind the best slip within which another is reported too
SLIPPED = 0.5  # probability that a campaign contains a slip; assumed
CLEAR = float(np.log(1000.0))  # log odds from which the rows are left out of the judgement
FAR_OFF = 16.0  # squared deviation from which a row is examined
MOST_ROWS, MOST_CLAMPS, MOST_SLIPS = 12, 6, 3
NEAR = 3.0  # standard deviations within which the corrected rows must lie, root mean square
# A digit typed wrongly; mm and degrees, assumed. Each further one costs all others a little: more is tried by chance.
STEPS_MM, STEPS_DEG = (10.0,), (1.0, 5.0)
# Unit in which a stiffness may have been written -> written over true; an inch is 25.4 mm, a pound-force 4.448... N.
UNITS = {"lbf/in": 25.4 / 4.4482216152605, "N/um": 1e-3}
TINY = 1e-9
SET_ASIDE = 1e2  # variance of ln k of a row that is left out
AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
MENDED = ("position", "angles", "direction", "stiffness")  # columns of the readings that a slip may change
# Columns, field of the readings, usual slips, SI value of their unit.
POSE_STEPS = (
    (("x_mm", "y_mm", "z_mm"), "position", STEPS_MM, float(m_from_mm(1.0))),
    (("a_deg", "b_deg", "c_deg"), "angles", STEPS_DEG, float(rad_from_deg(1.0))),
)


@dataclass(frozen=True, eq=False)
class Slip:
    """Rows (k,) with one and the same typing slip.

    Attributes
    ----------
    column, stands, meant
        What is wrong: a column, what stands there and what it would be (of the first row).
    mended
        Column of the readings -> (k, 3) or (k,) as it would be, where it is another.
    words, log_odds
        Of a suspect: all that it may be in a sentence, and the odds against the rows being as they should be, or wild.
    """

    rows: Rows
    column: str
    stands: str
    meant: str
    mended: Mapping[str, FloatArray]
    words: str = ""
    log_odds: float = -np.inf

    @property
    def clear(self) -> bool:
        """True if the rows are better left out, provided nothing else is missing."""
        return self.log_odds > CLEAR


@dataclass(frozen=True)
class SuspectEntry:
    """A suspect as a document entry: its rows, counted from 1 in their file, and its lines."""

    file: str
    row: int
    rows: list[int]
    lines: list[int]
    column: str
    stands: str
    would_be: str
    words: str
    left_out: bool


def mended(data: Readings, suspects: Sequence[Slip]) -> Readings:
    """Readings with the likeliest slip of each suspect corrected."""
    columns = {name: getattr(data, name).copy() for name in MENDED}
    for suspect in suspects:
        for name, values in suspect.mended.items():
            columns[name][suspect.rows] = values
    return replace(data, **columns)


def alone(data: Readings, suspects: Sequence[Slip]) -> tuple[Slip, ...]:
    """Suspects whose rows (with other suspects' rows) are the only ones of a tool, a set-up, a loop or a load.

    An effect of that tool, set-up or load would look like their slip, and no other reading says which of the two it is.
    """
    rest = np.ones(len(data), dtype=bool)
    for suspect in suspects:
        rest[suspect.rows] = False
    columns = (data.tool_extension, data.setup, data.loop, data.force)
    return tuple(
        suspect
        for suspect in suspects
        if not all(np.isin(column[suspect.rows], column[rest]).all() for column in columns)
    )


def suspect_entries(suspects: Sequence[Slip], data: Readings, left_out: Sequence[Slip] | None) -> list[SuspectEntry]:
    """Suspects for a document; `left_out`: those left out of the judgement, None if there was none."""
    entries = []
    for slip in suspects:
        words, out = slip.words, left_out is not None and slip in left_out
        if left_out is not None:
            missing = "kept: it may as well be what is missing from the model that stands out there"
            kept = missing if slip.clear else "kept, for it may be chance"
            words += f"; {'left out of the judgement' if out else kept}"
        file, lines = data.file[slip.rows[0]], data.line[slip.rows].tolist()
        rows = [int((data.file[: row + 1] == data.file[row]).sum()) for row in slip.rows]
        entries.append(SuspectEntry(str(file), rows[0], rows, lines, slip.column, slip.stands, slip.meant, words, out))
    return entries


def suspect_rows(problem: Problem, fit: Fit) -> tuple[Slip, ...]:
    """Rows that one typical slip, corrected, brings back into the noise; the clearest first.

    Parameters
    ----------
    problem
        Readings, model and scatter.
    fit
        The best explanation: what else the readings hold.
    """
    suspects: list[Slip] = []
    data = problem.predictor.data
    taken = np.zeros(len(data), dtype=bool)
    tried = len(data) * len(list(_slips_of_row(data, np.array([0]))))  # possible slips of single rows
    for _ in range(MOST_SLIPS):
        slips = list(_slips(data, *_looked_at(problem, fit, taken)))
        if not slips:
            break
        odds = _log_odds(problem, fit, slips, taken) + np.log(SLIPPED / tried)
        together: dict[tuple[int, ...], list[int]] = defaultdict(list)
        for k in np.argsort(-odds, kind="stable").tolist():
            if np.isfinite(odds[k]):
                together[tuple(slips[k].rows.tolist())].append(k)
        # A row may be wrong in any way: all ways count, those that fit about as well are reported.
        totals = {rows: float(np.logaddexp.reduce(odds[ways])) for rows, ways in together.items()}
        rows = max(totals, key=lambda rows: (totals[rows], rows), default=())
        if not rows or totals[rows] <= 0.0:
            break
        first, *others = together[rows]
        ways = [slips[first], *(slips[k] for k in others if odds[k] > odds[first] - AS_WELL)]
        suspects.append(replace(ways[0], words=_words(data, ways), log_odds=totals[rows]))
        taken[list(rows)] = True
    return tuple(suspects)


def _words(data: Readings, ways: Sequence[Slip]) -> str:
    """Sentence on where the rows are and what may be wrong with them."""
    rows = ways[0].rows
    either = " or ".join(f"{way.column} {way.meant} instead of {way.stands}" for way in ways)
    lines = ", ".join(str(line) for line in data.line[rows])
    return f"line {lines} of {data.file[rows[0]]} may be mistyped: {either} would fit all other readings"


def _looked_at(problem: Problem, fit: Fit, taken: BoolArray) -> tuple[list[Rows], list[Rows]]:
    """Single rows that are far off, and clampings whose rows together are; only the furthest."""
    projected, inflated = problem.projected(fit.jacobian), _inflation(fit)
    pulls = projected.times(fit.residual)
    squared = np.where(taken, 0.0, pulls**2 / np.maximum(projected.diagonal, 1e-300)) / inflated
    order = np.argsort(-squared, kind="stable")[:MOST_ROWS]
    clampings = []
    for members in Groups.by(problem.predictor.data.clamp).members():
        if len(members) > 1 and not taken[members].any():
            weighted = np.linalg.lstsq(projected.block(members), pulls[members], rcond=1e-10)[0]
            excess = float(pulls[members] @ weighted) / inflated
            clampings.append(((excess - len(members)) / np.sqrt(2.0 * len(members)), members))
    clampings.sort(key=lambda pair: (-pair[0], int(pair[1][0])))
    rows = [np.array([row]) for row in order.tolist() if squared[row] > FAR_OFF]
    return rows, [members for far, members in clampings[:MOST_CLAMPS] if far > 2.0]


def _inflation(fit: Fit) -> float:
    """Factor by which a fit's residuals exceed noise: if the machine is not understood, rows are not to blame."""
    freedom = max(len(fit.residual) - fit.jacobian.shape[1], 1)
    return float(max(1.0, fit.projected.squares(fit.residual) / freedom))


def _slips(data: Readings, rows: Sequence[Rows], clampings: Sequence[Rows]) -> Iterator[Slip]:
    for row in rows:
        yield from _slips_of_row(data, row)
    for members in clampings:
        yield from _slips_of_pose(data, members)
        # Two readings of one clamping and load with their directions swapped.
        for first, second in combinations(members.tolist(), 2):
            apart = np.abs(data.direction[first] - data.direction[second]).max() > TINY
            if apart and data.force[first] == data.force[second]:
                names, others = [_axis(data.direction[row]) or "oblique" for row in (first, second)], [second, first]
                stand, meant = " and ".join(names), f"{' and '.join(names[::-1])} (exchanged)"
                yield Slip(np.array([first, second]), "direction", stand, meant, {"direction": data.direction[others]})


def _slips_of_row(data: Readings, row: Rows) -> Iterator[Slip]:
    yield from _slips_of_pose(data, row)
    stands = _axis(data.direction[row[0]])
    for name, vector in AXES.items():
        if stands != name:
            yield Slip(row, "direction", stands or "oblique", name, {"direction": np.array([vector])})
    value = float(n_per_mm_from_n_per_m(data.stiffness[row[0]]))
    for unit, factor in UNITS.items():
        meant = f"{value / factor:.6g} (the number stands in {unit})"
        yield Slip(row, "stiffness_N_per_mm", f"{value:.6g}", meant, {"stiffness": data.stiffness[row] / factor})


def _slips_of_pose(data: Readings, rows: Rows) -> Iterator[Slip]:
    """Slips in a coordinate or an angle: wrong sign or a usual offset, the same in all rows."""
    for names, field, steps, si in POSE_STEPS:
        values = getattr(data, field)[rows]
        for k, name in enumerate(names):
            if float(np.ptp(values[:, k])) > TINY:
                continue
            stands = float(values[0, k]) / si
            wrong_sign = [-stands] if abs(stands) > 0.5 * steps[0] and name != "z_mm" else []
            for meant in (*wrong_sign, *(stands + sign * step for step in steps for sign in (-1.0, 1.0))):
                changed = values.copy()
                changed[:, k] = meant * si
                yield Slip(rows, name, f"{round(stands, 6):g}", f"{round(meant, 6):g}", {field: changed})


def _axis(direction: FloatArray) -> str:
    """X, Y or Z if a unit vector lies along that axis, either way; otherwise ""."""
    return next((name for name, v in AXES.items() if abs(abs(float(direction @ np.array(v))) - 1.0) < TINY), "")


def _changes(problem: Problem, fit: Fit, slips: Sequence[Slip]) -> list[FloatArray]:
    """Change of ln(modelled / measured) of a slip's rows when it is corrected; nan where the model has no stiffness."""
    predictor = problem.predictor
    data, rows = predictor.data, np.concatenate([slip.rows for slip in slips])

    def column(name: str) -> FloatArray:
        return np.concatenate([slip.mended.get(name, getattr(data, name)[slip.rows]) for slip in slips])

    position, angles, direction, stiffness = map(column, MENDED)
    taken = replace(data.select(rows), position=position, angles=angles, direction=direction, stiffness=stiffness)
    law = scaled_law(predictor.machine.strut_law, fit.law)
    model = build_model(predictor.machine.with_changes(strut_law=law), predictor.effect_files, fit.effects)
    try:
        logs = np.log(model_stiffness(model, taken))
    except InputError:  # the machine cannot take one of the poses
        logs = np.full(len(rows), np.nan)
    moved = logs - np.log(taken.stiffness) + fit.residual[rows]
    return np.split(moved, np.cumsum([len(slip.rows) for slip in slips])[:-1])


def _log_odds(problem: Problem, fit: Fit, slips: Sequence[Slip], taken: BoolArray) -> FloatArray:
    """(slips,) log likelihood ratio of each slip to its rows as they stand, plain or wild; -inf if impossible."""
    scatter, inflated = problem.scatter, _inflation(fit)
    known: dict[tuple[int, ...], tuple[Precision, FloatArray]] = {}
    odds = np.full(len(slips), -np.inf)
    for k, (slip, change) in enumerate(zip(slips, _changes(problem, fit, slips), strict=True)):
        if not np.isfinite(change).all():
            continue
        wild = tuple(sorted(set(fit.scatter.wild) - set(slip.rows.tolist())))
        if wild not in known:  # residuals of the fit, wild rows widened and taken ones set aside
            rows, gone = np.array(wild, dtype=np.int64), np.flatnonzero(taken)
            wider = scatter.covariance.widened(rows, scatter.widening[rows])
            wider = wider.widened(gone, np.full(len(gone), SET_ASIDE))
            projected = wider.precision.beside(fit.jacobian.T, law_prior(fit.jacobian.shape[1]))
            known[wild] = projected, projected.times(fit.residual)
        projected, pulls = known[wild]
        block, pull = projected.block(slip.rows) / inflated, pulls[slip.rows] / inflated
        left = pull - block @ change
        if float(left @ np.linalg.lstsq(block, left, rcond=1e-10)[0]) <= NEAR**2 * len(change):
            gain = float(change @ pull - 0.5 * change @ block @ change)
            odds[k] = gain - max(0.0, _gain_of_wild(scatter, slip.rows, block, pull))
    return odds


def _gain_of_wild(scatter: Scatter, rows: Rows, block: FloatArray, pull: FloatArray) -> float:
    """Gain in log likelihood by taking those of the rows that are far off to be wild, less their price."""
    far = pull**2 > scatter.beyond * np.diag(block)
    if not far.any():
        return 0.0
    inner, part, widening = block[np.ix_(far, far)], pull[far], scatter.widening[rows[far]]
    gain = part @ np.linalg.solve(np.diag(1.0 / widening) + inner, part)
    volume = np.linalg.slogdet(np.eye(len(part)) + widening[:, None] * inner)[1]
    return float(0.5 * (gain - volume) - len(part) * scatter.price)
