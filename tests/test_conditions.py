"""An effect that waits for a set-up, a temperature or a tool acts where that is given, and says so where it is not."""

from __future__ import annotations

import json

import pytest

from toolpath_stiff.cli.main import main
from toolpath_stiff.machine.file import load_machine, parse_machine
from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.rig import case
from toolpath_stiff.rig import exercise as exercise_module
from toolpath_stiff.stiffness.contract import Conditions
from toolpath_stiff.stiffness.model import acting_names, build_model, condition_warnings, waiting_effects

RISER = {"setup": "riser", "x_nm_per_N": 8.0, "y_nm_per_N": 5.0, "z_nm_per_N": 2.0}
PART = "G21 G90 G94\nG0 X0 Y0 Z20\nG1 Z0 F600\nG1 X30 F1200\nG1 Y30\nM30\n"
WAITS = "setup_compliance does not act"

USER_EFFECT = '''
import numpy as np

from toolpath_stiff.stiffness.effects import Effect, Parameter


class {cls}(Effect):
    """Softer for every degree above 20."""

    name = "{name}"
    title = "made up"
    link = "{link}"
    equation = "made up"
    source = "made up"
    needs = ("{needs}",)
    parameters = (Parameter("compliance", "nm/N", 1e-9, (0.0, 100.0), (1.0, 10.0), "made up"),)

    def load_compliance(self, path, p):
        form = np.zeros((len(path), 12, 12))
        form[:, 6, 6] = p["compliance"] * {size}
        return form
'''


def effect_file(folder, name, needs, size):
    text = USER_EFFECT.format(cls=name.title().replace("_", ""), name=name, link="table", needs=needs, size=size)
    file = folder / f"{name}.py"
    file.write_text(text)
    return str(file)


def with_effects(*entries, **changes):
    return load_machine("nist").with_changes(effects=tuple(EffectEntry(*entry) for entry in entries), **changes)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a program and a machine whose riser gives way."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.nc").write_text(PART)
    (tmp_path / "riser.toml").write_text(machine_toml(with_effects(("setup_compliance", RISER))))
    return tmp_path


def analyzed(capsys, *options):
    assert main(["analyze", "part.nc", "--json", "--no-plots", "--step", "5", *options]) == 0
    return json.loads(capsys.readouterr().out)


def test_without_the_set_up_the_figures_are_the_nominal_ones_and_a_warning_says_why(here, capsys):
    nominal = analyzed(capsys)
    waiting = analyzed(capsys, "--machine", "riser.toml")
    assert waiting["mean_N_per_mm"] == pytest.approx(nominal["mean_N_per_mm"], rel=1e-9)
    assert waiting["effects"] == [] and waiting["setup"] is None
    assert [one["effect"] for one in waiting["effects_idle"]] == ["setup_compliance"]
    told = [text for text in waiting["warnings"] if text.startswith(WAITS)]
    assert len(told) == 1 and "--setup riser" in told[0]
    assert main(["analyze", "part.nc", "--machine", "riser.toml"]) == 0
    printed = capsys.readouterr().out
    assert "with setup_compliance" not in printed and "--setup" in printed
    page = (here / "reports/part/report.html").read_text()
    assert WAITS in page


def test_in_its_set_up_the_springs_stand_in_series(here, capsys):
    """Vertical spindle: along X the compliance grows by the riser's own, whatever the struts do."""
    stiffness = {}
    for setup in ("riser", "none"):
        assert main(["pose", "40", "-30", "800", "--machine", "riser.toml", "--setup", setup, "--json"]) == 0
        stiffness[setup] = json.loads(capsys.readouterr().out)
    for axis, grown in (("x", 8e-6), ("y", 5e-6), ("z", 2e-6)):  # mm/N
        key = f"k{axis}_N_per_mm"
        assert 1.0 / stiffness["riser"][key] - 1.0 / stiffness["none"][key] == pytest.approx(grown, rel=1e-6)
    assert stiffness["riser"]["effects"] == ["setup_compliance"] and stiffness["riser"]["setup"] == "riser"
    assert stiffness["none"]["effects"] == [] and stiffness["none"]["warnings"] == []


def test_the_header_names_effect_and_set_up(here, capsys):
    assert main(["analyze", "part.nc", "--machine", "riser.toml", "--setup", "riser", "--no-plots"]) == 0
    assert "nist with setup_compliance, set-up riser" in capsys.readouterr().out


