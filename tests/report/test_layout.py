"""Pictures and pages as they look: nothing is clipped, texts do not overlap, the width is used, dark pages are dark."""

from __future__ import annotations

import re
from itertools import combinations, pairwise

import numpy as np
import pytest
from matplotlib.text import Text

import toolpath_stiff as tps
from tests.browser import needs_browser, opened, painted, viridis
from tests.report.factory import short
from tests.stiffness.cases import nist
from tests.updating.cases import VERDICTS, diagnosed
from toolpath_stiff.analysis.grid import map_stiffness
from toolpath_stiff.analysis.loads import parse_load
from toolpath_stiff.comparison.compare import compare
from toolpath_stiff.placement.case_study import run_case_study
from toolpath_stiff.planning.menu import Menu
from toolpath_stiff.planning.visits import Visits
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.report import folder
from toolpath_stiff.report.analysis import page
from toolpath_stiff.report.batch.index import batch_page
from toolpath_stiff.report.diagnose import page as diagnose_html
from toolpath_stiff.report.map import page as map_page
from toolpath_stiff.report.pages import asset
from toolpath_stiff.report.pictures import files
from toolpath_stiff.report.pictures.diagnose import ladder
from toolpath_stiff.report.pictures.plan import MOST_LEVELS, visits_drawn
from toolpath_stiff.stiffness.model import build_model

TOUCH = 1.5  # pixels that boxes may share: they are a little larger than the letters


@pytest.fixture(scope="module")
def compared():
    return compare(nist(), read_measurements(["nist-table1"], nist()))


@pytest.fixture(scope="module")
def mapped():
    side, model = (-0.15, 0.15), build_model(nist())
    return map_stiffness(model, side, side, [0.4, 0.65, 0.9, 1.2], parse_load("radial"), 21, (0.0, 0.0, 0.0), 1000.0)


def shown_texts(figure):
    figure.draw_without_rendering()
    texts = [one for one in figure.findobj(Text) if one.get_visible() and one.get_text().strip()]
    boxes = [(one.get_text(), one.get_window_extent()) for one in texts]
    hidden = _beyond(figure)
    return [(text, box) for text, box in boxes if box.width > 0 and box.height > 0 and text not in hidden]


def _beyond(figure):
    """Words that are not drawn, at least not everywhere: of ticks beyond the limits of their axis."""
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            slack = 1e-9 * (high - low)
            for tick in axis.get_major_ticks():
                if not low - slack <= tick.get_loc() <= high + slack or not tick.label1.get_visible():
                    hidden.add(tick.label1.get_text())
    return hidden


def assert_whole_and_apart(figure):
    texts = shown_texts(figure)
    width, height = figure.bbox.size
    for text, box in texts:
        assert box.x0 >= -TOUCH and box.x1 <= width + TOUCH, text
        assert box.y0 >= -TOUCH and box.y1 <= height + TOUCH, text
    for (first, one), (second, other) in combinations(texts, 2):
        across = min(one.x1, other.x1) - max(one.x0, other.x0)
        up = min(one.y1, other.y1) - max(one.y0, other.y0)
        assert min(across, up) <= TOUCH, (first, second)


def used_width(figure):
    boxes = [axes.get_tightbbox() for axes in figure.axes if axes.axison]
    return (max(box.x1 for box in boxes) - min(box.x0 for box in boxes)) / figure.bbox.width


@pytest.mark.parametrize("pose", [(-300, 300, 300, -30, 0, 0), (0, 0, 800, 0, 0, 0)])
@pytest.mark.parametrize("machine", ["nist", "genhexkins", "nategh_agheli"])
def test_the_machine_is_drawn_from_two_sides(machine, pose):
    figure = tps.Machine.load(machine).plot(pose)
    assert used_width(figure) > 0.9 and "strut1 " in figure.texts[-1].get_text()


def test_slices_of_a_map_fill_their_rows_and_no_figure_lies_on_another(mapped):
    figure = folder.figure(mapped)
    assert len({round(axes.get_position().x0, 3) for axes in figure.axes[:4]}) == 2
    assert_whole_and_apart(figure)


def test_the_regions_of_the_case_study_are_whole_and_apart():
    figure = folder.figure(run_case_study(build_model(nist())))
    assert_whole_and_apart(figure)
    assert used_width(figure) > 0.95


def test_the_scatter_uses_its_width(compared):
    figure = folder.figure(compared, "measured_modelled.png")
    assert used_width(figure) > 0.9
    assert_whole_and_apart(figure)


# -- the plan ----------------------------------------------------------------------------------------------------------


