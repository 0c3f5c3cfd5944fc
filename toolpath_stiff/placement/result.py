"""A program placed: the result of a search, and the advice that terminal, placement.json, page and sheet give alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from toolpath_stiff.analysis.results import Analysis
from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import number, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.placement.goals import Bounds
from toolpath_stiff.placement.rows import FIGURES, PlacementRow
from toolpath_stiff.placement.task import VARIED, PlacementTask, SearchRecord
from toolpath_stiff.poses import ShopPose, pose_in_mm
from toolpath_stiff.results import FolderResult
from toolpath_stiff.rewriting.offset_blocks import OffsetBlocks, offset_blocks
from toolpath_stiff.stiffness.model import effects_stated
from toolpath_stiff.units import mm_from_m

if TYPE_CHECKING:
    import pandas as pd

WORSE = {"mean": "the mean is lower", "range": "the range is wider", "weakest": "the weakest place is softer"}
ROUNDING = 1e-9  # of the mean: two evaluations of one placement differ by less
AT_BOUND = 1e-3  # of a bound's span: this near the search has ended on it


@dataclass(frozen=True)
class Worsening:
    """A figure that is worse at the chosen placement than at the present one: mean, range or weakest."""

    figure: str
    chosen_N_per_mm: float  # noqa: N815
    before_N_per_mm: float  # noqa: N815
    worse_by_N_per_mm: float  # noqa: N815


@dataclass(frozen=True)
class Written:
    """The program written for the placement: its file, where it was analysed again, how it differs; or why not."""

    file: str
    analysed_at: Mapping[str, float] = field(default_factory=dict)
    relative_difference: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    refused: str = ""


@dataclass(frozen=True, repr=False)
class Placement(FolderResult):
    r"""A program at the placement that was chosen for it, and the others of the front.

    Attributes
    ----------
    task
        What was to be placed, and how, in SI.
    front
        Placements of which none is better than another in all three figures, by rising mean.
    search
        The search, as `placement.json` has it.
    chosen, present
        The chosen placement and the present one, which is None where it is out of reach.
    present_reason
        Why that is out of reach.
    best, before
        Analyses at the chosen and at the present placement.
    rewritten, written
        Bytes of the program written for the placement, and what `placement.json` says of it; None unless asked for.
    inputs
        Files that were read.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> found = tps.place(slot, "nist", x_mm=0, y_mm=0, z_mm=800, rotate_deg=0, step_mm=10, points=2, write="new.nc")
    >>> found
    <Placement: slot.nc, X0 Y0 Z800 A0 B0 C0 of 1 placements>
    >>> found.origin_mm_deg, found.worse, found.warnings
    ((0.0, 0.0, 800.0, 0.0, 0.0, 0.0), [], [])
    >>> found.refusal, found.program_bytes.decode().splitlines()[1]
    ('', 'G0 X0 Y0 Z5')
    >>> len(found.to_frame()), list(found.files(plots=False)), found.to_dict()["objective"]
    (1, ['placements.csv', 'placement.json'], 'balanced')
    >>> found.picked, list(found.trade_offs), found.machine_stated["machine"]
    (False, ['mean', 'range', 'weakest'], 'nist')
    >>> found.offsets.linuxcnc[:3]
    'G21'
    >>> type(found.plot()).__name__
    'Figure'
    """

    command: ClassVar[str] = "place"
    shown_by: ClassVar[str] = "place"

    task: PlacementTask
    front: list[PlacementRow]
    search: SearchRecord
    chosen: PlacementRow
    present: PlacementRow | None
    present_reason: str
    best: Analysis
    before: Analysis | None
    rewritten: bytes | None
    written: Written | None
    inputs: tuple[str, ...] = ()

    @property
    def origin_mm_deg(self) -> ShopPose:
        """The chosen placement: what `analyze` takes as `origin_mm_deg`."""
        return self.chosen.origin_mm_deg

    @property
    def picked(self) -> bool:
        """Another one of the front than the recommended placement is chosen."""
        return self.chosen.number != self.search.recommended

    @cached_property
    def worse(self) -> list[Worsening]:
        """Figures that are worse there than at the present placement, and by how much."""
        if self.present is None:
            return []
        worse = []
        for figure, key in FIGURES.items():
            chosen, before = getattr(self.chosen, key), getattr(self.present, key)
            worse_by = chosen - before if figure == "range" else before - chosen
            if worse_by > ROUNDING * self.present.mean_N_per_mm:
                worse.append(Worsening(figure, chosen, before, worse_by))
        return worse

    @cached_property
    def warnings(self) -> list[str]:
        """Sentences that deserve a look, what gets worse first."""
        warnings = [nothing_better_words(self.search)] if self.search.nothing_better else []
        warnings += [self._worse_words(worse) for worse in self.worse]
        if self.worse and not self.picked:
            warnings.append("no placement was found within the bounds that is as good as the present one in all three")
        warnings += [
            f"line {line}: no placement within the bounds keeps this rapid within reach; it does not follow the work, "
            "and was left out of the search"
            for line in self.search.rapids_left_out
        ]
        if self.present is None:
            nothing = "the present placement is out of reach, so nothing says what must not get worse"
            warnings.append(f"{nothing}: {self.present_reason}")
        else:
            warnings += self._present_words()
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

    def _present_words(self) -> list[str]:
        """Rules that the present placement itself does not keep, in sentences."""
        words, margin, before = [], self.task.rules.margin, self.before
        assert before is not None
        least = float(before.at.reach.margin.min())
        if least < margin:
            words.append(
                f"the present placement has a margin of {100.0 * least:.2f} % of a limit's span, less than the "
                f"{100.0 * margin:g} % asked for with --margin"
            )
        depths = [-float(box.clearances(before.samples.position).min()) for box in self.task.rules.keepouts]
        if max(depths, default=0.0) > 0.0:
            words.append(f"the present placement runs {mm_from_m(max(depths)):.1f} mm deep into a keep-out")
        return words

    def _worse_words(self, worse: Worsening) -> str:
        share = 100.0 * worse.worse_by_N_per_mm / max(abs(worse.before_N_per_mm), 1e-12)
        return (
            f"WORSE: at the {'picked' if self.picked else 'recommended'} placement {WORSE[worse.figure]} than at the "
            f"present one, {number(worse.chosen_N_per_mm)} instead of {number(worse.before_N_per_mm)} N/mm "
            f"({share:.1f} % worse)"
        )

    @property
    def program_bytes(self) -> bytes:
        """The program written for the placement; it was asked for with `write`.

        Raises `InputError` where it cannot be written there; the rest of the result stands.
        """
        if self.rewritten is None:
            raise InputError(self.refusal or "the program was not written for the placement: ask with write=FILE")
        return self.rewritten

    @property
    def refusal(self) -> str:
        """The reason why the program could not be written for the placement, "" unless that is so."""
        return "" if self.written is None else self.written.refused

    @property
    def offsets(self) -> OffsetBlocks:
        """Offsets to key in at the control."""
        return offset_blocks(self.best.program, self.best.origin)

    @property
    def trade_offs(self) -> dict[str, dict[str, float]]:
        """The cost of the choice in each objective: the best on the front beside it."""
        return {
            name: {
                "chosen_N_per_mm": getattr(self.chosen, key),
                "best_on_front_N_per_mm": (min if name == "range" else max)(getattr(row, key) for row in self.front),
            }
            for name, key in FIGURES.items()
        }

    @property
    def machine_stated(self) -> dict[str, Any]:
        """The machine and what acts on it, as every JSON document has them."""
        return {"machine": self.best.machine.name, **effects_stated(self.best.model)}

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command."""
        document: dict[str, Any] = to_dict(
            {
                "warnings": self.warnings,
                "worse": self.worse,
                "program": self.best.program.name,
                **self.machine_stated,
                "load": str(self.best.load),
                "force_N": self.best.force,
                "objective": self.task.rules.objective,
                "chosen": self.chosen,
                "picked": self.picked,
                "recommended": self.front[self.search.recommended - 1],
                "before": self.present,
                "before_reason": self.present_reason or None,
                "trade_offs": self.trade_offs,
                "front": self.front,
                "offset_blocks": {name: text or None for name, text in vars(self.offsets).items()},
                "written": self.written,
                "search": self.search,
                "assumptions": self.best.to_dict()["assumptions"],
            }
        )
        return document

    def to_frame(self) -> pd.DataFrame:
        """The front, one placement a row, as in `placements.csv`."""
        import pandas as pd

        return pd.DataFrame(self.front)

    def _short(self) -> str:
        words = [f"{axis}{value:.6g}" for axis, value in zip("XYZABC", self.origin_mm_deg, strict=True)]
        return f"{self.best.program.name}, {' '.join(words)} of {len(self.front)} placements"


