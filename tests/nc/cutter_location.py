"""Help for the tests of cutter-location files."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import strategies as st

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.reader import parse_program

MM = 1e-3
START = "UNITS/MM\nFEDRAT/600,MMPM\n"


def read(text: str, **options) -> ReadProgram:
    return parse_program(text, "part.apt", **options)


def refused(text: str, **options) -> InputError:
    with pytest.raises(InputError) as caught:
        read(text, **options)
    return caught.value


tilt = st.tuples(st.floats(0, 80), st.floats(-180, 180)).map(lambda t: (math.radians(t[0]), math.radians(t[1])))


def leaning(angles) -> np.ndarray:
    away, around = angles
    return np.array([math.sin(away) * math.cos(around), math.sin(away) * math.sin(around), math.cos(away)])
