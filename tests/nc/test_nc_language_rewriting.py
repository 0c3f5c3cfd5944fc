"""The rewriter depends on the reader: what it can express of the language keeps its path, the rest is refused."""

from __future__ import annotations

import math

import pytest

from tests.placement.rewriting import assert_same_path
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.rewriting.program import rewrite_program

HERE = (0.0,) * 6
THERE = [
    (0.02, -0.03, 0.04, 0.0, 0.0, 0.0),
    (0.02, 0.01, 0.0, 0.0, 0.0, math.radians(90)),
    (0.02, 0.01, 0.0, 0.0, 0.0, math.radians(33)),
]
ROTATED = """G21 G90 F500
G0 X0 Y0 Z5
G68 X10 Y5 R30
G0 X20 Y5
G1 Z-1
G3 X10 Y15 I-10
G91 G1 X3
X0 Y-4
G90 X1 Y2
G98 G81 X5 Y6 Z-2 R1
G80 G69
G0 X0 Y0
G1 X7 Y8
M30
"""


@pytest.mark.parametrize("there", THERE)
def test_a_rotated_system_is_rewritten(there):
    program = parse_program(ROTATED, origin=there)
    rewritten = rewrite_program(program, there, HERE)
    assert_same_path(program, there, parse_program(rewritten.text, origin=HERE), HERE, 1e-4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G16 G1 F100 X10 Y30\nG15 X0 Y0 Z0\nM30\n", "polar words"),
        ("G0 X0 Y0 Z0\nG1 F100 X10 Y30\nM98 P1\nM30\nO1\nG1 X3\nM99\n", "M98, M99"),
        ("G0 X0 Y0 Z0\nG1 F100 X10 Y30\nM99\n", "M98, M99"),
    ],
)
def test_what_cannot_be_rewritten_is_refused(text, words):
    with pytest.raises(InputError, match=words):
        rewrite_program(parse_program(text, origin=THERE[0]), THERE[0], HERE)
