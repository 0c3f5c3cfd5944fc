"""Engagement against closed forms, and against a simulation of discs that shares nothing with it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cutting.milling import Milling
from toolpath_stiff.cutting import engagement, workpiece
from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.courses import move_lengths, points_along

HEAD = "G21 G90 G17 F600\n"
SLOT = "G0 X-40 Y0 Z5\nG1 Z-3\nX70\nG0 Z5\n"  # D10, 3 deep


def beside(offset, back=False):
    """A second pass at an offset from the slot, the other way round where it goes back."""
    start, end = (70, -40) if back else (-40, 70)
    return HEAD + SLOT + f"G0 X{start} Y{offset}\nG1 Z-3\nX{end}\nM30\n"


def angle_of(immersion):
    """Degrees of contact of a D10 cutter at a radial immersion, mm."""
    return np.degrees(np.arccos(1.0 - immersion / 5.0))


@pytest.mark.parametrize(
    "text, entry, exit_",
    [
        (HEAD + SLOT + "M30\n", 0.0, 180.0),
        (beside(5.0), 0.0, angle_of(5.0)),  # up: the work on the left
        (beside(-5.0), 180.0 - angle_of(5.0), 180.0),
        (beside(1.0), 0.0, angle_of(1.0)),
        (beside(1.0, back=True), 180.0 - angle_of(1.0), 180.0),
        (beside(0.05), 0.0, angle_of(0.05)),
    ],
)
def test_contact_of_slots_and_walls_is_that_of_the_closed_form(text, entry, exit_):
    np.testing.assert_allclose(Milling(text).contact(10.0), [[0.0, 3.0, entry, exit_]], atol=2e-3)


def test_a_spring_pass_and_air_touch_nothing():
    milling = Milling(beside(0.0))
    patches, removed = milling.engaged()
    second = milling.samples.line > 6
    assert removed[second].sum() < 1e-6 * removed.sum()
    assert not np.isin(patches.station, np.flatnonzero(second)).any()


def test_levels_of_the_stock_are_layers_and_the_underside_ends_them():
    # A step of 1 mm by a slot beside, then a pass over both and through the underside at -10.
    text = HEAD + "G0 X-40 Y5 Z5\nG1 Z-1\nX70\nG0 Z5\nG0 X-40 Y0\nG1 Z-12\nX70\nM30\n"
    rows = Milling(text).contact(10.0)
    # On its left side up to the middle the slot is 1 mm deep.
    np.testing.assert_allclose(rows, [[2.0, 11.0, 0.0, 180.0], [11.0, 12.0, 90.0, 180.0]], atol=2e-3)


@pytest.mark.parametrize("offset, depth", [(0.3, 0.2), (1.0, 3.0), (2.0, 1.0)])
def test_contact_of_a_ball_raster(offset, depth):
    text = HEAD + f"G0 X-40 Y0 Z5\nG1 Z-{depth}\nX70\nG0 Z5\nG0 X-40 Y{offset}\nG1 Z-{depth}\nX70\nM30\n"
    milling = Milling(text, corner=5.0)
    for low, high, entry, exit_ in milling.contact(10.0):
        radius = np.sqrt(25.0 - (5.0 - 0.5 * (low + high)) ** 2)  # of the ring; that of the first pass lies beside
        assert entry == pytest.approx(0.0, abs=2e-3)
        assert exit_ == pytest.approx(np.degrees(np.arccos(np.clip(1.0 - offset / radius, -1.0, 1.0))), rel=2e-3)
    y = np.linspace(-5.0, 5.0 + offset, 200_001)  # mm: what the second profile takes
    first, second = (5.0 - depth - np.sqrt(np.maximum(25.0 - (y - at) ** 2, 0.0)) for at in (0.0, offset))
    area = np.trapezoid(np.clip(np.minimum(first, 0.0) - np.minimum(second, 0.0), 0.0, None), y)
    station = np.flatnonzero(np.abs(milling.samples.position[:, 0] - 0.01) < 1e-9)[-1]
    assert milling.removed()[station] * 1e9 == pytest.approx(area, rel=5e-3)  # of the mm before


MIXED = (
    HEAD + "G0 X-20 Y0 Z5\nG1 Z-1\nX10 Y3\nG3 X10 Y13 I-1 J5 Z-2\nG2 X4 Y13 I-3 J0\nG1 X-5 Y14 Z-3.5\n"
    "G1 X-12 Y6\nG3 X-12 Y6 I4 J0 Z-4.5\nG1 X-12 Y-4\nX-2 Y-6 Z-2\nM30\n"
)


def simulated(milling, station, angle, height):
    """Whether points of the cutter lie in what its bodies every 20 um of path leave, up to a tenth of a mm before."""
    moves, samples, cutter = milling.moves, milling.samples, milling.cutter
    lengths = move_lengths(moves)
    row = samples.move[station]
    share = (samples.s[station] - samples.s[samples.move == row][0]) / lengths[row]
    tip, ahead = samples.position[station], samples.tangent[station] / np.hypot(*samples.tangent[station, :2])
    flat = cutter.radius - cutter.corner_radius
    inset = np.sqrt(np.maximum(cutter.corner_radius**2 - np.maximum(cutter.corner_radius - height, 0.0) ** 2, 0.0))
    x = tip[0] + (flat + inset) * (np.sin(angle) * ahead[0] - np.cos(angle) * ahead[1])
    y = tip[1] + (flat + inset) * (np.sin(angle) * ahead[1] + np.cos(angle) * ahead[0])
    top = np.zeros(len(angle))
    for move in np.flatnonzero(moves.motion[: row + 1] != 0):
        end = share - 1e-4 / lengths[row] if move == row else 1.0
        count = int(lengths[move] * max(end, 0.0) / 2e-5) + 2
        for x0, y0, z0 in points_along(moves, np.full(count, move), np.linspace(0.0, max(end, 0.0), count))[0]:
            distance = np.hypot(x - x0, y - y0)
            covered = np.maximum(distance - flat, 0.0)
            rise = cutter.corner_radius - np.sqrt(np.maximum(cutter.corner_radius**2 - covered**2, 0.0))
            top = np.where(distance <= cutter.radius, np.minimum(top, z0 + rise), top)
    return top > tip[2] + height


@pytest.mark.parametrize("corner", [0.0, 5.0, 1.5])
def test_contact_along_lines_arcs_ramps_and_helices_is_that_of_simulated_discs(corner):
    milling = Milling(MIXED, corner=corner, step=2.0)
    patches = milling.engaged()[0]
    rng = np.random.default_rng(1)
    within = np.diff(milling.samples.move, prepend=-1) == 0  # a move
    stations = np.flatnonzero((np.bincount(patches.station, minlength=len(within)) > 0) & within)
    wrong = points = 0
    for station in stations[:: max(len(stations) // 8, 1)]:
        some = patches.take(patches.station == station)
        middle = 0.5 * (some.low + some.high)
        angle = rng.uniform(0.06, np.pi - 0.06, 40 * len(middle))  # off the sides, where the last 0.1 mm cuts
        row = rng.integers(len(middle), size=len(angle))
        near = [np.abs(ends[None, :] - angle[:, None]).min(axis=1) < 0.03 for ends in (some.entry, some.exit)]
        clear = ~(near[0] | near[1])
        angle, height = angle[clear], middle[row[clear]]
        inside = (some.low <= height[:, None]) & (height[:, None] <= some.high)
        inside &= (some.entry <= angle[:, None]) & (angle[:, None] <= some.exit)
        wrong += np.sum(simulated(milling, station, angle, height) != inside.any(axis=1))
        points += len(angle)
    assert points > 500
    assert wrong <= 0.002 * points


@pytest.mark.parametrize("changes", [{"CELL": 0.15}, {"STAGE": 10, "BEFORE": 8}, {"MANY": 1}])
def test_neither_cells_nor_stages_nor_compiled_loops_change_the_contact(monkeypatch, changes):
    monkeypatch.setattr(engagement, "STRIDES", (1,))  # which stations share a contact is told within a stage
    plain, volume = Milling(MIXED, corner=1.5).engaged()
    for name, value in changes.items():
        if name == "MANY":
            pytest.importorskip("numba")
        monkeypatch.setattr(workpiece, name, value)
    milling = Milling(MIXED, corner=1.5)
    assert len(milling.stages) > 3 or "STAGE" not in changes
    patches, removed = milling.engaged()
    np.testing.assert_array_equal(patches.station, plain.station)
    for name in ("low", "high", "entry", "exit"):
        np.testing.assert_allclose(getattr(patches, name), getattr(plain, name), atol=1e-7)
    np.testing.assert_allclose(removed, volume, atol=1e-15, rtol=1e-6)


@pytest.mark.parametrize("corner, body", [(0.0, np.pi * 25 * 6), (5.0, np.pi * 25 * 6 - np.pi * 125 / 3)])
def test_a_plunge_removes_and_has_no_contact(corner, body):
    milling = Milling(HEAD + "G0 X0 Y0 Z2\nG1 Z-6\nG0 Z5\nM30\n", corner=corner, step=0.1)
    patches, removed = milling.engaged()
    assert len(patches.low) == 0
    assert removed.sum() * 1e9 == pytest.approx(body, rel=5e-3)


def test_a_helical_bore_has_its_volume_and_contact_all_around():
    turns = "".join(f"G3 X3 Y0 I-3 J0 Z{z}\n" for z in (-1, -2, -3, -4))
    milling = Milling(HEAD + "G0 X3 Y0 Z0\nG1 Z0\n" + turns + "G3 X3 Y0 I-3 J0\nM30\n", step=0.5)
    patches, removed = milling.engaged()
    assert removed.sum() * 1e9 == pytest.approx(np.pi * 64 * 4, rel=2e-3)
    assert patches.exit.max() == pytest.approx(np.pi) and patches.high.max() * 1e3 < 1.01


def test_an_inner_corner_is_the_peak():
    text = HEAD + "G0 X0 Y0 Z5\nG1 Z-3\nX20\nY20\nG0 Z5\nG0 X0 Y-0.5\nG1 Z-3\nX20.5\nY20\nM30\n"
    milling = Milling(text, low=(-30, -30, -10), high=(60, 60, 0), step=0.5)
    along, last = milling.contact(15.0, line=9), milling.contact(20.5, line=9)
    np.testing.assert_allclose(along, [[0.0, 3.0, 180.0 - angle_of(0.5), 180.0]], atol=5e-3)
    # At the end of the first wall the front is in cut up to the second slot's wall, which lies 4.5 mm ahead.
    np.testing.assert_allclose(last, [[0.0, 3.0, 90.0 - angle_of(0.5), 180.0]], atol=5e-3)


@settings(max_examples=6, deadline=None)
@given(
    points=st.lists(st.tuples(st.integers(-20, 20), st.integers(-12, 12), st.integers(1, 8)), min_size=2, max_size=6),
    corner=st.sampled_from([0.0, 5.0, 2.0]),
)
def test_what_is_removed_is_what_is_missing(points, corner):
    moves = [f"G1 X{x} Y{y} Z-{0.5 * z}" for x, y, z in points]
    begin = HEAD + f"G0 X{points[0][0]} Y{points[0][1]} Z1"
    milling = Milling("\n".join([begin, *moves, "G0 Z5", "M30", ""]), corner=corner)
    edge = 0.25
    x, y = (np.arange(-29.9, 30, edge) * 1e-3 for _ in "xy")
    x, y = (grid.ravel() for grid in np.meshgrid(x, y))
    every = np.full(len(x), len(milling.work.pieces))
    depth = -milling.work.tops(x, y, (np.zeros_like(every), every))[0] * 1e3
    assert milling.removed().sum() * 1e9 == pytest.approx(depth.sum() * edge**2, rel=0.02, abs=1.0)


def test_a_tool_that_nobody_described_is_refused_with_its_line():
    with pytest.raises(ProgramError, match="tool 3 cuts but its geometry is not known") as error:
        Milling(HEAD + "T3 M6\nG1 X10\nM30\n")
    assert error.value.line == 3


@pytest.mark.parametrize(
    "moves, lines",
    [
        ("G0 X-40 Y0 Z5\nG1 Z-3\nX0\nG0 X20\nZ5\n", [5, 6]),  # on through the material, and up out of it
        ("G0 X-40 Y0 Z5\nG1 Z-3\nX0\nG0 X-20\nZ5\n", []),  # back through its own slot
        ("G0 X1 Y1\nZ-2\nG1 X10\nG0 Z5\n", [3]),  # down into it, from nobody knows where
        ("G0 X-36 Y0\nZ-2\nG1 X10\nG0 Z1\nX50 Y20\n", []),
        ("G0 X-36 Y0\nZ-2\nG1 X10\nG0 Z1\nX50 Y20 Z-0.5\n", [6]),
    ],
)
def test_rapids_through_material_are_told_by_their_lines(moves, lines):
    milling = Milling(HEAD + moves + "M30\n")
    milling.engaged()
    assert np.unique(milling.samples.line[milling.engagement.struck]).tolist() == lines
