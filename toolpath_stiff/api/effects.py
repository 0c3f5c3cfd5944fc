"""The physical effects that a machine can carry: the catalogue, and one's own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.api.diagnosis import Data, NoisePercent, Question, Seed, StrutSpread
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.options import checked
from toolpath_stiff.results import Progress, TextFile, teller

if TYPE_CHECKING:
    from toolpath_stiff.correction.draft import Draft
    from toolpath_stiff.diagnosis.result import Diagnosis
    from toolpath_stiff.stiffness.catalogue import EffectCatalogue
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


class EffectFile(TextFile):
    """The text of a file with an effect.

    Attributes
    ----------
    name, text
        The effect's name; the file.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> template = tps.effect_template("my_screw")
    >>> template.to_dict()["effect"], template.text == str(template)
    ('my_screw', True)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = template.save(pathlib.Path(folder, "my_screw.py"))
    ...     tps.effects([file])["my_screw"].link
    'struts'
    """

    command: ClassVar[str] = "effects"

    def to_dict(self) -> dict[str, Any]:
        """Name and text."""
        return {"effect": self.name, "text": self.text}


class EffectDraft(EffectFile):
    """What a diagnosis leaves unexplained, as the text of an effect file.

    Attributes
    ----------
    name, text
        Name of the effect; the file, "" where there is nothing to describe.
    effects
        Names of all effects in it.
    reason
        Why nothing is drafted, a sentence; "" where something is.
    diagnosis
        The diagnosis that it was drawn from.
    next
        Commands that go on from here.
    """

    def __init__(self, name: str, draft: Draft, diagnosis: Diagnosis, commands: Sequence[str]) -> None:
        super().__init__(name, draft.text)
        self.effects, self.reason = list(draft.effects), draft.reason
        self.diagnosis, self.next = diagnosis, list(commands) if draft.text else []

    def to_dict(self) -> dict[str, Any]:
        """Names and text, the verdict and the portrait; `reason` where nothing is drafted."""
        document = self.diagnosis.to_dict()
        return {
            "effect": self.name if self.text else None,
            "effects": self.effects,
            "text": self.text,
            "reason": self.reason,
            "verdict": document["verdict"],
            "portrait": document["portrait"],
            "next": self.next,
        }

    def __str__(self) -> str:
        return self.text or self.reason

    def _short(self) -> str:
        return super()._short() if self.text else self.reason

    def save(self, file: str | Path) -> Path:
        """Write the file, whole or not at all; raises `InputError` where nothing is drafted."""
        if not self.text:
            raise InputError(f"nothing is drafted: {self.reason}")
        return super().save(file)


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
    >>> found = tps.draft_effect("nist-table1", "nist", noise_percent=20)
    >>> found.reason
    'Nothing is missing that these data could show: there is nothing to describe.'
    >>> found.to_dict()["effect"] is None, found.text  # `found.save(FILE)` raises InputError then
    (True, '')
    """
    from toolpath_stiff.correction.draft import draft
    from toolpath_stiff.diagnosis.diagnose import diagnose
    from toolpath_stiff.stiffness.catalogue import known_effects

    question = Question(machine, data, noise_percent, strut_spread_percent, seed)
    name = effect_name(file, ".toml")
    if name in known_effects(question.on.effect_files):
        raise InputError(f"effect {name} exists already", hint="give the draft another file name")
    how = {"names": question.files, "progress": teller(progress), **question.common}
    diagnosis = diagnose(question.model, question.readings, plan_next=False, **how)
    line = question.asked.command("diagnose", *options(seed=seed or None))
    diagnosis = replace(diagnosis, line=line, asked=question.asked, inputs=question.inputs)
    drafted = draft(diagnosis, str(file))
    return EffectDraft(name, drafted, diagnosis, next_of_draft(question.asked, str(file)))


def effect_name(file: str | Path, ending: str = ".py") -> str:
    """The name of the effect that a file is to hold: the file's own, without the ending."""
    path = Path(file)
    if path.suffix != ending or not path.stem.isidentifier():
        raise InputError(f"{str(file)!r} cannot hold an effect", expected=f"a name such as my_screw{ending}")
    return path.stem


def next_of_draft(asked: Asked, file: str) -> list[str]:
    """What to do with a drafted file, as hints."""
    return [
        hint("read it, change it, then try it", command_line("effects", "check", file)),
        hint("let it compete with the catalogue", asked.command("diagnose", effects=[file])),
        hint("measure where it would show, or fail", asked.command("plan", effects=[file])),
    ]
