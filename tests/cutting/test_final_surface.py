"""Who makes the finished part, and stocks: on parts whose walls, floors and scallops are known."""

import struct

import numpy as np
import pytest

from tests.cutting.milling import Milling
from toolpath_stiff.cutting.final_surface import final_strip, finished_surface, walls_of_passes
from toolpath_stiff.cutting.stock import box_stock, stock_from_stl, stock_of_extents
from toolpath_stiff.errors import InputError

HEAD = "G21 G90 G17 F600\n"
# A pocket in two levels (lines 3 to 7, 8 to 12), then a wall pass 0.3 mm further out on the right side only.
LEVEL = "G1 Z-{z}\nX20\nY-10\nX0\nY0\n"
POCKET = HEAD + "G0 X0 Y0 Z5\n" + LEVEL.format(z=2) + LEVEL.format(z=4)


def of_line(milling, values, line):
    """Values of the samples inside of a line's move."""
    rows = np.flatnonzero(milling.samples.line == line)
    return values[rows[len(rows) // 4 : -len(rows) // 4]]


def test_the_last_pass_that_touches_a_wall_owns_it_over_the_height_that_stands():
    milling = Milling(POCKET + "G0 Z5\nM30\n")
    walls = walls_of_passes(*milling.context)[1] * 1e3
    assert np.isnan(of_line(milling, walls, 4)).all()  # the second level touches it again
    # Clockwise: the wall on the left, up to the stock's top; on the right, across, the island's.
    np.testing.assert_allclose(
        of_line(milling, walls, 9)[:, 0], [[0.0, 4.0]] * len(of_line(milling, walls, 9)), atol=1e-6
    )
    assert np.isnan(of_line(milling, walls, 9)[:, 1]).all()  # 10 mm apart: the cutter has taken the island


def test_a_spring_pass_owns_the_wall_and_a_roughing_pass_does_not():
    again = "G0 Z5\nG0 X0 Y0\nG1 Z-4\nX20\nG0 Z5\nG0 X0 Y0.4\nG1 Z-3\nX20\nG0 Z5\nM30\n"
    milling = Milling(POCKET + again)
    walls = walls_of_passes(*milling.context)[1] * 1e3
    assert np.isnan(of_line(milling, walls, 9)[:, 0]).all()
    # The spring pass keeps what stays below the last one, which is 3 deep and 0.4 further out.
    np.testing.assert_allclose(of_line(milling, walls, 16)[:, 0], [[0.0, 1.0]] * 10, atol=1e-6)
    np.testing.assert_allclose(of_line(milling, walls, 20)[:, 0], [[0.0, 3.0]] * 10, atol=1e-6)


def test_a_wall_through_the_stock_begins_at_its_underside():
    milling = Milling(HEAD + "G0 X-40 Y0 Z5\nG1 Z-12\nX70\nM30\n")
    np.testing.assert_allclose(
        of_line(milling, walls_of_passes(*milling.context)[1], 4)[20, 0], [2e-3, 12e-3], atol=1e-9
    )


@pytest.mark.parametrize(
    "corner, slope, over, strip",
    [
        (0.0, 0.0, 8.0, (-5.0, 3.0)),
        (5.0, 0.0, 1.0, (-0.5, 0.5)),
        (5.0, 0.0, 0.1, (0.0, 0.0)),
        (5.0, 0.2, 1.0, (-0.5, 0.5)),
        (2.0, 0.0, 6.0, (-3, 3)),
        (0.0, 0.2, 8.0, (-4.0, 4.0)),  # a trough: the edge behind is lower in the middle
        (2.0, 0.2, 6.0, (-3, 3)),
        (2.0, -0.2, 6.0, (-3, 3)),
    ],
)
def test_the_strip_between_two_passes_is_halfway_to_the_neighbours(corner, slope, over, strip):
    """Of a flat end on a level the later pass owns what both pass."""
    passes = "".join(
        f"G0 X-20 Y{y} Z25\nG1 Z{-3 + 20 * slope}\nX40 Z{-3 - 40 * slope}\nG0 Z25\n" for y in (0.0, over, 2.0 * over)
    )
    milling = Milling(HEAD + passes + "M30\n", corner=corner, low=(-30, -30, -20), high=(60, 60, 0))
    middle = of_line(milling, final_strip(*milling.context, np.full(len(milling.samples), True)), 8)[5] * 1e3
    np.testing.assert_allclose(middle, strip, atol=0.45)


def test_the_finished_part_has_the_heights_and_owners_of_its_passes():
    milling = Milling(POCKET + "G0 Z5\nM30\n")
    x, y, top, owner = finished_surface(milling.work, milling.samples, 1e-3)
    assert top.shape == owner.shape == (len(x), len(y)) == (90, 60)
    i, j = np.searchsorted(x, 10.2e-3), np.searchsorted(y, 0.2e-3)
    assert top[i, j] == pytest.approx(-4e-3)
    assert milling.samples.line[owner[i, j]] == 9
    np.testing.assert_allclose(milling.samples.position[owner[i, j], 0], x[i], atol=0.6e-3)
    assert top[0, 0] == 0.0 and owner[0, 0] == -1


def body(folder, text):
    """A pyramid cut off: 20 x 10 mm below, 10 x 5 above, 6 high; as STL, binary or text."""
    corners = np.array(
        [[sx * s, sy * s / 2, z] for z, s in ((0, 10), (6, 5)) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    quads = [(0, 3, 2, 1), (4, 5, 6, 7), *((k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4))]
    triangles = np.array([corners[list(three)] for q in quads for three in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))])
    path = folder / "body.stl"
    if text:
        facets = [
            "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t) + "endloop\nendfacet"
            for t in triangles
        ]
        path.write_text("\n".join(["solid body", *facets, "endsolid"]))
    else:
        rows = b"".join(struct.pack("<12fH", 0, 0, 0, *t.ravel(), 0) for t in triangles)
        path.write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + rows)
    return path


@pytest.mark.parametrize("text", [False, True])
def test_the_stock_of_an_stl_file_has_its_heights(tmp_path, text):
    stock = stock_from_stl(body(tmp_path, text), 0.5e-3)
    assert stock.top.shape == (40, 20)
    x, y = (np.random.default_rng(3).uniform(-edge, edge, 400) for edge in (11.0, 6.0))
    middle_x, middle_y = (np.abs(np.floor(values / 0.5) * 0.5 + 0.25) for values in (x, y))
    top = np.minimum(6.0, np.minimum((10.0 - middle_x) * 6.0 / 5.0, (5.0 - middle_y) * 6.0 / 2.5))
    np.testing.assert_allclose(stock.tops(x * 1e-3, y * 1e-3) * 1e3, np.where(top < 0.0, -np.inf, top), atol=1e-5)
    np.testing.assert_allclose(stock.bottoms(x * 1e-3, y * 1e-3), 0.0, atol=1e-12)


def test_stocks_that_cannot_be_are_refused(tmp_path):
    path = tmp_path / "cut_off.stl"
    path.write_bytes(body(tmp_path, False).read_bytes()[:-7])
    with pytest.raises(InputError, match=r"cut_off\.stl: no STL file, or one that is cut off"):
        stock_from_stl(path, 1e-3)
    with pytest.raises(InputError, match="cells of 1e-05 mm"):
        stock_from_stl(body(tmp_path, True), 1e-8)
    with pytest.raises(InputError, match="a stock of 10 x 0 x 5 mm"):
        box_stock((0.0, 0.0, 0.0), (0.01, 0.0, 0.005), "given")


def test_the_stock_of_the_extents_is_the_cuts_grown_by_the_radius():
    milling = Milling(HEAD + "G0 X0 Y0 Z5\nG1 Z-3\nX20\nY10 Z-4\nG0 Z5\nM30\n")
    stock = stock_of_extents(milling.moves, milling.cutters)
    np.testing.assert_allclose(stock.corner, [-5e-3, -5e-3])
    np.testing.assert_allclose(stock.cell, [30e-3, 20e-3])
    assert (stock.bottom[0, 0], stock.top[0, 0]) == (-4e-3, 0.0)
    assert "assumed" in stock.origin
