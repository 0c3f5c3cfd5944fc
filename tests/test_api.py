"""What people import: each function against the command that shows its result, and what every result can do."""

from __future__ import annotations

import inspect
import json
import math
import pickle
import re
import subprocess
import sys
from pathlib import Path

import matplotlib.figure
import pandas as pd
import pytest

import toolpath_stiff as tps
from toolpath_stiff.cli.main import MODULES as COMMANDS
from toolpath_stiff.cli.main import main

ROOT = Path(__file__).parents[1]
SLOT = "G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nG2 X60 Y20 R20\nM2\n"
RAW = "x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um\n" + "".join(
    f"0,0,800,X,{jog},{40 * jog},{0.2 * jog}\n" for jog in (0, 200, -200, 0)
)
SLOTS = ["record,time_s,fx_N,fy_N,feed_per_tooth_mm,spindle_rpm,depth_mm"] + [
    f"{feed},{k / 4000},{100 * feed},{-900 * feed + 20 * math.sin(0.15 * math.pi * k)},{feed},6000,3"
    for feed in (0.04, 0.06, 0.08)
    for k in range(400)
]
PLACE = {"x_mm": (-60, 60), "y_mm": 0, "z_mm": (700, 800), "rotate_deg": 0, "step_mm": 10, "points": 5}

# The command -> the function that must give the same JSON. Each in a folder with slot.nc and raw.csv.
PAIRS = {
    "analyze slot.nc --step 5 --origin 10,0,800 --load normal --require 50000 --compare genhexkins --partial": lambda: (
        tps.analyze(
            "slot.nc",
            "nist",
            step_mm=5,
            origin_mm_deg=(10, 0, 800),
            load="normal",
            require_N_per_mm=50000,
            compare_with="genhexkins",
            partial=True,
        )
    ),
    "check slot.nc --machine none --dialect fanuc": lambda: tps.check(
        tps.Program.read("slot.nc", dialect="fanuc"), None
    ),
    "pose -300 300 300 -30 0 0 --force 500": lambda: tps.pose((-300, 300, 300, -30, 0, 0), "nist", force_N=500),
    "map --slices 800,1200 --points 11 --load z --tilt 5,0,0": lambda: tps.map_stiffness(
        "nist", z_mm=(800, 1200), points=11, load="z", tilt_deg=(5, 0, 0)
    ),
    "place slot.nc --x -60:60 --y 0 --z 700:800 --rotate 0 --step 10 --points 5": lambda: tps.place(
        "slot.nc", "nist", **PLACE
    ),
    "case-study": tps.case_study,
    "compare nist-table1 --noise 5": lambda: tps.compare("nist-table1", "nist", noise_percent=5),
    "diagnose nist-table1 --noise 10 --seed 3 --program slot.nc --origin 0,0,800": lambda: tps.diagnose(
        "nist-table1", "nist", noise_percent=10, seed=3, program="slot.nc", origin_mm_deg=(0, 0, 800)
    ),
    "update nist-table1 --strut-law --noise 2,1 -o mine.toml": lambda: tps.update(
        "nist-table1", "nist", strut_law=True, noise_percent=(2, 1), machine_file="mine.toml"
    ),
    "plan --between spindle_compliance,none --n 2 --cost pose=20": lambda: tps.plan(
        machine="nist", between=("spindle_compliance", "none"), n=2, minutes={"pose": 20}
    ),
    "forces slots.csv --cut cut.toml --axes=x,y,z": lambda: tps.forces("slots.csv", "cut.toml"),
    "machine check nist.toml": lambda: tps.Machine.load("nist.toml").check(),
    "effects list": tps.effects,
    "effects draft nist-table1 --noise 20 -o missing.toml": lambda: tps.draft_effect(
        "nist-table1", "nist", "missing.toml", noise_percent=20
    ),
}
NO_PICTURES = ("analyze", "map", "place", "case-study", "compare", "diagnose", "update", "plan", "forces")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("slot.nc").write_text(SLOT)
    Path("raw.csv").write_text(RAW)
    Path("slots.csv").write_text("\n".join(SLOTS))
    Path("cut.toml").write_text("[[tool]]\nnumber = 1\ndiameter_mm = 10\nflutes = 3\nhelix_deg = 30\n")
    tps.Machine.load("nist").save("nist.toml")
    tps.effect_template("my_screw").save("my_screw.py")
    return tmp_path


