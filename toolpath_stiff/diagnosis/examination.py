"""What a diagnosis has found: judgements under each noise model, fits, errors held out, and what stands behind them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.loop_readings import LoopMean
from toolpath_stiff.hints import Asked
from toolpath_stiff.inference.confounding import Confounding
from toolpath_stiff.inference.detectable import Detectable
from toolpath_stiff.inference.drawn import Drawn
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.judgement import Judgement
from toolpath_stiff.inference.left_out import HeldOut
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.slips import SuspectEntry
from toolpath_stiff.inference.unexcluded import Unexcluded
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.portrait.alike import Alike
from toolpath_stiff.portrait.portrait import Portrait
from toolpath_stiff.readings.measurements import Readings

NAMING = ("identified", "described")  # verdicts that give one explanation as the answer


@dataclass(frozen=True, eq=False, repr=False)
class Examination:
    """Which physical effect the model lacks, if any, and what stands behind it; arrays in SI.

    Attributes
    ----------
    verdict, plausible
        Common to all noise models; see `inference.judgement`.
    judgements
        Name of the noise model -> judgement. The one that is written out in full is `main`.
    main
        The judgement of the measured or stated noise, else of the high guess.
    data, machine
        What was diagnosed.
    cannot_test
        Effect -> missing columns; empty where nothing in these data depends on the effect.
    as_given, base, fits
        The machine file as it stands; its strut law refitted; effect or "a + b" -> final fit of all that were offered.
    held_out_base, held_out
        Errors at left-out points.
    confounding, detectable
        What these data cannot tell apart, and what they would have shown.
    names, seed, line, asked, inputs
        For the record, and for the commands that go on from here: names of the measurement files, the command; files
        that were read.
    next_measurements, remarks
        Where the verdict is `ambiguous`: rows of a plan that would tell the explanations apart; what it cannot do.
        Where it is `described`: of a plan that would confirm it.
    path
        How much the choice between the explanations matters on a program (`choice_on_path`); None where there is none.
    portrait
        What the missing thing looks like (`portrait_of`); None where nothing is missing or left behind.
    alike
        What else would look the same as the effect that is named (`alike_of`); None where nothing would, or none is.
    unexcluded
        Effects that the readings neither show nor exclude beside the likeliest explanation, at a size that matters.
    suspects
        Rows that look mistyped; `data` no longer holds those that are clear.
    loops
        Readings of indicators beside the tip against the likeliest explanation. Everything above with an entry a
        reading is of those of the tip.
    """

    verdict: str
    plausible: list[str]
    judgements: dict[str, Judgement]
    main: Judgement
    data: Readings
    machine: Hexapod
    cannot_test: dict[str, tuple[str, ...]]
    as_given: Fit
    base: Fit
    fits: dict[str, Fit]
    held_out_base: HeldOut
    held_out: dict[str, HeldOut]
    confounding: Confounding
    detectable: tuple[Detectable, ...]
    names: tuple[str, ...]
    seed: int
    line: str = ""
    asked: Asked | None = None
    next_measurements: tuple[dict[str, Any], ...] = ()
    remarks: tuple[str, ...] = ()
    path: dict[str, Any] | None = None
    portrait: Portrait | None = None
    alike: Alike | None = None
    unexcluded: tuple[Unexcluded, ...] = ()
    suspects: tuple[SuspectEntry, ...] = ()
    loops: tuple[LoopMean, ...] = ()
    inputs: tuple[str, ...] = ()

    @property
    def noise(self) -> Noise:
        """The noise model of `main`."""
        return self.main.noise

    @property
    def predictor(self) -> Predictor:
        """The model's answers to the data."""
        return self.main.problem.predictor

    @property
    def explanations(self) -> tuple[str, ...]:
        """Hypotheses left standing under any noise model, the most likely first: effects, `none`, "a + b".

        One alone where one is the answer.
        """
        most = 1 if self.verdict in NAMING else None
        standing = (name for judgement in self.judgements.values() for name in judgement.explanations[:most])
        return tuple(dict.fromkeys(standing))

    @property
    def before(self) -> FloatArray:
        """(n,) ln measured - ln modelled of the machine file as given."""
        return self.as_given.residual

    @cached_property
    def best(self) -> str | None:
        """Name of the best explanation by an effect or a pair; None where there is none.

        The likeliest, of equals the one with more evidence.
        """
        names = [name for name, weight in self.main.likely if weight > 0.0] + [
            family.name for family in self.main.families
        ]
        offered = (n for n in names if n in self.fits and any(size.any() for size in self.fits[n].sizes))
        return next(offered, None)

    @property
    def likeliest(self) -> Fit:
        """The fit of the best explanation; with the strut law refitted alone where there is none."""
        return self.base if self.best is None else self.fits[self.best]

    @property
    def after(self) -> FloatArray:
        """(n,) residual of the best explanation; with the strut law refitted where there is none, or none is needed."""
        return self.base.residual if self.verdict == "adequate" else self.likeliest.residual

    @property
    def unconfirmed(self) -> Drawn | None:
        """How an answer that is only `described` stands, under the noise model that confirms it least."""
        drawn = (judgement.drawn for judgement in self.judgements.values() if judgement.verdict == "described")
        return next(filter(None, drawn), None)
