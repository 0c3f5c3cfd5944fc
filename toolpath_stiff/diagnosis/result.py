"""A diagnosis: which physical effect is missing from the model, if any, and what stands behind that."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.comparison.loop_readings import BesideTip
from toolpath_stiff.files import Content
from toolpath_stiff.hints import Asked
from toolpath_stiff.inference.confounding import Confounding
from toolpath_stiff.inference.detectable import Detectable
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.judgement import Judgement
from toolpath_stiff.inference.left_out import HeldOut
from toolpath_stiff.inference.noise import Noise
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.inference.slips import SlipSize, SuspectEntry
from toolpath_stiff.inference.unexcluded import Unexcluded
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.portrait.alike import Alike
from toolpath_stiff.portrait.portrait import Portrait
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.results import FolderResult
from toolpath_stiff.stiffness.contract import Effect

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


NAMING = ("identified", "described")  # verdicts that give one explanation as the answer


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(FolderResult):
    """Which physical effect the model lacks, if any, and what stands behind it; arrays in SI.

    Attributes
    ----------
    verdict, plausible
        Common to all noise models; see `verdict`.
    judgements
        Name of the noise model -> judgement. The one that is written out in full is `main`.
    main
        The judgement of the measured or stated noise, else of the high guess.
    data, machine, effects
        What was diagnosed, with the effects that these data can test.
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
    slips
        The smallest slips of a pose that these readings would show; none where rows were not looked at.
    loops
        Readings of indicators beside the tip against the likeliest explanation. Everything above with an entry a
        reading is of those of the tip.
    """

    command: ClassVar[str] = "diagnose"
    shown_by: ClassVar[str] = "diagnose.page"

    verdict: str
    plausible: list[str]
    judgements: dict[str, Judgement]
    main: Judgement
    data: Measurements
    machine: Machine
    effects: tuple[Effect, ...]
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
    slips: tuple[SlipSize, ...] = ()
    loops: BesideTip = field(default_factory=BesideTip)
    inputs: tuple[str, ...] = ()

    @cached_property
    def document(self) -> dict[str, Any]:
        """The content of diagnose.json."""
        # The module that writes it reads this class: to import it above would be a circle.
        written: dict[str, Any] = import_module("toolpath_stiff.diagnosis.document").document(self)
        return written

    def to_dict(self) -> dict[str, Any]:
        """The content of diagnose.json."""
        return dict(self.document)

    def to_frame(self) -> pd.DataFrame:
        """The candidates, one a row: probability, errors, why not."""
        import pandas as pd

        return pd.DataFrame(self.document["candidates"])

    def plot(self) -> Figure:
        """The error as given, with the strut law refitted, and with each candidate."""
        figure: Figure = self.view.ladder_png.figure(self.document)
        return figure

    def files(self, *, plots: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """The files of `tps diagnose`."""
        files: Mapping[str, Content] = self.view.files(self, plots=plots)
        return files

    def _short(self) -> str:
        names = ", ".join(self.plausible)
        return f"{self.verdict}: {names}" if names else self.verdict

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
        return tuple(dict.fromkeys(name for one in self.judgements.values() for name in one.explanations[:most]))

    @property
    def before(self) -> FloatArray:
        """(n,) ln measured - ln modelled of the machine file as given."""
        return self.as_given.residual

    @property
    def best(self) -> str | None:
        """Name of the best explanation by an effect or a pair; None where there is none."""
        offered = [name for name in self.ranking() if name in self.fits and any(s.any() for s in self.fits[name].sizes)]
        return offered[0] if offered else None

    @property
    def after(self) -> FloatArray:
        """(n,) residual of the best explanation; with the strut law refitted where there is none, or none is needed."""
        if self.best is None or self.verdict == "adequate":
            return self.base.residual
        return self.fits[self.best].residual

    @property
    def law(self) -> FloatArray:
        """(2,) the strut law's logarithms with the best explanation."""
        return self.base.law if self.best is None else self.fits[self.best].law

    def ranking(self) -> list[str]:
        """Explanations, most likely first: by probability, then by evidence."""
        likely = sorted(self.main.probability.items(), key=lambda item: (-item[1], item[0]))
        names = [name for name, weight in likely if weight > 0.0 and name in self.fits]
        return names + [f.name for f in self.main.families if f.name not in names]
