from __future__ import annotations

import io
import itertools
import subprocess
import sys
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.image import imread
from scipy.ndimage import uniform_filter

from tests.report.factory import make_analysis, short, spiral
from toolpath_stiff.report.colours import CLASSES, SLATE
from toolpath_stiff.report.curves import extremes_by_column, profile_curve, scale_limits
from toolpath_stiff.report.pictures import drawing
from toolpath_stiff.report.pictures import path as path_module
from toolpath_stiff.report.pictures.files import house_style, picture_file
from toolpath_stiff.report.pictures.path import UNREACHABLE, path, segment_classes
from toolpath_stiff.report.pictures.profile import _set_limits, profile
from toolpath_stiff.report.pictures.style import new_figure


def path_picture(analysis, **look) -> bytes:
    return picture_file("path.png", path, analysis, **look)


def profile_picture(analysis, **look) -> bytes:
    return picture_file("profile.png", profile, analysis, **look)


def pixels(png: bytes) -> np.ndarray:
    return imread(io.BytesIO(png), format="png")[:, :, :3]


def count_colour(png: bytes, rgb: tuple[int, int, int]) -> int:
    return int((np.abs(pixels(png) - np.array(rgb) / 255.0).max(axis=2) < 0.02).sum())


@pytest.fixture(scope="module")
def analysis():
    return spiral()


def test_pictures_are_png_of_the_stated_size(analysis):
    assert pixels(path_picture(analysis)).shape[1] == 1400
    assert pixels(profile_picture(analysis)).shape[:2] == (620, 1400)


def test_the_same_analysis_gives_the_same_bytes_whatever_the_users_own_settings(analysis):
    first = path_picture(analysis), profile_picture(analysis)
    with mpl.rc_context({"figure.facecolor": "black", "axes.labelsize": 30, "lines.linewidth": 9}):
        assert (path_picture(analysis), profile_picture(analysis)) == first
        assert mpl.rcParams["axes.labelsize"] == 30  # and the settings are left alone


@pytest.mark.parametrize("draw", [path, profile])
def test_texts_and_scales_are_those_that_matplotlib_itself_draws(analysis, draw):
    with house_style():
        ours, canvas = drawing.pixels(draw(analysis)).astype(int), FigureCanvasAgg(draw(analysis))
        canvas.draw()
    theirs = np.asarray(canvas.buffer_rgba())[:, :, :3].astype(int)
    assert ours.shape == theirs.shape
    # A text begins at a whole pixel, with matplotlib between two: a shift below one pixel, which blurring removes.
    apart = np.abs(uniform_filter((ours - theirs).mean(axis=2), 5))
    assert apart.max() < 60.0
    assert (apart > 15.0).mean() < 4e-3


def test_pictures_need_no_pyplot():
    code = (
        "import sys; from tests.report.factory import short;"
        "a = short(); before = 'matplotlib' in sys.modules; a.plot(); a.plot_profile();"
        "print(before, 'matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def test_unreachable_samples_are_red_and_only_they():
    beyond = make_analysis([{"end": (0.7, 0.0, 0.0)}, {"end": (0.9, 0.0, 0.0)}], partial=True)
    assert beyond.out_of_reach.any()
    red = (0xD6, 0x45, 0x45)
    assert count_colour(path_picture(beyond), red) > 20
    assert count_colour(path_picture(short()), red) == 0
    pale = (0xF6, 0xC9, 0xC9)
    assert count_colour(profile_picture(beyond), pale) > 1000
    assert count_colour(profile_picture(short()), pale) == 0


def test_a_very_long_path_keeps_its_shape_and_what_is_red(monkeypatch):
    beyond = make_analysis([{"end": (0.7, 0.0, 0.0)}, {"end": (0.9, 0.0, 0.0)}], partial=True)
    whole = path_picture(beyond)
    monkeypatch.setattr(path_module, "MOST_POINTS", 200)  # of 900 mm in steps of 1 mm
    thinned = path_picture(beyond)
    red = (0xD6, 0x45, 0x45)
    assert count_colour(thinned, red) == pytest.approx(count_colour(whole, red), rel=0.1)
    assert (np.abs(pixels(thinned) - pixels(whole)).max(axis=2) > 0.3).mean() < 2e-4


def test_what_lies_upon_another_segment_is_drawn_once_and_the_picture_stays(monkeypatch):
    there_and_back = [{"end": (0.2 * (i % 2), 0.0, 0.0), "start": (0.2 * (1 - i % 2), 0.0, 0.0)} for i in range(1, 41)]
    long = make_analysis(there_and_back)
    thinned = path_picture(long)
    curves = path(long).axes[0].collections[0].get_paths()
    assert sum(len(curve.vertices) for curve in curves) < len(long.samples) / 5
    monkeypatch.setattr(path_module, "_thinned", lambda points, strokes, axes: strokes)
    assert (np.abs(pixels(path_picture(long)) - pixels(thinned)).max(axis=2) > 0.3).mean() < 2e-3


def test_a_command_leaves_lists_of_properties_out_of_docstrings_and_the_library_does_not():
    lines = ("from toolpath_stiff.report.folder import pictures_of, skip_docstrings", "skip_docstrings()")
    asked = (
        "pictures_of('map')",
        "from matplotlib.lines import Line2D",
        "print('markersize' in str(Line2D.set.__doc__))",
    )
    for told, kept in ((lines, "False"), (lines[:1], "True")):
        done = subprocess.run(
            [sys.executable, "-c", "\n".join((*told, *asked))], check=True, capture_output=True, text=True
        )
        assert done.stdout.strip() == kept


def test_required_level_and_second_machine_change_the_profile(analysis):
    plain = profile_picture(analysis)
    orange = (0xDE, 0x6B, 0x12)
    assert count_colour(plain, orange) == 0
    assert count_colour(profile_picture(replace(analysis, on_other=spiral(load="x"))), orange) > 100
    assert count_colour(profile_picture(replace(analysis, required=6e7)), (0xD6, 0x45, 0x45)) > 1000


@pytest.mark.parametrize("name", ["pri$ce_$5.nc", "$\\frac{$.nc", "a\nb\x1b[0m.nc", "部品.nc", "x" * 400])
def test_any_file_name_can_head_a_picture(name):
    assert path_picture(short(name=name)).startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "moves",
    [
        [{"end": (0.0, 0.0, -0.05)}],  # one plunge: no extent in X and Y
        [{"end": (1e-6, 0.0, 0.0)}],  # a micrometre
        [{"end": (0.1, 0.0, 0.0)}] * 2,  # the second move goes nowhere
        [{"end": (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)}, {"end": (0.1, 0.0, 0.0, 0.1, 0.0, 0.0)}],  # rotary axis alone
        [{"end": (0.0, 0.0, 0.0, 0.1, 0.0, 0.0)}],  # nothing else: no sample is in the statistics
    ],
)
def test_degenerate_paths_are_drawn(moves):
    analysis = make_analysis(moves)
    assert path_picture(analysis).startswith(b"\x89PNG")
    assert profile_picture(analysis).startswith(b"\x89PNG")


