"""A placed program: the result of a search, with the same advice for terminal, placement.json, page and sheet."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from toolpath_stiff.analysis.loads import Load
from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document, number, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.placement.goals import Bounds, SearchRules
from toolpath_stiff.placement.surface_error import Errors
from toolpath_stiff.poses import Pose, ShopPose, pose_in_mm, pose_in_si
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.rewriting.offset_blocks import OffsetBlocks, offset_blocks
from toolpath_stiff.stiffness.model import StiffnessModel, effects_stated
from toolpath_stiff.units import mm_from_m

# The three objectives and the keys of their values.
FIGURES = {"mean": "mean_N_per_mm", "range": "range_N_per_mm", "weakest": "min_N_per_mm"}
WORSE = {"mean": "the mean is lower", "range": "the range is wider", "weakest": "the weakest place is softer"}
SEARCH = ("pose_evaluations", "searches", "nothing_better")  # entries of placement.json on the search
VARIED = ("--x", "--y", "--z", "--tilt-a", "--tilt-b", "--rotate")  # options of the columns of a placement
ROUNDING = 1e-9  # of the mean: two evaluations of one placement differ by less than this
AT_BOUND = 1e-3  # share of a bound's span within which the search has ended on the bound


@dataclass(frozen=True)
class PlacementTask:
    """A program to place, with the machine, the bounds and rules, the load. SI.

    Attributes
    ----------
    model, program
        Machine and effects; the program as read where its zero sits now.
    present
        Where that is.
    read
        Reads the program for another zero: moves to machine coordinates depend on it.
    bounds, rules
        What may vary; what a placement must keep and be good at.
    load, step, force
        As `analyze` takes them.
    write
        Name of the file that the program itself is written to; "": it is not.
    decimals, linearise
        Of its numbers; within so much of arcs its chords, m.
    control
        What the program was read with.
    errors
        Surface error of placements; None unless that is the objective.
    """

    model: StiffnessModel
    program: ReadProgram
    present: Pose
    read: Callable[[Pose], ReadProgram]
    bounds: Bounds
    rules: SearchRules
    load: Load
    step: float
    force: float
    write: str = ""
    decimals: int | None = None
    linearise: float | None = None
    control: Controller = UNKNOWN_CONTROL
    errors: Errors | None = None


@dataclass(frozen=True)
class PlacementRow:
    """A placement and its figures. The present one has no number, and no margins beside the front's."""

    number: int | None
    x_mm: float
    y_mm: float
    z_mm: float
    a_deg: float
    b_deg: float
    rotation_deg: float
    mean_N_per_mm: float  # noqa: N815
    range_N_per_mm: float  # noqa: N815
    min_N_per_mm: float  # noqa: N815
    mean_deflection_um: float
    plunge_mean_N_per_mm: float | None  # noqa: N815
    plunge_min_N_per_mm: float | None  # noqa: N815
    extrapolated_share: float
    margin: float | None = None
    rapid_margin: float | None = None
    tool_turn_deg: float | None = None  # about its axis; None: as programmed

    @property
    def cells(self) -> Document:
        """Known values, by column."""
        return {name: value for name, value in vars(self).items() if name != TOOL_TURN or value is not None}

    @property
    def origin_mm_deg(self) -> ShopPose:
        """X, Y, Z in mm, A, B, C in degrees."""
        return self.x_mm, self.y_mm, self.z_mm, self.a_deg, self.b_deg, self.rotation_deg

    @property
    def origin(self) -> Pose:
        """The placement in m and rad."""
        return pose_in_si(self.origin_mm_deg)


TOOL_TURN = "tool_turn_deg"


@dataclass(frozen=True)
class Written:
    """The program written for the placement: its file, place of re-analysis, differences; or the reason why not."""

    file: str
    analysed_at: Mapping[str, float] = field(default_factory=dict)
    relative_difference: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    refused: str = ""


