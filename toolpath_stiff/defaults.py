"""Defaults that hold unless the user says otherwise, with units, and constants shared by several rooms."""

import math
import os

from toolpath_stiff.units import m_from_mm, m_per_s_from_mm_per_min, rad_from_deg

VERSION = "0.2.0"  # of the package; pyproject.toml reads it from this text

MACHINE = "nist"  # name of a packaged machine: the paper's
LOAD = "tangential"  # direction of the load
FORCE = 1000.0  # N at the tool tip, assumed wherever neither the user nor the data say at which load
STEP = m_from_mm(1.0)  # m between samples: resolves any feature that a mill can cut, and costs microseconds
RAPID_FEED = m_per_s_from_mm_per_min(10_000.0)  # m/s, assumed where no machine says otherwise
# rad between motion and tool axis that still counts as a plunge; helical and ramping entries are well beyond it.
PLUNGE_ANGLE = rad_from_deg(5.0)

# Searches of placements.
# Weights of mean, -range and weakest place, all in N/m, of what a search raises.
OBJECTIVES: dict[str, tuple[float, float, float]] = {
    "balanced": (1.0, 1.0, 0.0),
    "mean": (1.0, 0.0, 0.0),
    "range": (0.0, 1.0, 0.0),
    "weakest": (0.0, 0.0, 1.0),
}
OBJECTIVE = "balanced"
MARGIN = 0.01  # smallest margin to a limit, as a share of its span
FRONT_POINTS = 60
PLACEMENT_SEED = 1

# Measurements.
STRUT_SPREAD = 0.01  # relative sd of the struts' stiffnesses, assumed
CLAMPING = 0.01  # relative sd of clamping anew, assumed where the data cannot tell

# Mean of |x| over its standard deviation for a normal x: scatter alone leaves so large a mean error.
MEAN_OVER_SD = math.sqrt(2.0 / math.pi)
NORMAL_95 = 1.959964  # two-sided 95 % quantile of the normal distribution

# Environment variables by which linear algebra is told how many threads it may have, before it is loaded. One, by
# design: on matrices of this size a second one costs four times the CPU, and sums keep their order.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def usable_cpus() -> int:
    """CPUs that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