def test_a_constant_stiffness_has_a_scale():
    low, high = scale_limits(make_analysis([{"end": (0.0, 0.0, 0.0), "start": (-1e-6, 0.0, 0.0)}], load="z"))
    assert low < high


def test_few_far_out_values_do_not_take_the_contrast_but_ordinary_ends_stay_on_the_scale(analysis):
    plunges = np.abs(analysis.samples.tangent[:, 2]) > 0.9
    ordinary = analysis.at.stiffness[analysis.counted & ~plunges] / 1e3
    low, high = scale_limits(analysis)
    assert (low, high) == (ordinary.min(), ordinary.max())


def test_plunges_are_grey(analysis):
    slate = tuple(int(SLATE[i : i + 2], 16) for i in (1, 3, 5))
    assert count_colour(path_picture(analysis), slate) > 20
    lines = {line.get_label(): line.get_color() for line in profile(analysis).axes[0].lines}
    assert lines["plunges"] == SLATE


def test_the_axis_of_the_profile_is_that_of_the_headline(analysis):
    axes = new_figure(5.0, 3.0).add_subplot()
    _set_limits(axes, analysis, [profile_curve(analysis)[1]])
    low, high = axes.get_ylim()
    headline, plunges = (analysis.at.stiffness[rows] / 1e3 for rows in (analysis.headline, analysis.set_aside))
    assert low <= headline.min() and headline.max() <= high < plunges.min()


def test_classes_cover_the_scale_in_order():
    values = np.linspace(10.0, 20.0, 1000)
    classes = segment_classes(values, (10.0, 20.0))
    assert classes[0] == 0
    assert classes[-1] == CLASSES - 1
    assert (np.diff(classes) >= 0).all()
    assert len(np.unique(classes)) == CLASSES
    assert segment_classes(np.array([1.0, np.nan, 99.0]), (10.0, 20.0)).tolist() == [0, UNREACHABLE, CLASSES - 1]


@settings(max_examples=60, deadline=None)
@given(
    steps=st.lists(st.floats(0.0, 5.0), min_size=1, max_size=400),
    columns=st.integers(1, 20),
    seed=st.integers(0, 2**32 - 1),
)
def test_thinning_keeps_the_extremes_of_every_column_the_ends_and_the_gaps(steps, columns, seed):
    x = np.cumsum(steps)
    y = np.random.default_rng(seed).normal(size=len(x))
    y[np.random.default_rng(seed + 1).random(len(x)) < 0.1] = np.nan
    rows = extremes_by_column(x, y, columns)
    assert (np.diff(rows) > 0).all()
    assert rows[0] == 0
    assert np.isnan(y[rows]).any() == np.isnan(y).any()
    if np.isfinite(y).any():
        assert np.nanmin(y[rows]) == np.nanmin(y)
        assert np.nanmax(y[rows]) == np.nanmax(y)
    # Whatever stood between two finite samples that now follow each other was finite too: no gap is bridged.
    for before, after in itertools.pairwise(rows):
        if np.isfinite(y[before]) and np.isfinite(y[after]):
            assert np.isfinite(y[before : after + 1]).all()


def test_thinning_a_long_path_leaves_few_rows_and_one_spike():
    x = np.arange(1_000_000.0)
    y = np.sin(x / 1e4)
    y[123_457] = 7.0
    rows = extremes_by_column(x, y, 1000)
    assert len(rows) <= 4 * 1001
    assert 123_457 in rows
