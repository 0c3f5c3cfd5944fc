"""A cut along a program: engagement, forces, deflections, and the resulting surface error."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray, product
from toolpath_stiff.cutting.coefficients import Coefficients
from toolpath_stiff.cutting.cutters import Cutter, of_tools
from toolpath_stiff.cutting.engagement import engage
from toolpath_stiff.cutting.final_surface import final_strip, walls_of_passes
from toolpath_stiff.cutting.forces import mean_force, peak_force
from toolpath_stiff.cutting.passes import walls_of_all_passes
from toolpath_stiff.cutting.patches import Contact, Patches, of_stations
from toolpath_stiff.cutting.setup import CutSetup, cutters_of, spindle_of, stock_of
from toolpath_stiff.cutting.stations import samples_seen
from toolpath_stiff.cutting.surface_error import HEIGHTS, floor_error, shares, wall_error
from toolpath_stiff.cutting.tilts import TURNING
from toolpath_stiff.cutting.tip import machine_deviation, station_axes, tip_compliances, with_tools
from toolpath_stiff.cutting.workpiece import Workpiece, stages_of
from toolpath_stiff.errors import InputError, ProgramError
from toolpath_stiff.nc.courses import move_lengths
from toolpath_stiff.nc.moves import Moves, ReadProgram
from toolpath_stiff.path.sampling import Samples, lines_named, sample_moves
from toolpath_stiff.poses import Pose
from toolpath_stiff.results import Progress
from toolpath_stiff.rotations import along_tool_axis
from toolpath_stiff.stiffness.model import StiffnessModel
from toolpath_stiff.units import per_min_from_rad_per_s

BLOCK = 16_384  # stations at a time
KEPT = np.float32  # precision of results
THIN = 0.1  # of the width of cut: a larger error changes the engagement
OTHER = 0.1  # of a wall's error: if the pass itself makes less, most comes from an earlier pass
ROUNDED = 1e-12  # of a cosine
# Results shared by samples with the same contact.
SHARED = ("ap", "ae", "entry", "exit", "mean_force", "peak_force", "deflection", "wall_force", "errors", "lowest",
          "highest", "deviation", "wall_profiles")  # fmt: skip
SAME_WALL = 1e-6  # m, ranges of height closer than this are one


@dataclass(frozen=True, repr=False, eq=False)
class Cut:
    """The cut at n samples of a program, and the error of the surface it leaves. SI.

    Vectors are in the station's frame: x along the horizontal feed, y to its left, z up; forces act on the tool. Errors
    count out of the part: + material is left, - it is cut too deep. nan: there is no such thing at that sample. Results
    are in single precision: a million lines have two million samples.

    Attributes
    ----------
    samples
        In the set-up frame, row for row those of the analysis.
    cutters, work, coefficients
        By tool number; the stock and what is taken from it, set-up frame; of the cutting force.
    feed_per_tooth
        (n,) m.
    ap, ae, entry, exit, removed
        (n,) m, m, rad, rad, m3: depth along the tool, width across the feed, first and last angle in the stock (0 left,
        90 degrees ahead), volume removed since the sample before.
    mean_force, peak_force
        (n, 3) N of a turn.
    deflection
        (n, 3) m of tip and tool under the mean force.
    wall_heights
        (n, 2, 2) m above the tip: of the left and right wall that stays, lowest and highest point.
    wall_force
        (n, 2, 3) N, force when the left and right wall is made, mean over its height: the one behind its mean error.
    errors, lowest, highest
        (n, 3) m, error of left wall, right wall, and the floor or a ball's contact: mean over it, extremes.
    deviation
        (n, 3) m, standard deviation of `errors`, from the coefficients and the machine.
    wall_profiles
        (n, 2, HEIGHTS) m, errors of the left and right wall from its lower to its upper end, at `surface_error.shares`.
    assumptions, warnings
        Sentences.
    """

    samples: Samples
    cutters: Mapping[int, Cutter]
    work: Workpiece
    coefficients: Coefficients
    feed_per_tooth: FloatArray
    ap: FloatArray
    ae: FloatArray
    entry: FloatArray
    exit: FloatArray
    removed: FloatArray
    mean_force: FloatArray
    peak_force: FloatArray
    deflection: FloatArray
    wall_heights: FloatArray
    wall_force: FloatArray
    errors: FloatArray
    lowest: FloatArray
    highest: FloatArray
    deviation: FloatArray
    wall_profiles: AnyArray
    assumptions: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def wall_mean(self) -> FloatArray:
        """(n, 2) m, error of the left and right wall, mean over the height."""
        return self.errors[:, :2]

    @property
    def turning(self) -> BoolArray:
        """(n,) True where a tool cuts while it changes its orientation: no surface error is predicted there."""
        return np.asarray(self.samples.cutting & (self.work.tilts[self.samples.move] == TURNING))

    @property
    def machine_only(self) -> bool:
        """True if the compliance of a tool itself is unknown, so that the errors are too small."""
        return any(np.isnan(cutter.lateral_compliance) for cutter in self.cutters.values())

    def lines_warning(self, rows: BoolArray, words: str) -> list[str]:
        """A sentence that names the lines of the chosen samples (n,) and the problem; [] without samples."""
        return [f"{lines_named(self.samples.line[rows])}: {words}"] if rows.any() else []


def evaluate_cut(
    model: StiffnessModel,
    program: ReadProgram,
    origin: Pose,
    setup: CutSetup,
    step: float,
    progress: Progress | None = None,
    sampled: Samples | None = None,
) -> Cut:
    """The cut of a program whose zero sits at `origin` (m, rad), with samples at most `step` (m) apart.

    Parameters
    ----------
    model
        The machine with its effects, under its conditions; those that depend on the load take the force that acts.
    program
        As it was read; cuts whose tool turns on the way are left out, with a warning.
    progress
        Called with what is being done, samples done, samples in all.
    sampled
        The same samples on the machine, whose columns are then held once.

    Raises
    ------
    InputError
        Something is missing (which, and where to write it), the tool turns in every cut, or joints leave a choice.
    """
    if len(model.machine.configurations) > 1:
        mistake = f"a cut on machine {model.machine.name}, which reaches poses in several configurations"
        raise InputError(mistake, expected="`tps analyze --cut`, which keeps one, or a machine of one configuration")
    orient = model.machine.angles_of if program.native else np.asarray
    cutters, samples = cutters_of(setup, program), sample_moves(program.moves, step, angles_of=orient)
    if sampled is not None:
        samples = replace(sampled, **{name: getattr(samples, name) for name in ("position", "abc", "tangent")})
    spindle = spindle_of(setup, program, samples)
    feed_per_tooth = _feed_per_tooth(samples, cutters, spindle)
    samples = _along_teeth(samples, program.moves, feed_per_tooth)
    stock = stock_of(setup, program, cutters)
    try:
        engaged = engage(stages_of(stock, program.moves, cutters, orient), program.moves, samples, cutters, progress)
    except ProgramError as error:  # this error knows no file
        raise error.in_line(program.name, error.line or 0) from None
    work = engaged.work
    tilt, seen = samples_seen(work, samples)
    walls, own = walls_of_passes(work, tilt, seen, cutters)
    # Samples that share a contact are computed once, unless their walls differ.
    source = engaged.source.copy()
    apart = ~np.isclose(walls, walls[source], rtol=0.0, atol=SAME_WALL, equal_nan=True).all(axis=(1, 2))
    source[apart] = np.flatnonzero(apart)
    rows = np.unique(source)
    strips = final_strip(work, tilt, seen, cutters, np.isin(np.arange(len(samples)), rows))
    patches = of_stations(engaged.patches, engaged.source[rows])
    patches = replace(patches, station=rows[patches.station])
    cut = _nothing_cut(samples, cutters, work, setup.coefficients, feed_per_tooth)
    cut, struck = replace(cut, removed=engaged.removed, wall_heights=walls), engaged.struck
    del engaged
    made = np.isfinite(np.concatenate([walls[..., 0], strips[:, :1]], axis=1))
    for values in (cut.errors, cut.lowest, cut.highest, cut.deviation):
        values[made] = 0.0  # a pass that takes nothing off: no force, no error of its own
    cut.wall_profiles[made[:, :2]] = 0.0
    _note_engagement(cut, patches)
    cutting = np.unique(patches.station)
    level = np.hypot(seen.tangent[:, 0], seen.tangent[:, 1])
    feed = cut.feed_per_tooth[:, None] * np.stack([level, seen.tangent[:, 2]], axis=1)
    for number, cutter in cutters.items():
        contact = Contact(patches, cutter, setup.coefficients, feed, np.sign(spindle))
        those = cutting[samples.tool[cutting] == number]
        for rows in (those[start : start + BLOCK] for start in range(0, len(those), BLOCK)):
            _evaluate(cut, model, origin, contact.of(rows), strips, rows)
    del patches, contact, strips, feed, level
    for some in (slice(start, start + BLOCK) for start in range(0, len(source), BLOCK)):
        for name in SHARED:
            values = getattr(cut, name)
            values[some] = values[source[some]]
    cut = _with_walls_of_all_passes(cut, seen, tilt, own, step)
    warnings = _warnings(cut, struck)
    return replace(cut, assumptions=_assumptions(cut, model, setup), warnings=warnings)


def _feed_per_tooth(samples: Samples, cutters: Mapping[int, Cutter], spindle: FloatArray) -> FloatArray:
    """(n,) m; nan where the spindle is stopped or nothing cuts."""
    teeth = of_tools(cutters, samples.tool, "flutes", 1.0)
    per_second = np.where(samples.cutting & (np.abs(spindle) > 0.0), teeth * np.abs(spindle) / (2.0 * np.pi), np.nan)
    return np.asarray(samples.feed / per_second)


def _along_teeth(samples: Samples, moves: Moves, feed: FloatArray) -> Samples:
    """Samples with the feed direction taken over one tooth's feed if moves are shorter: rounding turns short chords."""
    rows = np.flatnonzero(samples.cutting & (move_lengths(moves)[samples.move] < feed))
    ends = (samples.s[rows] + side * feed[rows] for side in (0.5, -0.5))
    after, before = ([np.interp(path, samples.s, axis) for axis in samples.position.T] for path in ends)
    along = np.subtract(after, before).T
    length, tangent = np.linalg.norm(along, axis=1, keepdims=True), samples.tangent.copy()
    tangent[rows] = np.divide(along, length, out=tangent[rows], where=length > 0.0)
    return replace(samples, tangent=tangent)


