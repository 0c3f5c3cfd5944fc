"""A program without the micrometres that its cutting forces make."""

from dataclasses import replace
from pathlib import Path

from toolpath_stiff.api import inputs
from toolpath_stiff.api.cutting import Cutting, Material, StockBox, cut_setup
from toolpath_stiff.api.inputs import origin_si
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.cutting.compensation import Compensation, compensate_program
from toolpath_stiff.cutting.cut import Cut, evaluate_cut
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.lines import split_lines
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.nc.reader import read
from toolpath_stiff.options import checked
from toolpath_stiff.results import Progress, teller
from toolpath_stiff.units import m_from_mm


@checked
def compensate(
    program: Program | str | Path,
    machine: Machine | str | Path = "nist",
    *,
    cut: Cutting = None,
    material: Material = None,
    stock_mm: StockBox = None,
    origin_mm_deg: inputs.Origin = None,
    step_mm: inputs.Step = 1.0,
    decimals: inputs.Decimals = None,
    progress: Progress | None = None,
) -> Compensation:
    r"""A program whose path is shifted against the deflection of its final walls.

    Parameters
    ----------
    program, machine
        What it runs on, what runs.
    cut, material, stock_mm
        As of `analyze`.
    origin_mm_deg
        Where program zero (G54) sits, as of `analyze`.
    step_mm
        Largest distance of two samples.
    decimals
        Of the numbers written; unless given, 4 in mm, 5 in inch.
    progress
        Called with what is being done.

    Raises
    ------
    InputError
        Nothing is known of the cut, no pass makes a final wall, or a block cannot be written otherwise: where and why.
    """
    on, part, origin, setup = (
        machine_from(machine),
        program_from(program),
        origin_si(origin_mm_deg),
        cut_setup(cut, material, stock_mm),
    )
    if setup is None:
        raise InputError("no cut to compensate", hint="say --cut FILE, or --material and --stock")
    model = on.running(part)
    default = model.machine.default_origin
    first = part.moves(origin, default)
    place = origin or (first.origin if first.origin_source == "program" else default)
    tell = teller(progress)

    def evaluate(program: ReadProgram) -> Cut:
        tell(f"{part.name}: cutting")
        return evaluate_cut(model, program, place, setup, m_from_mm(step_mm))

    def reread(text: str) -> ReadProgram:
        return read(replace(part.placed(origin, default), lines=split_lines(text, part.name), path=""))

    return compensate_program(first, place, evaluate, reread, decimals=decimals, control=part.request.controller)
