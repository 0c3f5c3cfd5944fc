"""Plain lines many at a time and one by one: the same moves, the same words to the user, digit for digit."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc import frames, geometry, plain_lines, plain_words
from toolpath_stiff.nc.checking import check
from toolpath_stiff.nc.codes import feeds, increments
from toolpath_stiff.nc.codes.code import EVERYWHERE
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.lines import read_lines, split_lines
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import ToolEntry
from toolpath_stiff.nc.words import read_block

PROGRAMS = sorted((Path(__file__).parents[2] / "programs").glob("*.nc"))
TOOLS = {1: ToolEntry(1, 50.0, 6.0), 2: ToolEntry(2, 80.0, 10.0), 3: ToolEntry(3, 120.0, 8.0)}
ZERO = (0.0,) * 6


@pytest.fixture(autouse=True)
def _runs_of_any_length(monkeypatch):
    monkeypatch.setattr(plain_lines, "FEWEST", 1)


def outcome(lines, dialect, fast):
    """Everything that reading leaves behind, in comparable form, and how many lines were executed at once."""
    run = ProgramRun(Request(lines, "p", controller=Controller(DIALECTS[dialect], tools=TOOLS)), fast=fast)
    control, axes = run.state, run.state.frames
    executed = []
    run._tally_plain = lambda at, rows: executed.append(len(rows.code))
    error = None
    try:
        warnings = run.run()
    except InputError as found:
        error, warnings = str(found), []
    state = {
        name: repr(value)
        for name, value in vars(control).items()
        if name not in ("recorder", "frames", "tools", "dialect")
    }
    frame = {f.name: repr(getattr(axes, f.name)) for f in dataclasses.fields(axes)}
    moves = control.recorder.moves()
    columns = {f.name: getattr(moves, f.name) for f in dataclasses.fields(moves)}
    return error, warnings, state if error is None else None, frame if error is None else None, columns, sum(executed)


def assert_same(lines, dialect="generic"):
    slow, fast = outcome(lines, dialect, fast=False), outcome(lines, dialect, fast=True)
    assert fast[0] == slow[0]
    assert fast[1] == slow[1]
    assert fast[2] == slow[2]
    assert fast[3] == slow[3]
    for name, column in slow[4].items():
        np.testing.assert_array_equal(fast[4][name], column, err_msg=name, strict=True)
    assert slow[5] == 0
    return fast[5]


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.name)
@pytest.mark.parametrize("dialect", EVERYWHERE)
def test_programs(program, dialect):
    lines = read_lines(program)[: 8000 if dialect == "generic" else 2000]  # longer runs: across chunks, below
    assert assert_same(lines, dialect) > 0 or not DIALECTS[dialect].semicolon  # whose blocks end at `;`


numbers = st.one_of(
    st.decimals(-200, 200, places=3).map(str),
    st.integers(-100, 100).map(str),
    st.sampled_from(["0", "0.", "-0.", ".5", "+3.25", "10.", "-.125", "00012.50", "1e3", "1.", "100001", "1.2.3", "-"]),
)
feed_numbers = st.sampled_from(["100", "250.5", "1", "0", ".5", "1e2", "-5"])
blank = st.sampled_from(["", "", "", " ", "\t"])


@st.composite
def plain(draw):
    words = [f"G{draw(st.sampled_from(['0', '1', '1', '00', '01', '2', '3', '02']))}"] if draw(st.booleans()) else []
    if draw(st.integers(0, 5)) == 0:
        words.append("F" + draw(feed_numbers))
    words += [letter + draw(numbers) for letter in draw(st.sets(st.sampled_from("XYZABC"), max_size=3))]
    words += [letter + draw(numbers) for letter in draw(st.sets(st.sampled_from("IJKR"), max_size=2))] * draw(
        st.sampled_from([0, 0, 0, 1])
    )
    if draw(st.booleans()):
        words.sort(key="GXYZABCIJKRF".find, reverse=False) if "F" in "".join(words) else None
    if draw(st.integers(0, 3)) == 0:
        words.append("F" + draw(feed_numbers))
    if draw(st.integers(0, 7)) == 0:
        words.append("S" + draw(st.sampled_from(["100", "0", "2500.5", ".5", "-1", "1e2", "99999999999"])))
    text = "".join(word + draw(blank) for word in words)
    if draw(st.integers(0, 5)) == 0:
        text = f"N{draw(st.integers(1, 99999))} {text}"
    text += draw(st.sampled_from(["", "", "", "", "(a comment)", "; another", ";", "(open", "(a)(b)", "(a(b))"]))
    return text.lower() if draw(st.integers(0, 9)) == 0 else text


@st.composite
def arc(draw):
    """An arc that fits, from wherever the tool is: a full circle or a half one, in G91 and G90 alike."""
    radius = draw(st.decimals("0.5", "50", places=2))
    code = draw(st.sampled_from(["G2", "G3"]))
    return draw(
        st.sampled_from([f"{code}I{radius}J0", f"{code}I-{radius}", f"G91\n{code}X{2 * radius}Y0R{radius}\nG90"])
    )


@given(st.lists(st.from_regex(r"([NGFSXYZABCIJKRfx][-+]?[0-9]{0,16}[.]?[0-9]{0,3}){0,3}", fullmatch=True), min_size=1))
@example(
    ["X9007199254740993", "X.1Y0.30Z-0.000001", "F1X2F3", "F1F2", "G03X1", "G010", "S-1", "X-0.", "7", "X1X2", "-"]
)
def test_words_by_arithmetic_are_those_of_the_reader(lines):
    words, others = plain_words.lex(lines)
    for row in set(range(len(lines))) - set(others.tolist()):
        theirs = [(word.letter, word.value) for word in read_block(lines[row], 1, "p").words]
        ours = [(key[0], words.values[key][row]) for key in words.forms if words.forms[key][row]]
        ours += [("G", code) for code in words.code[row : row + 1].tolist() if code != plain_words.NO_CODE]
        assert sorted(ours) == sorted(theirs) and words.count[row] == len(theirs)


modal = st.sampled_from(
    [
        "G90", "G91", "G20", "G21", "G17", "G18", "G19", "G93", "G94", "G54", "G55", "G10 L2 P2 X10 Y-3.3 Z0.7 A1",
        "G92 X1 Z-2", "G92.1", "G52 X.1", "M3 S100", "T2 M6", "G43 H2", "G49", "G80", "G4 P1", "G53 G0 Z0", "G28 Z0",
        "G81 X1 Y2 Z-1 R2", "X5 Y5", "", "(only a comment)", "%", "G68 X0 Y0 R30", "G69", "G10 L2 P1 R15", "G61", "/X1",
        "G90.1", "G91.1", "G1 X1 P2", "X1 X2", "X1 Y", "Ä", "(Ä)", "\u0131 10", "G16", "G15", "M30", "S100 X1",
    ]
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.one_of(plain(), plain(), plain(), arc(), modal), min_size=1, max_size=30),
    st.sampled_from(sorted(EVERYWHERE)),
)
@example(["G1X1F1", "X10.", "Y2"], "generic")
@example(["G93", "G1 X1 F2", "X2"], "generic")
@example(["G1 X1 F100", "G91", "X.1", "X.1", "X.1", "G90", "Y1"], "generic")
def test_random_programs(blocks, dialect):
    assert_same(split_lines("G21 G90 G17 F300\nG0 X0. Y0. Z0.\n" + "\n".join(blocks), "p"), dialect)


@settings(max_examples=40, deadline=None)
@example(["f100f100s100", "G2I0.50J0", "G19", "G91\nG2X1.00Y0R0.50\nG90"])  # an arc by R that ends where it starts
@given(st.lists(st.one_of(plain(), arc(), modal), min_size=1, max_size=20))
def test_random_programs_are_checked_alike(blocks):
    lines = split_lines("F300\n" + "\n".join(blocks), "p")
    fast = check(Request(lines, "p", controller=Controller()))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plain_lines, "FEWEST", len(lines) + 1)
        slow = check(Request(lines, "p", controller=Controller()))
    for found in (fast, slow):
        assert found.used == slow.used
        assert found.findings == slow.findings
        assert found.program.moves.end.tolist() == slow.program.moves.end.tolist()


def test_long_runs_across_chunks():
    lines = ["G1 F500 X0 Y0", *(f"X{i % 100} Y{i % 77}.{i % 10} Z-{i % 5}.5" for i in range(20_000)), "M2"]
    assert assert_same(lines) == 20_001


def test_inverse_time_and_inches():
    lines = ["G20 G93", *(f"G1 X{i}.5 A{i} F{i + 1}.25" for i in range(50)), "G94 F10", *(f"B{i}" for i in range(9))]
    assert assert_same(lines) == 9  # those of G94


@pytest.mark.parametrize("cycle", ["G81 G99", "G83 G98 Q1.5", "G82 G99 P0.2"])
def test_holes_of_a_modal_cycle(cycle):
    # Offsets whose sums round, a hole at the place before, one axis alone, another depth, and a step in between.
    holes = [f"X{i * 0.37:.3f} Y{i % 7 / 3:.3f}" for i in range(40)]
    lines = ["G21 G90 F300", "G10 L2 P1 X0.1 Y-0.3 Z0.7", "G0 X0 Y0 Z9", f"{cycle} X1 Y1 R2 Z-3.3", *holes, "Z-4"]
    assert assert_same([*lines, *holes, "X5", "X5", *holes, "G91", *holes, "G80", "G0 Z9"]) > 60


def moved_by_a_rule(*rule):
    """How the moves of both ways change when a rule of the interpreter does."""
    program = [
        "G21 G90 G17 F300.", "G0 X0. Y0. Z0.", "G92 X1", "G1 X5. F100", "X10", "A20.", "X10.", "G2 X14. Y0. R2.",
        "G3 X18. I2.", "G1 X3. Y4. Z1", "X7.", "Y9.", "G20", "X1. F20.", "B5.", "Y2.", "Z1.", "X3.",
    ]  # fmt: skip
    slow, fast = outcome(program, "fanuc", fast=False), outcome(program, "fanuc", fast=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(*rule)
        other_slow, other_fast = outcome(program, "fanuc", fast=False), outcome(program, "fanuc", fast=True)
    assert fast[0] == slow[0] is None
    assert fast[5] > 8  # lines many at a time
    assert other_fast[0] == other_slow[0]
    return slow[4], fast[4], other_slow[4], other_fast[4]


@pytest.mark.parametrize(
    "rule",
    [
        (frames, "shifted", lambda program, shift, offset: program + 2.0 * shift + offset + 1.0),
        (frames, "shifted_back", lambda control, shift, offset: control - offset - shift / 2.0),
        (geometry, "center_from_radius", lambda start, end, radius, clockwise: ((start[0] + end[0]) / 2.0, start[1])),
        (geometry, "turn_between", lambda first, last, clockwise: 0.25),
        (increments, "INCREMENT_MM", 0.5),
        (feeds, "MM_PER_INCH", 20.0),
        (State, "feed_scale", property(lambda state: 3.0)),
        (State, "length_scale", property(lambda state: 2.0)),
    ],
    ids=lambda rule: rule[1],
)
def test_both_ways_ask_the_same_rule(rule):
    """Change a rule, and both ways change alike: it is not written down twice."""
    slow, fast, other_slow, other_fast = moved_by_a_rule(*rule)
    for name, column in other_slow.items():
        np.testing.assert_array_equal(other_fast[name], column, err_msg=name)
    for before, after in ((slow, other_slow), (fast, other_fast)):
        assert any(before[name].shape != after[name].shape or (before[name] != after[name]).any() for name in before)