def _nothing_cut(
    samples: Samples, cutters: Mapping[int, Cutter], work: Workpiece, coefficients: Coefficients, feed: FloatArray
) -> Cut:
    """A cut without results, to be filled in."""

    def column(value: float, *shape: int) -> AnyArray:
        return np.full((len(samples), *shape), value, KEPT)

    return Cut(
        samples=samples,
        cutters=cutters,
        work=work,
        coefficients=coefficients,
        feed_per_tooth=feed,
        **{name: column(0.0) for name in ("ap", "ae", "entry", "exit", "removed")},
        **{name: column(0.0, 3) for name in ("mean_force", "peak_force", "deflection")},
        wall_heights=column(np.nan, 2, 2),
        wall_force=column(np.nan, 2, 3),
        **{name: column(np.nan, 3) for name in ("errors", "lowest", "highest", "deviation")},
        wall_profiles=column(np.nan, 2, HEIGHTS),
        assumptions=(),
        warnings=(),
    )


def _note_engagement(cut: Cut, patches: Patches) -> None:
    """Enter depth, width and angles of engagement from all patches of each station."""
    if not len(patches.station):
        return
    first = np.flatnonzero(np.diff(patches.station, prepend=-1))
    rows = patches.station[first]
    low, high = np.minimum.reduceat(patches.low, first), np.maximum.reduceat(patches.high, first)
    cut.ap[rows] = high - low
    cut.entry[rows] = np.minimum.reduceat(patches.entry, first)
    cut.exit[rows] = np.maximum.reduceat(patches.exit, first)
    ahead = np.minimum(patches.entry, np.pi), np.minimum(patches.exit, np.pi)
    left, right = (np.cos(angle) for angle in ahead)
    widths = np.maximum.reduceat(left, first) - np.minimum.reduceat(right, first)
    cut.ae[rows] = of_tools(cut.cutters, cut.samples.tool[rows], "radius") * widths


