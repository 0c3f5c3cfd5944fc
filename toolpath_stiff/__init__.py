r"""Stiffness of a machine tool along an NC program: hexapods, mills, deltas, milling robots.

Everything that the commands of `tps` do is one function here, which returns one result. Lengths are in mm, angles in
degrees, forces in N, stiffnesses in N/mm; the names of arguments and columns say so.

Examples
--------
>>> import toolpath_stiff as tps
>>> machine = tps.Machine.load("nist")
>>> slot = tps.Program.from_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2", name="slot.nc")
>>> analysis = tps.analyze(slot, machine, origin_mm_deg=(0, 0, 800))
>>> round(analysis.mean_N_per_mm)
54353
"""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

from toolpath_stiff.defaults import VERSION

__version__ = VERSION

# Public name -> its module, imported when first asked for: the command line starts without numpy. The list is the one
# that type checkers read.
_HOME = {
    name: module
    for module, name in re.findall(r"^from (\S+) import (\w+)", Path(__file__).with_suffix(".pyi").read_text(), re.M)
}
__all__ = sorted([*_HOME, "__version__"])  # noqa: PLE0605  (the list above)


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return list(__all__)