def test_a_set_up_that_nobody_knows_is_refused_with_the_known_ones(here, capsys):
    assert main(["analyze", "part.nc", "--machine", "riser.toml", "--setup", "riserr"]) == 2
    error = capsys.readouterr().err
    assert "'riserr'" in error and "one of riser, or none" in error
    assert not (here / "reports").exists()
    for command in (["map"], ["pose", "0", "0", "800"], ["place", "part.nc"], ["case-study"]):
        assert main([*command, "--machine", "riser.toml", "--setup", "riserr"]) == 2, command
        assert "one of riser, or none" in capsys.readouterr().err


def test_another_set_up_that_the_machine_file_lists_is_no_mistake(here, capsys):
    machine = with_effects(("setup_compliance", RISER), setups=("riser", "table"))
    (here / "both.toml").write_text(machine_toml(machine))
    assert load_machine("both.toml").setups == ("riser", "table")
    found = analyzed(capsys, "--machine", "both.toml", "--setup", "table")
    assert found["effects"] == [] and not any(WAITS in text for text in found["warnings"])
    assert any("belongs to set-up 'riser', and this is 'table'" in text for text in found["assumptions"])
    assert main(["analyze", "part.nc", "--machine", "both.toml", "--setup", "tabel"]) == 2
    assert "one of riser, table, or none" in capsys.readouterr().err


def test_machine_file_and_controller_file_name_the_set_up_and_the_option_wins(here, capsys):
    machine = with_effects(("setup_compliance", RISER), setup="riser", setups=("riser", "table"), temperature=21.5)
    (here / "named.toml").write_text(machine_toml(machine))
    again = load_machine("named.toml")
    assert (again.setup, again.setups, again.temperature) == ("riser", ("riser", "table"), 21.5)
    assert analyzed(capsys, "--machine", "named.toml")["effects"] == ["setup_compliance"]
    (here / "control.toml").write_text('setup = "table"\n')
    on_table = analyzed(capsys, "--machine", "named.toml", "--controller", "control.toml")
    assert on_table["effects"] == [] and on_table["setup"] == "table"
    both = ("--machine", "named.toml", "--controller", "control.toml", "--setup", "riser")
    assert analyzed(capsys, *both)["setup"] == "riser"
    (here / "control.toml").write_text('setup = "riserr"\n')
    assert main(["analyze", "part.nc", "--machine", "named.toml", "--controller", "control.toml"]) == 2
    assert "control.toml: set-up 'riserr' is not known" in capsys.readouterr().err
    (here / "control.toml").write_text("setup = 3\n")
    assert main(["analyze", "part.nc", "--controller", "control.toml"]) == 2
    assert "setup = 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "found"),
    [('name = ""', "a text that is not empty"), ('names = ["a", "a"]', "each once"), ('names = "a"', "a list of names"),
     ("temperature_C = 900", "at most 200")],
)  # fmt: skip
def test_bad_conditions_in_a_machine_file_name_their_line(line, found):
    text = machine_toml(load_machine("nist")).replace("[setup]\n", f"[setup]\n{line}\n")
    with pytest.raises(Exception, match=found) as raised:
        parse_machine(text, "mine.toml")
    assert str(raised.value).startswith(f"mine.toml:{text.splitlines().index(line) + 1}")


def test_a_set_up_in_the_machine_file_that_no_effect_knows_is_refused(here, capsys):
    machine = with_effects(("setup_compliance", RISER), setup="rizer")
    (here / "slip.toml").write_text(machine_toml(machine))
    assert main(["pose", "0", "0", "800", "--machine", "slip.toml"]) == 2
    error = capsys.readouterr().err
    assert "[setup] name: set-up 'rizer' is not known" in error and "one of riser" in error
    (here / "bare.toml").write_text((here / "slip.toml").read_text().replace('"rizer"', '"none"'))
    assert main(["pose", "0", "0", "800", "--machine", "bare.toml"]) == 0


def test_a_set_up_that_changes_nothing_is_said(here, capsys):
    found = analyzed(capsys, "--setup", "riser")
    assert any("'riser' changes nothing" in text for text in found["warnings"])


