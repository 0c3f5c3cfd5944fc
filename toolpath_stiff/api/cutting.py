"""Input of functions that compute a cut: its setup file, or material and stock; a template of that file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from toolpath_stiff.api.inputs import template
from toolpath_stiff.cutting.setup import CutSetup, read_setup, setup_of
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import Option
from toolpath_stiff.results import TextFile

Cutting = Annotated[CutSetup | str | Path | None, Option("--cut", "FILE")]
Material = Annotated[str | None, Option("--material", "NAME", instead_of="cut")]
StockBox = Annotated[str | Sequence[float] | None, Option("--stock", "X,Y,Z", instead_of="cut")]
Tolerance = Annotated[float | None, Option("--tolerance", "um", above=0, at_most=1e5)]


def cut_setup(cut: Cutting, material: Material, stock_mm: StockBox) -> CutSetup | None:
    """The setup, given in one way or the other; None if not given. Raises `InputError`."""
    if isinstance(cut, CutSetup):
        return cut
    if cut is not None:
        return read_setup(cut)
    if material is None and stock_mm is None:
        return None
    if material is None:
        raise InputError("--stock without --material", hint="say --material NAME, or --cut FILE with both")
    words = stock_mm if stock_mm is None or isinstance(stock_mm, str) else ",".join(map(str, stock_mm))
    return setup_of(material, words)


def cut_template(file: str | Path = "cut.toml") -> TextFile:
    """A commented setup of a cut to edit: stock, tools, coefficients, spindle; nothing is written before `save`.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.cut_template("part.toml").name
    'part'
    """
    return TextFile(Path(file).stem, template("cut.toml").replace("CUT_FILE", Path(file).name))
