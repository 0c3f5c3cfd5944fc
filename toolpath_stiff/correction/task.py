"""A task: the machine to correct, the measurements, and what may change."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.hints import Asked
from toolpath_stiff.inference.evidence import Problem
from toolpath_stiff.inference.noise import Noise, noise_models
from toolpath_stiff.inference.prediction import Predictor
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.readings.measurements import Readings

MACHINE, INSTRUMENT = "machine", "instrument"
LIKELIHOOD, MEAN_ERROR = "likelihood", "mean-error"


@dataclass(frozen=True, eq=False)
class UpdateTask:
    """A machine, measurements, and the parts of the machine that they may change.

    Attributes
    ----------
    machine, data
        The model and n readings.
    add
        Effects to be added: `weak_strut`, or with what they act on, `weak_strut:strut=3`.
    strut_law
        Write the refitted strut law even if no effect is added.
    keep_strut_law
        Keep the strut law of the machine file; else its two stiffnesses are fitted along with every effect.
    auto
        Go on adding effects while the data support them.
    force
        Keep what the data do not support, or readings hardly of this machine; never what fits worse than `machine`.
    believe
        Where machine and instrument would show the same, which of them it is taken for; None: it is refused.
    objective
        `LIKELIHOOD`; or `MEAN_ERROR`, the paper's own estimation, of the strut law alone.
    noise, strut_spread, effect_files, seed, progress
        As in `diagnose`.
    files
        Names of the measurement files, whose bytes are hashed for the record; empty: those that `data` names.
    machine_file
        Name that the new machine file is to have, for the record and the commands that use it.
    request
        What the commands that go on from here carry.
    """

    machine: Hexapod
    data: Readings
    add: Sequence[str] = ()
    strut_law: bool = False
    keep_strut_law: bool = False
    auto: bool = False
    force: bool = False
    believe: str | None = None
    objective: str = LIKELIHOOD
    noise: float | tuple[float, float] | None = None
    strut_spread: float = STRUT_SPREAD
    effect_files: Sequence[str | Path] = ()
    seed: int = 0
    files: Sequence[str] = ()
    machine_file: str = "machine.toml"
    request: Asked | None = None
    progress: Callable[[str], None] = lambda text: None

    @cached_property
    def noise_model(self) -> Noise:
        """Noise model with the largest noise, if there are several, as in a diagnosis."""
        return max(noise_models(self.data, self.noise, self.strut_spread), key=lambda model: model.typical)

    @cached_property
    def problem(self) -> Problem:
        """Model and scatter."""
        return Problem.of(Predictor(self.machine, self.data, self.effect_files), self.noise_model)
