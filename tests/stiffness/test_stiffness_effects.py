"""The effect contract from outside: machine files, user files, and every message that they can end in."""

from __future__ import annotations

from importlib import resources

import numpy as np
import pytest

from tests.stiffness.cases import nist, random_poses
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.stiffness.catalogue import effects_from_file, known_effects
from toolpath_stiff.stiffness.contract import LINKS
from toolpath_stiff.stiffness.core import tip_compliance
from toolpath_stiff.stiffness.model import build_model, load_path

NIST_TEXT = (resources.files("toolpath_stiff") / "data" / "machines" / "nist.toml").read_text("utf-8")
USER_EFFECT = """
import numpy as np
from toolpath_stiff.stiffness.effects import Effect, Parameter

class Screw(Effect):
    name = "screw"
    title = "constant compliance in every strut"
    link = "struts"
    equation = "c = c0"
    source = "test"
    parameters = (Parameter("compliance", "nm/N", 1e-9, (0.0, 100.0), (1.0, 5.0), "test"),)

    def strut_compliance(self, path, p):
        return np.full((len(path), 6), p["compliance"])
"""
GAUGE = """
from toolpath_stiff.stiffness.effects import Effect, Parameter

class Gauge(Effect):
    name = "gauge"
    title = "gauge scale"
    link = "instrument"
    equation = "k (1 + s)"
    source = "test"
    parameters = (Parameter("scale", "%", 0.01, (-50.0, 50.0), (-1.0, 1.0), "test"),)

    def reading(self, stiffness, path, p):
        return stiffness * (1.0 + p["scale"])
"""


@pytest.fixture
def user_file(tmp_path):
    def write(text: str = USER_EFFECT, name: str = "mine.py") -> str:
        (tmp_path / name).write_text(text, encoding="utf-8")
        return str(tmp_path / name)

    return write


def machine_with(lines: str):
    return parse_machine(NIST_TEXT + "\n" + lines, "mine.toml")


def test_every_known_effect_is_complete():
    for effect in known_effects().values():
        assert effect.link in LINKS
        assert effect.title and effect.equation and effect.source
        for parameter in effect.parameters:
            low, high = parameter.bounds
            assert low <= parameter.typical[0] <= parameter.typical[1] <= high
            assert parameter.source and parameter.meaning


def test_effects_come_in_the_order_of_the_load_path(user_file):
    links = [LINKS.index(effect.link) for effect in known_effects([user_file(), user_file(GAUGE, "g.py")]).values()]
    assert links == sorted(links) and len(links) >= 3


def test_platform_flexibility_as_effect_or_as_bars_of_the_machine():
    pose = random_poses(10, 21)
    entry = machine_with('[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = 1e9')
    assert np.array_equal(tip_compliance(build_model(entry), *pose), tip_compliance(build_model(nist(1e9)), *pose))
    assert (tip_compliance(build_model(entry), *pose) != tip_compliance(build_model(nist()), *pose)).any()


def test_finite_bars_and_the_effect_are_once_too_often():
    text = NIST_TEXT.replace("bar_stiffness_N_per_m = inf", "bar_stiffness_N_per_m = 1e10")
    text += '\n[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = 1e9\n'
    with pytest.raises(InputError, match=r"platform_flexibility is given twice.*Keep one"):
        build_model(parse_machine(text, "mine.toml"))


def test_a_users_effect_named_by_the_machine_file(user_file):
    """The same 2 nm/N in every strut adds 2 nm/N (J^T J)^-1 at the tip, whatever else is there."""
    model = build_model(machine_with('[[effect]]\nname = "screw"\ncompliance_nm_per_N = 2.0'), [user_file()])
    pose = random_poses(5, 23)
    added = tip_compliance(model, *pose) - tip_compliance(build_model(nist()), *pose)
    jacobian = load_path(model, *pose).struts.jacobian
    expected = 2e-9 * np.linalg.inv(np.swapaxes(jacobian, 1, 2) @ jacobian)[:, :3, :3]
    assert np.abs(added - expected).max() < 1e-9 * np.abs(expected).max()


def test_instruments_are_set_aside(user_file):
    machine = machine_with('[[instrument]]\nname = "gauge"\nscale_percent = 5.0')
    model = build_model(machine, [user_file(GAUGE)])
    assert [active.effect.name for active in model.instruments] == ["gauge"]
    assert model.instruments[0].values == {"scale": 0.05}
    pose = random_poses(3, 22)
    assert np.array_equal(tip_compliance(model, *pose), tip_compliance(build_model(nist()), *pose))


