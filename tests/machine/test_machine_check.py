"""`tps machine new` and `check`: a neutral template; slips are found."""

from contextlib import suppress
from itertools import product

import pytest

from toolpath_stiff.analysis.machine_check import check_machine
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import load_machine, packaged_machines, parse_machine
from toolpath_stiff.stiffness.model import build_model

NIST = packaged_machines()["nist"].read_text()
BODIES = ("frame_joints", "platform_joints")


def changed(old: str, new: str) -> str:
    assert old in NIST
    return NIST.replace(old, new, 1)


@pytest.fixture
def check(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def run(text: str, code: int) -> str:
        (tmp_path / "m.toml").write_text(text)
        assert main(["machine", "check", "m.toml"]) == code
        told = capsys.readouterr()
        return told.out + told.err

    return run


def test_the_template_is_neutral(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["machine", "new", "mine.toml"]) == 0
    text = (tmp_path / "mine.toml").read_text()
    for word in ("NIST", "nist", "Table 1", "paper", "3013", "REMARK", "MACHINE_"):
        assert word not in text
    machine = load_machine("mine.toml")
    assert machine.name == "mine" and set(machine.origins.values()) == {"assumed"}
    capsys.readouterr()
    assert main(["machine", "check", "mine.toml"]) == 0
    told = capsys.readouterr().out
    assert (
        "the remark of [frame_joints]" in told
        and "still says 'value of the template" in told
        and "[setup]" in told
        and "WRONG" not in told
    )
    assert (tmp_path / "reports/mine_machine.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", packaged_machines())
def test_the_packaged_machines_are_clean(name):
    found = check_machine(build_model(load_machine(name)))
    assert found.good and not found.doubtful


@pytest.mark.parametrize(
    ("text", "code", "told"),
    [
        (changed("[46.5, 32.5]", "[46500, 32500]"), 1, "a strut of 2561.6 mm with 46500 N/um; expected 1 to 1000 N/um; "
         "is it in N/mm?"),
        (changed("[46.5, 32.5]", "[0.0465, 0.0325]"), 1, "is it in kN/um?"),
        (changed("[46.5, 32.5]", "[46.5, 19.0]"), 1, "an end of the travel: a strut of 3650 mm with"),
        (changed("min_mm = 2200.0", "min_mm = 2900.0"), 1, "the neutral pose is out of reach: strut2 min length needs"),
        (changed("default_origin_mm = [0.0, 0.0, 800.0]", "default_origin_mm = [0.0, 0.0, 3000.0]"), 1,
         "the default origin is out of reach"),
        (changed("[304.77, 30.0, 296.97]", "[304.77, 30.0, -296.97]"), 0, "strut 1 is 3"),
        (changed("[2080.72, 60.0, 3313.35]", "[2080.72, 90.0, 3313.35]"), 0, "strut 2 is"),
        (changed("length_mm = [2561.6, 3213.2]", "length_mm = [2000, 2500]"), 1, "outside the lengths of [strut_law]"),
        (NIST, 0, "1000 N move the tool by 18.2 um along X, 18.2 um along Y, 8.08 um along Z"),
        (NIST, 0, "the file is good"),
    ],
)  # fmt: skip
def test_what_check_says(check, text, code, told):
    assert told in check(text, code)


def test_most_flipped_signs_are_found_at_their_strut():
    named = slips = 0
    for machine in map(load_machine, packaged_machines()):
        for body, joint, axis in product(BODIES, range(6), range(3)):
            joints = getattr(machine, body).copy()
            joints[joint, axis] *= -1.0
            if abs(joints[joint, axis]) > 1e-3:
                slips += 1
                with suppress(InputError):  # singular, which is said
                    doubtful = check_machine(build_model(machine.with_changes(**{body: joints}))).doubtful
                    named += any(text.startswith(f"strut {joint + 1} is") for text in doubtful)
    assert named > 0.8 * slips


ENTRIES = '\n[[effect]]\nname = "joint_compliance"\ncompliance_nm_per_N = 1.0\n\n'


@pytest.mark.parametrize(
    ("entries", "line", "told"),
    [
        (ENTRIES + "[[effect]]\ncompliance_nm_per_N = 1.0\n", 5, "[[effect]] name is missing"),
        (ENTRIES.replace("compliance_nm", "complience_nm"), 3, "unknown key complience_nm_per_N; expected one of"),
        (ENTRIES.replace("1.0", "-1.0"), 3, "compliance_nm_per_N = -1.0; expected a number from 0 to 200 nm/N"),
        (ENTRIES.replace("compliance_nm_per_N = 1.0", ""), 1, "compliance_nm_per_N is missing"),
        (ENTRIES.replace("joint_c", "jiont_c"), 2, "unknown effect 'jiont_compliance'"),
        (ENTRIES.replace("[[effect]]", "[[instrument]]"), 1, "Write it as [[effect]]"),
        (
            ENTRIES + '[[effect]]\nname = "weak_strut"\nstrut = 7\nfactor = 0.5\n',
            7,
            "strut = 7; expected a whole number",
        ),
    ],
)
def test_a_bad_entry_names_file_and_line(check, entries, line, told):
    number = len(NIST.splitlines()) + 1 + line
    error = check(NIST + entries, 2)
    assert error.startswith(f"tps: error: m.toml:{number}: ") and told in error


def test_entries_from_no_file_still_say_whose_they_are():
    from toolpath_stiff.errors import InputError
    from toolpath_stiff.machine.model import EffectEntry

    machine = parse_machine(NIST).with_changes(effects=(EffectEntry("joint_compliance", {"x": 1.0}),))
    with pytest.raises(InputError, match=r"machine nist, \[\[effect\]\]: effect joint_compliance: unknown key x"):
        build_model(machine)


@pytest.mark.parametrize("out", ["mc/fine.png", "mc.svg"])
def test_the_picture_is_a_png(tmp_path, monkeypatch, capsys, out):
    monkeypatch.chdir(tmp_path)
    assert main(["machine", "new", "mine.toml"]) == 0
    code = main(["machine", "check", "mine.toml", "--out", out])
    written = sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    if out == "mc.svg":
        assert code == 2 and written == ["mine.toml"] and "ends in .png" in capsys.readouterr().err
    else:
        assert written == [out, "mine.toml"]
