"""A folder holds the files of one run, and what the tool did not write stays as it is."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import pytest

from tests.faults import all_writes_by_files
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError
from toolpath_stiff.results_folder import MANIFEST, Rules, check_folder, write_folder


def tree(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def run(folder, *names, **more):
    """A run that writes `names`, each with its own name in it."""
    return write_folder(
        folder, {name: f"{name} {sorted(names)}" for name in names}, command="test", rules=Rules(**more)
    )


def test_a_run_leaves_its_own_files_alone_and_the_hashes_of_each(tmp_path):
    out = tmp_path / "deep" / "out"
    run(out, "a.csv", "old.png")
    assert run(out, "a.csv", "b.json") == [out / "a.csv", out / "b.json"]
    assert set(tree(out)) == {"a.csv", "b.json", MANIFEST}
    recorded = json.loads((out / MANIFEST).read_text())
    contents = {name: (out / name).read_bytes() for name in ("a.csv", "b.json")}
    assert recorded["checksums"] == {name: f"{zlib.crc32(it):08x}-{len(it)}" for name, it in contents.items()}
    assert set(tree(tmp_path)) == {f"deep/out/{name}" for name in tree(out)}  # nothing temporary is left


def test_the_same_run_writes_the_same_bytes_wherever_it_goes(tmp_path):
    run(tmp_path / "one", "a", "old")
    run(tmp_path / "one", "a", "b")
    run(tmp_path / "two", "a", "b")
    assert tree(tmp_path / "one") == tree(tmp_path / "two")


@pytest.mark.parametrize("known", [False, True])
def test_a_file_of_that_name_that_the_tool_did_not_write_is_refused_before_anything_is_written(tmp_path, known):
    if known:
        run(tmp_path, "a", "old")
    (tmp_path / "report.html").write_text("mine")
    before = tree(tmp_path)
    with pytest.raises(InputError, match=r"report.html.*is there already.*--out.*--replace"):
        run(tmp_path, "a", "report.html")
    assert tree(tmp_path) == before


def test_a_file_that_was_changed_since_is_the_user_s(tmp_path):
    """Readings filled into plan.csv are not lost to the next plan."""
    run(tmp_path, "plan.csv", "plan.json")
    (tmp_path / "plan.csv").write_text("filled in")
    before = tree(tmp_path)
    with pytest.raises(InputError, match=r"plan.csv.*was changed since tps wrote it"):
        run(tmp_path, "plan.csv")
    assert tree(tmp_path) == before
    run(tmp_path, "other.json")
    assert set(tree(tmp_path)) == {"plan.csv", "other.json", MANIFEST}
    assert list(json.loads((tmp_path / MANIFEST).read_text())["checksums"]) == ["other.json"]


def test_a_symbolic_link_is_not_the_tool_s_even_if_it_leads_to_the_same_bytes(tmp_path):
    out, kept = tmp_path / "out", tmp_path / "kept"
    run(out, "a")
    (out / "a").rename(kept)
    (out / "a").symlink_to(kept)
    with pytest.raises(InputError):
        run(out, "a")
    run(out, "b")
    assert (out / "a").is_symlink()


@pytest.mark.parametrize("names", [("in.csv",), ("b",)], ids=["replaced", "cleared"])
def test_an_input_is_neither_replaced_nor_cleared(tmp_path, names):
    run(tmp_path, "in.csv", "b")
    before = tree(tmp_path)
    with pytest.raises(InputError, match=r"in.csv.*is read here and would be written over"):
        run(tmp_path, *names, inputs=(tmp_path / "." / "in.csv",))
    assert tree(tmp_path) == before


def test_results_of_another_file_of_the_same_name_stay(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in "ab":
        Path(folder).mkdir()
        Path(folder, "part.nc").touch()
    run("reports/part", "a", of=("a/part.nc",))
    run("reports/part", "b", of=("./a/../a/part.nc",))
    before = tree(tmp_path)
    with pytest.raises(InputError, match=r"holds the results of.*a/part.nc.*--out"):
        run("reports/part", "a", of=("b/part.nc",))
    assert tree(tmp_path) == before
    run("reports/part", "c")  # the user names the folder
    assert set(tree(tmp_path / "reports/part")) == {"c", MANIFEST}


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{}", '{"written_by": 1}', '{"written_by": "x", "results_of": [], "checksums": 3}', "[" * 100_000],
)
def test_a_manifest_that_is_none_is_one_clear_error(tmp_path, text):
    (tmp_path / MANIFEST).write_text(text)
    with pytest.raises(InputError, match="does not record what tps wrote"):
        run(tmp_path, "a")
    assert tree(tmp_path) == {MANIFEST: text.encode()}


@pytest.mark.parametrize("name", ["../mine", "/etc/passwd", "sub/mine", "..", "."])
def test_a_manifest_reaches_no_file_outside_its_folder(tmp_path, name):
    mine, out = tmp_path / "mine", tmp_path / "out"
    (out / "sub").mkdir(parents=True)
    for path in (mine, out / "sub" / "mine"):
        path.write_text("mine")
    sums = {name: f"{zlib.crc32(b'mine'):08x}-4"}
    (out / MANIFEST).write_text(json.dumps({"written_by": "tps x", "results_of": [], "checksums": sums}))
    run(out, "a")
    assert mine.exists()
    assert (out / "sub" / "mine").exists()


def test_an_error_while_a_content_is_made_leaves_everything_as_it_was(tmp_path):
    def fails():
        raise RuntimeError("no picture")

    for out in (tmp_path / "new" / "deep", tmp_path):
        run(tmp_path, "a", "b")
        before = tree(tmp_path)
        with pytest.raises(RuntimeError):
            write_folder(out, {"a": "changed", "c.png": fails}, command="test")
        assert tree(tmp_path) == before
    assert not list((tmp_path / "new" / "deep").iterdir())


def test_what_would_be_refused_is_known_before_anything_is_computed(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(InputError):
        check_folder(tmp_path, ["a"])
    assert check_folder(tmp_path, ["b"]) == []
    run(tmp_path / "own", "a")
    with pytest.raises(InputError, match="is there already"):
        check_folder(tmp_path / "own", ["a"], Rules(fresh=True))


def test_told_to_replace_it_keeps_what_was_in_the_way(tmp_path):
    run(tmp_path, "a", "b", "c")
    (tmp_path / "b").write_text("changed")
    (tmp_path / "d").write_text("mine")
    told = []
    run(tmp_path, "a", "b", "d", replace=True, kept=lambda file, kept: told.append((file.name, kept.name)))
    assert told == [("b", "b.old"), ("d", "d.old")]
    assert (tmp_path / "b.old").read_text() == "changed" and (tmp_path / "d.old").read_text() == "mine"
    assert set(tree(tmp_path)) == {"a", "b", "d", "b.old", "d.old", MANIFEST}


# -- the commands ------------------------------------------------------------------------------------------------------

PART = "G90 G21\nG54 G0 X0 Y0 Z0\nG1 X5 F500\nM2\n"
ROWS = "point,x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n" + "".join(
    f"{x}{y}{z},{x},{y},{z},{axis},{stiffness}\n"
    for x, y, z in ((0, 0, 500), (100, 0, 500), (0, 100, 500), (0, 0, 700), (-100, 50, 700), (50, -100, 600))
    for axis, stiffness in (("X", 32000), ("Y", 33000), ("Z", 95000))
)
PLACED = ["--x", "0", "--y", "0", "--z", "600:620", "--rotate", "0", "--points", "2", "--step", "5"]


@pytest.fixture
def shop(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("one", "two"):
        Path(f"{name}.nc").write_text(PART)
        Path(f"{name}.csv").write_text(ROWS)
    Path("deep").mkdir()
    Path("deep/one.nc").write_text(PART)
    Path("deep/one.csv").write_text(ROWS)
    return tmp_path


COMMANDS = {  # command -> its arguments without and with pictures left out, the folder by default, a file of it
    "analyze": (["analyze", "one.nc"], "reports/one", "summary.json"),
    "place": (["place", "one.nc", *PLACED], "reports/one-place", "placement.json"),
    "compare": (["compare", "one.csv"], "reports/one-compare", "compare.json"),
    "diagnose": (["diagnose", "one.csv"], "reports/one-diagnose", "diagnose.json"),
    "update": (["update", "one.csv", "--strut-law"], "reports/one-update", "update.json"),
    "plan": (["plan", "one.csv", "--between", "none,table_compliance", "--n", "1"], "reports/one-plan", "plan.json"),
    "map": (["map", "--points", "3"], "reports/nist-map", "map.json"),
    "case-study": (["case-study"], "reports/nist-case-study", "case_study.json"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_names_its_folder_after_its_data_and_keeps_to_the_rules(command, shop, capsys):
    arguments, folder, file = COMMANDS[command]
    with all_writes_by_files(shop):
        assert main([*arguments, "--no-plots"]) == 0
    out = shop / folder
    assert set(json.loads((out / MANIFEST).read_text())["checksums"]) == {p.name for p in out.iterdir()} - {MANIFEST}
    first = tree(out)
    # Another command's files go, a user's own stay, and one in the way is refused.
    other = shop / "other"
    run(other, "stale.json", "report.html")
    (other / "notes.txt").write_text("mine")
    assert main([*arguments, "--no-plots", "--out", "other"]) == 0
    assert set(tree(other)) == {*first, "notes.txt"}
    (other / file).write_text("mine")
    before = tree(shop)
    capsys.readouterr()
    assert main([*arguments, "--no-plots", "--out", "other"]) == 2
    assert "was changed since tps wrote it" in capsys.readouterr().err
    assert tree(shop) == before
    # Data of the same name elsewhere do not take the folder.
    if "one." in "".join(arguments):
        assert main([arguments[0], f"deep/{arguments[1]}", *arguments[2:], "--no-plots"]) == 2
        assert "holds the results of ../../one." in capsys.readouterr().err
        assert tree(shop) == before


def test_an_output_that_is_an_input_is_refused(shop, capsys):
    assert main(["update", "one.csv", "--strut-law", "--force", "--no-plots", "--out", "fit"]) == 0
    before = tree(shop)
    assert "fit/machine.toml" in before
    assert main(["compare", "two.csv", "--machine", "fit/machine.toml", "--no-plots", "--out", "fit"]) == 2
    assert "is read here and would be written over" in capsys.readouterr().err
    assert tree(shop) == before
    machine = before["fit/machine.toml"]
    assert main(["compare", "two.csv", "--machine", "fit/machine.toml", "--no-plots", "--out", "fit", "--replace"]) == 0
    assert "kept the old fit/machine.toml as fit/machine.toml.old" in capsys.readouterr().out
    after = tree(shop)
    assert after["fit/machine.toml.old"] == machine and "fit/machine.toml" not in after


def test_a_blind_exercise_is_never_made_over_another(shop, capsys):
    new = ["rig", "new", "--layout", "paper", "--out", "blind", "--seed"]
    assert main([*new, "1"]) == 0
    before = tree(shop)
    assert main([*new, "2"]) == 2
    assert "is there already" in capsys.readouterr().err
    assert tree(shop) == before


def test_many_programs_leave_one_overview_and_no_foreign_index(shop, capsys):
    assert main(["analyze", "one.nc", "two.nc", "--no-plots", "--jobs", "1"]) == 0
    assert main(["analyze", "one.nc", "deep", "--no-plots", "--jobs", "1"]) == 0
    assert (shop / "reports/index.html").exists()
    (shop / "reports/index.html").write_text("mine")
    capsys.readouterr()
    assert main(["analyze", "one.nc", "two.nc", "--no-plots", "--jobs", "1"]) == 2
    assert "was changed since" in capsys.readouterr().err