def _evaluate(
    cut: Cut,
    model: StiffnessModel,
    origin: Pose,
    contact: Contact,
    strips: FloatArray,
    rows: IntArray,
) -> None:
    """Enter forces, deflections and errors of samples `rows` (m,) with their contact; `strips` (n, 2): of floor."""
    samples = cut.samples.take(rows)
    mean = mean_force(contact)
    cut.mean_force[rows], cut.peak_force[rows] = mean, peak_force(contact)
    axes = station_axes(samples, origin)
    machine = tip_compliances(model, samples, origin, axes, mean)
    whole = with_tools(machine, samples, cut.cutters)
    cut.deflection[rows] = product(whole, mean[:, :, None])[..., 0]
    walls, of_walls, cut.wall_force[rows] = wall_error(contact, whole, cut.wall_heights[rows])
    floors, of_floors = floor_error(contact, whole, strips[rows])
    cut.wall_profiles[rows] = walls
    _enter(cut, rows, slice(0, 2), walls @ shares()[1], walls)
    _enter(cut, rows, slice(2, 3), floors.mean(axis=1)[:, None], floors[:, None])
    # Deviation of the machine as a share of the compliance along the normal.
    compliance = whole[:, (1, 1, 2), (1, 1, 2)]
    share = machine_deviation(model, samples, origin, axes, mean, machine)[:, (0, 0, 1)] / compliance
    of_coefficients = np.concatenate([of_walls, of_floors[:, None]], axis=1)
    cut.deviation[rows] = np.hypot(of_coefficients, share * cut.errors[rows])


