"""The physical effect that a machine lacks, if any."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from toolpath_stiff.api.inputs import Origin, origin_si
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.diagnosis.diagnose import choice_on_path, with_plan
from toolpath_stiff.diagnosis.diagnose import diagnose as diagnose_readings
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.options import Option, checked, words_of
from toolpath_stiff.placement.case_study import case_study_program
from toolpath_stiff.results import Progress, teller

if TYPE_CHECKING:
    pass


from toolpath_stiff.api.measurements import Data, NoisePercent, Question, Seed, StrutSpread


@checked
def diagnose(
    data: Data,
    machine: Machine | str | Path = "nist",
    *,
    columns: Mapped = None,
    noise_percent: NoisePercent = None,
    strut_spread_percent: StrutSpread = 1.0,
    seed: Seed = 0,
    program: Annotated[Program | str | Path | None, Option("--program", "PROGRAM")] = None,
    origin_mm_deg: Origin = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find out which physical effect the model lacks, if any.

    Parameters
    ----------
    data, machine
        The machine, whose effect files take part; measurements, or the files that hold them.
    columns
        As of `compare`.
    noise_percent, strut_spread_percent, seed
        As of `compare`.
    program, origin_mm_deg
        Where several explanations remain, how much the choice matters is worked out on this program, placed there;
        unless given, on the packaged case study.
    progress
        Called with what is being done.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read; too few readings.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.diagnose("nist-table1", "nist", noise_percent=20)
    >>> found.verdict, found.plausible[:2], found.best
    ('adequate', ['none', 'joint_moment_stiffness'], 'joint_moment_stiffness')
    >>> found.to_frame()[["effect", "probability", "mean_abs_error_percent"]].shape
    (12, 3)
    >>> list(found.files(plots=False)), len(found.to_dict()["plausible"])
    (['diagnose.json', 'residuals.csv'], 6)
    """
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    part = None if program is None else program_from(program)
    origin, conditions = origin_si(origin_mm_deg), question.on.running(part).conditions
    circumstances = [
        *words_of(diagnose, {"program": part.file if part else None, "origin_mm_deg": origin_mm_deg, "seed": seed}),
        *words_of(Machine.under, {"setup": question.on.setup, "temperature_C": question.on.temperature_C}),
        *(part.words if part else ()),
    ]
    tell = teller(progress)
    diagnosis = replace(
        with_plan(diagnose_readings(question.model, question.readings, progress=tell, **question.common), tell),
        names=question.files,
        line=question.request.command("diagnose", *circumstances),
        asked=question.request,
        inputs=(*question.inputs, *(part.inputs if part else ())),
    )
    if diagnosis.verdict != "ambiguous":
        return diagnosis
    moves = case_study_program() if part is None else part.moves(origin, question.model.default_origin)
    return replace(diagnosis, path=choice_on_path(diagnosis, moves, origin, conditions))