def visits_at(z):
    """Visits at these heights, each elsewhere; what else they are is not drawn."""
    count = len(z)
    pose = np.zeros((count, 6))
    pose[:, 0], pose[:, 2] = 0.02 * np.arange(count), z
    none, empty = np.zeros(count), np.full(count, "")
    index = np.arange(count)
    return Visits(Menu(), pose, none, none, empty, empty, empty, None, empty, index, index, index)


@pytest.mark.parametrize("heights", [[0.43, 0.78, 1.2, 1.49], [0.07, 0.43, 0.78, 1.13, 1.49, 1.2], [0.5]])
def test_every_pose_is_in_the_panel_of_its_own_height(heights):
    visits = visits_at(np.array([*heights, heights[0]]))
    count = len(heights) + 1
    with files.house_style():
        figure = visits_drawn(visits, range(count), ["vertical"] * count, ("title", "text"))
    found = {}
    for axes in figure.axes:
        z = float(re.match(r"z = ([\d.]+) mm", axes.get_title(loc="left")).group(1))
        found[z] = sorted(float(line.get_xdata()[0]) for line in axes.lines)
    expected = {1e3 * z: [] for z in heights}
    for x, _, z, *_ in 1e3 * visits.pose:
        expected[float(np.round(z, 3))].append(float(x))
    assert found.keys() == {round(z, 3) for z in expected}
    for z, places in expected.items():
        assert found[round(z, 3)] == pytest.approx(sorted(places))
    assert_whole_and_apart(figure)


def test_many_heights_are_put_together_with_their_neighbours():
    visits = visits_at(np.linspace(0.4, 1.2, 30))
    with files.house_style():
        axes = visits_drawn(visits, range(30), ["vertical"] * 30, ("title", "text")).axes
    assert len(axes) == MOST_LEVELS
    ends = [list(map(float, re.findall(r"[\d.]+", each.get_title(loc="left")))) for each in axes]
    assert all(high < low for (_, high), (low, _) in pairwise(ends)) and (ends[0][0], ends[-1][1]) == (400.0, 1200.0)


# -- pages -------------------------------------------------------------------------------------------------------------


def test_all_pages_have_one_style_sheet_with_a_dark_half(mapped):
    analysis = short()
    pages = {
        "analysis": "".join(page(analysis, {})),
        "batch": batch_page([]),
        "map": "".join(map_page(mapped, {})),
        "diagnosis": diagnose_html(diagnosed(*VERDICTS["identified"]), {}),
    }
    shared = asset("page.css")
    assert "prefers-color-scheme: dark" in shared
    for name, text in pages.items():
        assert text.count(shared) == 1, name
        assert (
            text.count("prefers-color-scheme: dark)") - text.count('matchMedia("(prefers-color-scheme: dark)")') == 1
        ), name
        assert "Content-Security-Policy" in text, name
        # Every colour that a rule names is declared.
        used, declared = set(re.findall(r"var\((--[a-z-]+)", text)), set(re.findall(r"(--[a-z-]+):", text))
        assert used <= declared | {"--natural", "--digits", "--scale"}, name


@needs_browser
def test_surfaces_of_a_map_stand_above_their_planes(tmp_path):
    """Seen from the front a surface rises from its plane: the stiffest is higher on the screen than the softest."""
    one = map_stiffness(build_model(nist()), (-0.1, 0.1), (-0.1, 0.1), [0.8], parse_load("radial"), 9)
    front = "document.querySelector('[data-view=front]').click()"
    rows = painted("".join(map_page(one, {})), tmp_path, front)["view"]
    ramp = [rows[colour] for colour in viridis(0.0, 0.93) if colour in rows]  # softest first
    assert len(ramp) > 5
    assert ramp[-1] < ramp[0] - 50


def test_a_picture_stands_in_a_page_as_wide_as_it_was_drawn():
    found = diagnosed(*VERDICTS["ambiguous"])
    text = diagnose_html(found, {"ladder.png": files.picture_file("ladder.png", ladder, found, files.SHARP)})
    assert text.count('class="picture"') == 1 and '<img alt="" style="--natural:1400px" src="data:image/png' in text


@needs_browser
def test_a_picture_is_saved_from_its_page_under_its_name(tmp_path):
    # Under the page's own policy, which lets no other script run.
    found, file = diagnosed(*VERDICTS["ambiguous"]), tmp_path / "report.html"
    drawn = {"ladder.png": files.picture_file("ladder.png", ladder, found, files.SHARP)}
    file.write_text(diagnose_html(found, drawn), encoding="utf-8")
    done = opened(file.as_uri(), tmp_path)
    ((picture,), (link,)) = (re.findall(tag, done.stdout) for tag in ('<img [^>]*src="([^"]*)"', "<a [^>]*>PNG</a>"))
    assert f'href="{picture}"' in link and 'download="ladder.png"' in link
    assert "CONSOLE" not in done.stderr
