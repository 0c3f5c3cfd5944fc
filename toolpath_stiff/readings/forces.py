"""Coefficients of the cutting force from dynamometer records, their uncertainty, and what the records leave open."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from toolpath_stiff.arrays import BoolArray, FloatArray, product
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.cutting.coefficients import SHOWN, SYMBOLS, Coefficients
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.forces import force_at
from toolpath_stiff.cutting.identification import SURE, least_squares, left_out, slot, slot_responses
from toolpath_stiff.cutting.patches import TURN
from toolpath_stiff.documents import Document, json_number, records, without_nan
from toolpath_stiff.errors import InputError, MeasurementError
from toolpath_stiff.readings.force_records import ComplexArray, harmonics, mean_force, read_records
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.units import mm_from_m, um_from_m

AXES = ("x", "y", "z")
FEW = 5  # feeds below which a straight line is hardly tested
PROBE, NONE = 1e-6, 1e-9  # m, run-out tried first; run-out that counts as none
BINS, ROUNDS = 720, 4  # angles of a turn; rounds until fit and run-out settle


@dataclass(frozen=True, repr=False, eq=False)
class CoefficientFit(FolderResult):
    """Coefficients of the cutting force, fitted to the mean forces of n slots.

    Attributes
    ----------
    coefficients
        With their covariance.
    determined
        (6,) those that the records tell.
    cutter
        That cut the slots, with the run-out that they tell.
    records
        (n,) names.
    feed, depth
        (n,) m per tooth, m.
    force, fitted, left_out
        (n, 3) N on the tool along the feed, to its left, up: measured mean, fitted, and measured less what the slots
        of all other feeds predict; nan where not recorded or not to be had.
    run_out
        (n,) m, as what comes back once a turn tells; nan of a single flute and of mean forces, which show none.
    notes
        What was assumed, and read differently.
    inputs
        Files that were read.
    """

    command: ClassVar[str] = "forces"
    shown_by: ClassVar[str] = "forces"

    coefficients: Coefficients
    determined: BoolArray
    cutter: Cutter
    records: tuple[str, ...]
    feed: FloatArray
    depth: FloatArray
    force: FloatArray
    fitted: FloatArray
    left_out: FloatArray
    run_out: FloatArray
    notes: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()

    @property
    def reach(self) -> float:
        """Half width of a 95 % interval in standard deviations: Student's t."""
        from scipy.special import stdtrit

        return float(stdtrit(len(self.feed) - 2, SURE))

    @property
    def silent(self) -> list[str]:
        """Sentences on what the records cannot tell."""
        low, high = (um_from_m(float(value)) for value in (self.feed.min(), self.feed.max()))
        sentences = [
            f"other feeds per tooth than {low:.4g} to {high:.4g} um: thinner chips, as in finishing, are extrapolated"
        ]
        unknown = [symbol for symbol, known in zip(SYMBOLS, self.determined, strict=True) if not known]
        if unknown:
            sentences.append(f"{', '.join(unknown)}: no such force was recorded; 0 with a wide deviation is assumed")
        feeds = len(np.unique(self.feed))
        if feeds < FEW:
            sentences.append(f"whether forces rise straight with the feed: {feeds} feeds hardly test it, {FEW} would")
        if len(np.unique(self.depth)) == 1:
            sentences.append("whether forces rise with the depth of cut: all slots are equally deep")
        if np.isnan(self.run_out).all():
            sentences.append("run-out: mean forces and a single flute show none")
        elif self.cutter.flutes == 2:
            sentences.append("run-out square to the two flutes: theirs differ only by its part along them")
        return sentences

    def to_dict(self) -> Document:
        """Coefficients in the form of a setup file, with intervals; one entry per record; what is not determined."""
        columns, values = self.columns(), self.coefficients.values * SHOWN
        deviation = self.coefficients.deviation * SHOWN * self.reach
        document = {
            "coefficients": self.coefficients.document(),
            "interval_95_percent": {
                symbol: [json_number(value - half), json_number(value + half)]
                for symbol, value, half in zip(SYMBOLS, values.tolist(), deviation.tolist(), strict=True)
            },
            "run_out_um": [json_number(value) for value in um_from_m(self.run_out).tolist()],
            "records": records(columns),
            "not_told": self.silent,
            "notes": list(self.notes),
        }
        return dict(without_nan(document))

    def to_frame(self) -> DataFrame:
        """One row per record, with the columns of `columns`."""
        return frame_of(self.columns())

    def columns(self) -> dict[str, list[object]]:
        """One row per record: feed, depth, force measured, fitted, and less the prediction from other feeds."""
        columns: dict[str, list[object]] = {
            "record": list(self.records),
            "feed_per_tooth_um": um_from_m(self.feed).round(6).tolist(),
            "depth_mm": mm_from_m(self.depth).round(6).tolist(),
        }
        for name, forces in (("measured", self.force), ("fitted", self.fitted), ("left_out", self.left_out)):
            for axis, column in zip(AXES, forces.T, strict=True):
                columns[f"f{axis}_{name}_N"] = column.round(6).tolist()
        columns["run_out_um"] = um_from_m(self.run_out).round(3).tolist()
        return columns

    def _short(self) -> str:
        return f"{len(self.records)} slots, Ktc {self.coefficients.values[0] * SHOWN[0]:.0f} N/mm2"


