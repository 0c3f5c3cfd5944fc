"""A user's own effect: each fault is one message with file, line and pose; the same from every command."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from tests.stiffness.cases import nist
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import EffectFault, InputError
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import MOST_FILES, _loaded, effects_from_file, known_effects
from toolpath_stiff.stiffness.core import tip_compliance
from toolpath_stiff.stiffness.model import build_model
from toolpath_stiff.stiffness.trial import all_passed, try_effect, unit_in_si

SOURCE = """\
import sys
import numpy as np
from toolpath_stiff.stiffness.effects import Effect, Parameter


class Mine(Effect):
    name = "mine"
    title = "mine"
    link = "struts"
    equation = "c_i += c"
    source = "test"
    needs = ()
    parameters = (
        Parameter("c", "nm/N", 1e-9, (0.0, 100.0), (1.0, 5.0), "test"),
    )

    def strut_compliance(self, path, p):
        return np.full((len(path), 6), p["c"])
"""
BODY = 'return np.full((len(path), 6), p["c"])'
HOOK = "strut_compliance"
DEFINED, BODY_LINE = 17, 18


def own(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    text = SOURCE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "mine.py"
    file.write_text(text, encoding="utf-8")
    return file


def use(file: Path, n: int = 3) -> np.ndarray:
    model = build_model(nist(), extra=[ActiveEffect(effects_from_file(file)["mine"], {"c": 2e-9})])
    return tip_compliance(model, np.linspace([0.0, 0.0, 0.8], [0.2, 0.1, 0.9], n))


FORM = (HOOK, "load_compliance")
BROKEN_AT_RUN_TIME = [
    ([(BODY, "return np.full(6, p['c'])")], DEFINED, "returns an array of (6,) float64; expected an array of (3, 6)"),
    ([(BODY, "return p['c']")], DEFINED, "returns float"),
    ([(BODY, "return path.struts.lengths * np.nan")], DEFINED, "returns nan at X0 Y0 Z800 mm; expected finite"),
    ([(BODY, "a = np.zeros((len(path), 6)); a[1, 2] = np.inf; return a")], DEFINED, "returns inf at X100 Y50 Z850 mm"),
    ([(BODY, "return 'soft'")], DEFINED, "returns str ('soft')"),
    ([(BODY, "return path.struts.lengths * 1j")], DEFINED, "complex128"),
    ([(BODY, "return [None] * 6")], DEFINED, "returns list"),
    ([(BODY, "return 1e-9 / 0")], BODY_LINE, "ends in ZeroDivisionError: float division by zero"),
    ([(BODY, "raise ValueError('no') if path.position[:, 0].max() > 0.15 else None")], BODY_LINE, ""),
    ([(BODY, "return p['compliance'] * path.struts.lengths")], BODY_LINE, "ends in KeyError: 'compliance'"),
    ([(BODY, "sys.exit(3)")], BODY_LINE, "ends in SystemExit: 3"),
    ([(BODY, "path.struts.lengths[:] *= 2.0; return None")], BODY_LINE, "read-only"),
    ([("self, path, p", "self, path")], DEFINED, "ends in TypeError"),
    ([FORM, (BODY, "q = np.zeros((len(path), 12, 12)); q[2, 0, 1] = 1e-9; return q")], DEFINED,
     "returns 1e-09 at X200 Y100 Z900 mm; expected a symmetric matrix"),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "line", "told"), BROKEN_AT_RUN_TIME)
def test_a_fault_at_run_time_names_file_line_and_pose(tmp_path, changes, line, told):
    file = own(tmp_path, *changes)
    with pytest.raises(EffectFault) as caught:
        use(file)
    assert str(caught.value).startswith(f"{file}:{line}: effect mine: ") and told in str(caught.value)


def test_an_effect_that_takes_more_than_there_is_names_effect_and_pose(tmp_path):
    file = own(tmp_path, (BODY, "return np.full((len(path), 6), -1.0)"))
    with pytest.raises(InputError, match=r"with effect mine strut \d has no positive stiffness at X0 Y0 Z800 mm"):
        use(file)
    overflow = own(tmp_path, (BODY, "return np.full((len(path), 6), 1.7e308)"))
    with pytest.raises(EffectFault, match=r"strut_compliance returns 1.7e\+308 at X0 Y0 Z800 mm; expected finite"):
        use(overflow)


def test_an_effect_that_is_sound_adds_what_it_says(tmp_path):
    """Equal compliances in series with all struts: 2 nm/N at 46.5 N/um are as a strut law of 1 / (1 / 46.5 + 0.002)."""
    from dataclasses import replace

    from toolpath_stiff.machine.model import StrutLaw

    constant = nist().with_changes(strut_law=StrutLaw(2.0, 50e6, 3.0, 50e6))
    effect = effects_from_file(own(tmp_path))["mine"]
    tip = np.array([[0.1, -0.2, 0.8]])
    found = tip_compliance(build_model(constant, extra=[ActiveEffect(effect, {"c": 2e-9})]), tip)
    softer = 1.0 / (1.0 / 50e6 + 2e-9)
    law = replace(constant.strut_law, stiffness_1=softer, stiffness_2=softer)
    assert found == pytest.approx(tip_compliance(build_model(constant.with_changes(strut_law=law)), tip), rel=1e-12)


WRONG_DECLARATIONS = [
    ([("1e-9", '"nano"')], 13, "parameter c: si is no number above 0; expected the SI value of one nm/N"),
    ([("1e-9", "-1e-9")], 13, "si is no number above 0"),
    ([("1e-9", "1" + 400 * "0")], 13, "si is no number above 0"),
    ([("1e-9", "10**5000")], 13, "si is no number above 0"),
    ([("(0.0, 100.0)", "(0, 10**400)")], 13, "bounds is not of numbers"),
    ([("(0.0, 100.0)", "(100.0, 0.0)")], 13, "low < high with the neutral between them"),
    ([("(0.0, 100.0)", "100.0")], 13, "bounds is not of numbers; expected bounds and typical = (low, high)"),
    ([("(1.0, 5.0)", "(1.0, 500.0)")], 13, "typical 1 to 500"),
    ([('"nm/N"', '"µm"')], 13, "a unit in plain letters"),
    ([('Parameter("c"', 'Parameter("my c"')], 13, "name = 'my c'; expected letters"),
    ([("(\n        Parameter", "[\n        3, Parameter"), ("),\n    )\n", "),\n    ]\n")], 13, "parameters hold 3"),
    ([('"test"),', '"test", nme="c"),')], 14, "TypeError"),
    ([('link = "struts"', 'link = "strut"')], 9, "link = 'strut'; expected one of tool"),
    ([('link = "struts"', 'link = "instrument"')], 9, "`reading` alone with link"),
    ([('title = "mine"', "title = 3")], 8, "title = 3"),
    ([('name = "mine"', 'name = "my effect"')], 7, "name = 'my effect'"),
    ([("needs = ()", 'needs = "time_min"')], 12, "needs = 'time_min'"),
    ([('    equation = "c_i += c"\n', "")], 6, "`equation` is missing"),
    ([("strut_compliance", "strut_complaince")], 17, "strut_complaince is never called; expected strut_compliance"),
    ([("strut_compliance", "stiffening")], 6, "adds nothing; expected one of"),
    ([("class Mine(Effect):", "class Mine(Effect:")], 6, "SyntaxError"),
    ([("import Effect, Parameter", "import Effekt, Parameter")], 3, "ImportError"),
    ([("import sys\n", "import sys\nsys.exit(0)\n")], 2, "SystemExit: 0"),
    ([("import sys\n", "import sys\n1 / 0\n")], 2, "ZeroDivisionError"),
    (
        [("(Effect):", "(Effect):\n    def __init__(self):\n        raise OSError('no gauge')\n")],
        8,
        "OSError: no gauge",
    ),
    ([("(Effect)", "")], None, "defines no effect"),
]


@pytest.mark.parametrize(("changes", "line", "told"), WRONG_DECLARATIONS)
@pytest.mark.parametrize("command", ["pose", "list", "check"])
def test_wrong_declarations_are_refused_when_the_file_is_loaded(tmp_path, capsys, changes, line, told, command):
    file = own(tmp_path, *changes)
    words = {
        "pose": ["pose", "0", "0", "800", "--effects", str(file)],
        "list": ["effects", "list", "--effects", str(file)],
        "check": ["effects", "check", str(file)],
    }[command]
    assert main(words) == 2
    error = capsys.readouterr().err
    where = f"{file}:{line}" if line else str(file)
    assert error.startswith(f"tps: error: {where}") and told in error and len(error.splitlines()) == 1


def with_machine(tmp_path: Path, kind: str = "effect", entry: str = "c_nm_per_N = 2.0") -> Path:
    from toolpath_stiff.machine.file import packaged_machines

    machine = tmp_path / "m.toml"
    machine.write_text(packaged_machines()["nist"].read_text() + f'\n[[{kind}]]\nname = "mine"\n{entry}\n')
    return machine


@pytest.mark.parametrize(
    "words",
    [
        ["pose", "0", "0", "800", "--machine", "m.toml"],
        ["analyze", "part.nc", "--machine", "m.toml", "--no-plots"],
        ["compare", "nist-table1", "--machine", "m.toml", "--no-plots"],
        ["diagnose", "nist-table1", "--no-plots"],
        ["update", "nist-table1", "--add", "mine", "--no-plots"],
    ],
    ids=lambda words: words[0],
)
def test_every_command_ends_in_one_message(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    own(tmp_path, (BODY, "return path.struts.lengths * np.nan"))
    with_machine(tmp_path)
    (tmp_path / "part.nc").write_text("G21 G90\nG0 X0 Y0 Z0\nG1 X10 F100\nM2\n")
    assert main([*words, "--effects", "mine.py"]) == 2
    error = capsys.readouterr().err
    assert "mine.py:17: effect mine: strut_compliance returns nan at X" in error and "Traceback" not in error
    assert not list(tmp_path.glob("reports/**/*.*"))


def test_geometry_and_instruments_are_held_against_the_contract_too(tmp_path):
    geometry = own(
        tmp_path, ("self, path, p", "self, machine, p"), (HOOK, "geometry"), (BODY, "return machine.frame_joints")
    )
    with pytest.raises(EffectFault, match=r"mine\.py:17: effect mine: geometry returns an array of \(6, 3\)"):
        use(geometry)
    bent = "return machine.with_changes(platform_joints=machine.platform_joints * np.nan)"
    with pytest.raises(EffectFault, match="gives joints that are not finite"):
        use(own(tmp_path, ("self, path, p", "self, machine, p"), (HOOK, "geometry"), (BODY, bent)))


def test_an_instrument_that_shows_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    own(
        tmp_path, ("self, path, p", "self, stiffness, path, p"), (HOOK, "reading"), (BODY, "return -stiffness"),
        ('link = "struts"', 'link = "instrument"'),
    )  # fmt: skip
    with_machine(tmp_path, "instrument")
    assert main(["compare", "nist-table1", "--machine", "m.toml", "--effects", "mine.py", "--no-plots"]) == 2
    assert "mine.py:17: effect mine: reading returns -" in capsys.readouterr().err


@pytest.mark.parametrize("name", [n for n, e in known_effects().items() if type(e).__module__.startswith("toolpath")])
def test_the_packaged_effects_pass_their_own_check(name):
    outcomes = try_effect(known_effects()[name], nist())
    assert all_passed(outcomes), outcomes


@pytest.mark.parametrize(
    ("changes", "failing", "told"),
    [
        ([("1e-9", "1e-6")], "unit of c", "one nm/N is 1e-09 in SI, but si = 1e-06"),
        ([(BODY, 'return np.full((len(path), 6), p["c"] + 1e-9)')], "neutral value", "must not"),
        ([(BODY, "return np.zeros((len(path), 6))")], "size", "changes nothing"),
        ([(BODY, 'return np.full((len(path), 6), p["c"] * path.position[:, 2].max())')], "poses", "the poses mix"),
        ([(BODY, "return np.full((len(path), 6), 1 / 0)")], "shapes", "ZeroDivisionError"),
        ([(BODY, 'return np.full((len(path), 6), -1e3 * p["c"])')], "stiffness", "no positive stiffness"),
    ],
)
def test_check_finds_what_is_wrong(tmp_path, capsys, changes, failing, told):
    file = own(tmp_path, *changes)
    outcomes = try_effect(effects_from_file(file)["mine"], nist())
    wrong = [outcome for outcome in outcomes if outcome.passed is False]
    assert [outcome.name for outcome in wrong] == [failing] and told in wrong[0].found
    assert main(["effects", "check", str(file)]) == 1
    assert "FAILS" in capsys.readouterr().out


def test_check_of_a_sound_effect(tmp_path, capsys):
    assert main(["effects", "check", str(own(tmp_path)), "--machine", "genhexkins"]) == 0
    told = capsys.readouterr().out
    assert "mine, on machine genhexkins: good" in told and "changes by -20 to -20 %" in told


@pytest.mark.parametrize(
    ("unit", "value"),
    [("N/um", 1e6), ("kN/mm", 1e6), ("mrad/N/m", 1e-3), ("um/h", 1e-6 / 3600), ("N m/rad", 1.0), ("furlong", None)],
)
def test_units(unit, value):
    assert unit_in_si(unit) == (None if value is None else pytest.approx(value, rel=1e-12))


def test_a_file_is_run_again_only_if_it_changed(tmp_path):
    file = own(tmp_path)
    assert effects_from_file(file)["mine"] is effects_from_file(file)["mine"]
    first = effects_from_file(file)["mine"]
    own(tmp_path, ('title = "mine"', 'title = "another title"'))
    assert effects_from_file(file)["mine"].title == "another title" != first.title


def test_no_more_than_so_many_files_are_kept(tmp_path):
    file = own(tmp_path)
    kept = [effects_from_file(file)]
    for version in range(MOST_FILES):
        os.utime(file, ns=(version, version))  # an editor's save
        kept.append(effects_from_file(file))
    assert effects_from_file(file) is kept[-1]
    assert _loaded.cache_info().currsize == MOST_FILES
