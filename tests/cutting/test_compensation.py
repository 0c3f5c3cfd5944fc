"""Compensation against errors that are given functions of the path: what is left, what stays, what is never worse.

The surface errors here are formulas of place and shift, not the chain's: what is tested is the mirror method, its
iteration, its limits and the program written. `tests/cutting/test_compensated_cuts.py` goes through the chain.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from toolpath_stiff.cutting.compensation import compensate_program
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.path.sampling import sample_moves

HERE = (0.0,) * 6
STILL = {"turning": None, "lines_warning": lambda rows, words: []}  # no tool turns on its way
WIDTH, HEIGHT = 25.0, 15.0  # mm, of the centre path's rectangle
POCKET = """G21 G90 G17
S9000 M3
G0 X0 Y0 Z5
G1 Z-3 F250
X10 F900
X25
Y10
G3 X20 Y15 R5
G1 X-20
G3 X-25 Y10 R5
G1 Y-10
G3 X-20 Y-15 R5
G1 X20
G3 X25 Y-10 R5
G1 Y0
X0
G0 Z10
M30
"""


def outward(position):
    """(n,) mm by which points lie outside the rectangle of the centre path with corners of 5 mm."""
    x, y = np.abs(position[:, 0]) * 1e3, np.abs(position[:, 1]) * 1e3
    a, b = x - (WIDTH - 5.0), y - (HEIGHT - 5.0)
    return np.where((a > 0) & (b > 0), np.hypot(a, b), np.maximum(a, b)) - 5.0


def cut_by(error, side=1, width=2.0):
    """An `evaluate`: errors (mm) of the wall on one side by `error(x, y, outward)` in mm, spread of a third."""

    def evaluate(program):
        samples = sample_moves(program.moves, 1e-3)
        off = outward(samples.position)
        along = np.abs((samples.tangent * samples.position).sum(axis=1)) * 1e3  # links go straight out
        link = (np.abs(samples.position[:, 1]) < 1e-9) & (np.abs(samples.tangent[:, 0]) > 0.5) & (along >= 0)
        made = (samples.motion != 0) & (np.abs(off) < 0.4) & (samples.position[:, 2] < 0.0) & ~link
        x, y = samples.position[:, 0] * 1e3, samples.position[:, 1] * 1e3
        walls = np.full((len(samples), 2), np.nan)
        walls[made, side] = error(x, y, off)[made] * 1e-3
        wide = np.where(made, width * 1e-3, 0.0)
        return SimpleNamespace(
            samples=samples,
            wall_mean=walls,
            lowest=walls * 0.8,
            highest=walls * 1.1,
            ae=wide,
            made=made,
            off=off,
            **STILL,
        )

    return evaluate


def compensate(evaluate, text=POCKET, **options):
    program = parse_program(text, "pocket.nc")
    return compensate_program(program, HERE, evaluate, lambda t: parse_program(t, "pocket.nc"), **options)


@pytest.mark.parametrize(
    ("error", "left", "turns"),
    [
        (lambda x, y, off: 0.012 + 0.0 * x, 0.01, 1),  # the force does not depend on the shift
        (lambda x, y, off: -0.02 + 0.0 * x, 0.01, 1),
        (lambda x, y, off: 0.015 + 1e-4 * x + 5e-5 * y, 0.03, 1),
        (lambda x, y, off: 0.02 + 0.006 * np.sin(x / 4.0), 0.08, 1),
        (lambda x, y, off: 0.012 + 0.25 * off, 0.02, 4),  # it grows with the width of cut
        (lambda x, y, off: 0.012 - 0.25 * off, 0.03, 5),
        (lambda x, y, off: np.where(x > 5.0, 0.01, -0.006), 0.25, 1),  # a step: the shift ramps over it
    ],
)
def test_what_is_left(error, left, turns):
    compensated = compensate(cut_by(error))
    walls = compensated.walls
    assert walls["mean_after_um"] <= left * walls["mean_before_um"]
    assert compensated.turns <= turns and compensated.changed
    # The same from the outside: the wall that the written path makes is the error less the way it lies outward.
    again = cut_by(error)(parse_program(compensated.rewritten.text))
    surface = (again.wall_mean[:, 1] * 1e3 - again.off)[again.made]
    untouched = cut_by(error)(parse_program(POCKET))
    before = np.abs(untouched.wall_mean[untouched.made, 1]).mean() * 1e3
    assert np.abs(surface).mean() <= (left + 0.01) * before
    assert compensated.rewritten.text.splitlines()[:4] == POCKET.splitlines()[:4]


def test_a_force_that_depends_on_the_shift_settles_all_the_same():
    compensated = compensate(cut_by(lambda x, y, off: 0.01 + 0.6 * off))
    assert compensated.walls["mean_after_um"] < 0.1 * compensated.walls["mean_before_um"]


@pytest.mark.parametrize(
    ("error", "width", "reason"),
    [
        (lambda x, y, off: 0.15 + 0.0 * x, 2.0, "the limit, 100.0 um"),
        (lambda x, y, off: 0.03 + 0.0 * x, 0.05, "half of the width of cut, 25.0 um"),
        (lambda x, y, off: np.where(np.abs(off) > 1e-5, -0.05 * np.sign(off), 0.01), 2.0, "worse"),
    ],
)
def test_what_is_left_alone(error, width, reason):
    """Beyond the limits, or where it would be worse, the program stays byte for byte."""
    compensated = compensate(cut_by(error, width=width))
    assert not compensated.changed and compensated.rewritten.text == POCKET
    assert any(reason in why for why in compensated.lines["left_alone"]) and all(compensated.lines["left_alone"])
    assert compensated.lines["size_after_um"] == compensated.lines["size_before_um"]


def test_a_line_left_alone_keeps_its_place_between_shifted_ones():
    def error(x, y, off):
        return np.where((y > 14.5) & (np.abs(x) <= 19.0), 0.2, 0.01)

    compensated = compensate(cut_by(error))
    rows = dict(zip(compensated.lines["line"], compensated.lines["left_alone"], strict=True))
    assert "limit" in rows[9] and sum(map(bool, rows.values())) == 1
    moves = parse_program(compensated.rewritten.text).moves
    ends = np.round(np.concatenate([moves.start[:, :2], moves.end[:, :2]], axis=1) * 1e3, 6).tolist()
    assert [20.0, 15.0, -20.0, 15.0] in ends
    for before, after, why in zip(*(compensated.lines[n] for n in ("size_before_um", "size_after_um", "left_alone")),
                                  strict=True):  # fmt: skip
        assert why or after < 0.4 * before


def test_two_walls_of_a_slot_share_what_a_shift_can_do():
    text = "G21 G90\nS9000 M3\nG0 X-40 Y0 Z5\nG1 Z-3 F250\nX40 F900\nG0 Z5\nM30\n"

    def evaluate(left, right):
        def cut(program):
            samples = sample_moves(program.moves, 1e-3)
            made = (samples.motion == 1) & (np.abs(samples.tangent[:, 0]) > 0.9)
            walls = np.where(made[:, None], np.array([[left, right]]) * 1e-6, np.nan)
            sides = dict.fromkeys(("wall_mean", "lowest", "highest"), walls)
            return SimpleNamespace(samples=samples, ae=made * 0.01, **sides, **STILL)

        return cut

    compensated = compensate(evaluate(8.0, -4.0), text)
    middle = [np.interp(0.5, [0, 1], [v, v]) for v in compensated.lines["shift_um"]]
    assert middle[0] > 5.5 and middle[1] < -5.5  # 6 um to the left but for the ramps: both are then off by 2
    assert max(compensated.lines["size_after_um"]) < 2.3
    assert not compensate(evaluate(8.0, 4.0), text).changed  # either way one of them would be worse


def test_a_program_without_walls_is_refused():
    with pytest.raises(InputError, match="no pass makes a wall"):
        compensate(cut_by(lambda x, y, off: x * np.nan))


def test_random_errors_never_get_worse():
    """Errors of place and shift, with steps: no wall of any program is worse, most are a fifth or less."""
    shares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        mean, wave, length, slope, step = rng.uniform([-0.03, 0.0, 3.0, -0.5, -0.01], [0.03, 0.01, 20.0, 0.5, 0.01])

        def error(x, y, off, mean=mean, wave=wave, length=length, slope=slope, step=step):
            return mean + wave * np.sin((x + y) / length) + slope * off + np.where(x > 0.0, step, 0.0)

        compensated = compensate(cut_by(error))
        before, after = (np.array(compensated.lines[f"size_{when}_um"]) for when in ("before", "after"))
        assert (after <= before + 0.1).all()
        shares.append(compensated.walls["left_percent"])
        again = cut_by(error)(parse_program(compensated.rewritten.text))
        surface = np.abs(again.wall_mean[:, 1] * 1e3 - again.off)[again.made]
        untouched = cut_by(error)(parse_program(POCKET))
        assert surface.mean() <= np.abs(untouched.wall_mean[untouched.made, 1]).mean() * 1e3
    assert np.median(shares) < 20.0


def test_result():
    compensated = compensate(cut_by(lambda x, y, off: 0.012 + 0.0 * x))
    document = compensated.to_dict()
    assert document["walls"]["mean_before_um"] == pytest.approx(12.0)
    assert set(document["lines"][0]) == set(compensated.to_frame().columns)
    assert "which no shift removes" in str(compensated) and "floors are not compensated" in str(compensated)


def test_where_every_shift_makes_walls_worse_elsewhere_nothing_is_shifted():
    """Also where moves that made no wall before make one then: the search for what may be shifted ends."""
    untouched, base = parse_program(POCKET, "pocket.nc"), cut_by(lambda x, y, off: 0.012 + 0.0 * x)

    def evaluate(program):
        cut = base(program)
        same = len(program.moves) == len(untouched.moves) and np.allclose(program.moves.end, untouched.moves.end)
        if not same:
            swinging = np.where(np.arange(len(cut.samples)) % 2, 5e-5, -5e-5)  # no shift takes that out
            cut.wall_mean[cut.made, 1] += swinging[cut.made]
            cut.wall_mean[(cut.samples.motion != 0) & ~cut.made & (cut.samples.position[:, 2] < 0.0), 1] = 1e-5
        return cut

    compensated = compensate(evaluate)
    assert not compensated.changed
    assert compensated.rewritten.text.splitlines() == POCKET.splitlines()
    assert all(compensated.lines["left_alone"])
