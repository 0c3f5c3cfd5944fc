from __future__ import annotations

import csv
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.report.factory import make_analysis, short
from toolpath_stiff.errors import InputError
from toolpath_stiff.report import analysis as summary_module
from toolpath_stiff.report.analysis import samples_csv, unwritten
from toolpath_stiff.report.folder import names
from toolpath_stiff.results_folder import MANIFEST, write_folder

PLOTS = {"samples.csv", "summary.json", "path.png", "profile.png", "report.html"}


def write(analysis, folder, **options):
    return write_folder(folder, analysis.files(**options), command="analyze")


@pytest.fixture(scope="module")
def analysis():
    return short()


def tree(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_all_files_are_written_and_nothing_else(analysis, tmp_path):
    written = write(analysis, tmp_path / "deep" / "out")
    assert {f.name for f in written} == PLOTS == set(names("analysis", omit=unwritten("csv", cut=False)))
    assert set(tree(tmp_path)) == {f"deep/out/{name}" for name in {*PLOTS, MANIFEST}}


def test_the_same_analysis_writes_the_same_bytes(analysis, tmp_path):
    for name in ("a", "b"):
        write(replace(short(), required=5e7, on_other=analysis), tmp_path / name)
    assert tree(tmp_path / "a") == tree(tmp_path / "b")


def test_without_plots_matplotlib_is_not_imported(tmp_path):
    code = (
        "import sys; from tests.report.factory import short; from tests.report.test_report_write import write;"
        f"print([p.name for p in write(short(), {str(tmp_path / 'o')!r}, plots=False)]);"
        "print([m for m in ('matplotlib', 'pandas', 'pyarrow') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["['samples.csv', 'summary.json']", "[]"]


def test_summary_is_json_without_nan_and_equals_the_analysis(analysis, tmp_path):
    write(replace(analysis, required=1e9, on_other=analysis), tmp_path / "o", plots=False)
    text = (tmp_path / "o" / "summary.json").read_text()
    read = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    compare, required = read.pop("compare"), read.pop("required")
    assert read == analysis.to_dict()
    assert compare["mean_N_per_mm"] == read["mean_N_per_mm"]
    assert [entry["line"] for entry in required["below"]] != []
    assert required["required_N_per_mm"] == pytest.approx(1e6, rel=1e-12)  # 1e9 N/m; a division's rounding


def test_out_of_reach_is_null_in_json_an_empty_cell_in_csv_and_a_null_in_parquet(tmp_path):
    from pyarrow import parquet as pq

    beyond = make_analysis([{"end": (0.7, 0.0, 0.0)}, {"end": (0.9, 0.0, 0.0)}], partial=True)
    write(beyond, tmp_path / "o", plots=False)
    rows = list(csv.DictReader((tmp_path / "o" / "samples.csv").open()))
    empty = [row["stiffness_N_per_mm"] == "" for row in rows]
    assert np.array_equal(empty, ~beyond.at.reachable)
    write(beyond, tmp_path / "o", plots=False, table="parquet")
    table = pq.read_table(tmp_path / "o" / "samples.parquet")
    assert table.column_names == list(rows[0])
    assert table["stiffness_N_per_mm"].null_count == sum(empty)
    assert not (tmp_path / "o" / "samples.csv").exists()  # of the earlier run: it would stand for this one


def test_old_files_of_ours_go_and_foreign_ones_stay(analysis, tmp_path):
    write(analysis, tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    write(analysis, tmp_path, plots=False)
    assert set(tree(tmp_path)) == {"samples.csv", "summary.json", "notes.txt", MANIFEST}
    assert json.loads((tmp_path / "summary.json").read_text())["samples"] == len(analysis.samples)


@pytest.mark.parametrize("error", [RuntimeError("midway"), KeyboardInterrupt()])
@pytest.mark.parametrize("exists", [False, True])
def test_an_error_midway_leaves_everything_as_it_was(analysis, tmp_path, monkeypatch, error, exists):
    out = tmp_path / "reports" / "part"
    if exists:
        write(analysis, out, plots=False)
    before = tree(tmp_path)

    def fail(*_args, **_kwargs):
        raise error

    monkeypatch.setattr(summary_module, "page", fail)
    with pytest.raises(type(error)):
        write(analysis, out)
    assert tree(tmp_path) == before


def test_a_file_in_the_place_of_the_folder_is_one_clear_error(analysis, tmp_path):
    (tmp_path / "o").write_text("a file")
    for folder in (tmp_path / "o", tmp_path / "o" / "below"):
        with pytest.raises(InputError, match="cannot write"):
            write(analysis, folder, plots=False)
    assert tree(tmp_path) == {"o": b"a file"}


def test_short_moves_have_one_row_and_figures_count_both_ends():
    """At a step of 1 mm moves of 0.3 mm have their end alone, of 0.5 and 0.6 mm both ends."""
    lines = ["G21 G90 F600", "G0 Z5", "G1 Z0", *(f"X{0.3 * i:.1f}" for i in range(1, 5)), "X1.8", "X2.3", "M2"]
    analysis = tps.analyze(tps.Program.from_text("\n".join(lines)), origin_mm_deg=(0, 0, 800))
    rows = b"".join(samples_csv(analysis)).decode().splitlines()
    names = rows[0].split(",")
    table = [dict(zip(names, row.split(","), strict=True)) for row in rows[1:]]
    x = [(int(row["line"]), row["x_mm"]) for row in table if int(row["line"]) > 3]
    short = [(4, "0.3000"), (5, "0.6000"), (6, "0.9000"), (7, "1.2000")]
    assert x == [*short, (8, "1.2000"), (8, "1.8000"), (9, "1.8000"), (9, "2.3000")]
    assert len(analysis.to_frame()) == len(analysis.samples) == len(table) + len(short)
    assert table[-1]["strut1_mm"] == f"{analysis.to_frame()['strut1_mm'].iloc[-1]:.4f}"