def fit_coefficients(
    files: Sequence[str], cutter: Cutter, columns: Mapped = None, axes: str = "x,y,z", material: str = ""
) -> CoefficientFit:
    """Coefficients from records of slots.

    Parameters
    ----------
    files
        Of records.
    cutter
        That cut them.
    columns
        Columns that the files name differently.
    axes
        Directions of the dynamometer's axes: those that point along the feed, to its left and up.
    material
        Its name, for the result.

    Raises
    ------
    InputError
        A file cannot be read, there are too few feeds, or the signs of the axes cannot be right.
    """
    turned = _rotation(axes)
    records, settings, forces, waves = [], [], [], []
    noted: dict[str, list[str]] = {}  # remark -> records
    for file in files:
        for name, setting, signal, how in read_records(file, columns, cutter.flutes):
            mean, wave, remarks = mean_force(name, signal, setting[2], cutter, setting[0], turned[1][0])
            # A dynamometer reads the force on the work.
            forces.append([-sign * mean[axis] for axis, sign in turned])
            waves.append(-turned[1][1] * wave)
            settings.append(setting)
            records.append(name)
            for remark in (*remarks, *how):
                noted.setdefault(remark, []).append(name)
    feed, depth, _ = np.array(settings).reshape(-1, 3).T
    if (count := len(np.unique(feed))) < 3:
        fault = f"slots at {count} feed{'s' * (count != 1)}"
        raise MeasurementError(fault, expected="3 or more, so that a straight line can be wrong; 5 are better")
    force, told = np.array(forces), cutter.flutes > 1 and bool(np.isfinite(waves).all())
    run_out, angle = np.full(len(feed), np.nan), np.zeros(len(feed))
    for _ in range(ROUNDS):  # with run-out some teeth cut less, which bends the lines a little
        response = slot_responses(cutter, feed, depth, angle)
        values, covariance, determined = least_squares(response, force)
        if told and values[0] > 0.0:
            known = Coefficients(values[:3], values[3:], covariance)
            slots = zip(waves, feed, depth, strict=True)
            run_out, angle = np.array([_run_out(*slot, cutter, known) for slot in slots]).T
            cutter = replace(cutter, run_out=float(np.median(run_out)), run_out_angle=float(angle[0]))
    _check_signs(values, covariance, axes)
    coefficients = Coefficients(
        values[:3],
        values[3:],
        covariance,
        material,
        f"fitted to {len(feed)} slots ({', '.join(dict.fromkeys(files))})",
        float(feed.min()),
        float(feed.max()),
    )
    fitted = np.where(np.isnan(force), np.nan, product(response, values[:, None])[..., 0])
    off = left_out(response, force, feed)
    notes = [f"{', '.join(names)}: {remark}" for remark, names in noted.items()]
    if values[2] + 2.0 * np.sqrt(covariance[2, 2]) < 0.0:
        notes.append(
            f"Kac is less than 0 with axes {axes}: chips would push this cutter out of the work, against its helix; "
            "does the third axis point down? Then say it with the other sign"
        )
    columns_of_slots = (tuple(records), feed, depth, force, fitted, off, run_out)
    return CoefficientFit(coefficients, determined, cutter, *columns_of_slots, tuple(notes), tuple(files))


def _rotation(axes: str) -> list[tuple[int, float]]:
    """Column and sign of the forces along the feed, to its left, up. Raises `InputError`."""
    words = [word.strip() for word in axes.split(",")]
    names = [word.lstrip("+-") for word in words]
    if sorted(names) != sorted(AXES):
        raise InputError(f"--axes {axes}", expected="the axes along the feed, to its left and up, as x,y,z or -y,x,z")
    return [(AXES.index(name), -1.0 if word.startswith("-") else 1.0) for word, name in zip(words, names, strict=True)]


def _check_signs(values: FloatArray, covariance: FloatArray, axes: str) -> None:
    """Raise `MeasurementError` if the coefficients imply that an axis points the other way."""
    surely = values + 2.0 * np.sqrt(np.diagonal(covariance)) <= 0.0
    for symbol, axis, wrong in (("Ktc", "to the left", values[0] <= 0.0), ("Krc", "along the feed", surely[1])):
        if wrong:
            raise MeasurementError(
                f"{symbol} = {values[SYMBOLS.index(symbol)] * SHOWN[0]:.0f} N/mm2 with axes {axes}",
                expected="more than 0: a tooth is pushed back",
                hint=f"the axis {axis} points the other way, or two are exchanged: say --axes, as --axes=-y,x,z; "
                "of forces on the tool --axes=-x,-y,-z",
            )


def _run_out(
    wave: ComplexArray, feed: float, depth: float, cutter: Cutter, coefficients: Coefficients
) -> tuple[float, float]:
    """Size (m) and angle (rad) of the run-out that explains the force across the feed once a turn (`harmonics`)."""
    turns = (np.arange(BINS) + 0.5) / BINS
    run_out, angle = PROBE, 0.0
    for _ in range(ROUNDS):  # teeth that lose contact make it nonlinear
        tried = replace(cutter, run_out=run_out, run_out_angle=angle)
        force = force_at(slot(tried, feed, depth, coefficients), TURN * turns[None])[0, :, 1]
        once, tooth = wave / harmonics(turns, force, cutter.flutes)
        run_out = min(max(run_out * float(np.abs(once)), NONE), feed)
        # The component once a tooth gives the angle at which the record begins.
        angle += float(np.angle(once) - np.angle(tooth) / cutter.flutes)
    return run_out, angle