@dataclass(frozen=True, repr=False)
class Placement(FolderResult):
    r"""A program at the placement chosen for it, and the other placements of the front.

    Attributes
    ----------
    task
        What was to be placed, and how, in SI.
    front
        Placements of which none is better than another in all three figures, by rising mean.
    searches, pose_evaluations
        Searches from the beginning, poses evaluated in them.
    nothing_better
        Whether nothing but the present placement was found, in spite of all of them.
    chosen, present
        The chosen placement and the present one, which is None where it is out of reach.
    present_reason
        Why that is out of reach.
    best, before
        Analyses at the chosen and at the present placement.
    rewritten, written
        Bytes of the program written for the placement, and what `placement.json` says of it; None unless asked for.
    surface_error_um
        With the objective "error": what 95 % of the final walls stay below, at the chosen and the present placement.
    inputs
        Files that were read.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> found = tps.place(slot, "nist", x_mm=0, y_mm=0, z_mm=800, rotate_deg=0, step_mm=10, points=2, write="new.nc")
    >>> found
    <Placement: slot.nc, X0 Y0 Z800 A0 B0 C0 of 1 placements>
    >>> found.origin_mm_deg, found.worse, found.alarms, found.warnings
    ((0.0, 0.0, 800.0, 0.0, 0.0, 0.0), [], [], [])
    >>> found.refusal, found.program_bytes.decode().splitlines()[1]
    ('', 'G0 X0 Y0 Z5')
    >>> len(found.to_frame()), list(found.files(plots=False)), found.to_dict()["objective"]
    (1, ['placements.csv', 'placement.json'], 'balanced')
    >>> found.fixed[:8], list(found.trade_offs), found.machine_stated["machine"]
    ('--x=0 --', ['mean', 'range', 'weakest'], 'nist')
    >>> found.offsets.linuxcnc[:3]
    'G21'
    >>> type(found.plot()).__name__
    'Figure'
    """

    command: ClassVar[str] = "place"
    shown_by: ClassVar[str] = "place"

    task: PlacementTask
    front: list[PlacementRow]
    searches: int
    pose_evaluations: int
    nothing_better: bool
    chosen: PlacementRow
    present: PlacementRow | None
    present_reason: str
    best: Analysis
    before: Analysis | None
    rewritten: bytes | None
    written: Written | None
    surface_error_um: Mapping[str, float] | None = None
    inputs: tuple[str, ...] = ()

    @property
    def origin_mm_deg(self) -> ShopPose:
        """The chosen placement, as `analyze` takes `origin_mm_deg`."""
        return self.chosen.origin_mm_deg

    @property
    def fixed(self) -> str:
        """Options that fix the chosen placement."""
        return " ".join(f"{name}={value:.6g}" for name, value in zip(VARIED, self.origin_mm_deg, strict=True))

    @cached_property
    def worse(self) -> list[Document]:
        """Figures that are worse there than at the present placement, and by how much."""
        worse: list[Document] = []
        if (present := self.present) is None:
            return worse
        for figure, key in FIGURES.items():
            chosen, before = getattr(self.chosen, key), getattr(present, key)
            by = chosen - before if figure == "range" else before - chosen
            if by > ROUNDING * present.mean_N_per_mm:
                values = {"chosen_N_per_mm": chosen, "before_N_per_mm": before, "worse_by_N_per_mm": by}
                worse.append({"figure": figure, **values})
        return worse

    @cached_property
    def alarms(self) -> list[str]:
        """Sentences to precede the recommendation: limits and rules that it breaks, figures that get worse."""
        alarms = self._rules_broken(self.best, "recommended")
        if self.nothing_better:
            alarms.append(
                "nothing better than the present placement was found within the bounds, in "
                f"{self.searches} searches from the beginning, {self.pose_evaluations} poses evaluated"
            )
        for row in self.worse:
            chosen, before = row["chosen_N_per_mm"], row["before_N_per_mm"]
            alarms.append(
                f"WORSE: at the recommended placement {WORSE[row['figure']]} than at the present one, {number(chosen)} "
                f"instead of {number(before)} N/mm ({100.0 * row['worse_by_N_per_mm'] / before:.1f} % worse)"
            )
        return alarms

    @cached_property
    def warnings(self) -> list[str]:
        """Sentences on points to check, `alarms` first."""
        warnings = [*self.alarms]
        if self.worse:
            warnings.append("no placement was found within the bounds that is as good as the present one in all three")
        if self.before is None:
            nothing = "the present placement is out of reach, so nothing limits the recommendation"
            warnings.append(f"{nothing}: {self.present_reason}")
        else:
            warnings += self._rules_broken(self.before, "present")
        if self.chosen.extrapolated_share:
            warnings.append(
                f"the strut law is extrapolated at {100.0 * self.chosen.extrapolated_share:.0f} % of the samples: "
                "outside the lengths that it was measured at"
            )
        warnings += bound_warnings(self.task.bounds, self.origin_mm_deg, self.best.machine.limits.workspace)
        if self.best.plunging[self.best.counted].all():
            warnings.append(
                "the program only plunges along the tool axis: mean, range and weakest are those of plunges"
            )
        return list(dict.fromkeys([*warnings, *self.best.warnings]))

    def _rules_broken(self, analysis: Analysis, which: str) -> list[str]:
        """Rules that a placement breaks: the search does not hold rapids that do not follow the work to any."""
        words, margin, line = [], self.task.rules.margin, analysis.samples.line
        nearest = int(np.argmin(analysis.at.reach.margin))
        least = float(analysis.at.reach.margin[nearest])
        if least < margin:
            out = "is out of reach: it " if least < 0.0 else ""
            words.append(
                f"the {which} placement {out}has a margin of {100.0 * least:.2f} % of a limit's span in line "
                f"{line[nearest]}, less than the {100.0 * margin:g} % asked for with --margin"
            )
        for box in self.task.rules.keepouts:
            clearance = box.clearances(analysis.samples.position)
            deepest, depth = int(np.argmin(clearance)), mm_from_m(-float(clearance.min()))
            if depth > 0.0:
                into = f"the keep-out {box.name} in line {line[deepest]}"
                words.append(f"the {which} placement runs {depth:.1f} mm deep into {into}")
        return words

    @property
    def program_bytes(self) -> bytes:
        """The program written for the placement, if it was requested with `write`.

        Raises `InputError` where it cannot be written there; the rest of the result stands.
        """
        if self.rewritten is None:
            raise InputError(self.refusal or "the program was not written for the placement: pass write=FILE")
        return self.rewritten

    @property
    def refusal(self) -> str:
        """Reason why the program could not be written for the placement; "" if it could."""
        return "" if self.written is None else self.written.refused

    @cached_property
    def offsets(self) -> OffsetBlocks:
        """Offsets to key in at the control."""
        return offset_blocks(self.best.program, self.best.origin)

    @property
    def trade_offs(self) -> dict[str, dict[str, float]]:
        """Cost of the choice in each objective, against the best on the front."""
        return {
            name: {
                "chosen_N_per_mm": getattr(self.chosen, key),
                "best_on_front_N_per_mm": (min if name == "range" else max)(getattr(row, key) for row in self.front),
            }
            for name, key in FIGURES.items()
        }

    @property
    def machine_stated(self) -> Document:
        """The machine and its active effects, as in every JSON document."""
        return {"machine": self.best.machine.name, **effects_stated(self.best.model)}

    def to_dict(self) -> Document:
        """JSON document of the command."""
        document: Document = to_dict(
            {
                "warnings": self.warnings,
                "worse": self.worse,
                "program": self.best.program.name,
                **self.machine_stated,
                "load": str(self.best.load),
                "force_N": self.best.force,
                "objective": self.task.rules.objective,
                "chosen": self.chosen.cells,
                "before": self.present and self.present.cells,
                "before_reason": self.present_reason or None,
                "trade_offs": self.trade_offs,
                **({} if self.surface_error_um is None else {"surface_error_um": self.surface_error_um}),
                "front": [row.cells for row in self.front],
                "offset_blocks": {name: text or None for name, text in vars(self.offsets).items()},
                "written": self.written,
                "search": {name: getattr(self, name) for name in SEARCH},
                "assumptions": self.best.to_dict()["assumptions"],
            }
        )
        return document

    def to_frame(self) -> DataFrame:
        """The front, one placement a row, as in `placements.csv`."""
        return frame_of([row.cells for row in self.front])

    def _short(self) -> str:
        words = [f"{axis}{value:.6g}" for axis, value in zip("XYZABC", self.origin_mm_deg, strict=True)]
        return f"{self.best.program.name}, {' '.join(words)} of {len(self.front)} placements"


