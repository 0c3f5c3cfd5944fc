"""The model corrected: effects fitted (update), what no effect explains written as one (draft)."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from toolpath_stiff.api.effects import effect_name
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Data, NoisePercent, Question, Seed, StrutSpread
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.correction.draft import EffectDraft, draft
from toolpath_stiff.correction.result import Update
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.correction.update import update as update_machine
from toolpath_stiff.diagnosis.diagnose import diagnose
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.options import Option, checked, words_of
from toolpath_stiff.results import Progress, teller
from toolpath_stiff.stiffness.catalogue import known_effects
from toolpath_stiff.stiffness.model import build_model


@checked
def update(
    data: Data,
    machine: Machine | str | Path = "nist",
    *,
    add: Annotated[str | Iterable[str], Option("--add", "EFFECT[:KEY=VALUE,..]", count="append")] = (),
    strut_law: Annotated[bool, Option("--strut-law")] = False,
    keep_strut_law: Annotated[bool, Option("--keep-strut-law", instead_of="strut_law")] = False,
    auto: Annotated[bool, Option("--auto")] = False,
    force: Annotated[bool, Option("--force")] = False,
    objective: Annotated[str, Option("--objective", choices=("likelihood", "mean-error"))] = "likelihood",
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
        Effects to add: "weak_strut", or with what they act on, "weak_strut:strut=3".
    strut_law
        Write the refitted strut law even without an effect.
    keep_strut_law
        Keep the strut law as given; else its two stiffnesses are refitted along with every effect.
    auto
        Add effects as long as the error at left-out points falls and the data support it.
    force
        Write what the data do not support as well, never what fits worse than the machine given; and as
        --replace.
    objective
        Mean-error: the strut law alone, as the paper fitted it.
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
    >>> update = tps.update("nist-table1", "nist", strut_law=True)
    >>> update.to_frame()["name"].tolist()
    ['as given', 'strut law refitted']
    """
    question = Question(machine, data, noise_percent, strut_spread_percent, seed, columns)
    on = question.on

    def opened(corrected: Hexapod) -> Machine:
        model = replace(build_model(corrected, on.effect_files), unchecked=on.model.unchecked)
        return Machine(model, on.asked, on.effect_files, allow_unchecked_effects=on.allow_unchecked_effects)

    task = UpdateTask(
        question.model, question.readings, [add] if isinstance(add, str) else list(add), strut_law=strut_law,
        keep_strut_law=keep_strut_law, auto=auto, force=force, objective=objective, files=question.files,
        machine_file=str(machine_file), request=question.request, progress=teller(progress), **question.common,
    )  # fmt: skip
    return replace(update_machine(task), inputs=question.inputs, opened=opened)


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
        Where it will be saved: the effect is named after it. Nothing is written yet.
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
    diagnosis = replace(
        diagnose(question.model, question.readings, progress=teller(progress), **question.common),
        names=question.files,
        line=question.request.command("diagnose", *words_of(draft_effect, {"seed": seed})),
        asked=question.request,
        inputs=question.inputs,
    )
    return draft(diagnosis, str(file))
