"""One tool path in several regions of the workspace: the paper's conclusions checked."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from toolpath_stiff.api.inputs import Step, pose_si
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.options import checked
from toolpath_stiff.placement.case_study import MOST_REGIONS, CaseStudy, Region, run_case_study
from toolpath_stiff.units import m_from_mm


@checked
def case_study(
    program: Program | str | Path | None = None,
    machine: Machine | str | Path = "nist",
    regions: Mapping[str, Sequence[float]] | None = None,
    *,
    step_mm: Step = 1.0,
) -> CaseStudy:
    r"""One tool path in several regions, at several heights, displaced and turned, as the paper's Figure 10.

    Parameters
    ----------
    program
        What runs; unless given, the packaged contour of a 200 mm square.
    machine
        A machine, its name or its file.
    regions
        Name -> x, y, z of program zero in mm and, if turned, the angle in degrees. Unless given, four of the reference
        machine.
    step_mm
        Distance of the samples.

    Raises
    ------
    InputError
        A region or the program cannot be read.
    UnreachableError
        The machine cannot reach a region.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.case_study(machine="nist")
    <CaseStudy: nist, 3 of 3 conclusions of the paper hold>
    >>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
    >>> tps.case_study(slot, "nist", {"left": (-200, 0, 800), "right": (200, 0, 800, 90)}, step_mm=10)
    <CaseStudy: slot.nc on nist, 1 of 1 conclusion of the paper holds>
    """
    on = machine_from(machine)
    part = None if program is None else program_from(program)
    model = on.running(part)
    read = None if part is None else lambda origin: part.moves(origin, model.machine.default_origin)
    inputs = (*(part.inputs if part else ()), *on.inputs)
    return run_case_study(model, m_from_mm(step_mm), read, None if regions is None else _regions(regions), inputs)


def _regions(named: Mapping[str, Sequence[float]]) -> dict[str, Region]:
    """Regions by name in mm and degrees, checked."""
    if not 0 < len(named) <= MOST_REGIONS:
        raise InputError(f"{len(named)} regions", expected=f"1 to {MOST_REGIONS}")
    regions = {}
    for name, place in named.items():
        numbers = [float(value) for value in place]
        if len(numbers) not in (3, 4):
            raise InputError(f"region {name} of {len(numbers)} numbers", expected="x, y, z in mm, and the turn")
        x, y, z, turn = [*numbers, 0.0][:4]
        pose_si(f"region {name}", (x, y, z, 0.0, 0.0, turn))
        regions[str(name)] = (x, y, z, turn)
    return regions