def bound_warnings(bounds: Bounds, placement: ShopPose, workspace: FloatArray) -> list[str]:
    """Warnings for bounds of the search on which a placement lies, with the options that widen them by half."""
    words = []
    lows, highs = (pose_in_mm(ends[:6].tolist()) for ends in (bounds.low, bounds.high))
    least, most = (
        np.append(mm_from_m(ends), [far] * 3) for ends, far in zip(workspace, (-np.inf, np.inf), strict=True)
    )
    for i in bounds.free:
        if i > 5 or bounds.round[i] or (i == 2 and bounds.heights):
            continue
        low, high, half = lows[i], highs[i], 0.5 * (highs[i] - lows[i])
        value = low + (placement[i] - low + 1e-6) % 360.0 - 1e-6 if i == 5 else placement[i]  # as in rows: 0 to 360
        for end, wider in ((low, (max(low - half, least[i]), high)), (high, (low, min(high + half, most[i])))):
            if abs(value - end) <= AT_BOUND * (high - low) and wider != (low, high):  # else the machine's own end
                words.append(
                    f"the search ended on its own bound of {VARIED[i][2:]}, {round(end, 3):g} "
                    f"{'mm' if i < 3 else 'degrees'}: widen it with {VARIED[i]}={wider[0]:.6g}:{wider[1]:.6g}"
                )
    return words
