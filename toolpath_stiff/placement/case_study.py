"""The paper's case study: one tool path in four regions of the workspace, at two heights, displaced and turned.

Clinton, Zhang, Wavering (1997), Figure 10 and conclusion 3. The paper prints neither its path nor its figures; path and
regions are ours. What it concludes is checked one by one, and where it stops holding is shown. The same for a path and
regions of one's own, but for the non-planar variants, which are those of the packaged square.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import resources
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.analysis import Analysis, analyze
from toolpath_stiff.analysis.statistics import stiffness_figures
from toolpath_stiff.errors import ProgramError, TableError, UnreachableError
from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.results import FolderResult
from toolpath_stiff.stiffness.model import StiffnessModel, condition_warnings, effects_stated
from toolpath_stiff.tables import Columns, read_table
from toolpath_stiff.units import Pose, m_from_mm, mm_from_m, number, rad_from_deg

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

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
STEP_MM, MOST_STEPS, ROOM_MM = 25.0, 50, 500.0  # of other heights; where no workspace is bounded, above and below
REGION_COLUMNS = ("x_mm", "y_mm", "z_mm", "rotation_deg")
MOST_REGIONS = 50
MEANS_AGREE = 0.01  # the paper: "stiffnesses of the same magnitude"; we ask for one per cent
WAVES_MM = (10.0, 20.0, 40.0)  # how far the non-planar variants of the path go up and down
DECIMALS = 3  # N/mm: finer than anything that can be measured, coarser than the processor's last digits


@dataclass(frozen=True, repr=False)
class CaseStudy(FolderResult):
    r"""One tool path in several regions: the paper's conclusions checked one by one, and where they stop holding.

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

    summary: dict[str, Any]
    regions: dict[str, Analysis]
    inputs: tuple[str, ...] = ()

    @property
    def is_own(self) -> bool:
        """Whether path or regions are a user's; the packaged ones come with non-planar variants."""
        return not self.summary["non_planar"]

    def to_dict(self) -> dict[str, Any]:
        """The JSON document of the command."""
        return self.summary

    def to_frame(self) -> pd.DataFrame:
        """The regions, one a row."""
        import pandas as pd

        return pd.DataFrame(self.summary["regions"])

    def plot(self) -> Figure:
        """The path in its regions, coloured by stiffness."""
        return cast("Figure", self.view.regions_picture.figure(self))

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
    """The square with its height going up and down once along every side: a non-planar cut of the same outline."""
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
    return (m_from_mm(x_mm), m_from_mm(y_mm), m_from_mm(z_mm), 0.0, 0.0, rad_from_deg(turn_deg))


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
    own = read is not None or regions is not None
    packaged = case_study_program()
    where = dict(regions or REGIONS)

    def at(place: Region) -> Analysis:
        origin = origin_of(*place)
        return analyze(model, read(origin) if read else packaged, origin=origin, step=step)

    analyses = {name: _in_region(at, name, place, own) for name, place in where.items()}
    figures = {name: _figures(analysis) for name, analysis in analyses.items()}
    x, y, z, turn = next(iter(where.values()))
    heights = _over_heights(at, (x, y, turn), _heights(model, z) if own else HEIGHTS_MM)
    first = next(iter(analyses.values()))
    summary = {
        "program": first.program.name,
        "machine": model.machine.name,
        "step_mm": round(mm_from_m(step), 6),
        **effects_stated(model),
        "warnings": condition_warnings(model),
        "note": "path and regions as given" if own else "the paper does not print its path; path and regions are ours",
        "regions": [
            {"region": name, "x_mm": at[0], "y_mm": at[1], "z_mm": at[2], "rotation_deg": at[3], **figures[name]}
            for name, at in where.items()
        ],
        "conclusions": _conclusions(figures, where),
        "heights": heights,
        "limits_of_the_conclusions": _limits(heights),
        "non_planar": [] if own else [_wave(model, amplitude, step) for amplitude in WAVES_MM],
    }
    return CaseStudy(summary, analyses, inputs)


def _in_region(at: Callable[[Region], Analysis], name: str, place: Region, own: bool) -> Analysis:
    try:
        return at(place)
    except UnreachableError as error:
        if not own:
            raise
        raise UnreachableError(
            f"region {name}: {error.found}",
            hint=f"give regions that the machine reaches: {both_names('--region', 'NAME:X,Y,Z[,TURN]')}",
            file=error.file,
            line=error.line,
        ) from None


def _over_heights(
    at: Callable[[Region], Analysis], place: tuple[float, float, float], heights: Iterable[float]
) -> list[dict[str, float]]:
    """The figures at x, y, turn and every height that is within reach."""
    found, (x, y, turn) = [], place
    for z in heights:
        with suppress(UnreachableError):
            found.append({"z_mm": z, **_figures(at((x, y, z, turn)))})
    return found


def _heights(model: StiffnessModel, own: float) -> list[float]:
    """mm, whole steps over the workspace, and the height of the path itself."""
    low, high = (mm_from_m(float(end)) for end in model.machine.limits.workspace[:, 2])
    low, high = (low if np.isfinite(low) else own - ROOM_MM), (high if np.isfinite(high) else own + ROOM_MM)
    step = STEP_MM * max(1, math.ceil((high - low) / STEP_MM / MOST_STEPS))
    steps = range(math.ceil(low / step), math.floor(high / step) + 1)
    return sorted({own, *(step * i for i in steps)})


