"""Random programs through both readers, as `python -m benchmarks.hunt` does it in numbers; and the hunter hunted."""

from __future__ import annotations

import pytest

from benchmarks import hunt
from tests.nc import rs274
from toolpath_stiff.nc.reader import parse_program

pytestmark = pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")


@pytest.mark.parametrize("first", range(0, 60, 10))
def test_never_another_path(first, tmp_path):
    outcomes = [hunt.hunt_one(hunt.program_of(seed), tmp_path) for seed in range(first, first + 10)]
    found = [outcome for outcome in outcomes if outcome is not None]
    assert [outcome for outcome in found if outcome.verdict == hunt.OTHER] == []
    # A reader that refuses everything would pass too.
    assert sum(outcome.verdict in (hunt.SAME, hunt.RAPIDS) for outcome in found) >= 6


def test_a_reader_that_errs_is_found_out(tmp_path, monkeypatch):
    """One that takes every arc the other way round, or forgets the last move."""
    text = "G21 F100\nG1 X5\nG2 X15 I5\nG1 Y7\nM2\n"
    assert hunt.hunt_one(text, tmp_path).verdict == hunt.SAME
    for wrong in (text.replace("G2 ", "G3 "), text.replace("G1 Y7\n", ""), text.replace("Y7", "Y7.02")):
        monkeypatch.setattr(hunt, "read_program", lambda *_, wrong=wrong, **__: parse_program(wrong))
        assert hunt.hunt_one(text, tmp_path).verdict == hunt.OTHER


def test_what_one_refuses_is_left_out_and_the_rest_compared(tmp_path):
    outcome = hunt.hunt_one("G21 F100\nG1 X5\nG41 D1\nG77.7\nG1 X15\nM2\n", tmp_path)
    assert outcome.verdict == hunt.SAME and outcome.text == "G21 F100\nG1 X5\nG1 X15\nM2\n"


@pytest.mark.parametrize("line", ["M[101]", "m[1 5 0]", ";py,open('x','w')"])
def test_what_would_run_programs_is_not_given_to_it(line, tmp_path, monkeypatch):
    monkeypatch.setattr(hunt.rs274, "run", None)
    assert hunt.hunt_one(f"G1 X1 F100\n{line}\nM2\n", tmp_path) is None
