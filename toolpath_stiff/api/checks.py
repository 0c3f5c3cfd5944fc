"""Check of a program apart from stiffness: the words it uses and those left out; loads the readers of all languages."""

from pathlib import Path

from toolpath_stiff.analysis.program_check import ProgramCheck, check_program
from toolpath_stiff.api.inputs import Origin, Step, origin_si
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.nc.request import ZERO
from toolpath_stiff.options import checked
from toolpath_stiff.units import m_from_mm


@checked
def check(
    program: Program | str | Path,
    machine: Machine | str | Path | None = "nist",
    *,
    origin_mm_deg: Origin = None,
    step_mm: Step = 1.0,
) -> ProgramCheck:
    r"""Words that a program uses and those not understood, extents, times; with a machine its reach and fastest strut.

    Where the reader would refuse the program the check says so and goes on with the next block.

    Parameters
    ----------
    program, machine
        The program, or its file; the machine, None for none.
    origin_mm_deg
        Where program zero sits.
    step_mm
        Largest distance between the samples at which reach is checked.

    Raises
    ------
    InputError
        The file cannot be read at all.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.check(tps.Program.from_text("G21 G90\nG1 X40 F300\nG999\nM2", name="slot.nc"))
    >>> [(finding.line, finding.severity) for finding in found.errors]
    [(3, 'error')]
    """
    part, on = program_from(program), None if machine is None else machine_from(machine).model.machine
    request = part.placed(origin_si(origin_mm_deg), ZERO if on is None else on.default_origin)
    return check_program(request, on, m_from_mm(step_mm))
