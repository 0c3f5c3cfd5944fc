"""How large each effect is on the paper's 42 readings, against figures computed by someone else's script.

The figures are root mean squares in per cent of the change of ln k, and what is left of it after the strut law's two
constants are refitted: a study made for this project with other code (geometry of the NIST machine, effect sizes as
below), rounded to two digits. The tolerance is that rounding, and 5 % where the form of an effect leaves a choice.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.effects.cases import model_with, paper_design, readings
from tests.stiffness.cases import nist
from toolpath_stiff.machine.model import StrutLaw

# effect, values, force in N, raw, after refit, relative tolerance
CASES = [
    ("spindle_compliance", {"radial": 5e-9}, 1000.0, 17.5, 10.2, 0.01),
    ("spindle_compliance", {"axial": 2e-9}, 1000.0, 11.4, 9.3, 0.01),
    ("table_compliance", {"x": 3e-9}, 1000.0, 8.1, 6.5, 0.01),
    ("setup_compliance", {"x": 3e-9}, 1000.0, 6.7, 5.4, 0.01),
    # The study's 5 % is to first order, ours ln 1.05 = 4.88 %.
    ("gauge_scale", {"direction": 1, "setup": "", "scale": 0.05}, 1000.0, 2.9, 2.35, 0.04),
    ("joint_moment_stiffness", {"stiffness": 4e5}, 1000.0, 9.8, 4.8, 0.01),
    ("frame_compliance", {"vertex": 1, "radial": 6e-9}, 1000.0, 7.4, 2.7, 0.01),
    ("frame_compliance", {"vertex": 0, "radial": 3e-9}, 1000.0, 10.2, 1.1, 0.03),
    ("weak_strut", {"strut": 1, "factor": 0.9}, 1000.0, 2.4, 1.05, 0.02),
    ("platform_flexibility", {"bar_stiffness": 3e8}, 1000.0, 13.6, 0.57, 0.02),
    # 0.09 is one digit: 0.085 to 0.095, and the refit leaves a difference of small numbers.
    ("joint_compliance", {"compliance": 3e-9}, 1000.0, 11.3, 0.09, 0.15),
    # The study takes the pose as programmed; here a control with the wrong radius misses it.
    ("platform_radius_error", {"error": 0.002}, 1000.0, 0.8, None, 0.15),
    # The study does not print its load; 4 kN, its larger one, gives its figures for both effects that depend on it.
    ("joint_clearance", {"lost_motion": 2e-6}, 4000.0, 5.8, 1.4, 0.03),
    ("contact_nonlinearity", {"compliance": 3e-9}, 4000.0, 8.1, 0.63, 0.01),
    # The study moves the joints and takes the pose as the true tip's; here the control keeps the old length, so that
    # the struts stay. 10 mm of height are about 0.5 % of stiffness, an eighth of the effect.
    ("tool_length_error", {"error": 0.010}, 1000.0, 4.2, 2.3, 0.125),
]


def law_change(first: float, second: float) -> np.ndarray:
    """Change of ln k of the 42 readings when the law's constants change by factors e^first, e^second."""
    law = nist().strut_law
    changed = StrutLaw(law.length_1, law.stiffness_1 * np.exp(first), law.length_2, law.stiffness_2 * np.exp(second))
    position, along, _ = paper_design()
    after = readings(model_with("", nist().with_changes(strut_law=changed)), position, along)
    return np.log(after / readings(model_with(), position, along))


def raw_and_refitted(name, values, force):
    """Root mean squares of the change of ln k, and of its part that the strut law cannot follow, in per cent."""
    position, along, setups = paper_design()
    changed = readings(model_with(name, **values), position, along, force=force, setup=setups)
    change = np.log(changed / readings(model_with(), position, along))
    law = np.stack([law_change(1e-5, 0.0), law_change(0.0, 1e-5)], axis=1)
    left = change - law @ np.linalg.lstsq(law, change, rcond=None)[0]
    return 100.0 * np.sqrt(np.mean(change**2)), 100.0 * np.sqrt(np.mean(left**2))


@pytest.mark.parametrize(("name", "values", "force", "raw", "refitted", "tolerance"), CASES)
def test_size_on_the_papers_design(name, values, force, raw, refitted, tolerance):
    found = raw_and_refitted(name, values, force)
    assert found[0] == pytest.approx(raw, rel=tolerance)
    if refitted is not None:
        assert found[1] == pytest.approx(refitted, rel=tolerance)
