"""The paper's case study: one tool path in four regions of the workspace, at two heights, displaced and turned.

Clinton, Zhang, Wavering (1997), Figure 10 and conclusion 3. The paper prints neither its path nor its figures; path and
regions are ours. What it concludes is checked one by one, and where it stops holding is shown. The same for a path and
regions of one's own, but for the non-planar variants, which are those of the packaged square.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import resources
from itertools import pairwise
from typing import ClassVar

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis.results import Analysis, analyze
from toolpath_stiff.documents import Document, number
from toolpath_stiff.errors import ProgramError, UnreachableError
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.poses import Pose, pose_in_si
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.stiffness.model import StiffnessModel, condition_warnings, effects_stated
from toolpath_stiff.units import mm_from_m

PROGRAM = "case_study.nc"
LOW_MM, HIGH_MM = 400.0, 1200.0
Region = tuple[float, float, float, float]  # x, y, z of program zero in mm, turn in degrees
REGIONS: dict[str, Region] = {
    "1": (150.0, 100.0, LOW_MM, 0.0),
    "2": (-150.0, 100.0, LOW_MM, 45.0),
    "3": (150.0, 100.0, HIGH_MM, 0.0),
    "4": (-150.0, 100.0, HIGH_MM, 45.0),
}
HEIGHTS_MM = tuple(float(z) for z in range(300, 1401, 25))
STEP_MM, MOST_STEPS, ROOM_MM = 25.0, 50, 500.0  # step and number of other heights; their range without workspace
FIGURES = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm", "max_N_per_mm")
REGION_COLUMNS = ("x_mm", "y_mm", "z_mm", "rotation_deg")
MOST_REGIONS = 50
MEANS_AGREE = 0.01  # the paper: "stiffnesses of the same magnitude"; we ask for one per cent
WAVES_MM = (10.0, 20.0, 40.0)  # amplitudes of the non-planar variants of the path
DECIMALS = 3  # N/mm: finer than anything that can be measured, coarser than the processor's last digits


@dataclass(frozen=True, repr=False)
class CaseStudy(FolderResult):
    r"""One tool path in several regions: the paper's conclusions checked one by one, and where they cease to hold.

    Attributes
    ----------
    summary
        The JSON document of the command, in mm and N/mm.
    regions
        Name of each region -> the analysis there.
    inputs
        Files that were read.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> study = tps.case_study(slot, "nist", {"low": (0, 0, 500), "high": (0, 0, 900)}, step_mm=10)
    >>> study.to_frame()[["region", "z_mm"]].values.tolist()
    [['low', 500.0], ['high', 900.0]]
    >>> study.is_own
    True
    """

    command: ClassVar[str] = "case-study"
    shown_by: ClassVar[str] = "case_study"

    summary: Document
    regions: dict[str, Analysis]
    inputs: tuple[str, ...] = ()

    @property
    def is_own(self) -> bool:
        """True where path or regions are a user's; the packaged ones come with non-planar variants."""
        return not self.summary["non_planar"]

    def to_dict(self) -> Document:
        """JSON document of the command."""
        return self.summary

    def to_frame(self) -> DataFrame:
        """The regions, one a row."""
        return frame_of(self.summary["regions"])

    def _short(self) -> str:
        held = [conclusion["holds"] for conclusion in self.summary["conclusions"] if conclusion["holds"] is not None]
        on = f"{self.summary['program']} on " if self.is_own else ""
        verb = "conclusion of the paper holds" if len(held) == 1 else "conclusions of the paper hold"
        return f"{on}{self.summary['machine']}, {sum(held)} of {len(held)} {verb}"


def case_study_program() -> ReadProgram:
    """The packaged path."""
    text = (resources.files("toolpath_stiff") / "data" / "programs" / PROGRAM).read_text(encoding="ascii")
    return parse_program(text, PROGRAM)


