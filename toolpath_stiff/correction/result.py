"""The result of an update: its steps, the data's support for them, in words, and the resulting machine."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from textwrap import fill
from typing import Any, ClassVar

import numpy as np

from toolpath_stiff.correction.as_built import fitted_beside
from toolpath_stiff.correction.machines import fitted_machine
from toolpath_stiff.correction.objections import insufficient_forms, not_explained, risen_conditions, worse_for_kept_law
from toolpath_stiff.correction.steps import LadderStep, Support, dispersion
from toolpath_stiff.correction.task import UpdateTask
from toolpath_stiff.diagnosis.examination import percent_of, rounded_errors
from toolpath_stiff.documents import Document, json_number, to_dict
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content, write_atomically
from toolpath_stiff.inference.adequacy import hangs_on_load
from toolpath_stiff.inference.doubts import question
from toolpath_stiff.inference.drawn import Drawn
from toolpath_stiff.inference.error_model import error_model
from toolpath_stiff.inference.errors import LAW_REFITTED, errors_text
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.machine.error_model import GEOMETRY, ErrorModel
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.results import DataFrame, FolderResult, frame_of
from toolpath_stiff.stiffness.sizes import joined

UPDATED, REFUSED, FORCED, NOTHING = "updated", "refused", "forced", "nothing added"
NEEDED = 1.0  # standard errors by which the error at left-out points must fall
# Share of the mean error, or of the part due to scatter, by which it may rise: a likelier strut law can raise
# it a little (9.62 to 9.72 % on the paper's Table 1).
WORSE = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class Update(FolderResult):
    """A machine's model corrected by measurements, or the reason why not.

    Attributes
    ----------
    task
        What was to be corrected, by what, and how.
    steps
        The ladder, from the machine file as it stands to the last model; arrays in SI.
    refitted
        The strut law refitted alone: the second step, unless the law is kept.
    supports, turned_down
        Of every effect that was asked for, or that `auto` took; of those that it tried last and did not take.
    drawn
        How effects stand whose form was read off these readings; None where there are none.
    as_built
        The machine with struts and joints where they most likely are, which is the last step; None where they stay.
    search
        Of the paper's own estimation: how its searches ended; empty otherwise.
    provenance
        Where the fitted values come from, for the record.
    next
        Commands that go on from here.
    inputs
        Files that must not be written over.
    opened
        Makes what users call a machine of the new one.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> update = tps.update("nist-table1", "nist", strut_law=True, noise_percent=5, force=True)
    >>> update
    <Update: forced, mean error 9.62 to 9.66 %>
    >>> update.accepted, update.to_dict()["objective"]
    (True, 'likelihood')
    >>> update.to_frame()["mean_abs_error_percent"].round(2).tolist()
    [9.62, 9.66]
    >>> print(update.machine_text().splitlines()[0][:24])
    # Machine nist, updated.
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = update.save_machine(pathlib.Path(folder, "mine.toml"))
    ...     tps.Machine.load(file).name == update.machine.name
    True
    >>> print(update.next[0])
    what is left:
    tps compare nist-table1 --machine machine.toml --noise 5
    >>> list(update.files(plots=False)), type(update.plot()).__name__
    (['update.json', 'residuals.csv', 'machine.toml'], 'Figure')
    """

    command: ClassVar[str] = "update"
    shown_by: ClassVar[str] = "update"

    task: UpdateTask
    steps: tuple[LadderStep, ...]
    refitted: LadderStep
    supports: tuple[Support, ...] = ()
    turned_down: tuple[Support, ...] = ()
    drawn: Drawn | None = None
    as_built: Hexapod | None = None
    search: Document = field(default_factory=dict)
    provenance: Document = field(default_factory=dict)
    next: Sequence[str] = ()
    inputs: tuple[str, ...] = ()
    opened: Callable[[Hexapod], Any] | None = None

    @property
    def noise(self) -> Noise:
        """Noise model used."""
        return self.task.noise_model

    @cached_property
    def question(self) -> str:
        """Reason to doubt that these are readings of this machine; "" if there is none."""
        return question(self.task.problem.predictor)

    @property
    def described(self) -> Drawn | None:
        """`drawn`, unless new readings have confirmed it."""
        return None if self.drawn is None or self.drawn.confirmed else self.drawn

    @property
    def last(self) -> LadderStep:
        """Last model of the ladder; the machine file as given if nothing is to change."""
        return self.steps[-1] if self.changed else self.steps[0]

    @property
    def model(self) -> LadderStep:
        """Last step that fits law and sizes, before struts and joints are moved."""
        return self.steps[-1 if self.as_built is None else -2]

    @property
    def kept_law(self) -> Support | None:
        """Judgement by which the strut law stays as given beside effects; None if the data support the refitted law."""
        return next((support for support in self.turned_down if support.effect == LAW_REFITTED), None)

    @cached_property
    def known(self) -> Fit:
        """The fit that says how well law and sizes are known, its residuals those beside the machine as it was.

        A law that stays as given is no better known for it.
        """
        kept, fit = self.changed and self.kept_law is not None, self.last.fit
        anew = self.task, fit, fit.scatter.covariance.shared, kept or fit.law_free
        return fitted_beside(*anew) if kept or self.as_built else fit

    @property
    def changed(self) -> bool:
        """True if there is something to write."""
        law = any(support.effect == LAW_REFITTED for support in self.supports)
        return bool(self.steps[-1].fit.names) or self.task.strut_law or law

    @property
    def worse(self) -> bool:
        """True if the last model fits worse than the machine as given; such a machine is never written.

        Counted by the mean error, which users see. The fit is by likelihood, which bounds the factor by which readings
        are off, not the difference: where nothing fits, the one can fall while the other multiplies.
        """
        before, after = self.steps[0].error, self.last.error
        return not after - before <= max(WORSE * before, WORSE * self.noise.floor_percent / 100.0)

    @cached_property
    def objections(self) -> list[str]:
        """Clauses on what speaks against the machine as a whole (`correction.objections`).

        Of several missing effects the user may add one at a time: that the readings are not explained yet speaks
        against what `auto` found alone.
        """
        refitted = self.steps[self.steps.index(self.model) - bool(self.kept_law)]
        return [
            *risen_conditions(self.task.data.of_tip, self.steps[0].held, self.model.held),
            *([self._unexplained] if self.task.auto and self._unexplained else []),
            *insufficient_forms(self.model, self.noise.floor_percent, unconfirmed=self.described is not None),
            *worse_for_kept_law(self.model, refitted),
        ]

    @cached_property
    def _unexplained(self) -> str:
        """Clause on readings that the changes do not explain; "" if they may."""
        return not_explained(self.task, self.model)

    @property
    def supported(self) -> bool:
        """True if nothing speaks against the changes."""
        return not self.question and not self.objections and all(support.supported for support in self.supports)

    @property
    def accepted(self) -> bool:
        """True if a machine is to be written: the data support the additions, or they were forced."""
        return self.changed and not self.worse and (self.task.force or self.supported)

    @property
    def verdict(self) -> str:
        """`UPDATED`, `REFUSED`, `FORCED` or `NOTHING`."""
        if not self.changed:
            return NOTHING
        if not self.accepted:
            return REFUSED
        return UPDATED if self.supported else FORCED

    @property
    def widening(self) -> float:
        """Factor on standard deviations: width of the residuals over that of the noise model, at least 1."""
        # A bootstrap over points already has the width of the residuals.
        return 1.0 if self.search else float(np.sqrt(dispersion(self.known)))

    @cached_property
    def errors(self) -> ErrorModel | None:
        """Error of the last model to expect at a pose; None if too little was measured to tell."""
        if self.search:
            return None
        given, problem = self.last.fit if self.kept_law else None, self.task.problem
        geometry = problem.scatter.covariance.shared[:GEOMETRY]
        errors = error_model(self.known, problem.predictor.data, self.noise, geometry, given)
        by_load = 0.0 if errors is None or given else hangs_on_load(problem, self.model.fit)
        load = float(self.task.data.of_tip.force[0])
        return replace(errors, load=load, by_load=by_load) if errors and by_load else errors

    @cached_property
    def corrected(self) -> Hexapod | None:
        """The machine with the last model; None if nothing is to be written."""
        return self.fitted(self.provenance) if self.accepted else None

    def fitted(self, provenance: Document) -> Hexapod:
        """The machine with the last model; `provenance` states its origin."""
        setups = self.task.data.setup.tolist()
        machine, fit = self.as_built or self.task.machine, self.last.fit
        return fitted_machine(machine, fit, provenance, self.widening, setups, self.errors, self.known)

    def _written(self) -> Hexapod:
        if self.corrected is None:
            hint = "" if self.worse else "force=True keeps it all the same"
            raise InputError(f"the update was refused: {self.text}", hint=hint)
        return self.corrected

    @property
    def machine(self) -> Any:
        """The machine with the additions; raises `InputError` if they were refused."""
        machine = self._written()
        return machine if self.opened is None else self.opened(machine)

    def machine_text(self) -> str:
        """Text of the new machine file, with the origin of its fitted values; raises `InputError` if refused."""
        heading = (
            f"{fill(f'Machine {self.task.machine.name}, updated. {self.text}', 110)}\n"
            f"Command: {self.provenance['command']}\n"
            f"SHA-256 of the data: {self.provenance['data_sha256']}\n"
        )
        return self._text_of(self._written(), heading)

    def _text_of(self, machine: Any, heading: str) -> str:
        return machine_toml(machine, heading)

    def save_machine(self, file: str | Path) -> Path:
        """Write the new machine file, whole or not at all."""
        return write_atomically(file, self.machine_text())

    def files(self, *, plots: bool = True, machine: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """Files that `tps update` writes; the machine file only with `machine`."""
        return self._files(plots, [] if machine and self.accepted else ["machine.toml"])

    def _short(self) -> str:
        first, last = (100.0 * step.error for step in (self.steps[0], self.steps[-1]))
        return f"{self.verdict}, mean error {first:.2f} to {last:.2f} %"

    def to_frame(self) -> DataFrame:
        """The steps, one a row: as given, strut law refitted, each effect; errors in per cent."""
        return frame_of(self.document["steps"])

    def to_dict(self) -> dict[str, Any]:
        """Content of update.json."""
        return dict(self.document)

    @cached_property
    def document(self) -> Document:
        """Content of update.json."""
        task, predictor, law = self.task, self.task.problem.predictor, self.task.machine.strut_law
        before = (None, *self.steps)
        steps = [step.document(law, self.widening, before[k]) for k, step in enumerate(self.steps)]
        uncertainty = None if self.corrected is None else self.corrected.uncertainty
        return {
            "verdict": self.verdict,
            "text": self.text,
            "question": self.question,
            "objective": task.objective,
            "baseline": steps[0],
            "strut_law_refitted": rounded_errors(self.refitted.residual),
            "steps": steps,
            "support": to_dict(self.supports),
            "described": [] if self.described is None else list(self.described.names),
            "rejected": to_dict(self.turned_down),
            "noise_percent": percent_of(self.noise.typical),
            "noise_floor_percent": json_number(self.noise.floor_percent),
            "noise": {"name": self.noise.name, "origin": self.noise.origin},
            "widening": json_number(self.widening),
            "uncertainty": None
            if uncertainty is None
            else {
                "parameters": list(uncertainty.names),
                "sd": [json_number(sd) for sd in uncertainty.sd.tolist()],
                "correlation": [[json_number(x, 3) for x in row] for row in uncertainty.correlation.tolist()],
            },
            "assumptions": self.assumptions,
            "warnings": list(predictor.data.warnings),
            "notes": list(task.data.notes),
            "machine": task.machine.name,
            "effects": predictor.effects_that_act,
            "machine_file": task.machine_file if self.accepted else None,
            "data": list(task.files),
            "readings": len(task.data.of_tip),
            "provenance": dict(self.provenance),
            "seed": task.seed,
            "next": list(self.next),
            **({"search": self.search} if self.search else {}),
        }

    @property
    def text(self) -> str:
        """Sentences on what was done, the cause first, then the error step by step."""
        doubt = f"{self.question} " if self.question else ""
        last, verdict = self.steps[-1], self.verdict
        if verdict == NOTHING:
            nothing = "These data support no further effect: the machine stays as it is."
            return f"{doubt}{nothing} Mean error: {self._errors}."
        held = 100.0 * last.held.mean_error
        errors = f"Mean error: {self._errors}{f' ({held:.2f} % at left-out points)' if np.isfinite(held) else ''}."
        doubted = [support for support in self.supports if not support.supported]
        doubts = [*(f"{support.effect}: {', and '.join(support.reasons)}" for support in doubted), *self.objections]
        against = "; ".join(doubts)
        reason = f" ({against})" if against else ""
        if self.worse:
            return f"{doubt}The new machine would fit worse than the one given: it is not written{reason}. {errors}"
        if verdict == REFUSED:
            stays = f"The data speak against it: {against}." if against else "The machine stays as it is."
            return f"{doubt}{stays} (--force, force=True, writes it all the same.) {errors}"
        unconfirmed = "" if self.described is None else f"But {self.described.reason}. "
        if verdict == FORCED:
            return f"{doubt}Added by force, although the data do not support it{reason}. {unconfirmed}{errors}"
        if not last.fit.names:
            return f"Strut law refitted; no effect added. {errors}"
        cause = self.cause
        word = "added" if self.described is None else "added as described, not as identified"
        law = f"The strut law stays as given: {'; '.join(self.kept_law.reasons)}. " if self.kept_law else ""
        return f"{cause[:1].upper()}{cause[1:]} ({joined(self.added)} {word}). {law}{unconfirmed}{errors}"

    @property
    def cause(self) -> str:
        """Words on what was fitted."""
        return joined(self.steps[-1].fit.findings)

    @property
    def added(self) -> Sequence[str]:
        """Names of the effects added."""
        return self.steps[-1].fit.names

    @property
    def _errors(self) -> str:
        """Mean error of every step; if the law is kept, also the error that refitting it would leave."""
        steps = [(step.name.replace("+ ", "with ", 1), 100.0 * step.error) for step in self.steps]
        kept = LAW_REFITTED not in [step.name for step in self.steps] and not self.search
        law = [(f"({LAW_REFITTED} alone)", 100.0 * self.refitted.error)] if kept else []
        return errors_text(steps[0][1], None, [*law, *steps[1:]])

    @property
    def assumptions(self) -> list[str]:
        """Sentences on what the result rests on."""
        sentences = [
            f"noise: {self.noise.origin}",
            "as given, nothing is fitted, so leaving points out changes nothing: where the machine file's figures were "
            "fitted to these readings, its error at left-out points looks better than it is",
        ]
        loads = np.unique(self.task.data.of_tip.force)
        if self.changed and len(loads) == 1:
            sentences.append(
                f"all readings are under {loads[0]:g} N; at other loads the stiffness is taken to be the same"
            )
        if self.changed and not (self.task.auto or self.search) and self._unexplained:
            sentences.append(f"{self._unexplained}; what else is missing acts along a path, too")
        if self.search:
            return [
                *sentences,
                "smallest mean |modelled - measured| / measured, as the paper counts it; standard deviations by a "
                "bootstrap over the measuring points",
            ]
        sentences.append(
            f"an effect is kept if the error at left-out points falls by more than {NEEDED:g} standard error, no "
            "parameter ends at its bound, and its gain in likelihood is beyond what the best of all candidates gains "
            "by chance once in twenty campaigns: the strut law refitted with and without it, or kept with and without "
            "it where a refitted one predicts left-out points no better"
        )
        if self.widening > 1.0:
            sentences.append(
                f"standard deviations are {self.widening:.2f} times those of the noise model: the residuals of the "
                "last model are that much wider"
            )
        return sentences
