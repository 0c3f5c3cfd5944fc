"""An effect file drafted from a portrait: what is missing, as terms for an engineer to read and edit.

The file says what the portrait says, no more: terms that were read off the readings, at most three sizes, constants in
the open. It records the readings that it was drawn from, so that no diagnosis takes it for confirmed by them
(`inference.drawn`). The same readings and options give the same bytes.
"""

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path, PurePath
from typing import Any

from toolpath_stiff.correction.machines import data_hash
from toolpath_stiff.diagnosis.examination import Diagnosis
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.inference.judgement import NONE
from toolpath_stiff.machine.writer import value_text
from toolpath_stiff.portrait.portrait import Portrait
from toolpath_stiff.portrait.words import portrait_text, size_words, term_words
from toolpath_stiff.readings.measurements import reading_marks
from toolpath_stiff.results import TextFile
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.stiffness.term_effect import ENDINGS
from toolpath_stiff.stiffness.term_file import entry_of
from toolpath_stiff.stiffness.terms import PINS, Term, formula

WIDTH = 116  # columns of running text in the file

MARKS_A_LINE = 10


class EffectDraft(TextFile):
    """Text of an effect file for what a diagnosis leaves unexplained.

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

    def __init__(
        self, name: str, diagnosis: Diagnosis, text: str = "", effects: Sequence[str] = (), reason: str = "",
        commands: Sequence[str] = (),
    ) -> None:  # fmt: skip
        super().__init__(name, text)
        self.effects, self.reason, self.diagnosis, self.next = list(effects), reason, diagnosis, list(commands)

    def to_dict(self) -> dict[str, Any]:
        """Names and text, the verdict and the portrait; `reason` if nothing is drafted."""
        diagnosis = self.diagnosis.to_dict()
        return {
            "effect": self.name if self.text else None,
            "effects": self.effects,
            "text": self.text,
            "reason": self.reason,
            "verdict": diagnosis["verdict"],
            "portrait": diagnosis["portrait"],
            "next": self.next,
        }

    def __str__(self) -> str:
        return self.text or self.reason

    def save(self, file: str | Path) -> Path:
        """Write the file, whole or not at all; raises `InputError` if nothing is drafted."""
        if not self.text:
            raise InputError(f"nothing is drafted: {self.reason}")
        return super().save(file)


def draft(diagnosis: Diagnosis, file: str) -> EffectDraft:
    """Effect file for what a diagnosis leaves unexplained.

    Parameters
    ----------
    diagnosis
        With what it was asked.
    file
        Where it is to be written: the effect is named after it, and the commands in the file read it there.
    """
    name, portrait, names = PurePath(file).stem, diagnosis.portrait, diagnosis.names
    reason = _nothing_to_describe(diagnosis)
    if reason or portrait is None:
        return EffectDraft(name, diagnosis, reason=reason)
    request = diagnosis.asked or Asked(names, diagnosis.machine.name)
    source = (
        f"{len(diagnosis.data)} readings of {joined(names)} (SHA-256 {data_hash(names)[:16]}), "
        f"machine {diagnosis.machine.name}"
    )
    drawn = request.command("effects draft", "-o", file, *options(seed=diagnosis.seed or None))
    commands = {
        "read it, change it, then try it": command_line("effects", "check", file),
        "let it compete with the catalogue": request.command("diagnose", effects=[file]),
        "measure where it would be confirmed or refuted": request.command("plan", effects=[file]),
    }
    marks = sorted(set(reading_marks(diagnosis.data).tolist()))
    text = draft_text(name, portrait, source, f"Drawn by `{drawn}` from {source}.", list(commands.values()), marks)
    endings = sorted({ENDINGS.get(sized.term.action, "") for sized in portrait.terms if sized.term.acts})
    effects = [name] if len(endings) == 1 else [f"{name}{ending}" for ending in endings]
    return EffectDraft(name, diagnosis, text, effects, commands=[hint(*pair) for pair in commands.items()])


def _nothing_to_describe(diagnosis: Diagnosis) -> str:
    """Reason why there is nothing that an effect could describe, a sentence; "" if there is something."""
    portrait, verdict = diagnosis.portrait, diagnosis.verdict
    if diagnosis.main.question:
        return f"{diagnosis.main.question} Nothing is drafted from readings that may be of another machine."
    if verdict == "adequate" or (portrait is None and NONE in diagnosis.explanations):
        return "Nothing is missing that these data could show: there is nothing to describe."
    if verdict == "unexplained" and (portrait is None or not portrait.terms):
        return "Something is missing, but no simple form of it stands out from chance: there is nothing to write down."
    if portrait is None or verdict == "described":
        names = joined(list(diagnosis.explanations))
        return f"{names} would leave nothing of these readings that stands out: there is nothing more to describe."
    terms = [sized.term for sized in portrait.terms]
    if not any(term.acts for term in terms):
        with_what = joined(list(dict.fromkeys(name for term in terms for name in term.unseen)))
        return f"What is missing varies with {with_what}, which no effect of a machine sees: nothing is drafted."
    return ""


def draft_text(
    name: str, portrait: Portrait, source: str, origin: str, commands: Sequence[str], marks: Sequence[str]
) -> str:
    """The text of an effect file.

    Parameters
    ----------
    name
        Of the effect.
    portrait
        Of its terms, those of variables that effects see.
    source, origin
        The readings that it was read off, in words; the same as a sentence with the command.
    commands
        That check it, try it, and plan readings that it has not seen.
    marks
        Of the readings, `measurements.reading_marks`.
    """
    heading = [
        "The model lacks, by its readings (a description, no finding):", "", portrait_text(portrait), "", origin, "",
        "The sizes are fitted to whatever readings you give; the constants below were read off these. Change bounds, "
        "constants and shapes into what you know of the machine (docs/effects.md). Then:", "",
        *(f"    {' '.join(command.split())}" for command in commands),
    ]  # fmt: skip
    lines = [line for paragraph in heading for line in _comment(paragraph)]
    lines += ["", f"name = {value_text(name)}", f"source = {value_text(f'described from {source}; not confirmed')}"]
    sizes: list[str] = []
    for sized in (sized for sized in portrait.terms if sized.term.acts):
        size = base = size_name(sized.term)
        if base in sizes:
            size = f"{base}_{sum(other.startswith(base) for other in sizes) + 1}"
        sizes.append(size)
        lines += ["", *_comment(f"{size_words(sized)}: {formula(sized.term, size)}"), "[[effect]]"]
        meaning = " ".join(term_words(sized.term).split())
        lines += [f"{key} = {value_text(value)}" for key, value in entry_of(sized.term, size, meaning).items()]
    lines += [
        "",
        "# The readings that this was drawn from, a mark each. They cannot confirm it: judged by them it is",
        "# `described`, and `identified` only when readings that are not among them predict it.",
        "[drawn_from]",
        'readings = """',
        *(" ".join(marks[k : k + MARKS_A_LINE]) for k in range(0, len(marks), MARKS_A_LINE)),
        '"""',
    ]
    return "\n".join(lines) + "\n"


