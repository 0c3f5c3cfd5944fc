"""Cycles with L in both distance modes, and changes of the mode within a run, against LinuxCNC's interpreter."""

from __future__ import annotations

import random

import numpy as np
import pytest

from tests.nc import rs274
from tests.nc.test_nc_against_rs274 import assert_same_path
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.reader import parse_program, read_program

LINUXCNC = Controller(DIALECTS["linuxcnc"])


def repeated_program(seed: int) -> str:
    """Runs of one cycle with L, G98 and G99, and G90 and G91 changing on the way."""
    r = random.Random(seed)
    lines = [f"G21 G17 F{r.randint(100, 500)}", f"G0 X{r.randint(0, 9)} Y{r.randint(0, 9)} Z{r.randint(5, 30)}"]
    for _ in range(r.randint(1, 3)):
        code = r.choice(["G81", "G82 P0.2", "G83 Q1.37", "G73 Q0.83", "G85", "G89 P0.3"])
        mode = r.choice(["G90", "G91"])
        heights = f"Z{-r.randint(2, 9)} R{r.randint(1, 8)}"
        lines.append(f"{mode} {r.choice(['G98', 'G99'])} {code} X{r.randint(1, 9)} {heights} L{r.randint(1, 5)}")
        for _ in range(r.randint(1, 4)):
            words = [r.choice(["", "", "", "G90", "G91"]), r.choice(["", "G98", "G99"]), f"X{r.randint(1, 9)}"]
            words += [r.choice(["", f"Y{r.randint(1, 9)}"]), r.choice(["", f"L{r.randint(2, 4)}"])]
            lines.append(" ".join(words))
        lines.append("G80 G90")
    return "\n".join([*lines, "G1 X50 Y50 Z0", "M2", ""])


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("seed", range(40))
def test_repeats_and_changes_of_mode_as_linuxcnc(seed, tmp_path):
    path = tmp_path / "cycles.ngc"
    path.write_text(repeated_program(seed))
    canon = rs274.run(path, tmp_path)
    try:
        read = read_program(path, controller=LINUXCNC)
    except InputError as error:
        assert "below the bottom" in str(error)
        assert "R value" in canon.error or "R less" in canon.error, canon.error
        return
    assert not canon.error
    assert_same_path(read, canon)
    try:
        plain = read_program(path)
    except InputError as error:
        assert "controls differ" in str(error)
        return
    np.testing.assert_array_equal(plain.moves.end, read.moves.end)


def test_too_many_strokes_are_refused():
    with pytest.raises(InputError, match="more than 100000 strokes"):
        parse_program("F100 G0 Z5\nG83 X1 Z-5 R1 Q0.00001")
    with pytest.raises(InputError, match="more than 100000 strokes"):
        parse_program("F100 G0 Z5\nG91 G83 X1 Z-5 R1 Q0.1 L9999")
