"""The table of codes: every row has its function, meaning and source, and the documentation is made from it."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

from benchmarks.hunt import codes_of, program_of
from docs.from_code import codes_table
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import EVERYWHERE
from toolpath_stiff.nc.codes.registry import CODES, REFUSED, UNDERSTOOD, code_meaning
from toolpath_stiff.nc.controller import DIALECTS, LANGUAGES, Controller
from toolpath_stiff.nc.plain_lines import MODE_NAMES
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.state import STEPS
from toolpath_stiff.nc.tables import ADDITIONAL_OFFSETS, WORK_OFFSETS


@pytest.mark.parametrize("name", CODES)
def test_every_code_has_function_meaning_and_source(name):
    code = CODES[name]
    assert re.fullmatch(r"[GM](0|[1-9]\d*)(\.\d)?|[FST]|,[CR]", name)
    assert code.controls and set(code.controls) <= set(EVERYWHERE)
    assert list(inspect.signature(code.act).parameters) == ["state", "block", "code"]
    assert inspect.getdoc(code.act), "a function of a code says what the code does"
    assert code.meaning
    assert any(manual in code.source for manual in ("LinuxCNC", "Fanuc", "Haas"))
    assert code.when in STEPS
    assert code_meaning(name)


@pytest.mark.parametrize("name", REFUSED)
def test_every_refused_code_says_what_it_is_and_what_to_do(name):
    code = REFUSED[name]
    assert name not in CODES
    assert code.hint
    assert code.source
    with pytest.raises(InputError) as refusal:
        parse_program(f"G21 F100\nG1 X1\n{name}\nM2\n")
    assert (refusal.value.line, refusal.value.column) == (3, 1)
    assert refusal.value.found == f"{name} is {code.what}, which is not supported"
    assert refusal.value.hint == code.hint


@pytest.mark.parametrize("code", ["G1.7", "G60", "G102", "G5.6"])
def test_a_code_that_is_not_in_the_table_is_refused(code):
    with pytest.raises(InputError, match="not a G code that is known") as refusal:
        parse_program(f"G21 F100\nG1 X1\n  {code}\nM2\n")
    assert (refusal.value.line, refusal.value.column) == (3, 3)


def test_the_controls_of_a_row_are_those_of_the_dialects():
    dialects = [dialect for dialect in DIALECTS.values() if dialect.name not in LANGUAGES]
    assert set(EVERYWHERE) == {dialect.name for dialect in dialects}
    for name in ADDITIONAL_OFFSETS:
        assert set(CODES[name].controls) == {d.name for d in DIALECTS.values() if name in d.additional}
    for name, more in (("G70", {"generic"}), ("G71", {"generic"}), ("G234", set())):
        assert set(CODES[name].controls) == {d.name for d in DIALECTS.values() if name in d.aliases} | more
    assert set(CODES["G43.4"].controls) == {d.name for d in dialects if "G234" not in d.aliases}


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", ["G54.1", "G154", "M97"])
def test_a_control_without_a_code_refuses_it(name, dialect):
    program = f"G21 F100.\nG1 X1.\n{name} P1\nM2\n"
    with pytest.raises(InputError) as refusal:
        parse_program(program, controller=Controller(DIALECTS[dialect]))
    of_the_control = "nothing defines" in str(refusal.value) or "no block has" in str(refusal.value)
    assert of_the_control == (dialect in CODES[name].controls)


def test_groups_that_other_modules_name():
    numbered = {f"G{number}" for number in range(110, 130)}  # Haas' names of G154 P1 to P20
    offsets = {name for name, code in CODES.items() if code.group == "work offset"}
    assert offsets - numbered == {*WORK_OFFSETS, *ADDITIONAL_OFFSETS} and numbered <= offsets
    assert MODE_NAMES == ("G0", "G1", "G2", "G3")  # the digits that the pattern of plain lines reads
    assert {name for name, code in CODES.items() if code.takes_axes and code.group == "non-modal"} == {
        "G10", "G28", "G30", "G52", "G92",
    }  # fmt: skip


def test_the_table_names_every_code_once():
    assert len(CODES) == len(UNDERSTOOD)
    cells = [line.split("|")[1] for line in codes_table().splitlines() if line.startswith("| ")]
    names = [name for cell in cells for name in cell.split() if name != "code" and not set(name) <= {"-"}]
    assert sorted(names) == sorted([*CODES, *REFUSED])


# Codes whose lines the hunt leaves out, because only the dialect linuxcnc has them, or for want of a subprogram: in
# programs that the tests hold against rs274.
IN_TESTS = {
    "M98": "test_nc_language_subprograms.py", "M99": "test_nc_language_subprograms.py",
}  # fmt: skip


def test_what_the_table_says_is_held_against_linuxcnc_is():
    """Each such code is in the hunt's random programs, whose paths agree (`benchmarks/hunt.md`), or in the tests."""
    hunted = set().union(*(codes_of(program_of(seed)) for seed in range(2000)))
    rows = [line.split(" | ") for line in codes_table().splitlines() if line.endswith("| same path |")]
    held = {name for row in rows for name in row[0].removeprefix("| ").split()}
    assert len(held) > 80 and held - hunted <= IN_TESTS.keys()
    for name, file in IN_TESTS.items():
        text = (Path(__file__).parent / file).read_text(encoding="utf-8")
        assert "rs274" in text and name in text
