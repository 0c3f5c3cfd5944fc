r"""Stiffness of a hexapod (Stewart-platform) mill along a real NC program.

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

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from toolpath_stiff.defaults import VERSION as _VERSION

if TYPE_CHECKING:
    from toolpath_stiff.analysis.grid import StiffnessMap as StiffnessMap
    from toolpath_stiff.analysis.machine_check import MachineCheck as MachineCheck
    from toolpath_stiff.analysis.poses import PoseStiffness as PoseStiffness
    from toolpath_stiff.analysis.program_check import ProgramCheck as ProgramCheck
    from toolpath_stiff.analysis.results import Analysis as Analysis
    from toolpath_stiff.api.by_hand import Preview as Preview
    from toolpath_stiff.api.by_hand import preview as preview
    from toolpath_stiff.api.case_studies import case_study as case_study
    from toolpath_stiff.api.comparison import compare as compare
    from toolpath_stiff.api.correction import draft_effect as draft_effect
    from toolpath_stiff.api.correction import update as update
    from toolpath_stiff.api.diagnosis import diagnose as diagnose
    from toolpath_stiff.api.effects import check_effects as check_effects
    from toolpath_stiff.api.effects import effect_template as effect_template
    from toolpath_stiff.api.effects import effects as effects
    from toolpath_stiff.api.machine_files import MachineFile as MachineFile
    from toolpath_stiff.api.machine_files import machine_from_linuxcnc as machine_from_linuxcnc
    from toolpath_stiff.api.machine_files import machine_template as machine_template
    from toolpath_stiff.api.machine_files import recover_geometry as recover_geometry
    from toolpath_stiff.api.machines import Machine as Machine
    from toolpath_stiff.api.many import ManyAnalyses as ManyAnalyses
    from toolpath_stiff.api.many import analyze_many as analyze_many
    from toolpath_stiff.api.measurements import Measurements as Measurements
    from toolpath_stiff.api.placements import PlacementTrial as PlacementTrial
    from toolpath_stiff.api.placements import place as place
    from toolpath_stiff.api.placements import rewrite as rewrite
    from toolpath_stiff.api.placements import try_placement as try_placement
    from toolpath_stiff.api.planning import plan as plan
    from toolpath_stiff.api.poses import map_stiffness as map_stiffness
    from toolpath_stiff.api.poses import pose as pose
    from toolpath_stiff.api.poses import read_poses as read_poses
    from toolpath_stiff.api.programs import analyze as analyze
    from toolpath_stiff.api.programs import check as check
    from toolpath_stiff.api.programs import sample_path as sample_path
    from toolpath_stiff.case.case import Case as Case
    from toolpath_stiff.comparison.compare import Comparison as Comparison
    from toolpath_stiff.correction.draft import EffectDraft as EffectDraft
    from toolpath_stiff.correction.result import Update as Update
    from toolpath_stiff.diagnosis.result import Diagnosis as Diagnosis
    from toolpath_stiff.errors import EffectError as EffectError
    from toolpath_stiff.errors import EffectFault as EffectFault
    from toolpath_stiff.errors import FileError as FileError
    from toolpath_stiff.errors import InputError as InputError
    from toolpath_stiff.errors import InputErrors as InputErrors
    from toolpath_stiff.errors import MachineFileError as MachineFileError
    from toolpath_stiff.errors import MeasurementError as MeasurementError
    from toolpath_stiff.errors import PoseError as PoseError
    from toolpath_stiff.errors import ProgramError as ProgramError
    from toolpath_stiff.errors import TableError as TableError
    from toolpath_stiff.errors import TpsError as TpsError
    from toolpath_stiff.errors import UnreachableError as UnreachableError
    from toolpath_stiff.nc.program import Program as Program
    from toolpath_stiff.path.table import SampledPath as SampledPath
    from toolpath_stiff.placement.case_study import CaseStudy as CaseStudy
    from toolpath_stiff.placement.keep_out import KeepOut as KeepOut
    from toolpath_stiff.placement.result import Placement as Placement
    from toolpath_stiff.planning.next_visit import NextVisit as NextVisit
    from toolpath_stiff.planning.next_visit import next_visit as next_visit
    from toolpath_stiff.planning.result import Plan as Plan
    from toolpath_stiff.readings.raw import Reduction as Reduction
    from toolpath_stiff.readings.raw import reduce as reduce
    from toolpath_stiff.rewriting.program import RewrittenProgram as RewrittenProgram
    from toolpath_stiff.stiffness.catalogue import EffectCatalogue as EffectCatalogue
    from toolpath_stiff.stiffness.contract import Effect as Effect
    from toolpath_stiff.stiffness.contract import Parameter as Parameter
    from toolpath_stiff.stiffness.effect_file import EffectFile as EffectFile
    from toolpath_stiff.stiffness.trial import EffectCheck as EffectCheck

__version__ = _VERSION

# Module -> its public names; imported when first asked for: the command line starts without numpy.
_PUBLIC = {
    "analysis.grid": ("StiffnessMap",),
    "analysis.machine_check": ("MachineCheck",),
    "analysis.poses": ("PoseStiffness",),
    "analysis.program_check": ("ProgramCheck",),
    "analysis.results": ("Analysis",),
    "api.by_hand": ("Preview", "preview"),
    "api.case_studies": ("case_study",),
    "api.comparison": ("compare",),
    "api.correction": ("draft_effect", "update"),
    "api.diagnosis": ("diagnose",),
    "api.effects": ("check_effects", "effect_template", "effects"),
    "api.machine_files": ("MachineFile", "machine_from_linuxcnc", "machine_template", "recover_geometry"),
    "api.machines": ("Machine",),
    "api.many": ("ManyAnalyses", "analyze_many"),
    "api.measurements": ("Measurements",),
    "api.placements": ("PlacementTrial", "place", "rewrite", "try_placement"),
    "api.planning": ("plan",),
    "api.poses": ("map_stiffness", "pose", "read_poses"),
    "api.programs": ("analyze", "check", "sample_path"),
    "case.case": ("Case",),
    "comparison.compare": ("Comparison",),
    "correction.draft": ("EffectDraft",),
    "correction.result": ("Update",),
    "diagnosis.result": ("Diagnosis",),
    "errors": (
        "EffectError", "EffectFault", "FileError", "InputError", "InputErrors", "MachineFileError", "MeasurementError",
        "PoseError", "ProgramError", "TableError", "TpsError", "UnreachableError",
    ),
    "nc.program": ("Program",),
    "path.table": ("SampledPath",),
    "placement.case_study": ("CaseStudy",),
    "placement.keep_out": ("KeepOut",),
    "placement.result": ("Placement",),
    "planning.next_visit": ("NextVisit", "next_visit"),
    "planning.result": ("Plan",),
    "readings.raw": ("Reduction", "reduce"),
    "rewriting.program": ("RewrittenProgram",),
    "stiffness.catalogue": ("EffectCatalogue",),
    "stiffness.contract": ("Effect", "Parameter"),
    "stiffness.effect_file": ("EffectFile",),
    "stiffness.trial": ("EffectCheck",),
}  # fmt: skip
_HOME = {name: module for module, names in _PUBLIC.items() for name in names}

__all__ = sorted([*_HOME, "__version__"])  # noqa: PLE0605  (the table above is the list)


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
