"""Machine files: every mistake is one message with section, key, value, bound and line; files are written as read."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import toolpath_stiff as tps
from tests.machine.test_machine_readers import filled
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine, packaged_machines, parse_machine
from toolpath_stiff.machine.kinematics import singularity_index, solve_struts
from toolpath_stiff.machine.limits import reach
from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.machine.writer import machine_toml

NIST = packaged_machines()["nist"].read_text()


def changed(old: str, new: str) -> str:
    assert old in NIST
    return NIST.replace(old, new, 1)


BAD_FILES = [
    (changed("min_index = 0.1", "min_indx = 0.1"), "[limits.singularity] min_indx: unknown key"),
    (changed("[limits.singularity]", "[limits.singular]"), "unknown section [limits.singular]"),
    (changed("[setup]", "[set]"), "unknown section [set]"),
    (
        changed("min_mm = 2200.0", "min_mm = -5.0"),
        "[limits.strut_length] min_mm = -5; expected a number in mm, at least 0",
    ),
    (changed("min_mm = 2200.0", "min_mm = 4000.0"), "more than min_mm = 4000"),
    (changed("max_mm = 3650.0", "max_mm = 4800.0"), "the strut law leaves no stiffness there"),
    (changed("max_mm = 3650.0", "max_mm = nan"), "max_mm = nan"),
    (changed("max_mm = 3650.0", "max_mm = inf"), "max_mm = inf"),
    (changed("max_mm = 3650.0", "max_mm = true"), "max_mm = True"),
    (changed("max_mm = 3650.0", 'max_mm = "long"'), "max_mm = 'long'"),
    (changed("length_mm = 150.0", ""), "[reference_tool] length_mm is missing"),
    (changed("stiffness_N_per_um = [46.5, 32.5]", "stiffness_N_per_um = [46.5]"), "2 or more numbers in N/um"),
    (changed("stiffness_N_per_um = [46.5, 32.5]", "stiffness_N_per_um = [46.5, -1]"), "stiffness_N_per_um = -1"),
    (changed("length_mm = [2561.6, 3213.2]", "length_mm = [2561.6, 2561.6]"), "0.001 mm apart or more"),
    (changed("    [304.77, 330.0, 296.97],\n", ""), "6 rows of 3 numbers"),
    (changed("    [304.77, 330.0, 296.97],\n", "    [304.77, 330.0],\n"), "6 rows of 3 numbers"),
    (
        changed("[platform_joints]", "[platform_joints]\nmm = [[0,0,0],[1,0,0],[2,0,0],[3,0,0],[4,0,0],[5,0,0]]"),
        "both given",
    ),
    (changed('origin = "published"', 'origin = "guessed"'), "one of published, recovered, assumed"),
    (changed('origin = "published"', ""), "origin is missing"),
    (changed('name = "nist"', 'name = ""'), "a text that is not empty"),
    (changed("bar_stiffness_N_per_m = inf", "bar_stiffness_N_per_m = 10"), "bar_stiffness_N_per_m = 10"),
    (changed("frame_max_deg = 30.0", "frame_max_deg = 300.0"), "at most 180"),
    (changed("max_mm = [750.0, 750.0, 1700.0]", "max_mm = [750.0, -800.0, 1700.0]"), "max_mm > min_mm"),
    (changed("default_origin_mm = [0.0, 0.0, 800.0]", "default_origin_mm = [0.0, 0.0]"), "3 or 6 numbers"),
    (changed("neutral_pose_mm_deg = [0.0, 0.0, 800.0, 0.0, 0.0, 0.0]", "neutral_pose_mm_deg = [0, 0]"), "6 numbers"),
    ("effect = 3\n" + NIST, "write [[effect]]"),
    (NIST + '\n[[effect]]\nname = "x"\nprovenance = "campaign 3"\n', "[[effect]] provenance = 'campaign 3'"),
    (NIST + "\n[[effect]]\nbar_stiffness_N_per_m = 1e9\n", "name is missing"),
]


@pytest.mark.parametrize(("text", "words"), BAD_FILES, ids=[words[:30] for _, words in BAD_FILES])
def test_bad_files_name_section_key_value_bound(text, words):
    with pytest.raises(InputError) as caught:
        parse_machine(text, "mine.toml")
    assert words in str(caught.value) and str(caught.value).startswith("mine.toml")


def test_the_line_is_named():
    text = changed("min_mm = 2200.0", "min_mm = -5.0")
    with pytest.raises(InputError) as caught:
        parse_machine(text, "mine.toml")
    assert caught.value.line == text.splitlines().index("min_mm = -5.0") + 1


def test_broken_toml_names_line_and_column():
    with pytest.raises(InputError) as caught:
        parse_machine("name = 'a'\ntitle = \n", "mine.toml")
    assert (caught.value.line, caught.value.column) == (2, 9)


def test_missing_section_and_missing_machine(tmp_path):
    with pytest.raises(InputError, match=r"section \[strut_law\] is missing"):
        parse_machine(NIST.replace("[strut_law]", "[[effect]]\nname='x'\n[effect.y]"), "mine.toml")
    with pytest.raises(InputError, match="neither a packaged machine nor a file"):
        load_machine("nistt")
    binary = tmp_path / "m.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        load_machine(binary)
    binary.write_text(NIST, "utf-8-sig")  # as Windows' editor saves it
    assert load_machine(binary).name == "nist"


def test_a_machine_that_is_singular_everywhere_is_refused():
    # Similar hexagons without a twist: no strut forces can balance a moment about the axis.
    rows = "".join(f"    [{{r}}, {a}.0, {{h}}],\n" for a in range(0, 360, 60))
    text = NIST
    for section, radius, height in (("frame_joints", 2000, 3000), ("platform_joints", 300, 300)):
        start = text.index(f"[{section}]")
        end = text.index("origin =", start)
        body = f"[{section}]\ncylindrical_mm_deg = [\n{rows.format(r=radius, h=height)}]\n"
        text = text[:start] + body + text[end:]
    with pytest.raises(InputError, match="singular there"):
        parse_machine(text, "mine.toml")


@pytest.mark.parametrize("name", list(packaged_machines()))
def test_packaged_machines_work_where_their_programs_start(name):
    machine = load_machine(name)
    origin = np.array(machine.default_origin)
    steps = np.array([[x, y, z] for x in (-0.05, 0, 0.05) for y in (-0.05, 0, 0.05) for z in (-0.03, 0, 0.03)])
    struts = solve_struts(machine, origin[:3] + steps)
    stand = reach(machine, origin[:3] + steps, struts)
    assert stand.reachable.all() and (singularity_index(machine, struts) > 0.3).all()
    assert set(machine.origins.values()) <= {"published", "recovered", "assumed"} and machine.source


def test_limits_of_the_default_machine_admit_the_poses_that_the_paper_and_the_reference_show():
    from toolpath_stiff.machine.kinematics import solve_struts_at
    from toolpath_stiff.rotations import rotation_matrices

    machine = load_machine("nist")
    assert machine.limits.strut_length[0] <= 2.25 and machine.limits.strut_length[1] >= 3.60
    poses = np.array([[-0.3, 0.3, 0.3, -30, 0, 0], [0.1, -0.2, 0.8, 10, -15, 20], [0, 0, 1.268225, 0, 0, 0]])
    poses[:, 3:] = np.deg2rad(poses[:, 3:])
    stand = reach(machine, poses[:, :3], solve_struts_at(machine, poses), rotation_matrices(poses[:, 3:]))
    assert stand.reachable.all()


def same_machine(one, two) -> None:
    for field in dataclasses.fields(one):
        a, b = getattr(one, field.name), getattr(two, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(one.limits.workspace, two.limits.workspace, rtol=1e-13)
    for a, b in zip(one.limits.strut_length, two.limits.strut_length, strict=True):
        assert a == pytest.approx(b, rel=1e-13)
    assert one.strut_law.stiffness_1 == pytest.approx(two.strut_law.stiffness_1, rel=1e-13)
    assert one.default_origin == pytest.approx(two.default_origin, rel=1e-13)
    assert (one.name, one.title, dict(one.remarks)) == (two.name, two.title, dict(two.remarks))
    assert [(e.name, dict(e.parameters), dict(e.provenance)) for e in (*one.effects, *one.instruments)] == [
        (e.name, dict(e.parameters), dict(e.provenance)) for e in (*two.effects, *two.instruments)
    ]


@given(
    st.text(min_size=1).filter(lambda t: t.strip() and t.isprintable()),
    st.floats(1e8, 1e12),
    st.lists(st.floats(-5, 5, allow_nan=False), min_size=18, max_size=18),
)
def test_what_is_written_reads_back(title, bars, joints):
    machine = load_machine("nist")
    machine = machine.with_changes(
        title=title,
        platform_bar_stiffness=bars,
        frame_joints=machine.frame_joints + 0.01 * np.array(joints).reshape(6, 3),
        effects=(EffectEntry("spindle", {"radial_nm_per_N": 5.5, "note": title}, {"data": title, "rows": 42}),),
        instruments=(EffectEntry("gauge", {"factor": 1.05}),),
    )
    same_machine(parse_machine(machine_toml(machine, "first\nsecond")), machine)


HAL = "".join(
    f"setp genhexkins.{part}.{n}.{axis} {value}\n"
    for part, size in (("base", 500.0), ("platform", 200.0))
    for n, angle in enumerate((100, 20, -20, -100, -140, 140) if part == "base" else (80, 40, -40, -80, -160, 160))
    for axis, value in zip(
        "xyz", (size * np.cos(np.deg2rad(angle)), size * np.sin(np.deg2rad(angle)), 0.0), strict=True
    )
)


def machine_from_hal(folder, text: str, units: str = "mm"):
    (folder / "my.hal").write_text(text)
    return tps.machine_from_linuxcnc(folder / "my.hal", units).text


def test_from_linuxcnc_reads_pins_and_leaves_the_rest_to_fill_in(tmp_path):
    text = machine_from_hal(tmp_path, HAL + "setp genhexkins.tool-offset 50\n# setp genhexkins.bogus 1\n")
    machine = filled(text)
    assert np.hypot(*machine.frame_joints[:, :2].T) == pytest.approx(0.5)
    # genhexkins.c adds the offset to Z of base and platform joints alike.
    assert machine.platform_joints[:, 2] == pytest.approx(0.05)
    assert machine.frame_joints[:, 2] == pytest.approx(0.05)
    with pytest.raises(InputError, match="length_mm is missing"):
        parse_machine(text)
    limited = "".join(f"[JOINT_{i}]\nMIN_LIMIT = 400\nMAX_LIMIT = {900 - i}\n" for i in range(6))
    (tmp_path / "my.ini").write_text(f"[HAL]\nHALFILE = my.hal\n{limited}")
    inch = filled(machine_from_hal(tmp_path, HAL, "inch"))
    assert np.hypot(*inch.frame_joints[:, :2].T) == pytest.approx(0.5 * 25.4)
    assert inch.limits.strut_length == pytest.approx((0.4 * 25.4, 0.895 * 25.4))
    same_machine(parse_machine(machine_toml(machine)), machine)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("loadrt genhexkins\n", "genhexkins.base.0.x is not set"),
        (HAL.replace("setp genhexkins.base.3.y", "# "), "genhexkins.base.3.y"),
        (HAL + "setp genhexkins.base.0.x 1\n", "set twice"),
        (HAL.replace("base.0.x ", "base.0.x [KIN]X #"), "a number, or the ini file"),
        (HAL.replace("base.0.z 0.0", "base.0.z nan"), "finite"),
    ],
)
def test_bad_hal_files(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        machine_from_hal(tmp_path, text)
    assert words in str(caught.value) and str(caught.value).startswith("my.hal")


def test_commands(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["machine", "list", "--json"]) == 0
    names = [row["name"] for row in json.loads(capsys.readouterr().out)]
    assert {"nist", "genhexkins"} <= set(names) and len(names) >= 3
    assert main(["machine", "show", "nist"]) == 0
    printed = capsys.readouterr().out
    assert "46.5 N/um at 2561.6 mm" in printed and "[recovered]" in printed
    assert (tmp_path / "reports/nist.png").read_bytes().startswith(b"\x89PNG")
    assert main(["machine", "new", "mine.toml"]) == 0
    assert main(["machine", "new", "mine.toml"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["machine", "check", "mine.toml"]) == 0
    (tmp_path / "bad.toml").write_text(changed("min_mm = 2200.0", "min_mm = -5.0"))
    assert main(["machine", "check", "bad.toml"]) == 2
    assert "at least 0" in capsys.readouterr().err
    assert main(["machine", "check", "none.toml"]) == 2
    assert main(["machine"]) == 2
    (tmp_path / "kins.hal").write_text(HAL)
    assert main(["machine", "from-linuxcnc", "kins.hal", "-o", "kins.toml"]) == 2  # no unit to be found
    assert "--units" in capsys.readouterr().err and not (tmp_path / "kins.toml").exists()
    (tmp_path / "kins.ini").write_text("[TRAJ]\nLINEAR_UNITS = mm\n")
    assert main(["machine", "from-linuxcnc", "kins.hal", "-o", "kins.toml"]) == 0
    assert main(["machine", "check", "kins.toml"]) == 2  # what nobody knows is to be filled in
    assert main(["machine", "show", "nist", "--pose", "0,0,5000"]) == 1
