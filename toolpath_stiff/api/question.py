"""Arguments that all questions about measurements share, checked and in SI."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.api.measurements import Data, measurements_from
from toolpath_stiff.column_names import Mapped
from toolpath_stiff.diagnosis.diagnose import diagnose as diagnose_readings
from toolpath_stiff.diagnosis.examination import Diagnosis
from toolpath_stiff.diagnosis.on_elements import ElementDiagnosis, diagnose_elements, pull_problem
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked
from toolpath_stiff.inference.element_fits import PullProblem
from toolpath_stiff.machine.model import Hexapod, as_hexapod
from toolpath_stiff.options import Option, numbers, words_of
from toolpath_stiff.readings.measurements import Readings
from toolpath_stiff.readings.pulls import pull_tables

Noise = float | tuple[float, ...] | None
NOISE = """\
Standard deviation of one reading, re-clamping included; or of the reading alone and of a clamping. Unless given, from
repeats, else from sd_N_per_mm, else a guess."""
NoisePercent = Annotated[Noise, Option("--noise", "PERCENT[,PERCENT]", read=numbers, help=" ".join(NOISE.split()))]
StrutSpread = Annotated[
    float, Option("--strut-spread", "%", at_least=0, at_most=50, help="Standard deviation of the struts' stiffness.")
]
Seed = Annotated[int, Option("--seed", at_least=0, help="Seed of all random draws.")]


class Question:
    """A machine, measurements of it, and how much they scatter.

    Attributes
    ----------
    on, model, data
        The machine; as its file has it; the measurements, None where there are none.
    request
        The same, as words of a command.
    common
        Keyword arguments of every comparison, diagnosis, update and plan.
    inputs
        The files that are read.
    """

    def __init__(
        self,
        machine: Machine | str | Path,
        data: Data | None,
        noise_percent: NoisePercent = None,
        strut_spread_percent: StrutSpread = 1.0,
        seed: Seed = 0,
        columns: Mapped = None,
    ) -> None:
        self.on = machine_from(machine)
        self.model = self.on.stated
        self.data = None if data is None else measurements_from(data, columns)
        files, mapped = (self.data.files, self.data.columns) if self.data else ((), None)
        spreads = {"noise_percent": noise_percent, "strut_spread_percent": strut_spread_percent}
        words = tuple(words_of(Question.__init__, spreads))
        self.request = Asked(files, self.on.asked, self.on.effect_files, mapped, words)
        self.common: dict[str, Any] = {
            "noise": _noise(noise_percent), "strut_spread": strut_spread_percent / 100.0, "seed": seed,
            "effect_files": self.on.effect_files,
        }  # fmt: skip
        self.inputs = (*files, *self.on.inputs)

    @property
    def readings(self) -> Readings:
        """Readings in the measurement files, on this machine."""
        assert self.data is not None
        return self.data.on(self.on)

    @property
    def has_pulls(self) -> bool:
        """True if the measurements are vectors of force and displacement, on a machine of elements."""
        if self.data is None or isinstance(self.model, Hexapod):
            return False
        return bool(pull_tables(self.data.files, self.model, self.data.columns))

    def pulls(self) -> tuple[PullProblem, bool]:
        """Pulls, or stiffnesses, on a machine of elements, and True if their scatter is given."""
        assert self.data is not None
        noise = self.common["noise"] and float(np.hypot.reduce(np.atleast_1d(self.common["noise"])))
        spread, files = float(self.common["strut_spread"]), tuple(map(str, self.on.effect_files))
        return pull_problem(self.on.running(), self.data.files, self.data.columns, noise, spread, files)

    def of_elements(self) -> ElementDiagnosis:
        """Diagnosis of a machine of elements from its pulls or stiffnesses."""
        return replace(diagnose_elements(*self.pulls()), inputs=self.inputs)

    def diagnosed(self, tell: Callable[[str], None], *words: str, inputs: Iterable[str] = ()) -> Diagnosis:
        """A diagnosis of the readings; `words`: further words of the command that repeats it."""
        return replace(
            diagnose_readings(as_hexapod(self.model, "diagnose"), self.readings, progress=tell, **self.common),
            names=self.request.data,
            line=self.request.command("diagnose", *words),
            asked=self.request,
            inputs=(*self.inputs, *inputs),
        )


def _noise(percent: Noise) -> float | tuple[float, float] | None:
    """Percentages as relative standard deviations."""
    if percent is None:
        return None
    shares = [float(part) / 100.0 for part in ([percent] if isinstance(percent, int | float) else percent)]
    if len(shares) not in (1, 2) or not all(0.0 <= part <= 0.5 for part in shares) or shares[0] <= 0.0:
        named = ",".join(f"{100.0 * part:g}" for part in shares)
        raise InputError(f"--noise {named}", expected="one or two percentages, more than 0 and at most 50")
    return shares[0] if len(shares) == 1 else (shares[0], shares[1])