def nothing_better_words(search: SearchRecord) -> str:
    """A sentence: the front is the present placement alone, and how hard another was looked for."""
    return (
        f"nothing better than the present placement was found within the bounds, in {search.searches} searches from "
        f"the beginning, {search.pose_evaluations} poses evaluated"
    )


def bound_warnings(bounds: Bounds, placement: ShopPose, workspace: FloatArray) -> list[str]:
    """Bounds of the search that a placement lies on, with the options that widen them by half."""
    words = []
    lows, highs = (pose_in_mm(ends.tolist()) for ends in (bounds.low, bounds.high))
    reach = [*mm_from_m(workspace).T.tolist(), *[(-np.inf, np.inf)] * 3]
    for i in bounds.free:
        if bounds.round[i] or (i == 2 and bounds.heights):
            continue
        low, high, (least, most), value = lows[i], highs[i], reach[i], placement[i]
        value = low + (value - low + 1e-6) % 360.0 - 1e-6 if i == 5 else value  # the file's is within 0 to 360
        half = 0.5 * (high - low)
        for end, at_end, wider in (
            (low, value - low, (max(low - half, least), high)),
            (high, high - value, (low, min(high + half, most))),
        ):
            if at_end <= AT_BOUND * (high - low) and wider != (low, high):  # else the machine's own end
                words.append(
                    f"the search ended on its own bound of {VARIED[i][2:]}, {round(end, 3):g} "
                    f"{'mm' if i < 3 else 'degrees'}: widen it with {VARIED[i]}={wider[0]:.6g}:{wider[1]:.6g}"
                )
    return words