def size_name(term: Term) -> str:
    """Name of a term's size: its link, which one of its kind, and its direction."""
    action, strut = term.action, f"strut_{term.where}" if term.where else ""
    parts = [strut if term.link == "one strut" else f"{term.link} {term.where or ''}", term.direction]
    if action == "coupling":
        parts = [f"coupling_{term.constants['first']:.0f}_{term.constants['second']:.0f}"]
    elif action == "joint offset":
        parts[0] = f"{term.column}_joint_{term.where}"
    elif action == "turning":
        parts = [strut, action]
    elif action in PINS:
        parts = [strut, action, term.direction]
    elif action in ("rocking", "tilting", "spring", "reading shift"):
        parts.append(action.removeprefix("reading "))
    name = " ".join(part for part in parts if part not in ("reading", "along the struts"))
    return re.sub(r"\W+", "_", name.lower()).strip("_")


def _comment(text: str) -> list[str]:
    """A paragraph as comment lines; a command, which is indented, stays on one line."""
    if text.startswith("    "):
        return [f"# {text}"]
    wrapper = textwrap.TextWrapper(
        WIDTH, initial_indent="# ", subsequent_indent="# ", break_long_words=False, break_on_hyphens=False
    )
    return wrapper.wrap(" ".join(text.split())) or ["#"]
