"""Whatever an effect or a machine file does: a result that is finite, symmetric, positive definite, or one message."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.effects.test_own_effects import BODY, FORM, own, use, with_machine
from tests.stiffness.cases import nist
from toolpath_stiff.analysis.evaluation import evaluate
from toolpath_stiff.analysis.poses import evaluate_poses
from toolpath_stiff.analysis.results import analyze, required_stiffness_missed
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.stiffness import core
from toolpath_stiff.stiffness.active import ActiveEffect
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.stiffness.core import compliance_along
from toolpath_stiff.stiffness.effects.frame_compliance import FrameCompliance
from toolpath_stiff.stiffness.effects.joint_compliance import JointCompliance
from toolpath_stiff.stiffness.exact import is_compliance
from toolpath_stiff.stiffness.model import build_model

PART = "G21 G90\nG0 X0 Y0 Z0\nG1 X10 F100\nM2\n"
TIP = np.linspace([0.0, 0.0, 0.8], [0.2, 0.1, 0.9], 3)


def unsymmetric(self, path, p):
    form = np.zeros((len(path), 12, 12))
    form[:, 0, 1] = 1e-6
    return form


BROKEN = {
    "nan": (JointCompliance, "strut_compliance", lambda self, path, p: np.full((len(path), 6), np.nan)),
    "inf": (JointCompliance, "strut_compliance", lambda self, path, p: np.full((len(path), 6), np.inf)),
    "negative": (JointCompliance, "strut_compliance", lambda self, path, p: np.full((len(path), 6), -1e-6)),
    "unsymmetric": (FrameCompliance, "load_compliance", unsymmetric),
}
ENTRIES = {
    JointCompliance: 'name = "joint_compliance"\ncompliance_nm_per_N = 2.0',
    FrameCompliance: 'name = "frame_compliance"\nvertex = 0\nradial_nm_per_N = 1.0\nvertical_nm_per_N = 1.0',
}
COMMANDS = {
    "pose": ["pose", "0", "0", "800"],
    "analyze": ["analyze", "part.nc", "--no-plots", "--require", "9999999"],
    "map": ["map", "--x", "-10:10", "--y", "-10:10", "--z", "800", "--points", "3", "--no-plots"],
    "place": ["place", "part.nc", "--no-plots", "--points", "3"],
}
READINGS = {name: [name, "nist-table1", "--no-plots"] for name in ("compare", "diagnose")}


@pytest.mark.parametrize("how", BROKEN)
@pytest.mark.parametrize("command", COMMANDS | READINGS)
def test_a_packaged_effect_that_goes_wrong_is_one_message(tmp_path, monkeypatch, capsys, how, command):
    if how == "unsymmetric" and command in READINGS:
        pytest.skip("along one direction the symmetric part alone matters")
    monkeypatch.chdir(tmp_path)
    owner, hook, method = BROKEN[how]
    with_machine(tmp_path).write_text(
        with_machine(tmp_path).read_text().split("[[effect]]")[0] + f"[[effect]]\n{ENTRIES[owner]}\n"
    )
    Path("part.nc").write_text(PART)
    monkeypatch.setattr(owner, hook, method)
    assert main([*(COMMANDS | READINGS)[command], "--machine", "m.toml"]) == 2
    out, error = capsys.readouterr()
    assert "N/mm" not in out and "Traceback" not in error
    assert f"with effect {owner.name} " in error and " has no positive stiffness at X" in error


@pytest.mark.parametrize("command", COMMANDS | READINGS)
def test_an_effect_of_ones_own_that_leaves_a_strut_nothing(tmp_path, monkeypatch, capsys, command):
    """The tip's compliance alone would look sound: the other five struts hide the negative one."""
    monkeypatch.chdir(tmp_path)
    own(tmp_path, (BODY, "c = np.zeros((len(path), 6)); c[:, 1] = -27e-9; return c"))
    with_machine(tmp_path)
    Path("part.nc").write_text(PART)
    assert main([*(COMMANDS | READINGS)[command], "--machine", "m.toml", "--effects", "mine.py"]) == 2
    assert "with effect mine strut 2 has no positive stiffness at X" in capsys.readouterr().err


def test_an_effect_of_ones_own_whose_figures_would_overflow(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    own(tmp_path, (BODY, "return np.full((len(path), 6), 1e300)"))
    with_machine(tmp_path)
    assert main(["compare", "nist-table1", "--no-plots", "--machine", "m.toml", "--effects", "mine.py"]) == 2
    assert "strut_compliance returns 1e+300 at X" in (error := capsys.readouterr().err) and "within +-1e+18" in error


def test_an_indefinite_form_is_refused_however_small_its_share(tmp_path):
    """A tip that pushes back along Z by a billionth of its softest compliance is no machine."""
    text = "q = np.zeros((len(path), 12, 12)); q[:, 8, 8] = -1e-7; return q"
    with pytest.raises(InputError, match=r"effect mine the tip has no positive stiffness at X0 Y0 Z800 mm"):
        use(own(tmp_path, FORM, (BODY, text)))


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("stiffness_N_per_um", "[5e-324, 5e-324]", "stiffness_N_per_um = 4.94066e-324"),
        ("length_mm", "[1e-300, 2e-300]", "0.001 mm apart or more"),
    ],
)
def test_machine_files_with_absurd_laws_are_refused_with_their_line(tmp_path, capsys, key, value, told):
    machine = with_machine(tmp_path)
    lines = machine.read_text().split("[[effect]]")[0].splitlines()
    row = next(i for i, line in enumerate(lines) if line.startswith(f"{key} = ["))
    machine.write_text("\n".join([*lines[:row], f"{key} = {value}", *lines[row + 1 :]]))
    assert main(["pose", "0", "0", "800", "--machine", str(machine)]) == 2
    error = capsys.readouterr().err
    assert f"m.toml:{row + 1}: " in error and told in error


