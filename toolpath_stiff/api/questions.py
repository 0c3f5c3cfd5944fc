"""Questions about measurements: where the model fails, what it lacks, what corrects it, what to measure next."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from toolpath_stiff.api.effects import effect_name
from toolpath_stiff.api.inputs import Origin, origin_si
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Data
from toolpath_stiff.api.question import NoisePercent, Question, Seed, StrutSpread
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.comparison.compare import Comparison
from toolpath_stiff.comparison.compare import compare as compare_readings
from toolpath_stiff.correction.draft import EffectDraft, draft
from toolpath_stiff.correction.on_elements import PullTask, build_pull_ladder
from toolpath_stiff.correction.result import Update
from toolpath_stiff.correction.task import INSTRUMENT, LIKELIHOOD, MACHINE, MEAN_ERROR, UpdateTask
from toolpath_stiff.correction.update import update as update_machine
from toolpath_stiff.diagnosis.diagnose import check_measured, choice_on_path, with_plan
from toolpath_stiff.diagnosis.examination import Diagnosis
from toolpath_stiff.diagnosis.on_elements import ElementDiagnosis
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import hint
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.nc.program import Program, program_from
from toolpath_stiff.options import Option, checked, finite_number, names, numbers, words_of
from toolpath_stiff.planning.menu import COSTS, Menu
from toolpath_stiff.planning.result import Plan
from toolpath_stiff.planning.result import plan as plan_visits
from toolpath_stiff.planning.rivals import rivals_on_elements
from toolpath_stiff.results import Progress, one_of, teller
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.units import m_from_mm, rad_from_deg

COMMON = ("columns", "noise_percent", "strut_spread_percent")  # options that `Asked.command` writes


@checked
def compare(
    data: Data,
    machine: Machine | str | Path = "nist",
    *,
    columns: Mapped = None,
    noise_percent: NoisePercent = None,
    strut_spread_percent: StrutSpread = 1.0,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> Comparison | ElementDiagnosis:
    """See where the model fails: the machine as its file has it, against measurements.

    Parameters
    ----------
    data, machine
        The machine; measurements, or the files that hold them.
    columns
        Columns that the files name differently: "stiffness=stiff_mean:N/um", or such a dict.
    noise_percent
        Standard deviation of one reading, re-clamping included; or of the reading alone and of a clamping. Unless
        given, from repeats, else from the column sd_N_per_mm, else a low and a high guess.
    strut_spread_percent
        Standard deviation of the struts' stiffness.
    seed
        Seed of every random draw.
    progress
        Called with what is being done.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read; the model has no stiffness at a measured pose.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.compare("nist-table1", "nist", noise_percent=5)
    <Comparison: nist, mean error 9.62 %>
    """
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    teller(progress)("comparing")
    if question.has_pulls:
        return question.of_elements()
    comparison = compare_readings(question.model, question.readings, **question.common)
    following = hint("which effect would explain it", question.request.command("diagnose"))
    onwards = (following,) if isinstance(question.model, Hexapod) else ()
    return replace(comparison, inputs=question.inputs, summary=replace(comparison.summary, next=onwards))


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
) -> Diagnosis | ElementDiagnosis:
    """Find out which physical effect the model lacks, if any.

    Parameters
    ----------
    data, machine
        The machine, whose effect files take part; measurements, or the files that hold them.
    columns
        As of `compare`.
    noise_percent, strut_spread_percent, seed
        As of `compare`.
    program
        If several explanations remain, how much the choice matters is computed on this program.
    origin_mm_deg
        Where zero of this program (G54) sits.
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
    ('ambiguous', ['none', 'joint_moment_stiffness'], 'joint_moment_stiffness')
    >>> found.to_frame()[["effect", "probability", "mean_abs_error_percent"]].shape
    (16, 3)
    >>> list(found.files(plots=False)), len(found.to_dict()["plausible"])
    (['diagnose.json', 'residuals.csv'], 4)
    """
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    if not isinstance(question.model, Hexapod):
        if program is not None:
            raise InputError("--program, which compares explanations, is for hexapods only", hint="leave it out")
        return question.of_elements()
    on, part, origin = question.on, None if program is None else program_from(program), origin_si(origin_mm_deg)
    words = [
        *words_of(diagnose, {"program": part.file if part else None, "origin_mm_deg": origin_mm_deg, "seed": seed}),
        *words_of(Machine.under, {"setup": on.setup, "temperature_C": on.temperature_C}),
        *(part.words if part else ()),
    ]
    conditions, tell = on.running(part).conditions, teller(progress)
    diagnosis = with_plan(question.diagnosed(tell, *words, inputs=part.inputs if part else ()), tell)
    if part is None or diagnosis.verdict != "ambiguous":
        return diagnosis
    moves = part.moves(origin, question.model.default_origin)
    return replace(diagnosis, path=choice_on_path(diagnosis, moves, origin, conditions))


@checked
def update(
    data: Data,
    machine: Machine | str | Path = "nist",
    *,
    add: Annotated[str | Iterable[str], Option("--add", "EFFECT[:KEY=VALUE,..]", count="append")] = (),
    strut_law: Annotated[bool, Option("--strut-law")] = False,
    keep_strut_law: Annotated[bool, Option("--keep-strut-law", instead_of="strut_law")] = False,
    joints: Annotated[bool, Option("--joints")] = False,
    auto: Annotated[bool, Option("--auto")] = False,
    force: Annotated[bool, Option("--force")] = False,
    believe: Annotated[str | None, Option("--believe", choices=(MACHINE, INSTRUMENT))] = None,
    objective: Annotated[str, Option("--objective", choices=(LIKELIHOOD, MEAN_ERROR))] = LIKELIHOOD,
    machine_file: str | Path = "machine.toml",
    columns: Mapped = None,
    noise_percent: NoisePercent = None,
    strut_spread_percent: StrutSpread = 1.0,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> Update:
    """Fit effects to measurements, judge whether the data support them, make the machine that carries them.

    Parameters
    ----------
    data, machine
        The machine; measurements, or the files that hold them.
    add
        Effects to add: "weak_strut", or with what they act on, "weak_strut:strut=3", "joint_torsion:element=joint 3".
    strut_law
        Write the refitted strut law even without an effect, if the data support it.
    keep_strut_law
        Keep the strut law as given; otherwise it is refitted with every effect, and written if the data support it.
    joints
        On a machine of elements: refit the torsions of all rotary joints instead of the file's.
    auto
        Add effects as long as the error at left-out points falls and the data support it.
    force
        Write effects even if the data do not support them, but never a machine that fits worse than the given one;
        includes --replace.
    believe
        Which to hold responsible for an error that either could cause, machine or instrument; unless given, it is
        refused.
    objective
        What to optimise; mean-error fits the strut law alone, as the paper did.
    machine_file
        Name that the new machine file is to have, for the record.
    columns
        As of `compare`.
    noise_percent, strut_spread_percent, seed
        As of `compare`.
    progress
        Called with what is being done.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read; an effect is unknown, there already, or lacks its column; nothing is to be done.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> update = tps.update("nist-table1", "nist", strut_law=True)  # refused: no left-out point asks for another law
    >>> update.to_frame()["name"].tolist()
    ['as given', 'strut law refitted']
    """
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    options: dict[str, Any] = {
        "add": [add] if isinstance(add, str) else list(add), "keep_strut_law": keep_strut_law, "auto": auto,
        "force": force, "believe": believe, "objective": objective, "files": question.request.data,
        "machine_file": str(machine_file), "request": question.request, "progress": teller(progress), **question.common,
    }  # fmt: skip
    if isinstance(question.model, Hexapod):
        if joints:
            raise InputError("--joints is for machines of elements", hint="a hexapod's struts: --strut-law")
        result = update_machine(UpdateTask(question.model, question.readings, strut_law=strut_law, **options))
    else:
        if strut_law or keep_strut_law or objective == MEAN_ERROR:
            raise InputError(f"machine {question.model.name} has no strut law", hint="--joints refits its joints")
        problem, _ = question.pulls()
        task = PullTask(question.model, problem.pulls, strut_law=joints, pulls=problem, **options)
        result = update_machine(task, build_pull_ladder)
    return replace(result, inputs=question.inputs, opened=question.on.carrying)


@checked
def draft_effect(
    data: Data,
    machine: Machine | str | Path = "nist",
    file: str | Path = "missing.toml",
    *,
    noise_percent: NoisePercent = None,
    strut_spread_percent: StrutSpread = 1.0,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> EffectDraft:
    """Describe what a diagnosis leaves unexplained as an effect file to read, edit and put to the test.

    Parameters
    ----------
    data, machine
        The machine, whose effect files take part; measurements, or the files that hold them.
    file
        File to save it in: the effect is named after it. Nothing is written yet.
    noise_percent, strut_spread_percent, seed, progress
        As of `diagnose`.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read; too few readings; there is an effect of that name.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> drafted = tps.draft_effect("nist-table1", "nist", noise_percent=20)
    >>> drafted.reason
    'Nothing is missing that these data could show: there is nothing to describe.'
    >>> drafted.to_dict()["effect"] is None, drafted.text  # `drafted.save(FILE)` raises InputError then
    (True, '')
    """
    question = Question(machine, data, noise_percent, strut_spread_percent, seed)
    name = effect_name(file, ".toml")
    if name in known_effects(question.on.effect_files):
        raise InputError(f"effect {name} exists already", hint="give the draft another file name")
    return draft(question.diagnosed(teller(progress), *words_of(draft_effect, {"seed": seed})), str(file))


def _cost(text: str) -> tuple[str, float]:
    """Name and minutes from `pose=15`."""
    name, equals, value = text.partition("=")
    if not equals:
        raise ValueError("WHAT=MINUTES")
    return name, finite_number(value)


@checked
def plan(
    data: Data | None = None,
    machine: Machine | str | Path = "nist",
    *,
    between: Annotated[Sequence[str], Option("--between", "A,B", read=names)] = (),
    n: Annotated[int | None, Option("--n")] = None,
    radius_mm: Annotated[float | None, Option("--radius", "mm", above=0, at_most=1e5)] = None,
    heights_mm: Annotated[Sequence[float] | None, Option("--heights", "Z,Z,...", read=numbers)] = None,
    max_tilt_deg: Annotated[float | None, Option("--max-tilt", "deg", at_least=0, below=90)] = None,
    loads_N: Annotated[Sequence[float] | None, Option("--loads", "N,N,...", read=numbers)] = None,
    tool_extensions_mm: Annotated[Sequence[float] | None, Option("--tools", "MM,MM,...", read=numbers)] = None,
    setups: Annotated[Sequence[str] | None, Option("--setups", "NAME,...", read=names)] = None,
    indicators: Annotated[bool, Option("--indicators")] = False,
    minutes: Annotated[Mapping[str, float] | None, Option("--cost", "WHAT=MINUTES", read=_cost, count="append")] = None,
    columns: Mapped = None,
    noise_percent: NoisePercent = None,
    strut_spread_percent: StrutSpread = 1.0,
    seed: Seed = 0,
    diagnosis: Diagnosis | ElementDiagnosis | None = None,
) -> Plan:
    """What to measure next to tell explanations apart; without data, what to measure first.

    Parameters
    ----------
    data, machine
        The machine; measurements, or the files that hold them; None before the first campaign.
    between
        Effects to tell apart, or "none"; on elements as "joint_torsion:joint 2". Unless given, those that a diagnosis
        of the data leaves open.
    n
        Number of poses; unless given, 6, or 24 in a first campaign.
    radius_mm
        Largest distance of poses from the axis; unless given, 300 mm.
    heights_mm
        Heights of the tool tip; unless given, five levels.
    max_tilt_deg
        Largest tilt of the spindle; unless given, 25 degrees.
    loads_N
        Loads; unless given, 500, 1000, 4000 and those of the data.
    tool_extensions_mm
        Tool lengths beyond the reference tool; the first is in the spindle now. Unless given, the last one measured,
        and 150 mm.
    setups
        Set-ups, the first now on the table; unless given, those of the data.
    indicators
        Use a second indicator across a link of the load path where it tells more.
    minutes
        Cost of work: of a "reading" (1), a "pose" (15), another "tool" (10), another "setup" (45), a second
        "indicator" (10).
    columns
        As of `compare`.
    noise_percent, strut_spread_percent, seed
        As of `compare`.
    diagnosis
        A diagnosis of the same data; it is not made again then.

    Raises
    ------
    InputError, InputErrors
        A file cannot be read; an unknown effect, no reachable pose, a number that cannot be.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.plan(machine="nist", between=("spindle_compliance", "none"), n=2)
    >>> found
    <Plan: rivals, 2 clampings>
    >>> len(found.to_dict()["visits"]), found.to_frame().columns.tolist()[:6]
    (2, ['x_mm', 'y_mm', 'z_mm', 'a_deg', 'b_deg', 'c_deg'])
    >>> list(found.files(plots=False)), len(found.rows) == len(found.to_frame())
    (['plan.csv', 'plan.json'], True)
    """
    line = words_of(plan, {name: value for name, value in locals().items() if name not in COMMON})
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    minutes = {name: float(value) for name, value in (minutes or {}).items()}
    for name, value in minutes.items():
        one_of("minutes", name, tuple(COSTS))
        if not value >= 0.0:
            raise InputError(f"{name}={value:g}", expected="minutes, 0 or more")
    of_struts, pulled = isinstance(question.model, Hexapod), dict[str, Any]()
    if question.data is not None and not of_struts:
        found = diagnosis if isinstance(diagnosis, ElementDiagnosis) else question.of_elements()
        fits = sorted([found.problem.none, *found.ranked], key=lambda fit: -fit.log_posterior)
        pulled = {"rivals": rivals_on_elements(fits, found.plausible, between), "noise": found.problem.noise.typical}
    readings = question.readings if question.data is not None and of_struts else None
    if readings is not None:
        check_measured(readings.of_tip, "to plan from")
    menu = Menu.of(readings).with_options(
        radius=None if radius_mm is None else m_from_mm(radius_mm),
        heights=_in_metres(heights_mm),
        max_tilt=None if max_tilt_deg is None else rad_from_deg(max_tilt_deg),
        loads=loads_N,
        tool_extensions=_in_metres(tool_extensions_mm),
        setups=setups,
        indicators=indicators,
        costs={**COSTS, **minutes},
    )
    judgement = diagnosis.main if isinstance(diagnosis, Diagnosis) else None
    proposal = plan_visits(
        question.model, readings, menu, between=tuple(between), n=n, judgement=judgement, **question.common | pulled
    )
    command = question.request.command("plan", *line)
    return replace(proposal, names=question.request.data, line=command, inputs=question.inputs)


def _in_metres(values_mm: Sequence[float] | None) -> tuple[float, ...] | None:
    return None if values_mm is None else tuple(m_from_mm(float(value)) for value in values_mm)