def wavy_program(amplitude_mm: float) -> ReadProgram:
    """The square with one wave of height along each side: a non-planar cut of the same outline."""
    lines = ["G21 G90 F1200", "G0 X-100 Y-100 Z0"]
    corners = [(-100, -100), (100, -100), (100, 100), (-100, 100), (-100, -100)]
    for (x0, y0), (x1, y1) in pairwise(corners):
        for i in range(1, 101):
            u = i / 100.0
            z = amplitude_mm * math.sin(2.0 * math.pi * u)
            lines.append(f"G1 X{x0 + u * (x1 - x0):.4f} Y{y0 + u * (y1 - y0):.4f} Z{z:.4f}")
    return parse_program("\n".join(lines) + "\n", f"square with waves of {amplitude_mm:g} mm")


def origin_of(x_mm: float, y_mm: float, z_mm: float, turn_deg: float) -> Pose:
    """A placement in SI."""
    return pose_in_si((x_mm, y_mm, z_mm, 0.0, 0.0, turn_deg))


def run_case_study(
    model: StiffnessModel,
    step: float = defaults.STEP,
    read: Callable[[Pose], ReadProgram] | None = None,
    regions: Mapping[str, Region] | None = None,
    inputs: tuple[str, ...] = (),
) -> CaseStudy:
    """Analyze a path in every region and over the heights, the packaged one also with waves.

    Parameters
    ----------
    model
        Machine and effects.
    step
        Distance of the samples, m.
    read
        A program of one's own, read for where its zero sits; unless given, the packaged square.
    regions
        Name -> where program zero sits; unless given, `REGIONS`.
    inputs
        Files that were read for it.

    Raises
    ------
    UnreachableError
        The machine cannot reach a region (`REGIONS` are those of the reference machine).

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.stiffness.model import build_model
    >>> study = run_case_study(build_model(load_machine("nist")), step=0.02)
    >>> [found["holds"] for found in study.summary["conclusions"]]
    [True, True, True]
    """
    custom = read is not None or regions is not None
    packaged, places = case_study_program(), dict(regions or REGIONS)

    def analyzed(place: Region) -> Analysis:
        origin = origin_of(*place)
        return analyze(model, read(origin) if read else packaged, origin=origin, step=step)

    analyses = {}
    for name, place in places.items():
        try:
            analyses[name] = analyzed(place)
        except UnreachableError as error:
            hint = "give regions that the machine reaches: --region NAME:X,Y,Z[,TURN]"
            raise UnreachableError(
                f"region {name}: {error.found}", hint=hint, file=error.file, line=error.line
            ) from None
    rows = _rows(places, analyses)
    x, y, height, turn = next(iter(places.values()))
    heights = []
    for z in _heights(model, height) if custom else HEIGHTS_MM:
        with suppress(UnreachableError):
            heights.append({"z_mm": z, **_figures(analyzed((x, y, z, turn)))})
    own, ours = "path and regions as given", "the paper does not print its path; path and regions are ours"
    summary = {
        "program": next(iter(analyses.values())).program.name,
        "machine": model.machine.name,
        "step_mm": round(mm_from_m(step), 6),
        **effects_stated(model),
        "warnings": condition_warnings(model),
        "note": own if custom else ours,
        "regions": rows,
        "conclusions": conclusions(rows),
        "heights": heights,
        "limits_of_the_conclusions": {
            f"largest_{figure}_at_z_mm": max(heights, key=lambda row: row[f"{figure}_N_per_mm"])["z_mm"]
            for figure in ("mean", "range")
        },
        "non_planar": [] if custom else [_wave(model, amplitude, step) for amplitude in WAVES_MM],
    }
    return CaseStudy(summary, analyses, inputs)


