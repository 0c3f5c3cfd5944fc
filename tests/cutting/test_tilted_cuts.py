"""Tools that stand aslant: a cut turned as a whole is the same cut; operations of several tilts against manifold3d."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from toolpath_stiff.cutting.cut import evaluate_cut
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.engagement import engage
from toolpath_stiff.cutting.final_surface import final_strip, walls_of_passes
from toolpath_stiff.cutting.patches import of_stations
from toolpath_stiff.cutting.setup import read_setup
from toolpath_stiff.cutting.stations import samples_seen
from toolpath_stiff.cutting.stock import box_stock
from toolpath_stiff.cutting.workpiece import stages_of
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.courses import points_along
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.path.placing import place
from toolpath_stiff.path.sampling import sample_moves
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.model import build_model

HEAD = "G21 G90 G17 F600\nT1 M6 S6000 M3\n"
FACED = "G0 X-60 Y-60 Z30\nG1 Z0\n" + "".join(
    f"X60\nY{y + 8}\nX-60\nY{y + 16}\n" for y in range(-60, 60, 16)
)  # a plane in the frame of the tool, whatever the stock's
BODY = "G0 Z5\nG0 X-20 Y0\nG1 X-10 Z-3\nX15\nG3 X20 Y5 I0 J5\nG1 Y15\nX-10\nY4\nX10 Z-5\nG0 Z5\nM30\n"
TILTS = [(0.3, 0.0, 0.0), (0.2, -0.5, 0.4), (0.0, np.pi / 2.0, 0.0)]


class Tilted:
    """Moves of a cutter D10 through a box, mm."""

    def __init__(self, moves, half, corner=0.0, low=None, high=None):
        self.moves, cutters = moves, {tool: Cutter(tool, 10e-3, corner * 1e-3, 3, 0.5) for tool in (0, 1)}
        self.samples = sample_moves(moves, 1e-3)
        stock = box_stock(
            tuple(np.multiply(low or (-half,) * 3, 1e-3)), tuple(np.multiply(high or (half,) * 3, 1e-3)), ""
        )
        engaged = engage(stages_of(stock, moves, cutters), moves, self.samples, cutters)
        self.removed, self.patches = engaged.removed * 1e9, of_stations(engaged.patches, engaged.source)
        context = engaged.work, *samples_seen(engaged.work, self.samples), cutters
        self.walls = walls_of_passes(*context)[1]
        self.strips = final_strip(*context, np.full(len(self.samples), True))


def as_a_whole(moves, abc):
    """The program turned about its zero, its tools with it."""
    turned = place(moves, (0.0, 0.0, 0.0, *abc))
    ends = (np.column_stack([end[:, :3], np.tile(abc, (len(end), 1))]) for end in (turned.start, turned.end))
    return replace(turned, **dict(zip(("start", "end"), ends, strict=True)))


@pytest.mark.parametrize(("abc", "corner"), [*zip(TILTS, [0.0, 5.0, 2.0], strict=True)])  # each once
def test_a_cut_turned_as_a_whole_is_the_same_cut(abc, corner):
    text = HEAD + FACED + BODY
    moves = parse_program(text).moves
    upright, tilted = Tilted(moves, 80.0, corner), Tilted(as_a_whole(moves, abc), 120.0, corner)
    body = upright.samples.line > text[: text.index(BODY)].count("\n")
    np.testing.assert_allclose(tilted.removed[body].sum(), upright.removed[body].sum(), rtol=1e-5)
    np.testing.assert_allclose(tilted.removed[body], upright.removed[body], atol=2e-3)
    sizes = [
        np.bincount(cut.patches.station, (cut.patches.exit - cut.patches.entry) * (cut.patches.high - cut.patches.low))
        for cut in (upright, tilted)
    ]
    np.testing.assert_allclose(sizes[1][body[: len(sizes[1])]], sizes[0][body[: len(sizes[0])]], atol=3e-5)
    both = np.isfinite(upright.walls) & np.isfinite(tilted.walls)
    assert (both == np.isfinite(upright.walls))[body].mean() > 0.98
    both[~body] = False
    np.testing.assert_allclose(tilted.walls[both], upright.walls[both], atol=1e-7)


def aslant(abc, way):
    """Words of a way (G0 or G1, point in the frame of the tool), mm and degrees."""
    turn = rotation_matrices(np.radians(abc))
    words = (
        f"G{code} X{x:.5f} Y{y:.5f} Z{z:.5f}" for code, (x, y, z) in ((g, turn @ np.array(p, float)) for g, p in way)
    )
    return "".join(f"{word} A{abc[0]} B{abc[1]} C{abc[2]}\n" for word in words)


SLOT = HEAD + "G0 X-40 Y0 Z25\nG0 Z-3\nG1 X0\nG1 X5 Y30\nG0 Z25\n"
CHAMFER = [
    (0, (-2, -40, 60)),
    (0, (-2, -40, 15)),
    (1, (-2, 40, 15)),
    (1, (4, 40, 13)),
    (1, (4, -40, 13)),
    (0, (4, -40, 60)),
]
FROM_THE_SIDE = [(0, (-40, -4, 60)), (0, (-40, -4, 15)), (1, (40, -4, 15)), (1, (40, -8, 12)), (1, (-40, -8, 12))]
LAST = "G0 X-40 Y-8 Z60\nG0 A0 B0 C0\nG0 Z-9\nG1 X40\nG0 Z25\nM30\n"
SEVERAL = SLOT + aslant((0, 50, 0), CHAMFER) + aslant((90, 0, 0), FROM_THE_SIDE) + LAST


@pytest.mark.parametrize(("corner", "rel"), [(0.0, 5e-3), (5.0, 7e-3)])
def test_operations_of_several_tilts_remove_what_manifold3d_says(corner, rel):
    """Each meets what the others left: a slot, a chamfer, a step from the side, and again from above."""
    manifold3d = pytest.importorskip("manifold3d")
    low, high, corners = (-30, -20, -20), (30, 20, 0), 512
    cut = Tilted(parse_program(SEVERAL).moves, 0.0, corner, low, high)
    radius = 5.0 / np.sqrt(np.sin(2.0 * np.pi / corners) / (2.0 * np.pi / corners))
    tool = manifold3d.Manifold.cylinder(90.0 - corner, radius, radius, corners).translate((0, 0, corner))
    if corner:
        ball = manifold3d.Manifold.sphere(5.0, corners).translate((0, 0, corner))
        tool = manifold3d.Manifold.batch_hull([ball, tool])
    left, moves = manifold3d.Manifold.cube(tuple(np.subtract(high, low))).translate(low), cut.moves
    for row in np.flatnonzero(moves.motion != 0):
        turn = rotation_matrices(moves.start[row, 3:])
        ends = points_along(moves, np.full(2, row), np.array([0.0, 1.0]))[0] * 1e3
        before = left.volume()
        left -= manifold3d.Manifold.batch_hull([tool.transform(np.column_stack([turn, end])) for end in ends])
        removed = cut.removed[cut.samples.move == row].sum()
        assert removed == pytest.approx(before - left.volume(), rel=rel, abs=2.0), moves.line[row]


SETUP = """
[stock]
box_mm = [200, 200, 200]
corner_mm = [-100, -100, -100]
[coefficients]
cutting_N_per_mm2 = [800, 250, 150]
edge_N_per_mm = [20, 25, 2]
origin = "made up"
[[tool]]
number = 1
diameter_mm = 10
flutes = 3
helix_deg = 30
corner_radius_mm = 0
lateral_nm_per_N = 0
axial_nm_per_N = 0
"""


def test_forces_are_the_tool_s_and_the_machine_gives_way_where_it_stands(tmp_path):
    (tmp_path / "cut.toml").write_text(SETUP)
    setup, origin, abc = read_setup(tmp_path / "cut.toml"), (0.0, 0.0, 0.8, 0.0, 0.0, 0.0), (0.0, 0.1, 0.0)
    read = parse_program(HEAD + FACED + BODY, "part.nc")
    turned, model = replace(read, moves=as_a_whole(read.moves, abc)), build_model(load_machine("nist"))
    upright, tilted = (evaluate_cut(model, program, origin, setup, 2e-3) for program in (read, turned))
    body = upright.samples.line > (HEAD + FACED).count("\n")
    np.testing.assert_allclose(tilted.mean_force[body], upright.mean_force[body], atol=0.05)
    row = int(np.flatnonzero(body & (tilted.samples.line == upright.samples.line[body][0] + 3))[3])
    position = tilted.samples.position[[row]] + origin[:3]
    turn = rotation_matrices(abc)
    compliance = core.tip_compliance(model, position, turn[None])[0]
    x = upright.samples.tangent[row] @ turn.T
    axes = np.stack([x, np.cross(turn[:, 2], x), turn[:, 2]], axis=1)
    expected = axes.T @ compliance @ axes @ tilted.mean_force[row]
    np.testing.assert_allclose(tilted.deflection[row], expected, rtol=1e-5)
    assert np.nanmax(np.abs(tilted.wall_mean[body] - upright.wall_mean[body])) > 1e-8  # another compliance


def test_a_mill_that_turns_the_work_gives_way_along_the_axes_of_the_work(tmp_path):
    """Its table tilts: the compliance of the cut, in work axes, against loads in the axes of its base."""
    (tmp_path / "cut.toml").write_text(SETUP)
    mill = Path(__file__).parents[1] / "machine" / "data" / "mill5.toml"
    lines = ["G0 X-60 Y0 Z40", "G0 A-30", "G0 Z-2", "G1 X60"]
    program = tps.Program.from_text(HEAD + "\n".join([*lines, "M30"]), name="tilted.nc")
    found = tps.analyze(program, mill, cut=tmp_path / "cut.toml", step_mm=10.0)
    row = int(np.flatnonzero(found.cut.ap > 0.0)[-1])
    samples, model = found.samples, found.model
    at = samples.position[[row]], rotation_matrices(samples.abc[[row]]), samples.tool_length[[row]]
    machine = model.machine.with_changes(only=model.machine.configurations.index(found.at.configuration))
    stance = machine.solve(*at)
    base = stance.tip_compliance()[0, :3, :3]  # in the axes of the base
    tool = stance.rotation[0]  # the tool there, along Z of the machine
    np.testing.assert_allclose(np.abs(tool[2, 2]), 1.0, atol=1e-9)
    feed = stance.work_axes[0] @ samples.tangent[row]
    axes = np.stack([feed, np.cross(tool[:, 2], feed), tool[:, 2]], axis=1)
    expected = axes.T @ base @ axes @ found.cut.mean_force[row]
    np.testing.assert_allclose(found.cut.deflection[row], expected, rtol=1e-5)


def test_lines_on_which_the_tool_turns_or_stands_aslant_are_left_alone_by_name(tmp_path):
    (tmp_path / "cut.toml").write_text(SETUP)
    lines = [
        "G0 X-120 Y-100 Z110",
        "G0 Z96",
        "G1 X120",
        "G0 Z110",
        "G0 Y100",
        "G0 Z97",
        "G1 X110 A3",
        "G0 Z160",
        "G0 A30",
    ]
    lines += ["G0 X-120 Y0 Z96", "G1 X120", "G0 Z160", "M30"]
    program = tps.Program.from_text(HEAD + "\n".join(lines), name="part.nc")
    (tmp_path / "points.csv").write_text(
        "x_mm,y_mm,z_mm,nx,ny,nz,deviation_um\n40,-95,98,0,-1,0,9\n60,-95,98,0,-1,0,9\n"
    )
    compared = tps.compare_walls(tmp_path / "points.csv", program=program, cut=tmp_path / "cut.toml")
    assert [row["line"] for row in compared.lines] == [5]
    assert any(note.startswith("lines 9: the tool turns along the move: no error") for note in compared.notes)
    assert "lines 13: not compared: the tool is tilted" in compared.notes
    compensated = tps.compensate(program, cut=tmp_path / "cut.toml")
    left = dict(zip(compensated.lines["line"], compensated.lines["left_alone"], strict=True))
    assert left[5] == "" and left[13].endswith("a tilted tool") and 9 not in left
    assert "lines 9: not shifted: the tool turns along the move" in compensated.notes


def posed(place, rotary):
    """Axes of the tool and its tip, (3, 4), mm."""
    return np.column_stack([rotation_matrices(np.radians(rotary)), place])


@pytest.mark.parametrize(("corner", "rel"), [(0.0, 0.015), (1.5, 0.015), (5.0, 0.025)])
def test_a_tool_that_turns_on_its_way_removes_what_manifold3d_says(corner, rel):
    """Wave after wave, tilted up to 15 degrees each way: hulls of the cutter every half degree."""
    manifold3d = pytest.importorskip("manifold3d")
    low, high, corners, radius = (-25, -12, -8), (10, 12, 0), 64, 5.0
    radius /= np.sqrt(np.sin(2.0 * np.pi / corners) / (2.0 * np.pi / corners))
    tool = manifold3d.Manifold.cylinder(60.0 - corner, radius, radius, corners).translate((0, 0, corner))
    if corner:
        ball = manifold3d.Manifold.sphere(corner, corners)
        ball = ball.scale([np.cbrt(4.0 / 3.0 * np.pi * corner**3 / ball.volume())] * 3)
        around = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
        rim = [ball.translate(((5 - corner) * np.cos(a), (5 - corner) * np.sin(a), corner)) for a in around]
        tool = manifold3d.Manifold.batch_hull([*rim, tool])
    x = np.linspace(-31.0, 10.0, 8)
    places = np.stack([x, -2.0 + 0.0 * x, -2.0 + 0.5 * np.sin(x / 5.0)], axis=1)
    rotary = np.stack([-15.0 * np.sin(x / 12.0), 15.0 * np.cos(x / 16.0), 0.0 * x], axis=1)
    rows = zip(places, rotary, strict=True)
    words = ["X{:.6f} Y{:.6f} Z{:.6f} A{:.6f} B{:.6f}".format(*place, *turn[:2]) for place, turn in rows]
    text = HEAD + "G0 Z40\n" + "\n".join([f"G0 {words[0]}", *(f"G1 {word}" for word in words[1:]), "G0 Z40\nM30\n"])
    cut = Tilted(parse_program(text).moves, 0.0, corner, low, high)
    left, moves = manifold3d.Manifold.cube(tuple(np.subtract(high, low))).translate(low), cut.moves
    removed = np.bincount(cut.samples.move, cut.removed, len(moves))[np.flatnonzero(moves.motion != 0)]
    for row, volume in enumerate(removed):
        ends, before = (places[row : row + 2], rotary[row : row + 2]), left.volume()
        shares = np.linspace(0.0, 1.0, int(np.ceil(np.abs(np.diff(ends[1], axis=0)).max() / 0.5)) + 1)
        poses = [tool.transform(posed(*(end[0] + share * (end[1] - end[0]) for end in ends))) for share in shares]
        left -= manifold3d.Manifold.batch_boolean(
            [manifold3d.Manifold.batch_hull(list(pair)) for pair in itertools.pairwise(poses)], manifold3d.OpType.Add
        )
        assert volume == pytest.approx(before - left.volume(), rel=rel, abs=0.1)
