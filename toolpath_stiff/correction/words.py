"""An update in words: the verdict, what was assumed, the heading of the machine file."""

from textwrap import fill

import numpy as np

from toolpath_stiff.correction.outcome import FORCED, NOTHING, REFUSED, UpdateOutcome
from toolpath_stiff.inference.errors import LAW_REFITTED, errors_text
from toolpath_stiff.stiffness.sizes import joined

NEEDED = 1.0  # standard errors by which the error at left-out points must fall


def text(update: UpdateOutcome) -> str:
    """What was done, the cause first, then the error step by step."""
    question = f"{update.question} " if update.question else ""
    last, verdict = update.steps[-1], update.verdict
    if verdict == NOTHING:
        nothing = "These data support no further effect: the machine stays as it is."
        return f"{question}{nothing} Mean error: {_errors(update)}."
    held = 100.0 * last.held.mean_error
    errors = f"Mean error: {_errors(update)}{f' ({held:.2f} % at left-out points)' if np.isfinite(held) else ''}."
    if update.worse:
        return f"{question}The new machine would fit worse than the one given: it is not written. {errors}"
    doubted = [support for support in update.supports if not support.supported]
    against = "; ".join(f"{support.effect}: {', and '.join(support.reasons)}" for support in doubted)
    if verdict == REFUSED:
        reason = f"The data do not support {against}." if against else "The machine stays as it is."
        return f"{question}{reason} (--force, force=True, writes it all the same.) {errors}"
    unconfirmed = "" if update.described is None else f"But {update.described.reason}. "
    if verdict == FORCED:
        reason = f" ({against})" if against else ""
        return f"{question}Added by force, although the data do not support it{reason}. {unconfirmed}{errors}"
    if not last.fit.names:
        return f"Strut law refitted; no effect added. {errors}"
    cause = joined(last.fit.findings)
    word = "added" if update.described is None else "added as described, not as identified"
    return f"{cause[:1].upper()}{cause[1:]} ({joined(last.fit.names)} {word}). {unconfirmed}{errors}"


def _errors(update: UpdateOutcome) -> str:
    """Mean error of every step; of a law that is kept also what refitting it would leave."""
    steps = [(step.name.replace("+ ", "with ", 1), 100.0 * step.error) for step in update.steps]
    kept = update.refitted not in update.steps and update.task.objective == "likelihood"
    law = [(f"({LAW_REFITTED} alone)", 100.0 * update.refitted.error)] if kept else []
    return errors_text(steps[0][1], None, [*law, *steps[1:]])


def assumptions(update: UpdateOutcome) -> list[str]:
    """What the result rests on, sentences."""
    sentences = [
        f"noise: {update.noise.origin}",
        "as given, nothing is fitted, so leaving points out changes nothing: where the machine file's figures were "
        "fitted to these readings, its error at left-out points looks better than it is",
    ]
    if update.task.objective != "likelihood":
        return [
            *sentences,
            "smallest mean |modelled - measured| / measured, as the paper counts it; standard deviations by a "
            "bootstrap over the measuring points",
        ]
    sentences.append(
        f"an effect is kept if the error at left-out points falls by more than {NEEDED:g} standard error, no parameter "
        "ends at its bound, and its gain in likelihood, the strut law refitted with and without it, is beyond what "
        "the best of all candidates gains by chance once in twenty campaigns"
    )
    if update.widening > 1.0:
        sentences.append(
            f"standard deviations are {update.widening:.2f} times those of the noise model: the residuals of the last "
            "model are that much wider"
        )
    return sentences


def machine_heading(update: UpdateOutcome) -> str:
    """The remark above the machine file that an update writes."""
    return (
        f"{fill(f'Machine {update.task.machine.name}, updated. {text(update)}', 110)}\n"
        f"Command: {update.provenance['command']}\n"
        f"SHA-256 of the data: {update.provenance['data_sha256']}\n"
    )
