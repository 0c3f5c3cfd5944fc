"""`tps effects`: what it lists agrees with the registry, what it writes loads as it stands."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from toolpath_stiff.cli.main import main
from toolpath_stiff.machine.file import load_machine, parse_machine
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect, known_effects
from toolpath_stiff.stiffness.contract import LINKS
from toolpath_stiff.stiffness.core import tip_compliance
from toolpath_stiff.stiffness.model import build_model


@pytest.fixture
def template(tmp_path, capsys):
    file = tmp_path / "my_screw.py"
    assert main(["effects", "new", str(file)]) == 0
    capsys.readouterr()
    return file


def test_list_shows_every_effect_along_the_load_path(capsys):
    assert main(["effects", "list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [effect["name"] for effect in listed["effects"]] == list(known_effects())
    places = [LINKS.index(effect["link"]) for effect in listed["effects"]]
    assert places == sorted(places)
    assert main(["effects", "list"]) == 0
    text = capsys.readouterr().out
    for effect in known_effects().values():
        line = next(line for line in text.splitlines() if f" {effect.name} " in line)
        assert effect.title in line
        assert all(parameter.name in line and parameter.unit in line for parameter in effect.parameters)


def test_show_tells_what_a_parameter_is(capsys):
    assert main(["effects", "show", "platform_flexibility"]) == 0
    text = capsys.readouterr().out
    effect = find_effect("platform_flexibility")
    parameter = effect.parameters[0]
    for part in (effect.equation, effect.source, parameter.key, parameter.source, parameter.meaning, "1e+08 to inf"):
        assert part in text


def test_show_json_is_strict_json_even_with_infinite_bounds(capsys):
    assert main(["effects", "show", "platform_flexibility", "--json"]) == 0

    def refuse(constant: str):
        raise AssertionError(constant)

    shown = json.loads(capsys.readouterr().out, parse_constant=refuse)
    assert shown["parameters"][0]["bounds"] == [1e8, "inf"]


def test_what_new_writes_loads_and_softens_the_machine(template, capsys):
    assert len(template.read_text().splitlines()) < 60
    assert main(["effects", "show", "my_screw", "--effects", str(template)]) == 0
    shown = capsys.readouterr().out
    machine = load_machine("nist")
    effect = find_effect("my_screw", [template])
    position = np.array([[0.1, 0.0, 0.4]])
    soft = tip_compliance(build_model(machine, extra=[ActiveEffect(effect, {"compliance": 2e-9})]), position)
    assert (np.diag(soft[0]) > np.diag(tip_compliance(build_model(machine), position)[0])).all()
    assert f"{effect.parameters[0].key} = " in shown
    # The key that the template's own text names is the one that is read.
    assert f"    {effect.parameters[0].key} = " in template.read_text()


def test_several_effect_files(template, tmp_path, capsys):
    other = tmp_path / "other.py"
    assert main(["effects", "new", str(other)]) == 0
    capsys.readouterr()
    assert main(["effects", "list", "--json", "--effects", str(template), "--effects", str(other)]) == 0
    names = {effect["name"] for effect in json.loads(capsys.readouterr().out)["effects"]}
    assert {"my_screw", "other"} <= names


def test_new_never_overwrites(template, capsys):
    template.write_text("mine")
    assert main(["effects", "new", str(template)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert template.read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["show", "platform_flexibilty"], "Did you mean platform_flexibility"),
        (["list", "--effects", "none.py"], "no effects file 'none.py'"),
        (["new", "my screw.py"], "such as my_screw.py"),
        (["new", "screw.txt"], "such as my_screw.py"),
    ],
)
def test_wrong_input_is_one_message_and_exit_code_2(words, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["effects", *words]) == 2
    error = capsys.readouterr().err
    assert message in error and "Traceback" not in error
    assert list(tmp_path.iterdir()) == []


def test_a_command_honours_the_machine_files_effect(template, tmp_path, capsys):
    """`tps pose` with the packaged machine and with a copy that carries the template's effect."""
    text = (resources.files("toolpath_stiff") / "data" / "machines" / "nist.toml").read_text("utf-8")
    machine = tmp_path / "soft.toml"
    machine.write_text(f'{text}\n[[effect]]\nname = "my_screw"\ncompliance_nm_per_N_per_m = 2.0\n')
    pose = ["pose", "100", "-200", "800", "--json"]
    assert main(pose) == 0
    plain = json.loads(capsys.readouterr().out)
    assert main([*pose, "--machine", str(machine), "--effects", str(template)]) == 0
    soft = json.loads(capsys.readouterr().out)
    assert all(soft[f"k{axis}_N_per_mm"] < plain[f"k{axis}_N_per_mm"] for axis in "xyz")
    assert main([*pose, "--machine", str(machine)]) == 2
    assert "unknown effect 'my_screw'" in capsys.readouterr().err


