"""Struts measured alone over years: dates, bench records, steps, drift and quiet series that are known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from openpyxl import Workbook

import toolpath_stiff as tps
from tests.conftest import as_written
from tests.stiffness.cases import nist
from toolpath_stiff.cli.main import main
from toolpath_stiff.comparison.compare import compare
from toolpath_stiff.documents import to_dict
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.readings.dates import date_text, day_of
from toolpath_stiff.readings.history import history
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.readings.strut_series import DRAWS, StrutReadings

DATES = ("2018-03-01", "2018-09-10", "2019-04-02", "2019-06-11", "2020-01-15", "2020-08-03", "2021-02-11")
DAYS = np.array([day_of(text) for text in DATES])
FORCES = [*range(0, 1001, 250), *range(750, -1001, -250), *range(-750, 1, 250)]


def of_struts(*columns, seed: int = 0):
    return to_dict(history(StrutReadings(*columns), seed=seed))


def series(seed: int, *, step: float = 0.0, drift: float = 0.0, sd: float = 0.01, dates: int = 10, struts: int = 6):
    """Struts on the same dates; the third takes a step of ln stiffness halfway, or drifts by so much in all."""
    rng = np.random.default_rng([5, seed])  # not the stream of the simulated series
    day = 17_000.0 + np.sort(rng.uniform(0.0, 2000.0, dates))
    ln = np.log(40e6) + sd * rng.standard_normal((struts, dates))
    ln[min(2, struts - 1)] += step * (np.arange(dates) >= dates // 2) + drift * (day - day[0]) / np.ptp(day)
    names = np.repeat([f"strut {i + 1} alone" for i in range(struts)], dates)
    n = struts * dates
    return of_struts(names, np.tile(day, struts), ln.ravel(), np.zeros(n), seed=seed), day


def changes(found):
    return [(one["strut"], change["kind"]) for one in found["struts"] for change in one["changes"]]


def test_quiet_series_raise_few_alarms():
    """5 %, all struts and places counted: of 60 sets 12 or more would come once in 18,000 times."""
    assert sum(bool(changes(series(seed, dates=8, struts=3)[0])) for seed in range(60)) <= 11


def test_a_step_is_found_where_it_is():
    told, inside = 0, 0
    for seed in range(20):
        found, day = series(seed, step=-0.12)
        kinds = changes(found)
        told += ("strut 3 alone", "step") in kinds
        for change in found["struts"][2]["changes"]:
            if change["kind"] == "step":
                inside += change["after"] <= date_text(day[4]) and date_text(day[5]) <= change["before"]
                assert change["low_percent"] < change["change_percent"] < change["high_percent"]
                assert change["change_percent"] == pytest.approx(100.0 * np.expm1(-0.12), abs=3.0)
                break
    assert told >= 18 and inside >= 18


def test_a_drift_is_not_called_a_step():
    kinds = [kind for seed in range(20) for _, kind in changes(series(seed, drift=-0.12)[0])]
    assert kinds.count("drift") >= 18 and "step" not in kinds


def test_figures_without_scatter():
    """One strut, two levels: e^-0.12 is 11.308 % softer, and the limit of the simulation is 1 in 2001."""
    found, _ = series(0, step=-0.12, sd=0.0)
    (one,) = found["struts"][2]["changes"]
    assert one["change_percent"] == pytest.approx(-11.308, abs=1e-3)
    assert one["from_N_per_mm"] == pytest.approx(40_000.0) and one["p"] == pytest.approx(1.0 / (1 + DRAWS), abs=1e-5)
    assert "became 11 % softer between" in one["text"]


def test_two_dates_cannot_tell_a_step_from_a_drift():
    found, _ = series(0, step=-0.3, dates=2, struts=1)
    assert changes(found) == [("strut 1 alone", "step or drift")] and "assumed" in found["scatter_from"]
    assert not changes(series(0, step=-0.03, dates=2, struts=1)[0])


def test_one_wild_date_is_no_change():
    ln = np.tile(np.log(40e6) + 0.002 * np.sin(np.arange(10.0)), 2)
    ln[1] -= 0.3
    names = np.repeat(["strut 1 alone", "strut 2 alone"], 10)
    found = of_struts(names, np.tile(np.arange(10.0) * 30.0, 2), ln, np.zeros(20))
    assert not changes(found) and found["struts"][0]["wild_dates"] == ["1970-01-31"]


def test_tension_against_compression_by_hand():
    """30 and 40 N/um in the geometric mean of 8 dates; a change of both in time does not hide in it."""
    day = np.repeat(np.arange(8.0) * 100.0, 2)
    side = np.tile([1.0, -1.0], 8)
    ln = np.where(side > 0.0, np.log(30e6), np.log(40e6)) + 0.003 * np.sin(np.arange(16.0))
    found = of_struts(np.full(16, "strut 2 alone"), day, ln, side)["struts"][0]
    assert found["sides"]["difference_percent"] == pytest.approx(-25.0, abs=0.5)
    assert found["sides"]["text"].startswith("strut 2 is 25 % softer in tension") and not found["changes"]


# -- dates -------------------------------------------------------------------------------------------------------------


def test_days_are_counted_from_1970():
    assert [day_of("1970-01-01"), day_of("2000-03-01"), day_of("2000-03-01T12:00")] == [0.0, 11017.0, 11017.5]
    assert day_of("2024-01-01T01:00+02:00") == day_of("2023-12-31 23:00:00Z") and np.isnan(day_of(""))
    assert date_text(11017.9) == "2000-03-01"


@pytest.mark.parametrize(
    ("text", "hint"),
    [("31.02.2024", ""), ("13/13/24", ""), ("4538", ""), ("2024-02-30", ""), ("soon", ""), ("0024-03-01", "")],
)  # fmt: skip
def test_what_is_no_date_is_named_with_its_row(text, hint, tmp_path):
    with pytest.raises(InputError, match=hint or "date"):
        day_of(text)
    for name, row in (("strut,date,force_N,displacement_um", "1,{},0,0"), ("loop,date,strut_force_N,displacement_um",
                                                                          "strut 1 alone,{},1000,25")):  # fmt: skip
        file = tmp_path / "dates.csv"
        file.write_text(f"{name}\n{row.format('2024-03-01')}\n{row.format(text)}\n")
        with pytest.raises(InputErrors, match=r"dates.csv:3: date '") as caught:
            tps.reduce(file) if name.startswith("strut") else read_measurements(str(file), nist())
        assert "2024-03-31" in str(caught.value)


def test_a_workbooks_dates_are_read(tmp_path):
    from datetime import date, datetime

    book = Workbook()
    book.active.append(["loop", "date", "strut_force_N", "displacement_um", "length_mm"])
    book.active.append(["strut 1 alone", date(2024, 3, 1), 1000, 25, 2500])
    book.active.append(["strut 1 alone", datetime(2024, 3, 2, 6), -1000, -25, 2500])
    book.save(tmp_path / "struts.xlsx")
    data = read_measurements(str(tmp_path / "struts.xlsx"), nist())
    assert data.day == pytest.approx([0.0, 1.25]) and data.date[0].startswith("2024-03-01")
    assert data.compliance == pytest.approx([25e-9] * 2)


# -- bench records -----------------------------------------------------------------------------------------------------


def bench(stiffness, *, soft: float = 1.0, forces=FORCES, heading: str = "strut,date,force_N,displacement_um") -> str:
    """Records of struts 1 to 3 of `stiffness`(strut, date) N/um; strut 1 `soft` times softer in tension."""
    lines = [heading]
    for strut in (1, 2, 3):
        for i, date in enumerate(DATES):
            for f in forces:
                give = f / stiffness(strut, i) * (soft if strut == 1 and f > 0 else 1.0)
                lines.append(f"{strut},{date},{f},{give:.4f}")
    return "\n".join(lines) + "\n"


SCATTER = 0.003 * as_written(4).standard_normal((4, len(DATES)))


def weakened(strut: int, i: int) -> float:
    return 40.0 * (1.0 + SCATTER[strut, i]) * (0.88 if strut == 3 and i >= 3 else 1.0)


def test_bench_records_to_a_history_and_back(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("bench.csv").write_text(bench(weakened, soft=1.25))
    assert main(["reduce", "bench.csv", "--json", "--no-plots"]) == 0
    told = json.loads(capsys.readouterr().out)
    found = tps.reduce("bench.csv")
    assert told["history"] == found.to_dict()["history"]
    assert len(told["loops"]) == 21 and told["loops"][0]["loop"] == "strut 1 alone, 2018-03-01"
    assert told["loops"][7]["stiffness_N_per_mm"] == pytest.approx(1e3 * weakened(2, 0), rel=1e-4)
    one, two, three = told["history"]["struts"]
    assert one["sides"]["difference_percent"] == pytest.approx(-20.0, abs=0.1) and "softer in tension" in str(one)
    assert not two["changes"] and two["sides"]["p"] > 0.05
    (change,) = three["changes"]
    assert (change["kind"], change["after"], change["before"]) == ("step", "2019-04-02", "2019-06-11")
    assert "strut 3 became 12 % softer between 2019-04-02 and 2019-06-11 (95 %)" in str(found)

    data = read_measurements("bench_measurements.csv", nist())
    assert data.day.max() == DAYS.max() - DAYS.min() and any("neutral pose" in note for note in data.notes)
    Path("tip.csv").write_text("x_mm,y_mm,z_mm,direction,force_N,stiffness_N_per_mm\n0,0,800,X,1000,40000\n")
    both = read_measurements(["tip.csv", "bench_measurements.csv"], nist())
    assert len(compare(nist(), both, noise=0.05, draws=20).document["loops"]) == 3
    (again,) = tps.reduce("bench_measurements.csv").to_dict()["history"]["struts"][2]["changes"]
    assert again["text"].split(":")[0] == change["text"].split(":")[0]
    with pytest.raises(InputError, match="no reading of the tip"):
        tps.compare("bench_measurements.csv", "nist")


def test_one_sided_records_give_the_sign_of_their_force(tmp_path):
    file = tmp_path / "push.csv"
    file.write_text("strut,force_N,displacement_um\n" + "".join(f"2,{f},{f / 40.0}\n" for f in (0, -500, -1000, 0)))
    (loop,) = tps.reduce(file).to_dict()["loops"]
    assert loop["stiffness_N_per_mm"] == pytest.approx(40_000.0) and loop["force_N"] == -1000.0
    assert loop["lost_motion_um"] is None and loop["loop"] == "strut 2 alone"


@pytest.mark.parametrize(
    ("clock", "loops"),
    [(("09:00", "09:00", "09:00", "14:00", "14:00", "14:00"), 2), (("09:00", "09:01", "09:02", "09:03", "09:04",
                                                                   "09:05"), 1)],
)  # fmt: skip
def test_a_running_clock_is_one_loop_and_two_times_are_two(clock, loops, tmp_path):
    rows = [f"1,2024-03-01T{at},{f},{f / 40.0}" for at, f in zip(clock, (0, 1000, -1000) * 2, strict=True)]
    file = tmp_path / "clock.csv"
    file.write_text("strut,date,force_N,displacement_um\n" + "\n".join(rows) + "\n")
    assert len(tps.reduce(file).to_dict()["loops"]) == loops


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("strut,date,force_N,displacement_um\n1,,0,0\n", "no date"),
        ("strut,date,force_N,displacement_um\n7,2024-03-01,0,0\n", "strut '7'; expected 1 to 6"),
        ("strut,loop,force_N,displacement_um\n1,strut 2 alone,0,0\n", "strut '1'; expected 1 to 6, and no other loop"),
        ("loop,force_N,displacement_um\nspindle,0,0\n", "no column x_mm"),
        ("strut,force_N,displacement_um\n1,100,5\n1,100,5\n", "0 N over a deflection"),
        ("strut,force_N\n1,100\n", "displacement_um is missing"),
    ],
)
def test_wrong_bench_records_are_named(text, message, tmp_path):
    file = tmp_path / "wrong.csv"
    file.write_text(text)
    with pytest.raises((InputError, InputErrors), match=message):
        tps.reduce(file)


# -- tables of stiffnesses ---------------------------------------------------------------------------------------------


def stiffness_table(dates: list[str], values=lambda i: 40_000 + 10 * (i % 7)) -> str:
    rows = [f"{i % 6 + 1},{date},{values(i)}" for i, date in enumerate(d for d in dates for _ in range(6))]
    return "\n".join(["strut,date,stiffness_N_per_mm", *rows]) + "\n"


def test_failed_tests_are_set_aside_and_struts_are_printed(tmp_path):
    """40 of 2,941 rows of a bench stood near zero, and the whole table was refused."""
    file = tmp_path / "bench.csv"
    dates = [f"{2015 + i // 50}-{i % 50 // 5 + 1:02d}-{i % 5 + 1:02d}" for i in range(490)]
    file.write_text(stiffness_table(dates, lambda i: (-3.0, 0, 55)[i % 3] if i % 73 == 5 else 40_000 + 10 * (i % 7)))
    found = tps.reduce(file)
    (note,) = found.notes
    assert (
        note
        == f"{file}: 41 of 2940 rows with a stiffness within 100 N/mm of zero are left out as failed tests, from line 7"
    )
    assert len(found.to_dict()["loops"]) == 2940 - 41
    assert all(
        one["stiffness_N_per_mm"] == pytest.approx(40_030, abs=3) for one in found.to_dict()["history"]["struts"]
    )
    assert len(str(found).splitlines()) < 20 and str(found).count("strut 6 alone") == 1


def test_a_table_near_zero_is_in_another_unit(tmp_path):
    file = tmp_path / "bench.csv"
    file.write_text(stiffness_table(["2021-01-01", "2022-01-01"], lambda i: 40 if i else 40_000))
    with pytest.raises(InputErrors, match=r"bench.csv:3: 11 of 12 rows .* of zero. Is the unit right"):
        tps.reduce(file)
