"""Compliance of serial machines as pinocchio, MuJoCo and OpenSees have it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.machine.oracles import ORACLES, apart, drawn, soft
from tests.machine.test_machine_kinds import KINDS

SERIAL = ("robot200", "mill5", "mill3", "head", "table", "rail", "offset wrist")


@pytest.mark.parametrize("name", SERIAL)
@pytest.mark.parametrize("oracle", ORACLES)
def test_compliance_is_that_of_another_program(oracle: str, name: str) -> None:
    pytest.importorskip(oracle)
    machine = soft(KINDS[name])
    assert apart(oracle, machine, drawn(machine, np.random.default_rng(1), 10)) < 1e-10
