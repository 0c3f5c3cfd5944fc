"""Cuts: their setup files, and the materials that are known.

for example:
  tps cut new part.toml                                     a commented setup to edit
  tps cut materials                                         coefficients of the cutting force that come with the tool
  tps analyze part.nc --cut part.toml --tolerance 20        the error of the surface
"""

from argparse import Namespace
from typing import Annotated

import toolpath_stiff as tps
from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import JSON, REPLACE, command
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
