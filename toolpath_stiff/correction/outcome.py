"""The outcome of an update: the steps, what the data support of them, and the machine that comes of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from toolpath_stiff.correction.machines import fitted_machine
from toolpath_stiff.correction.steps import LadderStep, Support, dispersion
from toolpath_stiff.correction.strut_law import BarCurve, StrutLawSearch
from toolpath_stiff.correction.task import LIKELIHOOD, UpdateTask
from toolpath_stiff.documents import Document
from toolpath_stiff.inference.drawn import Drawn
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.machine.model import Hexapod

UPDATED, REFUSED, FORCED, NOTHING = "updated", "refused", "forced", "nothing added"
# Share of the mean error, or of what scatter alone leaves of it, by which it may rise: a likelier strut law can raise
# it a little (9.62 to 9.72 % on the paper's Table 1).
WORSE = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class UpdateOutcome:
    """The steps of an update, judged.

    Attributes
    ----------
    task
        What was to be corrected, by what, and how.
    noise, problem
        The largest of the noise models; model and scatter.
    steps
        The ladder, from the machine file as it stands to the last model; arrays in SI.
    refitted
        The strut law refitted alone: the second step, unless the law is kept.
    supports, turned_down
        Of every effect that was asked for, or that `auto` took; of those that it tried last and did not take.
    question
        That these are hardly readings of this machine, and why; "" where nothing says so.
    drawn
        How effects stand whose form was read off these readings; None where there are none.
    search, bars
        Of the paper's own estimation: how its searches ended; its Figure 3. None otherwise.
    provenance
        Where the fitted values come from, for the record.
    next
        Commands that go on from here.
    """

    task: UpdateTask
    noise: Noise
    problem: Problem
    steps: tuple[LadderStep, ...]
    refitted: LadderStep
    supports: tuple[Support, ...] = ()
    turned_down: tuple[Support, ...] = ()
    question: str = ""
    drawn: Drawn | None = None
    search: StrutLawSearch | None = None
    bars: BarCurve | None = None
    provenance: Document = field(default_factory=dict)
    next: Sequence[str] = ()

    @property
    def described(self) -> Drawn | None:
        """`drawn`, if new readings have not confirmed it."""
        return None if self.drawn is None or self.drawn.confirmed else self.drawn

    @property
    def last(self) -> LadderStep:
        """The last model of the ladder; the machine file as given where nothing is to be changed."""
        return self.steps[-1] if self.changed else self.steps[0]

    @property
    def changed(self) -> bool:
        """True where there is something to be written."""
        return bool(self.steps[-1].fit.names) or self.task.strut_law

    @property
    def worse(self) -> bool:
        """True where the last model fits worse than the machine as given; such a machine is never written.

        Counted by the mean error, which users see. The fit is by likelihood, which bounds the factor by which readings
        are off, not the difference: where nothing fits, the one can fall while the other multiplies.
        """
        before, after = self.steps[0].error, self.steps[-1].error
        return not after - before <= max(WORSE * before, WORSE * self.noise.floor_percent / 100.0)

    @property
    def supported(self) -> bool:
        """True where nothing speaks against what is to be changed."""
        return not self.question and all(support.supported for support in self.supports)

    @property
    def accepted(self) -> bool:
        """True where a machine is to be written: the data support what was added, or it was forced."""
        return self.changed and not self.worse and (self.task.force or self.supported)

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        if not self.changed:
            return NOTHING
        if not self.accepted:
            return REFUSED
        return UPDATED if self.supported else FORCED

    @property
    def widening(self) -> float:
        """Factor on standard deviations: how much wider the residuals are than the noise model says, at least 1."""
        # A bootstrap over points has the residuals' own width already.
        return float(np.sqrt(dispersion(self.last.fit))) if self.task.objective == LIKELIHOOD else 1.0

    @cached_property
    def corrected(self) -> Hexapod | None:
        """The machine with the last model; None where nothing is to be written."""
        return self.fitted(self.provenance) if self.accepted else None

    def fitted(self, provenance: Document) -> Hexapod:
        """The machine with the last model, which comes from there."""
        return fitted_machine(
            self.task.machine, self.last.fit, provenance, self.widening, self.task.data.setup.tolist()
        )
