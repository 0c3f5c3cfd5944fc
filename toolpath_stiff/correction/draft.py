"""An effect file drafted from a portrait: what is missing, as terms that an engineer reads and edits.

The file says what the portrait says, no more: terms that were read off the readings, at most three sizes, constants in
the open. It records the readings that it was drawn from, so that no diagnosis takes it for confirmed by them
(`inference.drawn`). The same readings and options give the same bytes.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath

from toolpath_stiff.correction.machines import data_hash
from toolpath_stiff.diagnosis.result import Diagnosis
from toolpath_stiff.hints import Asked, command_line, options
from toolpath_stiff.machine.writer import value_text
from toolpath_stiff.portrait.portrait import Portrait, Sized
from toolpath_stiff.portrait.words import portrait_text, size_words, term_words
from toolpath_stiff.readings.measurements import reading_marks
from toolpath_stiff.stiffness.sizes import joined
from toolpath_stiff.stiffness.term_effect import kind_of
from toolpath_stiff.stiffness.term_file import entry_of
from toolpath_stiff.stiffness.terms import PINS, Term, formula

WIDTH = 116  # columns of running text in the file

MARKS_A_LINE = 10


@dataclass(frozen=True)
class Draft:
    """An effect file, or why there is none.

    Attributes
    ----------
    text
        The file; "" where there is nothing to be described.
    effects
        Names of its effects.
    reason
        Why there is none, a sentence; "" where there is one.
    """

    text: str = ""
    effects: tuple[str, ...] = ()
    reason: str = ""


def draft(diagnosis: Diagnosis, file: str) -> Draft:
    """What a diagnosis leaves unexplained, as an effect file.

    Parameters
    ----------
    diagnosis
        With what it was asked.
    file
        Where it is to be written: the effect is named after it, and the commands in the file read it there.
    """
    reason = _nothing_to_describe(diagnosis)
    if reason or diagnosis.portrait is None:
        return Draft(reason=reason)
    name, asked = PurePath(file).stem, diagnosis.asked or Asked(diagnosis.names, diagnosis.machine.name)
    source = (
        f"{len(diagnosis.data)} readings of {joined(list(diagnosis.names))} "
        f"(SHA-256 {data_hash(diagnosis.names)[:16]}), machine {diagnosis.machine.name}"
    )
    drawn = asked.command("effects draft", "-o", file, *options(seed=diagnosis.seed or None))
    commands = [
        command_line("effects", "check", file),
        asked.command("diagnose", effects=[file]),
        asked.command("plan", effects=[file]),
    ]
    marks = sorted(set(reading_marks(diagnosis.data).tolist()))
    text = draft_text(name, diagnosis.portrait, source, f"Drawn by `{drawn}` from {source}.", commands, marks)
    return Draft(text, tuple(effect_names(name, [sized.term for sized in diagnosis.portrait.terms])))


def _nothing_to_describe(diagnosis: Diagnosis) -> str:
    """Why there is nothing that an effect could describe, a sentence; "" where there is something."""
    names = joined(list(diagnosis.explanations))
    if diagnosis.main.question:
        return f"{diagnosis.main.question} Nothing is drafted from readings that may be of another machine."
    if diagnosis.verdict == "adequate":
        return "Nothing is missing that these data could show: there is nothing to describe."
    if diagnosis.verdict == "described":
        return f"{names} describes these readings already: measure others, and see whether it foretells them."
    if diagnosis.verdict == "unexplained" and (diagnosis.portrait is None or not diagnosis.portrait.terms):
        return "Something is missing, but no simple form of it stands out from chance: there is nothing to write down."
    if diagnosis.portrait is None:
        word = "explains" if diagnosis.verdict == "identified" else "may explain"
        return f"{names} {word} these readings and leaves nothing that stands out: there is nothing to describe."
    terms = [sized.term for sized in diagnosis.portrait.terms]
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
    seen = [sized for sized in portrait.terms if sized.term.acts]
    entries = list(zip(sizes_of([sized.term for sized in seen]), seen, strict=True))
    alike = [f"{term_words(one.term)} ({100.0 * (one.probability or 0.0):.0f} %)" for one in portrait.alike]
    heading = ["The model lacks, by its readings (a description, no finding):", "", portrait_text(portrait)]
    if alike:
        heading += ["", "What would look the same on these readings, as far as they can tell:"]
        heading += [f"- {words}" for words in alike]
    heading += [
        "", origin, "",
        "The sizes are fitted to whatever readings you give; the constants below were read off these. Change bounds, "
        "constants and shapes into what you know of the machine (docs/effects.md). Then:", "",
        *(f"    {' '.join(command.split())}" for command in commands),
    ]  # fmt: skip
    lines = [line for paragraph in heading for line in _comment(paragraph)]
    lines += ["", f"name = {value_text(name)}", f"source = {value_text(f'described from {source}; not confirmed')}"]
    for size, sized in entries:
        lines += ["", *_comment(f"{size_words(sized)}: {formula(sized.term, size)}"), "[[effect]]"]
        lines += [f"{key} = {value_text(value)}" for key, value in entry_of(sized.term, size, _meaning(sized)).items()]
    lines += [
        "",
        "# The readings that this was drawn from, a mark each. They cannot confirm it: judged by them it is",
        "# `described`, and `identified` only when readings that are not among them foretell it.",
        "[drawn_from]",
        'readings = """',
        *(" ".join(marks[k : k + MARKS_A_LINE]) for k in range(0, len(marks), MARKS_A_LINE)),
        '"""',
    ]
    return "\n".join(lines) + "\n"


def _meaning(sized: Sized) -> str:
    return " ".join(term_words(sized.term).split())


def effect_names(name: str, terms: Sequence[Term]) -> list[str]:
    """Names of the effects in a file of these terms."""
    endings = sorted({kind_of(term).ending for term in terms if term.acts})
    return [name] if len(endings) == 1 else [f"{name}{ending}" for ending in endings]


def sizes_of(terms: Sequence[Term]) -> list[str]:
    """Names of the sizes of terms, each its own."""
    sizes: list[str] = []
    for term in terms:
        size = base = size_name(term)
        while size in sizes:
            size = f"{base}_{sum(other.startswith(base) for other in sizes) + 1}"
        sizes.append(size)
    return sizes


def size_name(term: Term) -> str:
    """What the size of a term is called: its link, which one, and its direction."""
    if term.action == "coupling":
        return f"coupling_{term.constants['first']:.0f}_{term.constants['second']:.0f}"
    place = [f"strut_{term.where}" if term.link == "one strut" else f"{term.link} {term.where or ''}"]
    if term.action == "joint offset":
        place = [f"{term.column}_joint_{term.where}"]
    if term.action == "turning" or term.action in PINS:
        place = [f"strut_{term.where}" if term.where else "", term.action]
    if term.direction not in ("reading", "along the struts") and term.action != "turning":
        place.append(term.direction)
    if term.action in ("rocking", "tilting", "reading shift"):
        place.append(term.action.removeprefix("reading "))
    return re.sub(r"\W+", "_", " ".join(place).strip().lower()).strip("_")


def _comment(text: str) -> list[str]:
    """A paragraph as comment lines; a command, which is indented, stays on one."""
    if text.startswith("    "):
        return [f"# {text}"]
    rest = "#   " if text.startswith("- ") else "# "
    plain = " ".join(text.split())
    return textwrap.wrap(
        plain, WIDTH, initial_indent="# ", subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    ) or ["#"]