LOW_TIP = """
import numpy as np
from toolpath_stiff.stiffness.effects import Effect, Parameter

class LowTip(Effect):
    name = "low_tip"
    title = "the tip sits lower than believed"
    link = "geometry"
    equation = "P_i + (0, 0, h)"
    source = "test"
    parameters = (Parameter("height", "mm", 1e-3, (-50.0, 50.0), (-5.0, 5.0), "test"),)

    def geometry(self, machine, p):
        return machine.with_changes(platform_joints=machine.platform_joints + np.array([0.0, 0.0, p["height"]]))
"""


def test_a_geometry_effect_reaches_kinematics_and_stiffness(user_file):
    """A tip 20 mm lower on the same platform is a tool 20 mm longer: the core knows that without any effect."""
    machine = machine_with('[[effect]]\nname = "low_tip"\nheight_mm = 20.0')
    changed = build_model(machine, [user_file(LOW_TIP)])
    position, rotation = random_poses(5, 24)
    longer = machine.reference_tool_length + 0.020
    plain = build_model(nist())
    assert load_path(changed, position, rotation).struts.lengths == pytest.approx(
        load_path(plain, position, rotation, longer).struts.lengths, rel=1e-14
    )
    got, expected = tip_compliance(changed, position, rotation), tip_compliance(plain, position, rotation, longer)
    assert np.abs(got - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('[[effect]]\nname = "gauge"\nscale_percent = 5', r"acts on readings.*\[\[instrument\]\]"),
        ('[[instrument]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = 1e9', r"the machine.*\[\[effect\]\]"),
        ('[[effect]]\nname = "platform_flexibilty"', r"Did you mean platform_flexibility"),
        ('[[effect]]\nname = "platform_flexibility"', "bar_stiffness_N_per_m is missing"),
        ('[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = 1e9\nmass_kg = 1', "unknown key mass_kg"),
        ('[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = 1e3', r"1000.*from 1e\+08 to inf N/m"),
        ('[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = nan', "nan"),
        ('[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = true', "True"),
        ('[[effect]]\nname = "platform_flexibility"\nbar_stiffness_N_per_m = "1e9"', "'1e9'"),
    ],
)
def test_machine_entries_that_are_refused(lines, message, user_file):
    with pytest.raises(InputError, match=message):
        build_model(machine_with(lines), [user_file(GAUGE)])


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (USER_EFFECT.replace("link =", "link = ="), 8, "SyntaxError"),
        ("x = 1\ny = x / 0\n", 2, "ZeroDivisionError"),
        ("import no_such_module_anywhere\n", 1, "no_such_module_anywhere"),
        ("x = 1\n", None, "defines no effect"),
        (USER_EFFECT.replace('    equation = "c = c0"\n', ""), 5, "Screw: `equation` is missing"),
        (USER_EFFECT.replace('"struts"', '"strut"'), 8, "link = 'strut'.*one of tool, platform"),
        (USER_EFFECT.replace("(0.0, 100.0)", "(100.0, 0.0)"), 11, "parameter compliance: bounds"),
        (USER_EFFECT.replace("(0.0, 100.0)", "(1.0, 100.0)"), 11, "neutral"),
        (USER_EFFECT.replace('"test"),)', '"test"),) * 2'), 11, "compliance is declared twice"),
        (USER_EFFECT.replace('(Parameter("compliance"', '("x", Parameter("compliance"'), 11, "parameters hold 'x'"),
        (USER_EFFECT + USER_EFFECT.replace("class Screw", "class Other"), 20, "screw is defined twice"),
        (USER_EFFECT.replace('name = "screw"', 'name = "platform_flexibility"'), 6, "exists already"),
    ],
)
def test_effect_files_that_are_refused(text, line, message, user_file):
    file = user_file(text)
    with pytest.raises(InputError, match=message) as caught:
        known_effects([file])
    assert file in str(caught.value)
    assert caught.value.line == line


def test_an_error_in_a_file_given_by_a_relative_name_has_its_line(user_file, tmp_path, monkeypatch):
    user_file("x = 1\ny = x / 0\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"mine\.py:2: ZeroDivisionError"):
        effects_from_file("mine.py")


def test_a_file_that_does_not_exist_or_is_no_python(tmp_path):
    with pytest.raises(InputError, match="no effects file"):
        effects_from_file(tmp_path / "none.py")
    (tmp_path / "text.txt").write_text("hello")
    with pytest.raises(InputError, match=r"ends in \.py"):
        effects_from_file(tmp_path / "text.txt")
