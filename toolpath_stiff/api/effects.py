"""The physical effects that a machine can carry: the catalogue, and one's own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.api.diagnosis import Data, NoisePercent, Question, Seed, StrutSpread
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import options
from toolpath_stiff.options import checked
from toolpath_stiff.results import Progress, teller

if TYPE_CHECKING:
    from toolpath_stiff.correction.draft import EffectDraft
    from toolpath_stiff.stiffness.catalogue import EffectCatalogue
    from toolpath_stiff.stiffness.effect_file import EffectFile
    from toolpath_stiff.stiffness.trial import EffectCheck


def effects(files: Iterable[str | Path] = ()) -> EffectCatalogue:
    """The effects that a machine can carry: the catalogue's, plug-ins', those in files of one's own.

    Raises
    ------
    InputError
        A file cannot be loaded.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.effects()["weak_strut"].title
    'one strut is weak'
    """
    from toolpath_stiff.stiffness.catalogue import EffectCatalogue, installed_effects, known_effects

    return EffectCatalogue(list(known_effects(list(map(str, files))).values()), installed_effects()[1])


def check_effects(file: str | Path, machine: Machine | str | Path = "nist") -> EffectCheck:
    """Try the effects of a file against the contract, on a machine.

    Raises
    ------
    InputError
        The file cannot be loaded, or names an effect that there is already.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = tps.effect_template("my_screw").save(pathlib.Path(folder, "my_screw.py"))
    ...     tps.check_effects(file).passed
    True
    """
    from toolpath_stiff.stiffness.catalogue import effects_from_file, known_effects
    from toolpath_stiff.stiffness.trial import EffectCheck, try_effect

    on = machine_from(machine)
    model = on.model.given or on.model.machine
    known_effects([str(file)])  # names that are taken
    trials = [try_effect(effect, model) for effect in effects_from_file(str(file)).values()]
    return EffectCheck(str(file), on.name, trials)


def effect_template(name: str) -> EffectFile:
    """A commented, working example of an effect to change into one's own.

    Parameters
    ----------
    name
        Of the effect and of its file without the ending.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.effect_template("my_screw").name
    'my_screw'
    """
    from importlib import resources

    from toolpath_stiff.stiffness.effect_file import EffectFile

    if not name.isidentifier():
        raise InputError(f"{name!r} cannot be an effect's name", expected="a name such as my_screw")
    text = (resources.files("toolpath_stiff") / "data" / "templates" / "effect.py.txt").read_text("utf-8")
    return EffectFile(name, text.replace("EFFECT_NAME", name).replace("EFFECT_FILE", f"{name}.py"))


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
    from toolpath_stiff.correction.draft import draft
    from toolpath_stiff.diagnosis.diagnose import diagnose
    from toolpath_stiff.stiffness.catalogue import known_effects

    question = Question(machine, data, noise_percent, strut_spread_percent, seed)
    name = effect_name(file, ".toml")
    if name in known_effects(question.on.effect_files):
        raise InputError(f"effect {name} exists already", hint="give the draft another file name")
    diagnosis = replace(
        diagnose(question.model, question.readings, progress=teller(progress), **question.common),
        names=question.files,
        line=question.request.command("diagnose", *options(seed=seed or None)),
        asked=question.request,
        inputs=question.inputs,
    )
    return draft(diagnosis, str(file))


def effect_name(file: str | Path, ending: str = ".py") -> str:
    """The name of the effect that a file is to hold: the file's own, without the ending."""
    path = Path(file)
    if path.suffix != ending or not path.stem.isidentifier():
        raise InputError(f"{str(file)!r} cannot hold an effect", expected=f"a name such as my_screw{ending}")
    return path.stem
