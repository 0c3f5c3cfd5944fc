"""The tutorials, run as a reader would: every command, in order, prints what the text shows."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent.parent / "docs" / "tutorials"
SPEC = importlib.util.spec_from_file_location("tutorials_make", FOLDER / "make.py")
make = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(make)

PAGES = sorted(FOLDER.glob("*.md"))


@pytest.mark.parametrize("tutorial", make.TUTORIALS, ids=lambda tutorial: tutorial.stem)
def test_commands_print_what_is_shown(tutorial):
    with make.workshop():
        played = 0
        for command, shown, lines in make.play(tutorial, pictures=False):
            assert make.agrees(shown, lines), "\n".join([command, "shown:", *shown, "printed:", *lines])
            played += 1
        assert played >= 5


def test_an_ellipsis_stands_for_lines_and_nothing_else():
    assert make.agrees(["a", "...", "d"], ["a", "b", "c", "d"])
    assert make.agrees(["a", "...", "d"], ["a", "d"])
    assert not make.agrees(["a", "d"], ["a", "b", "d"])
    assert not make.agrees(["a", "...", "d"], ["a", "b", "c"])
    assert not make.agrees(["a", "...", "b", "...", "c"], ["a", "c", "b"])
    assert not make.agrees(["a", "...", "a"], ["a"])
    assert make.agrees([], ["anything"])


def test_numbers_agree_to_one_in_the_last_place():
    assert make.alike("error 2.32 %", "error 2.33 %")
    assert not make.alike("error 2.32 %", "error 2.34 %")
    assert not make.alike("error 2.32 %", "Error 2.32 %")
    assert not make.alike("bias +0.6", "bias -0.6")
    assert make.alike("bar 1.03e9 N/m", "bar 1.04e9 N/m")
    assert not make.alike("bar 1.03e9 N/m", "bar 1.03e8 N/m")


def test_outputs_renewed_agree():
    lines = ["error 3.1 %", "law refitted", "none 0 %", "weak_strut 99 %", "written:"]
    renewed = make.renewed(["error 4.0 %", "...", "weak_strut 90 %", "..."], lines)
    assert renewed == ["error 3.1 %", "...", "weak_strut 99 %", "..."]
    assert make.agrees(renewed, lines)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_and_pictures_are_there(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
        assert (FOLDER / target).exists(), target


def test_every_picture_is_shown_and_small():
    text = "".join(page.read_text() for page in PAGES)
    pictures = sorted(path.name for path in (FOLDER / "pictures").iterdir())
    assert pictures == sorted(make.PICTURES)
    for name in pictures:
        assert f"pictures/{name}" in text
        assert (FOLDER / "pictures" / name).stat().st_size < 150_000
