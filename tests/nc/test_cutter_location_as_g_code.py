"""Cutter-location files: the same path as in G code, and however it is written."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.nc import rs274
from tests.nc.cutter_location import MM, START, leaning, read, tilt
from tests.nc.test_nc_against_rs274 import assert_same_path
from toolpath_stiff.nc.moves import CYCLE
from toolpath_stiff.nc.reader import parse_program


@pytest.mark.parametrize(
    ("cycle", "code"),
    [
        ("DRILL,DEPTH,12,MMPM,80,CLEAR,2", "G81 R2 Z-12"),
        ("DRILL,DEPTH,12,MMPM,80,CLEAR,2,DWELL,1.5", "G82 R2 Z-12 P1.5"),
        ("DEEP,DEPTH,12,STEP,5,MMPM,80,CLEAR,2", "G83 R2 Z-12 Q5"),
        ("DRILL,DEEP,FEDTO,-12,STEP,5,MMPM,80,CLEAR,2", "G83 R2 Z-12 Q5"),
        ("BRKCHP,DEPTH,12,INCR,5,MMPM,80,CLEAR,2", "G73 R2 Z-12 Q5"),
    ],
)
def test_holes_as_g_code_drills_them(cycle, code):
    """In upright holes the strokes are those of the canned cycles, which are held against LinuxCNC's."""
    ours = read(
        f"UNITS/MM\nFEDRAT/500\nFROM/0,0,30\nCYCLE/{cycle}\nGOTO/10,0,0\nGOTO/20,5,0\nCYCLE/OFF\nRAPID\nGOTO/20,5,30\n"
    ).moves
    theirs = parse_program(f"G0 Z30\nG99 {code} X10 Y0 F80\nX20 Y5\nG80\nG0 Z30\n").moves
    theirs = theirs.take(slice(1, None))  # without the way up to Z30
    np.testing.assert_allclose(ours.end, theirs.end, atol=1e-12)
    np.testing.assert_array_equal(ours.motion, theirs.motion)
    np.testing.assert_allclose(ours.feed, theirs.feed)
    np.testing.assert_allclose(ours.dwell, theirs.dwell)


def test_holes_in_inches():
    text = (
        "UNITS/{}\nSPINDL/1000,RPM\nFEDRAT/{}\nFROM/0,0,{}\n"
        "CYCLE/DEEP,DEPTH,{},STEP,{},{},CLEAR,{},RETURN,{}\nGOTO/0,0,0\n"
    )
    inch = read(text.format("INCHES", 10, 1, 0.5, 0.2, "IPR,0.01", 0.1, 0.3)).moves
    metric = read(text.format("MM", 254, 25.4, 12.7, 5.08, "PERREV,0.254", 2.54, 7.62)).moves
    for column in ("end", "feed", "motion"):
        np.testing.assert_allclose(getattr(inch, column), getattr(metric, column), rtol=1e-12, atol=1e-15)
    assert metric.end[-1, 2] == pytest.approx(7.62 * MM)


def test_tilted_holes_go_along_the_tool():
    moves = read(
        f"{START}GOTO/0,0,20,0,.6,.8\nCYCLE/DRILL,DEPTH,10,MMPM,80,CLEAR,3\nGOTO/0,0,0\nCYCLE/OFF\nGOTO/0,0,30\n"
    ).moves
    drill = moves.take(moves.motion == CYCLE)
    np.testing.assert_allclose(drill.start[0, :3], MM * 3 * np.array([0, 0.6, 0.8]), atol=1e-15)
    np.testing.assert_allclose(drill.end[0, :3], -MM * 10 * np.array([0, 0.6, 0.8]), atol=1e-15)


number = st.floats(-200, 200).map(lambda v: round(v, 3))
vectors = tilt.map(leaning)


@st.composite
def paths(draw):
    """Steps of a path: rapid, cut, arc in XY, each with an axis or without."""
    steps = []
    for _ in range(draw(st.integers(2, 8))):
        kind = draw(st.sampled_from(["rapid", "cut", "feed", "arc"]))
        if kind == "feed":
            steps.append(("feed", draw(st.integers(1, 5000))))
        elif kind == "arc":
            steps.append(("arc", draw(st.integers(1, 50)), draw(st.sampled_from([1, -1])), draw(st.integers(5, 355))))
        else:
            axis = draw(st.none() | vectors)
            steps.append((kind, draw(number), draw(number), draw(number), axis))
    return steps


def written(steps, value, words, ending="\n", inch=False):
    """A path as statements; `value` formats numbers, `words` joins a word and its arguments."""
    unit = 25.4 if inch else 1.0
    lines = [words("UNITS", ["INCHES" if inch else "MM"]), words("FEDRAT", [value(100 / unit)])]
    point = [0.0, 0.0, 0.0]
    lines.append(words("FROM", [value(0.0)] * 3))
    for step in steps:
        if step[0] == "feed":
            lines.append(words("FEDRAT", [value(float(step[1])), "MMPM"]))
        elif step[0] == "arc":
            _, radius, sense, degrees = step
            center = [point[0] - radius, point[1], point[2]]
            turn = math.radians(sense * degrees)
            point = [center[0] + radius * math.cos(turn), center[1] + radius * math.sin(turn), point[2]]
            given = [*(v / unit for v in center), 0.0, 0.0, float(sense), radius / unit]
            lines.append(words("CIRCLE", [value(v) for v in given]))
            lines.append(words("GOTO", [value(v / unit) for v in point]))
        else:
            kind, x, y, z, axis = step
            point = [x, y, z]
            if kind == "rapid":
                lines.append("RAPID")
            axis = [] if axis is None else list(axis)
            lines.append(words("GOTO", [*(value(v / unit) for v in point), *(value(v) for v in axis)]))
    return ending.join([*lines, words("GODLTA", [value(0.0), value(0.0), value(1 / unit)]), "FINI", ""])