def test_every_command_on_the_machine_warns(here, capsys):
    machine = ["--machine", "riser.toml", "--no-plots"]
    assert main(["map", *machine, "--points", "3"]) == 0
    assert WAITS in capsys.readouterr().out
    assert WAITS in json.loads((here / "reports/riser-map/map.json").read_text())["warnings"][0]
    assert main(["map", *machine, "--points", "3", "--setup", "riser"]) == 0
    assert "machine nist with setup_compliance, set-up riser" in capsys.readouterr().out
    assert main(["pose", "0", "0", "800", *machine[:2]]) == 0
    assert WAITS in capsys.readouterr().out
    (here / "poses.csv").write_text("x_mm,y_mm,z_mm\n0,0,800\n")
    assert main(["pose", "--csv", "poses.csv", *machine[:2]]) == 0
    assert WAITS in capsys.readouterr().err
    assert main(["case-study", *machine]) == 0
    assert WAITS in capsys.readouterr().out
    bounds = ["--x", "0:20", "--y", "0", "--z", "800", "--rotate", "0", "--points", "3", "--step", "10"]
    assert main(["place", "part.nc", *machine, *bounds]) == 0
    assert WAITS in capsys.readouterr().out.replace("\n                ", " ")
    (here / "more").mkdir()
    (here / "more/other.nc").write_text(PART)
    assert main(["analyze", "part.nc", "more/other.nc", *machine, "--out", "all", "--jobs", "1"]) == 0
    capsys.readouterr()
    for name in ("part", "other"):
        assert WAITS in json.loads((here / f"all/{name}/summary.json").read_text())["warnings"][0]


def test_a_machine_compared_with_says_so_too(here, capsys):
    found = analyzed(capsys, "--compare", "riser.toml")
    assert any(text.startswith(f"--compare nist: {WAITS}") for text in found["warnings"])
    found = analyzed(capsys, "--compare", "riser.toml", "--setup", "riser")
    assert found["compare"]["mean_N_per_mm"] < 0.9 * found["mean_N_per_mm"]
    assert found["compare"]["effects"] == ["setup_compliance"]


def test_a_temperature_that_nobody_gives(here, capsys):
    file = effect_file(here, "warm_table", "temperature_C", "(path.temperature - 20.0)")
    (here / "warm.toml").write_text(machine_toml(with_effects(("warm_table", {"compliance_nm_per_N": 2.0}))))
    options = ("--machine", "warm.toml", "--effects", file)
    waiting = analyzed(capsys, *options)
    assert waiting["effects"] == []
    assert any("warm_table does not act" in text and "--temperature" in text for text in waiting["warnings"])
    kx = {}
    for temperature in ("20", "23"):
        assert main(["pose", "0", "0", "800", *options, "--temperature", temperature, "--json"]) == 0
        kx[temperature] = json.loads(capsys.readouterr().out)["kx_N_per_mm"]
    assert 1.0 / kx["23"] - 1.0 / kx["20"] == pytest.approx(3 * 2e-6, rel=1e-6)
    assert main(["pose", "0", "0", "800", *options, "--temperature", "900"]) == 2
    assert "at most 200" in capsys.readouterr().err


def test_what_no_program_has_is_named_as_such(here, capsys):
    file = effect_file(here, "creeping", "time_min", "path.time")
    (here / "creep.toml").write_text(machine_toml(with_effects(("creeping", {"compliance_nm_per_N": 2.0}))))
    found = analyzed(capsys, "--machine", "creep.toml", "--effects", file)
    assert found["effects"] == []
    assert any("creeping does not act" in text and "no program has" in text for text in found["warnings"])


def test_the_model_alone_knows_what_acts():
    model = build_model(with_effects(("setup_compliance", RISER)))
    assert acting_names(model) == [] and list(waiting_effects(model)) == ["setup_compliance"]
    in_place = build_model(with_effects(("setup_compliance", RISER)), conditions=Conditions(setup="riser"))
    assert acting_names(in_place) == ["setup_compliance"] and condition_warnings(in_place) == []


def test_a_parameter_of_an_effect_that_does_not_act_has_no_band(here, capsys):
    text = machine_toml(with_effects(("setup_compliance", RISER)))
    text += '\n[uncertainty]\nparameters = ["setup_compliance.x_nm_per_N"]\nsd = [0.5]\ncorrelation = [[1.0]]\n'
    (here / "band.toml").write_text(text)
    assert "parameter_uncertainty" not in analyzed(capsys, "--machine", "band.toml")
    assert analyzed(capsys, "--machine", "band.toml", "--setup", "riser")["parameter_uncertainty"]


