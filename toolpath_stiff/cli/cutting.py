"""Cuts: their setup files, and the materials that are known.

for example:
  tps cut new part.toml                                     a commented setup to edit
  tps cut materials                                         coefficients of the cutting force that come with the tool
  tps analyze part.nc --cut part.toml --tolerance 20        the error of the surface
  tps compensate part.nc --cut part.toml -o part_comp.nc    the program without it
"""

from argparse import Namespace
from pathlib import Path
from typing import Annotated

import toolpath_stiff as tps
from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import JSON, PROGRAM, REPLACE, command
from toolpath_stiff.cutting.coefficients import materials
from toolpath_stiff.options import Option


@command("cut new", REPLACE)
def new_cut(args: Namespace, file: Annotated[str, Option("FILE")]) -> int:
    """Write a commented setup of a cut: stock, tools, coefficients, spindle."""
    text = tps.cut_template(file).text
    return run.write_text(args, file, text, "edit it, then", "analyze", "part.nc", "--cut", file, fresh=True)


@command("cut materials", JSON)
def list_materials(args: Namespace) -> int:
    """Materials with their coefficients and where these come from."""
    known = {name: coefficients.document() for name, coefficients in materials().items()}
    row = "{:<12} {}\n{:<12} tangential, radial, axial {} N/mm2, at the edge {} N/mm\n{:<12} {}"
    text = "\n".join(
        row.format(name, m["material"], "", m["cutting_N_per_mm2"], m["edge_N_per_mm"], "", m["origin"])
        for name, m in known.items()
    )
    return run.show(args, text, document=lambda: known)


@command("compensate", PROGRAM, "compensate", "Program.read", "Machine.load", "Machine.under", REPLACE, JSON)
def compensate(
    args: Namespace,
    output: Annotated[str | None, Option("-o --output", "FILE")] = None,
) -> int:
    """The program shifted against the deflection of its final walls: what it does to each, what is left alone and why.

    for example:
      tps compensate programs/pocket.nc --cut programs/pocket_cut.toml -o pocket_comp.nc

    Passes that make a wall of the finished part are shifted by the mean of its error over the height, iterated with the
    engagement of the shifted path. Arcs stay arcs; feeds, comments, modes, tool changes and cycles are kept; rapids,
    plunges and floors stay. A wall that would get worse, or whose shift is beyond 0.1 mm or half of the width of cut,
    is left alone. Where nothing is shifted nothing is written.

    Parameters
    ----------
    output
        File of the compensated program (default: the program's name with _comp).
    """
    source = Path(args.program)
    file = Path(output or source.with_name(f"{source.stem}_comp{source.suffix}"))
    run.check_single(args, file)
    compensation = run.call(args, tps.compensate)
    written = run.write_single(args, {file: compensation.rewritten.content}) if compensation.changed else []
    after = run.written_text(written) if written else f"{file} was not written: nothing is shifted"
    return run.show(args, compensation, after)