@given(paths(), st.randoms(use_true_random=False), st.booleans())
def test_the_same_path_however_it_is_written(steps, chance, inch):
    """Blanks, exponents, continuations, comments, case, inches and ends of lines do not change a path."""

    def plainly(v):
        return f"{v:.9f}"

    def freely(v):
        text = chance.choice([f"{v:.9f}", f"{v:+.10f}", f"{v:.12E}", f"{v:.12e}".replace("e", "D"), f"{v:.9f}000"])
        return text if "." not in text or abs(v) >= 1 or "E" in text.upper() else text.replace("0.", ".", 1)

    def plain(word, arguments):
        return f"{word}/{','.join(arguments)}"

    def free(word, arguments):
        blank = chance.choice(["", " ", "   ", "\t"])
        text = chance.choice([word, word.lower()]) + blank + "/"
        for i, argument in enumerate(arguments):
            if i:
                text += "," + chance.choice(["", " ", "$\n  ", "$ $$ a remark, with GOTO/1,2,3\n"])
            text += blank + argument
        return (
            chance.choice(["", "$$ remark\n", "\n", "PPRINT what, $ ever / it says\n"])
            + text
            + chance.choice(["", "  "])
        )

    def moves_of(text):  # without moves that are the rounding of a number written twice
        moves = read(text).moves
        return moves.take((moves.arc_sweep != 0) | (np.abs(moves.end - moves.start).max(axis=1) > 1e-8))

    first = moves_of(written(steps, plainly, plain))
    second = moves_of(written(steps, freely, free, chance.choice(["\n", "\r\n", "\r"]), inch))
    np.testing.assert_array_equal(first.motion, second.motion)
    np.testing.assert_allclose(first.end, second.end, atol=2e-9)
    np.testing.assert_allclose(
        first.arc_sweep * first.arc_normal[:, 2], second.arc_sweep * second.arc_normal[:, 2], atol=1e-6
    )
    np.testing.assert_allclose(first.feed, second.feed, rtol=1e-6)


def as_g_code(steps):
    """The same steps, without tool axes, in G0 to G3."""
    lines, point = ["G21 G90 G94 F100"], [0.0, 0.0, 0.0]
    for step in steps:
        if step[0] == "feed":
            lines.append(f"F{step[1]}")
        elif step[0] == "arc":
            _, radius, sense, degrees = step
            turn = math.radians(sense * degrees)
            end = [point[0] - radius + radius * math.cos(turn), point[1] + radius * math.sin(turn)]
            lines.append(f"{'G3' if sense > 0 else 'G2'} X{end[0]:.9f} Y{end[1]:.9f} I{-radius} J0")
            point[:2] = end
        else:
            point = list(step[1:4])
            lines.append(f"{'G0' if step[0] == 'rapid' else 'G1'} X{point[0]:.3f} Y{point[1]:.3f} Z{point[2]:.3f}")
    return "\n".join([*lines, "G91 G1 Z1", "M2", ""])


def as_apt(steps):
    return written(steps, lambda v: f"{v:.9f}", lambda word, arguments: f"{word}/{','.join(arguments)}")


@given(paths())
def test_the_same_path_as_g_code(steps):
    """Without tool axes a path is the same as in G0, G1, G2, G3."""
    steps = [step if step[0] in ("arc", "feed") else (*step[:4], None) for step in steps]
    ours, theirs = read(as_apt(steps)).moves, parse_program(as_g_code(steps)).moves
    np.testing.assert_array_equal(ours.motion, theirs.motion)
    np.testing.assert_allclose(ours.end, theirs.end, atol=2e-9)
    turns = [moves.arc_sweep * moves.arc_normal[:, 2] for moves in (ours, theirs)]
    np.testing.assert_allclose(*turns, atol=1e-6)
    np.testing.assert_allclose(ours.feed, theirs.feed)


@pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")
@pytest.mark.parametrize("seed", range(6))
def test_the_same_path_as_linuxcnc_makes_of_g_code(seed, tmp_path):
    chance = random.Random(seed)
    steps = []
    for _ in range(40):
        kind = chance.choice(["rapid", "cut", "cut", "feed", "arc", "arc"])
        if kind == "feed":
            steps.append(("feed", chance.randint(1, 5000)))
        elif kind == "arc":
            steps.append(("arc", chance.randint(1, 50), chance.choice([1, -1]), chance.randint(5, 355)))
        else:
            steps.append((kind, *(round(chance.uniform(-200, 200), 3) for _ in range(3)), None))
    program = tmp_path / "part.ngc"
    program.write_text(as_g_code(steps))
    canon = rs274.run(program, tmp_path)
    assert not canon.error
    ours = read(as_apt(steps))
    # LinuxCNC's arcs are about +Z, clockwise ones by a negative angle.
    up = np.where(ours.moves.arc_normal[:, 2] < 0.0, -1.0, 1.0)
    moves = replace(
        ours.moves, arc_normal=ours.moves.arc_normal * up[:, None] + 0.0, arc_sweep=ours.moves.arc_sweep * up
    )
    assert_same_path(replace(ours, moves=moves), canon)