def _heights(model: StiffnessModel, of_path: float) -> list[float]:
    """Heights, mm: whole steps over the workspace, and the height of the path itself."""
    low, high = (mm_from_m(float(end)) for end in model.machine.limits.workspace[:, 2])
    low, high = (low if np.isfinite(low) else of_path - ROOM_MM), (high if np.isfinite(high) else of_path + ROOM_MM)
    step = STEP_MM * max(1, math.ceil((high - low) / STEP_MM / MOST_STEPS))
    steps = range(math.ceil(low / step), math.floor(high / step) + 1)
    return sorted({of_path, *(step * i for i in steps)})


def _rows(places: Mapping[str, Region], analyses: Mapping[str, Analysis]) -> list[Document]:
    columns = ("region", *REGION_COLUMNS)
    return [{**dict(zip(columns, (name, *places[name]), strict=True)), **_figures(a)} for name, a in analyses.items()]


def _figures(analysis: Analysis) -> dict[str, float]:
    if analysis.figures["mean_N_per_mm"] is None:
        raise ProgramError("no cut moves the tool tip", file=analysis.program.name)
    return {key: round(analysis.figures[key], DECIMALS) for key in FIGURES}


def conclusions(regions: Sequence[Document]) -> list[Document]:
    """The paper's three statements, each with the numbers that decide it; None where no two regions allow a test."""
    above: dict[tuple[float, ...], list[Document]] = defaultdict(list)
    for row in sorted(regions, key=lambda row: row["z_mm"]):
        above[row["x_mm"], row["y_mm"], row["rotation_deg"]].append(row)
    steps = [pair for rows in above.values() for pair in pairwise(rows)]
    statements = [
        _statement(
            f"the {figure} rises with z",
            [high[key] > low[key] for low, high in steps],
            [
                f"region {low['region']} to {high['region']}: {number(low[key])} to {number(high[key])} N/mm"
                for low, high in steps
            ],
            "no two regions differ in height alone",
        )
        for figure, key in (("mean", "mean_N_per_mm"), ("range", "range_N_per_mm"))
    ]
    key, pairs = "range_N_per_mm", _in_plane(regions)
    alike = _statement(
        "at one height means agree closely and ranges differ a little",
        [_apart(a, b) < MEANS_AGREE and a[key] != b[key] for a, b in pairs],
        [
            f"regions {a['region']} and {b['region']}: means apart by {100 * _apart(a, b):.2f} %, ranges "
            f"{number(a[key])} and {number(b[key])} N/mm"
            for a, b in pairs
        ],
        "no two regions are at one height",
    )
    return [*statements, alike]


def _statement(statement: str, held: Sequence[bool], words: Sequence[str], nothing: str) -> Document:
    return {"statement": statement, "holds": all(held) if held else None, "numbers": "; ".join(words) or nothing}


def _in_plane(regions: Sequence[Document]) -> list[tuple[Document, Document]]:
    """The two regions at each height whose means are farthest apart."""
    pairs = []
    for z in sorted({row["z_mm"] for row in regions}):
        rows = [row for row in regions if row["z_mm"] == z]
        ends = [end(rows, key=lambda row: row["mean_N_per_mm"]) for end in (min, max)]
        if len(rows) > 1:
            first, second = sorted(ends, key=regions.index)
            pairs.append((first, second))
    return pairs


def _apart(a: Document, b: Document) -> float:
    return float(abs(b["mean_N_per_mm"] / a["mean_N_per_mm"] - 1.0))


def _wave(model: StiffnessModel, amplitude: float, step: float) -> Document:
    """The wavy square in the four regions, and True if its mean is still independent of the region."""
    program = wavy_program(amplitude)
    analyses = {name: analyze(model, program, origin=origin_of(*at), step=step) for name, at in REGIONS.items()}
    rows = _rows(REGIONS, analyses)
    return {
        "amplitude_mm": amplitude,
        "regions": [{key: row[key] for key in ("region", *FIGURES)} for row in rows],
        "means_apart_at_one_height_percent": [round(100 * _apart(a, b), DECIMALS) for a, b in _in_plane(rows)],
    }