def _with_walls_of_all_passes(cut: Cut, seen: Samples, tilt: IntArray, own: FloatArray, step: float) -> Cut:
    """The cut with each wall at the pass that owns it; samples in frames of tilts (n,); `own` as `Cut.wall_heights`."""
    walls_of_all_passes(seen, tilt, cut.cutters, cut.wall_heights, own, cut.wall_profiles, step)
    before, deviation = np.abs(cut.wall_mean), cut.deviation[:, :2].copy()
    share = deviation / np.where(before > 0.0, before, np.nan)  # the coefficients scatter all errors alike
    usual = float(np.median(share[np.isfinite(share)])) if np.isfinite(share).any() else 0.0
    for start in range(0, len(own), BLOCK):
        rows = np.arange(start, min(start + BLOCK, len(own)))
        _enter(cut, rows, slice(0, 2), cut.wall_profiles[rows] @ shares()[1], cut.wall_profiles[rows])
    after = np.abs(cut.wall_mean)
    cut.deviation[:, :2] = after * np.where(before > OTHER * after, share, usual)
    return replace(cut, wall_heights=own.astype(KEPT))


def _enter(cut: Cut, rows: IntArray, surfaces: slice, mean: FloatArray, values: FloatArray) -> None:
    """Enter mean (m, k) and extremes over the last axis of values (m, k, h)."""
    cut.errors[rows, surfaces] = mean
    cut.lowest[rows, surfaces], cut.highest[rows, surfaces] = values.min(axis=-1), values.max(axis=-1)


def _assumptions(cut: Cut, model: StiffnessModel, setup: CutSetup) -> tuple[str, ...]:
    """All assumptions made, one sentence each."""
    sentences = [
        f"stock: {cut.work.stock.origin}",
        f"coefficients of {cut.coefficients.material}: {cut.coefficients.origin}",
    ]
    sentences += [sentence for cutter in cut.cutters.values() for sentence in cutter.origin]
    sentences += [
        "errors of the surface are quasi-static deflections of tip and tool: no vibration, no wear, no heat; they "
        "do not reduce the chip thickness",
        "a spring pass is computed on the part as programmed, without the error of the pass before: where it removes "
        "nothing, its error is 0",
    ]
    if model.load_dependent:
        sentences.append("effects that depend on the load act as under the mean force of a turn")
    if not math.isnan(setup.spindle):
        speed = abs(per_min_from_rad_per_s(setup.spindle))
        sentences.append(f"where the program names no speed the spindle turns at {speed:g} 1/min ({setup.file})")
    return tuple(sentences)


def _warnings(cut: Cut, struck: BoolArray) -> tuple[str, ...]:
    """Warnings for the user, one sentence each."""
    samples, warnings = cut.samples, []
    if cut.machine_only:
        numbers = [f"T{number}" for number, cutter in cut.cutters.items() if np.isnan(cutter.lateral_compliance)]
        warnings.append(
            f"machine only: the compliance of {', '.join(numbers)} is not known, and a slim tool is softer than "
            "the machine (stick_out_mm in [[tool]] of cut.toml)"
        )
    engaged = cut.ap > 0.0
    if not cut.removed.any():
        warnings.append("no cut meets the stock: corner_mm in [stock] and the program's zero say where both are")
    along = np.abs(along_tool_axis(samples.tangent, samples.abc))
    plunges = (cut.removed > 0.0) & (along >= np.cos(defaults.PLUNGE_ANGLE) - ROUNDED)
    on_the_spot = cut.turning & ~samples.tangent.any(axis=1)
    large = (np.abs(np.nan_to_num(cut.wall_mean)).max(axis=1) > THIN * cut.ae) & (cut.ae > 0.0)
    for rows, words in (
        (large, f"walls off by over {THIN:g} of the width of cut, predicted too large: the chip stays as thick"),
        (struck, "rapids run into material, which counts as still there afterwards"),
        (plunges, "plunges: cutting with the end of the tool is not modelled, the force there is unknown"),
        (cut.turning & ~on_the_spot, "the tool turns along the move: no error of the surface is predicted there"),
        (on_the_spot, "the tool turns on the spot: it removes what it meets, the force there is unknown"),
    ):  # fmt: skip
        warnings += cut.lines_warning(rows, words)
    chip = np.where(engaged, cut.feed_per_tooth, np.nan)
    thin, thick = cut.coefficients.thinnest, cut.coefficients.thickest
    for beyond, words in ((chip < thin, "thinner"), (chip > thick, "thicker")):
        named = f"feeds per tooth {words} than those of the coefficients: extrapolated"
        warnings += cut.lines_warning(beyond, named)
    return tuple(warnings)
