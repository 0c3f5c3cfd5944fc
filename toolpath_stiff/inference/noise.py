"""Scatter of readings for reasons that no model should explain.

The logarithm of a reading carries, beside what the machine does,

    repeat noise      of every reading on its own,
    clamping          common to the readings of one clamping,
    strut spread      six struts are never quite alike: a nuisance with one column per strut,
    joint positions   never quite where the machine file has them: one column per coordinate,
    the rest          frame, table, platform, tool are never quite as the model has them: one column per axis,

the last three the same for all readings of a machine. Now and then a reading is wild. Who takes all of this for
independent scatter finds effects that are not there: in dense data, in every second campaign.

Repeat noise and clamping are estimated from repeats where there are any (restricted maximum likelihood of the
differences between repeats; Patterson and Thompson 1971), else taken from what the file or the user states, else
guessed low and high.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, IntArray
from toolpath_stiff.defaults import CLAMPING, MEAN_OVER_SD, STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.inference.covariances import Covariance, Groups, Precision
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.repeats import (
    OUTLIER_WIDTH,
    OUTLIERS,
    Repeats,
    clampings_of,
    copied,
    from_repeats,
    scatter_apart,
)
from toolpath_stiff.readings.measurements import Readings

# Sd of the rms change of ln stiffness, along each axis, by links that the model takes to be rigid; assumed. Twice as
# much hides a spindle that gives way by 4 % of the tip; with none, sound machines of beams and mounts fail.
REST = 0.003
JOINT_ERROR = 0.5e-3  # m, sd of each coordinate; assumed
# Relative sd of one reading where nothing is known. The paper reports deviations of 44 to 2944 N/mm for readings of
# 30 to 90 kN/mm: 0.1 to 5 %. Its model fits within 10 %.
GUESSES = {"low": 0.02, "high": 0.10}
LARGEST = 0.5  # relative sd that a user may state
# Smallest relative sd of a reading: the paper's best readings, not clamped anew, scatter by 44 N/mm,
# 0.1 %. With less, the last digit of the readings would decide.
LEAST = 1e-3
# Degrees of freedom that a standard deviation is worth: one that is right within 10 % (1 / sqrt(2 x 50)) where a person
# states it, within a third where it is guessed; assumed.
STATED_FREEDOM, GUESSED_FREEDOM = 50.0, 4.0
SHOWS = 3.9  # whitened length that 80 % of campaigns show at 5 % false alarms among some twenty candidates
CONTRADICTED = 3.3  # standard deviations of the logarithm of their ratio from which repeats overrule a stated noise


@dataclass(frozen=True)
class Noise:
    """Scatter of ln readings.

    Attributes
    ----------
    name
        "measured", "stated", or the guesses "low" and "high".
    repeat
        (n,) relative standard deviation of each reading's own scatter.
    clamping
        Relative standard deviation common to the readings of one clamping; root of the mean square where
    clampings
        (n,) they differ; None: they do not.
    strut_spread
        Relative standard deviation of the struts' stiffnesses.
    joint_error
        m, standard deviation of each coordinate of each joint.
    outliers, outlier_width
        Share of wild readings and how many times wider they scatter.
    freedom
        Degrees of freedom behind `repeat`: how far it is to be trusted.
    origin
        Where the figures come from, a sentence.
    remark
        That a stated noise is not what the repeats show; "" where nothing is to be said.
    tip
        (n,) readings of the tip among those of other loops, which are what is told of; None: all.
    rest
        Rms change of ln stiffness by each axis of the links that the model takes for rigid, sd.
    apart
        Whether each axis of a clamping scatters for itself.
    """

    name: str
    repeat: FloatArray
    clamping: float
    strut_spread: float
    joint_error: float
    outliers: float
    outlier_width: float
    freedom: float
    origin: str
    remark: str = ""
    tip: BoolArray | None = None
    rest: float = REST
    clampings: FloatArray | None = None
    apart: bool = False

    @property
    def guess(self) -> str:
        """Kind of guess, "low" or "high"; "" if the noise is not guessed."""
        return self.name if self.name in GUESSES else ""

    @property
    def reading(self) -> FloatArray:
        """(n,) relative standard deviation of one reading, re-clamping included."""
        return np.hypot(self.repeat, self.clamping if self.clampings is None else self.clampings)

    @property
    def floor_percent(self) -> float:
        """Mean error that scatter alone would leave, %."""
        return 100.0 * MEAN_OVER_SD * self.typical

    @property
    def typical_repeat(self) -> float:
        """Root mean square of `repeat`."""
        return float(np.sqrt(np.mean(self._of_tip(self.repeat) ** 2)))

    @property
    def typical(self) -> float:
        """Root mean square of `reading`."""
        return float(np.sqrt(np.mean(self._of_tip(self.reading) ** 2)))

    def _of_tip(self, values: FloatArray) -> FloatArray:
        return values if self.tip is None or not self.tip.any() else values[self.tip]

    def select(self, rows: BoolArray | IntArray) -> Noise:
        """Noise of some of the readings."""
        clampings = None if self.clampings is None else self.clampings[rows]
        tip = None if self.tip is None else self.tip[rows]
        return replace(self, repeat=self.repeat[rows], tip=tip, clampings=clampings)

    def times(self, factor: float) -> Noise:
        """Noise `factor` times as large."""
        clampings = None if self.clampings is None else factor * self.clampings
        return replace(self, repeat=factor * self.repeat, clamping=factor * self.clamping, clampings=clampings)


def noise_models(
    data: Readings,
    stated: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    joint_error: float = JOINT_ERROR,
) -> tuple[Noise, ...]:
    """Noise of the data: one model, or a low and a high guess if nothing is known.

    Parameters
    ----------
    data
        n readings; those of loops beside the tip have a noise of their own, `Readings.sd`.
    stated
        Relative sd of one reading, re-clamping included; or (repeat, clamping). Wins over the data.
    strut_spread, joint_error
        Relative sd of the struts' stiffnesses; m.

    Raises
    ------
    InputError
        A stated noise that cannot be.
    """
    models = _noise_of_tip(data.of_tip, stated, strut_spread, joint_error)
    if data.beside is None:
        return models
    # Loops beside the tip scatter on their own. Each reading is a clamping of its own (`measurements.with_offsets`),
    # whose scatter is counted beside this one.
    relative, with_loops = data.sd / data.stiffness, []
    for noise in models:
        repeat = np.sqrt(np.maximum(relative**2 - noise.clamping**2, LEAST**2))
        repeat[data.tip] = noise.repeat
        clampings = None if noise.clampings is None else np.full(len(data), noise.clamping)
        if clampings is not None:
            clampings[data.tip] = noise.clampings
        with_loops.append(replace(noise, repeat=repeat, tip=data.tip, clampings=clampings))
    return tuple(with_loops)


def _noise_of_tip(
    data: Readings, stated: float | tuple[float, float] | None, strut_spread: float, joint_error: float
) -> tuple[Noise, ...]:
    copies, relative = copied(data), data.sd / data.stiffness
    repeats = None if copies else from_repeats(data)

    def model(
        name: str,
        repeat: float | FloatArray,
        clamping: float | FloatArray,
        freedom: float,
        origin: str,
        remark: str = "",
    ) -> Noise:
        every = np.maximum(np.full(len(data), repeat), LEAST)
        if np.min(repeat) < LEAST:
            origin += f"; at least {100 * LEAST:g} % a reading is counted: no measurement is better"
        wild = OUTLIERS if repeats is None else repeats.wild
        mean = float(np.sqrt(np.mean(np.square(clamping))))
        each = clamping if isinstance(clamping, np.ndarray) else None
        return Noise(
            name, every, mean, strut_spread, joint_error, wild, OUTLIER_WIDTH, freedom, origin, remark, clampings=each
        )

    remark = ""
    if stated is not None:
        both = stated if isinstance(stated, tuple) else _shared(stated)
        if not (0.0 < both[0] <= LARGEST and 0.0 <= both[1] <= LARGEST):
            raise InputError(f"a noise of {stated!r}", expected=f"more than 0 and at most {100 * LARGEST:g} %")
        remark = "" if repeats is None else _disagreement(repeats, *both, "noise stated with --noise")
        if not remark:
            return (model("stated", *both, STATED_FREEDOM, f"stated: {_percent(*both)}"),)
    known = np.isfinite(relative) & (stated is None)  # readings that state their scatter
    total = float(np.sqrt(np.mean(relative[known] ** 2))) if known.any() else np.nan
    if repeats is not None:
        if known.any():
            remark = _disagreement(repeats, *_shared(total), "sd_N_per_mm stated in the file")
        origin = f"estimated from {repeats.differences} differences between repeats: "
        origin += _percent(repeats.repeat, repeats.clamping)
        origin += "" if repeats.clamps else " (clamping assumed: no point was clamped twice)"
        origin += ", each axis of it for itself" if repeats.apart else ""
        repeat, clamping, words = scatter_apart(data, repeats)
        measured = model("measured", repeat, clamping, repeats.freedom, origin + words, remark)
        return (replace(measured, apart=repeats.apart),)
    if known.any():
        repeat, each, origin = _of_stated(np.where(known, relative, total), data, total)
        if not known.all():
            origin += f"; {int((~known).sum())} readings do not state it and are assumed to scatter as the others do"
        return (model("stated", repeat, each, STATED_FREEDOM, origin),)
    why = "the repeats agree exactly, as copies do" if copies else "the data hold neither repeats nor sd_N_per_mm"
    clampings = len(np.unique(data.clamp))
    return tuple(
        model(
            name, *_shared(guess), GUESSED_FREEDOM,
            f"a {name} guess, {_percent(*_shared(guess))}: {why}; were it right, what changes the stiffness by less "
            f"than {100 * _hidden(*_shared(guess), len(data), clampings):.2g} % (rms) could hide under it",
        )
        for name, guess in GUESSES.items()
    )  # fmt: skip


def _of_stated(relative: FloatArray, data: Readings, total: float) -> tuple[FloatArray, float | FloatArray, str]:
    """Repeat noise (n,), clamping ((n,) if it differs) and origin for readings that state their total scatter (n,).

    At most half the variance of a clamping's best reading is clamping, so that it counts once in each of them.
    """
    clamps = Groups.by(data.clamp)
    least = np.full(clamps.count, CLAMPING * np.sqrt(2.0))
    np.minimum.at(least, clamps.of, relative)
    each = least[clamps.of] / np.sqrt(2.0)
    mean = float(np.sqrt(np.mean(each**2)))
    origin = f"sd_N_per_mm of the readings, {100 * total:.2g} % in the mean, of which {100 * mean:.2g} % is "
    origin += "assumed to be clamping: it stands in them and is counted once"
    return np.sqrt(relative**2 - each**2), each if np.ptp(each) > 0.0 else mean, origin


def _hidden(repeat: float, clamping: float, readings: int, clampings: int) -> float:
    """Relative rms change that readings and clampings of this number do not reveal: of whitened length `SHOWS`.

    Of a change that differs from reading to reading; strut law and the struts' and joints' own scatter hide more.
    """
    return float(SHOWS * np.sqrt(repeat**2 / readings + clamping**2 / clampings))


def _disagreement(repeats: Repeats, repeat: float, clamping: float, what: str) -> str:
    """Sentence on repeats that contradict a stated noise; "" if they do not.

    Both are estimates: the stated one to `STATED_FREEDOM`, the repeats' to theirs (sd of a ratio's logarithm).
    """
    total = float(np.hypot(repeat, clamping)) if repeats.clamps else repeat
    ratio = repeats.total / total
    if abs(np.log(ratio)) < CONTRADICTED * np.sqrt(0.5 / STATED_FREEDOM + 0.5 / repeats.freedom):
        return ""
    return (
        f"the {what} is too {'small' if ratio > 1.0 else 'large'}: {100 * total:.2g} %, where {repeats.differences} "
        f"differences between repeats scatter {ratio:.2g} times as much; what the repeats show is used instead"
    )


def _shared(total: float) -> tuple[float, float]:
    """A total relative sd split into repeat noise and clamping."""
    clamping = min(CLAMPING, total / np.sqrt(2.0))
    return float(np.sqrt(max(total**2 - clamping**2, 0.0))), float(clamping)


def _percent(repeat: float, clamping: float) -> str:
    return f"{100 * repeat:.2g} % a reading, {100 * clamping:.2g} % a clamping"


def covariance(noise: Noise, predictor: Predictor) -> Covariance:
    """Covariance of ln readings."""
    shared = [noise.strut_spread * predictor.strut_columns(), noise.joint_error * predictor.joint_columns]
    shared.append(noise.rest * predictor.rest_columns())
    rows = np.ascontiguousarray(np.concatenate(shared, axis=1).T)
    clamps = clampings_of(predictor.data, noise.apart)
    common: float | FloatArray = noise.clamping**2
    if noise.clampings is not None:
        common = clamps.sums(noise.clampings**2) / np.bincount(clamps.of)
    return Covariance(noise.repeat**2, clamps, common, rows)


MOST_WILD = 0.05  # largest share of readings taken to be wild, unless more are expected
OFTEN_WILD = 2.0  # factor on the expected share, if that allows more
NEVER = 1e12  # price of a wild reading where there are none


@dataclass(frozen=True)
class Scatter:
    """Scatter of ln readings, some of which are taken to be wild.

    Attributes
    ----------
    covariance
        With the wild readings' own scatter widened.
    widening
        (n,) variance that a wild reading adds.
    price
        Minus the log odds of a reading being wild.
    wild
        Readings taken for wild.
    beyond
        Squared deviation beyond which a reading's widening pays that price.
    most
        Share of readings that may be taken for wild.
    """

    covariance: Covariance
    widening: FloatArray
    price: float
    wild: tuple[int, ...] = ()
    beyond: float = np.inf
    most: float = MOST_WILD

    @classmethod
    def of(cls, noise: Noise, covariance: Covariance) -> Scatter:
        """Scatter from a noise model and its covariance."""
        wide = noise.outlier_width**2
        price = np.log((1.0 - noise.outliers) / noise.outliers) if noise.outliers > 0.0 else NEVER
        beyond = float((2.0 * price + np.log(wide)) * wide / (wide - 1.0))
        most = max(MOST_WILD, OFTEN_WILD * noise.outliers)
        return cls(covariance, (wide - 1.0) * noise.repeat**2, float(price), (), beyond, most)

    @property
    def precision(self) -> Precision:
        """Inverse covariance."""
        return self.covariance.precision

    @property
    def log_price(self) -> float:
        """Change of a log likelihood by the width of the scatter and by the readings taken to be wild."""
        return -0.5 * self.covariance.log_determinant - len(self.wild) * self.price

    def with_wild(self, residual: FloatArray, known: Scatter | None = None) -> Scatter:
        """Scatter in which readings are taken to be wild where widening pays its price at these residuals (n,).

        Where these are the wild readings of `known`, that is the answer: nothing is worked out again. One by one, the
        most wild first, each beside those before it.
        """
        precision, wild = self.precision, list(self.wild)
        diagonal, pull, taken = precision.diagonal, precision.times(residual), np.zeros(len(residual))
        taken[wild] = -np.inf
        for _ in range(int(self.most * len(residual)) + 1):
            inflated = 1.0 + self.widening * diagonal
            gain = self.widening * pull**2 / inflated - np.log(inflated) - 2.0 * self.price + taken
            row = int(np.argmax(gain))
            if gain[row] <= 0.0:
                break
            precision, column, share = precision.widened(row, float(self.widening[row]))
            pull = pull - column * (share * pull[row])
            diagonal = diagonal - column**2 * share
            wild.append(row)
            taken[row] = -np.inf
        if known is not None and set(known.wild) == set(wild):
            return known
        rows = np.array(wild[len(self.wild) :], dtype=np.int64)
        return replace(self, covariance=self.covariance.widened(rows, self.widening[rows]), wild=tuple(wild))

    def log_likelihood(self, residual: FloatArray) -> FloatArray:
        """(...,) log likelihoods of residuals (..., n), with the price of wild readings, without n ln(2 pi) / 2."""
        return np.asarray(-0.5 * self.precision.squares(residual) + self.log_price)
