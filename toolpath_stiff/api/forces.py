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
    tool: Annotated[int | None, Option("--tool", "NUMBER", at_least=0)] = None,
    material: Annotated[str, Option("--material", "NAME")] = "",
) -> CoefficientFit:
    """Coefficients of the cutting force from records of a dynamometer: slots at several feeds.

    Parameters
    ----------
    records
        A file or several, one record each or several told apart by a column record: CSV, or FILE.xlsx[#SHEET].
    cut
        Setup file with the tool that cut the slots, as [[tool]].
    columns
        Which columns the files call otherwise: "fx=Kraft X:kN, feed_per_tooth==0.05", or such a dict; unless given, as
        FILE.columns.toml beside a file says.
    axes
        Axes of the dynamometer that point along the feed, to its left and up; what it reads acts on the work.
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
    >>> import toolpath_stiff as tps
    >>> try:
    ...     tps.forces("slots.csv", "none.toml")
    ... except tps.InputError as error:
    ...     print(error.found)
    cannot read the cut's setup 'none.toml': No such file or directory
    """
    setup = TomlReader.read(cut, "the cut's setup")
    tools = tools_of(setup, "tool") or {}
    number = next(iter(tools)) if tool is None and len(tools) == 1 else tool
    if number not in tools:
        named = ", ".join(map(str, tools)) or "none"
        hint = "say --tool NUMBER" if tools else "write [[tool]] with number, diameter_mm, flutes and helix_deg"
        raise InputError(f"tool {number or 'of the slots'} is not told (tools: {named})", hint=hint, file=str(cut))
    files = [records] if isinstance(records, str | Path) else records
    return fit_coefficients([str(file) for file in files], cutter_of(tools[number]), columns, axes, material)