def read_regions(file: str) -> dict[str, Region]:
    """Regions of a table (CSV or FILE.xlsx[#SHEET]): x_mm, y_mm, z_mm, and if there rotation_deg and region, its name.

    `case_study.csv` is such a table.

    Raises
    ------
    InputError
        A column is missing, a cell is no number, a name stands twice, or there is no region or too many; with line.
    """
    table = read_table(file, "regions", Columns(REGION_COLUMNS, ("region",)))
    missing = [name for name in REGION_COLUMNS[:3] if name not in table.heading]
    if missing:
        raise TableError(
            f"column {missing[0]} is missing", expected=",".join(REGION_COLUMNS), file=file, line=table.heading_line
        )
    found: dict[str, Region] = {}
    for row_number, (line, cells) in enumerate(table.rows, 1):
        row = dict(zip(table.heading, cells, strict=False))
        name = row.get("region") or str(row_number)
        if name in found:
            raise TableError(f"region {name} stands twice", file=file, line=line)
        try:
            x, y, z, turn = (float(row.get(column) or 0.0) for column in REGION_COLUMNS)
            if not np.isfinite((x, y, z, turn)).all():
                raise ValueError("a cell is no finite number")
        except ValueError as error:
            raise TableError(
                f"region {name}: {error}", expected="numbers in mm and degrees", file=file, line=line
            ) from None
        found[name] = (x, y, z, turn)
    return found


def _figures(analysis: Analysis) -> dict[str, float]:
    found = stiffness_figures(analysis, analysis.headline)
    if found["mean_N_per_mm"] is None:
        raise ProgramError("no cut moves the tool tip", file=analysis.program.name)
    return {
        key: round(float(found[key]), DECIMALS)
        for key in ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm", "max_N_per_mm")
    }


def _conclusions(
    figures: Mapping[str, Mapping[str, float]], regions: Mapping[str, Region] = REGIONS
) -> list[dict[str, Any]]:
    """The paper's three statements, each with the numbers that decide it; None where no two regions can."""
    in_height, in_plane = _pairs_in_height(regions), _pairs_in_plane(figures, regions)

    def rises(key: str) -> tuple[bool | None, str]:
        steps = [(figures[low][key], figures[high][key]) for low, high in in_height]
        words = "; ".join(
            f"region {low} to {high}: {number(a)} to {number(b)} N/mm"
            for (low, high), (a, b) in zip(in_height, steps, strict=True)
        )
        return (all(b > a for a, b in steps) if steps else None), words or "no two regions differ in height alone"

    mean_rises, mean_words = rises("mean_N_per_mm")
    range_rises, range_words = rises("range_N_per_mm")
    apart = [
        (abs(figures[b]["mean_N_per_mm"] / figures[a]["mean_N_per_mm"] - 1.0), figures[a], figures[b], f"{a} and {b}")
        for a, b in in_plane
    ]
    same_words = "; ".join(
        f"regions {pair}: means apart by {100 * gap:.2f} %, ranges {number(one['range_N_per_mm'])} and "
        f"{number(two['range_N_per_mm'])} N/mm"
        for gap, one, two, pair in apart
    )
    return [
        {"statement": "the mean rises with z", "holds": mean_rises, "numbers": mean_words},
        {"statement": "the range rises with z", "holds": range_rises, "numbers": range_words},
        {
            "statement": "at one height means agree closely and ranges differ a little",
            "holds": all(
                gap < MEANS_AGREE and one["range_N_per_mm"] != two["range_N_per_mm"] for gap, one, two, _ in apart
            )
            if apart
            else None,
            "numbers": same_words or "no two regions are at one height",
        },
    ]


def _pairs_in_height(regions: Mapping[str, Region]) -> list[tuple[str, str]]:
    """Regions above each other, the lower first, neighbours in height."""
    above: dict[tuple[float, ...], list[str]] = {}
    for name, (x, y, _, turn) in regions.items():
        above.setdefault((x, y, turn), []).append(name)
    return [pair for names in above.values() for pair in pairwise(sorted(names, key=lambda name: regions[name][2]))]


def _pairs_in_plane(figures: Mapping[str, Mapping[str, float]], regions: Mapping[str, Region]) -> list[tuple[str, str]]:
    """Of each height with several regions the two whose means are farthest apart."""
    beside: dict[float, list[str]] = {}
    for name, place in regions.items():
        beside.setdefault(place[2], []).append(name)
    mean = {name: found["mean_N_per_mm"] for name, found in figures.items()}
    return [
        max(combinations(names, 2), key=lambda pair: abs(math.log(mean[pair[1]] / mean[pair[0]])))
        for _, names in sorted(beside.items())
        if len(names) > 1
    ]


def _limits(heights: list[dict[str, float]]) -> dict[str, float]:
    """At which heights mean and range of the square at (150, 100) mm stop rising."""
    mean = max(heights, key=lambda row: row["mean_N_per_mm"])
    widest = max(heights, key=lambda row: row["range_N_per_mm"])
    return {"largest_mean_at_z_mm": mean["z_mm"], "largest_range_at_z_mm": widest["z_mm"]}


def _wave(model: StiffnessModel, amplitude: float, step: float) -> dict[str, Any]:
    """The wavy square in the four regions, and whether its mean still does not depend on where it lies."""
    program = wavy_program(amplitude)
    figures = {
        name: _figures(analyze(model, program, origin=origin_of(*at), step=step)) for name, at in REGIONS.items()
    }
    return {
        "amplitude_mm": amplitude,
        "regions": [{"region": name, **row} for name, row in figures.items()],
        "means_apart_at_one_height_percent": [
            round(100 * abs(figures[b]["mean_N_per_mm"] / figures[a]["mean_N_per_mm"] - 1.0), DECIMALS)
            for a, b in _pairs_in_plane(figures, REGIONS)
        ],
    }
