"""The placement of least surface error: predicted as the chain has it, better than now, and nothing else worse."""

from __future__ import annotations

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.cutting.test_compensated_cuts import HEAD, pocket, setup
from toolpath_stiff.errors import InputError

TEXT = HEAD + pocket(0.5, 6, False, 10) + "M2\n"
# A stout tool, so that the machine decides: of a slim one's error it has a tenth.
GIVEN = setup(10, 8.0)
BOX = {"x_mm": (-250, 250), "y_mm": (-250, 250), "z_mm": (700, 1000)}


def p95(origin):
    """What 95 % of the final walls stay below, um, by the chain at a placement."""
    cut = tps.analyze(tps.Program.from_text(TEXT, name="part.nc"), origin_mm_deg=origin, cut=GIVEN, step_mm=4.0).cut
    row, side = np.nonzero(np.isfinite(cut.wall_mean))
    size, length = np.abs(cut.wall_mean[row, side]) * 1e6, cut.samples.weight[row]
    order = np.argsort(size)
    return float(size[order][np.searchsorted(np.cumsum(length[order]), 0.95 * length.sum())])


def test_the_least_error():
    program = tps.Program.from_text(TEXT, name="part.nc")
    best = tps.place(program, objective="error", cut=GIVEN, points=5, step_mm=4.0, **BOX)
    told = best.to_dict()["surface_error_um"]
    assert told["chosen"] == pytest.approx(p95(best.origin_mm_deg), rel=0.02)
    assert told["chosen"] < told["before"] and not best.worse
    assert told["before"] == pytest.approx(p95(None), rel=0.02)
    assert f"within {told['chosen']:.2f} um" in str(best)


def test_what_is_refused():
    program = tps.Program.from_text(TEXT, name="part.nc")
    for options in ({"objective": "error"}, {"cut": GIVEN}):
        with pytest.raises(InputError, match="need each other"):
            tps.place(program, **BOX, **options)
    air = tps.Program.from_text(HEAD + "G0 X0 Y0 Z5\nG1 X20 F900\nM2\n", name="air.nc")
    with pytest.raises(InputError, match="no pass makes a wall"):
        tps.place(air, objective="error", cut=GIVEN, **BOX)
