"""What all tests of updating share: the model's answers to campaigns of one design are worked out once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from tests.stiffness.cases import nist
from tests.updating.cases import predictor_for
from toolpath_stiff.machine import Machine, machine_toml
from toolpath_stiff.updating import comparison, diagnosis
from toolpath_stiff.updating.correction import ladder
from toolpath_stiff.updating.inference.prediction import Predictor
from toolpath_stiff.updating.measurements import Measurements

NIST = machine_toml(nist())


def shared(machine: Machine, data: Measurements, effect_files: Sequence[str | Path] = ()) -> Predictor:
    """`Predictor(...)`; of the nist machine without effects of a user's own, that of the design."""
    known = not effect_files and machine_toml(machine) == NIST
    return predictor_for(data) if known else Predictor(machine, data, effect_files)


@pytest.fixture(scope="package", autouse=True)
def _predictors_are_shared() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module in (comparison, diagnosis, ladder):
            patch.setattr(module, "Predictor", shared)
        yield