def test_a_pose_that_is_singular_and_within_the_limits_is_an_error(monkeypatch):
    """A machine whose file bounds no singularity may stand where nothing can be solved: nan is no answer there."""
    monkeypatch.setattr(core, "tip_compliance", lambda model, tip, *_: np.full((len(tip), 3, 3), np.nan))
    zeros = np.zeros((1, 3))
    for evaluated in (partial(evaluate, tangent=np.eye(3)[:1]), evaluate_poses):
        with pytest.raises(InputError, match=r"machine nist is singular at X0 Y0 Z800 mm.*min_index"):
            evaluated(build_model(nist()), position=TIP[:1], abc=zeros)


def test_the_quick_test_of_tensors_is_that_of_their_eigenvalues():
    rng = np.random.default_rng(4)
    turns = np.linalg.qr(rng.normal(size=(4000, 3, 3)))[0]
    values = 10.0 ** rng.uniform(-12, -6, (4000, 3)) * np.where(rng.uniform(size=(4000, 3)) < 0.1, -1.0, 1.0)
    tensors = turns @ (values[..., None] * np.swapaxes(turns, 1, 2))
    tensors = 0.5 * (tensors + np.swapaxes(tensors, 1, 2))
    clear = np.abs(values).min(axis=1) > 1e-5 * np.abs(values).max(axis=1)
    assert (is_compliance(tensors)[clear] == (values > 0.0).all(axis=1)[clear]).all() and clear.sum() > 1000
    sound = np.diag([3e-8, 2e-8, 1e-8])
    odd = [sound.copy() for _ in range(6)]
    odd[0][0, 1], odd[1][2, 0], odd[2][1, 1], odd[3][0, 0], odd[4][2, 2] = 1e-12, np.nan, np.inf, -np.inf, 0.0
    odd[5] = 1e-200 * sound
    assert is_compliance(np.array(odd)).tolist() == [False] * 5 + [True]


def test_a_load_dependent_effect_is_tested_under_its_load():
    class Snap(JointCompliance):
        name, load_dependent = "snap", True

        def strut_compliance(self, path, p):
            return None if path.strut_forces is None else np.where(path.strut_forces > 100.0, -1.0, 0.0)

    model = build_model(nist(), extra=[ActiveEffect(Snap(), {"compliance": 1e-9})])
    along = np.tile([1.0, 0.0, 0.0], (3, 1))
    assert np.isfinite(compliance_along(model, along, TIP, force=1.0)).all()
    with pytest.raises(InputError, match=r"with effect snap strut \d has no positive stiffness at X"):
        compliance_along(model, along, TIP, force=1000.0)


def test_what_has_no_stiffness_has_not_the_required_one():
    found = analyze(nist(), parse_program(PART, "part.nc"))
    assert required_stiffness_missed(found, 1e3) == []
    at = replace(found.at, stiffness=np.where(np.arange(len(found.samples)) == 3, np.nan, found.at.stiffness))
    missed = required_stiffness_missed(replace(found, at=at), 1e3)
    assert [line for line, _ in missed] == [3] and np.isnan(missed[0][1])


@pytest.mark.parametrize(
    ("move", "option"), [("G1 A5 F100", []), ("G1 X5000 F100", ["--partial"])], ids=["rotary axes alone", "leaves"]
)
def test_the_gate_fails_where_a_cut_has_no_figure(tmp_path, monkeypatch, capsys, move, option):
    monkeypatch.chdir(tmp_path)
    Path("part.nc").write_text(f"G21 G90\nG0 X0 Y0 Z0\n{move}\nM2\n")
    assert main(["analyze", "part.nc", "--no-plots", "--require", "1", *option]) == 3
    assert f"1 line below the required 1 N/mm:\n  line 3  no stiffness  {move}\n" in capsys.readouterr().out
    assert main(["analyze", "part.nc", "--no-plots", *option]) == (1 if option else 0)
    found = tps.analyze("part.nc", "nist", require_N_per_mm=1.0, partial=bool(option))
    assert found.below_required[0][0] == 3 and "part.nc on nist" in repr(found)


def test_extreme_parameters_give_a_result_or_a_message():
    """Every packaged effect at the ends of what its file may say; those of constant compliance all at once as well."""
    extreme = []
    for name in tps.effects().to_frame()["name"]:
        effect = find_effect(name)
        if effect.is_instrument or any(p.kind == "text" for p in effect.parameters):
            continue
        for end in (0, 1):
            values = {p.name: p.bounds[end] * (p.si if p.kind == "real" else 1) for p in effect.parameters}
            extreme.append(
                ActiveEffect(effect, {k: int(v) if k in ("strut", "vertex") else v for k, v in values.items()})
            )
    constant = [one for one in extreme if not one.effect.load_dependent]
    ends = [[one] for one in extreme] + [constant[::2], constant[1::2]]
    answered = 0
    for acting in ends:
        try:
            found = evaluate_poses(build_model(nist(), extra=acting), TIP[1:2], np.zeros((1, 3)))
        except TpsError:
            continue
        answered += 1
        within = found.reach.reachable
        figures = np.column_stack([found.along_axes, found.softest_stiffness, found.stiffest_stiffness])[within]
        assert np.isfinite(figures).all() and (figures > 0.0).all(), [one.effect.name for one in acting]
    assert answered > 0.7 * len(ends)


@pytest.mark.parametrize("pose", [(0, 0, "a"), [[1, 2, 3], [4]]])
def test_a_pose_that_is_no_numbers_is_an_error_of_ours(pose):
    with pytest.raises(InputError, match="expected X Y Z or X Y Z A B C, numbers within"):
        tps.pose(pose, "nist")
