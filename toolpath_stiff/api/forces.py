"""Coefficients of the cutting force from records of a dynamometer."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from toolpath_stiff.column_names import Mapped
from toolpath_stiff.cutting.cutters import cutter_of
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.tables import tools_of
from toolpath_stiff.options import Option, checked
from toolpath_stiff.readings.forces import CoefficientFit, fit_coefficients
from toolpath_stiff.toml_reader import TomlReader

Records = str | Path | Sequence[str | Path]


@checked
def forces(
    records: Records,
    cut: Annotated[str | Path, Option("--cut", "FILE")],
    *,
    columns: Mapped = None,
    axes: Annotated[str, Option("--axes", "FEED,LEFT,UP")] = "x,y,z",
    tool: Annotated[int | None, Option("--tool", at_least=0)] = None,
    material: Annotated[str, Option("--material", "NAME")] = "",
) -> CoefficientFit:
    r"""Coefficients of the cutting force from records of a dynamometer: slots at several feeds.

    Parameters
    ----------
    records
        A file or several, one record each or several told apart by a column record: CSV, or FILE.xlsx[#SHEET].
    cut
        Setup file with the tool that cut the slots, as [[tool]].
    columns
        Columns that the files name differently: "fx=Kraft X:kN, feed_per_tooth==0.05", or such a dict; unless given, as
        FILE.columns.toml beside a file says.
    axes
        Axes of the dynamometer that point along the feed, to its left and up; its readings are forces on the work.
    tool
        Number of the tool (default: the only one in the setup file).
    material
        Name of the material, for the result.

    Raises
    ------
    InputError
        A file cannot be read; the tool is not known; fewer than three feeds; axes whose signs cannot be right.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from math import pi, sin
    >>> import toolpath_stiff as tps
    >>> rows = ["record,time_s,fx_N,fy_N,fz_N,feed_per_tooth_mm,spindle_rpm,depth_mm"]
    >>> for feed in (0.04, 0.06, 0.08):  # slots of a metal with Ktc = 800 N/mm2 and Kte = 20 N/mm
    ...     pushed = 9 * (800 * feed / 4 + 20 / pi)
    ...     for k in range(400):
    ...         teeth = 20 * sin(2 * pi * 3 * k / 40)
    ...         rows.append(f"{feed},{k / 4000},{pushed / 2 + teeth},{-pushed + teeth},0,{feed},6000,3")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     slots, cut = pathlib.Path(folder, "slots.csv"), pathlib.Path(folder, "cut.toml")
    ...     _ = slots.write_text(chr(10).join(rows))
    ...     _ = cut.write_text("[[tool]]\nnumber = 1\ndiameter_mm = 10\nflutes = 3\nhelix_deg = 30")
    ...     fit = tps.forces(slots, cut)
    >>> [round(value) for value in fit.to_dict()["coefficients"]["cutting_N_per_mm2"]]
    [800, 400, 0]
    >>> round(fit.reach, 1), fit.silent[1]  # Student's t of three slots
    (12.7, 'whether forces rise straight with the feed: 3 feeds hardly test it, 5 would')
    >>> fit.columns()["feed_per_tooth_um"]
    [40.0, 60.0, 80.0]
    """
    setup = TomlReader.read(cut, "the cut's setup")
    tools = tools_of(setup, "tool") or {}
    number = next(iter(tools)) if tool is None and len(tools) == 1 else tool
    if number not in tools:
        named = ", ".join(map(str, tools)) or "none"
        hint = "say --tool NUMBER" if tools else "write [[tool]] with number, diameter_mm, flutes and helix_deg"
        raise InputError(f"no tool {number or 'of the slots'} (tools: {named})", hint=hint, file=str(cut))
    files = [records] if isinstance(records, str | Path) else records
    return fit_coefficients([str(file) for file in files], cutter_of(tools[number]), columns, axes, material)
