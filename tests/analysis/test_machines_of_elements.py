"""Commands on machines of elements, against the values of `tests/machine/data` (see its README) and closed forms."""

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from toolpath_stiff.machine.file import load_machine

DATA = Path(__file__).parents[1] / "machine" / "data"
VALUES = json.loads((DATA / "check_values.json").read_text("utf-8"))
HEXAGLIDE = ("hexaglide",)


def file(name: str) -> str:
    return str(DATA / f"{name}.toml")


def poses(name: str) -> list[list[float]]:
    """X, Y, Z, A, B, C of the tip (roll, pitch, yaw in work axes) of a file's poses."""
    machine, rows = load_machine(file(name)), []
    for row in tomllib.loads(Path(file(name)).read_text("utf-8"))["pose"]:
        ((key, values),) = row.items()
        if key == "joints_deg":
            position, rotation = machine.forward(np.radians([values]))
            x, y, z = 1e3 * position[0]
            roll, yaw = (math.atan2(*rotation[0][index]) for index in (((2, 2), (1, 2)), ((1, 0), (0, 0))))
            roll = math.atan2(rotation[0][2, 1], rotation[0][2, 2])
            pitch = math.asin(-rotation[0][2, 0])
            rows.append([x, y, z, *np.degrees([roll, pitch, yaw])])
        elif key == "program_mm_deg":  # words A, C of a table: the tool leans the other way on the work
            rows.append([*values[:3], -values[3], 0.0, -values[4]])
        else:
            rows.append([*values, *[0.0] * (6 - len(values))][:6])
    return rows


@pytest.mark.parametrize("name", ["robot200", "mill3", "delta", "pentapod"])
def test_poses_have_the_stiffness_of_the_check_values(name: str) -> None:
    found = tps.pose(poses(name), file(name))
    for row, value in enumerate(VALUES[name]):
        assert 1e-6 * found.along_axes[row] == pytest.approx(value["stiffness_XYZ_N_per_um"], rel=1e-8)
        assert 1e-6 * found.softest_stiffness[row] == pytest.approx(value["softest_N_per_um"], rel=1e-8)
        assert 1e9 * found.tip_compliance[row] == pytest.approx(np.array(value["tip_compliance_nm_per_N"]), rel=1e-8)
