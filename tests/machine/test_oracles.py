"""Compliance of serial machines as pinocchio, MuJoCo and OpenSees have it; TPS_ORACLE_POSES=1000 asks for more."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff
from tests.machine.oracles import ORACLES, apart, drawn, soft
from tests.machine.test_machine_kinds import DATA, KINDS, UR, UR_ON_RAIL, axis
from toolpath_stiff.machine.file import load_machine, parse_machine

POSES = int(os.environ.get("TPS_ORACLE_POSES", "10"))
MILL5, PACKAGE = (DATA / "mill5.toml").read_text(), Path(toolpath_stiff.__file__).parent
OTHER_TRUNNION = (("xyzac-trt", "xyzbc-trt"), ("y_offset_mm", "x_offset_mm"), ("A_deg", "B_deg"), ('"A"', '"B"'))
for old, new in OTHER_TRUNNION:
    MILL5 = MILL5.replace(old, new)
TEMPLATE = (PACKAGE / "data/templates/serial.toml.txt").read_text()
MACHINES = {
    **{name: machine for name, machine in KINDS.items() if machine.kind == "serial"},
    "xyzbc": parse_machine(MILL5),
    "template": parse_machine(TEMPLATE),
    "cell": load_machine(Path(__file__).parents[2] / "programs/robot_cell.toml"),
    "offset wrist on a rail": parse_machine(UR_ON_RAIL),
    "beside a table": parse_machine(UR + axis("T", "rotary", "work", xyz_mm=[900, 0, -200], axis=[0, 0, 1])),
}


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("oracle", ORACLES)
def test_compliance_is_that_of_another_program(oracle: str, name: str) -> None:
    pytest.importorskip(oracle)
    machine = soft(MACHINES[name])
    assert apart(oracle, machine, drawn(machine, np.random.default_rng(1), POSES)) < 1e-10


def test_twelve_machines_are_asked_about() -> None:
    assert len(MACHINES) == 12