def test_the_walk_through_of_the_documentation_works(tmp_path, capsys):
    """The page's Python block is an effect file, its TOML block a machine entry; Betti's law must hold for them."""
    page = (Path(__file__).parents[1] / "docs" / "effects.md").read_text("utf-8")
    source, entry = (page.split(f"```{language}\n")[1].split("```")[0] for language in ("python", "toml"))
    file = tmp_path / "spindle.py"
    file.write_text(source)
    text = (resources.files("toolpath_stiff") / "data" / "machines" / "nist.toml").read_text("utf-8")
    model = build_model(parse_machine(text + "\n" + entry, "mine.toml"), [file])
    added = tip_compliance(model, np.array([[0.1, -0.2, 0.8]])) - tip_compliance(
        build_model(load_machine("nist")), np.array([[0.1, -0.2, 0.8]])
    )
    # Spindle vertical: the page's figures for radial and axial, in nm/N, stand on the diagonal and nothing beside it.
    assert added[0] * 1e9 == pytest.approx(np.diag([5.0, 5.0, 2.0]), abs=1e-9)
    assert main(["effects", "show", "spindle", "--effects", str(file)]) == 0
    assert "radial_nm_per_N" in capsys.readouterr().out


# Bodies of strut_compliance that must not pass a gate: the first three were sent in by somebody who tried.
FAILING = {
    "np.random.rand(len(path), 6) * 1e-8": "neutral value",
    "None": "size",
    "np.full((len(path), 6), -2e-8)": "no positive stiffness",
    "np.full((len(path), 6), -p['size'])": "sign",
}


@pytest.fixture(params=FAILING)
def failing(request, tmp_path, monkeypatch):
    """An effect file, the options that bring it in, and what is wrong with it."""
    monkeypatch.chdir(tmp_path)
    Path("part.nc").write_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2\n")
    Path("own.py").write_text(f"""import numpy as np
from toolpath_stiff.stiffness.effects import Effect, Parameter
class F(Effect):
    name = "f_x"; title = "t"; link = "tool"; equation = "-"; source = "-"
    parameters = (Parameter("size", "nm/N", 1e-9, (0.0, 100.0), (1.0, 2.0), "-", meaning="m"),)
    def strut_compliance(self, path, p): return {request.param}
""")
    text = (resources.files("toolpath_stiff") / "data/machines/nist.toml").read_text()
    Path("mine.toml").write_text(text + '\n[[effect]]\nname = "f_x"\nsize_nm_per_N = 2.0\n')
    return ["--machine", "mine.toml", "--effects", "own.py"], FAILING[request.param]


COMPUTING = {
    "analyze": ["analyze", "part.nc", "--require", "60000", "--no-plots"],
    "pose": ["pose", "0", "0", "800"],
    "compare": ["compare", "nist-table1", "--no-plots"],
}


@pytest.mark.parametrize("command", COMPUTING)
def test_no_command_computes_with_an_effect_that_fails_its_check(failing, command, capsys):
    options, wrong = failing
    assert main(["effects", "check", "own.py"]) == 1
    capsys.readouterr()
    assert main([*COMPUTING[command], *options]) == 2
    told = capsys.readouterr().err
    assert "own.py: effect f_x fails the check" in told and wrong in told and "--allow-unchecked-effects" in told
    assert told.count("\n") == 1 and not Path("reports").exists()


def test_an_effect_that_fails_is_used_when_told_to_and_every_result_says_so(failing, capsys):
    options, wrong = failing
    if wrong == "no positive stiffness":
        pytest.skip("nothing can be computed with it at all poses")
    for command in COMPUTING.values():
        assert main([*command, *options, "--allow-unchecked-effects", "--json"]) in (0, 1, 3)
        found = capsys.readouterr()
        assert "UNCHECKED effect f_x" in found.out, command
