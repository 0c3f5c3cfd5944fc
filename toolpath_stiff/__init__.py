"""Stiffness of a hexapod (Stewart-platform) mill along a real NC program.

>>> import toolpath_stiff as ts
>>> machine = ts.load_machine("nist")
>>> program = ts.read_program("programs/pocket.nc")  # doctest: +SKIP
>>> analysis = ts.analyse(machine, program)  # doctest: +SKIP
>>> analysis.to_frame()[["line", "x_mm", "y_mm", "stiffness_N_per_mm"]]  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from toolpath_stiff.analysis import Analysis, analyse
    from toolpath_stiff.machine import Machine, load_machine
    from toolpath_stiff.nc import Program, parse_program, read_program
    from toolpath_stiff.stiffness.model import StiffnessModel, build_model

__version__ = "0.1.0"

# Name -> module; imported when first asked for, so that the command line starts without numpy.
_LAZY = {
    "Analysis": "toolpath_stiff.analysis",
    "Machine": "toolpath_stiff.machine",
    "Program": "toolpath_stiff.nc",
    "StiffnessModel": "toolpath_stiff.stiffness.model",
    "analyse": "toolpath_stiff.analysis",
    "build_model": "toolpath_stiff.stiffness.model",
    "load_machine": "toolpath_stiff.machine",
    "parse_program": "toolpath_stiff.nc",
    "read_program": "toolpath_stiff.nc",
}

__all__ = [
    "Analysis",
    "Machine",
    "Program",
    "StiffnessModel",
    "__version__",
    "analyse",
    "build_model",
    "load_machine",
    "parse_program",
    "read_program",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_LAZY[name]), name)