@pytest.mark.parametrize("line", PAIRS)
def test_a_command_shows_what_its_function_returns(line, here, capsys):
    argv = [*line.split(), "--json"]
    argv += ["--no-plots", "--out", "out"] if argv[0] in NO_PICTURES else []
    assert main(argv) in (0, 1, 3)
    shown = capsys.readouterr().out
    result = PAIRS[line]()
    if isinstance(result, dict):
        assert json.loads(shown) == result
        return
    assert json.loads(shown) == result.to_dict()
    assert shown == result.to_json()
    name = {"analyze": "summary", "place": "placement", "case-study": "case_study"}.get(argv[0], argv[0])
    if argv[0] in NO_PICTURES:
        assert (here / "out" / f"{name}.json").read_text(encoding="utf-8") == shown
    assert str(result).strip()
    assert len(repr(result)) < 200
    assert "<script" not in result._repr_html_()


def test_reduce_is_its_function_and_where_it_wrote(here, capsys):
    assert main(["reduce", "raw.csv", "--no-plots", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown.pop("files") == ["raw_measurements.csv"]
    found = tps.reduce("raw.csv")
    assert shown == found.to_dict()
    assert found.to_frame()["stiffness_N_per_mm"].tolist() == [50000.0]  # 16 kN over 0.32 mm of deflection


def test_an_effect_check_is_its_function_s(here, capsys):
    assert main(["effects", "check", "my_screw.py", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == tps.check_effects("my_screw.py").to_dict()


def test_many_programs_are_their_function_s(here, capsys):
    Path("other.nc").write_text(SLOT)
    assert main(["analyze", "slot.nc", "other.nc", "--step", "20", "--jobs", "1", "--no-plots", "--json"]) == 0
    found = tps.analyze_many(["slot.nc", "other.nc"], "nist", "reports", jobs=1, step_mm=20, plots=False)
    assert capsys.readouterr().out == found.to_json()


def test_every_command_is_held_to_its_function():
    """What has no JSON of its own: `rig` shares nothing with the library, `studio` serves a page."""
    alone = {"reduce", "path", "cut", "compensate"}  # in tests of their own
    assert {line.split()[0] for line in PAIRS} | alone | {"rig", "studio"} == set(COMMANDS)


def test_path_is_its_function(here, capsys):
    assert main(["path", "slot.nc", "--step", "5", "--csv"]) == 0
    found = tps.sample_path("slot.nc", step_mm=5)
    assert capsys.readouterr().out == str(found)
    assert list(found.to_dict())[-2:] == ["feed_mm_per_min", "spindle_rpm"]


def test_a_saved_folder_is_the_command_s(here):
    found = tps.analyze("slot.nc", "nist", step_mm=5)
    written = found.save("saved", plots=False)
    assert main(["analyze", "slot.nc", "--step", "5", "--no-plots", "--out", "made"]) == 0
    assert {file.name for file in written} == {"samples.csv", "summary.json"}
    for file in written:
        assert file.read_bytes() == (here / "made" / file.name).read_bytes()


def test_saving_clears_what_an_earlier_run_left_and_keeps_what_is_not_the_tool_s(here):
    found = tps.analyze("slot.nc", "nist", step_mm=5)
    found.save("saved")
    (here / "saved" / "notes.txt").write_text("mine")
    found.save("saved", plots=False)
    assert {file.name for file in (here / "saved").glob("[!.]*")} == {"samples.csv", "summary.json", "notes.txt"}
    Path("other").mkdir()
    Path("other/summary.json").write_text("mine")
    with pytest.raises(tps.InputError, match="summary"):
        found.save("other", plots=False)
    found.save("other", plots=False, replace=True)
    assert Path("other/summary.json.old").read_text() == "mine"


@pytest.mark.parametrize(
    "result",
    [
        lambda: tps.analyze(tps.Program.from_text(SLOT), "nist", step_mm=5),
        lambda: tps.map_stiffness("nist", points=11),
        lambda: tps.Machine.load("nist"),
        lambda: tps.Machine.load("nist").check(),
        lambda: tps.compare("nist-table1", "nist", noise_percent=5),
        lambda: tps.plan(machine="nist", n=8),
    ],
)
def test_a_result_draws_itself(result):
    found = result()
    assert isinstance(found.plot(), matplotlib.figure.Figure)
    assert isinstance(found.to_frame(), pd.DataFrame)


def test_every_public_name_is_there_and_listed():
    assert set(tps.__all__) == set(dir(tps))
    for name in tps.__all__:
        assert getattr(tps, name) is not None
    wanted = "analyze check sample_path pose place map_stiffness case_study reduce compare diagnose update plan rewrite"
    assert {*wanted.split(), "Machine", "Program", "Measurements", "Effect"} <= set(tps.__all__)
    with pytest.raises(AttributeError, match="analyse"):
        tps.analyse  # noqa: B018


# Members without an example: it would take seconds. Those of `Case` keep the result of the function of the same name.
NO_EXAMPLE = {
    # What a result is made from, and its rows and sentences: the methods that show them have examples.
    "Comparison": {"variance", "document"},
    "Effect": {"hooks"},
    "Reduction": {"loops"},
    "Diagnosis": {
        "nuisances",
        "entries",
        "likeliest",
        "rows",
        "noise",
        "unconfirmed",
        "predictor",
        "explanations",
        "beside",
        "after",
    },
    "Plan": {"rows", "sentences", "notes", "visits"},
    "Analysis": {  # arrays in SI and what figures and pictures are made from
        *("machine", "moves", "path", "operations", "operation", "parameter_band", "figures", "weakest_rows"),
        *("counted", "along_axis", "move_lengths", "plunging", "headline", "set_aside", "out_of_reach"),
    },
    "Case": {"preview", "record", "next_result"},
    "Update": {
        "kept_law",
        "known",
        *("model", "cause", "added"),
        "objections",  # steps and fits in SI, and what follows from them
        *("described", "last", "changed", "worse", "supported", "verdict", "widening", "corrected", "fitted"),
        *("document", "noise", "question", "text", "assumptions", "errors"),
    },
    "Machine": {"picture"},
    "MachineCheck": {"picture"},
}


def members_of(public):
    """Name -> function of every public method and property, inherited ones of this package too."""
    found = {}
    for kind in reversed(public.__mro__ if inspect.isclass(public) else ()):
        for name, value in vars(kind).items() if kind.__module__.startswith("toolpath_stiff.") else ():
            made = getattr(value, "__func__", None) or getattr(value, "fget", None) or getattr(value, "func", value)
            if not name.startswith("_") and inspect.isfunction(made):
                found.setdefault(name, []).append(made)
    return found


@pytest.mark.parametrize("name", [name for name in tps.__all__ if not name.startswith("_")])
def test_every_public_name_and_member_is_in_an_example_that_runs(name):
    """An example is the name's own, a member's, or that of a function that returns the class."""
    public = getattr(tps, name)
    functions = [one for one in (getattr(tps, other) for other in tps.__all__) if inspect.isfunction(one)]
    makers = [one for one in functions if name in re.findall(r"\w+", str(inspect.signature(one).return_annotation))]
    members = members_of(public)
    documented = [public, *getattr(public, "__mro__", ()), *makers, *(one for own in members.values() for one in own)]
    lines = [line for one in documented for line in (inspect.getdoc(one) or "").splitlines()]
    shown = "\n".join(line for line in lines if line.startswith((">>> ", "... ")))
    assert any(">>> " in (one.__doc__ or "") for one in (public, *makers)), f"{name} has no example"
    for member, own in members.items():
        assert own[-1].__doc__, f"{name}.{member} has no docstring"
        example = any(">>> " in (one.__doc__ or "") for one in own) or f".{member}" in shown
        assert example or member in NO_EXAMPLE.get(name, ()), f"{name}.{member} is in no example"


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, toolpath_stiff; print([m for m in ('numpy', 'scipy', 'pandas', 'matplotlib') if m in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_a_machine_and_readings_show_themselves_as_json_and_in_notebooks(tmp_path):
    machine, data = tps.Machine.load("nist"), tps.Measurements.read("nist-table1")
    assert pd.DataFrame(machine.to_dict()["figures"]).equals(machine.to_frame())
    found = json.loads(json.dumps(data.to_dict(), allow_nan=False))
    assert pd.DataFrame(found["readings"])["stiffness_N_per_mm"].equals(data.to_frame()["stiffness_N_per_mm"])
    assert "NIST Ingersoll" in machine._repr_html_() and "stiffness_N_per_mm" in data._repr_html_()
    checked = tps.check(tps.Program.from_text(SLOT))
    assert checked.save(tmp_path / "check.json").read_text("utf-8") == checked.to_json()


def test_shop_units_at_the_door():
    slot = tps.Program.from_text(SLOT)
    found = tps.analyze(slot, "nist", step_mm=5, origin_mm_deg=(0, 0, 800)).to_frame()
    assert found["z_mm"].max() == pytest.approx(805.0)
    assert found["s_mm"].diff().max() <= 5.0 + 1e-9
    turned = tps.analyze(slot, "nist", step_mm=5, origin_mm_deg=(0, 0, 800, 0, 0, 90)).to_frame()
    assert turned["y_mm"].max() == pytest.approx(60.0)  # x of the program lies along y


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda: tps.analyze(tps.Program.from_text(SLOT), "nist", step_mm=0), "--step 0"),
        (lambda: tps.analyze(tps.Program.from_text(SLOT), "nist", step_mm=float("nan")), "--step nan"),
        (
            lambda: tps.analyze(tps.Program.from_text(SLOT), "nist", origin_mm_deg=(1, 2)),
            "of 2 numbers",
        ),
        (lambda: tps.analyze(tps.Program.from_text(SLOT), "nist", load="sideways"), "sideways"),
        (lambda: tps.analyze("nowhere.nc", "nist"), "nowhere.nc"),
        (lambda: tps.Machine.load("nobody"), "nobody"),
        (lambda: tps.Machine.load("nist", temperature_C=1000), "--temperature 1000"),
        (lambda: tps.pose((0, 0), "nist"), "X Y Z or X Y Z A B C"),
        (lambda: tps.pose((0, 0, 1e9), "nist"), "within \\+-100000"),
        (lambda: tps.map_stiffness("nist", points=1), "points 1"),
        (lambda: tps.map_stiffness("nist", z_mm=(800, 800)), "twice"),
        (lambda: tps.place(tps.Program.from_text(SLOT), "nist", x_mm=(5, -5)), "lower bound first"),
        (lambda: tps.place(tps.Program.from_text(SLOT), "nist", tilt_a_deg=(0, 400)), "at least -180 and at most 180"),
        (lambda: tps.place(tps.Program.from_text(SLOT), "nist", decimals=3), "without --write"),
        (lambda: tps.place(tps.Program.from_text(SLOT), "nist", objective="best"), "--objective best"),
        (lambda: tps.compare("nist-table1", "nist", noise_percent=80), "--noise 80; expected one or two percentages"),
        (lambda: tps.compare("nist-table1", "nist", seed=-1), "seed -1"),
        (lambda: tps.compare("nowhere.csv", "nist"), "nowhere.csv"),
        (lambda: tps.plan(machine="nist", minutes={"lunch": 30}), "lunch"),
        (lambda: tps.update("nist-table1", "nist"), "nothing"),
    ],
)
def test_what_is_wrong_is_one_error_that_can_be_caught(ask, told):
    with pytest.raises(tps.TpsError, match=told):
        ask()


def test_a_pose_out_of_reach_is_an_error_alone_and_empty_among_others():
    with pytest.raises(tps.UnreachableError):
        tps.pose((0, 0, 5000), "nist")
    found = tps.pose([(0, 0, 800), (0, 0, 5000)], "nist")
    assert found.reachable.tolist() == [True, False]
    assert found.to_dict()["poses"][1]["kx_N_per_mm"] is None
    json.dumps(found.to_dict(), allow_nan=False)


def test_progress_is_told_what_how_much_and_of_how_much(here):
    told = []
    tps.analyze("slot.nc", "nist", progress=lambda *what: told.append(what))
    text, done, total = told[-1]
    assert text == "slot.nc: samples"
    assert done == total > 0


def test_an_updated_machine_goes_on(here):
    refused, update = (tps.update("nist-table1", "nist", strut_law=True, force=force) for force in (False, True))
    assert not refused.accepted and update.accepted  # readings that tell nothing of the law
    better = update.machine
    file = update.save_machine("mine.toml")
    again = tps.Machine.load(file)
    at = (0, 0, 800)
    assert tps.pose(at, better).to_dict()["kz_N_per_mm"] == pytest.approx(tps.pose(at, again).to_dict()["kz_N_per_mm"])
    assert tps.compare("nist-table1", again, noise_percent=5).to_dict()["machine"] == "nist"


def test_a_rewritten_program_cuts_where_the_placed_one_does(here):
    slot = tps.Program.read("slot.nc")
    written = tps.rewrite(slot, to_mm_deg=(10, 20, 800, 0, 0, 30), from_mm_deg=(0, 0, 800))
    written.save("placed.nc")
    cuts = []
    for program, origin in ((slot, (10, 20, 800, 0, 0, 30)), ("placed.nc", (0, 0, 800))):
        frame = tps.sample_path(program, origin_mm_deg=origin, step_mm=5).to_frame()
        cuts.append(frame[frame["motion"] != "rapid"])
    for column in ("x_mm", "y_mm", "z_mm"):
        assert cuts[0][column].tolist() == pytest.approx(cuts[1][column].tolist(), abs=2e-4)


def test_a_machine_and_a_program_travel_to_another_process():
    machine = pickle.loads(pickle.dumps(tps.Machine.load("nist")))
    program = pickle.loads(pickle.dumps(tps.Program.from_text(SLOT)))
    assert tps.analyze(program, machine, step_mm=5).complete


def test_a_diagnosis_is_not_made_again_for_the_plan(monkeypatch):
    from toolpath_stiff.inference import judgement as planning

    data = tps.Measurements.read("nist-table1")
    found = tps.diagnose(data, "nist", noise_percent=10)
    plain = tps.plan(data, "nist", noise_percent=10, n=2)
    monkeypatch.setattr(planning, "judge", None, raising=True)
    assert tps.plan(data, "nist", noise_percent=10, n=2, diagnosis=found).to_dict() == plain.to_dict()


def test_place_names_the_program_that_it_wrote_among_the_files(here, capsys):
    options = "--x -60:60 --y 0 --z 700:800 --rotate 0 --step 10 --points 5 --no-plots --out out"
    assert main(["place", "slot.nc", *options.split(), "--write", "placed.nc"]) == 0
    written = capsys.readouterr().out.split("written:\n")[1].split()
    assert written == ["out/placements.csv", "out/placement.json", "placed.nc"]
    again = tps.place("slot.nc", "nist", **PLACE, write="placed.nc")
    assert Path("placed.nc").read_bytes() == again.program_bytes


def test_a_machine_may_be_named_after_the_data():
    assert str(tps.compare("nist-table1", machine="genhexkins")) == str(tps.compare("nist-table1", "genhexkins"))