@pytest.fixture(scope="module")
def exercise(tmp_path_factory):
    """The paper's points measured on a machine of independent code that hides a riser."""
    folder = tmp_path_factory.mktemp("riser")
    rows, _ = case.make_case(3, layout="paper", hidden="setup_compliance", noise=0.01)
    (folder / "data.csv").write_text(exercise_module.csv_text(rows))
    return folder


def test_a_riser_that_was_found_acts(exercise, here, capsys):
    """Measured, updated, analyzed: softer on the riser, unchanged beside it, never silently."""
    data = str(exercise / "data.csv")
    wanted = ["update", data, "--add", "setup_compliance", "--strut-law", "--noise", "1", "-o", "better.toml"]
    assert main([*wanted, "--no-plots"]) == 0
    assert "--setup riser" in capsys.readouterr().out
    better = load_machine("better.toml")
    assert set(better.setups) == {"riser", "table"}  # as the rig calls them
    on, off = (analyzed(capsys, "--machine", "better.toml", "--setup", name) for name in ("riser", "table"))
    assert on["mean_N_per_mm"] < 0.97 * off["mean_N_per_mm"]
    assert on["effects"] == ["setup_compliance"] and off["effects"] == []
    nobody = analyzed(capsys, "--machine", "better.toml")
    assert nobody["mean_N_per_mm"] == pytest.approx(off["mean_N_per_mm"], rel=1e-12)
    assert any(WAITS in text for text in nobody["warnings"])


def test_readings_without_the_column_are_told_of_it(exercise, here, capsys):
    import pandas as pd

    rows = pd.read_csv(exercise / "data.csv")
    rows.drop(columns="setup").to_csv("bare.csv", index=False)
    rows[rows["setup"] != "riser"].to_csv("table.csv", index=False)
    for file, why in (("bare.csv", "column setup is missing"), ("table.csv", "none is of set-up 'riser'")):
        assert main(["compare", file, "--machine", "riser.toml", "--noise", "1", "--no-plots", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["effects"] == []
        told = [text for text in found["warnings"] if text.startswith("setup_compliance of the machine file")]
        assert len(told) == 1 and why in told[0]
    assert main(["compare", str(exercise / "data.csv"), "--machine", "riser.toml", "--noise", "1", "--no-plots",
                 "--json"]) == 0  # fmt: skip
    found = json.loads(capsys.readouterr().out)
    assert found["effects"] == ["setup_compliance"] and not any("setup_comp" in text for text in found["warnings"])


def test_how_much_a_choice_matters_is_asked_in_the_set_up_that_it_belongs_to():
    from types import SimpleNamespace

    from toolpath_stiff.diagnosis.diagnose import choice_on_path
    from toolpath_stiff.placement.case_study import case_study_program

    machine = load_machine("nist")
    riser = build_model(with_effects(("setup_compliance", RISER))).effects
    law = (0.0, 0.0)
    diagnosis = SimpleNamespace(
        machine=machine, explanations=("none", "setup_compliance"), base=SimpleNamespace(law=law, effects=()),
        fits={"setup_compliance": SimpleNamespace(law=law, effects=riser)}, predictor=SimpleNamespace(effect_files=()),
    )  # fmt: skip
    found = choice_on_path(diagnosis, case_study_program(), None)
    assert found["setup"] == "riser"
    assert found["mean_spread_percent"] > 10.0


def test_an_effect_of_one_s_own_without_its_column_is_named_and_does_no_harm(exercise, here, capsys):
    """Its method would fail on a temperature that is not there; `compare` runs it through every link."""
    file = effect_file(here, "warm_table", "temperature_C", "(path.temperature - 20.0)")
    (here / "warm.toml").write_text(machine_toml(with_effects(("warm_table", {"compliance_nm_per_N": 2.0}))))
    words = ["compare", str(exercise / "data.csv"), "--machine", "warm.toml", "--effects", file, "--noise", "1"]
    assert main([*words, "--no-plots"]) == 0
    assert "warm_table of the machine file does not act on these readings" in capsys.readouterr().out
